//! Lattice Boltzmann with moving bounce-back around discs, spheres or convex polyhedra.
//!
//! In each step the lattice advances, and populations bounce back on the links that cross a body's surface
//! ([`lbm::links`]). The loads are those at the middle of the step. They are averaged with those of the previous
//! step (Ladd 1994) and are constant over the solid steps. Then the map of bodies is updated ([`super::body_map`]).
//! Bodies contain fluid inside their shells, so that covering and uncovering cells creates no mass. When a cell is
//! covered or uncovered, its momentum is exchanged with the body.
//!
//! `extra` of a grain holds, in lattice units: the load of the last half step (0 … 5: force, torque) and the impulse
//! of cells covered since then (6 … 11).

use super::body_map::{BodyMap, MapGrid, Rules};
use super::lattice::{
    Balanced, LatticeFlow, advance_fluid, parts_of_lattice_flow, view_of_lattice,
};
use super::loads::{about_centre, to_grain};
use super::structure_map::StructureMap;
use super::{BandStates, Flow, FluidView};
use base::error::Error;
use base::thread_pool;
use base::units::LatticeUnits;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;
use lbm::boundary::{FaceLoads, Flux};
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::gaps::BodyLinks;
use lbm::links::mirrored::MirroredLoads;
use lbm::links::{BODIES_PER_THREAD, Load, Rigid, Scheme, bounce};
use std::marker::PhantomData;
use std::sync::Arc;
use structure::Images;

/// Settings of the coupling.
#[derive(Clone, Copy, Debug)]
pub struct BounceBackSettings {
    /// Position of the surface on a link.
    pub scheme: Scheme,
    /// `true` if the loads of two half steps are averaged.
    pub average: bool,
    /// Hydraulic radius and treatment of narrow gaps.
    pub rules: Rules,
    /// Buoyancy per volume of a solid [N/m³] if the pressure of the lattice is the excess over hydrostatic;
    /// otherwise zero.
    pub buoyancy: [f64; 3],
}

/// Fluid with bodies in it.
pub struct BounceBack<Sp: Space, S: Stored> {
    fluid: Fluid<S>,
    map: BodyMap,
    structures: Option<Box<StructureMap>>,
    units: LatticeUnits,
    settings: BounceBackSettings,
    loads: Vec<Load>,
    owned: usize,
    /// Loads on planes of symmetry in the last step.
    plane_loads: FaceLoads,
    /// Motions of the bodies when the links were last registered with the gradients of the eddy viscosity.
    registered_motions: Vec<Rigid>,
    /// `true` if the fluid is in its initial state, the grains have no loads yet, and the map does not exist yet.
    fresh: bool,
    space: PhantomData<Sp>,
}

impl<Sp: Space, S: Stored> BounceBack<Sp, S> {
    /// Returns a coupling of a fluid with the bodies passed to [`Flow::update_bodies`].
    #[inline(never)]
    pub fn new(
        fluid: Fluid<S>,
        units: LatticeUnits,
        origin: [f64; 3],
        settings: BounceBackSettings,
    ) -> Self {
        let grid = MapGrid::new(&fluid, origin, units.spacing);
        let mut map = BodyMap::new(fluid.populations(), grid, settings.rules);
        map.stand_on(fluid.straight_links());
        log::info!("coupling by moving bounce-back: {settings:?}");
        Self {
            fluid,
            map,
            structures: None,
            units,
            settings,
            loads: Vec::new(),
            owned: 0,
            plane_loads: FaceLoads::default(),
            registered_motions: Vec::new(),
            fresh: true,
            space: PhantomData,
        }
    }

    /// Adds structures; with `interpolated` their links reflect at the surface, otherwise half-way.
    #[must_use]
    #[inline(never)]
    pub fn with_structures(mut self, solids: Vec<Arc<Images>>, interpolated: bool) -> Self {
        let structures = StructureMap::in_fluid(&mut self.fluid, &self.units, solids, interpolated);
        if let Some(structures) = &structures {
            self.map.stand_in(structures.cells(), structures.sheets());
            structures.bound_surface(&mut self.fluid);
            structures.register_links(&mut self.fluid);
        }
        self.structures = structures;
        self
    }

    /// Returns the map of the cells inside bodies, to set the cells of joints.
    pub fn map_mut(&mut self) -> &mut BodyMap {
        &mut self.map
    }

    /// Returns `true` if the loads of two half steps are averaged.
    #[must_use]
    pub fn averages_loads(&self) -> bool {
        self.settings.average
    }

    /// Returns the map of the cells inside bodies.
    #[must_use]
    pub fn map(&self) -> &BodyMap {
        &self.map
    }

    fn scales(&self) -> (f64, f64) {
        (
            self.units.velocity_to_lattice(1.0),
            self.units.angular_velocity_to_lattice(1.0),
        )
    }

