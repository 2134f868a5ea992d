//! Forces between spheres by threads, with the same sums in the same order as by one thread.
//!
//! The own grains are sorted by id and cut into as many parts as there are threads. A pair belongs to the part of its first grain,
//! the lower id. Pairs are sorted by their first grain: the pairs of a part are contiguous in the list, and a pair that crosses
//! into another part crosses into a later one.
//!
//! 1. Each part computes its pairs that cross.
//! 2. Each part adds, for its own grains, the results of earlier parts (the lower ids), and then computes its other pairs.
//!
//! Few pairs cross where ids follow space (the module `preparation::numbering` of the library).

use super::*;
use crate::thread_pool;

/// Where a part starts.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    grains: usize,
    pairs: usize,
    active: usize,
    planes: usize,
}

/// The active pairs of a part whose second is in a later one.
#[derive(Debug)]
struct Crossing<S: Space> {
    /// Places in the list of active pairs.
    places: Vec<u32>,
    seconds: Vec<u32>,
    actions: Vec<Action<S>>,
    deepest: Record,
}

/// Bonds of a part that failed, and its deepest contact.
#[derive(Debug)]
struct Failed<S: Space> {
    /// Its place.
    part: usize,
    pairs: Vec<(u32, Failure)>,
    at_walls: Vec<WallFailure<S>>,
    deepest: Record,
}

/// The parts of one rank; none where one thread does it all.
#[derive(Debug)]
pub(super) struct Parts<S: Space> {
    /// One more than there are parts.
    cuts: Vec<Cut>,
    crossings: Vec<Crossing<S>>,
    failed: Vec<Failed<S>>,
}

impl<S: Space> Default for Parts<S> {
    fn default() -> Self {
        Self {
            cuts: Vec::new(),
            crossings: Vec::new(),
            failed: Vec::new(),
        }
    }
}

impl<S: Space> Parts<S> {
    /// One part.
    pub(super) fn none(&mut self) {
        self.cuts.clear();
        self.crossings.clear();
        self.failed.clear();
    }

    /// Cuts the own grains into `count` parts. `pairs_below` and `planes_below` give, for a place among the own grains, how many
    /// listed pairs have a first of lower id, and how many listed planes a grain before it.
    pub(super) fn cut(
        &mut self,
        count: usize,
        owned: usize,
        [pairs_below, planes_below]: [&dyn Fn(usize) -> usize; 2],
    ) {
        self.none();
        self.cuts.extend((0..=count).map(|part| {
            let grains = owned * part / count;
            Cut {
                grains,
                // Pairs of firsts beyond the own grains or before them belong to the outer parts.
                pairs: if part == 0 { 0 } else { pairs_below(grains) },
                active: 0,
                planes: planes_below(grains),
            }
        }));
        self.crossings.resize_with(count, || Crossing {
            places: Vec::new(),
            seconds: Vec::new(),
            actions: Vec::new(),
            deepest: Record::default(),
        });
        self.failed.extend((0..count).map(|part| Failed {
            part,
            pairs: Vec::new(),
            at_walls: Vec::new(),
            deepest: Record::default(),
        }));
    }

    /// Takes note of the active pairs; `second` gives that of a listed pair.
    pub(super) fn note(&mut self, active: &[u32], second: impl Fn(u32) -> u32) {
        for cut in &mut self.cuts {
            cut.active = active.partition_point(|&k| (k as usize) < cut.pairs);
        }
        let owned = self.cuts.last().map_or(0, |end| end.grains);
        for (crossing, ends) in self.crossings.iter_mut().zip(self.cuts.windows(2)) {
            crossing.places.clear();
            crossing.seconds.clear();
            for (place, &k) in (0..).zip(active).take(ends[1].active).skip(ends[0].active) {
                let second = second(k);
                if (ends[1].grains..owned).contains(&(second as usize)) {
                    crossing.places.push(place);
                    crossing.seconds.push(second);
                }
            }
            crossing.actions.clear();
            crossing
                .actions
                .resize(crossing.places.len(), Action::default());
        }
    }
}

