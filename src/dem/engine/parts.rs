//! Forces between spheres, and their motion, in parts of the grains: one part per thread.
//!
//! The owned grains are sorted by id and divided into parts. Pairs are sorted by their first grain, which has the
//! lower id. A part computes every active pair that contains one of its grains:
//!
//! 1. Pairs that come in from earlier parts, whose second grain is in the part. It has copies of them.
//! 2. Its own pairs, whose first grain is in the part. They are contiguous in the list.
//! 3. Its pairs with planes and its contacts with facets.
//!
//! The forces on a grain thus add up in the order of the other grain's id, walls after grains, for any number of
//! parts. A pair between two parts is computed in both, with the same data and the same result. Such pairs are few
//! if ids follow space (the module `preparation::numbering` of the library).
//!
//! Each of several parts moves its grains as soon as it has their loads. It writes to a second array, because other
//! parts still read the old positions. A solid step therefore has a single synchronisation of the threads.

use super::bodies::Bodies;
use super::facets::Facets;
use super::pairs::{BLOCK, Grains, Pair, Spans, WallPair, act, act_at_plane};
use super::{Engine, WallFailure};
use crate::contact::{ContactLaw, Failure, PairTable};
use crate::deepest::Record;
use crate::ghosts;
use crate::integrate::{self, Fastest, Kick, Loads, Phase};
use crate::particles::{Load, Motion, Particles};
use crate::space::Space;
use crate::walls::Wall;
use base::thread_pool;
use std::ops::Range;

/// First indices of a part.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    grains: usize,
    pairs: usize,
    planes: usize,
}

/// Results of a part in a step.
#[derive(Debug)]
struct Part<S: Space> {
    /// Range of active pairs among all.
    active: Range<usize>,
    /// Positions of the incoming pairs in the list of all pairs.
    places: Vec<u32>,
    /// Failed bonds, and the deepest contact.
    pairs: Vec<(u32, Failure)>,
    at_planes: Vec<WallFailure<S>>,
    at_facets: Vec<WallFailure<S>>,
    deepest: Record,
    fastest: Fastest,
}

impl<S: Space> Default for Part<S> {
    fn default() -> Self {
        Self {
            active: 0..0,
            places: Vec::new(),
            pairs: Vec::new(),
            at_planes: Vec::new(),
            at_facets: Vec::new(),
            deepest: Record::default(),
            fastest: Fastest::default(),
        }
    }
}

/// Parts into which the grains of a rank are divided.
#[derive(Debug)]
pub(super) struct Parts<S: Space, C, M> {
    /// Boundaries of the parts: one more than there are parts.
    cuts: Vec<Cut>,
    parts: Vec<Part<S>>,
    /// Active pairs whose second grain is in a later part, for each part.
    going: Vec<Vec<u32>>,
    /// Copies of the active pairs that come in from earlier parts, for each part, in the order of the list.
    coming: Vec<Vec<Pair<C, M>>>,
    /// New positions and velocities of the grains.
    moved: Vec<Motion<S>>,
}

impl<S: Space, C, M> Default for Parts<S, C, M> {
    fn default() -> Self {
        Self {
            cuts: Vec::new(),
            parts: Vec::new(),
            going: Vec::new(),
            coming: Vec::new(),
            moved: Vec::new(),
        }
    }
}

impl<S: Space, C: Copy + Send + Sync, M: Copy + Send + Sync> Parts<S, C, M> {
    /// Divides the owned grains into `count` parts. `pairs_below` and `planes_below` return, for an index among the
    /// owned grains, the number of listed pairs with a first grain before it, and the number of listed planes of
    /// grains before it.
    fn cut(
        &mut self,
        count: usize,
        owned: usize,
        [pairs_below, planes_below]: [&dyn Fn(usize) -> usize; 2],
    ) {
        self.cuts.clear();
        self.cuts.extend((0..=count).map(|part| {
            let grains = owned * part / count;
            Cut {
                grains,
                // Pairs whose first grain is a ghost belong to the first or the last part.
                pairs: if part == 0 { 0 } else { pairs_below(grains) },
                planes: planes_below(grains),
            }
        }));
        self.parts.resize_with(count, Part::default);
        self.going.resize_with(count, Vec::new);
        self.coming.resize_with(count, Vec::new);
    }

