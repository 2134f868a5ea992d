//! Selection of the pass, made once at the start, by operator, force, eddy viscosity, solids, velocity set, storage
//! precision and processor.

mod single;

pub use single::collides_in_single;

use super::{Models, Setup};
use crate::block::RowBlock;
use crate::collision::{Collision, Dispatch, Kernels};
use crate::error::FluidError;
use crate::fluid::force::Force;
#[cfg(test)]
use crate::gpu::program::Program;
use crate::gpu::{Gpu, Kernel};
use crate::kernel::{Pass, Shared, Update, choose};
use crate::lanes::{Level, Stored};
use crate::lattice::{D2Q9, D3Q19, D3Q27, Lattice, VelocitySet};
use crate::populations::Parity;
#[cfg(test)]
use crate::saturation::pass::View;
use crate::saturation::{Covered, Open, Solids};
use crate::turbulence::{Eddies, Resolved};
use std::marker::PhantomData;

/// Pass with a selected operator, force and eddy viscosity.
pub(super) trait Step<S: Stored>: Send + Sync {
    /// Collides and streams the cells of a block on one worker; `force` is the force in this step.
    ///
    /// # Safety
    /// The slab must have these cells; no other thread may work on them or be the same worker.
    unsafe fn pass(&self, shared: &Shared<S>, force: [f64; 3], block: &RowBlock, worker: usize);

    /// Returns the equivalent kernel of a GPU, or `None`.
    fn kernel_on_gpu(&self) -> Option<Kernel>;

    /// Starts the pass over all cells on a GPU with this kernel, for populations after a pass of this parity.
    ///
    /// # Errors
    /// If the GPU fails.
    fn pass_on_gpu(&self, gpu: &mut Gpu, before: Parity, force: [f64; 3])
    -> Result<(), FluidError>;

    /// Computes the pass of a GPU on the host, cell by cell.
    ///
    /// # Safety
    /// The numbers must be those of the slab of the program.
    #[cfg(test)]
    unsafe fn pass_as_gpu(
        &self,
        numbers: *mut S,
        program: (&Program, Parity),
        view: &View,
        force: [f64; 3],
    );
}

/// Pass function with the operator as a function of the force.
struct Chosen<S: Stored, C, T, F> {
    pass: Pass<S, C, T>,
    operator: F,
    eddies: T,
    viscosity: f64,
    /// Name of the velocity set for cells without eddy viscosity, and `true` if solids may cover cells.
    without_eddies: Option<&'static str>,
    covered: bool,
    #[cfg(test)]
    cells: CellByCell<S, C>,
}

/// See [`cell_by_cell`].
#[cfg(test)]
type CellByCell<S, C> = unsafe fn(*mut S, (&Program, Parity), Option<(&View, f64)>, C);

/// Computes the pass over all cells, one by one, with the functions of the GPU kernels.
///
/// # Safety
/// The numbers must be those of the slab of the program, and the view that of its cover.
#[cfg(test)]
unsafe fn cell_by_cell<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    (program, before): (&Program, Parity),
    cover: Option<(&View, f64)>,
    operator: C,
) {
    use crate::gpu::cell::{CellIndex, collide};
    use crate::gpu::covered::{collide_open, fill, kind, mix};
    let [planes, rows, length] = program.cells;
    let slab = &program.after(before).slab;
    let kernel = (&operator, &operator.uniform::<f64>());
    // Reverse order: the result must not depend on the order.
    let places = (0..planes * rows * length).rev().map(|n| CellIndex {
        plane: n / (rows * length),
        row: n / length % rows,
        column: n % length,
    });
    for place in places {
        // SAFETY: promised by the caller.
        unsafe {
            match cover {
                None => collide::<L, C, S, true, Q>(numbers, slab, place, kernel.0, kernel.1),
                Some((view, omega)) => {
                    let of_worker = view.sums_of(0);
                    match kind(slab, place, view) {
                        [_, true] => fill::<L, S, Q>(numbers, slab, place, (view, of_worker)),
                        [true, _] => {
                            let site = (view, of_worker, omega);
                            mix::<L, C, S, Q>(numbers, slab, place, kernel, site);
                        }
                        _ => collide_open::<L, C, S, Q>(numbers, slab, place, kernel, view),
                    }
                }
            }
        }
    }
}

