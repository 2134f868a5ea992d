//! Free surface of water: volume of fluid on the lattice.
//!
//! A cell is liquid, gas, or an interface cell that the surface passes (C. Körner, M. Thies, T. Hofmann, N. Thürey,
//! U. Rüde, J. Stat. Phys. 121 (2005) 179). An interface cell has a mass m and a fill level ε = m/ρ. Gas has no
//! dynamics; its pressure is the datum, zero. A step is that of water without a surface
//! ([`super::fluid::Fluid::advance`]) with the following work before and after it:
//!
//! | time | work | data of other cells |
//! |---|---|---|
//! | before the pass | surface in interface cells, state of carried cells | fill levels, moments of liquid |
//! | pass | omits vectors of cells without water | |
//! | after boundaries and structures | links of carried cells ([`carried`]) | surface in carried cells |
//! | | mass, reconstruction ([`exchange`]) | kinds, fill levels, density of liquid |
//! | | conversions, excess mass ([`conversion`]) | kinds, three times; moments next to new interface cells |
//!
//! The surface acts in place, on the numbers of a link as stored after the last pass ([`super::populations`]): for
//! each link of an interface cell, the outgoing and the incoming population are the same two numbers after an even
//! and an odd pass. The population from the gas is
//!
//! f_ī(x, t+1) = 2 f⁺ - f*_i(x, t),
//!
//! with f⁺ from the traction of the water half-way between the two cells; no other population is reconstructed. In
//! the scheme of Körner et al. f⁺ is that of the pressure of the gas there, which is of the first order in space
//! (S. Bogner, R. Ammer, U. Rüde, J. Comput. Phys. 297 (2015) 1): the surface lies up to half a cell away, the
//! empty part of an interface cell has inertia, and half of the viscous stress acts at a wrong position. Here the
//! traction (pressure and viscous stress) is extrapolated from the liquid cell inside through zero at the surface
//! at the middle of the step ([`facet`]). A cell whose centre lies outside the water is carried by the liquid cell
//! inside ([`carried`]) where the flow is smooth.
//!
//! A standing wave of 40 cells then has its frequency within 0.5 % and its damping within 5 % of those of linear
//! viscous theory at relaxation times from 0.51 to 0.53 and depths of 0.2 to 0.5 wave lengths, and both errors
//! decrease with the square of the cell size. At 0.55 the frequency is up to 1.2 % low. Below 0.51 the wave of 40
//! cells gains up to 2 % of its amplitude in a period.
//!
//! **The same bits on any number of ranks and threads.** Every cell computes its own values, in the order of the
//! directions, from cells that do not change in the same phase. Ghost cells contain the kinds and values of the
//! cells that they copy ([`ghosts`]).
//!
//! **Mass.** The mass that one cell gives along a link equals, bit by bit, that which the other one receives. A
//! cell that becomes liquid or gas distributes its excess mass among the neighbouring interface cells, which
//! receive it in the next step. Without such neighbours the mass is lost and counted: drops of one cell, and
//! pockets of air that close.
//!
//! Cells without water have no defined populations: outputs, checkpoints and hashes use zeros there.
//!
//! | file | content |
//! |---|---|
//! | `kind` | kinds of cells |
//! | `cells` | kind, mass and fill level of the cells of a slab |
//! | `lists` | interface cells and wet parts of rows, by plane |
//! | `depths` | parts of rows far from the surface, for two steps in one sweep |
//! | `batch` | interface cells that are computed together |
//! | `positions` | positions of the cells of a batch, and reads from all of them |
//! | `ghosts` | state of the cells outside the slab |
//! | `moments` | density, velocity and stress of a cell |
//! | `momentum` | momentum of a step, for its balance |
//! | `cut` | plane that intersects a cell |
//! | `facet` | surface in an interface cell, and the traction on its links |
//! | `facets` | facets of a batch of interface cells |
//! | `film` | films on walls |
//! | `bodies` | bodies that fill cells in part or completely |
//! | `carrier` | part of a facet required by the links of other cells |
//! | `carried` | cells whose centres lie outside the water |
//! | `exchange` | exchange of mass and reconstruction |
//! | `friction` | friction of films of less than one cell |
//! | `conversion` | conversions between kinds |
//! | `strips` | exchange of values with the neighbours, next to the surface |
//! | `stencil` | numbers and neighbours of a cell at fixed distances |
//! | `opening` | openings: inflow and outflow |
//! | `tension` | surface tension with a contact angle |

