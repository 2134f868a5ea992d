//! The links that cross the surfaces of bodies.

use super::rows::Row;
use super::slab::Slab;
use super::{BodyMap, FLUID, OUTSIDE, tag};
use lbm::lanes::Stored;
use lbm::links::BodyLink;
use lbm::links::gaps::{BodyLinks, GapLink};
use lbm::populations::Populations;
use std::sync::atomic::Ordering;

/// Direction of the lattice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub(super) c: [i32; 3],
    /// Index offset in the map, then in the lattice.
    pub(super) map_offset: isize,
    pub(super) lattice_offset: isize,
    pub(super) opposite: usize,
}

/// Returns the directions of a lattice.
pub(super) fn directions<S: Stored>(slab: &Slab, populations: &Populations<S>) -> Vec<Direction> {
    let velocities = populations.velocities();
    (0..velocities.q())
        .map(|i| Direction {
            c: velocities.c[i].map(i32::from),
            map_offset: slab.step(velocities.c[i]),
            lattice_offset: populations.offset(i),
            opposite: velocities.opposite[i],
        })
        .collect()
}

impl BodyMap {
    /// Requests new links for every body with cells near a changed cell.
    pub(super) fn relink_around(&self, cell: [i32; 3], before: u32, reach: i32) {
        // Most neighbours belong to the same body.
        let mut last = [FLUID, OUTSIDE, FLUID];
        let mut flag = |owner: u32| {
            if last.contains(&owner) {
                return;
            }
            last[2] = owner;
            for &k in self.entries.get(&owner).into_iter().flatten() {
                self.relink[k as usize].store(true, Ordering::Relaxed);
            }
        };
        flag(before);
        let deep = if self.slab.dimension == 3 { reach } else { 0 };
        for dz in -deep..=deep {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let near = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
                    if self.slab.held(near) {
                        flag(self.owner[self.slab.layout_index(near)]);
                    }
                }
            }
        }
    }

    /// Returns the image of a body nearest to a cell, with its frame.
    pub(super) fn nearest(&self, owner: u32, cell: [i32; 3]) -> Option<(usize, [i32; 3])> {
        let entries = self.entries.get(&owner)?;
        entries
            .iter()
            .map(|&k| {
                let k = k as usize;
                let frame = self.slab.frame(self.bodies[k].shift);
                let d2: f64 = (0..self.slab.dimension)
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
        links: &mut BodyLinks,
    ) {
        let mine = tag(self.bodies[k].id);
        let frame = self.slab.frame(self.bodies[k].shift);
        let owner = |place: usize, along: &Direction| {
            let place = place.wrapping_add_signed(along.map_offset);
            (place, self.owner[place])
        };
        links.clear();
        let directions = &self.directions;
        // Cells beyond the ends of a row have only neighbours that belong to this body or another of lower id.
        let rows = &self.bodies[k].rows;
        let ends = rows
            .rows()
            .flat_map(|row| rows.ends(row, self.slab.dimension == 3));
        for inner in ends.flat_map(Row::cells) {
            let place = self.slab.layout_index(inner);
            if self.owner[place] != mine {
                continue;
            }
            // All cells read by the link are in the slab.
            let deep = self.slab.deep(inner);
            let cell = populations.cell(inner.map(|v| v as isize));
            let mut meets = false;
            for (out, along) in directions.iter().enumerate().skip(1) {
                let c = along.c;
                let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + c[a]);
                if !deep && !self.slab.held(outer) {
                    continue;
                }
                let (outer_place, there) = owner(place, along);
                let between = there != FLUID;
                meets |= between && there != mine;
                // A link between two bodies is treated by the one with the lower id.
                if there == mine || there == OUTSIDE || (between && there < mine) {
                    continue;
                }
                if self.cut(place, out) {
                    continue;
                }
                let mine_to_do = deep || self.slab.interior(outer);
                if !mine_to_do && !self.slab.interior(inner) {
                    continue;
                }
                let behind: [i32; 3] = std::array::from_fn(|a| outer[a] + c[a]);
                let backed = (deep || self.slab.held(behind))
                    && (owner(outer_place, along).1 == FLUID || self.is_mirrored_water(behind))
                    && !self.cut(outer_place, out);
                let link = BodyLink {
                    link: populations.link(
                        cell.wrapping_add_signed(along.lattice_offset),
                        along.opposite,
                    ),
                    middle: std::array::from_fn(|a| {
                        if a < self.slab.dimension {
                            2 * (outer[a] - frame[a]) + 1 - c[a]
                        } else {
                            0
                        }
                    }),
                    direction: u8::try_from(along.opposite).unwrap_or(0),
                    loads: mine_to_do && !between,
                    backed,
                };
                match self.gap_at(outer, outer_place, [1; 3], &mut links.gaps) {
                    Some(gap) => links.narrow.push(GapLink { link, gap }),
                    None => links.open.push(link),
                }
                if mine_to_do && !between && !deep {
                    self.feet_at(k, outer, inner, populations, &mut links.feet);
                }
            }
            if meets {
                self.corners_at(k, inner, populations, links);
            }
        }
    }

    /// Returns `true` if a sheet cuts the link from the cell at an index of the map along a direction: the link
    /// then belongs to the sheet.
    pub(super) fn cut(&self, place: usize, direction: usize) -> bool {
        !self.sheets.is_empty()
            && u8::try_from(direction).is_ok_and(|d| self.sheets.contains(&(place, d)))
    }

    /// Returns `true` if bodies, and walls next to them, occupy more than half of the neighbours of a cell of the
    /// slab (local coordinates).
    #[must_use]
    pub fn encloses<S: Stored>(&self, cell: [usize; 3], populations: &Populations<S>) -> bool {
        let velocities = populations.velocities();
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let (mut bodies, mut walls) = (0, 0);
        for c in &velocities.c[1..] {
            let near: [i32; 3] = std::array::from_fn(|a| cell[a] + i32::from(c[a]));
            match self.owner[self.slab.layout_index(near)] {
                FLUID => {}
                OUTSIDE => walls += 1,
                _ => bodies += 1,
            }
        }
        bodies > 0 && 2 * (bodies + walls) > velocities.q() - 1
    }
}
