//! Linear (von Neumann) stability of an operator in fluid at rest or in uniform motion.
//!
//! A small wave g_i(x) = h_i e^{ik·x} becomes h' = D(k) C h in a step. C is the operator linearised about equilibrium
//! at the velocity of the fluid, D = diag(e^{-ik·c_i}) the streaming. The wave grows if an eigenvalue of D C lies
//! outside the unit circle. Repeated squaring of the matrix gives the largest modulus without computing eigenvectors:
//!
//! |λ| = (|A^{2n}| / |A^n|)^{1/n},   n = 4096.
//!
//! Sources: J. D. Sterling, S. Chen, J. Comput. Phys. 123 (1996) 196; P. Lallemand, L.-S. Luo, Phys. Rev. E 61
//! (2000) 6546.

use super::Collision;
use crate::initial::equilibrium;
use crate::lattice::Lattice;
use std::f64::consts::PI;
use std::sync::{Mutex, PoisonError};

/// Fastest growing wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Growth factor |λ| of its amplitude per step; 1 or less if no wave grows.
    pub factor: f64,
    /// Wave vector, in sixteenths of π per cell; for fluid at rest 0 <= x <= y <= z.
    pub vector: [i8; 3],
}

impl Wave {
    /// Returns the wavelength in cells.
    #[must_use]
    pub fn length(&self) -> f64 {
        let squares = self.vector.map(|n| f64::from(n) * f64::from(n));
        2.0 * f64::from(NUMBERS) / squares.iter().sum::<f64>().sqrt()
    }
}

/// Number of wave numbers along an axis in addition to 0: waves of 32 to 2 cells.
const NUMBERS: i8 = 16;
/// Number of times the matrix is squared.
const SQUARINGS: i32 = 13;
/// Amplitude about rest: differences have no odd terms above the first except of third order, and populations at
/// rest are zero, so that there is no rounding.
const SMALL: f64 = 1e-8;
/// Amplitude about uniform motion: between its square and the rounding of populations close to the weights.
const SMALL_IN_MOTION: f64 = 1e-5;

/// Operators analysed so far: a study plans the same operator for many members.
static ANALYSED: Mutex<Vec<(Vec<f64>, Wave)>> = Mutex::new(Vec::new());
/// Maximum number of stored operators; later ones are analysed each time.
const REMEMBERED: usize = 64;

/// Returns the fastest growing wave of an operator, among those of [`NUMBERS`] along each axis.
#[must_use]
pub fn fastest<L: Lattice<Q>, C: Collision, const Q: usize>(operator: &C) -> Wave {
    let linear = linear::<L, C, Q>(operator, [0.0; 3]);
    let mut analysed = ANALYSED.lock().unwrap_or_else(PoisonError::into_inner);
    let entries = linear.as_flattened();
    if let Some((_, wave)) = analysed.iter().find(|(known, _)| known == entries) {
        return *wave;
    }
    let wave = search::<L, Q>(&linear);
    if analysed.len() < REMEMBERED {
        analysed.push((entries.to_vec(), wave));
    }
    wave
}

/// Returns the fastest growing wave of a linear operator that is symmetric in the axes.
fn search<L: Lattice<Q>, const Q: usize>(linear: &[[f64; Q]; Q]) -> Wave {
    let vectors =
        (1..=NUMBERS).flat_map(|z| (0..=z).flat_map(move |y| (0..=y).map(move |x| [x, y, z])));
    most::<L, Q>(linear, vectors)
}

/// Returns the fastest growing wave of a list.
fn most<L: Lattice<Q>, const Q: usize>(
    linear: &[[f64; Q]; Q],
    vectors: impl Iterator<Item = [i8; 3]>,
) -> Wave {
    let mut fastest = Wave {
        factor: 0.0,
        vector: [0; 3],
    };
    for vector in vectors {
        let k = vector.map(|n| PI / f64::from(NUMBERS) * f64::from(n));
        let factor = Matrix::new::<L>(linear, k).radius();
        if factor > fastest.factor {
            fastest = Wave { factor, vector };
        }
    }
    fastest
}

