//! Lattice Boltzmann with partially saturated cells, for bodies of any shape. The force is a smooth function of the
//! motion.
//!
//! In each step the lattice advances with the bodies over its cells ([`lbm::saturation`]) and returns the force
//! on each body. The force is constant over the solid steps. Then the cover is updated ([`super::cover_map`]).
//!
//! **Internal fluid.** Covered cells contain fluid that moves with the body. The force that accelerates this fluid
//! is part of the load on the body, which would add the inertia of that fluid to it. The inertia is compensated by
//! the momentum change of a rigid body of fluid of the same shape in the last step (Feng and Michaelides, Computers
//! & Fluids 38 (2009) 370). Cells that reverse populations respond to a change of the body's motion with an
//! oscillation, so that the load is the mean of two steps, as with bounce-back on links:
//!
//! ```text
//! F = (F_n + F_n-1)/2 + (ρ_f/ρ_s) m (v_n - v_n-1)/dt,    M = (M_n + M_n-1)/2 + (ρ_f/ρ_s) (L_n - L_n-1)/dt
//! ```
//!
//! `extra` of a grain holds F_n/2 - (ρ_f/ρ_s) m v_n/dt and the corresponding moment (0 … 5, SI), and 1 if they are
//! known (6).

use super::body_map::MapGrid;
use super::cover_map::{CoverMap, rigid};
use super::lattice::{
    Balanced, LatticeFlow, advance_fluid, parts_of_lattice_flow, view_of_lattice,
};
use super::loads::{about_centre, to_grain};
use super::solid_fraction;
use super::structure_map::StructureMap;
use super::{BandStates, Flow, FluidView};
use base::error::Error;
use base::units::LatticeUnits;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::{Components, Space};
use lbm::boundary::Flux;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::Load;
use lbm::quanta::from_quanta;
use lbm::saturation::Cover;
use std::marker::PhantomData;
use std::sync::Arc;
use structure::Images;

/// Settings of the coupling.
#[derive(Clone, Copy, Debug)]
pub struct PartiallySaturatedSettings {
    /// Method by which solid fractions are computed.
    pub fractions: solid_fraction::FractionMethod,
    /// `true` if the fluid inside a body is subtracted from its inertia.
    pub without_inner_water: bool,
    /// Buoyancy per volume of a solid [N/m³] if the pressure of the lattice is the excess over hydrostatic;
    /// otherwise zero.
    pub buoyancy: [f64; 3],
}

/// Fluid with bodies over its cells. The fluid must have been constructed with an operator for covered cells.
pub struct PartiallySaturated<Sp: Space, S: Stored> {
    fluid: Fluid<S>,
    map: CoverMap,
    structures: Option<Box<StructureMap>>,
    grid: MapGrid,
    units: LatticeUnits,
    settings: PartiallySaturatedSettings,
    loads: Vec<Load>,
    /// Sums for [`shares_in_flow`] of each entry.
    shares: Vec<Load>,
    owned: usize,
    /// `true` if the covered cells still have the initial state of the fluid.
    fresh: bool,
    space: PhantomData<Sp>,
}

impl<Sp: Space, S: Stored> PartiallySaturated<Sp, S> {
    /// Returns a coupling of a fluid with the bodies passed to [`Flow::update_bodies`].
    #[inline(never)]
    pub fn new(
        fluid: Fluid<S>,
        units: LatticeUnits,
        origin: [f64; 3],
        settings: PartiallySaturatedSettings,
    ) -> Self {
        let grid = MapGrid::new(&fluid, origin, units.spacing);
        log::info!("coupling by partially saturated cells: {settings:?}");
        Self {
            map: CoverMap::new(
                fluid.populations(),
                grid.clone(),
                settings.fractions,
                fluid.usual_order(),
            ),
            fluid,
            structures: None,
            grid,
            units,
            settings,
            loads: Vec::new(),
            shares: Vec::new(),
            owned: 0,
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
            let populations = self.fluid.populations();
            self.map
                .close(structures.positions(populations), populations);
            structures.bound_surface(&mut self.fluid);
            structures.register_links(&mut self.fluid);
        }
        self.structures = structures;
        self
    }

    fn scales(&self) -> (f64, f64) {
        (
            self.units.velocity_to_lattice(1.0),
            self.units.angular_velocity_to_lattice(1.0),
        )
    }

    /// Covers the cells at the present poses of the bodies.
    fn cover_cells(&mut self) {
        if let Some(cover) = self.fluid.cover_mut() {
            self.map.cover_cells(cover);
        }
    }

