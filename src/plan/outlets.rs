//! Outlets that a body can cover while an imposed inflow continues.
//!
//! Water that enters with an imposed velocity leaves through the openings whose flow is free. Where a body covers a
//! part of them, the inflow Q passes through the rest of their area, U = Q/(A - a), and the density grows until this
//! flow is established. A body at least as wide as the only outlet leaves no rest: the mass of the water then grows at
//! every step. A disc covers its width of an opening at most, a sphere or block the area of its section.
//!
//! A fixed body covers what it meets, a driven body what its path meets, which is unstable. Where a free body goes is
//! not known before the run: it may reach an outlet towards which water and weight carry it fast enough, and the plan
//! warns. The water that does not leave must fill the domain to the limit of the density before the run ends.
//!
//! Past a body that stays, the pressure p of the water drives a jet through the rest of the opening, of width w. Its
//! speed U follows from the contraction of the jet and, in creeping flow, from the resistance of a slit (H. Hasimoto,
//! J. Phys. Soc. Japan 13 (1958) 633): p/ρ = (U/0.61)²/2 + 32 ν U/(π w). With 12 of 14 cells of an outlet covered, and
//! a density of 1.2, the discharge was 0.92 times that.

use crate::driven_path;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::speed::{imposed_on_fluid, settling};
use base::vector::norm;
use lbm::boundary::{Condition, Inflow};
use std::f64::consts::PI;

/// Width of a jet over that of the gap between sharp edges from which it issues (Kirchhoff): the water contracts beyond
/// a body that stays at an outlet.
const CONTRACTION: f64 = 0.61;
/// Number of positions on the path of a driven body.
const POSITIONS: u32 = 64;
/// Number of parts in which the density grows to its limit.
const PARTS: u32 = 32;

/// Gap between a fixed body and an outflow with the state of the water below which runs failed \[cells\].
const NEAR: f64 = 1.1;

/// Reports the first fixed body that meets, or nearly meets, an outflow with the state of the water in front of it.
///
/// Runs of discs of 2.6 and 5.2 cells in a stream of 0.02 lattice units ended with gaps of -1 to 1 cells, with
/// half-way links, with interpolated ones and in saturated cells, at relaxation times of 0.56 and 0.8; at 1.2, in a
/// corner, in a tenth of the stream, with a convective outflow and with a pressure they held.
pub(super) fn near_outflow(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
        return;
    };
    let h = scene.grid.spacing;
    let floats = |patch: &&ScenePatch| matches!(patch.condition, Condition::Outflow(_));
    let fixed = scene.bodies.iter().enumerate();
    for (n, body) in fixed.filter(|(_, body)| body.mobility == Mobility::Fixed) {
        for outlet in flow.patches().filter(floats) {
            let axis = outlet.face.axis();
            let face = if outlet.face.is_max() {
                scene.grid.size[axis]
            } else {
                0.0
            };
            let gap = ((body.position[axis] - face).abs() - 0.5 * width(body)) / h;
            let mut others = (0..scene.grid.dimension).filter(|a| *a != axis);
            let meets = others.all(|a| {
                let [low, high] = outlet.ends[a].map(|end| end * h);
                (low..=high).contains(&body.position[a])
            });
            if gap >= NEAR || !meets {
                continue;
            }
            let path = format!("bodies[{n}].position");
            let reason = format!(
                "the body `{}` stands {} cells in front of the outflow `{}`, which repeats the state of the water: \
                 many runs with a gap of less than a cell ended",
                body.name,
                number(gap),
                outlet.name
            );
            let remedy = "use `convective_outflow` or `pressure`, or leave two cells or more";
            findings.warn(&path, reason, remedy);
            return;
        }
    }
}

