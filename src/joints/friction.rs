//! Friction in a joint: laminar flow between parallel walls, and turbulent flow over smooth and rough walls.
//!
//! With the hydraulic diameter `D = 2a`, the Reynolds number `Re = 2 a V/nu = 2 q/nu` and the discharge per width
//! `q = a V`, the pressure gradient is `lambda rho V²/(2 D)`:
//!
//! ```text
//! laminar            lambda = 96/Re                  (the cubic law)
//! turbulent, smooth  lambda = 0.316 Re^(-1/4)        (Blasius 1913)
//! turbulent, rough   lambda = (2 lg(3.7 D/k))^(-2)   (Nikuradse 1933, Colebrook 1939)
//! ```
//!
//! The largest of the three applies: laminar flow becomes turbulent where the laws intersect, at `Re = 2042`
//! between smooth walls and earlier between rough ones. `Re` does not depend on the aperture, and each law scales
//! with the inverse cube of the aperture, so that a link of varying aperture uses [`cube`].

/// Reynolds number up to which the flow is laminar between walls of any roughness: the largest factor of a rough wall
/// is `(2 lg 7.4)^(-2) = 96/290.13`.
const LAMINAR: f64 = 290.0;

/// Coefficients of turbulent friction of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turbulence {
    /// Reynolds number divided by the discharge \[s/m³\]; 0 for laminar flow.
    pub reynolds: f64,
    /// Pressure drop divided by `lambda` and the square of the discharge \[Pa s²/m⁶\].
    pub scale: f64,
    /// Friction factor `lambda` of the rough wall.
    pub rough: f64,
}

/// Returns the effective cube of the aperture of a layer in which the aperture varies linearly between two values
/// \[m³\]: the flow through the layer is that between parallel walls with this cube.
#[must_use]
pub fn cube([a, b]: [f64; 2]) -> f64 {
    2.0 * a * a * b * b / (a + b)
}

/// Returns the effective aperture of a layer for its inertia: the inverse of the mean of `1/a` \[m\].
#[must_use]
pub fn inertial([a, b]: [f64; 2]) -> f64 {
    let difference = (b - a) / a;
    if difference.abs() < 1e-4 {
        // Series of d/ln(1 + d).
        return a * (1.0 + difference * (0.5 - difference / 12.0));
    }
    a * difference / difference.ln_1p()
}

/// Returns the friction factor `lambda` of the rough wall for a roughness height and an aperture \[m\].
#[must_use]
pub fn rough(roughness: f64, aperture: f64) -> f64 {
    // The law is limited to a roughness that fills the joint.
    let relative = (roughness / (2.0 * aperture)).min(0.5);
    if relative <= 0.0 {
        return 0.0;
    }
    (2.0 * (3.7 / relative).log10()).powi(-2)
}

impl Turbulence {
    /// Returns the pressure drop in excess of the laminar one at a discharge of zero or more, and its derivative.
    /// `resistance` is the laminar one \[Pa s/m³\].
    #[must_use]
    pub fn excess(&self, discharge: f64, resistance: f64) -> (f64, f64) {
        if self.reynolds * discharge <= LAMINAR {
            return (0.0, 0.0);
        }
        let smooth = 0.316 * (self.reynolds * discharge).powf(-0.25);
        let (lambda, power) = if smooth > self.rough {
            (smooth, 1.75)
        } else {
            (self.rough, 2.0)
        };
        let fall = lambda * self.scale * discharge * discharge;
        let more = fall - resistance * discharge;
        if more <= 0.0 {
            return (0.0, 0.0);
        }
        (more, power * fall / discharge - resistance)
    }

    /// Returns the discharge `Q` with `Q + answer excess(Q) = laminar`, and its derivative with respect to `laminar`;
    /// `answer` is the derivative of the discharge with respect to the pressure \[m³/(Pa s)\].
    #[must_use]
    pub fn discharge(&self, laminar: f64, answer: f64, resistance: f64) -> (f64, f64) {
        let target = laminar.abs();
        let mut found = target;
        let mut slope = 1.0;
        // The excess is convex: Newton's method converges monotonically from above.
        for _ in 0..60 {
            let (excess, rise) = self.excess(found, resistance);
            slope = 1.0 / answer.mul_add(rise, 1.0);
            let change = (found + answer * excess - target) * slope;
            found -= change;
            if change.abs() <= 1e-15 * target {
                break;
            }
        }
        (found.copysign(laminar), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apertures_of_a_wedge_are_exact_integrals() {
        let (a, b) = (2e-4, 9e-4);
        let steps = 200_000;
        let (mut third, mut first) = (0.0, 0.0);
        for k in 0..steps {
            let part = (f64::from(k) + 0.5) / f64::from(steps);
            let aperture: f64 = a + (b - a) * part;
            third += aperture.powi(-3) / f64::from(steps);
            first += 1.0 / aperture / f64::from(steps);
        }
        assert!((cube([a, b]) * third - 1.0).abs() < 1e-8);
        assert!((inertial([a, b]) * first - 1.0).abs() < 1e-8);
        let near = [inertial([1.0, 1.0 + 0.9e-4]), inertial([1.0, 1.0 + 1.1e-4])];
        assert!((near[1] - near[0] - 0.1e-4).abs() < 1e-9);
    }

    #[test]
    fn the_laws_meet_at_their_reynolds_numbers() {
        // 96/Re = 0.316 Re^(-1/4): Re = (96/0.316)^(4/3).
        let (aperture, width, length, nu, rho) = (1e-3_f64, 0.7, 0.3, 1e-6, 1000.0);
        let resistance = 12.0 * nu * rho * length / (width * aperture.powi(3));
        let mut law = Turbulence {
            reynolds: 2.0 / (width * nu),
            scale: rho * length / (4.0 * width * width * aperture.powi(3)),
            rough: 0.0,
        };
        let limit = (96.0_f64 / 0.316).powf(4.0 / 3.0);
        assert!((limit - 2042.0).abs() < 2.0);
        let at = |law: &Turbulence, re: f64| law.excess(re / law.reynolds, resistance).0;
        assert_eq!(at(&law, 0.999 * limit), 0.0);
        assert!(at(&law, 1.001 * limit) > 0.0);
        // Rough walls, k/D = 0.033: 96/Re = (2 lg(3.7/0.033))^(-2) at 1613.
        law.rough = rough(0.066 * aperture, aperture);
        assert_eq!(at(&law, 1612.0), 0.0);
        assert!(at(&law, 1614.0) > 0.0);
        // For a given pressure gradient, lambda rho V²/(4 a) equals the gradient.
        let drive = 5e4;
        let (discharge, slope) = law.discharge(drive / resistance, 1.0 / resistance, resistance);
        let speed = discharge / (width * aperture);
        let lambda = (2.0 * (3.7_f64 / 0.033).log10()).powi(-2);
        assert!(
            (lambda * rho * speed * speed / (4.0 * aperture) * length / drive - 1.0).abs() < 1e-12
        );
        let more = law
            .discharge(1.001 * drive / resistance, 1.0 / resistance, resistance)
            .0;
        assert!(((more - discharge) / (0.001 * drive / resistance) / slope - 1.0).abs() < 1e-3);
    }
}
