//! One slab of fluid: the fused collision and streaming step with its halo and boundaries.

mod below_surface;
mod dispatch;
mod force;
mod free_surface;
mod left_out;
mod on_gpu;
mod state;
mod surfaces;
mod two_steps;

pub use dispatch::collides_in_single;
pub use force::Force;
pub use on_gpu::kernel_exists as kernel_exists_on_gpu;

use super::block::RowBlock;
use super::boundary::{Boundaries, FacePart, Frame, Patch, SolidPart, StraightLinks};
use super::collision::Operator;
use super::collision::trt::AntisymmetricRate;
use super::error::FluidError;
use super::feet::{FootLoad, StructureFoot};
use super::gpu::{Device, Gpu};
use super::halo::{Halo, wrap};
use super::initial::{self, Field};
use super::kernel::Shared;
use super::lanes::{Level, Stored};
use super::lattice::VelocitySet;
use super::populations::{Layout, Populations};
use super::saturation::pass::View as CoverView;
use super::saturation::{Cover, SaturationMethod};
use super::surface::SlabSurface;
use super::term::{self, ClosedCells, Term};
use super::turbulence::EddyViscosity;
use super::turbulence::field::{Field as VelocityField, View};
use base::thread_pool;
use below_surface::BelowSurface;
use decomposition::{Communicator, Domain};
use dispatch::{Choice, Step};
use serde::Serialize;
use std::ops::Range;

/// Velocity set, collision operator and eddy viscosity of a fluid: the models for which a pass is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Models {
    /// Velocity set.
    pub lattice: VelocitySet,
    /// Operator of the collisions.
    pub collision: Operator,
    /// Eddy viscosity; none if all scales are resolved.
    pub turbulence: Option<EddyViscosity>,
}

impl Models {
    /// Returns models without an eddy viscosity.
    #[must_use]
    pub fn new(lattice: VelocitySet, collision: Operator) -> Self {
        Self {
            lattice,
            collision,
            turbulence: None,
        }
    }
}

/// Parameters of a slab of fluid, in lattice units.
pub struct Setup<S: Stored = f64> {
    /// Velocity set, operator and eddy viscosity.
    pub models: Models,
    /// Relaxation time τ of the fluid without eddy viscosity, above ½.
    pub relaxation_time: f64,
    /// Body force on the fluid.
    pub force: Force,
    /// Number of cells of the whole domain along x, y, z.
    pub cells: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Patches of the faces; a face without a patch is a no-slip wall.
    pub patches: Vec<Patch<S>>,
    /// Method for cells covered by solids; none if no cell can be covered.
    pub saturation: Option<SaturationMethod>,
    /// `true` if cells collide in f32, for populations in f32 and open cells without eddy viscosity.
    pub single: bool,
    /// Device that computes the fluid.
    pub device: Device,
    /// Vertical axis of a fluid that will have a free surface ([`Fluid::open_surface`]).
    pub surface_axis: Option<usize>,
    /// Additional terms of the step.
    pub terms: Vec<term::TermBuilder<S>>,
}

impl<S: Stored> Setup<S> {
    /// Returns the parameters of a fluid without forces between no-slip walls, which the processor computes.
    #[must_use]
    pub fn new(models: Models, relaxation_time: f64, cells: [usize; 3]) -> Self {
        Self {
            models,
            relaxation_time,
            force: Force::None,
            cells,
            periodic: [false; 3],
            patches: Vec::new(),
            saturation: None,
            single: false,
            device: Device::Cpu,
            surface_axis: None,
            terms: Vec::new(),
        }
    }

    /// Returns the cover of the slab, if cells can be covered.
    fn cover(
        &self,
        populations: &Populations<S>,
        boundaries: &Boundaries<S>,
        threads: usize,
    ) -> Option<Cover> {
        let method = self.saturation?;
        let antisymmetric = self.models.collision.model().antisymmetric_rate();
        let antisymmetric = antisymmetric.unwrap_or(AntisymmetricRate::AsSymmetric);
        let tau = self.relaxation_time;
        let mut cover = Cover::new(populations, method, tau, antisymmetric, threads);
        cover.wall_off(boundaries.behind_walls_at_rest(populations));
        Some(cover)
    }

