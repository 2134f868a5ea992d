//! Links through the faces of the domain.

use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Link, Parity, Populations};

/// A link that leaves the domain through a patch.
pub struct Crossing<'a, S: Stored> {
    /// The slab.
    pub populations: &'a Populations<S>,
    /// Position of the cell that the link leaves.
    pub cell: usize,
    /// The cell in the whole domain.
    pub at: [usize; 3],
    /// Cells of the whole domain.
    pub cells: [usize; 3],
    /// Direction of the link.
    pub direction: usize,
    /// Along which axes it leaves the domain.
    pub outside: [bool; 3],
    /// Where it crosses the face, in cells; the first cell spans 0..1.
    pub middle: [f64; 3],
    /// Part of the surroundings of this point on the face that imposes a velocity, where one is imposed: less than 1 on the border of a patch.
    pub share: f64,
    /// The two numbers at its ends.
    pub link: Link,
}

impl<S: Stored> Crossing<'_, S> {
    /// c_i of the direction.
    #[must_use]
    pub fn velocity(&self) -> [i8; 3] {
        self.populations.velocities().c[self.direction]
    }

    /// w_i of the direction.
    #[must_use]
    pub fn weight(&self) -> f64 {
        self.populations.velocities().w[self.direction]
    }

    /// The link as rules keep it.
    #[must_use]
    pub fn face_link(&self) -> FaceLink {
        FaceLink {
            link: self.link,
            direction: self.direction,
        }
    }
}

/// A link through a face whose two ends are one population that leaves and one that enters.
#[derive(Clone, Copy, Debug)]
pub struct FaceLink {
    /// The two numbers at its ends.
    pub link: Link,
    /// Direction of the population that leaves.
    pub direction: usize,
}

/// A population that enters as the mirror image of one that left, of the same cell or of one beside it along the face.
#[derive(Clone, Copy, Debug)]
pub struct Mirror {
    from: [usize; 2],
    to: [usize; 2],
    /// The cells that the population leaves and enters: positions within an array.
    pub(crate) cells: [u32; 2],
    /// Direction of the outgoing population.
    pub(crate) leaves: usize,
    /// Direction of the incoming population.
    pub(crate) enters: usize,
}

impl Mirror {
    /// The population that enters along a link.
    #[must_use]
    pub fn new<S: Stored>(crossing: &Crossing<'_, S>) -> Self {
        let (populations, cell) = (crossing.populations, crossing.cell);
        let (i, outside) = (crossing.direction, crossing.outside);
        let velocities = populations.velocities();
        let enters = velocities.opposite[i];
        let c = velocities.c[enters];
        let mirrored: [i8; 3] = std::array::from_fn(|a| if outside[a] { -c[a] } else { c[a] });
        let along: [i8; 3] = std::array::from_fn(|a| if outside[a] { 0 } else { c[a] });
        let find = |v: [i8; 3]| velocities.c.iter().position(|&d| d == v).unwrap_or(0);
        let leaves = find(mirrored);
        let source = cell.wrapping_add_signed(-populations.offset(find(along)));
        // D3Q19 lacks corners, but the part of an edge direction along a face is an axis or rest: always in the set.
        let out = populations.link(source, leaves);
        let into = populations.link(cell, i);
        Self {
            from: [out.out(Parity::Home), out.out(Parity::Reversed)],
            to: [into.incoming(Parity::Home), into.incoming(Parity::Reversed)],
            // Both ends of a link lie in the array of their population behind the position of the cell.
            cells: [
                out.near - first(populations, velocities.opposite[leaves]),
                into.near - first(populations, velocities.opposite[i]),
            ],
            leaves,
            enters,
        }
    }

    pub(crate) fn ends(&self, parity: Parity) -> (usize, usize) {
        let k = usize::from(parity == Parity::Reversed);
        (self.from[k], self.to[k])
    }
}

/// Where the array of population `i` begins.
pub(super) fn first<S: Stored>(populations: &Populations<S>, i: usize) -> u32 {
    u32::try_from(populations.slot(0, i)).unwrap_or(u32::MAX)
}
