//! Stability of water with a free surface at an opening with a level.
//!
//! Water runs between the level outside and the level inside, with up to U = (2 g d)^½ for a difference d. Stability
//! depends on the cell Reynolds number U h/ν: `benches/stability/levels.csv` has runs of a tank that fills or empties.
//!
//! A level that changes slowly never differs that much from the level inside. In a basin of plan area A with this
//! opening alone, of width b and depth D, a rate r drives A r/(b D) through the opening when the water follows, and
//! twice as much while the wave runs to the other end and back (linear long waves: u = (g/D)^½ r t until t = 2 L/(g
//! D)^½). This counts for tables that start at the level inside and do not jump, without structures, whose level keeps
//! its direction for several such times, so that no sloshing adds up.

use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::free_surface::{FreeSurface, Opening};
use base::error::Remedy;
use lbm::boundary::Condition;
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
        let sudden = (2.0 * surface.gravity * difference).sqrt();
        let slow = filling_speed(scene, flow, surface, opening).filter(|slow| *slow < sudden);
        let speed = slow.unwrap_or(sudden);
        let cell = speed * scene.grid.spacing / flow.kinematic_viscosity;
        if speed <= 0.0 {
            continue;
        }
        let name = format!("cell Reynolds number U h/nu: the level `{}`", opening.name);
        margins.push(margin(&name, cell, holds, &opening.path));
        if cell <= holds * BOUND_SLACK {
            continue;
        }
        let cause = if slow.is_some() {
            format!(
                "a level that changes by up to {} m along its table gives",
                number(difference)
            )
        } else {
            format!("levels that differ by {} m give", number(difference))
        };
        let reason = format!(
            "{cause} a cell Reynolds number U h/nu of {}, with U = {} m/s: runs of \
             `benches/stability/levels.csv` with this operator finished up to {} and failed at {} and above",
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

/// Times of a wave along the basin and back for which a level must keep its direction.
const NO_SLOSHING: f64 = 4.0;

/// Returns the largest speed [m/s] with which water follows the table of the level outside, as the head of the file
/// says;
/// `None` where the whole difference may act at once.
fn filling_speed(
    scene: &Scene,
    flow: &Flow,
    surface: &FreeSurface,
    opening: &Opening,
) -> Option<f64> {
    let mut patches = flow.patches();
    let patch = patches.find(|patch| patch.name == opening.name)?;
    let Condition::Level(level) = &patch.condition else {
        return None;
    };
    let table = level.history.as_ref()?;
    let (up, normal) = (surface.axis, patch.face.axis());
    let structures = scene.structures.iter().any(|s| s.stops.water());
    if surface.openings.len() != 1 || structures || normal == up {
        return None;
    }
    let grid = &scene.grid;
    let start = surface.above(table.first()?[1]);
    if (start - opening.inside).abs() > 1e-6 * grid.size[up] {
        return None;
    }
    let depth = opening.levels()?[0].min(opening.inside) - opening.floor;
    let (mut rate, mut turned, mut direction) = (0.0_f64, f64::NEG_INFINITY, 0.0);
    let back = 2.0 * grid.size[normal] / (surface.gravity * depth.max(0.0)).sqrt();
    for rows in table.windows(2) {
        let [[from, low], [to, high]] = [rows[0], rows[1]];
        if to <= from && high.to_bits() != low.to_bits() {
            return None;
        }
        if high.to_bits() == low.to_bits() {
            continue;
        }
        rate = rate.max((high - low).abs() / (to - from));
        let now = (high - low).signum();
        if now * direction < 0.0 {
            if from - turned < NO_SLOSHING * back {
                return None;
            }
            turned = from;
        } else if direction == 0.0 {
            turned = from;
        }
        direction = now;
    }
    let across = |sizes: [f64; 3]| -> f64 {
        (0..grid.dimension)
            .filter(|a| *a != up && *a != normal)
            .map(|a| sizes[a])
            .product()
    };
    let width = across(patch.ends.map(|ends| (ends[1] - ends[0]) * grid.spacing));
    let area = grid.size[normal] * across(grid.size);
    (depth > 0.0 && width > 0.0).then(|| 2.0 * area * rate / (width * depth))
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

    /// Checks a basin of 1 m at which the level rises by 0.1 m: the speed of linear long waves is 2 L r/D = 0.1 m/s for
    /// a rise within 20 s and 0.001 m/s within 2000 s; a rise within 0.1 s is judged as a sudden one.
    #[test]
    fn a_level_that_rises_slowly_is_judged_by_its_rate() {
        let found = |seconds: f64| {
            let case = serde_json::json!({
                "domain": {"size": [1.0, 0.4], "spacing": 0.02},
                "gravity": [0, -9.81],
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
                    "surface": {"water": [{"level": 0.1}]},
                    "boundaries": [{"name": "sea", "face": "x_min",
                        "condition": {"level": {"value": 0.1, "history": [[0, 0.1], [seconds, 0.2]]}}}]
                }},
                "time": {"end": 2.0 * seconds}
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let mut margins = plan.margins.iter();
            let cell = margins.find(|margin| margin.limit.contains("level `sea`"));
            (
                cell.unwrap().value,
                plan.warnings
                    .iter()
                    .any(|p| p.to_string().contains("cell Reynolds number")),
            )
        };
        for seconds in [20.0, 2000.0] {
            let (cell, judged) = found(seconds);
            approx::assert_relative_eq!(cell, 40.0 / seconds, max_relative = 1e-6);
            assert!(!judged);
        }
        let (cell, judged) = found(0.1);
        approx::assert_relative_eq!(
            cell,
            20.0 * (2.0 * 9.81 * 0.1_f64).sqrt(),
            max_relative = 1e-6
        );
        assert!(judged);
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
