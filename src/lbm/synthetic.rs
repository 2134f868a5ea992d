//! Synthetic turbulence: a sum of random Fourier modes (Kraichnan 1970, doi:10.1063/1.1692799), lattice units.
//!
//! u(x) = A Σ_n a_n cos(k_n·x + φ_n),  a_n ⊥ k_n,  |a_n| = 1,  A = (2 D/N)^½ in D dimensions
//!
//! Each mode is free of divergence, and so is the sum. Wave numbers are drawn from the energy spectrum E(k) ~ k^{D+1}
//! exp(-k² σ²/2):
//! |k| σ is the length of a vector of D + 2 normal numbers. The longitudinal correlation of the ensemble is
//! f(r) = exp(-r²/(2 σ²)), with the integral length L = σ (π/2)^½ (Batchelor 1953, section 3.4). Modes come in
//! groups of D: in a random frame, the wave vector of each mode is along one axis and its amplitude along the next.
//! The a_n of a group are orthogonal, so that the mean square of every component is exactly one, not only on
//! average over seeds.
//!
//! All values are functions of seed and position: they are the same on any rank, in any order, and after a restart.

use base::error::{Remedy, Report, at_least, number};
use base::random::Stream;
use base::units::LatticeUnits;
use base::vector::{cross, dot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Synthetic turbulence: isotropic, divergence-free fluctuations that are sums of random Fourier modes (Kraichnan
/// 1970).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluctuations {
    /// Turbulence intensity: root mean square of each component over the local mean speed \[1\].
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub intensity: f64,
    /// Longitudinal integral length scale L \[m\]; the correlation is exp(-pi r²/(4 L²)).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length_scale: f64,
    /// Seed of the random numbers. Equal seeds give equal fluctuations.
    #[serde(default)]
    pub seed: u64,
}

impl Fluctuations {
    /// Refuses eddies smaller than a few cells of edge `spacing` \[m\], which the lattice cannot resolve.
    pub fn check(&self, spacing: f64, path: &str, report: &mut dyn Report) {
        let least = 2.0 * spacing;
        if self.length_scale < least {
            let path = format!("{path}.length_scale");
            report.error(
                &path,
                format!(
                    "eddies of this length are too small for the cells, which are {} m wide",
                    number(spacing)
                ),
                Remedy::from(format!(
                    "use at least {}, or a finer spacing",
                    at_least(least)
                ))
                .set(&*path, at_least(least)),
            );
        }
    }

    /// Returns the modes on a lattice, of unit root mean square.
    #[must_use]
    pub fn modes(&self, dimension: usize, units: &LatticeUnits) -> Modes {
        let length = units.length_to_lattice(self.length_scale);
        Modes::new(self.seed, length, dimension)
    }

    /// Returns the ratio of maximum to mean speed; 1 without fluctuations. Fluctuations rarely exceed three times
    /// their root mean square.
    #[must_use]
    pub fn gusts(fluctuations: Option<&Self>) -> f64 {
        1.0 + 3.0 * fluctuations.map_or(0.0, |f| f.intensity)
    }
}

/// Number of modes of a field, divisible by two and by three.
const COUNT: usize = 96;
/// Purpose of the random numbers.
const PURPOSE: u32 = 31;

/// Single wave.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// Wave vector [1/cell].
    pub wave: [f64; 3],
    /// Phase at the origin.
    pub phase: f64,
    /// Amplitude along each axis.
    pub amplitude: [f64; 3],
}

/// Field with unit root mean square in every component.
#[derive(Clone, Debug)]
pub struct Modes {
    list: Vec<Mode>,
    dimension: usize,
}

impl Modes {
    /// Returns the field of a seed with an integral length in cells.
    #[must_use]
    pub fn new(seed: u64, length: f64, dimension: usize) -> Self {
        let sigma = length * (2.0 / PI).sqrt();
        let mut list = Vec::with_capacity(COUNT);
        #[expect(clippy::cast_precision_loss, reason = "at most 3 of 96")]
        let size = (2.0 * dimension as f64 / COUNT as f64).sqrt();
        for group in 0..COUNT / dimension {
            let mut draws = Stream::new(seed, group as u64, PURPOSE);
            let frame = frame(&mut draws, dimension);
            for n in 0..dimension {
                let squares: f64 = (0..dimension + 2).map(|_| normal(&mut draws).powi(2)).sum();
                let wave_number = squares.sqrt() / sigma;
                list.push(Mode {
                    wave: frame[n].map(|e| e * wave_number),
                    phase: TAU * draws.uniform(),
                    amplitude: frame[(n + 1) % dimension].map(|e| e * size),
                });
            }
        }
        Self { list, dimension }
    }

    /// Returns the closest field that is periodic along the axes with a given length in cells.
    #[must_use]
    pub fn periodic(mut self, lengths: [Option<f64>; 3]) -> Self {
        for mode in &mut self.list {
            for (k, length) in mode.wave.iter_mut().zip(lengths) {
                if let Some(length) = length {
                    let unit = TAU / length;
                    *k = (*k / unit).round() * unit;
                }
            }
            mode.amplitude = across(mode.wave, mode.amplitude, self.dimension);
        }
        self
    }