/// Reports the first body that can cover so much of an outlet that the rest lets the inflow out too fast.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
        return;
    };
    let grid = &scene.grid;
    let (mut inflow, mut area, mut outlets) = (0.0, 0.0, Vec::new());
    for patch in flow.patches() {
        let (model, place) = (patch.condition.model(), patch.imposed_at(grid, PATH));
        match model.largest_inflow(&place) {
            Inflow::Mean(mean) => inflow += mean * place.area(),
            Inflow::Any if model.passes_water() => {
                area += place.area();
                outlets.push(patch);
            }
            Inflow::Any | Inflow::None => {}
        }
    }
    if inflow <= 0.0 {
        return;
    }
    for (n, body) in scene.bodies.iter().enumerate() {
        for outlet in &outlets {
            let [covered, time] = match body.mobility {
                Mobility::Fixed | Mobility::Driven => {
                    [covered_on_path(scene, outlet, body), scene.time.end]
                }
                Mobility::Free => [
                    most_covered(scene, outlet, body),
                    time_at_outlet(scene, flow, outlet, body),
                ],
            };
            let rest = (area - covered).max(0.0);
            if covered > 0.0 && time_to_fill(scene, flow, body, (inflow, rest)) < time {
                let contraction = if body.mobility == Mobility::Fixed {
                    CONTRACTION
                } else {
                    1.0
                };
                let speed = inflow / (rest * contraction);
                report(scene, (n, body), outlet, (covered, speed), findings);
                return;
            }
        }
    }
}

/// Returns the time in which an inflow [cells m/s] fills the domain to the limit of the density while it leaves through
/// a rest of the outlets \[cells\]; infinite if it comes to a balance before \[s\].
fn time_to_fill(scene: &Scene, flow: &Flow, body: &NamedBody, (inflow, rest): (f64, f64)) -> f64 {
    let grid = &scene.grid;
    let limit = scene.guards.max_compression;
    let fastest = scene.guards.max_lattice_velocity * grid.spacing / flow.time_step;
    let outflow = |compression: f64| {
        let speed = if body.mobility == Mobility::Fixed {
            speed_past(scene, flow, rest, compression).min(fastest)
        } else {
            fastest
        };
        speed * rest
    };
    let mut cells = grid.cells.map(base::number::real).iter().product::<f64>();
    if body.mobility == Mobility::Fixed && grid.dimension == 2 {
        let radius = 0.5 * width(body) / grid.spacing;
        cells = (cells - PI * radius * radius).max(0.0);
    }
    let part = limit / f64::from(PARTS);
    let times = (0..PARTS).map(|n| {
        let stays = inflow - outflow(part * (f64::from(n) + 0.5));
        if stays > 0.0 {
            part * cells * grid.spacing / stays
        } else {
            f64::INFINITY
        }
    });
    times.sum()
}

/// Returns the mean speed of the water through the rest of an outlet \[cells\] past a body that stays, where its
/// density exceeds that beyond the outlet by a part `compression` [m/s].
fn speed_past(scene: &Scene, flow: &Flow, rest: f64, compression: f64) -> f64 {
    let h = scene.grid.spacing;
    let sound_squared = (h / flow.time_step).powi(2) / 3.0;
    let gap = if scene.grid.dimension == 2 {
        rest
    } else {
        rest.sqrt()
    };
    // Coefficients of the resistance, quadratic and linear in the speed.
    let squared = 0.5 / (CONTRACTION * CONTRACTION);
    let linear = 32.0 / PI * flow.kinematic_viscosity / (gap * h);
    if gap <= 0.0 {
        return 0.0;
    }
    let root = (linear * linear + 4.0 * squared * compression * sound_squared).sqrt();
    (root - linear) / (2.0 * squared)
}

/// Reports a body that can cover an area \[cells\] of an outlet, and the speed of the water through the rest [m/s].
fn report(
    scene: &Scene,
    (n, body): (usize, &NamedBody),
    outlet: &ScenePatch,
    (covered, speed): (f64, f64),
    findings: &mut Findings,
) {
    let grid = &scene.grid;
    let area = outlet.imposed_at(grid, PATH).area();
    let rest = if speed.is_finite() {
        format!("leaves through the rest at {} m/s", number(speed))
    } else {
        "has no other way out, so that its mass grows".into()
    };
    let fixed = body.mobility == Mobility::Fixed;
    let path = format!("bodies[{n}].{}", if fixed { "position" } else { "motion" });
    let covers = if fixed {
        "covers"
    } else {
        "can reach and cover"
    };
    let reason = format!(
        "the body `{}` {covers} {} of the {} cells of the outlet `{}`; the water that enters then {rest}, and \
         guards.max_lattice_velocity or guards.max_compression ends the run",
        body.name,
        number(covered),
        number(area),
        outlet.name
    );
    let remedy =
        "use an outlet that is wider than the body, add another one, or keep the body away from it";
    if body.mobility != Mobility::Free {
        findings.unstable(&path, reason, remedy);
    } else {
        // Other bodies leave with the water, or go elsewhere.
        findings.warn(&path, reason, remedy);
    }
}

