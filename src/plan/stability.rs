//! Empirical velocity limits of the lattice for stability.
//!
//! Stability depends on the cell Reynolds number U h/ν = 3 (U/C)/(tau - 1/2), with U the largest imposed speed, and
//! not on tau or the lattice velocity alone; for some operators the limit decreases with the lattice velocity. The
//! bounds of each operator are next to its formula ([`lbm::collision::border`]) and come from the maps under
//! `benches/stability`. `holds` is the last value up to which every run was stable, `fails` the first at which one
//! failed.
//!
//! Beyond a bound the plan reports a finding but does not refuse the case: the corners of a lid are more severe
//! than most flows, and many scenes run at several times these values. The error that grows with the Mach number is
//! reported separately.
//!
//! Flows with an eddy viscosity are judged only under a lid, or without openings with BGK or TRT: turbulent
//! Taylor-Green vortices with TRT failed with WALE as with Smagorinsky (`benches/accuracy/eddy-models`). Under a
//! lid, WALE hardly changed the bounds of BGK and TRT, raised those of Suga's operator by a factor of ten in slow
//! flows, and raised those of cumulants, and of operators with separate rates for second moments only, beyond the
//! map. Streams and channels run with it at a thousand times these values: the stability limit depends on the
//! source of the eddies.

use super::margin::{Margin, USUAL_LATTICE_VELOCITY, margin};
use crate::scene::Scene;
use crate::scene::auto::density;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use crate::scene::speed::{self, Speed};
use base::error::Remedy;
use case::coupling::{Coupling, Scheme};
use lbm::boundary::SurfaceKind;
use lbm::collision::border::{Border, MovingBody, ReynoldsBounds, Situation, Surroundings};

fn surroundings(flow: &Flow) -> Surroundings {
    let mut all = Surroundings::Periodic;
    for patch in flow.patches() {
        match patch.condition.model().kind().surface {
            SurfaceKind::Symmetry => {}
            SurfaceKind::Wall | SurfaceKind::MovingWall => {
                if all == Surroundings::Periodic {
                    all = Surroundings::Walls;
                }
            }
            SurfaceKind::Opening => all = Surroundings::Openings,
        }
    }
    all
}

/// Returns the remedy of a spacing that lowers the cell Reynolds number.
fn finer_cells(scene: &Scene, flow: &Flow, finest: f64) -> Remedy {
    let text = format!(
        "use a spacing of at most {} m, or a slower flow or a larger viscosity",
        number(finest)
    );
    // At a stated time step, finer cells raise the lattice velocity.
    if flow.fixed_by == "time_step" {
        text.into()
    } else {
        super::bodies::propose_spacing(scene, finest, text)
    }
}

/// Returns `true` if a wall that moves in its plane ends at a stationary wall.
fn lid_meets_wall(flow: &Flow) -> bool {
    let faces = |surface: SurfaceKind| {
        let of_surface = flow
            .patches()
            .filter(move |patch| patch.condition.model().kind().surface == surface);
        of_surface.map(|patch| patch.face.axis())
    };
    faces(SurfaceKind::MovingWall).any(|lid| faces(SurfaceKind::Wall).any(|wall| wall != lid))
}

/// Reports interpolated links at faces of polyhedra: all links of a face are cut at the same fraction, and only the
/// collision damps the reflected populations. For a block plucked off a bed by a stream
/// (`tests/suite/same_bits.rs`), runs with two or more rates that keep walls at their position were stable at a
/// cell Reynolds number of 2 and failed at 20; with BGK and the matrix of Suga they failed at 2 or 20, depending on
/// the position of the faces. Half-way links and saturated cells were stable at 200.
fn links_at_faces(scene: &Scene, flow: &Flow, path: &str, cell: f64, findings: &mut Findings) {
    let interpolated = matches!(&scene.coupling,
        Some(Coupling::BounceBack(links)) if links.scheme == Scheme::Interpolated);
    if !interpolated || scene.polyhedra().next().is_none() {
        return;
    }
    let fails = flow.models.collision.model().fails_at_faces();
    if cell >= fails {
        findings.unstable(
            path,
            format!(
                "the cell Reynolds number U h/nu is {}: runs with this operator and with interpolated links at \
                 polyhedra failed at {} and above",
                number(cell),
                number(fails)
            ),
            Remedy::from("use partially_saturated, or \"half_way\" links, for the blocks")
                .set("coupling.bounce_back.scheme", "half_way"),
        );
    }
}

