//! Lists of nearby pairs, and the selection of those that a step tests.
//!
//! Lists contain all pairs with a gap of at most the skin. They are built again when a grain may have moved half
//! the skin. A step tests only the *active* pairs: those whose gap can close before all gaps are checked next. The
//! distance between two such checks adapts to the motion. In a nearly stationary bed the active pairs are the
//! contacts.

use super::Engine;
use super::bodies::Bodies;
use super::flush::repeats_a_plane;
use super::histories::Cursor;
use super::keys::{WallKey, key};
use super::pairs::{Pair, WallPair, at_wall, effective_mass, rolling_inertia, separation};
use crate::contact::PairProperties;
use crate::ghosts;
use crate::neighbors::{Search, threads_for};
use crate::particles::Particles;
use crate::space::{Components, Space};
use crate::walls::Wall;
use base::thread_pool;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Offsets that periodic axes add to the separations of pairs.
///
/// Only those of listed pairs are kept: grains that have crossed faces many times, each another number of times, have
/// as many differences as the square of their number. Threads add offsets in any order; a pair reads its own by its
/// index, so that no result depends on the order.
struct Offsets<S: Space> {
    /// Index of each number of periods along the axes.
    places: HashMap<[i32; 3], u32>,
    /// Offsets \[m\], zero first.
    vectors: Vec<S::Vector>,
}

impl<S: Space> Default for Offsets<S> {
    fn default() -> Self {
        Self {
            places: HashMap::from([([0; 3], 0)]),
            vectors: vec![S::Vector::default()],
        }
    }
}

/// Returns the offset of a number of periods along the axes.
#[inline]
fn offset_of<S: Space>(shift: [i32; 3], lengths: &[f64; 3]) -> S::Vector {
    let mut offset = S::Vector::default();
    for axis in 0..S::DIMENSION {
        offset.set(axis, f64::from(shift[axis]) * lengths[axis]);
    }
    offset
}

/// Returns the index of an offset, which it adds where it is new.
fn place_of<S: Space>(offsets: &Mutex<Offsets<S>>, shift: [i32; 3], offset: &S::Vector) -> u32 {
    let mut offsets = offsets.lock().unwrap_or_else(PoisonError::into_inner);
    let next = ghosts::index(offsets.vectors.len());
    let place = *offsets.places.entry(shift).or_insert(next);
    if place == next {
        offsets.vectors.push(*offset);
    }
    place
}