/// Returns the width of a body \[m\].
fn width(body: &NamedBody) -> f64 {
    body.thickness().unwrap_or(2.0 * body.radius)
}

/// Returns the area of an outlet that a body covers at most \[cells\].
fn most_covered(scene: &Scene, outlet: &ScenePatch, body: &NamedBody) -> f64 {
    covered(scene, outlet, width(body), |_| {
        [f64::NEG_INFINITY, f64::INFINITY]
    })
}

/// Returns the area \[cells\] that a round section of a body with this width \[m\] covers within the outlet, where the
/// body reaches from one coordinate to another along each axis \[m\].
fn covered(
    scene: &Scene,
    outlet: &ScenePatch,
    width: f64,
    reach: impl Fn(usize) -> [f64; 2],
) -> f64 {
    let h = scene.grid.spacing;
    let sides = (0..scene.grid.dimension).filter(|a| *a != outlet.face.axis());
    let sides = sides.map(|a| {
        let ([low, high], [from, to]) = (outlet.ends[a], reach(a).map(|x| x / h));
        (high.min(to) - low.max(from)).min(width / h).max(0.0)
    });
    let area: f64 = sides.product();
    if scene.grid.dimension == 2 {
        area
    } else {
        area.min(0.25 * PI * (width / h).powi(2))
    }
}

/// Returns the largest area of an outlet that a body covers on its path \[cells\]; a fixed body stays.
fn covered_on_path(scene: &Scene, outlet: &ScenePatch, body: &NamedBody) -> f64 {
    let (axis, radius) = (outlet.face.axis(), 0.5 * width(body));
    let face = if outlet.face.is_max() {
        scene.grid.size[axis]
    } else {
        0.0
    };
    let [back, ahead] = driven_path::path(body, scene.time.end);
    let at = |n: u32| {
        let way = back + (ahead - back) * f64::from(n) / f64::from(POSITIONS);
        let centre: [f64; 3] = std::array::from_fn(|a| body.position[a] + way * body.velocity[a]);
        let away = centre[axis] - face;
        let half = (radius * radius - away * away).max(0.0).sqrt();
        covered(scene, outlet, 2.0 * half, |a| {
            [centre[a] - half, centre[a] + half]
        })
    };
    (0..=POSITIONS).map(at).fold(0.0, f64::max)
}