    /// Logs the slab and the models.
    fn report(
        &self,
        populations: &Populations<S>,
        boundaries: &Boundaries<S>,
        rank: usize,
        threads: usize,
    ) {
        let (cells, numbers) = (populations.cells(), populations.velocities().q());
        log::info!(
            "rank {rank}: lattice {:?} of {} cells, {numbers} numbers of {} bytes each; \
             this slab {cells:?}, {} bytes, {threads} threads",
            self.models.lattice,
            self.cells.iter().product::<usize>(),
            size_of::<S>(),
            cells.iter().product::<usize>() * numbers * size_of::<S>()
        );
        log::debug!(
            "rank {rank}: operator {:?}, relaxation time {}, eddy viscosity {:?}, force {:?}, \
             periodic {:?}, patches {:?}",
            self.models.collision,
            self.relaxation_time,
            self.models.turbulence,
            self.force,
            self.periodic,
            boundaries.names().collect::<Vec<_>>()
        );
    }
}

/// Returns the list of all terms of a slab.
fn terms<'a, S: Stored>(
    force: &'a Force,
    eddies: &'a Option<EddyViscosity>,
    boundaries: &'a Boundaries<S>,
    cover: Option<&'a Cover>,
    closed: Option<&'a ClosedCells>,
    surface: Option<&'a SlabSurface>,
    added: &'a [Box<dyn Term<S>>],
) -> impl Iterator<Item = &'a dyn Term<S>> {
    let built_in: [Option<&'a dyn Term<S>>; 6] = [
        Some(force),
        eddies.as_ref().map(|eddies| eddies as &dyn Term<S>),
        Some(boundaries),
        cover.map(|cover| cover as &dyn Term<S>),
        closed.map(|closed| closed as &dyn Term<S>),
        surface.map(|surface| surface as &dyn Term<S>),
    ];
    let added = added.iter().map(AsRef::as_ref);
    built_in.into_iter().flatten().chain(added)
}

/// Minimum number of cells per thread.
const CELLS_PER_THREAD: usize = 1000;

/// Returns the planes of thread t.
fn planes_of(planes: &Range<usize>, threads: usize, t: usize) -> Range<usize> {
    let begin = |t: usize| planes.start + planes.len() * t / threads;
    begin(t)..begin(t + 1)
}

/// Returns the planes of a thread both of whose neighbours belong to the same thread.
fn inner(share: &Range<usize>) -> Range<usize> {
    let first = share.start + 1;
    first..(share.end - 1).max(first)
}

/// Returns the planes of a slab without following work (see [`Fluid::run_followed`]): all that are not [`inner`]
/// planes of the threads' parts of the planes between its ends.
fn unfollowed(planes: usize, threads: usize) -> impl Iterator<Item = Range<usize>> {
    let followed = move |t: usize| inner(&planes_of(&between(planes), threads, t));
    (0..=threads).map(move |t| {
        let begin = t.checked_sub(1).map_or(0, |t| followed(t).end);
        let end = if t == threads {
            planes
        } else {
            followed(t).start
        };
        begin..end
    })
}

/// Returns the planes between the first and the last.
fn between(planes: usize) -> Range<usize> {
    1..planes.max(2) - 1
}

/// Domain of a fluid and the position of the slab in it.
struct SlabExtent {
    /// Cells of the whole domain.
    cells: [usize; 3],
    /// First cell of the slab.
    start: [usize; 3],
    periodic: [bool; 3],
    /// Axes along which the slab itself is periodic.
    periodic_within: [bool; 3],
    /// Axes in memory on slabs across the longest axis.
    usual_order: [usize; 3],
}

