//! Steps on a GPU ([`crate::gpu`]).

use super::dispatch::{Choice, Step};
use super::{Fluid, Models, Setup};
use crate::boundary::Boundaries;
use crate::error::FluidError;
use crate::extremes::Extremes;
use crate::gpu::program::Program;
use crate::gpu::{Device, Gpu};
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::saturation::Cover;
use crate::term::Term;
use base::number::{single, to_u32};
use decomposition::Domain;

/// Name of a missing kernel in a message.
const KERNEL: &str = "this velocity set, collision operator, force and storage";

/// Returns `true` if there are kernels for these models, for a storage named as in [`Stored::NAME`], with a body force,
/// and with cells that solids may cover.
#[must_use]
pub fn kernel_exists(models: Models, stored: &str, [forced, covered]: [bool; 2]) -> bool {
    let step = Choice::on_any(models, forced, covered).step::<f64>();
    step.kernel_on_gpu()
        .is_some_and(|kernel| kernel.exists(stored))
}

/// Returns the GPU that the setup asks for, with the data of a slab; none for the processor, also where a choice is
/// left and no GPU runs this fluid.
///
/// # Errors
/// If the setup demands a GPU that does not support this fluid or reports an error.
pub(super) fn wanted<'a, S: Stored>(
    setup: &Setup<S>,
    populations: &Populations<S>,
    boundaries: &Boundaries<S>,
    step: &dyn Step<S>,
    solids_and_terms: (Option<&Cover>, impl Iterator<Item = &'a dyn Term<S>>),
    domain: &Domain,
) -> Result<Option<Gpu>, FluidError> {
    if setup.device == Device::Cpu {
        return Ok(None);
    }
    let started = start(
        setup,
        populations,
        boundaries,
        step,
        solids_and_terms,
        domain,
    );
    match started {
        Err(why) if setup.device == Device::Auto => {
            log::info!("the fluid runs on the processor: {why}");
            Ok(None)
        }
        started => started.map(Some),
    }
}

/// Returns a GPU with the data of a slab.
///
/// # Errors
/// If a GPU does not support this fluid, or reports an error.
fn start<'a, S: Stored>(
    setup: &Setup<S>,
    populations: &Populations<S>,
    boundaries: &Boundaries<S>,
    step: &dyn Step<S>,
    (cover, mut terms): (Option<&Cover>, impl Iterator<Item = &'a dyn Term<S>>),
    domain: &Domain,
) -> Result<Gpu, FluidError> {
    let refuse = |what: &str| Err(FluidError::NotOnGpu(what.to_owned()));
    if domain.communicator().size() > 1 {
        return refuse("a fluid on several ranks");
    }
    if let Some(term) = terms.find(|term| !term.runs_on_gpu()) {
        return refuse(term.name());
    }
    let kernel = step.kernel_on_gpu();
    let Some(kernel) = kernel.filter(|kernel| kernel.exists(S::NAME)) else {
        return refuse(KERNEL);
    };
    let program = Program::new(populations, boundaries, setup.periodic);
    let numbers = populations.numbers().len();
    // SAFETY: a fluid has one cover, which is dropped after the GPU.
    unsafe { Gpu::new::<S>(&kernel, program, numbers, cover, boundaries.count()) }
}

impl<S: Stored> Fluid<S> {
    /// Makes steps on the GPU, where the populations remain until [`Self::fetch`].
    pub(super) fn advance_on_gpu(&mut self, steps: u64) -> Result<(), FluidError> {
        let Some(gpu) = &mut self.gpu else {
            return Ok(());
        };
        if !self.shared_with_gpu {
            // SAFETY: these are the only populations of this fluid, which are dropped after the GPU.
            unsafe { gpu.give(self.populations.numbers())? };
            self.shared_with_gpu = true;
        }
        self.populations.set_on_device(true);
        for _ in 0..steps {
            #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
            let (now, then) = (self.step as f64, (self.step + 1) as f64);
            if let Some(cover) = &mut self.cover {
                cover.set_force(self.force.force_at(now), self.extent.periodic);
                gpu.send_cover(cover)?;
                gpu.clear_loads(cover)?;
            }
            let before = self.populations.parity();
            self.pass
                .pass_on_gpu(gpu, before, self.force.force_at(now))?;
            let boundaries = &self.boundaries;
            gpu.copy(before, |patch| boundaries.velocity_factor(patch, then))?;
            if let Some(cover) = &mut self.cover {
                gpu.take_loads(cover)?;
            }
            self.populations.flip();
            self.step += 1;
        }
        if self.cover.is_some() {
            // The bodies move while the open cells collide.
            return Ok(());
        }
        gpu.wait()
    }

