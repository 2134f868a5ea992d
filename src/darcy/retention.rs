//! Retention and relative permeability of unsaturated soil, as functions of the pressure head.
//!
//! ```text
//! theta = theta_r + (theta_s - theta_r) S_e(psi),     K = K_s k_r(psi),     psi = p/(rho g)
//! S_e = k_r = 1 at psi >= 0
//! ```
//!
//! The permeability of a face between two cells is the mean of `k_r` that makes the flux of a column exact where `ln
//! k_r` is linear in `psi` between the two (Gardner's soil everywhere, any soil in the limit of small cells). With `r
//! = ln(k_2/k_1)`, the slope `lambda = r/(psi_2 - psi_1)`, the rise `d` of the elevation from 1 to 2, and `E(x) = (e^x
//! - 1)/x`,
//!
//! ```text
//! k_f = k_1 E(r + lambda d)/E(lambda d)
//! ```
//!
//! This is the exponential fitting of D. L. Scharfetter and H. K. Gummel (IEEE Trans. Electron Devices 16 (1969)
//! 64) for the flux `-k_r d(psi + z)/dz`. Along a horizontal axis it is the logarithmic mean, the integral mean of
//! an exponential `k_r`; if a model provides its integral, the integral mean itself is used there, with which the
//! discharge of a dam is exact on any grid. In a tall cell that drains under gravity it is the `k_r` of the upper
//! cell, without oscillation; stationary water remains exactly stationary.
//!
//! Each model has its own file below this module and one line in the list.

use base::family::family;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

family! {
    /// Retention models. A new line makes a model available to cases, to their schema and to runs.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case", deny_unknown_fields)]
    #[schemars(inline)]
    pub enum Retention: dyn RetentionLaw, summary {
        van_genuchten: VanGenuchten(VanGenuchten),
        gardner: Gardner(Gardner),
        haverkamp: Haverkamp(Haverkamp),
        saturated_only: SaturatedOnly(SaturatedOnly),
    }
}

/// Suction below which a soil is nearly saturated, in capillary lengths.
pub(crate) const NEARLY_SATURATED: f64 = 1e-4;

/// Negative logarithm of the effective saturation below which the content is rounding: exp(-34) is eight times the
/// rounding of 1.
const ROUNDED: f64 = 34.0;

/// State of a soil at a pressure head.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SoilState {
    /// Volume of water per volume of soil \[1\].
    pub content: f64,
    /// Water capacity: derivative of the content with respect to the pressure head \[1/m\].
    pub capacity: f64,
    /// Natural logarithm of the relative permeability.
    pub log_permeability: f64,
    /// Derivative of the logarithm of the relative permeability with respect to the pressure head \[1/m\].
    pub slope: f64,
}

/// Model of retention and relative permeability.
pub trait RetentionLaw: Sync {
    /// Returns the description of the model in the schema of the case: one line.
    fn summary() -> &'static str
    where
        Self: Sized;

    /// Returns the model with its parameters for the tables of `plan`.
    fn description(&self) -> String;

    /// Returns the state at a pressure head \[m\].
    fn state(&self, head: f64) -> SoilState;

    /// Returns the degree of saturation at a pressure head: water content over that at saturation \[1\].
    fn saturation(&self, head: f64) -> f64 {
        self.state(head).content / self.state(0.0).content
    }

    /// Returns the content of water that does not drain \[1\].
    fn residual_content(&self) -> f64 {
        0.0
    }

    /// Returns the effective degree of saturation at a pressure head: the content above the residual one over that at
    /// saturation \[1\].
    fn effective_saturation(&self, head: f64) -> f64 {
        let residual = self.residual_content();
        (self.state(head).content - residual) / (self.state(0.0).content - residual)
    }

    /// Returns the integral of a power of the relative permeability over the pressure head, up to `head` \[m\]
    /// (Kirchhoff's potential); none without a closed form.
    fn potential(&self, _head: f64, _power: f64) -> Option<f64> {
        None
    }

    /// Returns the height \[m\] over which the permeability decreases to about 1/e above the phreatic surface, for
    /// comparison with the cells.
    fn capillary_length(&self) -> f64;

    /// Returns the pressure head \[m\] below which the water that can drain is less than the rounding of that of
    /// saturation.
    fn driest_head(&self) -> f64 {
        f64::NEG_INFINITY
    }

