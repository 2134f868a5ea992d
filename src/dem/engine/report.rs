//! Contacts and counts for output: every contact with its overlap and force, and the numbers of contacts.

use super::Engine;
use super::bodies::Bodies;
use super::facets::{AtFacets, history_of, is_held};
use super::flush::drop_doubled_by_planes;
use super::pairs::{Pair, WallPair, separation};
use crate::particles::Particles;
use crate::polyhedron::Narrow;
use crate::space::Space;
use crate::{Contact, Statistics, ghosts};

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    pub(crate) fn time(&self) -> f64 {
        #[expect(
            clippy::cast_precision_loss,
            reason = "a run of 2^53 steps would not end"
        )]
        let steps = self.steps as f64;
        steps * self.settings.time_step
    }

    /// Returns the contact of two spheres.
    pub(super) fn sphere_contact(
        &self,
        particles: &Particles<S>,
        pair: &Pair<L::Scale, L::History>,
    ) -> Option<Contact<S>> {
        let periodic = self.settings.region.any_periodic();
        let offset = &self.lists.offsets[pair.offset as usize];
        let (between, squared) = separation(&particles.motion, pair.ends(), offset, periodic);
        if squared >= pair.reach * pair.reach && !L::holds(&pair.history) {
            return None;
        }
        let (first, second) = pair.ends();
        let distance = squared.sqrt();
        let overlap = pair.reach - distance;
        let normal = between * (1.0 / distance);
        let constants = L::constants(self.rows.parameters_at(pair.row), &pair.scale, pair.reach);
        Some(Contact {
            grain: first,
            other: Some(second),
            wall: None,
            overlap,
            normal,
            position: particles.location(first) + normal * (pair.radius - 0.5 * overlap),
            normal_force: L::normal_spring(&constants, &pair.history, overlap),
            shear_force: S::embed(&L::shear_spring(&pair.history), &normal),
            bonded: L::bonded(&pair.history),
            bridge: L::bridge(&pair.history),
        })
    }

    /// Returns the contact of a sphere with a plane.
    pub(super) fn sphere_plane_contact(
        &self,
        particles: &Particles<S>,
        pair: &WallPair<L::Constants, L::History>,
    ) -> Option<Contact<S>> {
        let (grain, wall) = (pair.grain as usize, &self.walls[pair.wall as usize]);
        let distance = wall.distance(&particles.motion[grain].position);
        if distance >= pair.radius && !L::holds(&pair.history) {
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
            normal_force: L::normal_spring(&pair.constants, &pair.history, overlap),
            shear_force: S::embed(&L::shear_spring(&pair.history), &wall.normal),
            bonded: L::bonded(&pair.history),
            bridge: L::bridge(&pair.history),
        })
    }

    /// Visits every contact reported by this rank: those of pairs whose first grain it owns, and those with walls.
    pub(crate) fn for_each_contact(
        &self,
        particles: &Particles<S>,
        mut visit: impl FnMut(Contact<S>),
    ) {
        let mut narrow = Narrow::default();
        let own = |pair: &&Pair<L::Scale, L::History>| (pair.first as usize) < particles.owned();
        for pair in self.lists.pairs.iter().filter(own) {
            if let Some(contact) = L::contact(self, particles, pair, &mut narrow) {
                visit(contact);
            }
        }
        for pair in &self.solids.wall_pairs {
            if let Some(contact) = L::plane_contact(self, particles, pair, &mut narrow) {
                visit(contact);
            }
        }
        for facets in &self.solids.facets {
            for pair in &facets.pairs {
                L::facet_contacts(self, particles, (facets, pair), &mut narrow, &mut visit);
            }
        }
    }

    /// Visits the listed pairs of spheres with a gap below `fraction` of the smaller radius, a bond or a bridge, and
    /// the spheres that near to a wall or held by it.
    pub(crate) fn for_each_near(
        &self,
        particles: &Particles<S>,
        fraction: f64,
        visit: &mut dyn FnMut(usize, Option<usize>),
    ) {
        let periodic = self.settings.region.any_periodic();
        for pair in &self.lists.pairs {
            let offset = &self.lists.offsets[pair.offset as usize];
            let (first, second) = pair.ends();
            let squared = separation(&particles.motion, (first, second), offset, periodic).1;
            let smaller = pair.radius.min(pair.reach - pair.radius);
            let reach = pair.reach + fraction * smaller;
            if squared < reach * reach || L::holds(&pair.history) {
                visit(first, Some(second));
            }
        }
        for pair in &self.solids.wall_pairs {
            let grain = pair.grain as usize;
            let distance =
                self.walls[pair.wall as usize].distance(&particles.motion[grain].position);
            if distance < pair.radius * (1.0 + fraction) || L::holds(&pair.history) {
                visit(grain, None);
            }
        }
        let mut found = Vec::new();
        for facets in &self.solids.facets {
            for pair in &facets.pairs {
                let grain = pair.grain as usize;
                let wall = &self.walls[pair.wall as usize];
                let at = &particles.motion[grain].position;
                let reach = pair.radius * (1.0 + fraction);
                wall.touched(facets.near(pair), at, reach, &mut found);
                let held = facets.held(pair);
                if !found.is_empty() || held.iter().any(|held| L::holds(&held.history)) {
                    visit(grain, None);
                }
            }
        }
    }

    /// Visits the contacts of a sphere with facets.
    pub(super) fn sphere_facet_contacts(
        &self,
        particles: &Particles<S>,
        (facets, pair): AtFacets<'_, L::Constants, L::History>,
        visit: &mut impl FnMut(Contact<S>),
    ) {
        let (held, near) = (facets.held(pair), facets.near(pair));
        let (grain, wall) = (pair.grain as usize, &self.walls[pair.wall as usize]);
        let Some(surface) = &wall.surface else {
            return;
        };
        let mut found = Vec::new();
        let at = &particles.motion[grain].position;
        wall.touched(near, at, pair.radius + pair.opening, &mut found);
        let first = facets.pairs.partition_point(|one| one.grain < pair.grain);
        let own = facets.pairs[first..].iter();
        let count = own.take_while(|one| one.grain == pair.grain).count();
        if count > 1 {
            let mut doubled = Vec::new();
            let pairs = ghosts::index(first)..ghosts::index(first + count);
            let buffers = (&mut Vec::new(), &mut Vec::new());
            let motion = &particles.motion;
            let (walls, indices) = (&self.walls, pairs.clone());
            facets.doubles::<S, L>(indices, walls, motion, |_| 0.0, buffers, &mut doubled);
            let mut own = pairs;
            let own = own.find(|k| facets.pairs[*k as usize].wall == pair.wall);
            found.retain(|one| own.is_none_or(|own| !doubled.contains(&[own, one.facet])));
        }
        if pair.by_plane {
            drop_doubled_by_planes(&self.walls, (at, pair.radius), &mut found, |one| {
                is_held::<S, L>(held, one.facet)
            });
        }
        let mut taken = vec![false; held.len()];
        for one in &found {
            let history = history_of(surface, held, &mut taken, &found, one.facet);
            if one.distance < pair.radius || L::holds(&history) {
                let overlap = pair.radius - one.distance;
                let normal = S::from_volume(&one.normal);
                visit(Contact {
                    grain,
                    other: None,
                    wall: Some(pair.wall),
                    overlap,
                    normal,
                    position: particles.location(grain) - normal * (pair.radius - 0.5 * overlap),
                    normal_force: L::normal_spring(&pair.constants, &history, overlap),
                    shear_force: S::embed(&L::shear_spring(&history), &normal),
                    bonded: L::bonded(&history),
                    bridge: L::bridge(&history),
                });
            }
        }
    }

    /// Returns the present counts of this rank.
    pub(crate) fn statistics(&self, particles: &Particles<S>) -> Statistics {
        let mut now = Statistics {
            owned: particles.owned() as u64,
            ghosts: (particles.len() - particles.owned()) as u64,
            listed: (self.lists.pairs.len() + self.solids.wall_pairs.len() + self.facet_pairs())
                as u64,
            active: self.lists.active.len() as u64,
            rebuilds: self.validity.rebuilds,
            tested: self.validity.tested,
            ..Statistics::default()
        };
        self.for_each_contact(particles, |contact| {
            now.bridges += u64::from(contact.bridge > 0.0);
            if !contact.touches() {
                return;
            }
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
}