    /// Copies the active pairs that cross parts.
    pub(super) fn note(&mut self, active: &[u32], pairs: &[Pair<C, M>]) {
        let Some(owned) = self.cuts.last().map(|end| end.grains) else {
            return;
        };
        let cuts = &self.cuts;
        let shared = (
            thread_pool::evenly(&mut self.parts, cuts.len() - 1),
            thread_pool::evenly(&mut self.going, cuts.len() - 1),
        );
        thread_pool::each_of(cuts.len() - 1, shared, |part, (own, going)| {
            let below = |part: usize| {
                let end = cuts[part].pairs;
                active.partition_point(|&k| (k as usize) < end)
            };
            own[0].active = below(part)..below(part + 1);
            let later = cuts[part + 1].grains..owned;
            let goes = |k: &u32| later.contains(&pairs[*k as usize].ends().1);
            going[0].clear();
            if !later.is_empty() {
                let own = &active[own[0].active.clone()];
                going[0].extend(own.iter().copied().filter(goes));
            }
        });
        let going = &self.going;
        let shared = (
            thread_pool::evenly(&mut self.parts, cuts.len() - 1),
            thread_pool::evenly(&mut self.coming, cuts.len() - 1),
        );
        thread_pool::each_of(cuts.len() - 1, shared, |part, (own, coming)| {
            let grains = cuts[part].grains..cuts[part + 1].grains;
            let all = going[..part].iter().flatten();
            let pairs = all.map(|&k| pairs[k as usize]);
            coming[0].clear();
            coming[0].extend(pairs.filter(|pair| grains.contains(&pair.ends().1)));
            own[0].places.clear();
            own[0].places.extend(0..ghosts::index(coming[0].len()));
        });
    }
}

/// Input data of the pairs in a step.
struct StepInput<'a, S: Space, L: ContactLaw<S>> {
    rows: &'a PairTable<L::Row>,
    offsets: &'a [S::Vector],
    active: &'a [u32],
    grains: Grains<'a, S>,
    walls: &'a [Wall<S>],
    time_step: f64,
    /// Deepest contact before this step: overlap over the smaller radius.
    deepest: f64,
}

/// Pairs that a part computes.
struct Active<'a, C, M> {
    pairs: &'a mut [Pair<C, M>],
    /// Indices of those to compute.
    places: &'a [u32],
    /// Index of the first pair.
    base: usize,
}

/// Data written by one part: its listed pairs, copies of pairs listed by earlier parts, pairs with planes and with
/// facets, and the loads of its grains.
struct Share<'a, S: Space, L: ContactLaw<S>> {
    pairs: &'a mut [Pair<L::Scale, L::History>],
    coming: &'a mut [Pair<L::Scale, L::History>],
    planes: &'a mut [WallPair<L::Constants, L::History>],
    facets: &'a mut Facets<L::Constants, L::History>,
    loads: &'a mut [Load<S>],
}