/// One slab of fluid.
pub struct Fluid<S: Stored> {
    /// GPU that computes the steps, if there is one. It uses the memory of the populations and is therefore dropped
    /// first.
    gpu: Option<Gpu>,
    populations: Populations<S>,
    boundaries: Boundaries<S>,
    halo: Halo,
    turbulence: Option<EddyViscosity>,
    /// Velocities from which the eddy viscosity is computed, if there is one.
    field: Option<VelocityField>,
    /// Cover of the cells by solids, if cells can be covered.
    cover: Option<Cover>,
    /// Free surface, if there is one.
    surface: Option<Box<SlabSurface>>,
    /// Two steps in one sweep below the free surface.
    below: Option<Box<BelowSurface>>,
    closed: ClosedCells,
    /// Cells that the pass leaves out, if there are any.
    left_out: Option<Box<left_out::LeftOut>>,
    /// Terms that act before the collision.
    added: Vec<Box<dyn Term<S>>>,
    describe: fn(&mut Populations<S>, View, CoverView, bool) -> Shared<S>,
    pass: Box<dyn Step<S>>,
    relaxation_time: f64,
    force: Force,
    extent: SlabExtent,
    communicator: Communicator,
    threads: usize,
    step: u64,
    /// `true` if the GPU has the same populations.
    shared_with_gpu: bool,
}

impl<S: Stored> Fluid<S> {
    /// Returns stationary fluid in the slab of this rank.
    ///
    /// # Errors
    /// If the memory cannot be allocated, collisions in f32 are requested that this fluid does not have, or a GPU that
    /// does not exist or cannot run this fluid.
    #[inline(never)]
    pub fn new(mut setup: Setup<S>, domain: &Domain) -> Result<Self, FluidError> {
        let split = domain.axis().index();
        let planes = domain.range();
        let mut cells = setup.cells;
        cells[split] = planes.len();
        let mut start = [0; 3];
        start[split] = planes.start;
        let choice = Choice::from_setup(&setup, Level::best());
        let pass = if setup.single {
            let pass = choice.in_single();
            pass.ok_or(FluidError::NoSingle)?
        } else {
            choice.step()
        };
        let describe = match setup.models.lattice {
            VelocitySet::D2Q9 => Shared::new::<9>,
            VelocitySet::D3Q19 => Shared::new::<19>,
            VelocitySet::D3Q27 => Shared::new::<27>,
        };
        let velocities = setup.models.lattice.velocities();
        let order = Layout::order(velocities.dimension, cells, split, setup.surface_axis);
        let usual_order = Layout::usual(velocities.dimension, setup.cells, setup.surface_axis);
        let populations = Populations::with_order(velocities, cells, order)?;
        let patches = std::mem::take(&mut setup.patches);
        let frame = Frame {
            cells: setup.cells,
            start,
            periodic: setup.periodic,
        };
        let field = match setup.models.turbulence {
            None => None,
            Some(_) => Some(VelocityField::new(&populations, &frame, &patches, domain)?),
        };
        let threads = thread_pool::threads();
        // Structures may also cover cells at the faces.
        let mut boundaries = Boundaries::new(&populations, &frame, patches, true);
        boundaries.balance(domain.communicator());
        let cover = setup.cover(&populations, &boundaries, threads);
        let made = setup.terms.iter();
        let added: Vec<Box<dyn Term<S>>> = made.map(|make| make(&populations, start)).collect();
        let all = terms(
            &setup.force,
            &setup.models.turbulence,
            &boundaries,
            cover.as_ref(),
            None,
            None,
            &added,
        );
        let gpu = on_gpu::wanted(
            &setup,
            &populations,
            &boundaries,
            pass.as_ref(),
            (cover.as_ref(), all),
            domain,
        )?;
        let halo = Halo::new(&populations, domain)?;
        let mut periodic_within = setup.periodic;
        periodic_within[split] = false;
        // There is no periodicity along a missing axis.
        periodic_within[populations.velocities().dimension..].fill(false);
        setup.report(&populations, &boundaries, domain.rank(), threads);
        Ok(Self {
            populations,
            boundaries,
            halo,
            turbulence: setup.models.turbulence,
            field,
            cover,
            surface: None,
            below: None,
            closed: ClosedCells::default(),
            left_out: None,
            added,
            describe,
            pass,
            relaxation_time: setup.relaxation_time,
            force: setup.force,
            extent: SlabExtent {
                cells: setup.cells,
                start,
                periodic: setup.periodic,
                periodic_within,
                usual_order,
            },
            communicator: domain.communicator().clone(),
            threads,
            step: 0,
            gpu,
            shared_with_gpu: false,
        })
    }

