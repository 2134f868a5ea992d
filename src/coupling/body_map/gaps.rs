//! Cells of narrow gaps: water with many solid neighbours, where surfaces share one velocity ([`lbm::links::gaps`]).

use super::{BodyMap, FLUID, JOINT, OUTSIDE, PER_THREAD};
use base::thread_pool;
use lbm::boundary::{FacePart, SurfaceKind};
use lbm::links::Rigid;
use lbm::links::gaps::{BodyLinks, Gaps, Neighbour};

/// Number of solid neighbours that a cell next to a wall or structure needs in addition. A flat wall alone has three of
/// eight, and the velocity of a wall differs more from that of a body which passes it than those of bodies that touch.
const MORE_AT_WALLS: usize = 2;

/// Rule for the cells of narrow gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NarrowGaps {
    /// Minimum number of solid neighbours; with a mean velocity, two more next to walls and structures.
    pub solid_neighbours: usize,
    /// Velocity of the surfaces.
    pub velocity: GapVelocity,
}

/// Velocity of the surfaces in a narrow gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapVelocity {
    /// Mean velocity of the bodies around the cell; next to a wall or a structure its velocity.
    Mean,
    /// Zero (Sibille, Lomine and Marot 2012), which is not Galilean invariant.
    Zero,
}

/// Solid next to a cell of water.
struct Solid {
    owner: u32,
    /// Index of the part of a face of the domain that it is, if that moves.
    wall: Option<u32>,
    /// Cell of which the cell of water is the image, where the solid is an image across planes of symmetry.
    cell: [i32; 3],
    signs: [i8; 3],
}

/// Surface between the domain and a cell beyond it.
#[derive(Clone, Copy, Debug)]
enum Beyond {
    Opening,
    /// Index of the part of a face.
    MovingWall(u32),
    AtRest,
}

/// Solids around a cell of a narrow gap that determine its velocity.
#[derive(Default)]
struct Around {
    bodies: Vec<Neighbour>,
    wall: Option<u32>,
}

impl BodyMap {
    /// Sets the parts of the faces of the domain, with the velocities of walls in the next step.
    pub fn set_faces(&mut self, parts: impl Iterator<Item = FacePart>) {
        if !self.has_mean_gaps() {
            return;
        }
        self.at_faces.parts.clear();
        self.at_faces.parts.extend(parts);
    }

    /// Returns the solid in the neighbour of a cell along a direction; none if there is water.
    fn solid_beside(&self, cell: [i32; 3], place: usize, direction: usize) -> Option<Solid> {
        let along = &self.directions[direction];
        let mut solid = Solid {
            owner: self.owner[place.wrapping_add_signed(along.map_offset)],
            wall: None,
            cell,
            signs: [1; 3],
        };
        if solid.owner != OUTSIDE {
            return (solid.owner != FLUID).then_some(solid);
        }
        let near: [i32; 3] = std::array::from_fn(|a| cell[a] + along.c[a]);
        let image = self.slab.grid.image(self.slab.dimension, near);
        if let Some(image) = image.filter(|image| self.slab.held(*image)) {
            solid.owner = self.owner[self.slab.layout_index(image)];
            for a in (0..3).filter(|a| image[*a] != near[*a]) {
                solid.cell[a] = image[a] + along.c[a];
                solid.signs[a] = -1;
            }
            return (solid.owner != FLUID).then_some(solid);
        }
        match self.beyond_faces(near) {
            Beyond::Opening if self.has_mean_gaps() => None,
            Beyond::MovingWall(part) => {
                solid.wall = Some(part);
                Some(solid)
            }
            Beyond::Opening | Beyond::AtRest => Some(solid),
        }
    }