impl<S: Space, L: ContactLaw<S>> StepInput<'_, S, L> {
    /// Adds the actions of the pairs at these indices, each minus `base`, to the loads of the grains from number
    /// `first` on.
    #[inline(always)]
    fn act_on<const PERIODIC: bool>(
        &self,
        active: Active<'_, L::Scale, L::History>,
        (loads, first): (&mut [Load<S>], usize),
        record: &mut Record,
        mut fails: impl FnMut(u32, Failure),
    ) {
        let Active {
            pairs,
            places,
            base,
        } = active;
        let place_of = |grain: u32| (grain as usize).wrapping_sub(first);
        let mut spans = Spans::default();
        for block in places.chunks(BLOCK) {
            let near = block.iter().map(|&k| &pairs[k as usize - base]);
            spans.measure::<L, PERIODIC>(near, self.grains.motion, self.offsets);
            for (&k, span) in block.iter().zip(spans.iter()) {
                let pair = &mut pairs[k as usize - base];
                let found = act::<S, L>(self.rows, pair, self.grains, span, record, self.time_step);
                let Some(action) = found else {
                    continue;
                };
                // Ghosts and grains of other parts are outside the loads.
                if let Some(load) = loads.get_mut(place_of(pair.first)) {
                    load.force -= action.force;
                    load.torque += action.on_first;
                }
                if let Some(load) = loads.get_mut(place_of(pair.second)) {
                    load.force += action.force;
                    load.torque += action.on_second;
                }
                if let Some(failure) = action.failure {
                    fails(k, failure);
                }
            }
        }
    }

    /// Computes the loads of the grains of a part.
    fn load<const PERIODIC: bool>(&self, from: &Cut, part: &mut Part<S>, share: Share<'_, S, L>) {
        let Share {
            pairs,
            coming,
            planes,
            facets,
            loads,
        } = share;
        loads.fill(Load::default());
        part.pairs.clear();
        part.at_planes.clear();
        part.at_facets.clear();
        let mut record = Record::beyond(self.deepest);
        if !coming.is_empty() {
            // The part of the first grain reports failures.
            let all = Active {
                pairs: coming,
                places: &part.places[..],
                base: 0,
            };
            let to = (&mut *loads, from.grains);
            self.act_on::<PERIODIC>(all, to, &mut record, |_, _| {});
        }
        let active = &self.active[part.active.clone()];
        self.act_on::<PERIODIC>(
            Active {
                pairs,
                places: active,
                base: from.pairs,
            },
            (&mut *loads, from.grains),
            &mut record,
            |k, failure| part.pairs.push((k, failure)),
        );
        for pair in planes {
            let wall = &self.walls[pair.wall as usize];
            let load = &mut loads[pair.grain as usize - from.grains];
            let failure =
                act_at_plane::<S, L>(pair, wall, self.grains, (load, &mut record), self.time_step);
            part.at_planes.extend(failure);
        }
        let loads = (loads, from.grains);
        let found = (&mut part.at_facets, &mut record);
        facets.act::<S, L>(self.walls, self.grains, loads, found, self.time_step);
        part.deepest = record;
    }
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Divides the present lists into as many parts as there are threads.
    pub(super) fn cut_into_parts(&mut self, particles: &Particles<S>) {
        let owned = particles.owned();
        let id = |grain: usize| particles.body[..owned].get(grain).map(|body| body.id);
        let pairs_below = |grain: usize| {
            id(grain).map_or(self.lists.pairs.len(), |id| {
                self.lists
                    .pairs
                    .partition_point(|pair| self.lists.names[pair.first as usize].0 < id)
            })
        };
        let planes_below = |grain: usize| {
            self.solids
                .wall_pairs
                .partition_point(|pair| (pair.grain as usize) < grain)
        };
        let count = if self.parallel {
            thread_pool::threads()
        } else {
            1
        };
        self.lists
            .parts
            .cut(count, owned, [&pairs_below, &planes_below]);
        let entries = if count > 1 { particles.len() } else { 0 };
        self.lists.parts.moved.resize(entries, Motion::default());
    }

    /// Computes the contact loads of all owned grains; histories advance by `dt` \[s\]. If there are several parts,
    /// each then also moves its grains in `phase`, and the largest speed is returned.
    pub(super) fn forces_by_parts<const PERIODIC: bool>(
        &mut self,
        particles: &mut Particles<S>,
        dt: f64,
        phase: Option<(&Kick<S>, Phase)>,
    ) -> Option<Fastest> {
        let Parts {
            cuts,
            parts,
            coming,
            moved,
            ..
        } = &mut self.lists.parts;
        let world = StepInput::<S, L> {
            rows: &self.rows,
            offsets: &self.lists.offsets,
            active: &self.lists.active,
            grains: Grains {
                motion: &particles.motion,
                moisture: &particles.moisture,
            },
            walls: &self.walls,
            time_step: dt,
            deepest: self.events.record.part(),
        };
        let (cuts, count) = (&**cuts, parts.len());
        let phase = phase.filter(|_| count > 1);
        let (fluid, mobility) = (&particles.fluid[..], &particles.mobility[..]);
        let grains = |part: usize| cuts[part].grains;
        let shared = (
            thread_pool::evenly(parts, count),
            thread_pool::cut(&mut self.lists.pairs, count, |part| cuts[part].pairs),
            thread_pool::evenly(coming, count),
            thread_pool::cut(&mut self.solids.wall_pairs, count, |part| cuts[part].planes),
        );
        let shared = (
            shared,
            thread_pool::evenly(&mut self.solids.facets, count),
            thread_pool::cut(&mut particles.contact, count, grains),
            thread_pool::cut(
                moved,
                count,
                |part| {
                    if phase.is_some() { grains(part) } else { 0 }
                },
            ),
        );
        thread_pool::each_of(count, shared, |n, (lists, facets, loads, moved)| {
            let (part, pairs, coming, planes) = lists;
            let share = Share::<S, L> {
                pairs,
                coming: &mut coming[0],
                planes,
                facets: &mut facets[0],
                loads,
            };
            world.load::<PERIODIC>(&cuts[n], &mut part[0], share);
            if let Some((kick, phase)) = phase {
                let own = grains(n)..grains(n + 1);
                let loads = Loads {
                    contact: loads,
                    fluid: fluid.get(own.clone()).unwrap_or_default(),
                    mobility: &mobility[own.clone()],
                };
                let from = &world.grains.motion[own];
                part[0].fastest = integrate::move_by::<S, false>(from, moved, &loads, kick, phase);
            }
        });
        let mut fastest = Fastest::default();
        for part in &mut *parts {
            self.events.record = self.events.record.or(part.deepest);
            self.events.failures.append(&mut part.pairs);
            self.events.wall_failures.append(&mut part.at_planes);
            fastest = fastest.or(part.fastest);
        }
        // All planes first, as with a single part.
        for part in parts {
            self.events.wall_failures.append(&mut part.at_facets);
        }
        phase.map(|_| fastest)
    }

    /// Stores the positions that the last step computed.
    pub(super) fn take_moved(&mut self, particles: &mut Particles<S>) {
        let owned = particles.owned();
        // Ghosts remain unchanged until they are refreshed.
        self.lists.parts.moved[owned..].copy_from_slice(&particles.motion[owned..]);
        std::mem::swap(&mut self.lists.parts.moved, &mut particles.motion);
    }
}