    /// Sets every cell from a field; the step is unchanged.
    #[inline(never)]
    pub fn initialise(&mut self, field: &dyn Field) {
        let half = self.half_force();
        self.shared_with_gpu = false;
        initial::fill(
            &mut self.populations,
            self.extent.start,
            self.relaxation_time,
            half,
            field,
            self.threads,
        );
        if self.corrects_velocities() {
            let cells: Vec<usize> = self.populations.interior().map(|(_, cell)| cell).collect();
            for cell in cells {
                self.shift_to_velocity(cell, half);
            }
        }
        self.renew_velocities();
    }

    /// Adjusts the momentum of a cell, which contains the uniform force only, so that the velocity is unchanged
    /// with all terms.
    fn shift_to_velocity(&mut self, cell: usize, half: [f64; 3]) {
        let (drho, momentum) = self.populations.moments(cell);
        let u = std::array::from_fn(|a| (momentum[a] + half[a]) / (1.0 + drho));
        let v = self.of_momentum(cell, u);
        for i in 0..self.populations.velocities().q() {
            let velocities = self.populations.velocities();
            let (w, c) = (velocities.w[i], velocities.c[i]);
            let change = initial::equilibrium(w, c, drho, v) - initial::equilibrium(w, c, drho, u);
            let position = self.populations.incoming(cell, i);
            let number = &mut self.populations.numbers_mut()[position];
            *number = S::from_f64(number.to_f64() + change);
        }
    }

    /// Sets a cell to equilibrium.
    pub fn set_equilibrium(&mut self, cell: usize, drho: f64, u: [f64; 3]) {
        let half = self.half_force();
        let u = self.of_momentum(cell, u);
        self.shared_with_gpu = false;
        for i in 0..self.populations.velocities().q() {
            let v = self.populations.velocities();
            let (w, c) = (v.w[i], v.c[i]);
            // The velocity contains half of the force; the incoming momentum does not.
            let odd = (0..3).map(|a| f64::from(c[a]) * half[a]).sum::<f64>();
            let g = initial::equilibrium(w, c, drho, u) - 3.0 * w * odd;
            let position = self.populations.incoming(cell, i);
            self.populations.numbers_mut()[position] = S::from_f64(g);
        }
    }

    /// Returns the values that the openings keep between steps, by patch.
    pub fn memories(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        self.boundaries.memories()
    }

    /// Restores the values that the openings keep between steps, at a restart.
    pub fn recall(&mut self, memories: impl Iterator<Item = Option<f64>>) {
        self.boundaries.recall(memories);
    }

    /// Returns the number of steps that can be made in one call if no code reads the populations between them. It
    /// is equal on every rank.
    #[must_use]
    pub fn at_once(&self) -> u64 {
        if self.gpu.is_some() {
            u64::MAX
        } else if self.may_advance_two() {
            2
        } else {
            1
        }
    }