/// Returns the derivative of the outgoing population i with respect to the incoming population j, linearised about
/// equilibrium at a velocity.
fn linear<L: Lattice<Q>, C: Collision, const Q: usize>(
    operator: &C,
    velocity: [f64; 3],
) -> [[f64; Q]; Q] {
    let rates = operator.uniform::<f64>();
    let moves = velocity.iter().any(|u| u.abs() > 0.0);
    let small = if moves { SMALL_IN_MOTION } else { SMALL };
    let about: [f64; Q] = std::array::from_fn(|i| equilibrium(L::W[i], L::C[i], 0.0, velocity));
    let mut matrix = [[0.0; Q]; Q];
    for j in 0..Q {
        let [up, down] = [small, -small].map(|amplitude| {
            let mut g = about;
            g[j] += amplitude;
            operator.collide::<L, f64, _, Q>(&mut g, &rates);
            g
        });
        for i in 0..Q {
            matrix[i][j] = (up[i] - down[i]) / (2.0 * small);
        }
    }
    matrix
}

/// Complex matrix as real and imaginary parts.
struct Matrix<const Q: usize>([Box<[[f64; Q]; Q]>; 2]);

impl<const Q: usize> Matrix<Q> {
    fn zeros() -> Self {
        Self([(); 2].map(|()| Box::new([[0.0; Q]; Q])))
    }

    /// Returns the matrix D(k) C.
    fn new<L: Lattice<Q>>(linear: &[[f64; Q]; Q], k: [f64; 3]) -> Self {
        let mut all = Self::zeros();
        let [real, imaginary] = &mut all.0;
        for i in 0..Q {
            let phase: f64 = (0..3).map(|a| k[a] * f64::from(L::C[i][a])).sum();
            let (sin, cos) = phase.sin_cos();
            real[i] = linear[i].map(|x| x * cos);
            imaginary[i] = linear[i].map(|x| -x * sin);
        }
        all
    }

    fn square(&self) -> Self {
        let mut all = Self::zeros();
        let [real, imaginary] = &mut all.0;
        for i in 0..Q {
            for n in 0..Q {
                let (a, b) = (self.0[0][i][n], self.0[1][i][n]);
                let (c, d) = (&self.0[0][n], &self.0[1][n]);
                for j in 0..Q {
                    real[i][j] += a * c[j] - b * d[j];
                    imaginary[i][j] += a * d[j] + b * c[j];
                }
            }
        }
        all
    }

    /// Scales the largest number to 1; returns the logarithm of its former value.
    fn scale(&mut self) -> f64 {
        let numbers = || self.0.iter().flat_map(|part| part.as_flattened());
        let largest = numbers().fold(0.0, |most: f64, x| most.max(x.abs()));
        if largest <= 0.0 {
            return f64::NEG_INFINITY;
        }
        for part in &mut self.0 {
            for x in part.as_flattened_mut() {
                *x /= largest;
            }
        }
        largest.ln()
    }