impl<S, C, T, F> Step<S> for Chosen<S, C, T, F>
where
    S: Stored,
    C: Collision,
    T: Eddies,
    F: Fn([f64; 3]) -> C + Send + Sync,
{
    unsafe fn pass(&self, shared: &Shared<S>, force: [f64; 3], block: &RowBlock, worker: usize) {
        let update = Update {
            collision: (self.operator)(force),
            eddies: self.eddies,
            viscosity: self.viscosity,
            worker,
        };
        // SAFETY: the caller ensures the cells; the instruction set is one of the processor's.
        unsafe { (self.pass)(shared, &update, block) };
    }

    fn kernel_on_gpu(&self) -> Option<Kernel> {
        let (operator, set) = (C::ON_GPU?, self.without_eddies?);
        let operator = if self.covered {
            operator.strip_prefix("forced_")?
        } else {
            operator
        };
        let covered = self.covered;
        Some(Kernel {
            operator,
            set,
            covered,
        })
    }

    fn pass_on_gpu(
        &self,
        gpu: &mut Gpu,
        before: Parity,
        force: [f64; 3],
    ) -> Result<(), FluidError> {
        gpu.pass(before, (self.operator)(force), self.viscosity)
    }

    #[cfg(test)]
    unsafe fn pass_as_gpu(
        &self,
        numbers: *mut S,
        program: (&Program, Parity),
        view: &View,
        force: [f64; 3],
    ) {
        let omega = 1.0 / 3.0_f64.mul_add(self.viscosity, 0.5);
        let view = self.covered.then_some((view, omega));
        // SAFETY: forwarded from the caller.
        unsafe { (self.cells)(numbers, program, view, (self.operator)(force)) };
    }
}

/// Run-time parameters that select a pass, in addition to the types.
#[derive(Clone, Copy)]
pub(super) struct Choice {
    models: Models,
    relaxation_time: f64,
    forced: bool,
    covered: bool,
    level: Level,
}

impl Choice {
    pub(super) fn from_setup<S: Stored>(setup: &Setup<S>, level: Level) -> Self {
        Self {
            models: setup.models,
            relaxation_time: setup.relaxation_time,
            forced: setup.force != Force::None,
            covered: setup.saturation.is_some(),
            level,
        }
    }

    /// Returns the choice for any processor.
    pub(super) fn on_any(models: Models, forced: bool, covered: bool) -> Self {
        Self {
            models,
            relaxation_time: 1.0,
            forced,
            covered,
            level: Level::Scalar,
        }
    }

    /// Returns the pass.
    pub(super) fn step<S: Stored>(self) -> Box<dyn Step<S>> {
        let operator = self.models.collision;
        match self.models.lattice {
            VelocitySet::D2Q9 => operator.dispatch(ForVelocitySet::<D2Q9, S, 9>::new(self)),
            VelocitySet::D3Q19 => operator.dispatch(ForVelocitySet::<D3Q19, S, 19>::new(self)),
            VelocitySet::D3Q27 => operator.dispatch(ForVelocitySet::<D3Q27, S, 27>::new(self)),
        }
    }

    fn pass<L: Lattice<Q>, K: Kernels, S: Stored, const Q: usize>(
        self,
        kernels: K,
    ) -> Box<dyn Step<S>> {
        let omega = 1.0 / self.relaxation_time;
        let eddies = self.models.turbulence;
        if self.covered {
            let kernel = move |force| kernels.covered(omega, force);
            self.boxed::<L, _, _, Covered, S, Q>(kernel, eddies)
        } else if eddies.is_some() {
            let kernel = move |force| kernels.local(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, eddies)
        } else if self.forced {
            let kernel = move |force| kernels.uniform::<true>(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, Resolved)
        } else {
            let kernel = move |force| kernels.uniform::<false>(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, Resolved)
        }
    }

    fn boxed<L, C, T, P, S, const Q: usize>(
        self,
        operator: impl Fn([f64; 3]) -> C + Send + Sync + 'static,
        eddies: T,
    ) -> Box<dyn Step<S>>
    where
        L: Lattice<Q>,
        C: Collision + 'static,
        T: Eddies,
        P: Solids,
        S: Stored,
    {
        Box::new(Chosen {
            pass: choose::<L, C, T, P, S, Q>(self.level),
            operator,
            eddies,
            viscosity: (self.relaxation_time - 0.5) / 3.0,
            without_eddies: (!T::ACTIVE || !eddies.present()).then_some(L::NAME),
            covered: P::ACTIVE,
            #[cfg(test)]
            cells: cell_by_cell::<L, C, S, Q>,
        })
    }
}

/// Choice for a given velocity set.
struct ForVelocitySet<L, S, const Q: usize> {
    choice: Choice,
    types: PhantomData<(L, S)>,
}

impl<L: Lattice<Q>, S: Stored, const Q: usize> ForVelocitySet<L, S, Q> {
    fn new(choice: Choice) -> Self {
        let types = PhantomData;
        Self { choice, types }
    }
}

impl<L: Lattice<Q>, S: Stored, const Q: usize> Dispatch for ForVelocitySet<L, S, Q> {
    type Output = Box<dyn Step<S>>;

    fn on_any_set<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.pass::<L, K, S, Q>(kernels)
    }

    /// Moments are those of D3Q27 for any velocity set.
    fn on_d3q27<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.pass::<D3Q27, K, S, 27>(kernels)
    }
}
