//! Servo walls: plane walls that move along their normal so that the mean normal stress of their contacts follows a
//! stress that is given.
//!
//! ```text
//! v = (sum of K_i u_i + gain (sigma A - F)/dt)/K,   |v| <= velocity limit
//! F = sum of N,   K = sum of K_i,   K_i = dN/d(overlap)
//! ```
//!
//! v is the velocity into the grains, A the area of the wall that grains can reach ([`super::walls::area`]), N the
//! force of the normal spring of a contact, u_i the velocity of its grain away from the wall, dt the solid step. The
//! springs gain `K_i (v - u_i) dt` in a step: the first term follows the grains, so that the force stays; the second
//! adds the fraction `gain` of what F lacks. The error falls by the factor `1 - gain` from step to step at any constant
//! velocity of the grains. The control is stable up to a gain of 2 for the wall alone. While grains accelerate by a
//! away from the wall, F lacks `K a dt²/gain` to `1.5 K a dt²/gain`: the control adds the mass `K dt²/gain` to that of
//! the grains, which is small if the solid step is small compared with the period of a contact. The wall has no mass
//! and no damping; without the first term it would be a dashpot of `K dt/gain`, and F would lack `K u dt/gain` on
//! grains that recede. A wall that touches nothing moves at its velocity limit.
//!
//! The force is measured at the end of a solid step, from the positions of that time; the wall moves with the velocity
//! that follows from it in the next one. Position and velocity of a wall are all of its state. The sums are sums of
//! integers ([`QUANTUM`]), one message between ranks in a step, so that they do not depend on the order.

use super::space::Space;
use super::walls::area::PlaneArea;

/// Quantum of the sums of forces \[N\], stiffnesses [N/m] and losses of force [N/s]: 2^-70. Sums up to 1e17 fit into
/// 128 bits.
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
    /// Returns the velocity into the grains [m/s] for the sums over all contacts, the area \[m²\] and the solid step
    /// \[s\].
    #[must_use]
    pub fn velocity(&self, sums: &WallSums, area: f64, time_step: f64) -> f64 {
        let missing = self.stress * area - sums.force;
        let wanted = (sums.receding + self.gain * missing / time_step) / sums.stiffness;
        // Without a contact the quotient is infinite, and the limit decides; without a load as well there is none.
        if wanted.is_nan() {
            0.0
        } else {
            wanted.clamp(-self.velocity_limit, self.velocity_limit)
        }
    }
}

/// Sums over the contacts of a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallSums {
    /// Force of the normal springs \[N\].
    pub force: f64,
    /// Tangent stiffness of the normal springs [N/m].
    pub stiffness: f64,
    /// Stiffness times velocity of the grain away from the wall [N/s]: the force that a stationary wall loses in time.
    pub receding: f64,
}

/// Servo walls of an engine.
#[derive(Clone, Debug)]
pub(super) struct Servos<S: Space> {
    /// Controls.
    pub(super) list: Vec<Servo<S>>,
    /// Buffers of the areas.
    pub(super) area: PlaneArea,
    /// The [`WallSums`] of each control in quanta, one after the other.
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
                overlap += dt * servo.velocity(&sums(force, stiffness, 0.0), area, dt);
                error *= 1.0 - gain;
            }
            let limited = Servo {
                velocity_limit: 0.1,
                ..servo
            };
            assert_eq!(limited.velocity(&WallSums::default(), area, dt), 0.1);
            assert_eq!(limited.velocity(&sums(1e4, 1.0, 0.0), area, dt), -0.1);
            // A wall without a load that touches nothing does not move.
            let idle = Servo {
                stress: 0.0,
                ..limited
            };
            assert_eq!(idle.velocity(&WallSums::default(), area, dt), 0.0);
        }
    }

    /// Checks a wall on springs whose grains move: the error falls as on stationary ones while their velocity is
    /// constant, and is `K a dt²/gain` while they accelerate, if their velocity is that of the next step.
    #[test]
    fn the_wall_follows_its_grains() {
        let (stiffness, area, dt, gain) = (2e6, 0.5, 1e-4, 0.25);
        let servo = Servo::<PlaneSpace> {
            wall: 0,
            stress: 1e3,
            gain,
            velocity_limit: 10.0,
            sliding: Vector2::zeros(),
        };
        for (speed, acceleration) in [(0.01, 0.0), (-0.02, 0.0), (0.0, 0.5)] {
            let (mut overlap, mut recedes) = (1e-5_f64, speed);
            for _ in 0..200 {
                let sums = sums(stiffness * overlap, stiffness, stiffness * recedes);
                recedes += acceleration * dt;
                overlap += dt * (servo.velocity(&sums, area, dt) - recedes);
            }
            let missing = 500.0 - stiffness * overlap;
            let known = stiffness * acceleration * dt * dt / gain;
            assert_relative_eq!(missing, known, epsilon = 1e-9);
        }
    }

    fn sums(force: f64, stiffness: f64, receding: f64) -> WallSums {
        WallSums {
            force,
            stiffness,
            receding,
        }
    }
}