/// What the pairs of a step read.
struct World<'a, S: Space, L: ContactLaw<S>> {
    active: &'a [u32],
    rows: &'a PairTable<L::Row>,
    offsets: &'a [S::Vector],
    motion: &'a [Motion<S>],
    walls: &'a [Wall<S>],
    time_step: f64,
    /// The deepest contact before this step, over the smaller radius.
    deepest: f64,
}

/// What one part writes: its listed pairs, its pairs with planes, and the loads of its grains.
struct Share<'a, S: Space, L: ContactLaw<S>> {
    pairs: &'a mut [Pair<L::Scale, L::History>],
    planes: &'a mut [WallPair<L::Constants, L::History>],
    loads: &'a mut [Load<S>],
}

impl<S: Space, L: ContactLaw<S>> World<'_, S, L> {
    /// The pairs of a part that cross.
    fn cross<const PERIODIC: bool>(
        &self,
        from: &Cut,
        crossing: &mut Crossing<S>,
        pairs: &mut [Pair<L::Scale, L::History>],
    ) {
        let mut spans = Spans::default();
        let mut record = Record::beyond(self.deepest);
        let places = crossing.places.chunks(BLOCK);
        for (places, actions) in places.zip(crossing.actions.chunks_mut(BLOCK)) {
            let mut block = [0; BLOCK];
            for (k, &place) in block.iter_mut().zip(places) {
                *k = self.active[place as usize];
            }
            let block = &block[..places.len()];
            spans.measure::<L, PERIODIC>(block, pairs, from.pairs, self.motion, self.offsets);
            for ((&k, span), action) in block.iter().zip(spans.iter()).zip(actions) {
                let pair = &mut pairs[k as usize - from.pairs];
                let found = act::<S, L>(
                    self.rows,
                    pair,
                    self.motion,
                    span,
                    &mut record,
                    self.time_step,
                );
                *action = found.unwrap_or_default();
            }
        }
        crossing.deepest = record;
    }

    /// The loads of the grains of a part.
    fn load<const PERIODIC: bool>(
        &self,
        [from, to]: [&Cut; 2],
        crossings: &[Crossing<S>],
        failed: &mut Failed<S>,
        share: Share<'_, S, L>,
    ) {
        let Share {
            pairs,
            planes,
            loads,
        } = share;
        loads.fill(Load::default());
        failed.pairs.clear();
        failed.at_walls.clear();
        let mut record = Record::beyond(self.deepest);
        for earlier in &crossings[..failed.part] {
            for (&second, action) in earlier.seconds.iter().zip(&earlier.actions) {
                if let Some(load) = loads.get_mut((second as usize).wrapping_sub(from.grains)) {
                    load.force += action.force;
                    load.torque += action.on_second;
                }
            }
        }
        // Ghosts and grains of later parts are beyond the share.
        let place_of = |grain: u32| (grain as usize).wrapping_sub(from.grains);
        let own = &crossings[failed.part];
        let mut crosses = own.places.iter().zip(&own.actions);
        let mut next = crosses.next();
        let mut spans = Spans::default();
        let blocks = self.active[from.active..to.active].chunks(BLOCK);
        for (start, block) in (from.active..).step_by(BLOCK).zip(blocks) {
            spans.measure::<L, PERIODIC>(block, pairs, from.pairs, self.motion, self.offsets);
            for (place, (&k, span)) in (start..).zip(block.iter().zip(spans.iter())) {
                let pair = &mut pairs[k as usize - from.pairs];
                if let Some((&at, action)) = next
                    && at as usize == place
                {
                    if let Some(load) = loads.get_mut(place_of(pair.first)) {
                        load.force -= action.force;
                        load.torque += action.on_first;
                    }
                    if let Some(failure) = action.failure {
                        failed.pairs.push((k, failure));
                    }
                    next = crosses.next();
                    continue;
                }
                let found = act::<S, L>(
                    self.rows,
                    pair,
                    self.motion,
                    span,
                    &mut record,
                    self.time_step,
                );
                let Some(action) = found else {
                    continue;
                };
                if let Some(load) = loads.get_mut(place_of(pair.first)) {
                    load.force -= action.force;
                    load.torque += action.on_first;
                }
                if let Some(load) = loads.get_mut(place_of(pair.second)) {
                    load.force += action.force;
                    load.torque += action.on_second;
                }
                if let Some(failure) = action.failure {
                    failed.pairs.push((k, failure));
                }
            }
        }
        for pair in planes {
            let wall = &self.walls[pair.wall as usize];
            let load = &mut loads[pair.grain as usize - from.grains];
            let failure =
                act_at_plane::<S, L>(pair, wall, self.motion, (load, &mut record), self.time_step);
            failed.at_walls.extend(failure);
        }
        failed.deepest = record;
    }
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Parts for the present lists, as many as there are threads.
    pub(super) fn cut_into_parts(&mut self, particles: &Particles<S>) {
        if !self.parallel {
            return self.parts.none();
        }
        let owned = particles.owned();
        let id = |grain: usize| particles.body[..owned].get(grain).map(|body| body.id);
        let pairs_below = |grain: usize| {
            id(grain).map_or(self.pairs.len(), |id| {
                self.pairs
                    .partition_point(|pair| self.names[pair.first as usize].0 < id)
            })
        };
        let planes_below = |grain: usize| {
            self.wall_pairs
                .partition_point(|pair| (pair.grain as usize) < grain)
        };
        let count = thread_pool::threads();
        self.parts.cut(count, owned, [&pairs_below, &planes_below]);
    }

    /// Loads of grains on each other and of planes on them, by threads.
    pub(super) fn grain_forces_by_threads<const PERIODIC: bool>(
        &mut self,
        particles: &mut Particles<S>,
        dt: f64,
    ) {
        let world = World::<S, L> {
            active: &self.active,
            rows: &self.rows,
            offsets: &self.offsets,
            motion: &particles.motion,
            walls: &self.walls,
            time_step: dt,
            deepest: self.record.part(),
        };
        let Parts {
            cuts,
            crossings,
            failed,
        } = &mut self.parts;
        let (cuts, count) = (&**cuts, failed.len());
        if crossings.iter().any(|crossing| !crossing.places.is_empty()) {
            let pairs = thread_pool::cut(&mut self.pairs, count, |part| cuts[part].pairs);
            let shared = (thread_pool::evenly(crossings, count), pairs);
            thread_pool::each_of(count, shared, |part, (crossing, pairs)| {
                world.cross::<PERIODIC>(&cuts[part], &mut crossing[0], pairs);
            });
        }
        let shared = (
            thread_pool::evenly(failed, count),
            thread_pool::cut(&mut self.pairs, count, |part| cuts[part].pairs),
            thread_pool::cut(&mut self.wall_pairs, count, |part| cuts[part].planes),
            thread_pool::cut(&mut particles.contact, count, |part| cuts[part].grains),
        );
        thread_pool::each_of(count, shared, |part, (failed, pairs, planes, loads)| {
            let share = Share::<S, L> {
                pairs,
                planes,
                loads,
            };
            let ends = [&cuts[part], &cuts[part + 1]];
            world.load::<PERIODIC>(ends, crossings, &mut failed[0], share);
        });
        for crossing in crossings {
            let record = std::mem::take(&mut crossing.deepest);
            self.record = self.record.or(record);
        }
        for failed in failed {
            self.record = self.record.or(failed.deepest);
            self.failures.append(&mut failed.pairs);
            self.wall_failures.append(&mut failed.at_walls);
        }
    }
}
