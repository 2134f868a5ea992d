//! Forces between spheres by threads, with the same sums in the same order as by one thread.
//!
//! The own grains are sorted by id and cut into as many parts as there are threads. A pair belongs to the part of its first grain,
//! the lower id. Pairs are sorted by their first grain: the pairs of a part are contiguous in the list, and a pair that crosses
//! into another part crosses into a later one.
//!
//! 1. The pairs that cross are computed, shared out evenly.
//! 2. Each part adds, for its own grains, the results of earlier parts (the lower ids), and then computes its other pairs, its pairs with
//!    planes and its contacts with facets.
//!
//! Few pairs cross where ids follow space (the module `preparation::numbering` of the library).

use super::*;

/// Where a part starts.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    grains: usize,
    pairs: usize,
    planes: usize,
}

/// The active pairs whose second is in a later part than their first, in the order of the list.
#[derive(Debug)]
struct Crossings<S: Space> {
    /// Where those of each part begin, and the end.
    begins: Vec<usize>,
    /// Places among the listed pairs.
    pairs: Vec<u32>,
    /// Before which of [`Part::within`] each comes.
    before: Vec<u32>,
    firsts: Vec<u32>,
    seconds: Vec<u32>,
    actions: Vec<Action<S>>,
    /// The deepest contact that each thread found.
    deepest: Vec<Record>,
}

impl<S: Space> Default for Crossings<S> {
    fn default() -> Self {
        Self {
            begins: Vec::new(),
            pairs: Vec::new(),
            before: Vec::new(),
            firsts: Vec::new(),
            seconds: Vec::new(),
            actions: Vec::new(),
            deepest: Vec::new(),
        }
    }
}

/// A part: its active pairs, and what a step makes of them.
#[derive(Debug)]
struct Part<S: Space> {
    /// Its place.
    part: usize,
    /// Those that do not cross: places among the listed ones.
    within: Vec<u32>,
    /// Those that cross, with how many of the others come before, and both ends.
    crossing: Vec<[u32; 4]>,
    /// Bonds that failed, and the deepest contact.
    pairs: Vec<(u32, Failure)>,
    at_planes: Vec<WallFailure<S>>,
    at_facets: Vec<WallFailure<S>>,
    deepest: Record,
}

/// The parts of one rank; none where one thread does it all.
#[derive(Debug)]
pub(super) struct Parts<S: Space> {
    /// One more than there are parts.
    cuts: Vec<Cut>,
    crossings: Crossings<S>,
    parts: Vec<Part<S>>,
}

impl<S: Space> Default for Parts<S> {
    fn default() -> Self {
        Self {
            cuts: Vec::new(),
            crossings: Crossings::default(),
            parts: Vec::new(),
        }
    }
}

impl<S: Space> Parts<S> {
    /// One part.
    pub(super) fn none(&mut self) {
        self.cuts.clear();
        self.crossings = Crossings::default();
        self.parts.clear();
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
                planes: planes_below(grains),
            }
        }));
        self.crossings.deepest.resize_with(count, Record::default);
        self.parts.extend((0..count).map(|part| Part {
            part,
            within: Vec::new(),
            crossing: Vec::new(),
            pairs: Vec::new(),
            at_planes: Vec::new(),
            at_facets: Vec::new(),
            deepest: Record::default(),
        }));
    }

    /// Takes note of the active pairs; `ends` gives the grains of a listed pair.
    pub(super) fn note(&mut self, active: &[u32], ends: impl Fn(u32) -> [u32; 2] + Sync) {
        let Some(owned) = self.cuts.last().map(|end| end.grains) else {
            return;
        };
        let Self {
            cuts,
            crossings,
            parts,
        } = self;
        thread_pool::each_item(parts, 1, |part, own| {
            own.within.clear();
            own.crossing.clear();
            let below = |part: usize| {
                let end = cuts[part].pairs;
                active.partition_point(|&k| (k as usize) < end)
            };
            let later = cuts[part + 1].grains..owned;
            for &k in &active[below(part)..below(part + 1)] {
                let [first, second] = ends(k);
                if later.contains(&(second as usize)) {
                    let before = ghosts::index(own.within.len());
                    own.crossing.push([k, before, first, second]);
                } else {
                    own.within.push(k);
                }
            }
        });
        crossings.begins.clear();
        crossings.pairs.clear();
        crossings.before.clear();
        crossings.firsts.clear();
        crossings.seconds.clear();
        for part in &*parts {
            crossings.begins.push(crossings.pairs.len());
            for &[k, before, first, second] in &part.crossing {
                crossings.pairs.push(k);
                crossings.before.push(before);
                crossings.firsts.push(first);
                crossings.seconds.push(second);
            }
        }
        let all = crossings.pairs.len();
        crossings.begins.push(all);
        crossings.actions.clear();
        crossings.actions.resize(all, Action::default());
    }
}

