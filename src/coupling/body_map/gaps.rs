//! Cells of narrow gaps: water with many solid neighbours, where surfaces share one velocity ([`lbm::links::gaps`]).

use super::{BodyMap, FLUID, JOINT, OUTSIDE, PER_THREAD};
use base::thread_pool;
use lbm::links::Rigid;
use lbm::links::gaps::{BodyLinks, Gaps, Neighbour};

/// Rule for the cells of narrow gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NarrowGaps {
    /// Minimum number of solid neighbours.
    pub solid_neighbours: usize,
    /// Velocity of the surfaces.
    pub velocity: GapVelocity,
}

/// Velocity of the surfaces in a narrow gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapVelocity {
    /// Mean velocity of the bodies around the cell; zero next to a solid at rest.
    Mean,
    /// Zero (Sibille, Lomine and Marot 2012), which is not Galilean invariant.
    Zero,
}

/// Solid next to a cell of water.
struct Solid {
    owner: u32,
    /// Cell of which the cell of water is the image, where the solid is an image across planes of symmetry.
    cell: [i32; 3],
    signs: [f64; 3],
}

impl BodyMap {
    /// Returns the solid in the neighbour of a cell along a direction; none if there is water.
    fn solid_beside(&self, cell: [i32; 3], place: usize, direction: usize) -> Option<Solid> {
        let along = &self.directions[direction];
        let mut solid = Solid {
            owner: self.owner[place.wrapping_add_signed(along.map_offset)],
            cell,
            signs: [1.0; 3],
        };
        if solid.owner == OUTSIDE && self.slab.mirrors() {
            let near: [i32; 3] = std::array::from_fn(|a| cell[a] + along.c[a]);
            let image = self.slab.grid.image(self.slab.dimension, near);
            if let Some(image) = image.filter(|image| self.slab.held(*image)) {
                solid.owner = self.owner[self.slab.layout_index(image)];
                for a in (0..3).filter(|a| image[*a] != near[*a]) {
                    solid.cell[a] = image[a] + along.c[a];
                    solid.signs[a] = -1.0;
                }
            }
        }
        (solid.owner != FLUID).then_some(solid)
    }

    /// Returns `true` if a cell has so many solid neighbours that it is in a narrow gap.
    fn is_narrow(&self, cell: [i32; 3], place: usize) -> bool {
        self.rules.narrow.is_some_and(|rule| {
            let near = 1..self.directions.len();
            let solid =
                near.filter(|&direction| self.solid_beside(cell, place, direction).is_some());
            solid.count() >= rule.solid_neighbours
        })
    }

    /// Returns the index of the narrow gap at a cell, which is added if it is not listed; none if the cell is not in a
    /// narrow gap. `signs` are those of the velocity at the link.
    pub(super) fn gap_at(
        &self,
        cell: [i32; 3],
        place: usize,
        signs: [f64; 3],
        gaps: &mut Gaps,
    ) -> Option<u32> {
        // A cell of a joint has no water of its own: surfaces are at rest there.
        let joint = self.owner[place] == JOINT;
        (joint || self.is_narrow(cell, place)).then(|| {
            gaps.find(cell).unwrap_or_else(|| {
                let around = if joint {
                    Vec::new()
                } else {
                    self.bodies_around(cell, place, signs)
                };
                gaps.add(cell, around.into_iter())
            })
        })
    }

    /// Returns the bodies around a cell; none if a neighbour is at rest, and if the rule is a velocity of zero.
    fn bodies_around(&self, cell: [i32; 3], place: usize, signs: [f64; 3]) -> Vec<Neighbour> {
        let rule = self.rules.narrow.map(|rule| rule.velocity);
        let mut around: Vec<Neighbour> = Vec::new();
        if rule != Some(GapVelocity::Mean) {
            return around;
        }
        for direction in 1..self.directions.len() {
            let Some(solid) = self.solid_beside(cell, place, direction) else {
                continue;
            };
            if solid.owner == OUTSIDE || solid.owner == JOINT {
                return Vec::new();
            }
            let signs = std::array::from_fn(|a| signs[a] * solid.signs[a]);
            let same = |near: &&mut Neighbour| {
                near.tag == solid.owner && near.cell == solid.cell && near.signs == signs
            };
            if let Some(near) = around.iter_mut().find(same) {
                near.cells += 1;
            } else {
                let mut near = Neighbour {
                    tag: solid.owner,
                    entry: 0,
                    cells: 1,
                    cell: solid.cell,
                    at: [0; 3],
                    signs,
                };
                if self.find_motion(&mut near) {
                    around.push(near);
                }
            }
        }
        around
    }

    /// Returns `true` if the body next to a gap is mapped, after finding its motion.
    fn find_motion(&self, near: &mut Neighbour) -> bool {
        let Some((entry, frame)) = self.nearest(near.tag, near.cell) else {
            return false;
        };
        near.entry = u32::try_from(entry).unwrap_or(u32::MAX);
        for a in 0..self.slab.dimension {
            near.at[a] = 2 * (near.cell[a] - frame[a]) + 1;
        }
        true
    }

    /// Finds the motions of the bodies next to all gaps again, after the entries have changed.
    pub(super) fn find_motions_in_gaps(&mut self) {
        let mut links = std::mem::take(&mut self.links);
        for gaps in links.iter_mut().map(|links| &mut links.gaps) {
            self.find_motions(gaps);
        }
        self.links = links;
        for k in 0..self.bodies.len() {
            let mut gaps = std::mem::take(&mut self.bodies[k].mirrored_gaps);
            self.find_motions(&mut gaps);
            self.bodies[k].mirrored_gaps = gaps;
        }
    }

    fn find_motions(&self, gaps: &mut Gaps) {
        for near in gaps.neighbours_mut() {
            self.find_motion(near);
        }
    }

    /// Computes the velocities in gaps from the present motions of the bodies.
    pub(super) fn renew_gaps(&mut self) {
        let mean = |rule: NarrowGaps| rule.velocity == GapVelocity::Mean;
        if !self.rules.narrow.is_some_and(mean) {
            return;
        }
        let motion = &self.motion;
        let renew: fn(&mut Gaps, &[Rigid]) = if self.slab.dimension == 2 {
            Gaps::renew::<2>
        } else {
            Gaps::renew::<3>
        };
        thread_pool::each_item_in_runs(&mut self.links, PER_THREAD, |_, links: &mut BodyLinks| {
            renew(&mut links.gaps, motion);
        });
        if self.slab.mirrors() {
            for body in &mut self.bodies {
                renew(&mut body.mirrored_gaps, motion);
            }
        }
    }
}