    /// Returns the waves of the field.
    #[must_use]
    pub fn list(&self) -> &[Mode] {
        &self.list
    }

    /// Returns the velocity at a position in cells.
    #[must_use]
    pub fn velocity_at(&self, place: [f64; 3]) -> [f64; 3] {
        let mut u = [0.0; 3];
        for mode in &self.list {
            let c = (dot(mode.wave, place) + mode.phase).cos();
            for a in 0..3 {
                u[a] += mode.amplitude[a] * c;
            }
        }
        u
    }
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let size = dot(v, v).sqrt();
    v.map(|x| x / size)
}

/// Returns a normally distributed number (Box and Muller 1958).
fn normal(draws: &mut Stream) -> f64 {
    let radius = (-2.0 * (1.0 - draws.uniform()).ln()).sqrt();
    radius * (TAU * draws.uniform()).cos()
}

/// Returns an orthogonal frame with a uniformly random direction; in two dimensions its first two axes lie in the
/// plane.
fn frame(draws: &mut Stream, dimension: usize) -> [[f64; 3]; 3] {
    if dimension == 2 {
        let (s, c) = (TAU * draws.uniform()).sin_cos();
        return [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]];
    }
    let mut vector = || -> [f64; 3] { std::array::from_fn(|_| normal(draws)) };
    let (first, other) = (unit(vector()), vector());
    let third = unit(cross(first, other));
    [first, cross(third, first), third]
}

/// Returns the part of `v` normal to `k`, with the length of `v`; in two dimensions within the plane.
fn across(k: [f64; 3], v: [f64; 3], dimension: usize) -> [f64; 3] {
    let squared = dot(k, k);
    if squared <= 0.0 {
        return v;
    }
    let along = dot(k, v) / squared;
    let mut rest: [f64; 3] = std::array::from_fn(|a| v[a] - along * k[a]);
    if dot(rest, rest) < 1e-4 * dot(v, v) {
        // Rounding has made v parallel to k: any direction normal to k can be used.
        rest = if dimension == 2 {
            [-k[1], k[0], 0.0]
        } else {
            let least = (1..3).fold(0, |m, a| if k[a].abs() < k[m].abs() { a } else { m });
            let mut axis = [0.0; 3];
            axis[least] = 1.0;
            cross(k, axis)
        };
    }
    let size = dot(v, v).sqrt();
    unit(rest).map(|e| e * size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks spatial averages of one field: the intensity is exact for every seed.
    #[test]
    fn every_component_has_unit_mean_square() {
        for dimension in [2, 3] {
            let modes = Modes::new(5, 4.0, dimension);
            let mut squares = [0.0; 3];
            for mode in modes.list() {
                for a in 0..3 {
                    squares[a] += 0.5 * mode.amplitude[a].powi(2);
                }
                assert!(dot(mode.wave, mode.amplitude).abs() < 1e-14);
            }
            for (a, square) in squares.into_iter().enumerate() {
                let exact = if a < dimension { 1.0 } else { 0.0 };
                approx::assert_abs_diff_eq!(square, exact, epsilon = 1e-12);
            }
        }
    }

    /// Checks the correlation over an ensemble of fields: along r it is exp(-pi r²/(4 L²)), normal to r that plus r/(D
    /// - 1) times its derivative (Batchelor 1953). Spatial averages of a sum of waves are sums over waves.
    #[test]
    fn correlations_are_those_of_the_length() {
        let length = 3.0;
        for dimension in [2_usize, 3] {
            for r in [1.0, 3.0, 5.0] {
                let (mut along, mut across) = (0.0, 0.0);
                for seed in 0..240 {
                    for mode in Modes::new(seed, length, dimension).list() {
                        let share = 0.5 * (mode.wave[0] * r).cos() / 240.0;
                        along += share * mode.amplitude[0].powi(2);
                        across += share * mode.amplitude[1].powi(2);
                    }
                }
                let ratio = PI * r * r / (4.0 * length * length);
                let exact = (-ratio).exp();
                let exact_across = exact * (1.0 - 2.0 * ratio / (dimension as f64 - 1.0));
                // 23040 waves: a standard error below 1/sqrt(23040) = 0.007.
                assert!(
                    (along - exact).abs() < 0.04,
                    "{dimension} {r} {along} {exact}"
                );
                assert!(
                    (across - exact_across).abs() < 0.04,
                    "{dimension} {r} {across} {exact_across}"
                );
            }
        }
    }

    #[test]
    fn a_periodic_field_repeats_and_stays_free_of_divergence() {
        let lengths = [Some(16.0), None, Some(9.0)];
        let modes = Modes::new(1, 2.5, 3).periodic(lengths);
        let (a, b) = (
            modes.velocity_at([1.3, 2.0, 0.2]),
            modes.velocity_at([17.3, 2.0, 9.2]),
        );
        for c in 0..3 {
            approx::assert_abs_diff_eq!(a[c], b[c], epsilon = 1e-12);
        }
        for mode in modes.list() {
            let size = dot(mode.amplitude, mode.amplitude);
            approx::assert_abs_diff_eq!(size, 6.0 / 96.0, epsilon = 1e-12);
            assert!(dot(mode.wave, mode.amplitude).abs() < 1e-13);
        }
    }
}