    /// Returns the largest modulus of an eigenvalue.
    fn radius(mut self) -> f64 {
        let mut logarithm = self.scale();
        let mut before = logarithm;
        for _ in 0..SQUARINGS {
            before = logarithm;
            self = self.square();
            logarithm = 2.0 * before + self.scale();
        }
        ((logarithm - before) / 2.0_f64.powi(SQUARINGS - 1)).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::super::bgk::Bgk;
    use super::super::mrt::{Mrt, Rates};
    use super::super::second_order::SecondOrder;
    use super::super::suga::Suga;
    use super::*;
    use crate::lattice::{D2Q9, D3Q27};

    /// Returns the fastest growing wave in fluid that moves at a `velocity` of cells per step, among every `stride`-th
    /// of [`NUMBERS`] in both directions along each axis. A wave and its opposite grow alike.
    fn fastest_in_motion<L: Lattice<Q>, C: Collision, const Q: usize>(
        operator: &C,
        velocity: [f64; 3],
        stride: usize,
    ) -> Wave {
        let linear = linear::<L, C, Q>(operator, velocity);
        let along = move || (-NUMBERS..=NUMBERS).step_by(stride);
        let vectors = (0..=NUMBERS)
            .step_by(stride)
            .flat_map(move |z| along().flat_map(move |y| along().map(move |x| [x, y, z])))
            .filter(|vector| *vector != [0; 3]);
        most::<L, Q>(&linear, vectors)
    }

    fn weighted(tau: f64, rates: Rates) -> Mrt<false> {
        Mrt {
            omega: 1.0 / tau,
            rates,
            force: [0.0; 3],
        }
    }

    fn suga(tau: f64, rates: Rates) -> Wave {
        fastest::<D3Q27, _, 27>(&Suga {
            omega: 1.0 / tau,
            rates,
            force: [0.0; 3],
        })
    }

    /// Checks that no wave grows in fluid at rest with one or two relaxation times, for any viscosity; a rate above 2
    /// overshoots more in every step.
    #[test]
    fn one_rate_lets_nothing_grow_below_two() {
        let bgk = |omega: f64| {
            fastest::<D2Q9, _, 9>(&Bgk::<false> {
                omega,
                force: [0.0; 3],
            })
        };
        for omega in [0.4, 1.0, 1.7, 1.99] {
            let wave = bgk(omega);
            assert!(
                (wave.factor - 1.0).abs() < 1e-3 && wave.factor < 1.0 + 1e-7,
                "{omega}: {wave:?}"
            );
        }
        // The factor is 1 - ω of the moments that are not conserved.
        assert!((bgk(2.1).factor - 1.1).abs() < 0.02);
    }

    /// Checks that the published matrix is stable near tau = 1/2, and that waves of three cells along the diagonals
    /// grow from 0.556 on; largest eigenvalue by LAPACK: 1.05273777811894 at 0.8.
    #[test]
    fn the_published_matrix_lets_waves_grow() {
        let wave = suga(0.8, Rates::SUGA);
        assert!(
            (wave.factor - 1.052_737_778_118_94).abs() < 1e-9,
            "{wave:?}"
        );
        assert_eq!(wave.vector, [9, 10, 10]);
        for (tau, expected) in [(0.56, 1.0006), (0.6, 1.0106)] {
            let wave = suga(tau, Rates::SUGA);
            assert!((wave.factor - expected).abs() < 5e-5, "{tau}: {wave:?}");
        }
        assert!(suga(0.55, Rates::SUGA).factor < 1.0 + 1e-7);
        // As tau approaches 1/2, other waves grow slowly.
        assert!((suga(0.5001, Rates::SUGA).factor - 1.00075).abs() < 1e-5);
        let ones = Rates::two(1.0, 1.0);
        assert!(suga(0.51, ones).factor > 1.005);
    }

    /// Checks that with moments orthogonal under the weights no wave grows in fluid at rest at the same rates, as
    /// proved in [`super::super::mrt`]: waves of every second length, with the rates of Suga and with higher moments at
    /// equilibrium.
    #[test]
    fn moments_orthogonal_under_the_weights_let_nothing_grow() {
        for tau in [0.5001, 0.52, 0.6, 0.8, 1.2] {
            let wave = fastest_in_motion::<D3Q27, _, 27>(&weighted(tau, Rates::SUGA), [0.0; 3], 4);
            assert!(
                (wave.factor - 1.0).abs() < 1e-2 && wave.factor < 1.0 + 1e-12,
                "{tau}: {wave:?}"
            );
            let of_second_order = SecondOrder::<false> {
                omega: 1.0 / tau,
                bulk: 1.54,
                force: [0.0; 3],
            };
            let wave = fastest_in_motion::<D3Q27, _, 27>(&of_second_order, [0.0; 3], 4);
            assert!(wave.factor < 1.0 + 1e-12, "{tau}: {wave:?}");
        }
    }
}
