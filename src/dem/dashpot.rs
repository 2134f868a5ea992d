//! Normal dashpot of a contact in discrete time steps.
//!
//! A step evaluates a dashpot c at the velocity half a step earlier, and a contact begins and ends somewhere within
//! a step. Both make the restitution of an impact depend on the step dt to first order in `x = c dt/m`: at the
//! default step by 1 % for a damping ratio of 0.2, by 16 % for 0.5, and by as much again with the point in a step
//! at which the contact begins. Two corrections of the same order remove this; they vanish with the step:
//!
//! - The dashpot is `c/(1 + x/4)`. For an oscillator with springs, with the phase of the contact in the step
//!   averaged, the restitution is then exact within 1 % up to a damping ratio of 0.5, and for contacts that
//!   only push up to 0.9; for Hertz's contact as well.
//! - A step evaluates a contact as if it lasted the whole step. A contact with overlap d that is less than a step
//!   old has lasted for `d/|v|` of the past step, and lasts for the next half step: it acts with the fraction `1/2
//!   + d/(|v| dt)`. The dashpot of Hertz's contact grows with `d^(1/4)` and acts with the mean of that power over
//!   this time ([`hertz_root`]).
//!
//! A dashpot that may pull acts with its full force when the surfaces separate; whether it pulls for one more step
//! would depend on the phase of the contact in the step, with a jump of the force. [`Pulling`] spreads the last
//! step and a half over the last two steps without a jump.

/// Returns the dashpot [N s/m] with which discrete steps have the restitution of `dashpot` in continuous time,
/// where `x` is `dashpot time_step lever/weight`.
#[inline(always)]
pub(super) fn over_step(dashpot: f64, time_step: f64, lever: f64, weight: f64) -> f64 {
    // A contact without mass has no force.
    dashpot * weight / (weight + 0.25 * dashpot * time_step * lever + f64::MIN_POSITIVE)
}

/// Returns the fraction of a step in which a contact acts that overlaps by `overlap` \[m\] and whose surfaces move
/// at `rate` [m/s] along the normal.
#[inline(always)]
pub(super) fn part_of_step(overlap: f64, rate: f64, time_step: f64) -> f64 {
    let path = rate.abs() * time_step;
    if overlap < path {
        0.5 + overlap / path
    } else {
        1.0
    }
}

/// Returns the fourth root of the overlap \[m^1/4\]; in the first and the last step of a contact, its mean over the
/// time in which the contact acts.
///
/// Surfaces at the speed v overlap by `v t`. Over the time `0..(1/2 + g) dt`, with `g = d/(|v| dt)`, the integral
/// of `(v t)^(1/4)` is `4/5 (1/2 + g) (d + |v| dt/2)^(1/4) dt`. If the dashpot `pulls`, the sum of the integrals of
/// the last two steps is divided between them without a jump: `4/5 (3/2)^(5/4) g` in the last, the remainder in the
/// one before.
#[inline(always)]
pub(super) fn hertz_root(overlap: f64, rate: f64, time_step: f64, pulls: bool) -> f64 {
    let path = rate.abs() * time_step;
    let mean = |ratio: f64| {
        let reached = overlap + 0.5 * path;
        0.8 * ratio * reached.sqrt().sqrt()
    };
    let last = |ratio: f64| 0.8 * 1.5 * ratio * (1.5 * path).sqrt().sqrt();
    if pulls && rate > 0.0 && overlap < 2.0 * path {
        let ratio = overlap / path;
        if overlap < path {
            last(ratio)
        } else {
            mean(0.5 + ratio) - last(ratio - 1.0)
        }
    } else if overlap < path {
        mean(0.5 + overlap / path)
    } else {
        overlap.sqrt().sqrt()
    }
}

/// Linear spring and dashpot of a contact that may pull until the surfaces separate, over a time step.
///
/// With `x = c dt/m`, `y = k dt²/m` and `g = d/(|v| dt)` for the overlap d and the velocity v half a step before:
///
/// - The surfaces separate at `r v`, `r = sqrt((1 + y g (1 + g))/(1 - y/4)) - x t + x y t³/6` with `t = g + 1/2`:
///   the energy of the oscillator as the time steps keep it, less the dashpot over its path.
/// - The solution `g1` of `g1 = r(g1)` is the overlap from which the surfaces separate exactly at the end of a
///   step. Above it, a step ends at the velocity `v (g1 r + (1 - g1) g)` if the force for this exceeds that of
///   spring and dashpot; below it, at `v (1 - (1 - g1) g/g1)`. The last step then ends at `r v` for any phase, and
///   the force is a continuous function of overlap and velocity.
/// - In the first step of a contact, the spring adds `y (g - 1/2)²/2 m v/dt`, the part of its impulse that is
///   missing because the force is evaluated at the end of the path.
///
/// Two coefficients of second order in x, 0.15 and 0.09, are fitted to the closed form: the restitution of
/// every impact is within 0.6 % up to a damping ratio of 0.5 and a step of `0.283 sqrt(m/k)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pulling {
    /// Stiffness k [N/m].
    pub(super) spring: f64,
    /// Dashpot c [N s/m].
    pub(super) dashpot: f64,
    /// Effective mass m \[kg\].
    pub(super) mass: f64,
}

