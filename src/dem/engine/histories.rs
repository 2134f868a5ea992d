//! Contact histories outside of the lists: kept while lists are built again, saved in checkpoints and restored, and
//! packed into messages.
//!
//! A history is keyed by the ids of both partners, so that it applies to any lists on any rank.

use super::Engine;
use super::bodies::Bodies;
use super::facets::Facets;
use super::keys::{Key, WallKey, key};
use crate::contact::ContactLaw;
use crate::message::{Reader, Writer};
use crate::neighbors::threads_for;
use crate::space::Space;
use base::error::Error;
use base::thread_pool;
use std::ops::Range;

/// Search for histories of pairs that are requested in ascending order of their first ids.
#[derive(Debug, Default)]
pub(super) struct Cursor {
    /// Histories of the last first id, and that id.
    own: Range<usize>,
    first: Option<u64>,
}

impl Cursor {
    /// Returns the history of a pair, if it has one, from a list in ascending order of keys.
    #[inline]
    pub(super) fn find<H: Copy>(&mut self, histories: &[(Key, H)], key: &Key) -> Option<H> {
        if self.first != Some(key.first) {
            let start = if self.first.is_some_and(|first| first < key.first) {
                let rest = &histories[self.own.end..];
                self.own.end + rest.iter().take_while(|(k, _)| k.first < key.first).count()
            } else {
                histories.partition_point(|(k, _)| k.first < key.first)
            };
            let own = &histories[start..];
            self.own = start..start + own.iter().take_while(|(k, _)| k.first == key.first).count();
            self.first = Some(key.first);
        }
        let own = &histories[self.own.clone()];
        let at = own.binary_search_by_key(key, |(key, _)| *key).ok()?;
        Some(own[at].1)
    }
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Moves the histories of all contacts out of the lists, in ascending order of keys, each once.
    pub(super) fn remember(&mut self) {
        let fresh = L::History::default();
        let (pairs, names) = (&self.lists.pairs, &self.lists.names);
        let threads = threads_for(pairs.len());
        let bound = |thread: usize| pairs.len() * thread / threads;
        let mut before = [0; thread_pool::MAX_THREADS + 1];
        thread_pool::each_item(&mut before[1..=threads], 1, |thread, count| {
            let own = pairs[bound(thread)..bound(thread + 1)].iter();
            *count = own.filter(|pair| pair.history != fresh).count();
        });
        for thread in 1..=threads {
            before[thread] += before[thread - 1];
        }
        let histories = &mut self.histories;
        thread_pool::extend(
            histories,
            threads,
            |thread| before[thread],
            |thread, buffer| {
                for pair in &pairs[bound(thread)..bound(thread + 1)] {
                    if pair.history != fresh {
                        let (first, second) = pair.ends();
                        buffer.push((key(names[first], names[second]), pair.history));
                    }
                }
            },
        );
        for pair in &self.solids.wall_pairs {
            if pair.history != L::History::default() {
                let key = WallKey {
                    grain: self.lists.names[pair.grain as usize].0,
                    wall: pair.wall,
                    facet: 0,
                };
                self.wall_histories.push((key, pair.history));
            }
        }
        for facets in &mut self.solids.facets {
            for pair in &facets.pairs {
                let grain = self.lists.names[pair.grain as usize].0;
                for held in facets.held(pair) {
                    if held.history != L::History::default() {
                        let key = WallKey {
                            grain,
                            wall: pair.wall,
                            facet: held.facet,
                        };
                        self.wall_histories.push((key, held.history));
                    }
                }
            }
            facets.clear();
        }
        // Their memory is freed: the search for new pairs needs as much.
        self.lists.pairs = Vec::new();
        self.solids.wall_pairs.clear();
        self.lists.names.clear();
        self.put_histories_in_order();
    }

    pub(super) fn put_histories_in_order(&mut self) {
        put_in_order(&mut self.histories);
        sort(&mut self.wall_histories);
        self.wall_histories.dedup_by_key(|(key, _)| *key);
    }