fn into_inner<T>(shared: Mutex<T>) -> T {
    shared.into_inner().unwrap_or_else(PoisonError::into_inner)
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Lists all pairs with a gap of at most `gap` \[m\], and restores the history of each contact.
    pub(super) fn list(&mut self, particles: &mut Particles<S>, gap: f64) {
        let threads = thread_pool::threads();
        self.parallel = threads > 1 && particles.owned() >= L::PER_THREAD * threads;
        let periodic = self.settings.region.any_periodic();
        self.lists.names.extend(
            particles
                .body
                .iter()
                .zip(&particles.shift)
                .map(|(body, shift)| (body.id, *shift)),
        );
        self.lists.named_owned = particles.owned();
        // The memory of a rank reaches its maximum here. The search data is therefore freed before the list of
        // pairs is built, which is most of the memory of a grain and is allocated without excess capacity.
        let mut search = Search::default();
        let candidates = search.find_candidates(particles, gap);
        self.list_facets(particles, gap, &search);
        drop(search);
        let mut pairs = std::mem::take(&mut self.lists.pairs);
        let threads = threads_for(particles.len());
        let bound = |thread: usize| candidates.before(thread, threads);
        let view = particles.view();
        let offsets = Mutex::new(Offsets::<S>::default());
        thread_pool::extend(&mut pairs, threads, bound, |thread, buffer| {
            let mut cursor = Cursor::default();
            let mut places = HashMap::new();
            candidates.each(thread, threads, |i, j| {
                let (a, b) = (&view.body[i], &view.body[j]);
                let key = key(self.lists.names[i], self.lists.names[j]);
                let offset = offset_of::<S>(key.shift, &view.lengths);
                let partners = PairProperties {
                    materials: [a.material, b.material],
                    diameter: a.radius + b.radius,
                    mass: effective_mass(&view, i, j),
                    rolling_radius: a.radius * b.radius / (a.radius + b.radius),
                    rolling_inertia: rolling_inertia(&view, i, j),
                };
                let row = self.rows.index_of(a.material, b.material);
                let reach = a.radius + b.radius;
                let (between, squared) = separation(view.motion, (i, j), &offset, periodic);
                if !L::near(&self.scratch, (i, j), &between, gap) {
                    return;
                }
                let place = if periodic && key.shift != [0; 3] {
                    *(places.entry(key.shift))
                        .or_insert_with(|| place_of(&offsets, key.shift, &offset))
                } else {
                    0
                };
                let held = cursor.find(&self.histories, &key).unwrap_or_default();
                let lives = squared < reach * reach || L::holds(&held);
                buffer.push(Pair {
                    first: ghosts::index(i),
                    second: ghosts::index(j),
                    reach,
                    radius: a.radius,
                    row,
                    offset: place,
                    scale: L::scale(self.rows.parameters_at(row), &partners),
                    history: if lives { held } else { L::History::default() },
                });
            });
        });
        self.lists.pairs = pairs;
        self.lists.offsets = into_inner(offsets).vectors;
        drop(candidates);
        self.list_planes(particles, gap);
        self.histories = Vec::new();
        self.wall_histories.clear();
        self.validity.path = 0.0;
        L::distribute_work(self, particles);
        self.activate(particles);
    }

    /// Lists the pairs of owned grains and planes with a gap of at most `gap` \[m\].
    fn list_planes(&mut self, particles: &Particles<S>, gap: f64) {
        let view = particles.view();
        let threads = threads_for(view.owned);
        let mut found = std::mem::take(&mut self.solids.planes_found);
        let walls = self.walls.iter().enumerate();
        let planes: Vec<(usize, &Wall<S>)> = walls
            .filter(|(_, wall)| !wall.open && wall.surface.is_none())
            .filter(|(w, _)| !repeats_a_plane(&self.walls, *w, self.settings.skin))
            .collect();
        found.resize_with(threads, Vec::new);
        thread_pool::each_item(&mut found, 1, |thread, found| {
            let bound = |thread: usize| view.owned * thread / threads;
            let own = bound(thread)..bound(thread + 1);
            for k in own.filter(|&k| view.mobility[k].meets_all()) {
                let (body, motion) = (&view.body[k], &view.motion[k]);
                for &(w, wall) in &planes {
                    let distance = wall.distance(&motion.position);
                    if distance > body.radius + gap {
                        continue;
                    }
                    let wall_index = ghosts::index(w);
                    let key = WallKey {
                        grain: body.id,
                        wall: wall_index,
                        facet: 0,
                    };
                    let held = self
                        .wall_histories
                        .binary_search_by_key(&key, |(key, _)| *key)
                        .map_or(L::History::default(), |at| self.wall_histories[at].1);
                    let lives = distance < body.radius || L::holds(&held);
                    let partners = at_wall(wall.material, body);
                    found.push(WallPair {
                        wall: wall_index,
                        grain: ghosts::index(k),
                        radius: body.radius,
                        constants: self.at_wall(&partners),
                        history: if lives { held } else { L::History::default() },
                    });
                }
            }
        });
        for found in &mut found {
            self.solids.wall_pairs.append(found);
        }
        self.solids.planes_found = found;
    }

    pub(super) fn at_wall(&self, partners: &PairProperties) -> L::Constants {
        let [wall, grain] = partners.materials;
        L::between(self.rows.get(wall, grain), partners)
    }

    /// Chooses the pairs to test until grains have moved by the distance between two checks of all gaps.
    pub(super) fn activate(&mut self, particles: &Particles<S>) {
        let skin = self.settings.skin;
        let since = self.steps - self.validity.activated_at;
        if since < 30 {
            self.validity.check_path = (2.0 * self.validity.check_path).min(0.5 * skin);
        } else if since > 240 {
            self.validity.check_path = (0.5 * self.validity.check_path).max(skin / 1024.0);
        }
        self.validity.activated_at = self.steps;
        self.validity.activated = self.validity.path + self.validity.check_path;
        let periodic = self.settings.region.any_periodic();
        let (offsets, scratch, motion) =
            (&self.lists.offsets, &self.scratch, &particles.motion[..]);
        // The slack is far above the rounding of a separation, and far below any gap that costs time.
        let gap = 2.0 * self.validity.check_path * (1.0 + 1e-9);
        let choose =
            |first: usize, pairs: &mut [Pair<L::Scale, L::History>], active: &mut Vec<u32>| {
                active.clear();
                for (k, pair) in (ghosts::index(first)..).zip(pairs) {
                    let offset = &offsets[pair.offset as usize];
                    let (between, squared) = separation(motion, pair.ends(), offset, periodic);
                    let far = pair.reach * (1.0 + 1e-12) + gap;
                    let near = squared <= far * far && L::near(scratch, pair.ends(), &between, gap);
                    if near || L::holds(&pair.history) {
                        active.push(k);
                    } else {
                        pair.history = L::History::default();
                    }
                }
            };
        if self.parallel {
            let (pieces, all) = (thread_pool::threads(), self.lists.pairs.len());
            self.lists.chosen.resize_with(pieces, Vec::new);
            let shared = (
                thread_pool::evenly(&mut self.lists.pairs, pieces),
                thread_pool::evenly(&mut self.lists.chosen, pieces),
            );
            thread_pool::each_of(pieces, shared, |piece, (pairs, chosen)| {
                choose(all * piece / pieces, pairs, &mut chosen[0]);
            });
            self.lists.active.clear();
            for chosen in &self.lists.chosen {
                self.lists.active.extend_from_slice(chosen);
            }
        } else {
            choose(0, &mut self.lists.pairs, &mut self.lists.active);
        }
        let (walls, check_path) = (&self.walls, self.validity.check_path);
        let least = if self.parallel { 1 } else { usize::MAX };
        thread_pool::each_item(&mut self.solids.facets, least, |_, facets| {
            facets.activate(walls, motion, check_path);
        });
        self.lists.parts.note(&self.lists.active, &self.lists.pairs);
    }
}
