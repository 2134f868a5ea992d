//! Up to which speed a lattice has been seen to hold.
//!
//! What decides is the cell Reynolds number U h/ν = 3 (U/C)/(tau - 1/2), with U the largest speed that is imposed: neither tau nor the Mach
//! number alone. The bounds are those of the maps under `benches/stability`, taken up to Mach 0.2, in scenes of three kinds: no walls and no
//! openings (double shear layer), walls (lid-driven cavities, whose corners are the hardest that walls can be), openings (cylinder behind an
//! inlet). `holds` is the last value up to which every run ended, `fails` the first at which one did not.
//!
//! Beyond a bound the plan warns and does not refuse: a lid's corners are harder than what most flows meet, and many scenes run at several
//! times these values.
//!
//! Of flows with an eddy viscosity only those under a lid are judged: there WALE moved the bounds of BGK and TRT by nothing, and those of
//! the cumulants beyond the map. Streams and channels run with it at a thousand times these values: where the border lies depends on what
//! makes the eddies.

use super::envelope::{Margin, margin};
use crate::case::fluid::Collision;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Condition, Flow};
use crate::scene::speed;

/// Bounds of the cell Reynolds number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    holds: f64,
    fails: f64,
    /// The map.
    map: &'static str,
}

const fn bounds(holds: f64, fails: f64, map: &'static str) -> Bounds {
    Bounds { holds, fails, map }
}

/// What surrounds the water.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Surroundings {
    Periodic,
    Walls,
    Openings,
}

fn surroundings(flow: &Flow) -> Surroundings {
    let mut all = Surroundings::Periodic;
    for patch in flow.patches() {
        match patch.condition {
            Condition::FreeSlip => {}
            Condition::NoSlip | Condition::MovingWall(_) => {
                if all == Surroundings::Periodic {
                    all = Surroundings::Walls;
                }
            }
            _ => all = Surroundings::Openings,
        }
    }
    all
}

/// The bounds of an operator without eddy viscosity.
fn measured(collision: &Collision, dimension: usize, around: Surroundings) -> Bounds {
    const OPEN: &str = "cylinder-10";
    const FREE: &str = "shear-layers-64";
    let cavity = if dimension == 2 {
        "cavity-32"
    } else {
        "cavity-3d-20"
    };
    match (collision, around) {
        (Collision::Bgk {} | Collision::Trt { .. }, Surroundings::Openings) => {
            bounds(10.0, 18.0, OPEN)
        }
        (Collision::Bgk {}, Surroundings::Periodic) if dimension == 2 => bounds(180.0, 200.0, FREE),
        (Collision::Trt { .. }, Surroundings::Periodic) if dimension == 2 => {
            bounds(30.0, 60.0, FREE)
        }
        (Collision::Bgk {}, _) if dimension == 2 => bounds(10.0, 18.0, cavity),
        (Collision::Bgk {}, _) => bounds(10.0, 20.0, cavity),
        (Collision::Trt { .. }, _) => bounds(20.0, 30.0, cavity),
        (Collision::Mrt { .. }, _) => bounds(10.0, 20.0, cavity),
        (Collision::Cumulant { .. }, _) => bounds(30.0, 60.0, cavity),
    }
}

/// Whether a wall that moves along itself ends at one that does not.
fn lid_meets_wall(flow: &Flow) -> bool {
    let faces = |moving: bool| {
        let of_kind = flow.patches().filter(move |patch| match patch.condition {
            Condition::MovingWall(_) => moving,
            Condition::NoSlip => !moving,
            _ => false,
        });
        of_kind.map(|patch| patch.face.axis())
    };
    faces(true).any(|lid| faces(false).any(|wall| wall != lid))
}