    /// Visits key and history of each contact reported by this rank, in no order: contacts with grains, then with
    /// walls.
    pub(crate) fn each_history(
        &self,
        mut grains: impl FnMut(Key, &L::History),
        mut walls: impl FnMut(WallKey, &L::History),
    ) {
        let fresh = L::History::default();
        for pair in &self.lists.pairs {
            let (first, second) = pair.ends();
            if pair.history != fresh && first < self.lists.named_owned {
                grains(
                    key(self.lists.names[first], self.lists.names[second]),
                    &pair.history,
                );
            }
        }
        for pair in self
            .solids
            .wall_pairs
            .iter()
            .filter(|pair| pair.history != fresh)
        {
            let key = WallKey {
                grain: self.lists.names[pair.grain as usize].0,
                wall: pair.wall,
                facet: 0,
            };
            walls(key, &pair.history);
        }
        for facets in &self.solids.facets {
            for pair in &facets.pairs {
                let grain = self.lists.names[pair.grain as usize].0;
                let held = facets.held(pair).iter();
                for held in held.filter(|held| held.history != fresh) {
                    let key = WallKey {
                        grain,
                        wall: pair.wall,
                        facet: held.facet,
                    };
                    walls(key, &held.history);
                }
            }
        }
    }

    /// Returns all histories as lists in ascending order of keys.
    #[expect(clippy::type_complexity, reason = "two lists of key and history")]
    pub(crate) fn saved(&self) -> (Vec<(Key, L::History)>, Vec<(WallKey, L::History)>) {
        let (mut grains, mut walls) = (Vec::new(), Vec::new());
        self.each_history(
            |key, history| grains.push((key, *history)),
            |key, history| walls.push((key, *history)),
        );
        sort(&mut grains);
        sort(&mut walls);
        (grains, walls)
    }

    /// Takes the histories that [`Self::saved`] returned on all ranks; the next lists use those of their pairs.
    pub(crate) fn restore(
        &mut self,
        grains: Vec<(Key, L::History)>,
        walls: Vec<(WallKey, L::History)>,
        steps: u64,
    ) {
        self.lists.pairs.clear();
        self.solids.wall_pairs.clear();
        self.solids.facets.iter_mut().for_each(Facets::clear);
        self.histories = grains;
        self.wall_histories = walls;
        self.put_histories_in_order();
        self.validity.listed = false;
        self.validity.grain_count = None;
        self.steps = steps;
    }
}

/// Sorts histories by their keys, and keeps the first of each key.
fn put_in_order<H: Copy>(histories: &mut Vec<(Key, H)>) {
    if histories.is_sorted_by_key(|(key, _)| key.first) {
        // Taken from the lists, only the histories of images are out of order.
        for own in histories.chunk_by_mut(|a, b| a.0.first == b.0.first) {
            sort(own);
        }
    } else {
        sort(histories);
    }
    histories.dedup_by_key(|(key, _)| *key);
}

/// Sorts histories by their keys. Compiled once per type of history, not once per law and place.
fn sort<K: Ord + Copy, H>(histories: &mut [(K, H)]) {
    histories.sort_unstable_by_key(|(key, _)| *key);
}

/// Writes the numbers of a history; `numbers` is a reused buffer.
pub(super) fn pack_history<S: Space, L: ContactLaw<S>>(
    history: &L::History,
    numbers: &mut Vec<f64>,
    to: &mut Writer,
) {
    numbers.clear();
    L::save(history, numbers);
    for number in &*numbers {
        to.float(*number);
    }
}

/// Reads a history written by [`pack_history`].
pub(super) fn unpack_history<S: Space, L: ContactLaw<S>>(
    numbers: &mut Vec<f64>,
    from: &mut Reader<'_>,
) -> Result<L::History, Error> {
    numbers.clear();
    for _ in 0..L::NUMBERS {
        numbers.push(from.float()?);
    }
    Ok(L::load(numbers))
}
