//! A ground of layers: clouds of two gradings by sieve curve and two materials, a lens of a third material, one
//! deposition.

use crate::ranks::{Study, beside_others};
use solver::case::Document;
use solver::plan::Plan;

const SETTINGS: [(&str, &str); 11] = [
    ("materials.clay", r#"{"density": 2000}"#),
    ("materials.lens", r#"{"density": 3000}"#),
    (
        "contact.contact_bond.pairs",
        r#"[{"materials": ["clay", "clay"], "tensile_strength": 0.05, "shear_strength": 0.2},
            {"materials": ["soil", "soil"], "tensile_strength": 0.0001, "shear_strength": 0.0001}]"#,
    ),
    // Soft springs allow long time steps.
    ("contact.contact_bond.normal_stiffness.absolute", "1000"),
    ("grains.initial.deposition.falling_stiffness", "100"),
    ("grains.initial.deposition.number", "120"),
    (
        "grains.initial.deposition.grading",
        r#"{"sieve": [{"diameter": 0.002, "passing": 0}, {"diameter": 0.0028, "passing": 0.5}, {"diameter": 0.0032,
            "passing": 1}]}"#,
    ),
    ("grains.initial.deposition.box.to", "[0.02, 0.02, 0.04]"),
    (
        "grains.initial.deposition.layers",
        r#"[{"name": "top", "material": "clay", "number": 160, "box": {"from": [0.004, 0, 0.04], "to": [0.02, 0.02,
            0.06]},
             "grading": {"sieve": [{"diameter": 0.0018, "passing": 0}, {"diameter": 0.0022, "passing": 1}]}}]"#,
    ),
    (
        "grains.zones",
        r#"[{"name": "lens", "material": "lens", "region": {"box": {"from": [0.008, 0, 0.004], "to": [0.016, 0.02,
            0.008]}}}]"#,
    ),
    ("time.end", "0.004"),
];

#[test]
fn a_layered_ground_has_the_same_bits_on_any_ranks() {
    let _beside = beside_others();
    let study = Study::from_example(
        "deposition",
        &[&SETTINGS[..], &[("checkpoint", r#"{"every": 0.002}"#)]].concat(),
    );
    let done = study.run("straight", 1, 1, &[]);
    let told = done.stdout + &done.stderr;
    assert!(
        told.contains("zone lens:") && told.contains("C_u"),
        "{told}"
    );
    let summary = study.summary("straight");
    let grading = &summary["notes"]["preparation"]["grading"];
    let coarse = grading["d60"].as_f64().unwrap();
    assert!((0.0018..0.0032).contains(&coarse), "{summary:#}");
    study.same_on(&[("two", 2, 1, ""), ("three", 3, 1, "domain.split=x")]);
    study.run("parts", 3, 1, &["time.end=0.002"]);
    study.restart("parts", 2, &["time.end=0.004"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn the_plan_states_the_percentiles_of_the_grains() {
    let text = solver::case::examples::find("deposition").unwrap().text;
    let curve = r#"grains.initial.deposition.grading={"sieve": [{"diameter": 0.002, "passing": 0},
        {"diameter": 0.0024, "passing": 0.3}, {"diameter": 0.0036, "passing": 1}]}"#;
    let document = Document::read(text, &[curve.to_owned()], std::path::Path::new("")).unwrap();
    let plan = Plan::prepare(document).unwrap();
    let grains = plan.scene.grains.as_ref().unwrap();
    let found = grains.percentiles(3).unwrap();
    // The curve is linear in the logarithm between two sieves. 260 grains are few.
    for (found, exact) in [
        (found.d10, 0.002 * 1.2_f64.powf(1.0 / 3.0)),
        (found.d30, 0.0024),
        (found.d50, 0.0024 * 1.5_f64.powf(2.0 / 7.0)),
        (found.d60, 0.0024 * 1.5_f64.powf(3.0 / 7.0)),
    ] {
        assert!((found / exact - 1.0).abs() < 0.02, "{found} {exact}");
    }
    let mut all: Vec<f64> = Vec::new();
    if let solver::scene::grains::GrainSource::Deposition { clouds, deposition } = &grains.source {
        let from = (deposition.seed, 0);
        all = clouds[0].grading.radii(clouds[0].number, 3, from).unwrap();
    }
    assert_eq!(all.len(), grains.expected);
}
