//! Search for the facets near grains.

use super::Engine;
use super::bodies::Bodies;
use super::facets::{Facets, Held, SurfacePair};
use super::flush::{Planes, is_by_plane};
use super::keys::WallKey;
use super::pairs::at_wall;
use crate::ghosts;
use crate::neighbors::Search;
use crate::particles::Particles;
use crate::region::GrainDomain;
use crate::space::{Components, Space};
use crate::walls::Wall;
use base::thread_pool;

/// Returns the displacements of the facets of a wall from their initial position \[m\]: one, or for a moved wall in
/// a periodic domain all those for which a facet may be near a body of the domain.
fn places<S: Space>(wall: &Wall<S>, region: &GrainDomain<S>) -> Vec<S::Vector> {
    let lengths = region.periodic_lengths();
    let mut places = vec![wall.point];
    for axis in (0..S::DIMENSION).filter(|&axis| lengths[axis] > 0.0) {
        let length = lengths[axis];
        let moved = wall.point.get(axis);
        if moved == 0.0 {
            continue;
        }
        let within = moved - (moved / length).round() * length;
        places = places
            .iter()
            .flat_map(|place| {
                [within - length, within, within + length].map(|by| {
                    let mut place = *place;
                    place.set(axis, by);
                    place
                })
            })
            .collect();
    }
    places
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Lists the facets near owned grains, by grain, wall and facet.
    pub(super) fn list_facets(&mut self, particles: &Particles<S>, gap: f64, search: &Search) {
        let count = if L::IN_PARTS && self.parallel {
            thread_pool::threads()
        } else {
            1
        };
        self.solids.facets.truncate(count);
        self.solids.facets.resize_with(count, Facets::default);
        self.solids.facets.iter_mut().for_each(Facets::clear);
        let mut close = std::mem::take(&mut self.solids.facets[0].close);
        close.clear();
        for (w, wall) in (0..).zip(&self.walls) {
            let Some(surface) = wall.surface.as_ref().filter(|_| !wall.open) else {
                continue;
            };
            let places = places(wall, &self.settings.region);
            let planes = Planes::in_front_of(wall, &self.walls);
            for group in surface.groups() {
                let [low, high] = group.bounds.map(|corner| S::from_volume(&corner));
                for &place in &places {
                    search.near::<S>(&(low + place), &(high + place), gap, |k| {
                        if k >= particles.owned() || !particles.mobility[k].meets_all() {
                            return;
                        }
                        let at = wall.local(&particles.motion[k].position);
                        let (grain, reach) = (ghosts::index(k), particles.body[k].radius + gap);
                        for &number in &group.facets {
                            let facet = number as usize;
                            if surface.may_reach(facet, &at, reach)
                                && surface.distance(facet, &at) <= reach
                                && !planes.hide(surface, number)
                            {
                                close.push([grain, w, number]);
                                surface.images_beyond(number, &at, gap, |image| {
                                    close.push([grain, w, image]);
                                });
                            }
                        }
                    });
                }
            }
        }
        close.sort_unstable();
        close.dedup();
        let mut part = 0;
        for group in close.chunk_by(|a, b| a[..2] == b[..2]) {
            let [grain, w, _] = group[0];
            // Part that contains the grain ([`Parts::cut`]).
            while grain as usize >= particles.owned() * (part + 1) / count {
                part += 1;
            }
            let facets = &mut self.solids.facets[part];
            let (body, wall) = (&particles.body[grain as usize], &self.walls[w as usize]);
            let near = ghosts::index(facets.near.len());
            facets.near.extend(group.iter().map(|[_, _, facet]| *facet));
            let held = ghosts::index(facets.held.len());
            let first = WallKey {
                grain: body.id,
                wall: w,
                facet: 0,
            };
            let from = self.wall_histories.partition_point(|(key, _)| *key < first);
            let remembered = self.wall_histories[from..]
                .iter()
                .take_while(|(key, _)| (key.grain, key.wall) == (body.id, w));
            facets.held.extend(remembered.map(|(key, history)| Held {
                facet: key.facet,
                history: *history,
            }));
            let diameter = 2.0 * body.radius;
            let position = &particles.motion[grain as usize].position;
            facets.pairs.push(SurfacePair {
                wall: w,
                grain,
                radius: body.radius,
                opening: self.law.widest_opening([diameter, diameter]),
                by_plane: is_by_plane(&self.walls, position, body.radius, gap),
                near: (near, ghosts::index(facets.near.len())),
                held: (held, ghosts::index(facets.held.len())),
                constants: L::between(
                    self.rows.get(wall.material, body.material),
                    &at_wall(wall.material, body),
                ),
            });
        }
        self.solids.facets[0].close = close;
    }

    /// Returns the number of listed pairs of a grain and a wall of facets.
    pub(super) fn facet_pairs(&self) -> usize {
        self.solids.facets.iter().map(|part| part.pairs.len()).sum()
    }
}
