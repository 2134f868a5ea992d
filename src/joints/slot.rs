//! Inertia of the water in a joint with the exact laminar friction at every frequency.
//!
//! Between parallel walls at a distance `a` the discharge per width under an oscillating gradient is
//!
//! ```text
//! i w rho q = -a dp/dx (1 - tanh(s)/s),     s² = i w a²/(4 nu)
//! ```
//!
//! The velocity profile is a sum of the eigenfunctions of the layer, and so is the discharge (expansion of
//! `tanh(s)/s` in partial fractions):
//!
//! ```text
//! q = sum of q_k,     dq_k/dt + r_k q_k = -w_k (a/rho) dp/dx
//! w_k = 2/b_k²,     r_k = 4 nu b_k²/a²,     b_k = (k - 1/2) pi,     k = 1, 2, ...
//! ```
//!
//! Each `q_k` decays, so that the sum adds no energy to the water. Neighbouring terms are joined to [`MODES`]
//! groups, each with the sum of their `w_k` and the sum of their `w_k/r_k`; the last group contains all remaining
//! terms. The cubic law at low and the inertia at high frequencies are therefore exact for any number of groups. Up
//! to `|s| = 100` the resistance is within 1 % and the inertia within 0.1 % of the exact ones (tests).

use std::f64::consts::PI;

/// Number of groups.
pub const MODES: usize = 12;
/// Number of terms of a new group divided by that of all previous groups.
const GROWTH: f64 = 0.35;

/// Weights and rates of the groups for a layer with `a²/(4 nu) = 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modes {
    /// Contribution of each group to the inertial response.
    pub weights: [f64; MODES],
    /// Decay rate of each group, times `a²/(4 nu)`.
    pub rates: [f64; MODES],
}

impl Modes {
    /// Returns the groups.
    #[must_use]
    pub fn new() -> Self {
        let (mut weights, mut rates) = ([0.0; MODES], [0.0; MODES]);
        // Sums over all terms: tanh(s)/s and its derivative with respect to s² at zero.
        let (mut weight_left, mut conductance_left) = (1.0, 1.0 / 3.0);
        let mut first = 1.0_f64;
        for group in 0..MODES - 1 {
            let after = first + (GROWTH * first).round().max(1.0);
            let (mut weight, mut conductance) = (0.0, 0.0);
            let mut term = first;
            while term < after {
                let square = ((term - 0.5) * PI).powi(2);
                weight += 2.0 / square;
                conductance += 2.0 / (square * square);
                term += 1.0;
            }
            (weights[group], rates[group]) = (weight, weight / conductance);
            weight_left -= weight;
            conductance_left -= conductance;
            first = after;
        }
        (weights[MODES - 1], rates[MODES - 1]) = (weight_left, weight_left / conductance_left);
        Self { weights, rates }
    }
}

impl Default for Modes {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn resistance_and_inertia_are_those_of_the_exact_layer() {
        let modes = Modes::new();
        let mut worst = [0.0_f64; 2];
        for step in 0..=160 {
            // Values of |s| from 0.01 to 100.
            let size = 10_f64.powf(-2.0 + 4.0 * f64::from(step) / 160.0);
            let square = Complex::new(0.0, size * size);
            let root = square.sqrt();
            let exact = Complex::new(1.0, 0.0) - root.tanh() / root;
            let groups = modes.weights.iter().zip(&modes.rates);
            let sum: Complex<f64> = groups.map(|(w, r)| square * *w / (square + *r)).sum();
            let (impedance, exact) = (square / sum, square / exact);
            worst[0] = worst[0].max((impedance.re / exact.re - 1.0).abs());
            worst[1] = worst[1].max((impedance.im / exact.im - 1.0).abs());
        }
        println!(
            "resistance within {:e}, inertia within {:e}",
            worst[0], worst[1]
        );
        assert!(worst[0] < 0.01 && worst[1] < 1e-3);
    }
}
