//! Grains in unsaturated ground: bonds and bridges that fail on wetting, suction as a strength, the same bits on any
//! number of ranks and threads and after a restart, and refusals.

use crate::ranks::{Study, beside_others};
use solver::case::{Document, examples};
use solver::plan::Plan;
use std::path::Path;

/// Returns the columns of a table with these names, by rows.
fn columns<const N: usize>(study: &Study, file: &str, names: [&str; N]) -> Vec<[f64; N]> {
    let text = std::fs::read_to_string(study.path(file)).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let heads: Vec<&str> = lines.next().unwrap().split(',').map(str::trim).collect();
    let places = names.map(|name| {
        let found = heads
            .iter()
            .position(|head| head.split(' ').next() == Some(name));
        found.unwrap_or_else(|| panic!("{name} in {heads:?}"))
    });
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        places.map(|place| cells[place].parse().unwrap())
    };
    lines.map(row).collect()
}

/// Checks bonds that weaken with the saturation: a front of constant shape descends with (R - K_i)/(theta_R -
/// theta_i), and a bond fails at the saturation at which its strength is the weight less the buoyancy.
#[test]
fn stones_fall_as_the_front_of_rain_passes() {
    let _beside = beside_others();
    let study = Study::from_example("rain-fissure", &[]);
    study.run("wet", 1, 1, &[]);
    let breaks = columns(&study, "wet/bonds.csv", ["time"]);
    assert_eq!(breaks.len(), 3, "{breaks:?}");
    // 40 mm over 7.8956 mm/s; the load changes once in a coupling interval of 0.12 s.
    for pair in breaks.windows(2) {
        let lag = pair[1][0] - pair[0][0];
        assert!((lag - 5.066).abs() < 0.13, "{breaks:?}");
    }
    let dry = "fluid.darcy.boundaries[0].condition={\"no_flow\": {}}";
    study.run("dry", 1, 1, &[dry, "time.end=3.6"]);
    assert!(columns(&study, "dry/bonds.csv", ["time"]).is_empty());
}

/// Two spheres of 3 mm that hang one below the other from a ledge by capillary bridges.
fn chain() -> Study {
    Study::from_example(
        "rain-fissure",
        &[
            (
                "grains",
                r#"{"material": "stone", "initial": {"list": [
                    {"position": [0.0125, 0.0125, 0.138501], "radius": 0.0015},
                    {"position": [0.0125, 0.0125, 0.135502], "radius": 0.0015},
                    {"position": [0.0375, 0.0375, 0.098501], "radius": 0.0015},
                    {"position": [0.0375, 0.0375, 0.095502], "radius": 0.0015}]}}"#,
            ),
            (
                "contact",
                r#"{"linear": {"normal_stiffness": {"absolute": 2e3}, "friction_angle_degrees": 30,
                    "normal_damping_ratio": 0.3, "shear_damping_ratio": 0.3,
                    "bridges": {"volume": {"moisture": {"bridges_per_grain": 6}}}}}"#,
            ),
            (
                "regions",
                r#"[{"name": "base", "box": {"from": [0, 0, 0], "to": [0.05, 0.05, 0.02]},
                    "action": {"remove": {"when": "centre"}}}]"#,
            ),
            ("time.end", "18"),
            ("checkpoint", r#"{"every": 3.6}"#),
        ],
    )
}

/// Returns the number of grains at the end of a run; those that fell have left.
fn left(study: &Study, run: &str) -> u64 {
    study.summary(run)["grains"].as_u64().unwrap()
}

