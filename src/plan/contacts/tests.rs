//! Limits against frequencies known in closed form.

use super::network::Network;
use super::{Depth, Limits, blocks, densest_limit};
use crate::Plan;
use crate::scene::Scene;
use approx::assert_relative_eq;
use base::error::Severity;
use case::Document;
use serde_json::{Value, json};
use std::path::Path;

fn plan(case: &Value) -> Result<Plan, Vec<base::error::Problem>> {
    let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
    Plan::prepare(document)
}

const STIFFNESS: f64 = 1e5;

/// Returns equal grains of radius 1 cm at `places` in a periodic box, with a shear spring as stiff as the normal one.
fn grains(size: &[f64], places: &[Vec<f64>], friction: f64, damping: f64) -> Value {
    let axes = &["x", "y", "z"][..size.len()];
    let list = places
        .iter()
        .map(|p| json!({"position": p, "radius": 0.01}));
    json!({
        "domain": {"size": size, "spacing": size[0] / 60.0, "periodic": axes},
        "materials": {"glass": {"density": 2500}},
        "grains": {"material": "glass", "initial": {"list": list.collect::<Vec<_>>()}},
        "contact": {"linear": {
            "normal_stiffness": {"absolute": STIFFNESS}, "shear_to_normal_stiffness": 1,
            "friction_angle_degrees": friction, "normal_damping_ratio": damping
        }},
        "time": {"end": 1, "solid_time_step_safety": 1e-3}
    })
}

/// Returns w² m/k for the frequency w of a limit 2/w.
fn eigenvalue(scene: &Scene, limit: f64) -> f64 {
    4.0 * scene.mass(0, 0.01) / STIFFNESS / (limit * limit)
}

fn network(scene: &Scene) -> f64 {
    let law = scene.contact.as_ref().unwrap().model();
    Network::for_scene(scene, law, true, Depth::Start).limit()
}

/// Checks two grains, for which w² = 2 k/m; a dashpot shortens the step by sqrt(1 + zeta²) - zeta.
#[test]
fn two_grains_swing_against_each_other() {
    let places = [vec![0.1, 0.1], vec![0.1199, 0.1]];
    let free = plan(&grains(&[0.2, 0.2], &places, 0.0, 0.0)).unwrap().scene;
    assert_relative_eq!(eigenvalue(&free, network(&free)), 2.0, max_relative = 1e-9);
    let damped = plan(&grains(&[0.2, 0.2], &places, 0.0, 0.5)).unwrap().scene;
    let shorter = 1.25_f64.sqrt() - 0.5;
    assert_relative_eq!(
        network(&damped),
        shorter * network(&free),
        max_relative = 1e-9
    );
    // Across the normal two discs of the same spin: 2 k (1/m + r²/I).
    let rough = plan(&grains(&[0.2, 0.2], &places, 30.0, 0.0))
        .unwrap()
        .scene;
    assert_relative_eq!(
        eigenvalue(&rough, network(&rough)),
        6.0,
        max_relative = 0.02
    );
}

fn triangles(columns: u32, rows: u32) -> (Vec<f64>, Vec<Vec<f64>>) {
    // The root of 3/4 within 8e-4, so that the box is a whole number of cells.
    let (a, height) = (0.0199, 0.0199 * 13.0 / 15.0);
    let place = |i: u32, j: u32| {
        let x = a * (f64::from(i) + 0.5 * f64::from(j % 2) + 0.25);
        vec![x, height * (f64::from(j) + 0.5)]
    };
    let places = (0..rows).flat_map(|j| (0..columns).map(move |i| place(i, j)));
    (
        vec![a * f64::from(columns), height * f64::from(rows)],
        places.collect(),
    )
}

/// Returns a cubic face-centred lattice of n³ cells.
fn cubic(n: u32) -> (Vec<f64>, Vec<Vec<f64>>) {
    let a = 0.0199 * 2.0_f64.sqrt();
    let mut places = Vec::new();
    for k in 0..8 * n.pow(3) {
        let at = [k % (2 * n), k / (2 * n) % (2 * n), k / (4 * n * n)];
        if at.iter().sum::<u32>() % 2 == 0 {
            places.push(at.map(|i| 0.5 * a * (f64::from(i) + 0.5)).to_vec());
        }
    }
    (vec![a * f64::from(n); 3], places)
}