/// Notes where the case stands, and warns where runs of the maps failed.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let cumulant = matches!(flow.collision, Collision::Cumulant { .. });
    if flow.turbulence.is_some() && (cumulant || !lid_meets_wall(flow)) {
        return;
    }
    let speeds = speed::imposed(scene, flow).into_iter();
    let Some(speed) = speeds.max_by(|a, b| a.value.total_cmp(&b.value)) else {
        return;
    };
    let cell = speed.value * scene.grid.spacing / flow.kinematic_viscosity;
    let limit = measured(&flow.collision, scene.grid.dimension, surroundings(flow));
    margins.push(margin(
        &format!("cell Reynolds number U h/nu: {}", speed.what),
        cell,
        limit.holds,
        &speed.path,
    ));
    // The border lies between the two; a little less than what failed is taken as failing, for a value written with few digits.
    if cell >= limit.fails * (1.0 - 1e-6) {
        let finest = scene.grid.spacing * limit.holds / cell;
        findings.warn(
            &speed.path,
            format!(
                "{} gives a cell Reynolds number U h/nu of {}: in the map `{}` runs with this operator held up to {} and failed from {} on",
                speed.what,
                number(cell),
                limit.map,
                number(limit.holds),
                number(limit.fails)
            ),
            format!(
                "use a spacing of at most {} m, or a slower flow or a larger viscosity",
                number(finest)
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::case::Document;
    use crate::plan::Plan;

    /// What the plan says of a cavity at this relaxation time and Mach number U/C of the lid.
    fn warned(collision: &str, tau: f64, mach: f64) -> bool {
        let found = planned(collision, 2, tau, mach).unwrap().warnings;
        let words = |w: &crate::error::Problem| w.to_string().contains("cell Reynolds number");
        found.iter().any(words)
    }

    fn planned(
        collision: &str,
        dimension: usize,
        tau: f64,
        mach: f64,
    ) -> Result<Plan, Vec<crate::error::Problem>> {
        let speed = mach * 3e-6 / (1e-4 * (tau - 0.5));
        let (size, face, velocity) = if dimension == 2 {
            ("0.0032, 0.0032", "y_max", format!("{speed}, 0"))
        } else {
            ("0.002, 0.002, 0.002", "z_max", format!("{speed}, 0, 0"))
        };
        let text = format!(
            r#"{{
                "domain": {{"size": [{size}], "spacing": 1e-4}},
                "fluid": {{"lattice_boltzmann": {{
                    "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": {tau},
                    "collision": {{"{collision}": {{}}}},
                    "boundaries": [{{"name": "lid", "face": "{face}", "condition": {{"moving_wall": {{"velocity": [{velocity}]}}}}}}]
                }}}},
                "time": {{"end": 1}}
            }}"#
        );
        let document = Document::read(&text, &[], std::path::Path::new("")).unwrap();
        Plan::prepare(document)
    }

    /// Rows of `benches/stability/cavity-3d-20/map.csv`: tau = 0.51 at Mach 0.03 and 0.1; MRT holds under a lid at tau = 0.6, not at 0.7.
    #[test]
    fn in_three_dimensions_too() {
        for collision in ["bgk", "trt", "mrt"] {
            let quiet = planned(collision, 3, 0.51, 0.03).unwrap().warnings;
            assert!(quiet.is_empty(), "{collision}: {quiet:?}");
            let loud = planned(collision, 3, 0.51, 0.2).unwrap().warnings;
            assert!(!loud.is_empty(), "{collision}");
        }
        assert!(planned("mrt", 3, 0.6, 0.03).unwrap().warnings.is_empty());
        let found = planned("mrt", 3, 0.7, 0.03).unwrap().warnings;
        assert_eq!(found[0].path, "fluid.lattice_boltzmann.collision.mrt");
        assert!(planned("trt", 3, 0.7, 0.03).unwrap().warnings.is_empty());
    }

    /// Rows of `benches/stability/cavity-32/map.csv` on both sides of its border: tau = 0.501 with a slow lid holds, 0.51 with a
    /// faster one does not.
    #[test]
    fn the_verdict_turns_where_the_map_does() {
        for (collision, tau, mach, fails) in [
            ("bgk", 0.503, 0.01, false),
            ("bgk", 0.51, 0.03, false),
            ("bgk", 0.51, 0.06, true),
            ("bgk", 0.53, 0.1, false),
            ("bgk", 0.53, 0.2, true),
            ("trt", 0.51, 0.06, false),
            ("trt", 0.51, 0.1, true),
            ("trt", 0.53, 0.2, false),
            ("trt", 0.501, 0.01, true),
            ("trt", 0.6, 0.2, false),
        ] {
            assert_eq!(
                warned(collision, tau, mach),
                fails,
                "{collision} {tau} {mach}"
            );
        }
    }
}