/// Adds the margins of the case, and reports settings at which runs of the maps failed.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let fastest = |speeds: Vec<Speed>| {
        let speeds = speeds.into_iter();
        speeds.max_by(|a, b| a.value.total_cmp(&b.value))
    };
    if let Some(speed) = fastest(speed::imposed(scene, flow)) {
        let cell = speed.value * scene.grid.spacing / flow.kinematic_viscosity;
        links_at_faces(scene, flow, &speed.path, cell, findings);
    }
    let model = flow.models.collision.model();
    let through = speed::through_the_fluid(scene, flow).zip(scene.coupling.as_ref());
    let of_moving = through.and_then(|(speed, coupling)| {
        let body = MovingBody {
            links: matches!(coupling, Coupling::BounceBack(_)),
            dimension: scene.grid.dimension,
            eddies: flow.models.turbulence.is_some(),
        };
        Some((speed, model.border_of_moving(&body)?))
    });
    // Bodies have maps of their own, but the tangential motion of a body's surface acts like that of a wall.
    // Below a free surface there is no duct: `free_surface` judges what drives the water.
    let mut speeds = if scene.surface.is_some() {
        Vec::new()
    } else {
        speed::imposed_on_fluid(flow)
    };
    speeds.extend(speed::of_bodies(scene, of_moving.is_some()));
    let situation = Situation {
        velocities: flow.models.lattice,
        surroundings: surroundings(flow),
        lid_meets_wall: lid_meets_wall(flow),
        eddies: flow.models.turbulence.is_some(),
    };
    let border = model.border(&situation);
    let imposed = fastest(speeds);
    if let (Some(imposed), Some(border)) = (&imposed, &border)
        && scene.surface.is_none()
        && of_moving.is_some()
    {
        warn_of_jets(scene, flow, (imposed, border), findings);
    }
    let of_surroundings = imposed.zip(border);
    for (speed, border) in of_surroundings.into_iter().chain(of_moving) {
        add_speed_margin(scene, flow, &speed, &border, margins, findings);
    }
}

/// Warns of jets in narrow sections beyond the stability limit next to bodies that move, if the imposed speed is within
/// it. The maps contain no jets: between fixed solids many are stable beyond the limit, next to moving ones some fail.
fn warn_of_jets(
    scene: &Scene,
    flow: &Flow,
    (imposed, border): (&Speed, &Border),
    findings: &mut Findings,
) {
    let cell = |speed: f64| speed * scene.grid.spacing / flow.kinematic_viscosity;
    let limit = |speed: f64| {
        let lattice_velocity = speed * flow.time_step / scene.grid.spacing;
        let mut bounds = border.bounds.iter();
        bounds.find(|part| lattice_velocity <= part.lattice_velocity)
    };
    if limit(imposed.value).is_none_or(|limit| cell(imposed.value) >= limit.fails) {
        return;
    }
    for jet in density::jets(scene, flow) {
        let Some(limit) = limit(jet.speed).filter(|limit| cell(jet.speed) >= limit.fails) else {
            continue;
        };
        findings.warn(
            &jet.path,
            format!(
                "the water passes the narrowest section between solids, {} % of the whole, at {} m/s: a cell Reynolds \
                 number U h/nu of {}; in the stability map `{}` runs with this operator were stable up to {} and \
                 failed at {} and above, and jets next to moving bodies failed",
                number(100.0 * jet.open),
                number(jet.speed),
                number(cell(jet.speed)),
                border.map,
                number(limit.holds),
                number(limit.fails),
            ),
            finer_cells(
                scene,
                flow,
                scene.grid.spacing * limit.holds.max(0.5 * limit.fails) / cell(jet.speed),
            ),
        );
    }
}