/// Checks that smooth grains in the densest lattices reach the bound of a packing; rough ones have twice the partners
/// of a random packing, or 1.5 times as many in the plane.
#[test]
fn the_densest_lattices_have_the_frequencies_of_the_bounds() {
    for (size, places, smooth, rough) in [
        {
            let (s, p) = triangles(4, 4);
            (s, p, 6.0, [24.0, 16.0])
        },
        {
            let (s, p) = cubic(2);
            (s, p, 8.0, [40.0, 20.0])
        },
    ] {
        for (friction, [expected, packing]) in [(0.0, [smooth; 2]), (30.0, rough)] {
            let scene = plan(&grains(&size, &places, friction, 0.0)).unwrap().scene;
            let found = eigenvalue(&scene, network(&scene));
            assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
            let law = scene.contact.as_ref().unwrap().model();
            let bound = densest_limit(&scene, law, (0, 0.01), 12.0);
            assert_relative_eq!(eigenvalue(&scene, bound), packing, max_relative = 1e-9);
        }
    }
}

/// The step is refused above the limit of the contacts at the start, and accepted without a finding below that of
/// the densest packing; the proposed step is accepted.
#[test]
fn a_step_beyond_the_limit_is_refused_with_the_largest_that_passes() {
    let (size, places) = triangles(4, 4);
    let mut case = grains(&size, &places, 0.0, 0.0);
    case["time"]["solid_time_step_safety"] = json!(1);
    let mass = 2500.0 * std::f64::consts::PI * 1e-4;
    let limit = 2.0 / (6.0 * STIFFNESS / mass).sqrt();
    let mut with = |part: f64| {
        case["time"]["solid_time_step"] = json!(part * limit);
        plan(&case)
    };
    assert!(with(0.95).unwrap().warnings.is_empty());
    let problems = with(1.05).unwrap_err();
    let text = problems[0].to_string();
    assert!(
        text.contains("the stability limit of the initial contacts"),
        "{text}"
    );
    assert_eq!(problems[0].path, "time.solid_time_step");
    let word = text
        .split("at most ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    let passes: f64 = word.parse().unwrap();
    assert!(passes < limit && passes > 0.95 * limit, "{passes} {limit}");
}

/// Two initially separate grains may come into contact: the limit of possible contacts gives a warning, and a
/// single pair allows a longer step.
#[test]
fn what_may_come_to_touch_is_a_warning() {
    let places = [vec![0.05, 0.1], vec![0.15, 0.1]];
    let mut case = grains(&[0.2, 0.2], &places, 0.0, 0.0);
    case["time"]["solid_time_step_safety"] = json!(1);
    let mass = 2500.0 * std::f64::consts::PI * 1e-4;
    let pair = (2.0 * mass / STIFFNESS).sqrt();
    case["time"]["solid_time_step"] = json!(0.95 * pair);
    assert!(plan(&case).unwrap().warnings.is_empty());
    case["time"]["solid_time_step"] = json!(1.05 * pair);
    assert_eq!(plan(&case).unwrap().warnings.len(), 1);
}

/// Checks a cube with springs k_n and k_s over its faces of area A: w² is 16 k_s A/m for rotation against neighbours
/// that rotate alike, (4 k_n + 8 k_s) A/m for translation against neighbours that move the other way, and k_n A/m with
/// a single face in contact.
#[test]
fn a_cube_with_all_its_faces_in_touch() {
    let cube = |friction: f64, ratio: f64| {
        json!({
            "domain": {"size": [0.4, 0.4, 0.4], "spacing": 0.1},
            "materials": {"rock": {"density": 2500}},
            "bodies": [{"name": "cube", "shape": {"cuboid": {"edges": [0.1, 0.1, 0.1]}}, "position": [0.2, 0.2, 0.2],
                        "motion": {"free": {}}, "material": "rock"}],
            "contact": {"blocks": {"normal_stiffness": {"per_area": 1e8}, "shear_to_normal_stiffness": ratio,
                                   "friction_angle_degrees": friction}},
            "time": {"end": 1, "solid_time_step_safety": 1e-3}
        })
    };
    let mass = 2.5;
    for (friction, ratio, expected) in [(30.0, 1.0, 16.0), (30.0, 0.2, 5.6), (0.0, 1.0, 4.0)] {
        let scene = plan(&cube(friction, ratio)).unwrap().scene;
        let Limits {
            slipping: one,
            sticking: all,
            ..
        } = blocks::limits(
            &scene,
            scene.contact.as_ref().unwrap().model().blocks().unwrap(),
        );
        let eigenvalue = |limit: f64| 4.0 * mass / 1e6 / (limit * limit);
        assert_relative_eq!(eigenvalue(all), expected, max_relative = 1e-9);
        assert_relative_eq!(eigenvalue(one), 1.0, max_relative = 1e-9);
    }
}

/// Rain deposition uses a fifth of the critical step, and at most twice the limit of the densest packing: with a
/// damping of 0.8 a bed of 800 spheres did not settle at a fifth, but does so with this limit.
#[test]
fn strong_dashpots_shorten_the_step_of_a_packing() {
    let places = [
        vec![0.1, 0.1, 0.1],
        vec![0.13, 0.1, 0.1],
        vec![0.1, 0.13, 0.1],
    ];
    let ratio = |damping: f64| {
        let mut case = grains(&[0.2, 0.2, 0.2], &places, 30.0, damping);
        case["contact"]["linear"]["shear_damping_ratio"] = damping.into();
        super::packing_limit(&plan(&case).unwrap().scene)
    };
    let mut last = f64::INFINITY;
    for damping in [0.0, 0.2, 0.5, 0.8, 1.0] {
        let now = ratio(damping);
        assert!(now < last && now > 0.02, "{damping}: {now}");
        last = now;
    }
    assert!(
        ratio(0.0) > 0.2 && ratio(0.8) < 0.1,
        "{} {}",
        ratio(0.0),
        ratio(0.8)
    );
}

/// Points of contact of free blocks without dashpots are unstable; pressures, damped points and fixed blocks are not.
#[test]
fn points_of_contact_want_damping() {
    let said = |model: Value, damping: f64, motion: &str| {
        let case = json!({
            "domain": {"size": [2, 2, 2], "spacing": 0.1},
            "materials": {"rock": {"density": 2600}},
            "bodies": [{
                "name": "block", "shape": {"cuboid": {"edges": [0.5, 0.5, 0.5]}}, "position": [1, 1, 1],
                "motion": {motion: {}}, "material": "rock"
            }],
            "box_walls": ["z_min"],
            "box_wall_material": "rock",
            "contact": {"blocks": {
                "normal_stiffness": {"per_area": 1e9}, "normal_damping_ratio": damping, "model": model
            }},
            "time": {"end": 0.1}
        });
        let warnings = plan(&case).unwrap().warnings;
        warnings.iter().any(|w| w.path == "contact.blocks.model")
    };
    let point = json!({"point": {"rounding": 1e-3}});
    assert!(said(point.clone(), 0.0, "free"));
    assert!(!said(point.clone(), 0.1, "free"));
    assert!(!said(point, 0.0, "fixed"));
    assert!(said(json!("patch"), 0.0, "free"));
    assert!(!said(json!("pressure"), 0.0, "free"));
}

/// Three discs with strong dashpots: the program accepts its automatic time step and refuses a time step of the case
/// above the limit.
#[test]
fn the_automatic_step_is_accepted() {
    let pile = |damping: f64, time: Value| {
        json!({
            "domain": {"size": [0.2, 0.1], "spacing": 0.01},
            "gravity": [0, -9.81],
            "materials": {"glass": {"density": 2500}},
            "grains": {"material": "glass", "initial": {"list": [
                {"position": [0.09, 0.01], "radius": 0.01}, {"position": [0.11, 0.01], "radius": 0.01},
                {"position": [0.1, 0.03], "radius": 0.01}
            ]}},
            "box_walls": ["y_min"],
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e8}, "shear_to_normal_stiffness": 1,
                "friction_angle_degrees": 30, "normal_damping_ratio": damping, "shear_damping_ratio": damping}},
            "time": time
        })
    };
    let unstable = |plan: &Plan| {
        plan.warnings
            .iter()
            .any(|p| p.severity == Severity::Unstable)
    };
    for damping in [0.1, 0.4, 0.5, 0.9] {
        let automatic = plan(&pile(damping, json!({"end": 0.1}))).unwrap();
        assert!(!unstable(&automatic), "{damping}: {:?}", automatic.warnings);
    }
    let longest = plan(&pile(0.5, json!({"end": 0.1}))).unwrap();
    let step = 1.05 * longest.clock.solid_time_step;
    let stated = plan(&pile(0.5, json!({"end": 0.1, "solid_time_step": step}))).unwrap();
    assert!(unstable(&stated));
}
