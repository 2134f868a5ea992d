//! The body that contains each cell near a slab.

use super::rows::Row;
use super::{Again, BodyMap, Change, FLUID, Mapped, OUTSIDE, tag};
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::lbm::links::BodyLink;
use std::collections::HashMap;

impl BodyMap {
    /// Gives each entry of the particles the map of the same body and image, and clears those that went away.
    pub(super) fn adopt<Sp: Space>(&mut self, particles: &Particles<Sp>) {
        let mut old: HashMap<(u64, [i32; 3]), (Mapped, Vec<BodyLink>)> = self
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
                (fresh, Vec::new())
            });
            bodies.push(mapped);
            links.push(list);
        }
        // What is left went away; in a fixed order, though no result depends on it.
        let mut gone: Vec<Mapped> = old.into_values().map(|(body, _)| body).collect();
        gone.sort_by_key(|body| (body.id, body.shift));
        for body in gone {
            for row in body.rows.rows() {
                self.release(row, tag(body.id));
            }
        }
        self.bodies = bodies;
        self.links = links;
        self.entries.clear();
        for (k, body) in self.bodies.iter().enumerate() {
            let k = u32::try_from(k).unwrap_or(u32::MAX);
            self.entries.entry(tag(body.id)).or_default().push(k);
        }
    }

    /// Remembers what a cell was before this call of `follow` changed it.
    fn note(&mut self, cell: [i32; 3], position: usize) {
        if self.stamp[position] != self.now {
            self.stamp[position] = self.now;
            self.changes.push(Change {
                cell,
                before: self.owner[position],
                impulse: None,
            });
        }
    }

    /// Gives the cells of a row that are a body's back to the water.
    fn release(&mut self, row: Row, mine: u32) {
        for cell in row.cells() {
            let position = self.slab.at(cell);
            if self.owner[position] == mine {
                self.note(cell, position);
                self.owner[position] = FLUID;
            }
        }
    }

    /// Maps again what looks have found and what shares cells.
    pub(super) fn settle(&mut self) {
        let (again, found) = (
            std::mem::take(&mut self.again),
            std::mem::take(&mut self.found),
        );
        // First all release cells, so that none takes what another is about to leave.
        for &Again {
            body,
            moved,
            shared,
        } in &again
        {
            self.bodies[body].again = false;
            if shared {
                self.bodies[body].shares = false;
                self.with_rows(body, moved, |map, row, mine| map.release(row, mine));
            }
        }
        for &(body, row) in found.iter().flat_map(|found| &found.lost) {
            self.release(row, tag(self.bodies[body].id));
        }
        for &(body, row) in found.iter().flat_map(|found| &found.gained) {
            self.occupy(row, body);
        }
        for one in again.iter().filter(|one| one.shared) {
            self.with_rows(one.body, false, |map, row, _| map.occupy(row, one.body));
        }
        self.again = again;
        self.found = found;
    }

    /// Calls `each` with the rows of a body, those before it moved or those now, and with its tag.
    fn with_rows(&mut self, k: usize, before: bool, each: impl Fn(&mut Self, Row, u32)) {
        let mine = tag(self.bodies[k].id);
        let rows = |body: &mut Mapped| {
            std::mem::take(if before {
                &mut body.other
            } else {
                &mut body.rows
            })
        };
        let rows = rows(&mut self.bodies[k]);
        for row in rows.rows() {
            each(self, row, mine);
        }
        let body = &mut self.bodies[k];
        *(if before {
            &mut body.other
        } else {
            &mut body.rows
        }) = rows;
    }

    /// Takes the cells of a row for body `k`, but those of bodies of lower id.
    fn occupy(&mut self, row: Row, k: usize) {
        let mine = tag(self.bodies[k].id);
        for cell in row.cells() {
            let position = self.slab.at(cell);
            let there = self.owner[position];
            if there == OUTSIDE {
                continue;
            }
            if there != FLUID && there != mine {
                self.bodies[k].shares = true;
                if let Some(others) = self.entries.get(&there) {
                    for &other in others {
                        self.bodies[other as usize].shares = true;
                    }
                }
                if there < mine {
                    continue;
                }
            }
            self.note(cell, position);
            self.owner[position] = mine;
        }
    }
}
