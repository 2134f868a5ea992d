//! Waves that multiple relaxation times let grow by themselves, over the steps of a run.
//!
//! Near tau = 1/2 nothing but eddies damps the shortest waves, and with rates that differ from moment to moment some of them gain in
//! water at rest ([`growth`]): with those of Suga 0.075 % in a step at tau = 0.5001. A short run never shows it; over G = gain times
//! steps, an amplitude becomes e^G times itself.
//!
//! Seen: with the rates of Suga and WALE the open joint of `jobs/rock_scour/stagnation.json` failed at tau = 0.5001 after 11,000 steps
//! (G = 8.3); with cells four times as wide it held for its 3907 (G = 3.6). Since eddies may hold such waves it is a warning.

use super::Clock;
use crate::case::fluid::Collision;
use crate::error::Remedy;
use crate::lbm::collision::growth::{self, Wave};
use crate::lbm::collision::mrt::{Mrt, Rates};
use crate::lbm::lattice::D3Q27;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, SUGA_GROWS};
use serde_json::json;

/// G of which nothing is said.
const QUIET: f64 = 7.0;
/// From this gain in a step on runs failed: with the rates of Suga they held at tau = 0.65 (2.2 %) and failed at 0.7 (3.3 %) under a lid;
/// with q = 1.99 and XX = 1.2 at 2.5 %.
const FAILS: f64 = 0.024;

/// The rates of multiple relaxation times beside that of the shear stress; those of Suga where they are not given.
#[must_use]
pub fn rates(collision: &Collision) -> Option<Rates> {
    let Collision::Mrt { bulk, .. } = collision else {
        return None;
    };
    let suga = Rates::SUGA;
    let [q, psi, epsilon, e_cubed, xx, xy, tau, xyz] = collision.higher_rates();
    Some(Rates {
        bulk: bulk.unwrap_or(suga.bulk),
        q: q.unwrap_or(suga.q),
        psi: psi.unwrap_or(suga.psi),
        epsilon: epsilon.unwrap_or(suga.epsilon),
        e_cubed: e_cubed.unwrap_or(suga.e_cubed),
        xx: xx.unwrap_or(suga.xx),
        xy: xy.unwrap_or(suga.xy),
        tau: tau.unwrap_or(suga.tau),
        xyz: xyz.unwrap_or(suga.xyz),
    })
}

/// The wave that gains most, where the scene has not spoken of it already, whatever the steps.
fn fastest(flow: &Flow) -> Option<Wave> {
    let rates = rates(&flow.collision)?;
    let tau = flow.relaxation_time;
    let said = flow.collision.second_order() || rates == Rates::SUGA && tau >= SUGA_GROWS;
    (!said && tau > 0.5).then(|| {
        growth::fastest::<D3Q27, _, 27>(&Mrt::<false> {
            omega: 1.0 / tau,
            rates,
            force: [0.0; 3],
        })
    })
}

/// Whether a wave gains too much over the run.
pub(super) fn check(flow: &Flow, clock: &Clock, findings: &mut Findings) {
    let Some(wave) = fastest(flow) else { return };
    let gain = wave.factor - 1.0;
    #[allow(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
    let growth = gain * clock.steps as f64;
    if growth < QUIET && gain < FAILS {
        return;
    }
    let path = "fluid.lattice_boltzmann.collision.mrt";
    let reason = format!(
        "at tau = {} waves of {:.1} cells gain {} % in a step in water at rest with these rates",
        number(flow.relaxation_time),
        wave.length(),
        number(100.0 * gain),
    );
    let remedy = Remedy::from("use cumulant, or a larger tau")
        .set("fluid.lattice_boltzmann.collision", json!({"cumulant": {}}));
    if gain < FAILS {
        let steps = clock.steps;
        let long = format!(
            "{reason}, e^{growth:.0} times themselves in {steps} steps: only eddies can hold them"
        );
        findings.warn(path, long, remedy);
    } else {
        let failed = format!(
            "{reason}, and runs failed from {} % on",
            number(100.0 * FAILS)
        );
        findings.unstable(path, failed, remedy);
    }
}

#[cfg(test)]
mod tests {
    use crate::case::Document;
    use crate::plan::Plan;

    /// What the plan says of waves in a closed box of water with an operator and relaxation time over some steps.
    fn said(collision: &str, tau: f64, steps: u32) -> Option<String> {
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
    fn a_long_run_with_the_rates_of_suga_close_to_one_half_is_warned_of() {
        let suga = r#"{"mrt": {}}"#;
        assert_eq!(said(suga, 0.5001, 4000), None);
        let words = said(suga, 0.5001, 37_500).unwrap();
        assert!(
            words.contains("gain 0.07536 % in a step") && words.contains("e^28 times themselves"),
            "{words}"
        );
        assert_eq!(said(suga, 0.502, 1_000_000), None);
        assert_eq!(said(r#"{"cumulant": {}}"#, 0.5001, 37_500), None);
    }

    /// Seen to fail at once.
    #[test]
    fn rates_that_overshoot_are_called_unstable() {
        let words = said(r#"{"mrt": {"q": 1.99, "xx": 1.2}}"#, 0.6, 10).unwrap();
        assert!(words.contains("runs failed from 2.4 % on"), "{words}");
    }
}