mod batch;
pub(crate) mod bodies;
mod carried;
mod carrier;
pub(crate) mod cells;
mod conversion;
mod cut;
pub(crate) mod depths;
mod exchange;
mod facet;
mod facets;
mod film;
mod friction;
mod ghosts;
mod jump;
pub mod kind;
pub(crate) mod lists;
mod moments;
mod momentum;
mod opening;
mod positions;
mod stencil;
mod strips;
mod tension;

pub use ghosts::Ends;
use momentum::Left;
pub use momentum::StepMomentum;
pub(crate) use opening::Opening;
pub use opening::{Outside, Passed, UpAxis};
pub use tension::SurfaceTension;

use super::lanes::Stored;
use super::lattice::Velocities;
use super::populations::{Link, Populations};
use super::quanta::{from_quanta, quanta};
use batch::Batch;
use bodies::Bodies;
use cells::Cells;
use decomposition::{Communicator, Domain};
use facet::Drive;
use friction::Films;
use ghosts::Ghosts;
use jump::{CapillaryJump, NoJump};
use kind::{ENCLOSED, GAS, HELD, LIQUID, SOLID, STRAY, SURFACE, is_surface, is_wet};
use lists::Plane;
use std::collections::HashSet;
use stencil::with_set;
use tension::SlabTension;

/// Distance of a fill level from 0 or 1 below which a cell is empty or full at the start.
const ROUND: f64 = 1e-9;

/// Kind, mass and undistributed excess of a cell in a checkpoint.
pub type SavedCell = [f64; 3];

/// Free surface of one slab.
pub struct SlabSurface {
    cells: Cells,
    planes: Vec<Plane>,
    batches: Vec<Batch>,
    ghosts: Ghosts,
    /// Conditions of films of less than one cell.
    films: Films,
    work: conversion::Work,
    /// Cells and directions of links that a symmetry plane reflects into a solid: they bounce back. Links through
    /// openings are not included.
    corners: Vec<(u32, u8)>,
    /// Bodies in the cells; none for water without bodies.
    bodies: Option<Box<Bodies>>,
    /// `true` after a restart, until bodies are known.
    restored: bool,
    /// `true` between the step and the update of the bodies, which also changes cells: lists and fill levels are then
    /// those before the step.
    unsettled: bool,
    /// Carried ghost cells of a step; a reusable buffer.
    beyond: Vec<(usize, carrier::Carrier)>,
    /// Mass on this rank that could not be distributed, in quanta.
    lost: i128,
    openings: Vec<Opening>,
    /// Surface tension, if there is one.
    tension: Option<Box<SlabTension>>,
    /// Dry cells of a step next to water outside an opening; a reusable buffer.
    fed: Vec<conversion::FedCell>,
    /// Cells of gas with the velocities of the water next to them; the list keeps its memory.
    shore: Vec<(usize, [f32; 3])>,
    /// Momentum of the step; none if no balance is due.
    balance: Option<StepMomentum>,
    /// Ghost cells whose populations planes of symmetry mirror into cells of the slab, and those of them that were gas
    /// in the last step.
    mirrored: Vec<u32>,
    unsent: Vec<u32>,
}