    /// Returns `true` if a GPU has the populations and computes the cover of the cells, so that the host need not
    /// do so.
    #[must_use]
    pub fn covers_on_gpu(&self) -> bool {
        self.gpu.is_some()
            && self.is_away()
            && self
                .cover
                .as_ref()
                .is_some_and(|cover| cover.balls().is_some())
    }

    /// Sends the new cover of the cells by bodies to a GPU.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn send_cover(&mut self) -> Result<(), FluidError> {
        match (&mut self.gpu, &mut self.cover) {
            (Some(gpu), Some(cover)) if self.populations.are_on_device() => gpu.send_cover(cover),
            _ => Ok(()),
        }
    }

    /// Computes the fraction of each cell of a row covered by bodies, from a position on, like [`Cover::fraction`];
    /// 0 if no cell can be covered.
    pub fn row_fractions(&self, first: usize, fractions: &mut [f32]) {
        match (&self.gpu, &self.cover) {
            (Some(gpu), Some(_)) if self.covers_on_gpu() => {
                if let Err(error) = gpu.fractions(first, fractions) {
                    log::error!("{error}");
                }
                fractions.iter_mut().for_each(|part| *part = part.min(1.0));
            }
            (_, Some(cover)) => {
                for (fraction, position) in fractions.iter_mut().zip(first..) {
                    *fraction = single(cover.fraction(position));
                }
            }
            (_, None) => {
                for (fraction, position) in fractions.iter_mut().zip(first..) {
                    *fraction = f32::from(u8::from(!self.holds_water(position)));
                }
            }
        }
    }

    /// Returns `true` if the populations are on a GPU.
    #[must_use]
    pub fn is_away(&self) -> bool {
        self.populations.are_on_device()
    }

    /// Copies the populations back from a GPU, if they are there.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn fetch(&mut self) -> Result<(), FluidError> {
        if let Some(gpu) = &self.gpu
            && self.populations.are_on_device()
        {
            self.populations.set_on_device(false);
            gpu.take(self.populations.numbers_mut())?;
        }
        Ok(())
    }

    /// Returns the extreme values of all rows if the populations are on a GPU, in the order of [`Populations::rows`];
    /// `None` if they are on the host. The list is empty if the GPU fails, which is reported in the next step.
    pub(crate) fn extremes_on_gpu(&self) -> Option<Vec<Extremes>> {
        let gpu = self
            .gpu
            .as_ref()
            .filter(|_| self.populations.are_on_device())?;
        let found = gpu.extremes(self.populations.parity(), self.half_force());
        let found = found.unwrap_or_else(|error| {
            log::error!("{error}");
            Vec::new()
        });
        let rows = found.into_iter();
        Some(
            rows.map(|row| Extremes {
                squared_speed: row.squared_speed,
                compression: row.compression,
                finite: row.finite,
            })
            .collect(),
        )
    }

    /// Computes the moments of a row of cells at a plane and a row of the slab, like [`Populations::row_moments`],
    /// on the host or the GPU.
    pub fn row_moments(&self, [plane, row]: [usize; 2], moments: &mut [Vec<f64>; 4]) {
        let [slow, middle, fast] = self.populations.order();
        match &self.gpu {
            Some(gpu) if self.populations.are_on_device() => {
                let (parity, at) = (self.populations.parity(), [to_u32(plane), to_u32(row)]);
                if let Err(error) = gpu.row_moments(parity, at, moments) {
                    log::error!("{error}");
                }
            }
            _ => {
                let mut at = [0; 3];
                (at[slow], at[middle]) = (plane, row);
                let first = self.populations.interior_cell(at);
                let length = self.populations.cells()[fast];
                self.populations.row_moments(first, length, moments);
            }
        }
    }
}