#[test]
fn a_bridged_column_collapses_on_wetting_and_not_when_dry() {
    let _beside = beside_others();
    let study = chain();
    study.run("wet", 1, 1, &[]);
    // Behind the front S = 0.767: a bridge between spheres pulls with 1.8e-4 N, one at a ledge, of twice the mean
    // radius, with 3.6e-4 N. A sphere weighs 2.6e-4 N in this ground, and a ledge carries two of them: no bridge
    // holds. The front reaches the ledge first, so that both spheres fall together.
    assert_eq!(left(&study, "wet"), 0, "{:#}", study.summary("wet"));
    let dry = "fluid.darcy.boundaries[0].condition={\"no_flow\": {}}";
    study.run("dry", 1, 1, &[dry, "time.end=3.6"]);
    assert_eq!(left(&study, "dry"), 4, "{:#}", study.summary("dry"));
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[]);
        study.same("wet", name);
    }
    study.run("parts", 2, 1, &["time.end=7.2"]);
    study.restart("parts", 3, &["time.end=18"]).expect(0);
    study.same("wet", "parts");
}

/// Checks a layer of discs of diameter d under a roof, held by suction alone: the effective stress with chi = S_e =
/// exp(alpha psi) at the roof, `rho_w g h exp(-alpha h)`, against the weight of discs and water, `pi/4 rho_s g d + (1
/// - pi/4) S rho_w g d`.
#[test]
fn suction_holds_what_the_formula_of_bishop_holds() {
    let _beside = beside_others();
    let (diameter, alpha, density) = (0.01, 3.0, 2650.0);
    let pores = 1.0 - std::f64::consts::FRAC_PI_4;
    let strength = |h: f64| 1000.0 * h * (-alpha * h).exp();
    let middle = |h: f64| (-alpha * (h - 0.5 * diameter)).exp();
    let weight = |h: f64| (density * (1.0 - pores) + 1000.0 * pores * middle(h)) * diameter;
    let (mut low, mut high) = (0.0, 0.2);
    for _ in 0..60 {
        let h = 0.5 * (low + high);
        if strength(h) < weight(h) {
            low = h
        } else {
            high = h
        }
    }
    let discs: Vec<String> = (0..6)
        .map(|n| {
            let x = 0.005 + 0.01 * f64::from(n);
            format!(r#"{{"position": [{x}, 0.055], "radius": 0.005}}"#)
        })
        .collect();
    let case = format!(
        r#"{{
        "domain": {{"size": [0.06, 0.06], "spacing": 0.01}}, "gravity": [0, -9.81],
        "materials": {{"stone": {{"density": {density}}}}},
        "fluid": {{"darcy": {{"density": 1000, "viscosity": 1e-3,
            "zones": [{{"name": "ground", "permeability": {{"hydraulic_conductivity": 1e-3}}}}],
            "unsaturated": {{"retention": {{"gardner": {{"alpha": {alpha}, "saturated_content": 0.4}}}}}},
            "boundaries": [{{"name": "table", "face": "y_min", "condition": {{"head": {{"value": 0}}}}}}]}}}},
        "grains": {{"material": "stone", "initial": {{"list": [{}]}}}},
        "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e5}}, "friction_angle_degrees": 20,
            "normal_damping_ratio": 0.3, "shear_damping_ratio": 0.3}}}},
        "box_walls": ["y_min", "y_max"], "box_wall_material": "stone",
        "time": {{"end": 0.2}}, "output": {{"grains": {{"every": 0.2}}}},
        "probes": [{{"name": "roof", "every": 0.2, "at": {{"wall_load": {{"name": "y_max"}}}}}}]}}"#,
        discs.join(", ")
    );
    let study = Study::new(&case);
    let at = |part: f64| {
        let level = 0.06 - part * high;
        format!(r#"fluid.darcy.boundaries[0].condition={{"head": {{"value": {level}}}}}"#)
    };
    let roof = |name: &str, part: f64| {
        study.run(name, 1, 1, &[&at(part)]);
        let rows = columns(&study, &format!("{name}/probe_roof.csv"), ["force_y"]);
        rows.last().unwrap()[0]
    };
    assert!(roof("falls", 0.98).abs() <= 0.0);
    assert!(roof("holds", 1.02) > 0.0);
    // Times the tangent of the angle of friction, the load at the roof is the strength.
    for (name, part) in [("moist", 2.0), ("dry", 2.4)] {
        let exact = 9.81 * 0.06 * (strength(part * high) - weight(part * high));
        let found = roof(name, part);
        assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
    }
}

