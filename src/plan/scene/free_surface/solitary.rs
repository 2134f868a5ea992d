//! Solitary waves on water of one depth.
//!
//! A solitary wave of height H on water of depth h runs without a change of its shape. Surface and velocities are
//! those of the third order in ε = H/h (R. Grimshaw, J. Fluid Mech. 46 (1971) 611; J. Fenton, J. Fluid Mech. 53
//! (1972) 257), with X = (s - crest)/h, s along the axis of the wave, S = sech αX, T = tanh αX and y the height above
//! the bed over h:
//!
//! ```text
//! αh        = (3ε/4)^½ (1 - 5/8 ε + 71/128 ε²)
//! c²/(gh)   = 1 + ε - 1/20 ε² - 3/70 ε³
//! η/h       = ε S² - 3/4 ε² S² T² + ε³ (5/8 S² T² - 101/80 S⁴ T²)
//! u/(gh)^½  = ε S² + ε² (1/4 S² - S⁴ - y² (3/2 S² - 9/4 S⁴))
//!             - ε³ (19/40 S² + 1/5 S⁴ - 6/5 S⁶ + y² (-3/2 S² - 15/4 S⁴ + 15/2 S⁶)
//!                   + y⁴ (-3/8 S² + 45/16 S⁴ - 45/16 S⁶))
//! v/(gh)^½  = (3ε)^½ y T (ε S² - ε² (3/8 S² + 2 S⁴ + y² (1/2 S² - 3/2 S⁴))
//!             - ε³ (49/640 S² - 17/20 S⁴ - 18/5 S⁶ + y² (-13/16 S² - 25/16 S⁴ + 15/2 S⁶)
//!                   + y⁴ (-3/40 S² + 9/8 S⁴ - 27/16 S⁶)))
//! ```

use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use case::free_surface::SolitaryWave;
use serde::Serialize;

/// Ratio of height to depth above which a solitary wave breaks (J. McCowan, Phil. Mag. 38 (1894) 351).
const BREAKING_HEIGHT: f64 = 0.78;

/// Ratio of height to depth above which the error of the third order exceeds 5 % of the velocity at the surface.
const LARGE_HEIGHT: f64 = 0.4;

/// A solitary wave in SI.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SolitaryForm {
    /// Height of the undisturbed water surface, and depth of the water below it \[m\].
    pub(super) level: f64,
    depth: f64,
    /// Height over depth.
    steepness: f64,
    axis: usize,
    crest: f64,
    /// 1, or -1 for a wave that travels towards smaller coordinates.
    direction: f64,
    gravity: f64,
}

impl SolitaryForm {
    /// Returns the axis along which the wave travels.
    pub(super) fn axis(&self) -> usize {
        self.axis
    }

    /// Returns the depth of the undisturbed water \[m\].
    pub(crate) fn depth(&self) -> f64 {
        self.depth
    }

    /// Returns the speed of the wave [m/s].
    pub(crate) fn speed(&self) -> f64 {
        let e = self.steepness;
        let square = 1.0 + e - e * e / 20.0 - 3.0 / 70.0 * e * e * e;
        (self.gravity * self.depth * square).sqrt()
    }

    /// Returns the height of the crest above the undisturbed surface \[m\].
    pub(crate) fn crest_height(&self) -> f64 {
        self.steepness * self.depth
    }

    /// Returns sech² and tanh of αX at a point.
    fn shape(&self, at: [f64; 3]) -> [f64; 2] {
        let e = self.steepness;
        let alpha = (0.75 * e).sqrt() * (1.0 - 5.0 / 8.0 * e + 71.0 / 128.0 * e * e);
        let x = alpha * self.direction * (at[self.axis] - self.crest) / self.depth;
        let t = x.tanh();
        // 1 - tanh² loses the digits of the tail.
        [x.cosh().powi(-2), t]
    }

    /// Returns the elevation above the undisturbed surface \[m\].
    pub(super) fn elevation(&self, at: [f64; 3]) -> f64 {
        let [s2, t] = self.shape(at);
        let (e, t2) = (self.steepness, t * t);
        let third = 5.0 / 8.0 * s2 * t2 - 101.0 / 80.0 * s2 * s2 * t2;
        self.depth * (e * s2 - 0.75 * e * e * s2 * t2 + e * e * e * third)
    }

    /// Returns the velocities along the axis of the wave and upwards [m/s] at a height above the undisturbed surface
    /// \[m\].
    pub(super) fn velocity(&self, at: [f64; 3], height: f64) -> [f64; 2] {
        let [s2, t] = self.shape(at);
        let e = self.steepness;
        let y = (1.0 + height / self.depth).max(0.0);
        let (s4, s6, y2) = (s2 * s2, s2 * s2 * s2, y * y);
        let y4 = y2 * y2;
        let second = 0.25 * s2 - s4 - y2 * (1.5 * s2 - 2.25 * s4);
        let third = 19.0 / 40.0 * s2 + 0.2 * s4 - 1.2 * s6
            + y2 * (-1.5 * s2 - 3.75 * s4 + 7.5 * s6)
            + y4 * (-0.375 * s2 + 45.0 / 16.0 * (s4 - s6));
        let along = e * s2 + e * e * second - e * e * e * third;
        let second = 0.375 * s2 + 2.0 * s4 + y2 * (0.5 * s2 - 1.5 * s4);
        let third = 49.0 / 640.0 * s2 - 0.85 * s4 - 3.6 * s6
            + y2 * (-13.0 / 16.0 * s2 - 25.0 / 16.0 * s4 + 7.5 * s6)
            + y4 * (-0.075 * s2 + 1.125 * s4 - 27.0 / 16.0 * s6);
        let up = (3.0 * e).sqrt() * y * t * (e * s2 - e * e * second - e * e * e * third);
        let speed = (self.gravity * self.depth).sqrt();
        [self.direction * speed * along, speed * up]
    }
}

