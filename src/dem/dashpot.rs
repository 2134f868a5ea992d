//! The normal dashpot of a contact over time steps.
//!
//! A step evaluates a dashpot c at the velocity of half a step before, and a contact begins and ends somewhere within a
//! step. Both make the restitution of an impact depend on the step dt to first order in `x = c dt/m`: at the default
//! step by 1 % for a damping ratio of 0.2, by 16 % for 0.5, and by as much again with the place in a step at which the
//! contact begins. Two corrections of the same order take this away; they vanish with the step:
//!
//! - The dashpot is `c/(1 + x/4)`. Of an oscillator with springs, with the phase of the contact in the step averaged,
//!   the restitution is then exact within 1 % up to a damping ratio of 0.5, and for contacts that only push up to 0.9;
//!   of Hertz's contact as well.
//! - A step evaluates a contact as if it lasted all the step. One that is less than a step old, of the overlap d, has
//!   lasted for `d/|v|` of it, and the half step that follows: it acts with the part `1/2 + d/(|v| dt)`.

/// Returns the dashpot [N s/m] that restitutes over steps as `dashpot` does in continuous time, where `x` is
/// `dashpot time_step lever/weight`.
#[inline(always)]
pub(super) fn over_step(dashpot: f64, time_step: f64, lever: f64, weight: f64) -> f64 {
    // Without a mass there is no motion, and no force.
    dashpot * weight / (weight + 0.25 * dashpot * time_step * lever + f64::MIN_POSITIVE)
}

/// Returns the part of a step in which a contact acts that overlaps by `overlap` \[m\] and whose surfaces move at
/// `rate` [m/s] along the normal.
#[inline(always)]
pub(super) fn part_of_step(overlap: f64, rate: f64, time_step: f64) -> f64 {
    let path = rate.abs() * time_step;
    if overlap < path {
        0.5 + overlap / path
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::{over_step, part_of_step};
    use approx::assert_relative_eq;

    /// Returns the restitution of a mass of 1 on a spring of 1 that only pushes, thrown at 1 from `before` steps of
    /// `step` away.
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

    /// Schwager and Pöschel, Granular Matter 9 (2007) 465: `exp(-2 zeta acos(zeta)/sqrt(1 - zeta²))`, at steps up to
    /// the default one of two equal grains, 0.2 sqrt(2) sqrt(m/k).
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

    #[test]
    fn what_has_no_dashpot_or_no_step_stays() {
        assert_eq!(over_step(0.0, 0.1, 1.0, 1.0), 0.0);
        assert_eq!(over_step(3.0, 0.0, 1.0, 2.0), 3.0);
        assert_eq!(over_step(0.0, 0.1, 1.0, 0.0), 0.0);
        assert_eq!(part_of_step(0.1, 0.0, 0.1), 1.0);
        assert_eq!(part_of_step(0.1, 1.0, 0.0), 1.0);
    }
}
