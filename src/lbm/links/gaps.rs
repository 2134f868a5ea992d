//! Velocity with which surfaces reflect in narrow gaps between bodies.
//!
//! A cell between two bodies that approach each other receives mass on every link, until it is covered. In narrow gaps
//! all links of a cell therefore have the same velocity, with which no mass is added to an enclosed cell: the weights
//! of all directions balance, `sum w_i c_i = 0`. It is the mean velocity at the cell of the bodies around it, each
//! counted once for each of its cells next to this cell. Bodies that move together with their fluid exert no force
//! on it: the rule is Galilean invariant. Next to a structure or a wall of the domain the velocity is theirs.

use super::{BodyLink, CornerLink, FootLink, Rigid, StructureCorner, surface_velocity};
use crate::boundary::FacePart;

/// Body with cells next to a cell of a narrow gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Tag of the body in the map of its owner.
    pub tag: u32,
    /// Index of its motion.
    pub entry: u32,
    /// Number of its cells next to the cell of the gap.
    pub cells: u32,
    /// Cell at which the velocity is taken (local coordinates): that of the gap, or its image if the neighbour is the
    /// image of the body across planes of symmetry.
    pub cell: [i32; 3],
    /// Centre of that cell in half cells, in the frame of the body's raw position.
    pub at: [i32; 3],
    /// Factor 1 of each component of the velocity; -1 across a plane of symmetry.
    pub signs: [i8; 3],
}

/// Cell of a narrow gap.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gap {
    cell: [i32; 3],
    /// Part of a face of the domain whose velocity the gap has.
    wall: Option<u32>,
    /// One past the last of its neighbours; they follow those of the gap before it.
    end: usize,
    velocity: [f64; 3],
}

/// Cells of narrow gaps next to a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaps {
    gaps: Vec<Gap>,
    neighbours: Vec<Neighbour>,
}

impl Gaps {
    /// Removes all cells.
    pub fn clear(&mut self) {
        self.gaps.clear();
        self.neighbours.clear();
    }

    /// Returns the index of a cell (local coordinates); none if it is not listed.
    #[must_use]
    pub fn find(&self, cell: [i32; 3]) -> Option<u32> {
        let at = self.gaps.iter().rposition(|gap| gap.cell == cell)?;
        u32::try_from(at).ok()
    }

    /// Adds a cell with the bodies around it, or the moving wall next to it (the index of a part of a face), and
    /// returns its index. Without both its velocity is zero.
    pub fn add(
        &mut self,
        cell: [i32; 3],
        neighbours: impl IntoIterator<Item = Neighbour>,
        wall: Option<u32>,
    ) -> u32 {
        self.neighbours.extend(neighbours);
        self.gaps.push(Gap {
            cell,
            wall,
            end: self.neighbours.len(),
            velocity: [0.0; 3],
        });
        u32::try_from(self.gaps.len() - 1).unwrap_or(u32::MAX)
    }

    /// Returns the bodies around all cells, to change their indices.
    pub fn neighbours_mut(&mut self) -> &mut [Neighbour] {
        &mut self.neighbours
    }

    /// Returns the velocity in a gap \[cells per step\], as last computed.
    #[inline(always)]
    #[must_use]
    pub fn velocity(&self, gap: u32) -> [f64; 3] {
        self.gaps[gap as usize].velocity
    }

    /// Computes the velocities of all gaps from the motions of the bodies and the parts of the faces.
    pub fn renew<const D: usize>(&mut self, motion: &[Rigid], faces: &[FacePart]) {
        let mut first = 0;
        for gap in &mut self.gaps {
            let (mut sum, mut cells) = ([0.0; 3], 0.0);
            for near in &self.neighbours[first..gap.end] {
                let motion = &motion[near.entry as usize];
                let r = std::array::from_fn(|a| 0.5 * f64::from(near.at[a]) - motion.position[a]);
                let velocity = surface_velocity::<D>(motion, r);
                let count = f64::from(near.cells);
                for a in 0..D {
                    sum[a] += count * f64::from(near.signs[a]) * velocity[a];
                }
                cells += count;
            }
            if let Some(wall) = gap.wall {
                gap.velocity = faces[wall as usize].velocity;
            } else if cells > 0.0 {
                gap.velocity = sum.map(|part| part / cells);
            }
            first = gap.end;
        }
    }
}