/// Discs of 8 mm in ground of cells of 1 cm, in zones that follow the grains or not; `zones`, `soil` and `boundaries`
/// are JSON. The discs lie at `at`.
fn followed(at: &[[f64; 2]], zones: &str, soil: &str, boundaries: &str) -> Study {
    let discs: Vec<String> = at
        .iter()
        .map(|[x, y]| format!(r#"{{"position": [{x}, {y}], "radius": 0.004}}"#))
        .collect();
    Study::new(&format!(
        r#"{{
        "domain": {{"size": [0.06, 0.08], "spacing": 0.01}}, "gravity": [0, -9.81],
        "materials": {{"stone": {{"density": 2650}}}},
        "fluid": {{"darcy": {{"density": 1000, "viscosity": 1e-3, "tolerance": 1e-12, "coupling_interval": 20,
            "zones": {zones}, "unsaturated": {soil}, "boundaries": {boundaries}}}}},
        "grains": {{"material": "stone", "initial": {{"list": [{}]}}}},
        "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e6}}, "friction_angle_degrees": 20,
            "normal_damping_ratio": 0.3, "shear_damping_ratio": 0.3}}}},
        "box_walls": ["x_min", "x_max", "y_min", "y_max"], "box_wall_material": "stone",
        "checkpoint": {{"every": 0.005}},
        "time": {{"end": 0.3, "solid_time_step": 5e-5}}, "output": {{"grains": {{"every": 0.3}}}}}}"#,
        discs.join(", ")
    ))
}

const HELD: &str = r#"[{"name": "top", "face": "y_max", "condition": {"head": {"value": 0.12}}},
    {"name": "base", "face": "y_min", "condition": {"head": {"value": 0.11}}}]"#;
const SOIL: &str = r#"{"retention": {"gardner": {"alpha": 3, "saturated_content": 0.4, "residual_content": 0.05}}"#;

fn number(study: &Study, run: &str, field: &str) -> f64 {
    study.summary(run)["seepage"][field].as_f64().unwrap()
}