/// Returns the time that is left of the run when water and weight have carried a free body to an outlet \[s\]; negative
/// if they do not.
fn time_at_outlet(scene: &Scene, flow: &Flow, outlet: &ScenePatch, body: &NamedBody) -> f64 {
    let grid = &scene.grid;
    let axis = outlet.face.axis();
    let (outward, face) = if outlet.face.is_max() {
        (1.0, grid.size[axis])
    } else {
        (-1.0, 0.0)
    };
    let gap = |a: usize| {
        if a == axis {
            return (face - body.position[a]).abs();
        }
        let [low, high] = outlet.ends[a].map(|end| end * grid.spacing);
        (low - body.position[a])
            .max(body.position[a] - high)
            .max(0.0)
    };
    let way = (0..grid.dimension).map(gap).fold(0.0, f64::hypot) - body.radius;
    let speeds = imposed_on_fluid(flow).into_iter().map(|speed| speed.value);
    let of_water = speeds.fold(norm(body.velocity), f64::max);
    let falls = settling::body_settling_speed(scene, flow, width(body), body.material);
    let pull = outward * scene.gravity[axis] / norm(scene.gravity).max(f64::MIN_POSITIVE);
    let heavy = if scene.density(body.material) > flow.density {
        pull
    } else {
        -pull
    };
    let towards = of_water + falls * heavy;
    if way <= 0.0 {
        return scene.time.end;
    }
    scene.time.end - way / towards.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the finding on a disc of 8 cells in a channel of 40 x 20 cells with an inflow of 1 cell per 50 steps,
    /// and an outlet of some cells.
    fn finding(motion: &Value, outlet: [f64; 2], gravity: f64) -> Option<String> {
        let x = if motion.get("fixed").is_some() {
            0.04
        } else {
            0.03
        };
        let case = json!({
            "domain": {"size": [0.04, 0.02], "spacing": 0.001},
            "gravity": [gravity, 0],
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [2e-3, 0]},
                        "ramp_time": 1}}},
                    {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}},
                     "patch": {"from": [0, outlet[0]], "to": [0.04, outlet[1]]}}]}},
            "bodies": [{"name": "disc", "shape": {"disc": {"radius": 0.004}}, "position": [x, 0.01],
                        "motion": motion, "material": "glass"}],
            "coupling": {"partially_saturated": {}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
            "time": {"end": 20}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let of_outlet = |p: &&base::error::Problem| p.reason.contains("the outlet `out`");
        let found = plan.warnings.iter().find(of_outlet)?;
        let free = motion.get("free").is_some();
        let severity = if !free {
            Severity::Unstable
        } else {
            Severity::Warning
        };
        assert_eq!(found.severity, severity);
        Some(found.reason.clone())
    }

    #[test]
    fn a_body_that_can_plug_the_outlet_is_named() {
        let free = json!({"free": {}});
        let narrow = finding(&free, [0.006, 0.014], 0.0).unwrap();
        assert!(
            narrow.contains("`disc`") && narrow.contains("cover 8 of the 8 cells"),
            "{narrow}"
        );
        assert!(narrow.contains("no other way out"), "{narrow}");
        // Two cells remain, through which the inflow of 0.4 cells² per step passes at a lattice velocity of 0.2.
        assert_eq!(finding(&free, [0.005, 0.015], 0.0), None);
        let one = finding(&free, [0.005, 0.014], 0.0).unwrap();
        assert!(one.contains("cover 8 of the 9 cells"), "{one}");
        assert_eq!(finding(&free, [0.0, 0.02], 0.0), None);
        // A heavy disc that falls away from the outlet does not reach it.
        assert_eq!(finding(&free, [0.006, 0.014], -9.81), None);
        assert!(finding(&free, [0.006, 0.014], 9.81).is_some());
    }

    #[test]
    fn a_fixed_body_at_the_outlet_is_unstable() {
        let fixed = json!({"fixed": {}});
        let narrow = finding(&fixed, [0.005, 0.014], 0.0).unwrap();
        assert!(narrow.contains("covers 8 of the 9 cells"), "{narrow}");
        assert_eq!(finding(&fixed, [0.0, 0.02], 0.0), None);
        // Two of ten cells let the inflow of 0.4 cells² per step out at a lattice velocity of 0.2, or 0.33 in the jet,
        // which takes a density of 1.16 and, with the resistance of the slit, 1.47.
        assert!(finding(&fixed, [0.005, 0.015], 0.0).is_some());
    }

    #[test]
    fn a_fixed_body_next_to_an_outflow_is_named() {
        let severity = |gap: f64, condition: &str| {
            let h = 0.0005;
            let case = json!({
                "domain": {"size": [28.0 * h, 26.0 * h], "spacing": h},
                "materials": {"glass": {"density": 2500}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 4e-5, "relaxation_time": 0.56, "boundaries": [
                        {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.08, 0]},
                            "ramp_time": 0.015}}},
                        {"name": "out", "face": "y_max", "condition": {condition: {"mean_pressure": 0}}}]}},
                "bodies": [{"name": "disc", "shape": {"disc": {"radius": 2.6 * h}},
                            "position": [13.0 * h, (23.4 - gap) * h], "motion": {"fixed": {}}, "material": "glass"}],
                "coupling": {"bounce_back": {"scheme": "half_way"}},
                "time": {"end": 0.1}
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let mut found = plan.warnings.iter();
            let found = found.find(|p| p.reason.contains("in front of the outflow"));
            found.map(|p| p.severity)
        };
        assert_eq!(severity(0.1, "outflow"), Some(Severity::Warning));
        assert_eq!(severity(2.0, "outflow"), None);
        assert_eq!(severity(0.1, "convective_outflow"), None);
    }

    #[test]
    fn a_driven_body_counts_where_its_path_meets_the_outlet() {
        let driven = |x: f64, y: f64| json!({"driven": {"velocity": [x, y]}});
        assert!(finding(&driven(5e-4, 0.0), [0.006, 0.014], 0.0).is_some());
        // It ends before the face, turns to the side, and leaves above the outlet.
        assert_eq!(finding(&driven(2e-4, 0.0), [0.006, 0.014], 0.0), None);
        assert_eq!(finding(&driven(0.0, 5e-4), [0.006, 0.014], 0.0), None);
        assert_eq!(finding(&driven(5e-4, 3e-4), [0.001, 0.007], 0.0), None);
    }
}