    /// Registers the links with the gradients of the eddy viscosity.
    fn register_links(&mut self) {
        if self.fluid.velocities().is_none() {
            return;
        }
        if self.map.is_as_before() && self.registered_motions == self.map.motion() {
            return;
        }
        self.registered_motions.clear();
        self.registered_motions.extend_from_slice(self.map.motion());
        let (links, motion) = (self.map.links(), self.map.motion());
        if Sp::DIMENSION == 2 {
            self.fluid.record_links::<2>(links, motion);
        } else {
            self.fluid.record_links::<3>(links, motion);
        }
        if let Some(structures) = &self.structures {
            structures.register_links(&mut self.fluid);
        }
    }

    /// Updates the ends of links of structures that bodies cover.
    fn update_covered_ends(&mut self) {
        if let Some(structures) = &mut self.structures
            && !self.map.is_as_before()
        {
            structures.update_covered_ends(&self.map);
        }
    }

    /// Returns the number of steps that may be made at once if there are no grains. It is equal on every rank.
    #[must_use]
    pub fn at_once(&self) -> u64 {
        if self.structures.is_none() {
            self.fluid.at_once()
        } else {
            1
        }
    }

    /// Averages the loads of two half steps, including the impulse of cells that were covered or uncovered.
    fn load_grains(&self, particles: &mut Particles<Sp>) {
        let mut extra = std::mem::take(&mut particles.extra);
        let mut fluid = std::mem::take(&mut particles.fluid);
        let grains = particles.view();
        let (loads, motion) = (&self.loads, self.map.motion());
        let (settings, units) = (self.settings, &self.units);
        // Divided as for the links, so that a thread uses the loads that it computed.
        let runs = thread_pool::runs(loads.len(), BODIES_PER_THREAD);
        let first = |run: usize| (loads.len() * run / runs).min(grains.owned);
        let shared = (
            thread_pool::cut(&mut extra, runs, first),
            thread_pool::cut(&mut fluid, runs, first),
        );
        thread_pool::each_run_of(runs, shared, |run, (extra, fluid)| {
            for ((k, extra), fluid) in (first(run)..).zip(extra).zip(fluid) {
                let half = about_centre(motion[k].position, &loads[k]);
                let mut load = [0.0; 6];
                for a in 0..6 {
                    let now = half[a] + extra[6 + a];
                    load[a] = if settings.average {
                        0.5 * (now + extra[a])
                    } else {
                        now
                    };
                    extra[a] = now;
                    extra[6 + a] = 0.0;
                }
                *fluid = to_grain(units, &load, settings.buoyancy, grains.volume(k));
            }
        });
        particles.extra = extra;
        particles.fluid = fluid;
    }

    fn clear_loads(&mut self, n: usize) {
        self.loads.resize(n, [0; 6]);
        thread_pool::each_item_in_runs(&mut self.loads, BODIES_PER_THREAD, |_, load| {
            *load = [0; 6]
        });
    }
}

impl<Sp: Space, S: Stored> Flow<Sp> for BounceBack<Sp, S> {
    fn advance(&mut self, particles: &mut Particles<Sp>, domain: &Domain) -> Result<(), Error> {
        if !self.map.is_empty() {
            let map = &self.map;
            self.fluid.cover_openings(|cell| map.is_closed(cell));
        }
        let structures = self.structures.as_deref_mut();
        self.plane_loads = FaceLoads::default();
        self.fluid.feet_of_bodies_mut().clear();
        let kept = structures.is_some();
        let map = &mut self.map;
        let keep = |fluid: &Fluid<S>| map.keep_leaving(fluid.populations());
        if advance_fluid(&mut self.fluid, structures, particles, domain, keep)? {
            return Ok(());
        }
        // Reflection at links runs on this processor.
        self.fluid.fetch()?;
        if !kept {
            self.map.keep_leaving(self.fluid.populations());
        }
        let map = &self.map;
        self.fluid.close_openings(|cell| map.solid_in(cell));
        self.loads.resize(particles.len(), [0; 6]);
        let (links, motion) = (self.map.links(), self.map.motion());
        let faces = |k| self.map.faces(k);
        let populations = self.fluid.populations_mut();
        let (scheme, loads) = (self.settings.scheme, &mut self.loads);
        if Sp::DIMENSION == 2 {
            bounce::<S, 2>(populations, scheme, links, motion, faces, loads);
        } else {
            bounce::<S, 3>(populations, scheme, links, motion, faces, loads);
        }
        let mut given = std::mem::take(self.fluid.feet_of_bodies_mut());
        let (populations, structures) = (self.fluid.populations(), self.structures.as_deref_mut());
        let (map, loads) = (&self.map, &mut self.loads);
        if Sp::DIMENSION == 2 {
            map.load_feet::<S, 2>(populations, structures, loads, &mut given);
        } else {
            map.load_feet::<S, 3>(populations, structures, loads, &mut given);
        }
        *self.fluid.feet_of_bodies_mut() = given;
        let populations = self.fluid.populations_mut();
        let scheme = self.settings.scheme;
        let at_planes = (self.map).bounce_at_planes(populations, scheme, &mut self.loads);
        let at_joints = self.map.bounce_at_joints(self.fluid.populations_mut());
        particles.reduce_to_owners(&mut self.loads, domain)?;
        self.owned = particles.owned();
        self.load_grains(particles);
        self.plane_loads = at_planes.unwrap_or_default().planes;
        // For the balance of the momentum: they act on no body.
        let at_planes = at_planes.map(|loads| loads.body);
        for load in at_joints.into_iter().chain(at_planes) {
            self.loads.truncate(self.owned);
            self.loads.push(load);
            self.owned += 1;
        }
        Ok(())
    }

