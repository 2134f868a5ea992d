//! Stability of water with a free surface at an opening with a level.
//!
//! Water runs between the level outside and the level inside, with up to U = (2 g d)^½ for a difference d. Stability
//! depends on the cell Reynolds number U h/ν: `benches/stability/levels.csv` has runs of a tank that fills or empties.

use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use base::error::Remedy;
use lbm::collision::Operator;
use serde_json::json;

/// Factor by which a value written with few digits may exceed its bound.
const BOUND_SLACK: f64 = 1.0 + 1e-6;

/// Returns the largest cell Reynolds number up to which all runs of the table finished, and the smallest at which one
/// failed; none for operators that were not run.
fn limits(operator: &Operator, eddies: bool) -> Option<[f64; 2]> {
    match (operator, eddies) {
        (Operator::Trt(_), false) => Some([3.0, 4.0]),
        (Operator::Trt(_), true) => Some([3.0, 7.0]),
        (Operator::Bgk(_), false) => Some([7.0, 15.0]),
        (Operator::Bgk(_), true) => Some([15.0, 30.0]),
        _ => None,
    }
}

/// Adds the margin of each opening with a level, and a finding if similar runs failed.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(surface) = &scene.surface else {
        return;
    };
    let Some([holds, fails]) = limits(&flow.collision, flow.turbulence.is_some()) else {
        return;
    };
    for opening in &surface.openings {
        let Some([low, high]) = opening.levels() else {
            continue;
        };
        let inside = opening.inside;
        let difference = (high - inside).abs().max((low - inside).abs());
        let speed = (2.0 * surface.gravity * difference).sqrt();
        let cell = speed * scene.grid.spacing / flow.kinematic_viscosity;
        if speed <= 0.0 {
            continue;
        }
        let name = format!("cell Reynolds number U h/nu: the level `{}`", opening.name);
        margins.push(margin(&name, cell, holds, &opening.path));
        if cell <= holds * BOUND_SLACK {
            continue;
        }
        let reason = format!(
            "levels that differ by {} m give a cell Reynolds number U h/nu of {}, with U = {} m/s: runs of \
             `benches/stability/levels.csv` with this operator finished up to {} and failed at {} and above",
            number(difference),
            number(cell),
            number(speed),
            number(holds),
            number(fails)
        );
        let remedy = remedy(scene, flow, cell, cell / holds);
        if cell >= fails {
            findings.unstable(&opening.path, reason, remedy);
        } else {
            findings.warn(&opening.path, reason, remedy);
        }
    }
}

/// Returns settings with which runs finished at this cell Reynolds number, or the viscosity and the spacing that reduce
/// it by a factor.
fn remedy(scene: &Scene, flow: &Flow, cell: f64, factor: f64) -> Remedy {
    let finer = format!(
        "a viscosity of at least {} m2/s, or a spacing of at most {} m",
        number(flow.kinematic_viscosity * factor),
        number(scene.grid.spacing / factor),
    );
    let single = |eddies: bool| {
        limits(
            &Operator::Bgk(lbm::collision::bgk::BgkParameters {}),
            eddies,
        )
        .is_some_and(|[holds, _]| cell <= holds)
    };
    let collision = format!("{PATH}.collision");
    let eddies = flow.turbulence.is_some();
    if single(eddies) {
        Remedy::from(format!("use the operator `bgk`, or {finer}"))
            .set(collision, json!({"bgk": {}}))
    } else if single(true) {
        Remedy::from(format!(
            "use the eddy viscosity `smagorinsky` with the operator `bgk`, or {finer}"
        ))
        .set(format!("{PATH}.turbulence"), json!({"smagorinsky": {}}))
        .set(collision, json!({"bgk": {}}))
    } else {
        Remedy::from(format!("use {finer}"))
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    /// Returns the findings on a level of 0.2 m in front of water of 0.1 m, at a viscosity \[m2/s\].
    fn found(viscosity: f64, set: &[String]) -> String {
        let case = serde_json::json!({
            "domain": {"size": [0.6, 0.3], "spacing": 0.005},
            "gravity": [0, -9.81],
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": viscosity, "time_step": 1e-4,
                "surface": {"water": [{"level": 0.1}]},
                "boundaries": [{"name": "in", "face": "x_min", "condition": {"level": {"value": 0.2}}}]
            }},
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), set, Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let texts: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        texts.join("\n")
    }

    #[test]
    fn a_level_is_unstable_where_runs_failed() {
        assert!(!found(3e-3, &[]).contains("levels that differ"));
        let problem = found(1.1e-3, &[]);
        assert!(problem.contains("levels that differ by 0.1 m"), "{problem}");
        assert!(problem.contains("use the operator `bgk`"), "{problem}");
        let bgk = r#"fluid.lattice_boltzmann.collision={"bgk": {}}"#.to_owned();
        assert!(!found(1.1e-3, &[bgk]).contains("levels that differ"));
    }
}