/// What the pairs of a step read.
struct World<'a, S: Space, L: ContactLaw<S>> {
    rows: &'a PairTable<L::Row>,
    offsets: &'a [S::Vector],
    motion: &'a [Motion<S>],
    walls: &'a [Wall<S>],
    time_step: f64,
    /// The deepest contact before this step, over the smaller radius.
    deepest: f64,
}

/// What one part writes: its listed pairs, those with planes and with facets, and the loads of its grains.
struct Share<'a, S: Space, L: ContactLaw<S>> {
    pairs: &'a mut [Pair<L::Scale, L::History>],
    planes: &'a mut [WallPair<L::Constants, L::History>],
    facets: &'a mut Facets<L::Constants, L::History>,
    loads: &'a mut [Load<S>],
}

impl<S: Space, L: ContactLaw<S>> World<'_, S, L> {
    /// Pairs that cross, at these places in the list. `pairs` are those listed from `first` on. Returns the deepest contact.
    fn cross<const PERIODIC: bool>(
        &self,
        cross: &[u32],
        actions: &mut [Action<S>],
        first: usize,
        pairs: &mut [Pair<L::Scale, L::History>],
    ) -> Record {
        let mut spans = Spans::default();
        let mut record = Record::beyond(self.deepest);
        for (block, actions) in cross.chunks(BLOCK).zip(actions.chunks_mut(BLOCK)) {
            spans.measure::<L, PERIODIC>(block, pairs, first, self.motion, self.offsets);
            for ((&k, span), action) in block.iter().zip(spans.iter()).zip(actions) {
                let pair = &mut pairs[k as usize - first];
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
        record
    }

    /// The loads of the grains of a part.
    fn load<const PERIODIC: bool>(
        &self,
        from: &Cut,
        crossings: &Crossings<S>,
        part: &mut Part<S>,
        share: Share<'_, S, L>,
    ) {
        let Share {
            pairs,
            planes,
            facets,
            loads,
        } = share;
        loads.fill(Load::default());
        let Part {
            part: place,
            within,
            pairs: failed,
            at_planes,
            at_facets,
            deepest,
            ..
        } = part;
        failed.clear();
        at_planes.clear();
        at_facets.clear();
        let mut record = Record::beyond(self.deepest);
        let own = crossings.begins[*place]..crossings.begins[*place + 1];
        let earlier = crossings.seconds[..own.start].iter();
        for (&second, action) in earlier.zip(&crossings.actions) {
            if let Some(load) = loads.get_mut((second as usize).wrapping_sub(from.grains)) {
                load.force += action.force;
                load.torque += action.on_second;
            }
        }
        // Ghosts and grains of later parts are beyond the share.
        let place_of = |grain: u32| (grain as usize).wrapping_sub(from.grains);
        // Before which of the others the next pair that crosses comes.
        let turn = |cross: usize| match crossings.before.get(cross) {
            Some(&before) if cross < own.end => before as usize,
            _ => usize::MAX,
        };
        let mut cross = own.start;
        let mut next = turn(cross);
        // Adds what crosses before one of the others, so that every sum has its order.
        let mut add_crossing = |before: usize, loads: &mut [Load<S>], failures: &mut Vec<_>| {
            while turn(cross) <= before {
                let action = &crossings.actions[cross];
                if let Some(load) = loads.get_mut(place_of(crossings.firsts[cross])) {
                    load.force -= action.force;
                    load.torque += action.on_first;
                }
                if let Some(failure) = action.failure {
                    failures.push((crossings.pairs[cross], failure));
                }
                cross += 1;
            }
            turn(cross)
        };
        let mut spans = Spans::default();
        for (start, block) in (0..).step_by(BLOCK).zip(within.chunks(BLOCK)) {
            spans.measure::<L, PERIODIC>(block, pairs, from.pairs, self.motion, self.offsets);
            for (place, (&k, span)) in (start..).zip(block.iter().zip(spans.iter())) {
                if next <= place {
                    next = add_crossing(place, loads, failed);
                }
                let pair = &mut pairs[k as usize - from.pairs];
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
                    failed.push((k, failure));
                }
            }
        }
        add_crossing(within.len(), loads, failed);
        for pair in planes {
            let wall = &self.walls[pair.wall as usize];
            let load = &mut loads[pair.grain as usize - from.grains];
            let failure =
                act_at_plane::<S, L>(pair, wall, self.motion, (load, &mut record), self.time_step);
            at_planes.extend(failure);
        }
        let loads = (loads, from.grains);
        let found = (at_facets, &mut record);
        facets.act::<S, L>(self.walls, self.motion, loads, found, self.time_step);
        *deepest = record;
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
        let Parts {
            cuts,
            crossings,
            parts,
        } = &mut self.parts;
        let world = World::<S, L> {
            rows: &self.rows,
            offsets: &self.offsets,
            motion: &particles.motion,
            walls: &self.walls,
            time_step: dt,
            deepest: self.record.part(),
        };
        let (cuts, count) = (&**cuts, parts.len());
        let Crossings {
            pairs: cross,
            actions,
            deepest,
            ..
        } = &mut *crossings;
        let all = cross.len();
        if all > 0 {
            let cross = &**cross;
            // The listed pairs of each share of those that cross.
            let first = |part: usize| match cross.get(all * part / count) {
                _ if part == 0 => 0,
                Some(&k) => k as usize,
                None => self.pairs.len(),
            };
            let mut firsts = [0; thread_pool::MOST + 1];
            for (part, at) in firsts[..=count].iter_mut().enumerate() {
                *at = first(part);
            }
            let shared = (
                thread_pool::evenly(actions, count),
                thread_pool::evenly(deepest, count),
                thread_pool::cut(&mut self.pairs, count, |part| firsts[part]),
            );
            thread_pool::each_of(count, shared, |part, (actions, deepest, pairs)| {
                let cross = &cross[all * part / count..all * (part + 1) / count];
                deepest[0] = world.cross::<PERIODIC>(cross, actions, firsts[part], pairs);
            });
            for deepest in deepest {
                self.record = self.record.or(std::mem::take(deepest));
            }
        }
        let shared = (
            thread_pool::evenly(parts, count),
            thread_pool::cut(&mut self.pairs, count, |part| cuts[part].pairs),
            thread_pool::cut(&mut self.wall_pairs, count, |part| cuts[part].planes),
            thread_pool::cut(&mut particles.contact, count, |part| cuts[part].grains),
        );
        let shared = (shared, thread_pool::evenly(&mut self.facets, count));
        thread_pool::each_of(
            count,
            shared,
            |n, ((part, pairs, planes, loads), facets)| {
                let share = Share::<S, L> {
                    pairs,
                    planes,
                    facets: &mut facets[0],
                    loads,
                };
                world.load::<PERIODIC>(&cuts[n], crossings, &mut part[0], share);
            },
        );
        for part in parts {
            self.record = self.record.or(part.deepest);
            self.failures.append(&mut part.pairs);
            self.wall_failures.append(&mut part.at_planes);
        }
        // As by one thread: all planes first.
        for part in &mut self.parts.parts {
            self.wall_failures.append(&mut part.at_facets);
        }
    }
}