    /// Makes steps between which no code reads the populations, at most [`Self::at_once`]. A free surface moves in each
    /// of several steps; after a single one [`Self::move_surface`] moves it. Collective.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn advance_many(&mut self, steps: u64) -> Result<(), FluidError> {
        if self.gpu.is_some() {
            return self.advance_on_gpu(steps);
        }
        for _ in 0..steps / 2 {
            self.advance_two();
        }
        for _ in 0..steps % 2 {
            self.advance();
        }
        Ok(())
    }

    /// Makes one step on the processor: collides and streams every cell, exchanges populations, and applies the
    /// boundaries. Afterwards every incoming population of the slab is set, except those at moving bodies, which
    /// the coupling sets.
    #[inline(never)]
    pub fn advance(&mut self) {
        self.shared_with_gpu = false;
        let planes = self.populations.cells()[self.populations.order()[0]];
        let half = self.half_force();
        let force = half.map(|f| 2.0 * f);
        for term in &mut self.added {
            term.act(&mut self.populations, half, self.cover.as_ref());
        }
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let time = (self.step + 1) as f64;
        if planes == 0 {
            // The other ranks wait for the contribution of this rank to the sums.
            let populations = &self.populations;
            self.boundaries
                .measure(populations, time, half, &self.communicator);
            // All ranks agree on the next pass, including those without planes.
            self.populations.flip();
            self.step += 1;
            return;
        }
        self.boundaries.remember(&self.populations, half);
        if let Some(surface) = &mut self.surface {
            let viscosity = (self.relaxation_time - 0.5) / 3.0;
            surface.prepare(&mut self.populations, half, viscosity);
            surface.begin_balance(&self.populations, self.cover.as_ref());
        }
        self.hide_dry(true);
        // The end planes come first: their populations are sent while the interior is updated.
        let shared = self.describe_pass();
        let [_, middle, _] = self.populations.order();
        let round_middle = self.extent.periodic_within[middle];
        self.run_ends(&shared, force);
        if let Some(field) = &mut self.field {
            field.swap();
            field.exchange_start();
        }
        self.populations.flip();
        let reversed = self.populations.parity() == super::populations::Parity::Reversed;
        let last = planes.cast_signed() - 1;
        if reversed && round_middle {
            self.wrap(0..1);
            self.wrap(last..last + 1);
        }
        self.halo.start(&self.populations);
        let ahead = self.below.as_ref().is_some_and(|below| below.is_first());
        let early = ahead || !round_middle && self.boundaries.walls_stand_alone();
        let interior = between(planes);
        if ahead {
            self.run_ahead(&shared, force);
        } else {
            self.run_followed(&shared, force, interior.clone(), early.then_some(time));
        }
        self.hide_dry(false);
        self.halo.finish(&mut self.populations);
        if ahead {
            // The sweep has copied these planes.
        } else if reversed && round_middle {
            self.wrap(1..last);
        } else if round_middle {
            // Ghost planes are included: beyond a free-slip face they contain populations that are mirrored back.
            self.wrap(-1..last + 2);
        }
        self.step += 1;
        let threads = self.workers(&interior);
        self.apply_boundaries(
            time,
            half,
            unfollowed(planes, if early { threads } else { 0 }),
        );
        if let Some(surface) = &mut self.surface {
            surface.clear_gas_populations(&mut self.populations);
        }
        self.complete_velocities(unfollowed(planes, threads));
    }

    /// Returns the data of the next pass.
    fn describe_pass(&mut self) -> Shared<S> {
        let (half, periodic) = (self.half_force(), self.extent.periodic);
        if let Some(cover) = &mut self.cover {
            cover.set_force(half.map(|half| 2.0 * half), periodic);
        }
        let velocity = self.field.as_mut().map_or(View::NONE, |field| field.view());
        let cover = self
            .cover
            .as_mut()
            .map_or(CoverView::NONE, CoverView::from_cover);
        let [.., fast] = self.populations.order();
        let round_rows = self.extent.periodic_within[fast];
        let shared = (self.describe)(&mut self.populations, velocity, cover, round_rows);
        if let Some(surface) = &self.surface {
            let left = self.below.as_ref().and_then(|below| below.left());
            shared.only_wet(left.unwrap_or(surface.planes()))
        } else if let Some(left_out) = &self.left_out
            && !left_out.planes.is_empty()
        {
            shared.only_wet(&left_out.planes)
        } else {
            shared
        }
    }

    /// Applies the boundaries after a pass and closes openings in front of solids. `rest` are the planes whose walls no
    /// thread has applied during the pass.
    fn apply_boundaries(
        &mut self,
        time: f64,
        half: [f64; 3],
        rest: impl Iterator<Item = Range<usize>>,
    ) {
        if let Some(cover) = &self.cover {
            let fraction = |cell: usize, _: [usize; 3]| cover.fraction(cell);
            self.boundaries.cover(true, fraction);
        }
        if !self.closed.is_empty() {
            let fraction = |cell: usize, _: [usize; 3]| self.closed.fraction(cell);
            self.boundaries.cover(false, fraction);
        }
        self.boundaries
            .measure(&self.populations, time, half, &self.communicator);
        self.boundaries
            .apply(&mut self.populations, time, half, rest);
        if let Some(cover) = &self.cover {
            let flat = self.populations.velocities().dimension == 2;
            let solid = |cell: usize, local: [usize; 3]| {
                let at = local.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
                SolidPart {
                    fraction: cover.fraction(cell),
                    velocity: if flat {
                        cover.velocity::<2>(cell, at)
                    } else {
                        cover.velocity::<3>(cell, at)
                    },
                }
            };
            self.boundaries.close_covered(solid, &mut self.populations);
        }
        if !self.closed.is_empty() {
            let solid = |cell: usize, _: [usize; 3]| SolidPart::at_rest(self.closed.fraction(cell));
            self.boundaries.close_covered(solid, &mut self.populations);
        }
    }

    /// Copies populations across the middle axis in the planes of a range that cells with water have written to.
    fn wrap(&mut self, planes: Range<isize>) {
        let surface = self.surface.as_deref();
        let written = |plane: &isize| surface.is_none_or(|surface| surface.writes_to(*plane));
        wrap(&mut self.populations, planes.filter(written));
    }

    /// Passes the cells of the slab that bodies cover to the openings, before a step.
    pub fn cover_openings(&mut self, covered: impl Fn([usize; 3]) -> bool) {
        let fraction = |_: usize, local: [usize; 3]| f64::from(u8::from(covered(local)));
        self.boundaries.cover(true, fraction);
    }

    /// Closes openings at cells of the slab covered by bodies, after a step, so that no water enters a body.
    pub fn close_openings(&mut self, solid: impl Fn([usize; 3]) -> SolidPart + Sync) {
        self.boundaries
            .close_covered(|_, local| solid(local), &mut self.populations);
    }

    /// Fills the ghosts of the velocities that depend on the cells of a range of planes.
    fn complete_velocities(&mut self, planes: impl Iterator<Item = Range<usize>>) {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let time = self.step as f64;
        if let Some(field) = &mut self.field {
            let boundaries = &self.boundaries;
            field.complete(planes, |patch| boundaries.velocity_factor(patch, time));
        }
    }

    /// Sets the velocities for the next eddy viscosity to the present velocities of the cells. Collective.
    pub fn renew_velocities(&mut self) {
        let planes = self.populations.cells()[self.populations.order()[0]];
        if self.field.is_none() || planes == 0 {
            return;
        }
        let cells: Vec<usize> = self.populations.interior().map(|(_, cell)| cell).collect();
        for cell in cells {
            let (_, u) = self.state(cell);
            if let Some(field) = &mut self.field {
                #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
                field.set_velocity(cell, u.map(|x| x as f32));
            }
        }
        self.spread_velocities();
    }

    /// Fills the ghosts of velocities that were set for single cells. Collective.
    #[inline(never)]
    pub fn spread_velocities(&mut self) {
        if let Some(field) = &mut self.field {
            field.exchange_start();
        }
        let planes = self.populations.cells()[self.populations.order()[0]];
        self.complete_velocities(std::iter::once(0..planes));
    }

    /// Returns the velocities for the next eddy viscosity; `None` without a turbulence model.
    #[must_use]
    pub fn velocities(&self) -> Option<&VelocityField> {
        self.field.as_ref()
    }

    /// Returns the velocities for changes at a restart and inside bodies; [`Self::spread_velocities`] must follow.
    pub fn velocities_mut(&mut self) -> Option<&mut VelocityField> {
        self.field.as_mut()
    }

    /// Closes the openings at the cells of structures, given by position.
    pub fn close(&mut self, cells: impl Iterator<Item = usize>) {
        self.closed.close(&self.populations, cells);
    }

    /// Records the links through planes of symmetry that structures cut, by position of the cell and direction: their
    /// loads on the planes are those of the structures.
    pub fn cut_at_planes(&mut self, links: impl Iterator<Item = (u32, u8)>) {
        self.closed.cut_at_planes(links);
    }

    /// Records the links through faces at the feet of structures: the momentum along the axes that lead into
    /// structures is a load on these, not on the face.
    pub fn share_feet(&mut self, links: impl Iterator<Item = ((u32, u8), StructureFoot)>) {
        self.closed.share_feet(links);
    }

    /// Returns the momenta that bodies received in the last step at links through faces, for the coupling to set.
    pub fn feet_of_bodies_mut(&mut self) -> &mut Vec<FootLoad> {
        self.closed.at_bodies_mut()
    }

    /// Returns the links along which a wall or an opening returns a population to the cell that sent one. With a free
    /// surface openings act after structures and are left out.
    #[must_use]
    pub fn straight_links(&self) -> StraightLinks {
        let openings = self.surface.is_none();
        self.boundaries.straight_links(&self.populations, openings)
    }

    /// Returns all terms in addition to collision and streaming.
    pub fn terms(&self) -> impl Iterator<Item = &dyn Term<S>> {
        terms(
            &self.force,
            &self.turbulence,
            &self.boundaries,
            self.cover.as_ref(),
            Some(&self.closed),
            self.surface.as_deref(),
            &self.added,
        )
    }

    /// Returns the eddy viscosity of an interior cell in lattice units for the next collision; 0 without a
    /// turbulence model.
    #[must_use]
    pub fn eddy_viscosity(&self, cell: usize) -> f64 {
        let Some(field) = &self.field else { return 0.0 };
        self.turbulence
            .map_or(0.0, |model| model.viscosity(&field.gradient(cell)))
    }

    /// Returns the number of threads for a range of planes.
    fn workers(&self, planes: &Range<usize>) -> usize {
        self.threads.min(planes.len())
    }

    /// Collides and streams a range of planes, divided among threads.
    fn run(&self, shared: &Shared<S>, force: [f64; 3], planes: Range<usize>) {
        let threads = self.workers(&planes);
        if threads <= 1 {
            // SAFETY: there is only one worker.
            unsafe { self.pass.pass(shared, force, &shared.planes(planes), 0) };
            return;
        }
        thread_pool::each(threads, |t| {
            let cells = shared.planes(planes_of(&planes, threads, t));
            // SAFETY: the parts of the planes are disjoint, and each worker has one.
            unsafe { self.pass.pass(shared, force, &cells, t) };
        });
    }

    /// Collides and streams the first and the last plane, with the rows of both divided among threads.
    fn run_ends(&self, shared: &Shared<S>, force: [f64; 3]) {
        let planes = self.populations.cells()[self.populations.order()[0]];
        let rows = shared.rows();
        let all = if planes > 1 { 2 * rows } else { rows };
        let threads = self
            .threads
            .min(all * shared.cells() / CELLS_PER_THREAD)
            .max(1);
        thread_pool::each(threads, |t| {
            let mine = planes_of(&(0..all), threads, t);
            for (plane, first) in [(0, 0), (planes - 1, rows)] {
                let part = |row: usize| row.clamp(first, first + rows) - first;
                let cells = RowBlock {
                    planes: plane..plane + 1,
                    rows: part(mine.start)..part(mine.end),
                };
                // SAFETY: the parts of the rows are disjoint, and each worker has one.
                unsafe { self.pass.pass(shared, force, &cells, t) };
            }
        });
    }

    /// Collides and streams like [`Self::run`]. Values that depend on the cells of the [`inner`] planes of each
    /// thread are computed as soon as the adjacent planes are done, while their numbers are in the cache:
    /// velocities for the eddy viscosity beyond faces, and walls, if `walls` contains the time of the step. A
    /// separate loop over the walls of a cube of 200³ cells costs an eighth of the pass.
    fn run_followed(
        &self,
        shared: &Shared<S>,
        force: [f64; 3],
        planes: Range<usize>,
        walls: Option<f64>,
    ) {
        if planes.is_empty() {
            return;
        }
        let ghosts = self.field.as_ref().map(VelocityField::ghosts);
        if walls.is_none() && ghosts.is_none() {
            return self.run(shared, force, planes);
        }
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let time = (self.step + 1) as f64;
        let threads = self.workers(&planes);
        let parity = self.populations.parity();
        let (pass, boundaries) = (&self.pass, &self.boundaries);
        thread_pool::each(threads, |t| {
            let share = planes_of(&planes, threads, t);
            let followed = inner(&share);
            for plane in share {
                // SAFETY: the parts of the planes are disjoint, and each worker has one.
                unsafe { pass.pass(shared, force, &shared.planes(plane..plane + 1), t) };
                if !followed.contains(&(plane - 1)) {
                    continue;
                }
                let cells = shared.planes(plane - 1..plane);
                if walls.is_some() {
                    // SAFETY: the planes on both sides belong to this worker and are done.
                    unsafe { boundaries.give_walls(&cells, time, parity, shared.numbers()) };
                }
                if let Some(ghosts) = &ghosts {
                    let ramp = |patch| boundaries.velocity_factor(patch, time);
                    // SAFETY: as above.
                    unsafe { ghosts.follow(&cells, shared.velocity(), ramp) };
                }
            }
        });
    }

    /// Returns the boundaries, whose patches are in the order of [`Fluid::fluxes`].
    #[must_use]
    pub fn boundaries(&self) -> &Boundaries<S> {
        &self.boundaries
    }

    /// Returns the cover of the cells, if cells can be covered.
    #[must_use]
    pub fn cover(&self) -> Option<&Cover> {
        self.cover.as_ref()
    }

    /// Returns the cover of the cells, for the coupling.
    pub fn cover_mut(&mut self) -> Option<&mut Cover> {
        self.cover.as_mut()
    }

    /// Returns the populations of the slab.
    #[must_use]
    pub fn populations(&self) -> &Populations<S> {
        &self.populations
    }

    /// Returns the populations of the slab, for the coupling and for restarts.
    pub fn populations_mut(&mut self) -> &mut Populations<S> {
        self.shared_with_gpu = false;
        &mut self.populations
    }

    /// Returns the number of steps done.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Sets the number of steps after a restart; the populations must have been set.
    pub fn set_steps(&mut self, step: u64) {
        self.step = step;
        self.shared_with_gpu = false;
        self.populations.set_home();
    }

    /// Returns `true` for each end of an axis at which flow and bodies continue as their mirror images.
    #[must_use]
    pub fn planes_of_symmetry(&self) -> [[bool; 2]; 3] {
        let mut planes = self.boundaries.planes_of_symmetry(self.extent.cells);
        for (plane, periodic) in planes.iter_mut().zip(self.periodic()) {
            if periodic {
                *plane = [false; 2];
            }
        }
        planes
    }

    /// Returns the parts of the faces of the domain, with the velocities of walls in the next step.
    pub fn face_parts(&self) -> impl Iterator<Item = FacePart> + '_ {
        self.boundaries.face_parts((self.step + 1) as f64)
    }

    /// Returns the axes from slowest to fastest in memory if the slabs are cut across the longest axis. It is a
    /// function of the domain, whereas [`Populations::order`] follows the slabs.
    #[must_use]
    pub fn usual_order(&self) -> [usize; 3] {
        self.extent.usual_order
    }

    /// Returns the number of cells of the whole domain.
    #[must_use]
    pub fn domain_cells(&self) -> [usize; 3] {
        self.extent.cells
    }

    /// Returns the first cell of the slab.
    #[must_use]
    pub fn start(&self) -> [usize; 3] {
        self.extent.start
    }

    /// Returns the periodic axes.
    #[must_use]
    pub fn periodic(&self) -> [bool; 3] {
        self.extent.periodic
    }
}

#[cfg(test)]
mod tests;
