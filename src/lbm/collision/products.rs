//! Transform of the populations of D3Q27 to moments of products of one polynomial per axis, and its inverse.
//!
//! The transform is separate from the operators because several of them use it, each with its own polynomials.

use super::kernel::Site;
use crate::lanes::Lanes;
use crate::lattice::{D3Q27, Lattice, unroll};

/// Index of the population by the components of its velocity along x, y and z: 0 for 0, 1 for +1, 2 for -1.
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

/// Returns the index of a component in [`POPULATION`].
const fn component_index(c: i8) -> usize {
    match c {
        0 => 0,
        1 => 1,
        _ => 2,
    }
}

/// Returns the same number in every lane. Operators use this function rather than a closure, because the compiler does
/// not apply the vector instructions of the pass to closures, which then remain calls in the cell loop.
#[inline(always)]
pub(super) fn n<N: Lanes>(x: f64) -> N {
    N::splat(x)
}

/// Basis of three polynomials of one component of the velocity.
pub(super) trait Basis {
    /// Returns the three moments of the populations with component 0, +1 and -1.
    fn analyse<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3];

    /// Returns the populations with component 0, +1 and -1, given the moments times the factors of the basis.
    fn compose<N: Lanes>(moments: [N; 3]) -> [N; 3];
}

/// Returns the moments `t[a][b][c]` of the products of polynomials a of c_x, b of c_y and c of c_z. The transform is
/// applied along x and y within each plane of c_z, then along z.
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

/// Writes the outgoing populations, given their moments `t` times the factors of the basis ([`Basis::compose`]).
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