/// Adds the margin of a speed to the stability limit, and reports a speed beyond it.
fn add_speed_margin(
    scene: &Scene,
    flow: &Flow,
    speed: &Speed,
    border: &Border,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let cell = speed.value * scene.grid.spacing / flow.kinematic_viscosity;
    let (map, bounds) = (border.map, border.bounds);
    let stated = speed.value * flow.time_step / scene.grid.spacing;
    // A time step refused for its lattice velocity is judged as the shorter step that its finding proposes.
    let lattice_velocity = if stated > scene.guards.max_lattice_velocity {
        USUAL_LATTICE_VELOCITY
    } else {
        stated
    };
    // A value written with few digits may lie slightly beyond its bound.
    let slack = 1.0 + 1e-6;
    let within = |part: &ReynoldsBounds| lattice_velocity <= part.lattice_velocity * slack;
    let Some(at) = bounds.iter().position(within) else {
        return;
    };
    let limit = bounds[at];
    if limit.holds > 0.0 {
        margins.push(margin(
            &format!("cell Reynolds number U h/nu: {}", speed.what),
            cell,
            limit.holds,
            &speed.path,
        ));
    }
    // The stability limit lies between the two values; values close to the failed one count as failing.
    if cell * slack < limit.fails {
        if limit.holds > 0.0 && cell > limit.holds * slack {
            let beyond = if limit.fails.is_finite() {
                format!(
                    " and failed at {} and above; no value in between was tested",
                    number(limit.fails)
                )
            } else {
                ", the largest value that was tested".to_owned()
            };
            findings.warn(
                &speed.path,
                format!(
                    "{} leads to a cell Reynolds number U h/nu of {}: in the stability map `{map}` runs with \
                     this operator were stable up to {}{beyond}",
                    speed.what,
                    number(cell),
                    number(limit.holds),
                ),
                finer_cells(scene, flow, scene.grid.spacing * limit.holds / cell),
            );
        }
        return;
    }
    let slower = at.checked_sub(1).map(|at| bounds[at].lattice_velocity);
    if let (true, Some(slower)) = (limit.holds <= 0.0, slower) {
        findings.unstable(
            &speed.path,
            format!(
                "{} leads to a Mach number U/C of {}: in the stability map `{map}` runs with this operator \
                 failed above {slower}",
                speed.what,
                number(lattice_velocity),
            ),
            super::margin::slower_clock(
                flow,
                scene.grid.spacing,
                slower / lattice_velocity,
                "use a smaller time step or relaxation time, or a slower flow".into(),
            ),
        );
        return;
    }
    let finest = scene.grid.spacing * limit.holds / cell;
    findings.unstable(
        &speed.path,
        format!(
            "{} leads to a cell Reynolds number U h/nu of {}: in the stability map `{map}` runs with this \
             operator were stable up to {} and failed at {} and above{}",
            speed.what,
            number(cell),
            number(limit.holds),
            number(limit.fails),
            slower.map_or(String::new(), |mach| format!(" for Mach numbers above {mach}")),
        ),
        finer_cells(scene, flow, finest),
    );
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;

    /// Returns `true` if the plan warns of a cavity at this relaxation time and Mach number U/C of the lid.
    fn cavity_warned(collision: &str, tau: f64, mach: f64) -> bool {
        let found = planned(collision, 2, tau, mach).unwrap().warnings;
        let words = |w: &base::error::Problem| w.to_string().contains("cell Reynolds number");
        found.iter().any(words)
    }

    fn planned(
        collision: &str,
        dimension: usize,
        tau: f64,
        mach: f64,
    ) -> Result<Plan, Vec<base::error::Problem>> {
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
                    "boundaries": [{{"name": "lid", "face": "{face}",
                    "condition": {{"moving_wall": {{"velocity": [{velocity}]}}}}}}]
                }}}},
                "time": {{"end": 1}}
            }}"#
        );
        let document = Document::read(&text, &[], std::path::Path::new("")).unwrap();
        Plan::prepare(document)
    }

    /// Checks rows of `benches/stability/cavity-3d-20/map.csv`: tau = 0.51 at Mach 0.03 and 0.1; the matrix of Suga
    /// is stable under a lid at tau = 0.6, where waves grow slowly, but not at 0.7.
    #[test]
    fn in_three_dimensions_too() {
        for collision in ["bgk", "trt", "suga", "mrt"] {
            let quiet = planned(collision, 3, 0.51, 0.03).unwrap().warnings;
            assert!(quiet.is_empty(), "{collision}: {quiet:?}");
            let loud = planned(collision, 3, 0.51, 0.2).unwrap().warnings;
            assert!(!loud.is_empty(), "{collision}");
        }
        assert!(planned("suga", 3, 0.55, 0.03).unwrap().warnings.is_empty());
        for (tau, severity) in [(0.6, Severity::Warning), (0.7, Severity::Unstable)] {
            let found = planned("suga", 3, tau, 0.03).unwrap().warnings;
            assert_eq!(found[0].path, "fluid.lattice_boltzmann.collision.suga");
            assert_eq!(found[0].severity, severity);
            assert!(planned("mrt", 3, tau, 0.03).unwrap().warnings.is_empty());
        }
        assert!(planned("trt", 3, 0.7, 0.03).unwrap().warnings.is_empty());
    }

    /// Checks rows of `benches/stability/cavity-32/map.csv` on both sides of the limit: tau = 0.501 with a slow lid
    /// is stable,
    /// 0.51 with a faster one is not.
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
                cavity_warned(collision, tau, mach),
                fails,
                "{collision} {tau} {mach}"
            );
        }
    }

    /// Checks turbulent Taylor-Green vortices of `benches/accuracy/eddy-models`: with TRT they fail with either
    /// eddy-viscosity model, with the rates of Suga they are stable.
    #[test]
    fn eddies_do_not_carry_operators_of_one_or_two_rates() {
        let said = |collision: &str, model: &str| {
            let text = format!(
                r#"{{
                    "domain": {{"size": [0.048, 0.048, 0.048], "spacing": 1e-3, "periodic": ["x", "y", "z"]}},
                    "fluid": {{"lattice_boltzmann": {{
                        "density": 1000, "kinematic_viscosity": 4.8e-6, "time_step": 5e-5,
                        "lattice": "d3q27", "collision": {{"{collision}": {{}}}}, "turbulence": {{"{model}": {{}}}},
                        "initial": {{"taylor_green": {{"velocity": 1, "waves_along_z": 1}}}}
                    }}}},
                    "time": {{"end": 0.1}}
                }}"#
            );
            let document = Document::read(&text, &[], std::path::Path::new("")).unwrap();
            let found = Plan::prepare(document).unwrap().warnings;
            let unstable = |w: &base::error::Problem| w.severity == Severity::Unstable;
            found.iter().any(unstable)
        };
        for model in ["wale", "smagorinsky"] {
            assert!(said("trt", model), "{model}");
            assert!(said("bgk", model), "{model}");
            assert!(!said("cumulant", model), "{model}");
        }
    }

    #[test]
    fn links_at_faces_want_thick_water() {
        let said = |scheme: &str, collision: &str, viscosity: f64| {
            let text = format!(
                r#"{{
                    "domain": {{"size": [0.2, 0.1, 0.1], "spacing": 0.01}},
                    "materials": {{"rock": {{}}}},
                    "fluid": {{"lattice_boltzmann": {{
                        "density": 1000, "kinematic_viscosity": {viscosity}, "time_step": 2e-4,
                        "collision": {{"{collision}": {{}}}},
                        "boundaries": [
                            {{"name": "in", "face": "x_min", "condition": {{"velocity": {{"profile": {{"uniform": [2,
                            0, 0]}}}}}}}},
                            {{"name": "out", "face": "x_max", "condition": {{"pressure": {{"value": 0}}}}}}
                        ]
                    }}}},
                    "bodies": [{{
                        "name": "block", "shape": {{"cuboid": {{"edges": [0.04, 0.04, 0.04]}}}}, "position": [0.1,
                        0.05, 0.05],
                        "motion": {{"fixed": {{}}}}, "material": "rock"
                    }}],
                    "coupling": {{"bounce_back": {{"scheme": "{scheme}"}}}},
                    "time": {{"end": 0.1}}
                }}"#
            );
            let document = Document::read(&text, &[], std::path::Path::new("")).unwrap();
            let found = Plan::prepare(document).unwrap().warnings;
            found
                .iter()
                .any(|w| w.to_string().contains("links at polyhedra"))
        };
        assert!(said("interpolated", "trt", 1e-3));
        assert!(!said("interpolated", "trt", 1e-2));
        assert!(said("interpolated", "bgk", 1e-2));
        assert!(!said("half_way", "trt", 1e-3));
    }

    /// Checks rows of `benches/stability/moving-disc-10` and `moving-sphere-8`: with links a moving body is stable
    /// up to a cell Reynolds number of 10 with two relaxation times and to 40 with more, with saturated cells at
    /// all values of the maps.
    #[test]
    fn bodies_that_move_are_judged_by_their_own_maps() {
        for (dimension, coupling, collision, cell, fails) in [
            (2, "bounce_back", "trt", 10.0, false),
            (2, "bounce_back", "bgk", 14.0, true),
            (2, "partially_saturated", "trt", 40.0, false),
            (3, "bounce_back", "trt", 10.0, false),
            (3, "bounce_back", "trt", 20.0, true),
            (3, "bounce_back", "mrt", 40.0, false),
            (3, "partially_saturated", "trt", 40.0, false),
        ] {
            let mut velocity = vec![0.0; dimension];
            velocity[0] = cell * 1e-3;
            let shape = if dimension == 2 { "disc" } else { "sphere" };
            let case = serde_json::json!({
                "domain": {"size": vec![0.04; dimension], "spacing": 1e-3, "periodic": &["x", "y", "z"][..dimension]},
                "materials": {"steel": {"density": 7800}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-6, "time_step": 5e-5 / cell * 1e3,
                        "collision": {collision: {}},
                    "lattice": if dimension == 2 { "d2q9" } else { "d3q27" }
                }},
                "bodies": [{
                    "name": "rod", "shape": {shape: {"radius": 5e-3}}, "position": vec![0.02; dimension],
                    "motion": {"driven": {"velocity": velocity}}, "material": "steel"
                }],
                "coupling": {coupling: {}},
                "time": {"end": 0.01}
            });
            let document =
                Document::read(&case.to_string(), &[], std::path::Path::new("")).unwrap();
            let found = Plan::prepare(document).unwrap().warnings;
            let unstable = found.iter().any(|w| w.severity == Severity::Unstable);
            assert_eq!(
                unstable, fails,
                "{dimension} {coupling} {collision} {cell}: {found:?}"
            );
        }
    }

    /// Checks three discs that leave 13 % of a channel open, beyond whose gaps the water has a cell Reynolds number
    /// of 23: driven across the stream they ended a run at step 300, fixed they did not.
    #[test]
    fn jets_next_to_moving_bodies_are_warned_of() {
        for (motion, warned) in [
            (
                serde_json::json!({"driven": {"velocity": [0, -0.012]}}),
                true,
            ),
            (serde_json::json!({"fixed": {}}), false),
        ] {
            let h = 0.01 / 21.0;
            let bodies = [1.5, 8.8, 16.1].map(|y| {
                serde_json::json!({
                    "name": format!("disc{y}"), "shape": {"disc": {"radius": 3.2 * h}},
                    "position": [16.0 * h, y * h], "motion": motion, "material": "steel"
                })
            });
            let case = serde_json::json!({
                "domain": {"size": [32.0 * h, 22.0 * h], "spacing": h, "periodic": ["y"]},
                "materials": {"steel": {"density": 1075}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1024, "kinematic_viscosity": 6.5e-6, "relaxation_time": 0.51,
                    "boundaries": [
                        {"name": "in", "face": "x_min", "condition": {"velocity": {
                            "profile": {"uniform": [0.04, 0]}, "ramp_time": 0.015}}},
                        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
                    ]
                }},
                "bodies": bodies,
                "coupling": {"bounce_back": {"scheme": "half_way"}},
                "time": {"end": 0.06}
            });
            let document =
                Document::read(&case.to_string(), &[], std::path::Path::new("")).unwrap();
            let found = Plan::prepare(document).unwrap().warnings;
            let says = |w: &base::error::Problem| {
                w.to_string().contains("narrowest section between solids")
            };
            assert_eq!(found.iter().any(says), warned, "{motion}: {found:?}");
        }
    }
}