    /// Returns the exponent q with which the permeability leaves its saturated value, `1 - k_r ~ |psi|^q`: at most 1,
    /// and below 1 if its slope is infinite at saturation.
    fn saturation_exponent(&self) -> f64 {
        1.0
    }

    /// Returns `true` if the model defines the stored water, which a transient flow needs.
    fn stores(&self) -> bool {
        true
    }

    /// Returns a parameter that is out of range, with the range and a remedy; none if all are valid.
    fn check(&self) -> Option<Fault>;
}

/// Parameter out of range.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Path of the parameter below the retention of the case, such as `van_genuchten.n`.
    pub path: &'static str,
    /// Reason, with the allowed range.
    pub reason: String,
    /// Remedy for the parameter.
    pub remedy: String,
}

/// Relative permeability of a face, and its derivatives with respect to the pressure heads on both sides \[1/m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Relative permeability \[1\].
    pub permeability: f64,
    /// Derivatives with respect to the first and the second pressure head \[1/m\].
    pub derivatives: [f64; 2],
}

/// Side of a face.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    /// Pressure head \[m\].
    pub head: f64,
    /// Natural logarithm of the relative permeability.
    pub log_permeability: f64,
    /// Derivative of the logarithm of the relative permeability with respect to the pressure head \[1/m\].
    pub slope: f64,
    /// Kirchhoff's potential \[m\]; none if the model has no closed form.
    pub potential: Option<f64>,
}

/// Returns ln((e^x - 1)/x).
fn log_ratio(x: f64) -> f64 {
    if x.abs() < 1e-4 {
        x * (0.5 + x / 24.0)
    } else if x > 0.0 {
        x + (-(-x).exp_m1() / x).ln()
    } else {
        (x.exp_m1() / x).ln()
    }
}

/// Returns the derivative of [`log_ratio`]: 1/(1 - e^-x) - 1/x.
fn log_ratio_slope(x: f64) -> f64 {
    if x.abs() < 1e-2 {
        0.5 + x * (1.0 - x * x / 60.0) / 12.0
    } else {
        -1.0 / (-x).exp_m1() - 1.0 / x
    }
}

