//! Histories of contacts apart from the lists: kept while lists are made anew, saved in checkpoints and restored; their bytes in
//! messages.
//!
//! A history is keyed by the ids of both ends, so that it fits any lists on any rank.

use super::*;

/// Which contact at a wall: id of the grain, wall, facet (0 for a plane).
pub(in crate::dem) type WallKey = (u64, u32, u32);

/// Which contact: ids, and how many box lengths further the second's raw position stands than the first's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::dem) struct Key {
    pub(in crate::dem) first: u64,
    pub(in crate::dem) second: u64,
    pub(in crate::dem) shift: [i32; 3],
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Moves the histories of all contacts out of the lists, by rising key, each once.
    pub(super) fn remember(&mut self) {
        let with_history =
            |pair: &&Pair<L::Scale, L::History>| pair.history != L::History::default();
        self.histories
            .reserve_exact(self.pairs.iter().filter(with_history).count());
        for pair in &self.pairs {
            if pair.history != L::History::default() {
                let key = key(
                    self.names[pair.first as usize],
                    self.names[pair.second as usize],
                );
                self.histories.push((key, pair.history));
            }
        }
        for pair in &self.wall_pairs {
            if pair.history != L::History::default() {
                let id = self.names[pair.grain as usize].0;
                self.wall_histories.push(((id, pair.wall, 0), pair.history));
            }
        }
        for pair in &self.facets.pairs {
            let id = self.names[pair.grain as usize].0;
            for held in self.facets.held(pair) {
                if held.history != L::History::default() {
                    self.wall_histories
                        .push(((id, pair.wall, held.facet), held.history));
                }
            }
        }
        // Their memory is given back: the search for new pairs needs as much.
        self.pairs = Vec::new();
        self.wall_pairs.clear();
        self.facets.pairs.clear();
        self.facets.held.clear();
        self.names.clear();
        self.put_histories_in_order();
    }

    pub(super) fn put_histories_in_order(&mut self) {
        self.histories.sort_unstable_by_key(|(key, _)| *key);
        self.histories.dedup_by_key(|(key, _)| *key);
        self.wall_histories.sort_unstable_by_key(|(key, _)| *key);
        self.wall_histories.dedup_by_key(|(key, _)| *key);
    }

    /// Key and history of each contact this rank reports, in no order: with grains, then with walls.
    pub(in crate::dem) fn each_history(
        &self,
        mut grains: impl FnMut(Key, &L::History),
        mut walls: impl FnMut(WallKey, &L::History),
    ) {
        let fresh = L::History::default();
        for pair in &self.pairs {
            let (first, second) = pair.ends();
            if pair.history != fresh && first < self.named_owned {
                grains(key(self.names[first], self.names[second]), &pair.history);
            }
        }
        for pair in self.wall_pairs.iter().filter(|pair| pair.history != fresh) {
            let id = self.names[pair.grain as usize].0;
            walls((id, pair.wall, 0), &pair.history);
        }
        for pair in &self.facets.pairs {
            let id = self.names[pair.grain as usize].0;
            let held = self.facets.held(pair).iter();
            for held in held.filter(|held| held.history != fresh) {
                walls((id, pair.wall, held.facet), &held.history);
            }
        }
    }

    /// The same as lists by rising key.
    #[expect(clippy::type_complexity, reason = "two lists of key and history")]
    pub(in crate::dem) fn saved(&self) -> (Vec<(Key, L::History)>, Vec<(WallKey, L::History)>) {
        let (mut grains, mut walls) = (Vec::new(), Vec::new());
        self.each_history(
            |key, history| grains.push((key, *history)),
            |key, history| walls.push((key, *history)),
        );
        grains.sort_unstable_by_key(|(key, _)| *key);
        walls.sort_unstable_by_key(|(key, _)| *key);
        (grains, walls)
    }

    /// Takes histories that [`Self::saved`] gave on all ranks; the next lists pick up those of their pairs.
    pub(in crate::dem) fn restore(
        &mut self,
        grains: Vec<(Key, L::History)>,
        walls: Vec<(WallKey, L::History)>,
        steps: u64,
    ) {
        self.pairs.clear();
        self.wall_pairs.clear();
        self.facets.pairs.clear();
        self.facets.held.clear();
        self.histories = grains;
        self.wall_histories = walls;
        self.put_histories_in_order();
        self.listed = false;
        self.total = None;
        self.steps = steps;
    }
}

/// Writes the numbers of a history; `numbers` is a buffer that is reused.
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

/// Reads what [`pack_history`] wrote.
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