    /// Returns the surface between the domain and a cell that is not in it. That at rest takes precedence, then that
    /// of a moving wall; a structure is at rest.
    fn beyond_faces(&self, near: [i32; 3]) -> Beyond {
        let grid = &self.slab.grid;
        let global: [i64; 3] =
            std::array::from_fn(|a| i64::from(near[a]) + grid.start[a].cast_signed() as i64);
        let cells = grid.cells.map(|n| n.cast_signed() as i64);
        let point = std::array::from_fn(|a| global[a].clamp(0, cells[a] - 1) as f64 + 0.5);
        let mut beyond = None;
        for a in 0..self.slab.dimension {
            if grid.periodic[a] || (0..cells[a]).contains(&global[a]) {
                continue;
            }
            let upper = global[a] >= cells[a];
            let part = self
                .at_faces
                .parts
                .iter()
                .rposition(|part| part.axis == a && part.upper == upper && part.holds(point));
            let here = match part.map(|part| (part, self.at_faces.parts[part].surface)) {
                Some((_, SurfaceKind::Opening)) => Beyond::Opening,
                Some((part, SurfaceKind::MovingWall)) => {
                    Beyond::MovingWall(u32::try_from(part).unwrap_or(u32::MAX))
                }
                _ => Beyond::AtRest,
            };
            beyond = Some(match (beyond, here) {
                (None | Some(Beyond::Opening), here) => here,
                (Some(Beyond::MovingWall(part)), Beyond::Opening | Beyond::MovingWall(_)) => {
                    Beyond::MovingWall(part)
                }
                (Some(_), _) => Beyond::AtRest,
            });
        }
        beyond.unwrap_or(Beyond::AtRest)
    }

    fn has_mean_gaps(&self) -> bool {
        let rule = self.rules.narrow.map(|rule| rule.velocity);
        rule == Some(GapVelocity::Mean)
    }

    /// Returns `true` if a cell has so many solid neighbours that it is in a narrow gap.
    fn is_narrow(&self, cell: [i32; 3], place: usize) -> bool {
        self.rules.narrow.is_some_and(|rule| {
            let (mut solid, mut limit) = (0, rule.solid_neighbours);
            for direction in 1..self.directions.len() {
                let Some(near) = self.solid_beside(cell, place, direction) else {
                    continue;
                };
                solid += 1;
                if self.has_mean_gaps() && (near.owner == OUTSIDE || near.owner == JOINT) {
                    limit = rule.solid_neighbours + MORE_AT_WALLS;
                }
            }
            solid >= limit
        })
    }

    /// Returns the index of the narrow gap at a cell, which is added if it is not listed; none if the cell is not in a
    /// narrow gap. `signs` are those of the velocity at the link.
    pub(super) fn gap_at(
        &self,
        cell: [i32; 3],
        place: usize,
        signs: [i8; 3],
        gaps: &mut Gaps,
    ) -> Option<u32> {
        // A cell of a joint has no water of its own: surfaces are at rest there.
        let joint = self.owner[place] == JOINT;
        (joint || self.is_narrow(cell, place)).then(|| {
            gaps.find(cell).unwrap_or_else(|| {
                let around = if joint || !self.has_mean_gaps() {
                    Around::default()
                } else {
                    self.around(cell, place, signs)
                };
                gaps.add(cell, around.bodies, around.wall)
            })
        })
    }

    /// Returns the bodies or the moving wall around a cell; none if a neighbour is at rest.
    fn around(&self, cell: [i32; 3], place: usize, signs: [i8; 3]) -> Around {
        let mut around = Around::default();
        for direction in 1..self.directions.len() {
            let Some(solid) = self.solid_beside(cell, place, direction) else {
                continue;
            };
            if let Some(wall) = solid.wall {
                around.wall.get_or_insert(wall);
                continue;
            }
            if solid.owner == OUTSIDE || solid.owner == JOINT {
                return Around::default();
            }
            let signs = std::array::from_fn(|a| signs[a] * solid.signs[a]);
            let same = |near: &&mut Neighbour| {
                near.tag == solid.owner && near.cell == solid.cell && near.signs == signs
            };
            if let Some(near) = around.bodies.iter_mut().find(same) {
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
                    around.bodies.push(near);
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
        if !self.has_mean_gaps() {
            return;
        }
        let (motion, faces) = (&self.motion, &self.at_faces.parts);
        let renew: fn(&mut Gaps, &[Rigid], &[FacePart]) = if self.slab.dimension == 2 {
            Gaps::renew::<2>
        } else {
            Gaps::renew::<3>
        };
        thread_pool::each_item_in_runs(&mut self.links, PER_THREAD, |_, links: &mut BodyLinks| {
            renew(&mut links.gaps, motion, faces);
        });
        if self.slab.mirrors() {
            for body in &mut self.bodies {
                renew(&mut body.mirrored_gaps, motion, faces);
            }
        }
    }
}
