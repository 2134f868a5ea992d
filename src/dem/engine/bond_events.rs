//! Creation, failure and removal of bonds.

use super::Engine;
use super::bodies::Bodies;
use super::pairs::separation;
use crate::BondBreak;
use crate::particles::Particles;
use crate::space::{Components, Space};
use base::error::Error;
use decomposition::Domain;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Records each failed bond as an event on one rank: the owner of the lower id, or of the grain at a wall.
    #[cold]
    pub(super) fn report_failures(&mut self, particles: &Particles<S>) {
        let time = self.time();
        for &(k, mode) in &self.events.failures {
            let pair = &self.lists.pairs[k as usize];
            let (first, second) = (pair.first as usize, pair.second as usize);
            if first < particles.owned() {
                let (between, squared) = separation(
                    &particles.motion,
                    pair.ends(),
                    &self.lists.offsets[pair.offset as usize],
                    self.settings.region.any_periodic(),
                );
                let arm = pair.radius - 0.5 * (pair.reach - squared.sqrt());
                self.events.breaks.push(BondBreak {
                    step: self.steps,
                    time,
                    grain: particles.body[first].id,
                    other: Some(particles.body[second].id),
                    wall: None,
                    position: particles.location(first) + between * (arm / squared.sqrt()),
                    mode,
                    fluid_force: particles.fluid_load(first).force.length(),
                });
            }
        }
        for failure in &self.events.wall_failures {
            let grain = failure.grain as usize;
            self.events.breaks.push(BondBreak {
                step: self.steps,
                time,
                grain: particles.body[grain].id,
                other: None,
                wall: Some(failure.wall),
                position: particles.location(grain) + failure.arm,
                mode: failure.mode,
                fluid_force: particles.fluid_load(grain).force.length(),
            });
        }
    }

    /// Bonds every present contact of spheres; returns the number reported by this rank (the owner of the lower
    /// id).
    pub(super) fn bond(&mut self, particles: &Particles<S>) -> u64 {
        let mut bonds = 0;
        let periodic = self.settings.region.any_periodic();
        for pair in &mut self.lists.pairs {
            let offset = &self.lists.offsets[pair.offset as usize];
            let ends = pair.ends();
            let squared = separation(&particles.motion, ends, offset, periodic).1;
            let constants =
                L::constants(self.rows.parameters_at(pair.row), &pair.scale, pair.reach);
            let far = pair.reach + L::bonding_gap(&constants);
            if squared < far * far
                && L::bond(&constants, &mut pair.history, pair.reach - squared.sqrt())
                && ends.0 < particles.owned()
            {
                bonds += 1;
            }
        }
        for pair in &mut self.solids.wall_pairs {
            let distance = self.walls[pair.wall as usize]
                .distance(&particles.motion[pair.grain as usize].position);
            if distance < pair.radius + L::bonding_gap(&pair.constants)
                && L::bond(&pair.constants, &mut pair.history, pair.radius - distance)
            {
                bonds += 1;
            }
        }
        for facets in &mut self.solids.facets {
            bonds += facets.bond::<S, L>(&self.walls, &particles.motion);
        }
        // Bonds across gaps act from now on.
        self.activate(particles);
        bonds
    }

    /// Sets the strengths of all bonds to a multiple of those of the law. The lists are built again, because bonds may
    /// open farther. Collective.
    pub(super) fn set_bond_strength(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        factor: f64,
    ) -> Result<(), Error> {
        let change = factor / self.bond_strength;
        if change.to_bits() == 1_f64.to_bits() {
            return Ok(());
        }
        self.bond_strength = factor;
        self.law.strengthen(change);
        self.rows = self.law.table();
        self.remember();
        let pairs = self.histories.iter_mut().map(|(_, history)| history);
        let walls = self.wall_histories.iter_mut().map(|(_, history)| history);
        for history in pairs.chain(walls) {
            L::strengthen_bond(history, change);
        }
        self.validity.listed = false;
        self.prepare(particles, domain)
    }

    /// Breaks the bonds that are overloaded at the present positions, without motion; returns their number on all
    /// ranks. If there are none, contacts and loads keep their bits. Collective.
    pub(super) fn break_overloaded(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<u64, Error> {
        // Grains and histories go to their owners before they are copied.
        self.prepare(particles, domain)?;
        self.remember();
        let histories = (self.histories.clone(), self.wall_histories.clone());
        self.validity.listed = false;
        self.prepare(particles, domain)?;
        let loads = particles.contact.clone();
        let before = self.events.breaks.len();
        self.all_forces(particles, 0.0, None);
        let broken = (self.events.breaks.len() - before) as u64;
        let broken = domain.communicator().all_reduce_sum_u64(broken);
        if broken == 0 {
            self.remember();
            (self.histories, self.wall_histories) = histories;
            self.validity.listed = false;
            particles.contact = loads;
            self.prepare(particles, domain)?;
        }
        Ok(broken)
    }
}
