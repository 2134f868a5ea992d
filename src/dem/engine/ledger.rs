//! What there is to tell of the contacts: bonds made and broken, every contact, counts, and the memories that a checkpoint
//! keeps.

use super::super::Contact;
use super::super::polyhedron::Narrow;
use super::*;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Writes each failed bond into the ledger once: at the owner of the lower id, or of the grain at a wall.
    #[cold]
    pub(super) fn report_failures(&mut self, particles: &Particles<S>) {
        let time = self.time();
        for &(k, mode) in &self.failures {
            let pair = &self.pairs[k as usize];
            let (first, second) = (pair.first as usize, pair.second as usize);
            if first < particles.owned() {
                let (between, squared) = separation(
                    &particles.motion,
                    pair.ends(),
                    &self.offsets[pair.offset as usize],
                    self.settings.region.any_periodic(),
                );
                let arm = pair.radius - 0.5 * (pair.reach - squared.sqrt());
                self.breaks.push(BondBreak {
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
        for failure in &self.wall_failures {
            let grain = failure.grain as usize;
            self.breaks.push(BondBreak {
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

    pub(in crate::dem) fn time(&self) -> f64 {
        #[expect(
            clippy::cast_precision_loss,
            reason = "a run of 2^53 steps would not end"
        )]
        let steps = self.steps as f64;
        steps * self.settings.time_step
    }

    /// Bonds every contact of spheres that exists now; returns how many this rank reports (the owner of the lower id).
    pub(super) fn bond(&mut self, particles: &Particles<S>) -> u64 {
        let mut bonds = 0;
        let periodic = self.settings.region.any_periodic();
        for pair in &mut self.pairs {
            let offset = &self.offsets[pair.offset as usize];
            let ends = pair.ends();
            let squared = separation(&particles.motion, ends, offset, periodic).1;
            let constants = L::constants(self.rows.at(pair.row), &pair.scale, pair.reach);
            let far = pair.reach + L::bonding_gap(&constants);
            if squared < far * far
                && L::bond(&constants, &mut pair.memory, pair.reach - squared.sqrt())
                && ends.0 < particles.owned()
            {
                bonds += 1;
            }
        }
        for pair in &mut self.wall_pairs {
            let distance = self.walls[pair.wall as usize]
                .distance(&particles.motion[pair.grain as usize].position);
            if distance < pair.radius + L::bonding_gap(&pair.constants)
                && L::bond(&pair.constants, &mut pair.memory, pair.radius - distance)
            {
                bonds += 1;
            }
        }
        let facets = &mut self.facets;
        facets.next.clear();
        for pair in &mut facets.pairs {
            let wall = &self.walls[pair.wall as usize];
            let Some(surface) = &wall.surface else {
                continue;
            };
            let at = wall.local(&particles.motion[pair.grain as usize].position);
            let held = &facets.held[pair.held.0 as usize..pair.held.1 as usize];
            let near = &facets.near[pair.near.0 as usize..pair.near.1 as usize];
            let reach = pair.radius + L::bonding_gap(&pair.constants);
            surface.contacts(near, &at, reach, &mut facets.found);
            facets.taken.clear();
            facets.taken.resize(held.len(), false);
            let start = ghosts::index(facets.next.len());
            for one in &facets.found {
                let mut memory =
                    memory_of(surface, held, &mut facets.taken, &facets.found, one.facet);
                if L::bond(&pair.constants, &mut memory, pair.radius - one.distance) {
                    bonds += 1;
                }
                // A fresh memory is none, whether lists were made meanwhile or not.
                if (one.distance < pair.radius || L::bonded(&memory))
                    && memory != L::Memory::default()
                {
                    facets.next.push(Held {
                        facet: one.facet,
                        memory,
                    });
                }
            }
            pair.held = (start, ghosts::index(facets.next.len()));
        }
        std::mem::swap(&mut facets.held, &mut facets.next);
        // Bonds across gaps act from now on.
        self.activate(particles);
        bonds
    }

    /// Takes every bond away; the contacts stay.
    pub(in crate::dem) fn unbond(&mut self) {
        for pair in &mut self.pairs {
            L::unbond(&mut pair.memory);
        }
        for pair in &mut self.wall_pairs {
            L::unbond(&mut pair.memory);
        }
        for held in &mut self.facets.held {
            L::unbond(&mut held.memory);
        }
    }

    /// Two spheres as a contact.
    pub(super) fn sphere_contact(
        &self,
        particles: &Particles<S>,
        pair: &Pair<L::Scale, L::Memory>,
    ) -> Option<Contact<S>> {
        let periodic = self.settings.region.any_periodic();
        let offset = &self.offsets[pair.offset as usize];
        let (between, squared) = separation(&particles.motion, pair.ends(), offset, periodic);
        let bonded = L::bonded(&pair.memory);
        if squared >= pair.reach * pair.reach && !bonded {
            return None;
        }
        let (first, second) = pair.ends();
        let distance = squared.sqrt();
        let overlap = pair.reach - distance;
        let normal = between * (1.0 / distance);
        let constants = L::constants(self.rows.at(pair.row), &pair.scale, pair.reach);
        Some(Contact {
            grain: first,
            other: Some(second),
            wall: None,
            overlap,
            normal,
            position: particles.location(first) + normal * (pair.radius - 0.5 * overlap),
            normal_force: L::normal_spring(&constants, &pair.memory, overlap),
            bonded,
        })
    }

    /// A sphere at a plane as a contact.
    pub(super) fn sphere_plane_contact(
        &self,
        particles: &Particles<S>,
        pair: &WallPair<L::Constants, L::Memory>,
    ) -> Option<Contact<S>> {
        let (grain, wall) = (pair.grain as usize, &self.walls[pair.wall as usize]);
        let distance = wall.distance(&particles.motion[grain].position);
        let bonded = L::bonded(&pair.memory);
        if distance >= pair.radius && !bonded {
            return None;
        }
        let overlap = pair.radius - distance;
        Some(Contact {
            grain,
            other: None,
            wall: Some(pair.wall),
            overlap,
            normal: wall.normal,
            position: particles.location(grain) - wall.normal * (pair.radius - 0.5 * overlap),
            normal_force: L::normal_spring(&pair.constants, &pair.memory, overlap),
            bonded,
        })
    }

    /// Every contact this rank reports: those of pairs whose first it owns, and those with walls.
    pub(in crate::dem) fn for_each_contact(
        &self,
        particles: &Particles<S>,
        mut visit: impl FnMut(Contact<S>),
    ) {
        let mut narrow = Narrow::default();
        let own = |pair: &&Pair<L::Scale, L::Memory>| (pair.first as usize) < particles.owned();
        for pair in self.pairs.iter().filter(own) {
            if let Some(contact) = L::contact(self, particles, pair, &mut narrow) {
                visit(contact);
            }
        }
        for pair in &self.wall_pairs {
            if let Some(contact) = L::plane_contact(self, particles, pair, &mut narrow) {
                visit(contact);
            }
        }
        for pair in &self.facets.pairs {
            L::facet_contacts(self, particles, pair, &mut narrow, &mut visit);
        }
    }

    /// A sphere at facets as contacts.
    pub(super) fn sphere_facet_contacts(
        &self,
        particles: &Particles<S>,
        pair: &SurfacePair<L::Constants>,
        visit: &mut impl FnMut(Contact<S>),
    ) {
        let (held, near) = (self.facets.held(pair), self.facets.near(pair));
        let (grain, wall) = (pair.grain as usize, &self.walls[pair.wall as usize]);
        let Some(surface) = &wall.surface else {
            return;
        };
        let at = wall.local(&particles.motion[grain].position);
        let mut found = Vec::new();
        surface.contacts(near, &at, pair.radius + pair.opening, &mut found);
        let mut taken = vec![false; held.len()];
        for one in &found {
            let memory = memory_of(surface, held, &mut taken, &found, one.facet);
            let bonded = L::bonded(&memory);
            if one.distance < pair.radius || bonded {
                let overlap = pair.radius - one.distance;
                let normal = S::from_volume(&one.normal);
                visit(Contact {
                    grain,
                    other: None,
                    wall: Some(pair.wall),
                    overlap,
                    normal,
                    position: particles.location(grain) - normal * (pair.radius - 0.5 * overlap),
                    normal_force: L::normal_spring(&pair.constants, &memory, overlap),
                    bonded,
                });
            }
        }
    }

    /// What this rank has now.
    pub(in crate::dem) fn statistics(&self, particles: &Particles<S>) -> Statistics {
        let mut now = Statistics {
            owned: particles.owned() as u64,
            ghosts: (particles.len() - particles.owned()) as u64,
            listed: (self.pairs.len() + self.wall_pairs.len() + self.facets.pairs.len()) as u64,
            active: self.active.len() as u64,
            rebuilds: self.rebuilds,
            tested: self.tested,
            ..Statistics::default()
        };
        self.for_each_contact(particles, |contact| {
            now.contacts += 1;
            now.bonds += u64::from(contact.bonded);
            let diameter = 2.0
                * contact
                    .other
                    .map_or(particles.body[contact.grain].radius, |other| {
                        particles.body[contact.grain]
                            .radius
                            .min(particles.body[other].radius)
                    });
            now.largest_overlap = now.largest_overlap.max(contact.overlap / diameter);
        });
        now
    }

    /// Key and memory of each contact this rank reports, in no order: with grains, then with walls.
    pub(in crate::dem) fn each_memory(
        &self,
        mut grains: impl FnMut(Key, &L::Memory),
        mut walls: impl FnMut(WallKey, &L::Memory),
    ) {
        let fresh = L::Memory::default();
        for pair in &self.pairs {
            let (first, second) = pair.ends();
            if pair.memory != fresh && first < self.named_owned {
                grains(key(self.names[first], self.names[second]), &pair.memory);
            }
        }
        for pair in self.wall_pairs.iter().filter(|pair| pair.memory != fresh) {
            let id = self.names[pair.grain as usize].0;
            walls((id, pair.wall, 0), &pair.memory);
        }
        for pair in &self.facets.pairs {
            let id = self.names[pair.grain as usize].0;
            let held = self.facets.held(pair).iter();
            for held in held.filter(|held| held.memory != fresh) {
                walls((id, pair.wall, held.facet), &held.memory);
            }
        }
    }

    /// The same as lists by rising key.
    #[expect(clippy::type_complexity, reason = "two lists of key and memory")]
    pub(in crate::dem) fn saved(&self) -> (Vec<(Key, L::Memory)>, Vec<(WallKey, L::Memory)>) {
        let (mut grains, mut walls) = (Vec::new(), Vec::new());
        self.each_memory(
            |key, memory| grains.push((key, *memory)),
            |key, memory| walls.push((key, *memory)),
        );
        grains.sort_unstable_by_key(|(key, _)| *key);
        walls.sort_unstable_by_key(|(key, _)| *key);
        (grains, walls)
    }

    /// Takes memories that [`Self::saved`] gave on all ranks; the next lists pick up those of their pairs.
    pub(in crate::dem) fn restore(
        &mut self,
        grains: Vec<(Key, L::Memory)>,
        walls: Vec<(WallKey, L::Memory)>,
        steps: u64,
    ) {
        self.pairs.clear();
        self.wall_pairs.clear();
        self.facets.pairs.clear();
        self.facets.held.clear();
        self.memories = grains;
        self.wall_memories = walls;
        self.put_memories_in_order();
        self.listed = false;
        self.total = None;
        self.steps = steps;
    }
}
