//! Polygons and surfaces of cases that are layers of a drawing: the same results as with their corners, and messages
//! about drawings that cannot be used.

use crate::ranks::{Study, beside_others};
use solver::case::Document;
use solver::plan::Plan;
use std::path::Path;

/// Folder of the drawings, whose origin is README.md there.
fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/dxf")
}

/// A dam with a cut-off on sand with a band of gravel, from a drawing in mm; `layer` makes the JSON of a layer.
fn case(layer: impl Fn(&str) -> String) -> String {
    let (dam, sand, gravel) = (layer("DAM"), layer("SAND"), layer("GRAVEL"));
    format!(
        r#"{{
        "domain": {{"size": [100, 30], "spacing": 1}}, "gravity": [0, -9.81],
        "materials": {{"ground": {{"density": 2650}}}},
        "fluid": {{"darcy": {{"density": 1000, "viscosity": 1e-3,
            "grid": {{"from": [0, 0], "to": [100, 12], "cells": [200, 24]}},
            "zones": [
                {{"name": "sand", "polygon": {sand}, "permeability": {{"hydraulic_conductivity": 1e-5}}}},
                {{"name": "gravel", "polygon": {gravel}, "permeability": {{"hydraulic_conductivity": 1e-3}}}}],
            "boundaries": [
                {{"name": "upstream", "face": "y_max", "patch": {{"from": [0, 12], "to": [40, 12]}},
                    "condition": {{"head": {{"value": 20}}}}}},
                {{"name": "downstream", "face": "y_max", "patch": {{"from": [60, 12], "to": [100, 12]}},
                    "condition": {{"head": {{"value": 12}}}}}}]}}}},
        "structures": [{{"name": "dam", "shape": {{"polygon": {dam}}}}}],
        "probes": [{{"name": "dam", "every": 1, "at": {{"structure": {{"name": "dam", "about": [60, 12]}}}}}}],
        "time": {{"end": 1, "solid_time_step": 0.1}}}}"#
    )
}

fn drawn(name: &str, layer: &str) -> String {
    let path = folder().join(name);
    let scale = if name.contains("r12") {
        r#", "scale": 1"#
    } else {
        ""
    };
    format!(
        r#"{{"dxf": {{"path": {:?}, "layer": "{layer}", "tolerance": 0.02{scale}}}}}"#,
        path.to_str().unwrap()
    )
}