/// Checks the permeability of Kozeny and Carman at the porosity of the grains, 1 - pi 4²/10²: a disc in every cell.
#[test]
fn saturated_ground_conducts_by_the_porosity_of_its_grains() {
    let _beside = beside_others();
    let centres: Vec<[f64; 2]> = (0..48)
        .map(|n| {
            [
                0.01 * f64::from(n % 6) + 0.005,
                0.01 * f64::from(n / 6) + 0.005,
            ]
        })
        .collect();
    let zone = |more: &str| {
        format!(
            r#"[{{"name": "ground", "permeability": {{"hydraulic_conductivity": 1e-3}}{more}}}]"#
        )
    };
    let outflow = |more: &str| {
        let study = followed(&centres, &zone(more), &format!("{SOIL}}}"), HELD);
        study.run(
            "one",
            1,
            1,
            &["time.end=5e-5", "fluid.darcy.coupling_interval=1"],
        );
        number(&study, "one", "outflow")
    };
    let plain = 1e-3 * 0.06 * 0.01 / 0.08;
    assert!((outflow("") / plain - 1.0).abs() < 1e-9);
    let law = |eps: f64| eps.powi(3) / (1.0 - eps).powi(2);
    let porosity = 1.0 - std::f64::consts::PI * 0.16;
    for (more, reference) in [("", 0.4), (r#", "porosity": 0.3"#, 0.3)] {
        let found = outflow(&format!(r#", "follows_grains": true{more}"#));
        let exact = plain * law(porosity) / law(reference);
        // The discs fall by 5e-8 m before the flow is computed.
        assert!((found / exact - 1.0).abs() < 1e-4, "{found} {exact}");
    }
}

/// Checks discs that fall through water into ground that follows them: it expels their volume, the mass of water
/// closes, and the bits are the same on ranks, threads and after a restart.
#[test]
fn ground_that_grains_enter_expels_their_volume() {
    let _beside = beside_others();
    let discs: Vec<[f64; 2]> = (0..6)
        .map(|n| [0.01 * f64::from(n) + 0.005, 0.0441])
        .collect();
    let zones = r#"[{"name": "upper", "permeability": {"hydraulic_conductivity": 1e-3}},
        {"name": "lower", "region": {"layer": {"to": 0.04}}, "permeability": {"hydraulic_conductivity": 1e-3},
            "follows_grains": true}]"#;
    let soil = format!(r#"{SOIL}, "transient": {{"initial": "steady"}}}}"#);
    let study = followed(&discs, zones, &soil, HELD);
    study.run("one", 1, 1, &[]);
    let net = number(&study, "one", "water_out") - number(&study, "one", "water_in");
    let volume = 6.0 * std::f64::consts::PI * 0.004_f64.powi(2);
    assert!(number(&study, "one", "mass_error").abs() < 1e-9);
    assert!((net / volume - 1.0).abs() < 1e-3, "{net} {volume}");
    // The discs begin to enter the ground at once.
    let short = "time.end=0.01";
    study.run("short", 1, 1, &[short]);
    let seepage = |run: &str| study.summary(run)["seepage"].clone();
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[short]);
        study.same("short", name);
        assert_eq!(seepage(name), seepage("short"), "{name}");
    }
    study.run("parts", 2, 1, &["time.end=0.005"]);
    study.restart("parts", 3, &[short]).expect(0);
    study.same("short", "parts");
}

/// Returns the paths and reasons of the findings of the example with changes.
fn findings(set: &[&str]) -> Vec<(String, String)> {
    let text = examples::find("rain-fissure").unwrap().text;
    let set: Vec<String> = set.iter().map(|&set| set.to_owned()).collect();
    let found = Document::read(text, &set, Path::new(".")).and_then(Plan::prepare);
    let found = match found {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    found.into_iter().map(|p| (p.path, p.reason)).collect()
}

#[test]
fn what_does_not_go_with_grains_in_unsaturated_ground_is_refused_by_name() {
    let linear = r#"contact={"linear": {"normal_stiffness": {"absolute": 1e4}, "friction_angle_degrees": 30,
        "bridges": {"volume": {"moisture": {}}}}}"#;
    let unbonded = "grains.bond_at_start=false";
    let saturated = "fluid.darcy.unsaturated=null";
    let base = r#"fluid.darcy.boundaries[1].condition={"head": {"value": 0.3}}"#;
    for (set, path, reason) in [
        (
            &["fluid.darcy.drag=reaction"][..],
            "fluid.darcy.drag",
            "has no effect",
        ),
        (
            &[r#"fluid.darcy.zones[0].permeability={"factor": 0.5}"#],
            "fluid.darcy.zones[0].permeability.factor",
            "unsaturated ground has the permeability that its zones state as a number",
        ),
        (
            &["fluid.darcy.transient_porosity=true"],
            "fluid.darcy.transient_porosity",
            "has no effect",
        ),
        (
            &[saturated, base],
            "contact.contact_bond.softening",
            "depends on the moisture",
        ),
        (
            &[linear, unbonded, saturated, base],
            "contact.linear.bridges.volume.moisture",
            "depends on the moisture",
        ),
        (
            &[r#"fluid.darcy.unsaturated={"retention": {"saturated_only": {}}}"#],
            "fluid.darcy.unsaturated.retention.saturated_only",
            "depends on its content of water",
        ),
        (
            &[
                r#"contact={"linear": {"bridges": {"volume": {"ratio": 0.5}}}}"#,
                unbonded,
            ],
            "contact.linear.bridges.volume.ratio",
            "at most 0.1",
        ),
    ] {
        let found = findings(set);
        let said = |(p, r): &(String, String)| p == path && r.contains(reason);
        assert!(found.iter().any(said), "{set:?}: {found:#?}");
    }
}
