//! Velocity sets: directions, weights and opposites, as constants of a type.
//!
//! They are separate from `velocities`, which has the same tables as values, because the cell loop and the GPU kernels
//! need them as constants.
//!
//! | set | order of the directions |
//! |---|---|
//! | D2Q9 | rest; E, N, W, S; NE, NW, SW, SE |
//! | D3Q19, D3Q27 | rest; then opposite pairs: axes, edges, corners |
//!
//! Weights satisfy Σ w = 1 and Σ w c c = I/3 (Y. H. Qian, D. d'Humières, P. Lallemand, Europhys. Lett. 17 (1992) 479).
//! Populations are numbered by direction, independently of the memory layout, so that a sum over populations has the
//! same order and the same result for every layout.

#[cfg(not(target_arch = "nvptx64"))]
mod velocities;
#[cfg(not(target_arch = "nvptx64"))]
pub use velocities::{Velocities, VelocitySet};

/// Set of `Q` discrete velocities in lattice units (cells per step), with three components also in two dimensions.
pub trait Lattice<const Q: usize>: Copy + Send + Sync + 'static {
    /// Name as written in a case.
    const NAME: &'static str;
    /// Number of space dimensions.
    const DIMENSION: usize;
    /// Velocity of each population.
    const C: [[i8; 3]; Q];
    /// Weight of each population.
    const W: [f64; Q];
    /// Index of the population with the opposite velocity.
    const OPPOSITE: [usize; Q];
    /// Pairs of opposite populations, each pair once; entries from index `(Q - 1) / 2` on are unused.
    const PAIRS: [(usize, usize); 13];
}

/// Velocity set with nine velocities in two dimensions.
#[derive(Clone, Copy, Debug)]
pub struct D2Q9;

/// Velocity set with 19 velocities in three dimensions.
#[derive(Clone, Copy, Debug)]
pub struct D3Q19;

/// Velocity set with 27 velocities in three dimensions.
#[derive(Clone, Copy, Debug)]
pub struct D3Q27;

impl Lattice<9> for D2Q9 {
    const NAME: &'static str = "d2q9";
    const DIMENSION: usize = 2;
    const C: [[i8; 3]; 9] = [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [-1, 0, 0],
        [0, -1, 0],
        [1, 1, 0],
        [-1, 1, 0],
        [-1, -1, 0],
        [1, -1, 0],
    ];
    const W: [f64; 9] = weights(&Self::C, [4.0 / 9.0, 1.0 / 9.0, 1.0 / 36.0, 0.0]);
    const OPPOSITE: [usize; 9] = opposites(&Self::C);
    const PAIRS: [(usize, usize); 13] = pairs(&Self::OPPOSITE);
}

impl Lattice<19> for D3Q19 {
    const NAME: &'static str = "d3q19";
    const DIMENSION: usize = 3;
    const C: [[i8; 3]; 19] = first(&ALL27);
    const W: [f64; 19] = weights(&Self::C, [1.0 / 3.0, 1.0 / 18.0, 1.0 / 36.0, 0.0]);
    const OPPOSITE: [usize; 19] = opposites(&Self::C);
    const PAIRS: [(usize, usize); 13] = pairs(&Self::OPPOSITE);
}

impl Lattice<27> for D3Q27 {
    const NAME: &'static str = "d3q27";
    const DIMENSION: usize = 3;
    const C: [[i8; 3]; 27] = ALL27;
    const W: [f64; 27] = weights(&Self::C, [8.0 / 27.0, 2.0 / 27.0, 1.0 / 54.0, 1.0 / 216.0]);
    const OPPOSITE: [usize; 27] = opposites(&Self::C);
    const PAIRS: [(usize, usize); 13] = pairs(&Self::OPPOSITE);
}

/// Velocities of D3Q27: rest, 6 axes, 12 edges, 8 corners; the moving ones are in consecutive opposite pairs.
const ALL27: [[i8; 3]; 27] = [
    [0, 0, 0],
    [1, 0, 0],
    [-1, 0, 0],
    [0, 1, 0],
    [0, -1, 0],
    [0, 0, 1],
    [0, 0, -1],
    [1, 1, 0],
    [-1, -1, 0],
    [1, -1, 0],
    [-1, 1, 0],
    [1, 0, 1],
    [-1, 0, -1],
    [1, 0, -1],
    [-1, 0, 1],
    [0, 1, 1],
    [0, -1, -1],
    [0, 1, -1],
    [0, -1, 1],
    [1, 1, 1],
    [-1, -1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, -1],
    [-1, 1, 1],
    [1, -1, -1],
];

