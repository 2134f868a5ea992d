//! Assignment of each cell near a slab to the body that contains it.

use super::rows::{Row, Rows};
use super::slab::Slab;
use super::{BodyMap, Change, FLUID, Mapped, OUTSIDE, RemapRequest, tag};
use base::thread_pool;
use dem::particles::Particles;
use dem::space::Space;
use lbm::links::gaps::BodyLinks;
use std::collections::HashMap;
use std::ops::Range;

/// Bit that marks a cell whose owner before this update is recorded.
const NOTED: u32 = 1 << 31;

/// Minimum number of rows per thread.
const ROWS_PER_THREAD: usize = 16;

/// Bodies found to share cells with others.
#[derive(Clone, Debug, Default)]
struct Sharing {
    /// Indices of the new bodies in a shared cell, and tags of the bodies that were already in it.
    came: Vec<usize>,
    there: Vec<u32>,
}

/// Results of the cell assignment by one thread in its layers.
#[derive(Clone, Debug, Default)]
pub(super) struct Settled {
    changes: Vec<Change>,
    sharing: Sharing,
}

/// Layers of cells along the last axis that one thread changes.
struct Layers<'a> {
    slab: &'a Slab,
    /// Owners of the cells of these layers.
    owner: &'a mut [u32],
    layers: Range<usize>,
    changes: &'a mut Vec<Change>,
    sharing: &'a mut Sharing,
}

impl BodyMap {
    /// Assigns to each entry of the particles the map of the same body and image, and clears the maps of bodies
    /// that are gone.
    pub(super) fn assign_maps<Sp: Space>(&mut self, particles: &Particles<Sp>) {
        let mut old: HashMap<(u64, [i32; 3]), (Mapped, BodyLinks)> = self
            .bodies
            .drain(..)
            .zip(self.links.drain(..))
            .map(|(body, links)| ((body.id, body.shift), (body, links)))
            .collect();
        let mut bodies = Vec::with_capacity(particles.len());
        let mut links = Vec::with_capacity(particles.len());
        for (body, shift) in particles.body.iter().zip(&particles.shift) {
            let (mapped, list) = old.remove(&(body.id, *shift)).unwrap_or_else(|| {
                let fresh = Mapped {
                    id: body.id,
                    shift: *shift,
                    slack: -1.0,
                    ..Mapped::default()
                };
                (fresh, BodyLinks::default())
            });
            bodies.push(mapped);
            links.push(list);
        }
        // The remaining bodies are gone; they are processed in a fixed order, although no result depends on it.
        let mut gone: Vec<Mapped> = old.into_values().map(|(body, _)| body).collect();
        gone.sort_by_key(|body| (body.id, body.shift));
        let mut all = Layers {
            slab: &self.slab,
            owner: &mut self.owner,
            layers: 0..self.slab.layers(),
            changes: &mut self.changes,
            sharing: &mut Sharing::default(),
        };
        for body in gone {
            all.each(&body.rows, |all, row| all.release(row, tag(body.id)));
        }
        self.bodies = bodies;
        self.links = links;
        let bodies = self.bodies.iter().enumerate();
        self.sharing.clear();
        self.sharing
            .extend(bodies.filter(|(_, body)| body.shares).map(|(k, _)| k));
        self.adopted = true;
        self.entries.clear();
        for (k, body) in self.bodies.iter().enumerate() {
            let k = u32::try_from(k).unwrap_or(u32::MAX);
            self.entries.entry(tag(body.id)).or_default().push(k);
        }
    }