/// Returns the relative permeability of a face between two states; `rise` is the elevation of the second minus that
/// of the first \[m\].
#[must_use]
pub fn mean(first: Side, second: Side, rise: f64) -> Mean {
    let (a, b) = (first, second);
    if a.log_permeability.abs() + b.log_permeability.abs() <= 0.0 {
        // Both sides are saturated.
        return Mean {
            permeability: 1.0,
            derivatives: [0.0; 2],
        };
    }
    let difference = b.head - a.head;
    let ratio = b.log_permeability - a.log_permeability;
    // For nearly equal states the chord is the mean slope, whose change is negligible.
    let near = difference.abs() <= 1e-9 * (a.head.abs() + b.head.abs());
    let (chord, changes) = if near {
        (0.5 * (a.slope + b.slope), [0.0; 2])
    } else {
        let chord = ratio / difference;
        (
            chord,
            [
                (chord - a.slope) / difference,
                (b.slope - chord) / difference,
            ],
        )
    };
    if let (Some(low), Some(high)) = (a.potential, b.potential)
        && rise.abs() <= 0.0
        && !near
    {
        let permeability = (high - low) / difference;
        return Mean {
            permeability,
            derivatives: [
                (permeability - a.log_permeability.exp()) / difference,
                (b.log_permeability.exp() - permeability) / difference,
            ],
        };
    }
    let (drained, sum) = (chord * rise, ratio + chord * rise);
    let permeability = (a.log_permeability + log_ratio(sum) - log_ratio(drained)).exp();
    let (at_sum, at_drained) = (log_ratio_slope(sum), log_ratio_slope(drained));
    let by_chord = (at_sum - at_drained) * rise;
    Mean {
        permeability,
        derivatives: [
            permeability * (a.slope * (1.0 - at_sum) + by_chord * changes[0]),
            permeability * (b.slope * at_sum + by_chord * changes[1]),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::gardner::Gardner;
    use super::haverkamp::Haverkamp;
    use super::saturated_only::SaturatedOnly;
    use super::van_genuchten::VanGenuchten;
    use super::*;

    fn side(law: &dyn RetentionLaw, head: f64) -> Side {
        let state = law.state(head);
        Side {
            head,
            log_permeability: state.log_permeability,
            slope: state.slope,
            potential: law.potential(head, 1.0),
        }
    }

    fn laws() -> [Retention; 4] {
        [
            Retention::VanGenuchten(VanGenuchten {
                alpha: 3.35,
                n: 2.0,
                saturated_content: 0.368,
                residual_content: 0.102,
                exponent: 0.5,
            }),
            Retention::Gardner(Gardner {
                alpha: 5.0,
                saturated_content: 0.4,
                residual_content: 0.1,
            }),
            Retention::Haverkamp(Haverkamp {
                content_head: 0.39,
                content_exponent: 2.9,
                permeability_head: 0.2,
                permeability_exponent: 5.0,
                saturated_content: 0.3,
                residual_content: 0.0,
            }),
            Retention::SaturatedOnly(SaturatedOnly {
                thickness: Some(0.01),
            }),
        ]
    }

    /// Compares derivatives with central differences of contents, permeabilities and means.
    #[test]
    fn derivatives_are_those_of_the_functions() {
        let step = 1e-6;
        let close = |found: f64, stated: f64, scale: f64| {
            assert!((found - stated).abs() < 2e-5 * scale, "{found} {stated}");
        };
        for law in laws() {
            let law = law.model();
            for head in [-8.0, -1.3, -0.4, -0.05, -0.003, 0.2] {
                let (low, high) = (law.state(head - step), law.state(head + step));
                let here = law.state(head);
                close(
                    (high.content - low.content) / (2.0 * step),
                    here.capacity,
                    1.0,
                );
                let found = (high.log_permeability - low.log_permeability) / (2.0 * step);
                close(found, here.slope, 1.0 + here.slope);
                for (other, rise) in [(-2.0, 0.0), (-0.1, 0.3), (0.5, -0.2), (head + 0.01, 0.05)] {
                    let at = |a: f64, b: f64| mean(side(law, a), side(law, b), rise).permeability;
                    let here = mean(side(law, head), side(law, other), rise);
                    let first = (at(head + step, other) - at(head - step, other)) / (2.0 * step);
                    let second = (at(head, other + step) - at(head, other - step)) / (2.0 * step);
                    let scale = 1.0 + here.permeability / law.capillary_length();
                    close(first, here.derivatives[0], scale);
                    close(second, here.derivatives[1], scale);
                }
            }
        }
    }

    /// Checks a column of Gardner's soil under a constant flux, e^(alpha psi) = R + (1 - R) e^(-alpha z): the flux
    /// between any two heights is exact.
    #[test]
    fn the_flux_of_a_column_is_exact_in_cells_of_any_height() {
        let law = Retention::Gardner(Gardner {
            alpha: 5.0,
            saturated_content: 0.4,
            residual_content: 0.1,
        });
        let law = law.model();
        for rain in [0.1, 0.9, -0.005] {
            let head = |z: f64| (rain + (1.0_f64 - rain) * (-5.0 * z).exp()).ln() / 5.0;
            for (low, high) in [(0.1, 0.2), (0.0, 0.5), (0.3, 1.0)] {
                let (a, b) = (head(low), head(high));
                let rise = high - low;
                let k = mean(side(law, a), side(law, b), rise).permeability;
                let flux = k * (b + rise - a) / rise;
                assert!((flux - rain).abs() < 1e-12, "{rain} {flux}");
            }
        }
    }

    #[test]
    fn a_mean_lies_between_and_does_not_depend_on_the_order() {
        for law in laws() {
            let law = law.model();
            for (a, b) in [(-3.0, -0.2), (-0.5, 0.4), (-1.0, -1.0 + 1e-12)] {
                for rise in [-0.3, 0.0, 0.02] {
                    let (a, b) = (side(law, a), side(law, b));
                    let there = mean(a, b, rise).permeability;
                    let back = mean(b, a, -rise).permeability;
                    assert!((there / back - 1.0).abs() < 1e-12);
                    let (ka, kb) = (a.log_permeability.exp(), b.log_permeability.exp());
                    if rise <= 0.0 {
                        assert!(there >= ka.min(kb) * (1.0 - 1e-9));
                    }
                    assert!(there <= ka.max(kb) * (1.0 + 1e-9));
                }
            }
        }
    }
}