/// Returns the first `Q` velocities.
const fn first<const Q: usize>(all: &[[i8; 3]; 27]) -> [[i8; 3]; Q] {
    let mut c = [[0; 3]; Q];
    let mut i = 0;
    while i < Q {
        c[i] = all[i];
        i += 1;
    }
    c
}

/// Returns the weight of each velocity; `by_norm` is indexed by the number of non-zero components.
const fn weights<const Q: usize>(c: &[[i8; 3]; Q], by_norm: [f64; 4]) -> [f64; Q] {
    let mut w = [0.0; Q];
    let mut i = 0;
    while i < Q {
        let norm = c[i][0] * c[i][0] + c[i][1] * c[i][1] + c[i][2] * c[i][2];
        w[i] = by_norm[norm.unsigned_abs() as usize];
        i += 1;
    }
    w
}

/// Returns the index of the opposite of each velocity.
const fn opposites<const Q: usize>(c: &[[i8; 3]; Q]) -> [usize; Q] {
    let mut opposite = [0; Q];
    let mut i = 0;
    while i < Q {
        let mut j = 0;
        while j < Q {
            if c[i][0] == -c[j][0] && c[i][1] == -c[j][1] && c[i][2] == -c[j][2] {
                opposite[i] = j;
            }
            j += 1;
        }
        i += 1;
    }
    opposite
}

/// Returns each pair of opposite populations once, see [`Lattice::PAIRS`].
const fn pairs<const Q: usize>(opposite: &[usize; Q]) -> [(usize, usize); 13] {
    let mut pairs = [(0, 0); 13];
    let mut i = 1;
    let mut n = 0;
    while i < Q {
        if i < opposite[i] {
            pairs[n] = (i, opposite[i]);
            n += 1;
        }
        i += 1;
    }
    pairs
}

/// Repeats a block for each constant index below a limit, unrolled at compile time: in a loop that the compiler does
/// not unroll, the populations are in memory instead of registers. The first word selects the maximum number of
/// repetitions: 3 for `axes`, 4 for `four`, 6 for `six`, 9 for `nine`, 13 for `pairs`, 27 for `populations`.
macro_rules! unroll {
    (axes $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2] $i $n; $body)
    };
    (four $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2 3] $i $n; $body)
    };
    (six $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2 3 4 5] $i $n; $body)
    };
    (nine $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2 3 4 5 6 7 8] $i $n; $body)
    };
    (pairs $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2 3 4 5 6 7 8 9 10 11 12] $i $n; $body)
    };
    (populations $i:ident < $n:expr => $body:block) => {
        unroll!(@each [0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26] $i $n; $body)
    };
    (@each [$($k:literal)*] $i:ident $n:expr; $body:block) => {
        $( if $k < $n { let $i: usize = $k; $body } )*
    };
}
pub(crate) use unroll;

#[cfg(test)]
mod tests {
    use super::*;

    fn moments<L: Lattice<Q>, const Q: usize>() {
        let mut sum = 0.0;
        let mut second = [[0.0; 3]; 3];
        for i in 0..Q {
            sum += L::W[i];
            assert_eq!(L::OPPOSITE[L::OPPOSITE[i]], i);
            for a in 0..3 {
                assert_eq!(L::C[i][a], -L::C[L::OPPOSITE[i]][a]);
                for b in 0..3 {
                    second[a][b] += L::W[i] * f64::from(L::C[i][a]) * f64::from(L::C[i][b]);
                }
            }
        }
        assert!((sum - 1.0).abs() < 1e-15);
        for (a, row) in second.iter().enumerate() {
            for (b, &value) in row.iter().enumerate() {
                let exact = if a == b && a < L::DIMENSION {
                    1.0 / 3.0
                } else {
                    0.0
                };
                assert!((value - exact).abs() < 1e-15, "{} {a}{b}", L::NAME);
            }
        }
        let used = (Q - 1) / 2;
        for (k, &(i, j)) in L::PAIRS.iter().enumerate() {
            assert_eq!(k < used, i != j);
        }
    }

    #[test]
    fn weights_and_opposites_satisfy_the_lattice_identities() {
        moments::<D2Q9, 9>();
        moments::<D3Q19, 19>();
        moments::<D3Q27, 27>();
    }

    #[test]
    fn d2q9_has_the_order_of_the_paper() {
        assert_eq!(
            D2Q9::C[1..5],
            [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
        );
        assert_eq!(
            D2Q9::C[5..9],
            [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]
        );
        assert_eq!(D2Q9::OPPOSITE, [0, 3, 4, 1, 2, 7, 8, 5, 6]);
    }
}