/// Returns a wave, or reports findings about its fields. `up` is the axis of gravity, `weight` the acceleration along
/// it, and `above` the height of the level above the lowest point of the domain.
pub(super) fn resolve(
    grid: &Grid,
    (up, weight): (usize, f64),
    (wave, path): (&SolitaryWave, &str),
    above: f64,
    findings: &mut Findings,
) -> Option<SolitaryForm> {
    let axis = wave.axis.index();
    let path = format!("{path}.solitary_wave");
    if axis >= grid.dimension || axis == up {
        findings.error(
            &format!("{path}.axis"),
            "a wave must run along an axis of the domain that is normal to gravity",
            "write another axis",
        );
        return None;
    }
    let depth = wave.depth.unwrap_or(above);
    if !(depth > 0.0 && depth.is_finite()) {
        let at = if wave.depth.is_some() {
            "depth"
        } else {
            "level"
        };
        findings.error(
            &format!("{path}.{at}"),
            "there is no water below the wave",
            "use a depth above 0 m",
        );
        return None;
    }
    let steepness = wave.height / depth;
    if !(steepness > 0.0 && steepness <= BREAKING_HEIGHT) {
        findings.error(
            &format!("{path}.height"),
            format!(
                "a solitary wave of {} m on water {} m deep does not exist, because waves higher than \
                 {BREAKING_HEIGHT} of the depth break",
                number(wave.height),
                number(depth)
            ),
            format!("use a height above 0 and of at most {} m", number(BREAKING_HEIGHT * depth)),
        );
        return None;
    }
    if !wave.crest.is_finite() || above + wave.height > grid.size[up] {
        findings.error(
            &path,
            format!(
                "the crest does not fit into the domain, which is {} m high",
                number(grid.size[up])
            ),
            "use a lower wave or a higher domain, and a finite `crest`",
        );
        return None;
    }
    if steepness > LARGE_HEIGHT {
        findings.warn(
            &format!("{path}.height"),
            format!(
                "the height is {} of the depth: the third-order theory of the initial wave has an error of 5 % \
                 in the velocity at 0.4",
                number(steepness)
            ),
            format!("use a height of at most {} m", number(LARGE_HEIGHT * depth)),
        );
    }
    Some(SolitaryForm {
        level: wave.level,
        depth,
        steepness,
        axis,
        crest: wave.crest,
        direction: if wave.backward { -1.0 } else { 1.0 },
        gravity: weight.abs(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest errors of the conditions at the surface, kinematic and dynamic, and of the continuity below
    /// it, for a wave on water 1 m deep with a gravity of 1 m/s2.
    fn errors(steepness: f64, direction: f64) -> [f64; 3] {
        let wave = SolitaryForm {
            level: 0.0,
            depth: 1.0,
            steepness,
            axis: 0,
            crest: 0.3,
            direction,
            gravity: 1.0,
        };
        let e = steepness;
        let c = direction * (1.0 + e - e * e / 20.0 - 3.0 / 70.0 * e * e * e).sqrt();
        let step = 1e-4;
        let mut errors = [0.0_f64; 3];
        for n in -200..=200 {
            let x = 0.3 + 0.04 * f64::from(n) / e.sqrt();
            let height = |x: f64| wave.elevation([x, 0.0, 0.0]);
            let at = |x: f64, y: f64| wave.velocity([x, 0.0, 0.0], y);
            let [u, v] = at(x, height(x));
            let slope = (height(x + step) - height(x - step)) / (2.0 * step);
            let head = 0.5 * ((u - c).powi(2) + v * v) + height(x) - 0.5 * c * c;
            let mut largest = |n: usize, error: f64| errors[n] = errors[n].max(error.abs());
            largest(0, v - (u - c) * slope);
            largest(1, head);
            for y in [-0.8, -0.4, 0.0] {
                let [right, left] = [at(x + step, y), at(x - step, y)];
                let [above, below] = [at(x, y + step), at(x, y - step)];
                let divergence = right[0] - left[0] + above[1] - below[1];
                largest(2, divergence / (2.0 * step));
            }
        }
        errors
    }

    /// Checks that the residuals of the equations at the surface decrease with the fourth power of the wave height, and
    /// those along the wave with half a power more.
    #[test]
    fn a_wave_solves_the_equations_to_the_third_order() {
        for direction in [1.0, -1.0] {
            let [coarse, fine] = [0.1, 0.05].map(|e| errors(e, direction));
            for (n, order) in [4.5_f64, 4.0, 4.5].into_iter().enumerate() {
                let found = (coarse[n] / fine[n]).log2();
                assert!((found - order).abs() < 0.2, "{n}: order {found}");
            }
            assert!(coarse.iter().all(|error| *error < 3e-4), "{coarse:?}");
        }
    }
}
