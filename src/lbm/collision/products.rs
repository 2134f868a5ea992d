//! The populations of D3Q27 by the components of their velocities, for operators that use products of one polynomial
//! per axis.

use super::kernel::Site;
use crate::lanes::Lanes;
use crate::lattice::{D3Q27, Lattice, unroll};

/// Number of the population with these components: 0 for 0, 1 for +1, 2 for -1.
pub(super) const POPULATION: [[[usize; 3]; 3]; 3] = {
    let mut table = [[[0; 3]; 3]; 3];
    let mut i = 0;
    while i < 27 {
        let c = D3Q27::C[i];
        table[component_index(c[0])][component_index(c[1])][component_index(c[2])] = i;
        i += 1;
    }
    table
};

const fn component_index(c: i8) -> usize {
    match c {
        0 => 0,
        1 => 1,
        _ => 2,
    }
}

/// Returns one number in every lane. It is a function, as everything here that makes lanes: closures do not get the
/// vector instructions of the pass, and are calls in the cell loop then.
#[inline(always)]
pub(super) fn n<N: Lanes>(x: f64) -> N {
    N::splat(x)
}

/// A basis of three polynomials of one component of the velocity.
pub(super) trait Basis {
    /// Returns the moments of numbers (rest, +, -).
    fn analyse<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3];

    /// Returns the numbers (rest, +, -) of moments over the norms of their polynomials.
    fn compose<N: Lanes>(moments: [N; 3]) -> [N; 3];
}

/// Returns the moments `t[a][b][c]` of the products of polynomials a, b, c: along x and y within each plane of c_z,
/// then along z.
#[inline(always)]
pub(super) fn moments<B: Basis, N: Lanes, G: Site<N, Q>, const Q: usize>(
    g: &G,
) -> [[[N; 3]; 3]; 3] {
    let mut t = [[[n::<N>(0.0); 3]; 3]; 3];
    unroll!(axes z < 3 => {
        let mut rows = [[n::<N>(0.0); 3]; 3];
        unroll!(axes y < 3 => {
            rows[y] = B::analyse(
                g.incoming(POPULATION[0][y][z]),
                g.incoming(POPULATION[1][y][z]),
                g.incoming(POPULATION[2][y][z]),
            );
        });
        unroll!(axes a < 3 => {
            let column = B::analyse(rows[0][a], rows[1][a], rows[2][a]);
            t[a][0][z] = column[0];
            t[a][1][z] = column[1];
            t[a][2][z] = column[2];
        });
    });
    unroll!(axes x < 3 => {
        unroll!(axes y < 3 => {
            t[x][y] = B::analyse(t[x][y][0], t[x][y][1], t[x][y][2]);
        });
    });
    t
}

/// Lets the populations leave whose moments over their norms are `t`.
#[inline(always)]
pub(super) fn leave<B: Basis, N: Lanes, G: Site<N, Q>, const Q: usize>(
    g: &mut G,
    mut t: [[[N; 3]; 3]; 3],
) {
    unroll!(axes x < 3 => {
        unroll!(axes y < 3 => {
            t[x][y] = B::compose(t[x][y]);
        });
    });
    unroll!(axes z < 3 => {
        let mut columns = [[n::<N>(0.0); 3]; 3];
        unroll!(axes a < 3 => {
            columns[a] = B::compose([t[a][0][z], t[a][1][z], t[a][2][z]]);
        });
        unroll!(axes y < 3 => {
            let [rest, plus, minus] = B::compose([columns[0][y], columns[1][y], columns[2][y]]);
            g.leave(POPULATION[0][y][z], rest);
            g.leave(POPULATION[1][y][z], plus);
            g.leave(POPULATION[2][y][z], minus);
        });
    });
}