impl Pulling {
    /// Overlap in units of the path of a step, above which the contact does not end within two steps.
    const LARGE_OVERLAP: f64 = 2.0;

    /// Returns the force \[N\], negative in tension, at an `overlap` \[m\] and a separation `rate` [m/s].
    pub(super) fn force(&self, overlap: f64, rate: f64, time_step: f64) -> f64 {
        let path = rate.abs() * time_step;
        let spring = self.spring * overlap;
        let within = spring - over_step(self.dashpot, time_step, 1.0, self.mass) * rate;
        if overlap >= Self::LARGE_OVERLAP * path {
            return within;
        }
        let (x, y) = (
            self.dashpot * time_step / self.mass,
            self.spring * time_step * time_step / self.mass,
        );
        let ratio = overlap / path;
        let scale = self.mass * rate.abs() / time_step;
        if rate > 0.0 {
            scale
                * Self::force_of_separation_now(x, y, ratio)
                    .max(Self::force_of_separation_next(x, y, ratio).min(within / scale))
        } else if ratio < 1.0 {
            let dashpot = x / (1.0 + 0.25 * x) * (0.5 + ratio) * (1.0 + 0.15 * x);
            spring + scale * (dashpot + 0.5 * y * (ratio - 0.5) * (ratio - 0.5))
        } else {
            within
        }
    }

    /// Returns `g1` as defined at the type.
    fn border(x: f64, y: f64) -> f64 {
        let first = 1.5 / (1.0 + x);
        let t = (1.5 + 0.5 * y * first * first) / (1.0 + x);
        (t - 0.5).max(0.02)
    }

    /// Returns the force over `m v/dt` with which the surfaces separate in the same step.
    fn force_of_separation_now(x: f64, y: f64, ratio: f64) -> f64 {
        let border = Self::border(x, y);
        -ratio * (1.0 - border) / border
    }

