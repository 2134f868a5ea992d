//! The links that cross the surfaces of bodies.

use super::{BodyMap, FLUID, OUTSIDE, tag};
use crate::lbm::lanes::Stored;
use crate::lbm::links::BodyLink;
use crate::lbm::populations::Populations;

impl BodyMap {
    pub(super) fn flag(&mut self, owner: u32) {
        if owner != FLUID
            && owner != OUTSIDE
            && let Some(entries) = self.entries.get(&owner)
        {
            for &k in entries {
                self.relink[k as usize] = true;
            }
        }
    }

    /// The image of a body nearest to a cell, with its frame.
    pub(super) fn nearest(&self, owner: u32, cell: [i32; 3]) -> Option<(usize, [i32; 3])> {
        let entries = self.entries.get(&owner)?;
        entries
            .iter()
            .map(|&k| {
                let k = k as usize;
                let frame = self.frame(self.bodies[k].shift);
                let d2: f64 = (0..self.dimension)
                    .map(|a| {
                        (f64::from(cell[a] - frame[a]) + 0.5 - self.motion[k].position[a]).powi(2)
                    })
                    .sum();
                (d2, k, frame)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, k, frame)| (k, frame))
    }

    /// Finds the links of body `k`.
    pub(super) fn link<S: Stored>(
        &self,
        k: usize,
        populations: &Populations<S>,
        links: &mut Vec<BodyLink>,
    ) {
        let mine = tag(self.bodies[k].id);
        let frame = self.frame(self.bodies[k].shift);
        links.clear();
        let velocities = populations.velocities();
        for &inner in &self.bodies[k].cells {
            if self.owner[self.at(inner)] != mine {
                continue;
            }
            for out in 1..velocities.q() {
                let c = velocities.c[out].map(i32::from);
                let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + c[a]);
                if !self.held(outer) {
                    continue;
                }
                let there = self.owner[self.at(outer)];
                let between = there != FLUID;
                // A link between two bodies is the business of the one with the lower id.
                if there == mine || there == OUTSIDE || (between && there < mine) {
                    continue;
                }
                if self.cut(inner, out) {
                    continue;
                }
                let mine_to_do = self.interior(outer);
                if !mine_to_do && !self.interior(inner) {
                    continue;
                }
                let i = velocities.opposite[out];
                let behind: [i32; 3] = std::array::from_fn(|a| outer[a] + c[a]);
                let backed = self.held(behind)
                    && self.owner[self.at(behind)] == FLUID
                    && !self.cut(outer, out);
                let moves = match self.rules.isolated {
                    None => true,
                    Some(limit) => self.solid_neighbours(outer, populations) < limit,
                };
                links.push(BodyLink {
                    link: populations.link(populations.cell(outer.map(|v| v as isize)), i),
                    middle: std::array::from_fn(|a| {
                        if a < self.dimension {
                            2 * (outer[a] - frame[a]) + 1 - c[a]
                        } else {
                            0
                        }
                    }),
                    direction: u8::try_from(i).unwrap_or(0),
                    loads: mine_to_do && !between,
                    moves,
                    backed,
                });
            }
        }
    }

    /// Whether a sheet cuts the link from a cell along a direction: it is the sheet's.
    fn cut(&self, cell: [i32; 3], direction: usize) -> bool {
        !self.sheets.is_empty()
            && u8::try_from(direction).is_ok_and(|d| self.sheets.contains(&(self.at(cell), d)))
    }

    /// Whether bodies, and walls beside them, hold more than half of the neighbours of a cell of the slab (local coordinates).
    #[must_use]
    pub fn encloses<S: Stored>(&self, cell: [usize; 3], populations: &Populations<S>) -> bool {
        let velocities = populations.velocities();
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let (mut bodies, mut walls) = (0, 0);
        for c in &velocities.c[1..] {
            let near: [i32; 3] = std::array::from_fn(|a| cell[a] + i32::from(c[a]));
            match self.owner[self.at(near)] {
                FLUID => {}
                OUTSIDE => walls += 1,
                _ => bodies += 1,
            }
        }
        bodies > 0 && 2 * (bodies + walls) > velocities.q() - 1
    }

    fn solid_neighbours<S: Stored>(&self, cell: [i32; 3], populations: &Populations<S>) -> usize {
        let velocities = populations.velocities();
        (1..velocities.q())
            .filter(|&i| {
                let near: [i32; 3] =
                    std::array::from_fn(|a| cell[a] + i32::from(velocities.c[i][a]));
                self.owner[self.at(near)] != FLUID
            })
            .count()
    }
}
