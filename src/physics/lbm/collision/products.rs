//! The populations of D3Q27 by the components of their velocities, for operators that use products of one polynomial per axis.

use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{D3Q27, Lattice};

/// Number of the population with these components: 0 for 0, 1 for +1, 2 for -1.
pub(super) const POPULATION: [[[usize; 3]; 3]; 3] = {
    let mut table = [[[0; 3]; 3]; 3];
    let mut i = 0;
    while i < 27 {
        let c = D3Q27::C[i];
        table[place(c[0])][place(c[1])][place(c[2])] = i;
        i += 1;
    }
    table
};

const fn place(c: i8) -> usize {
    match c {
        0 => 0,
        1 => 1,
        _ => 2,
    }
}

/// The same number in every lane. A function and not a closure, as everything here that makes lanes: closures do not get the vector
/// instructions of the pass, and are calls in the cell loop then.
#[inline(always)]
pub(super) fn n<N: Lanes>(x: f64) -> N {
    N::splat(x)
}