/// Checks that a drawing in mm (R2010), one without units (R12) and the corners in the case give the same bits, and
/// that the copy of the case has the corners.
#[test]
fn a_drawing_gives_the_bits_of_its_corners() {
    let _beside = beside_others();
    let light = Study::new(&case(|layer| drawn("dam-ezdxf.dxf", layer)));
    light.run("light", 1, 1, &[]);
    let text = std::fs::read_to_string(light.path("light/case.json")).unwrap();
    assert!(!text.contains("dxf"), "{text}");
    let copy: serde_json::Value = serde_json::from_str(&text).unwrap();
    let points = |path: &str| copy.pointer(path).unwrap().to_string();
    let listed = case(|layer| {
        let path = match layer {
            "DAM" => "/structures/0/shape/polygon/points",
            "SAND" => "/fluid/darcy/zones/0/polygon/points",
            _ => "/fluid/darcy/zones/1/polygon/points",
        };
        format!(r#"{{"points": {}}}"#, points(path))
    });
    let listed = Study::new(&listed);
    listed.run("listed", 1, 1, &[]);
    let answers = |study: &Study, run: &str| {
        let summary = study.summary(run);
        (
            summary["seepage"].clone(),
            std::fs::read_to_string(study.path(&format!("{run}/probe_dam.csv"))).unwrap(),
        )
    };
    let (one, other) = (answers(&light, "light"), answers(&listed, "listed"));
    assert_eq!(one.0, other.0);
    let rows = |text: &str| {
        text.lines()
            .filter(|l| !l.starts_with('#'))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(rows(&one.1), rows(&other.1));
    // The drawing in m differs by the rounding of mm.
    let heavy = Study::new(&case(|layer| drawn("dam-r12.dxf", layer)));
    heavy.run("heavy", 1, 1, &[]);
    let outflow =
        |study: &Study, run: &str| study.summary(run)["seepage"]["outflow"].as_f64().unwrap();
    let (a, b) = (outflow(&light, "light"), outflow(&heavy, "heavy"));
    assert!(a > 0.0 && (a / b - 1.0).abs() < 1e-6, "{a} {b}");
}

fn findings(text: &str) -> Vec<(String, String, String)> {
    let found = Document::read(text, &[], Path::new("."));
    let found = match found.and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    let line = |p: solver::error::Problem| (p.path, p.reason, p.remedy.to_string());
    found.into_iter().map(line).collect()
}

#[test]
fn a_drawing_that_cannot_be_used_is_refused_by_layer_with_a_remedy() {
    let good = case(|layer| drawn("dam-ezdxf.dxf", layer));
    let refused = findings(&good);
    assert!(refused.is_empty(), "{refused:?}");
    let dam = drawn("dam-ezdxf.dxf", "DAM");
    for (new, path, reason, remedy) in [
        (
            dam.replace("DAM", "DAMM"),
            "structures[0].shape.polygon.dxf.layer",
            "no layer `DAMM`",
            "DAM, GRAVEL, SAND, SURFACE",
        ),
        (
            dam.replace("DAM", "NOTES"),
            "structures[0].shape.polygon.dxf.layer",
            "no polyline, but 1 TEXT",
            "PEDIT",
        ),
        (
            dam.replace("DAM", "SURFACE"),
            "structures[0].shape.polygon.dxf.layer",
            "is open: its ends are",
            "close the polyline",
        ),
        (
            dam.replace("dam-ezdxf", "missing"),
            "structures[0].shape.polygon.dxf.path",
            "missing.dxf",
            "correct the path",
        ),
        (
            dam.replace("dam-ezdxf.dxf", "LICENSE"),
            "structures[0].shape.polygon.dxf.path",
            "line 1",
            "save the drawing as text",
        ),
        (
            dam.replace("dam-ezdxf", "dam-r12"),
            "structures[0].shape.polygon.dxf",
            "$INSUNITS",
            "add `scale`",
        ),
        (
            dam.replace(r#""tolerance""#, r#""scale": 1000, "tolerance""#),
            "structures[0].shape.polygon.dxf.scale",
            "domain 100 m",
            "length of a unit",
        ),
        (
            dam.replace(r#""tolerance""#, r#""origin": [500, 0], "tolerance""#),
            "structures[0].shape.polygon.dxf.origin",
            "outside the domain",
            "`origin`",
        ),
    ] {
        assert_ne!(new, dam);
        let found = findings(&good.replace(&dam, &new));
        let named = found
            .iter()
            .any(|(at, why, how)| at == path && why.contains(reason) && how.contains(remedy));
        assert!(named, "{new}: {found:#?}");
    }
}

/// Checks an outline that crosses itself, and one of two polylines on a layer.
#[test]
fn outlines_that_cross_or_are_not_alone_are_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let square = |layer: &str, corners: &str| {
        let vertices: String = corners
            .split(' ')
            .map(|at| {
                let (x, y) = at.split_once(',').unwrap();
                format!("10\n{x}\n20\n{y}\n")
            })
            .collect();
        format!("0\nLWPOLYLINE\n8\n{layer}\n70\n1\n{vertices}")
    };
    let text = format!(
        "0\nSECTION\n2\nENTITIES\n{}{}{}0\nENDSEC\n0\nEOF\n",
        square("bow", "40,12 60,24 60,12 40,24"),
        square("two", "40,12 60,12 60,24"),
        square("two", "10,12 20,12 20,24")
    );
    let file = temporary.path().join("outlines.dxf");
    std::fs::write(&file, text).unwrap();
    let good = case(|layer| drawn("dam-ezdxf.dxf", layer));
    let dam = drawn("dam-ezdxf.dxf", "DAM");
    for (layer, reason) in [
        ("bow", "crosses or touches itself"),
        ("two", "has 2 polylines"),
    ] {
        let new = format!(
            r#"{{"dxf": {{"path": {:?}, "layer": "{layer}", "scale": 1}}}}"#,
            file.to_str().unwrap()
        );
        let found = findings(&good.replace(&dam, &new));
        let named = found.iter().any(|(at, why, _)| {
            at == "structures[0].shape.polygon.dxf.layer" && why.contains(reason)
        });
        assert!(named, "{layer}: {found:#?}");
    }
}
