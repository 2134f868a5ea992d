//! Servo walls: plane walls that move along their normal so that the mean normal stress of their contacts follows a
//! stress that is given.
//!
//! ```text
//! v = gain (sigma A - F)/(K dt),   |v| <= velocity limit,   F = sum of N,   K = sum of dN/d(overlap)
//! ```
//!
//! v is the velocity into the grains, A the area of the wall that grains can reach ([`super::walls::area`]), N the
//! force of the normal spring of a contact, dt the solid step. In one step at this velocity the springs gain the
//! fraction `gain` of what F lacks, if the grains are stationary: the error falls by the factor `1 - gain` from step to
//! step, and the control is stable up to a gain of 2 for the wall alone. While grains move away at the speed u from the
//! wall, F lacks `K u dt/gain`: the control acts as a dashpot of `K dt/gain`, which takes energy from the grains and is
//! weak if the solid step is small compared with the period of a contact. With a gain of at most 1 the control is
//! stable and dissipates energy. A wall that touches nothing moves at its velocity limit.
//!
//! The force is measured at the end of a solid step, from the positions of that time; the wall moves with the velocity
//! that follows from it in the next one. Position and velocity of a wall are all of its state. F and K of all walls are
//! sums of integers ([`QUANTUM`]), one message between ranks in a step, so that they do not depend on the order.

use super::space::Space;
use super::walls::area::PlaneArea;

/// Quantum of the sums of forces \[N\] and stiffnesses [N/m]: 2^-70. Sums up to 1e17 fit into 128 bits.
pub const QUANTUM: f64 = 8.470_329_472_543_003e-22;

/// Returns a number in quanta, truncated towards zero; numbers beyond the range become the largest in the range.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a cast of a float saturates"
)]
pub(super) fn quanta(number: f64) -> i128 {
    (number / QUANTUM) as i128
}

/// Returns a sum in quanta as a number.
#[expect(clippy::cast_precision_loss, reason = "the sum is rounded once")]
pub(super) fn from_quanta(sum: i128) -> f64 {
    sum as f64 * QUANTUM
}

/// Control of a plane wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo<S: Space> {
    /// Index of the wall.
    pub wall: usize,
    /// Mean normal stress \[Pa\] that the wall exerts, compression positive.
    pub stress: f64,
    /// Part of the missing force that the springs gain in a solid step, above 0 to 1.
    pub gain: f64,
    /// Largest velocity along the normal [m/s].
    pub velocity_limit: f64,
    /// Velocity along the face [m/s], which the control does not change.
    pub sliding: S::Vector,
}

impl<S: Space> Servo<S> {
    /// Returns the velocity into the grains [m/s] for the present force \[N\] and tangent stiffness [N/m] of all
    /// contacts, the area \[m²\] and the solid step \[s\].
    #[must_use]
    pub fn velocity(&self, [force, stiffness]: [f64; 2], area: f64, time_step: f64) -> f64 {
        let missing = self.stress * area - force;
        if missing.abs() > 0.0 {
            // Without a contact the quotient is infinite, and the limit decides.
            let wanted = self.gain * missing / (stiffness * time_step);
            wanted.clamp(-self.velocity_limit, self.velocity_limit)
        } else {
            0.0
        }
    }
}

/// Servo walls of an engine.
#[derive(Clone, Debug)]
pub(super) struct Servos<S: Space> {
    /// Controls.
    pub(super) list: Vec<Servo<S>>,
    /// Buffers of the areas.
    pub(super) area: PlaneArea,
    /// Force and stiffness of each control in quanta, one after the other.
    pub(super) sums: Vec<u128>,
}

impl<S: Space> Default for Servos<S> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            area: PlaneArea::default(),
            sums: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::PlaneSpace;
    use approx::assert_relative_eq;
    use nalgebra::Vector2;

    /// Checks that forces of grains of micrometres and of rocks keep twelve digits, and that sums that cancel are zero.
    #[test]
    fn quanta_hold_small_and_large_forces() {
        for force in [1e-9, 0.3, 7e4, 2e12] {
            let sum = quanta(force) + quanta(2.0 * force);
            assert_relative_eq!(from_quanta(sum), 3.0 * force, max_relative = 1e-12);
            assert_eq!(quanta(force) + quanta(-force), 0);
        }
        assert_eq!(quanta(f64::INFINITY), i128::MAX);
        assert_eq!(QUANTUM.log2(), -70.0);
    }

    /// Checks a wall on stationary springs: the error decreases by the fraction `gain` in each step, or by the amount
    /// of the velocity limit if that is smaller.
    #[test]
    fn the_error_falls_by_the_gain() {
        let (stiffness, area, dt) = (2e6, 0.5, 1e-4);
        for gain in [0.25, 0.5, 1.0] {
            let servo = Servo::<PlaneSpace> {
                wall: 0,
                stress: 1e3,
                gain,
                velocity_limit: 10.0,
                sliding: Vector2::zeros(),
            };
            let (mut overlap, mut error) = (1e-5, 500.0 - 20.0);
            for _ in 0..20 {
                let force = stiffness * overlap;
                assert_relative_eq!(500.0 - force, error, epsilon = 1e-9);
                overlap += dt * servo.velocity([force, stiffness], area, dt);
                error *= 1.0 - gain;
            }
            let limited = Servo {
                velocity_limit: 0.1,
                ..servo
            };
            assert_eq!(limited.velocity([0.0, 0.0], area, dt), 0.1);
            assert_eq!(limited.velocity([1e4, 1.0], area, dt), -0.1);
            // A wall without a load that touches nothing does not move.
            let idle = Servo {
                stress: 0.0,
                ..limited
            };
            assert_eq!(idle.velocity([0.0, 0.0], area, dt), 0.0);
        }
    }
}