    /// Sets the velocity of cells inside a solid to that of the solid: otherwise the initial fluid momentum inside
    /// the body acts on it as a spurious impulse.
    fn begin(&mut self) {
        let Some(cover) = self.fluid.cover() else {
            return;
        };
        let mut cells = Vec::new();
        for (at, position) in self.fluid.populations().interior() {
            let part = cover.fraction(position);
            if part > 0.0 && self.fluid.holds_water(position) {
                let (drho, u) = self.fluid.state(position);
                let at = at.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
                let us = if Sp::DIMENSION == 2 {
                    cover.velocity::<2>(position, at)
                } else {
                    cover.velocity::<3>(position, at)
                };
                cells.push((
                    position,
                    drho,
                    std::array::from_fn(|a| u[a] + part * (us[a] - u[a])),
                ));
            }
        }
        for (position, drho, u) in cells {
            self.fluid.set_equilibrium(position, drho, u);
        }
        self.fluid.renew_moments();
        self.fluid.renew_velocities();
    }

    /// Computes the load of owned grain `k` as the mean of the loads of this and the previous step.
    fn average(&self, particles: &mut Particles<Sp>, k: usize) {
        let (motion, body) = (particles.motion[k], particles.body[k]);
        let water = if self.settings.without_inner_water {
            self.units.density * particles.volume(k) / self.units.time_step
        } else {
            0.0
        };
        // For a block the moment is that of its angular momentum, times the ratio of the masses.
        let block = particles.polyhedron(k).map(|(_, a)| a.angular_momentum);
        let turning = water * Sp::inertia(1.0, body.radius);
        let extra = &mut particles.extra[k];
        let load = &mut particles.fluid[k];
        let known = extra[6] > 0.0;
        for a in 0..Sp::DIMENSION {
            let now = load.force.get(a);
            let inside = water * motion.velocity.get(a);
            if known {
                load.force.set(a, (0.5 * now + inside) + extra[a]);
            }
            extra[a] = 0.5 * now - inside;
        }
        for a in 0..Sp::Spin::COUNT {
            let now = load.torque.get(a);
            let inside = match block {
                Some(momentum) => water / body.mass * momentum[a],
                None => turning * motion.spin.get(a),
            };
            if known {
                load.torque.set(a, (0.5 * now + inside) + extra[3 + a]);
            }
            extra[3 + a] = 0.5 * now - inside;
        }
        extra[6] = 1.0;
    }
}

/// Returns the fractions of the volume and of the moment of inertia of a body whose cells take part in the flow, in
/// a fluid with a free surface.
fn shares_in_flow(sums: &Load) -> [f64; 2] {
    let ratio = |part: i128, all: i128| {
        if all > 0 {
            from_quanta(part) / from_quanta(all)
        } else {
            0.0
        }
    };
    [ratio(sums[0], sums[1]), ratio(sums[2], sums[3])]
}

impl<Sp: Space, S: Stored> PartiallySaturated<Sp, S> {
    /// Computes the load as in [`Self::average`] for a body of which only some cells take part in the flow.
    ///
    /// `extra` holds F_n/2 (0 … 2), the corresponding moment (3 … 5), the velocity (6 … 8), and the spin or the
    /// angular momentum of a block (9 … 11); all 0 if they are not known.
    fn average_in_part(&self, particles: &mut Particles<Sp>, k: usize) {
        let (motion, body) = (particles.motion[k], particles.body[k]);
        let shares = shares_in_flow(&self.shares[k]);
        let water = if self.settings.without_inner_water {
            self.units.density * particles.volume(k) / self.units.time_step
        } else {
            0.0
        };
        let block = particles.polyhedron(k).map(|(_, a)| a.angular_momentum);
        let turning = match block {
            Some(_) => water / body.mass,
            None => water * Sp::inertia(1.0, body.radius),
        };
        let extra = &mut particles.extra[k];
        let load = &mut particles.fluid[k];
        let known = extra.iter().any(|x| *x != 0.0);
        for a in 0..Sp::DIMENSION {
            let (half, now) = (0.5 * load.force.get(a), motion.velocity.get(a));
            if known {
                let inside = shares[0] * water * (now - extra[6 + a]);
                load.force.set(a, (half + extra[a]) + inside);
            }
            (extra[a], extra[6 + a]) = (half, now);
        }
        for a in 0..Sp::Spin::COUNT {
            let half = 0.5 * load.torque.get(a);
            let now = block.map_or_else(|| motion.spin.get(a), |momentum| momentum[a]);
            if known {
                let inside = shares[1] * turning * (now - extra[9 + a]);
                load.torque.set(a, (half + extra[3 + a]) + inside);
            }
            (extra[3 + a], extra[9 + a]) = (half, now);
        }
    }

    /// Sums the fractions of the bodies in a fluid with a free surface over the ranks. Collective.
    fn share_out(&mut self, particles: &mut Particles<Sp>, domain: &Domain) -> Result<(), Error> {
        let Some(surface) = self.fluid.surface() else {
            return Ok(());
        };
        self.shares.clear();
        self.shares.resize(particles.len(), [0; 6]);
        for (slot, shares) in (0..).zip(surface.shares_of_bodies()) {
            let entry = self.map.entry(slot);
            if let Some(sums) = entry.and_then(|entry| self.shares.get_mut(entry)) {
                for (sum, share) in sums.iter_mut().zip(shares) {
                    *sum += share;
                }
            }
        }
        particles.reduce_to_owners(&mut self.shares, domain)
    }
}