impl SlabSurface {
    /// Returns the surface of a slab of gas. `half_force` is F/2 at the start. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        ends: Ends,
        half_force: [f64; 3],
        domain: &Domain,
    ) -> Result<Self, String> {
        let ghosts = Ghosts::new(populations, ends, domain)?;
        let planes = populations.cells()[populations.order()[0]];
        Ok(Self {
            cells: Cells::new(populations),
            planes: (0..planes).map(|_| Plane::default()).collect(),
            batches: Vec::new(),
            ghosts,
            films: Films::new(half_force),
            work: conversion::Work::default(),
            corners: Vec::new(),
            bodies: None,
            restored: false,
            unsettled: false,
            beyond: Vec::new(),
            lost: 0,
            openings: Vec::new(),
            tension: None,
            fed: Vec::new(),
            shore: Vec::new(),
            balance: None,
            mirrored: Vec::new(),
            unsent: Vec::new(),
        })
    }

    /// Sets the cells and ghost cells whose populations planes of symmetry mirror into cells of the slab.
    pub(crate) fn set_mirrored(&mut self, cells: impl Iterator<Item = u32>) {
        self.mirrored = cells
            .filter(|cell| self.ghosts.holds(*cell as usize))
            .collect();
        self.mirrored.sort_unstable();
        self.mirrored.dedup();
    }

    /// Sets the links to faces at rest, by cell and direction.
    pub(crate) fn set_walls(&mut self, walls: HashSet<(u32, u8)>) {
        self.films.set_walls(walls);
    }

    /// Adds surface tension. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn add_tension<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        ends: Ends,
        domain: &Domain,
        settings: SurfaceTension,
    ) -> Result<(), String> {
        let tension = SlabTension::new(populations, ends, domain, settings)?;
        self.tension = Some(Box::new(tension));
        Ok(())
    }

    /// Makes cells solid, given by position, including ghost cells.
    pub fn make_solid(&mut self, solid: impl Iterator<Item = usize>) {
        for cell in solid {
            self.cells.kind[cell] = SOLID;
        }
    }

    /// Closes the link of a cell along a direction that a sheet intersects.
    pub fn cut(&mut self, cell: usize, direction: usize) {
        self.cells.close(cell, direction);
    }

    /// Fills the cells at the start; `fill` returns the fill level of a cell from its indices in the slab.
    /// Collective.
    pub fn begin<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        fill: impl Fn([usize; 3]) -> f64,
    ) {
        let all: Vec<_> = populations.interior().collect();
        for &(at, cell) in &all {
            if self.cells.kind[cell] == SOLID {
                continue;
            }
            let level = fill(at);
            let (density, _) = populations.moments(cell);
            let mass = level * (1.0 + density);
            let (kind, mass) = if level >= 1.0 - ROUND {
                (LIQUID, 0.0)
            } else if level <= ROUND {
                (GAS, 0.0)
            } else {
                (SURFACE, mass)
            };
            self.cells.kind[cell] = kind;
            self.cells.mass[cell] = mass;
        }
        self.spread_kinds();
        let open = |cells: &Cells, cell: usize| {
            cells.kind[cell] == LIQUID && cells.count_neighbours(cell, |kind| kind == GAS) > 0
        };
        let shore: Vec<usize> = (all.iter().map(|(_, cell)| *cell))
            .filter(|&cell| open(&self.cells, cell))
            .collect();
        for cell in shore {
            self.cells.kind[cell] = SURFACE;
            self.cells.mass[cell] = 1.0 + populations.moments(cell).0;
        }
        self.settle(populations, false);
        self.list_corners(populations);
    }

    /// Restores the cells at a restart, after the populations; `saved` has one entry for each of `cells`.
    /// Collective.
    pub fn restore<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        cells: &[usize],
        saved: &[SavedCell],
    ) {
        for (&cell, &[kind, mass, share]) in cells.iter().zip(saved) {
            let known = [SOLID, GAS, LIQUID, SURFACE];
            let kind = known.get(base::number::whole(kind)).copied();
            self.cells.kind[cell] = kind.unwrap_or(GAS);
            self.cells.mass[cell] = mass;
            self.cells.share[cell] = share;
            if share != 0.0 {
                self.work.note_share(cell);
            }
        }
        self.restored = true;
        self.settle(populations, false);
        self.list_corners(populations);
    }

    /// Lists the links that a symmetry plane reflects into a solid, except for those through openings, which have their
    /// own laws.
    fn list_corners<S: Stored>(&mut self, populations: &Populations<S>) {
        let open: HashSet<Link> = self.openings.iter().flat_map(Opening::crossed).collect();
        let corners = self.ghosts.around().corners(populations, &self.cells);
        let corners = corners.into_iter().filter(|&(cell, direction)| {
            !open.contains(&populations.link(cell as usize, usize::from(direction)))
        });
        self.corners = corners.collect();
    }

    /// Returns kind, mass and undistributed excess of a cell.
    #[must_use]
    pub fn saved(&self, cell: usize) -> SavedCell {
        let kind = match self.cells.kind[cell] {
            ENCLOSED | STRAY => SURFACE,
            HELD => LIQUID,
            kind => kind,
        };
        let mass = self.cells.mass[cell];
        [f64::from(kind), mass, self.cells.share[cell]]
    }

    /// Returns the mass on this rank that could not be distributed so far, in quanta: positive for mass that left the
    /// water.
    #[must_use]
    pub fn lost(&self) -> i128 {
        self.lost
    }

    /// Sets the mass that could not be distributed, at a restart.
    pub fn set_lost(&mut self, lost: i128) {
        self.lost = lost;
    }

    /// Opens faces of the domain: one opening for each permeable patch, equal on all ranks except for its links.
    pub(crate) fn open(&mut self, openings: Vec<Opening>) {
        for opening in &openings {
            opening.mark_links(&mut self.cells);
        }
        self.openings = openings;
    }

    /// Computes the state outside the openings at a step; `factor` returns the velocity factor of a patch.
    /// Collective.
    pub(crate) fn measure(
        &mut self,
        step: f64,
        factor: impl Fn(usize) -> f64,
        communicator: &Communicator,
    ) {
        for opening in &self.openings {
            opening.clear(&mut self.cells);
        }
        for opening in &mut self.openings {
            let factor = factor(opening.patch());
            opening.measure(&self.cells, (step, factor), communicator);
            opening.mark(&mut self.cells);
        }
    }

    /// Returns the patches of the openings with the mass that has passed through each on this rank.
    pub fn passed(&self) -> impl Iterator<Item = (usize, Passed)> + '_ {
        let openings = self.openings.iter();
        openings.map(|opening| (opening.patch(), opening.passed()))
    }

    /// Sets the mass that has passed through the openings, in their order, at a restart.
    pub fn set_passed(&mut self, passed: impl Iterator<Item = Passed>) {
        for (opening, passed) in self.openings.iter_mut().zip(passed) {
            opening.set_passed(passed);
        }
    }

    /// Returns the patches of the openings with the mass that entered in the last step on this rank, in quanta.
    pub(crate) fn entered_in_last_step(&self) -> impl Iterator<Item = (usize, i128)> + '_ {
        let openings = self.openings.iter();
        openings.map(|opening| (opening.patch(), opening.last()))
    }

    /// Returns the fill level of the free part of a cell: 0 for gas and solids, 1 for liquid.
    #[must_use]
    pub fn fill(&self, cell: usize) -> f64 {
        if self.cells.kind[cell] == HELD {
            0.0
        } else {
            self.cells.fill[cell]
        }
    }

    /// Returns `true` if a cell contains water.
    #[inline]
    #[must_use]
    pub fn is_wet(&self, cell: usize) -> bool {
        is_wet(self.cells.kind[cell])
    }

    /// Returns the kinds of the cells, by position.
    #[must_use]
    pub fn kinds(&self) -> &[u8] {
        &self.cells.kind
    }

    /// Returns the number of cells with water, in whole vectors, and of interface cells of each plane of the slab.
    pub fn cells_of_planes(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.planes
            .iter()
            .map(|plane| [plane.wet(), plane.surface.len()])
    }

    /// Returns the mass of the water of this rank in quanta; bodies replace water of density 1.
    #[must_use]
    pub fn mass<S: Stored>(&self, populations: &Populations<S>) -> i128 {
        let mut sum = 0;
        for (_, cell) in populations.interior() {
            let kind = self.cells.kind[cell];
            if kind == LIQUID || kind == HELD {
                sum += i128::from(quanta(1.0 + populations.moments(cell).0));
                sum -= i128::from(quanta(self.cells.solid(cell)));
            } else if is_surface(kind) {
                sum += i128::from(quanta(self.cells.mass[cell]));
                sum -= i128::from(quanta(self.cells.solid(cell)));
                sum += i128::from(quanta(self.cells.shares_taken(cell)));
            }
        }
        sum
    }

    /// Returns the mass of [`Self::lost`] in lattice units.
    #[must_use]
    pub fn lost_mass(&self) -> f64 {
        from_quanta(self.lost)
    }

    /// Returns the cells that water or bodies in it have reached in the last step: those of the slab, and ghost cells
    /// whose populations planes of symmetry mirror into the slab.
    pub(crate) fn reached(&self) -> impl Iterator<Item = usize> + '_ {
        let own = self.entered().chain(self.newly_held());
        let beyond = self.unsent.iter().map(|cell| *cell as usize);
        own.map(|(cell, _)| cell)
            .chain(beyond.filter(|cell| self.is_wet(*cell)))
    }

    /// Records the mirrored ghost cells that are gas.
    fn note_unsent(&mut self) {
        let kinds = &self.cells.kind;
        let dry = self
            .mirrored
            .iter()
            .filter(|cell| kinds[**cell as usize] == GAS);
        self.unsent.extend(dry);
    }

    /// Returns the cells reached by the surface in the last step, with their velocities.
    pub(crate) fn entered(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        self.work.entered()
    }

    /// Returns the gas cells of the slab that are next to interface cells and held cells along the axes, with the
    /// mean velocity of their wet neighbours; some occur more than once. `velocity` returns the velocity of a cell.
    pub(crate) fn shore<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        velocity: impl Fn(usize) -> [f32; 3],
    ) -> &[(usize, [f32; 3])] {
        let dimension = populations.velocities().dimension;
        let (cells, ghosts) = (&self.cells, &self.ghosts);
        let shore = &mut self.shore;
        shore.clear();
        let mut add = |gas: usize| {
            let mut sum = [0.0; 3];
            let mut count = 0.0;
            let wet = cells.along_axes(gas, dimension);
            for cell in wet.filter(|&cell| is_wet(cells.kind[cell])) {
                for (sum, u) in sum.iter_mut().zip(velocity(cell)) {
                    *sum += u;
                }
                count += 1.0;
            }
            shore.push((gas, sum.map(|sum| sum / count)));
        };
        let own = self.planes.iter().flat_map(|plane| &plane.surface);
        let held = self.bodies.iter().flat_map(|bodies| bodies.wet());
        let held = held.filter(|cell| cells.kind[**cell as usize] == HELD);
        for &cell in own.chain(held) {
            for next in cells.along_axes(cell as usize, dimension) {
                if cells.kind[next] == GAS && !ghosts.holds(next) {
                    add(next);
                }
            }
        }
        let count = populations.cells();
        for cell in ghosts.live() {
            let kind = cells.kind[cell as usize];
            if !is_surface(kind) && kind != HELD {
                continue;
            }
            let at = populations.coordinates(cell as usize);
            for (axis, step) in (0..dimension).flat_map(|axis| [(axis, -1), (axis, 1)]) {
                let mut next = at;
                next[axis] += step;
                let inside = (0..3).all(|a| (0..count[a].cast_signed()).contains(&next[a]));
                let next = populations.cell(next);
                if inside && cells.kind[next] == GAS {
                    add(next);
                }
            }
        }
        &self.shore
    }

    /// Returns `true` if the pass may write to a plane: it contains water, is next to a plane with water, or is at an
    /// end of the slab.
    pub(crate) fn writes_to(&self, plane: isize) -> bool {
        lists::is_written(&self.planes, plane)
    }

    /// Returns `true` if two steps may be made in one sweep far from the surface: all that acts on the water besides
    /// walls is next to the surface.
    pub(crate) fn allows_two_steps(&self) -> bool {
        self.bodies.is_none() && self.openings.is_empty() && !self.unsettled
    }

    /// Returns the lists of the planes, for the pass.
    pub(crate) fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Computes the surface in the interface cells before a pass. `half_force` is F/2, and `viscosity` that of the
    /// water.
    pub(crate) fn prepare<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        half_force: [f64; 3],
        viscosity: f64,
    ) {
        self.films.set_drive(half_force, viscosity);
        if self.unsettled {
            self.calm(populations, half_force);
            self.settle(populations, false);
        }
        if self.bodies.is_some() {
            self.brake(populations);
        }
        for opening in &mut self.openings {
            opening.remember(&self.cells, populations, half_force);
        }
        let (cells, planes) = (&mut self.cells, &mut self.planes[..]);
        let batches = &mut self.batches[..];
        let Some(tension) = &mut self.tension else {
            let drive = &Drive::new(half_force, viscosity, 0.0);
            let state = (&*cells, self.ghosts.around());
            with_set!(
                populations,
                exchange::prepare(state, batches, populations, drive, NoJump)
            );
            carried::mark(cells, batches, true);
            return;
        };
        with_set!(
            populations,
            tension::advance(&mut tension.levels, cells, planes, populations, half_force)
        );
        tension.spread(cells, populations);
        with_set!(
            populations,
            tension::press(&tension.levels, cells, planes, populations)
        );
        batch::press(batches, planes);
        let drive = &Drive::new(half_force, viscosity, tension.levels.density_of_waves());
        let state = (&*cells, self.ghosts.around());
        with_set!(
            populations,
            exchange::prepare(state, batches, populations, drive, CapillaryJump)
        );
        carried::mark(cells, batches, true);
    }

    /// Sets the populations that gas cells sent in the pass to zero.
    pub(crate) fn clear_gas_populations<S: Stored>(&mut self, populations: &mut Populations<S>) {
        let planes = &mut self.planes[..];
        with_set!(
            populations,
            exchange::clear_gas_populations(planes, populations)
        );
        exchange::bounce(&self.corners, populations);
    }

    /// Completes what wet cells take in from carried cells and openings, when all populations that come from water and
    /// solids are in place. Collective.
    pub(crate) fn complete<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        left: Left<'_, S>,
    ) {
        let (cells, batches) = (&self.cells, &self.batches);
        let carrier = |cell: usize| carried::carrier(cells, batches, cell);
        self.ghosts.exchange_carriers(carrier);
        self.add_state(populations, left, 1);
        let slab = (&mut self.batches[..], &self.ghosts);
        let (cells, beyond) = (&mut self.cells, &mut self.beyond);
        if self.tension.is_some() {
            with_set!(
                populations,
                carried::link(cells, slab, populations, beyond, CapillaryJump)
            );
        } else {
            with_set!(
                populations,
                carried::link(cells, slab, populations, beyond, NoJump)
            );
        }
        self.add_state(populations, left, -1);
        carried::clear(&mut self.cells, &self.batches);
        self.fed.clear();
        for opening in &mut self.openings {
            opening.pass(&mut self.cells, populations, &mut self.fed);
        }
    }

    /// Moves the surface, after [`Self::complete`]. Collective.
    pub(crate) fn finish<S: Stored>(&mut self, populations: &mut Populations<S>) {
        self.unsent.clear();
        self.note_unsent();
        let cells = &self.cells;
        let shore = |cell: usize| exchange::shore(cells, populations, cell);
        self.ghosts.exchange_moments(false, shore);
        let (cells, around) = (&mut self.cells, self.ghosts.around());
        let batches = &mut self.batches[..];
        if self.tension.is_some() {
            with_set!(
                populations,
                exchange::exchange(cells, around, batches, populations, CapillaryJump)
            );
        } else {
            with_set!(
                populations,
                exchange::exchange(cells, around, batches, populations, NoJump)
            );
        }
        self.work.forget_shares(&mut self.cells);
        let bodies = self.bodies.is_some();
        self.work.collect(&mut self.cells, &self.batches, bodies);
        self.spread_kinds();
        let kinds = &self.cells.kind;
        let of_surface = |cell: usize| {
            if is_surface(kinds[cell]) {
                moments::moments(populations, cell)
            } else {
                [0.0; 10]
            }
        };
        self.ghosts.exchange_moments(false, of_surface);
        self.work.resolve(&mut self.cells);
        self.spread_kinds();
        self.work.convert(
            &mut self.cells,
            &mut self.planes,
            populations,
            (&self.ghosts, &self.fed),
        );
        if bodies {
            self.distribute_excess(populations);
            // Bodies may fill cells next that the surface has just left.
            self.note_unsent();
            self.unsettled = true;
        } else {
            with_set!(
                populations,
                exchange::fill_renewed(&mut self.cells, self.work.renewed(), populations)
            );
            self.calm(populations, self.films.half_force());
            self.settle(populations, true);
            self.brake(populations);
        }
    }

    /// Sets the water at levels and outfalls to its equilibrium, for half of the body force.
    fn calm<S: Stored>(&self, populations: &mut Populations<S>, half_force: [f64; 3]) {
        for opening in &self.openings {
            opening.calm(&self.cells, populations, half_force);
        }
    }

    /// Applies the friction of walls to films: with bodies at the start of a step, when the kinds of cells are known.
    fn brake<S: Stored>(&mut self, populations: &mut Populations<S>) {
        let (films, cells, batches) = (&self.films, &self.cells, &mut self.batches[..]);
        with_set!(
            populations,
            friction::brake(films, cells, batches, populations)
        );
    }

    /// Sends the moments next to the surface again, after populations were set between two steps. Collective.
    pub(crate) fn renew_moments<S: Stored>(&mut self, populations: &Populations<S>) {
        let cells = &self.cells;
        let shore = |cell: usize| exchange::shore(cells, populations, cell);
        self.ghosts.exchange_moments(false, shore);
    }

    /// Fills the kinds of the ghost cells. Collective.
    fn spread_kinds(&mut self) {
        let bodies = self.cells.has_bodies();
        self.ghosts
            .spread_kinds(&mut self.cells.kind, &self.planes, bodies);
    }

    /// Distributes excess mass. Collective.
    fn distribute_excess<S: Stored>(&mut self, populations: &Populations<S>) {
        self.spread_kinds();
        self.lost += self.work.distribute(&mut self.cells);
        let mut fill = std::mem::take(&mut self.cells.fill);
        let mut share = std::mem::take(&mut self.cells.share);
        let cells = &self.cells;
        let shore = |cell: usize| exchange::shore(cells, populations, cell);
        let values = [&mut fill[..], &mut share[..]];
        let everywhere = self.tension.is_some();
        self.ghosts
            .spread_values((&self.cells.kind, everywhere), values, shore);
        (self.cells.fill, self.cells.share) = (fill, share);
        self.work
            .mark_takers(&mut self.cells, &self.ghosts, populations);
    }

    /// Distributes excess mass, and updates the ghost cells and the lists from the cells of the slab; `filled` is
    /// `true` if the fill levels of interface cells are known. Collective.
    fn settle<S: Stored>(&mut self, populations: &mut Populations<S>, filled: bool) {
        self.unsettled = false;
        self.spread_kinds();
        self.lost += self.work.distribute(&mut self.cells);
        self.list(populations);
        let batches = &mut self.batches[..];
        with_set!(
            populations,
            exchange::classify(
                (&self.cells, self.ghosts.around()),
                batches,
                populations,
                (self.films.half_force, filled)
            )
        );
        for batch in &self.batches {
            let states = batch.kind.iter().zip(&batch.fill);
            for (&cell, (&kind, &fill)) in batch.positions.cells().iter().zip(states) {
                self.cells.kind[cell as usize] = kind;
                self.cells.fill[cell as usize] = fill;
            }
        }
        self.distribute_excess(populations);
    }

    /// Updates the lists of the planes whose cells have changed kind.
    fn list<S: Stored>(&mut self, populations: &Populations<S>) {
        let [slow, middle, fast] = populations.order();
        let cells = populations.cells();
        let kinds = &mut self.cells;
        let mut any = false;
        for (n, plane) in self.planes.iter_mut().enumerate() {
            let made = plane.is_made();
            if made && !plane.changed {
                continue;
            }
            any = true;
            let first = |row: usize| {
                let mut at = [0; 3];
                (at[slow], at[middle]) = (n, row);
                populations.interior_cell(at)
            };
            plane.find(&kinds.kind, (0..cells[middle]).map(first), cells[fast]);
            if !made {
                // Liquid cells are full from the start.
                for row in 0..cells[middle] {
                    let row = first(row)..first(row) + cells[fast];
                    for (fill, kind) in kinds.fill[row.clone()].iter_mut().zip(&kinds.kind[row]) {
                        *fill = f64::from(u8::from(*kind == LIQUID));
                    }
                }
            }
        }
        if any {
            batch::divide(&mut self.batches, &self.planes);
        }
    }
}

/// Returns the directions of a velocity set with a nonzero component.
fn directions(velocities: &Velocities) -> std::ops::Range<usize> {
    1..velocities.q()
}

#[cfg(test)]
mod tests;