    /// Returns the force over `m v/dt` with which the surfaces separate in the next step.
    fn force_of_separation_next(x: f64, y: f64, ratio: f64) -> f64 {
        let border = Self::border(x, y);
        let t = ratio + 0.5;
        let energy = (1.0 + y * ratio * (1.0 + ratio)) / (1.0 - 0.25 * y.min(2.0));
        let last = energy.sqrt() - x * t * (1.0 + 0.09 * x) + x * y * t * t * t / 6.0;
        border * last.max(0.0) + (1.0 - border) * ratio - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::{Pulling, hertz_root, over_step, part_of_step};
    use approx::assert_relative_eq;

    /// Returns the restitution of a unit mass on a unit spring without tension, with unit speed, from a start
    /// `before` steps of length `step` before contact.
    fn restitution(zeta: f64, step: f64, before: f64) -> f64 {
        let (mut overlap, mut velocity, mut force) = (-before * step, 1.0, 0.0);
        loop {
            velocity += 0.5 * step * force;
            overlap += velocity * step;
            let part = part_of_step(overlap, velocity, step);
            let dashpot = over_step(2.0 * zeta, step, 1.0, 1.0) * part;
            force = if overlap > 0.0 {
                f64::min(-overlap - dashpot * velocity, 0.0)
            } else {
                0.0
            };
            velocity += 0.5 * step * force;
            if overlap <= 0.0 && velocity < 0.0 {
                return -velocity;
            }
        }
    }

    /// Checks against Schwager and Pöschel, Granular Matter 9 (2007) 465: `exp(-2 zeta acos(zeta)/sqrt(1 -
    /// zeta²))`, at steps up to the default one of two equal grains, 0.2 sqrt(2) sqrt(m/k).
    #[test]
    fn a_step_restitutes_as_continuous_time() {
        for zeta in [0.05_f64, 0.1, 0.2, 0.35, 0.5] {
            let exact = (-2.0 * zeta * zeta.acos() / (1.0 - zeta * zeta).sqrt()).exp();
            for step in [0.28, 0.2, 0.1] {
                let all = (0..32).map(|n| restitution(zeta, step, (f64::from(n) + 0.5) / 32.0));
                let all: Vec<f64> = all.collect();
                let mean = all.iter().sum::<f64>() / 32.0;
                assert_relative_eq!(mean, exact, max_relative = 0.01);
                for one in all {
                    assert_relative_eq!(one, exact, max_relative = 0.025);
                }
            }
        }
    }

    /// Returns the range, over the phase of the contact in the step, of the restitution divided by the `exact` one,
    /// for a unit mass with unit speed under `force` as a function of overlap and rate.
    fn range(step: f64, exact: f64, force: impl Fn(f64, f64) -> f64) -> [f64; 2] {
        let one = |before: f64| {
            let (mut overlap, mut velocity, mut acts) = (-before * step, 1.0, 0.0);
            loop {
                velocity += 0.5 * step * acts;
                overlap += velocity * step;
                acts = if overlap > 0.0 {
                    -force(overlap, -velocity)
                } else {
                    0.0
                };
                velocity += 0.5 * step * acts;
                if overlap <= 0.0 && velocity < 0.0 {
                    return -velocity / exact;
                }
            }
        };
        let all = (0..64).map(|n| one((f64::from(n) + 0.5) / 64.0));
        all.fold([f64::INFINITY, 0.0], |[low, high], e| {
            [low.min(e), high.max(e)]
        })
    }

    /// Checks a dashpot that may pull: the restitution is `exp(-pi zeta/sqrt(1 - zeta²))` in every impact.
    #[test]
    fn every_impact_with_attraction_restitutes_as_continuous_time() {
        for zeta in [0.05_f64, 0.1, 0.2, 0.35, 0.5] {
            let exact = (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
            let contact = Pulling {
                spring: 1.0,
                dashpot: 2.0 * zeta,
                mass: 1.0,
            };
            for (step, bar) in [(0.283, 0.006), (0.2, 0.004), (0.1, 0.002)] {
                let [low, high] = range(step, exact, |d, v| contact.force(d, v, step));
                assert!(low > 1.0 - bar, "{zeta} at {step}: {low}");
                assert!(high < 1.0 + bar, "{zeta} at {step}: {high}");
            }
        }
    }

    /// Checks Hertz's contact with the dashpot of constant restitution (Antypov and Elliott), in every impact.
    #[test]
    fn every_impact_of_hertz_restitutes_as_continuous_time() {
        for zeta in [0.05_f64, 0.1, 0.2, 0.35, 0.5] {
            let root = (1.0 - zeta * zeta).sqrt();
            for (pulls, phase) in [(false, 2.0 * zeta.acos()), (true, std::f64::consts::PI)] {
                let exact = (-phase * zeta / root).exp();
                for step in [0.23, 0.16, 0.08] {
                    let [low, high] = range(step, exact, |d, v| {
                        let dashpot = 5.0_f64.sqrt() * zeta * hertz_root(d, v, step, pulls);
                        let force = d * d.sqrt() - over_step(dashpot, step, 1.0, 1.0) * v;
                        if pulls { force } else { force.max(0.0) }
                    });
                    let bar = if pulls && zeta > 0.4 { 0.02 } else { 0.01 };
                    assert!(low > 1.0 - bar, "{zeta} at {step}, {pulls}: {low}");
                    assert!(high < 1.0 + bar, "{zeta} at {step}, {pulls}: {high}");
                }
            }
        }
    }

    #[test]
    fn a_contact_at_rest_keeps_its_spring() {
        let contact = Pulling {
            spring: 3.0,
            dashpot: 1.0,
            mass: 2.0,
        };
        assert_eq!(contact.force(0.5, 0.0, 0.1), 1.5);
        assert_eq!(contact.force(0.0, 0.0, 0.1), 0.0);
        assert_eq!(hertz_root(16.0, 0.0, 0.1, true), 2.0);
        assert_eq!(hertz_root(0.0, 0.0, 0.1, true), 0.0);
    }

    #[test]
    fn what_has_no_dashpot_or_no_step_stays() {
        assert_eq!(over_step(0.0, 0.1, 1.0, 1.0), 0.0);
        assert_eq!(over_step(3.0, 0.0, 1.0, 2.0), 3.0);
        assert_eq!(over_step(0.0, 0.1, 1.0, 0.0), 0.0);
        assert_eq!(part_of_step(0.1, 0.0, 0.1), 1.0);
        assert_eq!(part_of_step(0.1, 1.0, 0.0), 1.0);
    }
}