/// Link from a cell of a narrow gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GapLink {
    /// The link.
    pub link: BodyLink,
    /// Index of the gap.
    pub gap: u32,
}

impl AsRef<BodyLink> for GapLink {
    fn as_ref(&self) -> &BodyLink {
        &self.link
    }
}

/// Links that cross the surface of a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyLinks {
    /// Links that reflect with the velocity of the surface.
    pub open: Vec<BodyLink>,
    /// Links that reflect with the velocity of a narrow gap.
    pub narrow: Vec<GapLink>,
    /// Narrow gaps of these links.
    pub gaps: Gaps,
    /// Links through faces of the domain next to the body.
    pub feet: Vec<FootLink>,
    /// Links in corners with other bodies.
    pub corners: Vec<CornerLink>,
    /// Links in corners with structures.
    pub at_structures: Vec<StructureCorner>,
}

impl BodyLinks {
    /// Removes all links.
    pub fn clear(&mut self) {
        self.open.clear();
        self.narrow.clear();
        self.gaps.clear();
        self.feet.clear();
        self.corners.clear();
        self.at_structures.clear();
    }

    /// Returns the number of links, without those through faces.
    #[must_use]
    pub fn count(&self) -> usize {
        self.open.len() + self.narrow.len()
    }

    /// Returns all links with the velocity of the surface at their midpoints.
    pub fn with_velocities<const D: usize>(
        &self,
        motion: &Rigid,
    ) -> impl Iterator<Item = (&BodyLink, [f64; 3])> {
        let open = self.open.iter().map(|link| {
            let r = std::array::from_fn(|a| 0.5 * f64::from(link.middle[a]) - motion.position[a]);
            (link, surface_velocity::<D>(motion, r))
        });
        let narrow = self.narrow.iter();
        open.chain(narrow.map(|narrow| (&narrow.link, self.gaps.velocity(narrow.gap))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn neighbour(entry: u32, cells: u32, signs: [i8; 3]) -> Neighbour {
        Neighbour {
            tag: entry + 1,
            entry,
            cells,
            cell: [3, 4, 0],
            at: [7, 9, 0],
            signs,
        }
    }

    /// Checks the mean against hand computation: the point of a turning body, and an image across a plane.
    #[test]
    fn the_velocity_of_a_gap_is_the_mean_of_its_bodies() {
        let motion = [
            Rigid {
                position: [1.5, 4.5, 0.0],
                velocity: [0.01, 0.0, 0.0],
                spin: [0.0, 0.0, 0.002],
                radius: 1.6,
            },
            Rigid {
                position: [6.0, 4.5, 0.0],
                velocity: [-0.02, 0.03, 0.0],
                ..Rigid::default()
            },
        ];
        let mut gaps = Gaps::default();
        let still = gaps.add([0; 3], [], None);
        let around = [neighbour(0, 3, [1; 3]), neighbour(1, 2, [1, -1, 1])];
        let gap = gaps.add([3, 4, 0], around, None);
        gaps.renew::<2>(&motion, &[]);
        assert_eq!(gaps.find([3, 4, 0]), Some(gap));
        assert_eq!(gaps.velocity(still), [0.0; 3]);
        // The gap is 2 cells right of the first centre: (0.01, 0.004). The second body counts twice: (-0.02, -0.03).
        let mean = [
            (3.0 * 0.01 - 2.0 * 0.02) / 5.0,
            (3.0 * 0.004 - 2.0 * 0.03) / 5.0,
        ];
        let found = gaps.velocity(gap);
        assert!((found[0] - mean[0]).abs() < 1e-15 && (found[1] - mean[1]).abs() < 1e-15);
    }
}
