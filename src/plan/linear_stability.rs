//! Linear stability over the steps of a run: growing waves with multiple relaxation times.
//!
//! Near tau = 1/2 only the eddy viscosity damps the shortest waves. If the moments of an operator are not
//! orthogonal under the weights of the lattice and have different rates, some waves grow in stationary fluid
//! ([`lbm::collision::linear_stability`]): with the published matrix and rates of Suga by 0.075 % per step at tau =
//! 0.5001. A short run does not show this. Over G = gain times steps an amplitude grows by the factor e^G. With the
//! operator `mrt` none grow.
//!
//! Evidence: with the matrix of Suga and WALE the open joint of `jobs/rock_scour/stagnation.json` failed at tau =
//! 0.5001 after 11,000 steps (G = 8.3). With cells four times as wide it was stable for its 3907 steps (G = 3.6). Eddy
//! viscosity may damp such waves, so that the finding is a warning.

use super::Clock;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use base::error::Remedy;
use serde_json::json;

/// Maximum G without a finding.
const QUIET_GAIN: f64 = 7.0;
/// Gain per step above which runs failed: with the rates of Suga runs were stable at tau = 0.65 (2.2 %) and failed
/// at 0.7 (3.3 %) under a lid; with q = 1.99 and XX = 1.2 they failed at 2.5 %.
const FAILING_GAIN: f64 = 0.024;

/// Reports a wave that grows too much over the run.
pub(super) fn check(flow: &Flow, clock: &Clock, findings: &mut Findings) {
    let growing = flow
        .models
        .collision
        .model()
        .growing_wave(flow.relaxation_time);
    let Some(wave) = growing else { return };
    let gain = wave.factor - 1.0;
    #[allow(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
    let growth = gain * clock.steps as f64;
    if growth < QUIET_GAIN && gain < FAILING_GAIN {
        return;
    }
    let family = format!("{PATH}.collision");
    let path = &format!("{family}.{}", flow.models.collision.name());
    let reason = format!(
        "at tau = {} waves of {:.1} cells grow by {} % per step in water at rest with these rates",
        number(flow.relaxation_time),
        wave.length(),
        number(100.0 * gain),
    );
    let remedy = Remedy::from("use mrt, with which no waves grow in water at rest")
        .set(family, json!({"mrt": {}}));
    if gain < FAILING_GAIN {
        let steps = clock.steps;
        let long = format!(
            "{reason}, by a factor of e^{growth:.0} in {steps} steps unless eddy viscosity damps them"
        );
        findings.warn(path, long, remedy);
    } else {
        let failed = format!(
            "{reason}, and runs failed at a growth of {} % and above",
            number(100.0 * FAILING_GAIN)
        );
        findings.unstable(path, failed, remedy);
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;

    /// Returns the finding about waves in a closed box of water with an operator and relaxation time over some steps.
    fn finding_about(collision: &str, tau: f64, steps: u32) -> Option<String> {
        let step = (tau - 0.5) / 3.0 * 1e-2;
        let end = step * f64::from(steps);
        let text = format!(
            r#"{{
                "domain": {{"size": [0.001, 0.001, 0.001], "spacing": 1e-4}},
                "fluid": {{"lattice_boltzmann": {{
                    "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": {tau},
                    "lattice": "d3q27", "collision": {collision}
                }}}},
                "time": {{"end": {end}}}
            }}"#
        );
        let document = Document::read(&text, &[], std::path::Path::new("")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let words = plan.warnings.iter().map(ToString::to_string);
        words.into_iter().find(|w| w.contains("in water at rest"))
    }

    #[test]
    fn a_long_run_with_the_published_matrix_close_to_one_half_is_warned_of() {
        let suga = r#"{"suga": {}}"#;
        assert_eq!(finding_about(suga, 0.5001, 4000), None);
        let words = finding_about(suga, 0.5001, 37_500).unwrap();
        assert!(
            words.contains("grow by 0.07536 % per step") && words.contains("by a factor of e^28"),
            "{words}"
        );
        assert_eq!(finding_about(suga, 0.502, 1_000_000), None);
        for held in [r#"{"cumulant": {}}"#, r#"{"mrt": {}}"#] {
            assert_eq!(finding_about(held, 0.5001, 37_500), None);
        }
    }

    /// Checks rates with which a run failed at once.
    #[test]
    fn rates_that_overshoot_are_called_unstable() {
        let words = finding_about(r#"{"suga": {"q": 1.99, "xx": 1.2}}"#, 0.6, 10).unwrap();
        assert!(
            words.contains("runs failed at a growth of 2.4 % and above"),
            "{words}"
        );
    }
}