impl<Sp: Space, S: Stored> Flow<Sp> for PartiallySaturated<Sp, S> {
    fn advance(&mut self, particles: &mut Particles<Sp>, domain: &Domain) -> Result<(), Error> {
        let structures = self.structures.as_deref_mut();
        if advance_fluid(&mut self.fluid, structures, particles, domain, |_| {})? {
            return Ok(());
        }
        self.loads.clear();
        self.loads.resize(particles.len(), [0; 6]);
        let (map, loads) = (&self.map, &mut self.loads);
        if let Some(cover) = self.fluid.cover_mut() {
            cover.collect(|slot, received| {
                if let Some(load) = map.entry(slot).and_then(|entry| loads.get_mut(entry)) {
                    for (sum, part) in load.iter_mut().zip(received) {
                        *sum += part;
                    }
                }
            });
        }
        particles.reduce_to_owners(&mut self.loads, domain)?;
        self.share_out(particles, domain)?;
        self.owned = particles.owned();
        let (velocity, spin) = self.scales();
        for k in 0..particles.owned() {
            let centre = rigid(particles, k, &self.grid, velocity, spin).position;
            let load = about_centre(centre, &self.loads[k]);
            particles.fluid[k] = to_grain(&self.units, &load, [0.0; 3], 0.0);
            if self.fluid.surface().is_some() {
                self.average_in_part(particles, k);
            } else {
                self.average(particles, k);
            }
            let volume = particles.volume(k);
            let force = &mut particles.fluid[k].force;
            for (a, buoyancy) in self.settings.buoyancy.into_iter().enumerate() {
                if a < Sp::DIMENSION {
                    force.set(a, force.get(a) + buoyancy * volume);
                }
            }
        }
        Ok(())
    }

    fn update_bodies(&mut self, particles: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        particles.allocate_fluid_loads();
        particles.keep_extra();
        let (velocity, spin) = self.scales();
        if let Some(cover) = self.fluid.cover_mut() {
            self.map.place_bodies(particles, cover, velocity, spin);
        }
        if !self.fluid.covers_on_gpu() {
            self.cover_cells();
        }
        if self.fluid.surface().is_some() {
            let filled = self.map.filled_cells();
            self.fluid.meet_bodies(filled);
        }
        self.fluid.send_cover()?;
        let changed = self.fluid.cover_mut().is_some_and(Cover::take_changed);
        if changed && self.fluid.velocities().is_some() {
            let map = &self.map;
            let surfaces = |thread, threads| map.surface_cells(thread, threads);
            if Sp::DIMENSION == 2 {
                self.fluid.record_covered::<2, _>(surfaces);
            } else {
                self.fluid.record_covered::<3, _>(surfaces);
            }
            if let Some(structures) = &self.structures {
                structures.register_links(&mut self.fluid);
            }
        }
        if let Some(structures) = &self.structures {
            structures.clear(&mut self.fluid);
        }
        if self.fresh {
            self.fresh = false;
            self.begin();
        }
        Ok(())
    }
}

impl<Sp: Space, S: Stored> FluidView for PartiallySaturated<Sp, S> {
    view_of_lattice!();

    fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        let position = self.fluid.populations().interior_cell(cell);
        self.fluid.cover()?.body_at(position)
    }

    /// Counts the cells of bodies like water: their content has the pressure of the water and passes it on.
    fn fluxes(&self) -> Vec<Flux> {
        let structures = self.structures.as_deref();
        let loads = structures.map(StructureMap::plane_loads);
        self.fluid.fluxes_beside(None, loads.unwrap_or_default())
    }

    fn solid_at(&self, cell: [usize; 3]) -> bool {
        self.body_at(cell).is_some() || !self.balanced().holds(cell)
    }
}

impl<Sp: Space, S: Stored> LatticeFlow<Sp, S> for PartiallySaturated<Sp, S> {
    parts_of_lattice_flow!();

    fn restart(&mut self) {
        self.fresh = false;
    }

    /// Copies the cells of the bodies from a GPU, if they were computed there.
    fn fetch(&mut self) -> Result<(), Error> {
        self.cover_cells();
        Ok(self.fluid.fetch()?)
    }

    /// Excludes structures only: bodies receive the momentum that their cells lose.
    fn balanced(&self) -> Balanced<'_> {
        Balanced {
            bodies: None,
            structures: self.structures.as_deref(),
        }
    }

    /// Returns `false` for every cell, never `true`: cells that bodies fill in part exchange populations with all their
    /// neighbours.
    fn enclosed(&self, _: [usize; 3]) -> bool {
        false
    }
}