    /// Maps the bodies again that the search marked, and those that share cells.
    pub(super) fn settle(&mut self) {
        for one in &self.again {
            let body = &mut self.bodies[one.body];
            body.again = false;
            body.shares &= !one.shared;
        }
        self.sharing.retain(|&body| self.bodies[body].shares);
        let (again, found) = (&self.again, &self.found);
        let (bodies, slab) = (&self.bodies, &self.slab);
        let shared = || again.iter().filter(|one| one.shared);
        // Rows that bodies release, then rows that they occupy.
        let before = |one: &RemapRequest| match &bodies[one.body] {
            body if one.moved => &body.other,
            body => &body.rows,
        };
        let lost = || found.iter().flat_map(|found| &found.lost);
        let gained = || found.iter().flat_map(|found| &found.gained);

        // Each thread assigns layers with about equally many rows.
        let mut rows_below = std::mem::take(&mut self.rows_below);
        rows_below.clear();
        rows_below.resize(slab.layers() + 1, 0);
        let mut count = |row: Row| rows_below[slab.layer(row) + 1] += 1;
        lost().chain(gained()).for_each(|(_, row)| count(*row));
        for one in shared() {
            before(one).rows().for_each(&mut count);
            bodies[one.body].rows.rows().for_each(&mut count);
        }
        for layer in 1..rows_below.len() {
            rows_below[layer] += rows_below[layer - 1];
        }
        let all = rows_below[slab.layers()];
        let pieces = thread_pool::threads().min(all / ROWS_PER_THREAD).max(1);
        let bound = |piece: usize| match piece {
            piece if piece == pieces => slab.layers(),
            piece => rows_below.partition_point(|&rows| rows * pieces < all * piece),
        };
        // Buffers of further threads are kept for later use.
        self.settled
            .resize_with(pieces.max(self.settled.len()), Settled::default);
        let cells = slab.cells_of_a_layer();
        let cuts = (
            thread_pool::cut(&mut self.owner, pieces, |piece| cells * bound(piece)),
            thread_pool::evenly(&mut self.settled[..pieces], pieces),
        );
        thread_pool::each_of(pieces, cuts, |piece, (owner, settled)| {
            let Settled { changes, sharing } = &mut settled[0];
            changes.clear();
            let mut own = Layers {
                slab,
                owner,
                layers: bound(piece)..bound(piece + 1),
                changes,
                sharing,
            };
            // All cells are released first, so that no body takes a cell that another is about to release.
            for one in shared() {
                let mine = tag(bodies[one.body].id);
                own.each(before(one), |own, row| own.release(row, mine));
            }
            for &(body, row) in lost() {
                own.release(row, tag(bodies[body].id));
            }
            for &(body, row) in gained() {
                own.occupy(row, body, tag(bodies[body].id));
            }
            for one in shared() {
                let Mapped { id, rows, .. } = &bodies[one.body];
                own.each(rows, |own, row| own.occupy(row, one.body, tag(*id)));
            }
            for change in &*own.changes {
                if let Some(owner) = own.index(change.cell) {
                    own.owner[owner] &= !NOTED;
                }
            }
        });
        self.rows_below = rows_below;
        // Changes by bodies that are gone.
        for change in &self.changes {
            self.owner[self.slab.layout_index(change.cell)] &= !NOTED;
        }
        for settled in &mut self.settled {
            self.changes.append(&mut settled.changes);
            let there = settled.sharing.there.drain(..);
            let there = there.filter_map(|tag| self.entries.get(&tag)).flatten();
            let there = there.map(|&body| body as usize);
            for body in settled.sharing.came.drain(..).chain(there) {
                if !self.bodies[body].shares {
                    self.bodies[body].shares = true;
                    self.sharing.push(body);
                }
            }
        }
    }
}

impl Layers<'_> {
    /// Returns the index of a cell among those of these layers.
    fn index(&self, cell: [i32; 3]) -> Option<usize> {
        let first = self.layers.start * self.slab.cells_of_a_layer();
        let place = self.slab.layout_index(cell).wrapping_sub(first);
        (place < self.owner.len()).then_some(place)
    }

    /// Returns the index range of the cells of a row; empty for other layers.
    fn row(&self, row: Row) -> Range<usize> {
        let first = [row.span[0], row.y, row.z];
        let first = self.index(first).filter(|_| row.length() > 0);
        first.map_or(0..0, |first| first..first + row.length())
    }

    /// Calls `change` with the rows of these layers.
    fn each(&mut self, rows: &Rows, mut change: impl FnMut(&mut Self, Row)) {
        for row in rows.rows() {
            change(self, row);
        }
    }

    /// Sets the owner of a cell, and records the owner before this update.
    fn set(&mut self, cell: [i32; 3], place: usize, owner: u32) {
        let before = self.owner[place];
        if before & NOTED == 0 {
            self.changes.push(Change {
                cell,
                before,
                impulse: None,
            });
        }
        self.owner[place] = owner | NOTED;
    }

    /// Returns those cells of a row that a body owns to the water.
    fn release(&mut self, row: Row, mine: u32) {
        for (place, cell) in self.row(row).zip(row.cells()) {
            if self.owner[place] == mine {
                self.set(cell, place, FLUID);
            }
        }
    }

    /// Assigns the cells of a row to the body at an index, except those of bodies of lower id.
    fn occupy(&mut self, row: Row, body: usize, mine: u32) {
        for (place, cell) in self.row(row).zip(row.cells()) {
            let there = self.owner[place] & !NOTED;
            if there == OUTSIDE || there == mine {
                continue;
            }
            if there != FLUID {
                if self.sharing.came.last() != Some(&body) {
                    self.sharing.came.push(body);
                }
                if self.sharing.there.last() != Some(&there) {
                    self.sharing.there.push(there);
                }
                if there < mine {
                    continue;
                }
            }
            self.set(cell, place, mine);
        }
    }
}