    fn update_bodies(
        &mut self,
        particles: &mut Particles<Sp>,
        domain: &Domain,
    ) -> Result<(), Error> {
        particles.allocate_fluid_loads();
        particles.keep_extra();
        if let Some(structures) = &self.structures {
            structures.clear(&mut self.fluid);
        }
        if particles.is_empty() && domain.communicator().size() == 1 && self.map.links().is_empty()
        {
            self.fresh = false;
            self.map.forget_changes();
            return Ok(());
        }
        let (velocity, spin) = self.scales();
        self.map
            .refresh(particles, velocity, spin)
            .map_err(Error::Internal)?;
        self.map.set_faces(self.fluid.face_parts());
        if self.fresh {
            self.fresh = false;
            self.map
                .update_bodies(particles, self.fluid.populations(), None);
            self.update_covered_ends();
            self.register_links();
            log::debug!(
                "rank {}: {} bodies on the lattice by {} links",
                domain.rank(),
                particles.len(),
                self.map.links().iter().map(BodyLinks::count).sum::<usize>()
            );
            return Ok(());
        }
        self.clear_loads(particles.len());
        let mut loads = std::mem::take(&mut self.loads);
        self.map
            .update_bodies(particles, self.fluid.populations(), Some(&mut loads));
        self.update_covered_ends();
        self.register_links();
        let reduced = particles.reduce_to_owners(&mut loads, domain);
        self.loads = loads;
        reduced?;
        let (loads, motion) = (&self.loads, self.map.motion());
        let owned = particles.owned();
        let runs = thread_pool::runs(loads.len(), BODIES_PER_THREAD);
        let first = |run: usize| (loads.len() * run / runs).min(owned);
        let shared = thread_pool::cut(&mut particles.extra, runs, first);
        thread_pool::each_run_of(runs, shared, |run, extra| {
            for (k, extra) in (first(run)..).zip(extra) {
                if loads[k] != [0; 6] {
                    let impulse = about_centre(motion[k].position, &loads[k]);
                    for a in 0..6 {
                        extra[6 + a] += impulse[a];
                    }
                }
            }
        });
        Ok(())
    }
}

impl<Sp: Space, S: Stored> FluidView for BounceBack<Sp, S> {
    view_of_lattice!();

    fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        self.map.body_at(cell)
    }

    fn fluxes(&self) -> Vec<Flux> {
        // The fluxes are those of the last step, whose end has moved the bodies.
        let before = self.map.closed_before();
        let filled = |cell: [isize; 3]| self.map.was_closed(cell, &before);
        let bodies = !self.map.is_empty() || !before.is_empty();
        let mut loads = MirroredLoads::default();
        if bodies {
            loads.add_planes(&self.plane_loads);
        }
        if let Some(structures) = &self.structures {
            loads.add_planes(&structures.plane_loads());
        }
        let filled: Option<&dyn Fn([isize; 3]) -> bool> = if bodies { Some(&filled) } else { None };
        self.fluid.fluxes_beside(filled, loads.planes)
    }

    fn solid_at(&self, cell: [usize; 3]) -> bool {
        !self.balanced().holds(cell)
    }
}

impl<Sp: Space, S: Stored> LatticeFlow<Sp, S> for BounceBack<Sp, S> {
    parts_of_lattice_flow!();

    fn restart(&mut self) {
        self.fresh = true;
    }

    /// Excludes cells inside the shells from the balance of the fluid.
    fn balanced(&self) -> Balanced<'_> {
        Balanced {
            bodies: Some(&self.map),
            structures: self.structures.as_deref(),
        }
    }

    fn enclosed(&self, cell: [usize; 3]) -> bool {
        !self.map.is_empty() && self.map.encloses(cell, self.fluid.populations())
    }
}
