//! Free slip: populations are mirrored at the face, half-way beyond the last cell.
//!
//! The population entering x along j is the one that left the cell x - t along i, where i is j with the components
//! normal to the crossed faces reversed and t its part along them. No momentum parallel to the face is exchanged.

use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Parity, Populations};

/// One mirrored population.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mirror {
    from: [usize; 2],
    to: [usize; 2],
    /// The cells that the population leaves and enters: positions within an array.
    pub(crate) cells: [u32; 2],
    pub(crate) patch: usize,
    /// Direction of the outgoing population.
    pub(crate) leaves: usize,
    /// Direction of the incoming population.
    pub(crate) enters: usize,
}

impl Mirror {
    /// The population that enters `cell` opposite to direction `i`, whose link crosses the faces marked `outside`.
    pub(super) fn new<S: Stored>(
        populations: &Populations<S>,
        cell: usize,
        i: usize,
        outside: [bool; 3],
        patch: usize,
    ) -> Self {
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
            patch,
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

pub(super) fn apply<S: Stored>(mirrors: &[Mirror], populations: &mut Populations<S>) {
    let parity = populations.parity();
    let numbers = populations.numbers_mut();
    for m in mirrors {
        let (from, to) = m.ends(parity);
        numbers[to] = numbers[from];
    }
}
