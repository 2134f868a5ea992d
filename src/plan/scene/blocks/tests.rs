//! Blocks in a case: positions, materials, fixed blocks, and forbidden overlaps.

use crate::Plan;
use crate::scene::Scene;
use approx::assert_relative_eq;
use base::error::Problem;
use case::Document;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::path::Path;

fn case(parts: &Value) -> Value {
    let mut case = json!({
        "domain": {"size": [4, 4, 4], "spacing": 0.5},
        "gravity": [0, 0, -9.81],
        "materials": {"granite": {"density": 2600}, "slate": {"density": 2700}},
        "box_walls": ["z_min"],
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 30}},
        "time": {"end": 0.1}
    });
    for (key, part) in parts.as_object().expect("parts of a case") {
        case[key] = part.clone();
    }
    case
}

fn plan(parts: &Value, folder: &Path) -> Result<Plan, Vec<Problem>> {
    Document::read(&case(parts).to_string(), &[], folder).and_then(Plan::prepare)
}

fn scene(parts: &Value) -> Scene {
    plan(parts, Path::new("")).expect("a good case").scene
}

/// Returns a list of blocks of granite.
fn list(blocks: &Value) -> Value {
    json!({"blocks": {"material": "granite", "initial": {"list": blocks}}})
}

fn joints(more: &Value) -> Value {
    let set = |dip: f64, direction: f64| {
        json!({"dip_degrees": dip, "dip_direction_degrees": direction,
        "spacing": {"constant": 1}})
    };
    let mut blocks = json!({"material": "granite", "initial": {"joints": {
        "rock_mass": {"box": {"from": [0, 0, 0], "to": [4, 4, 2]}},
        "sets": [set(90.0, 90.0), set(90.0, 0.0), set(0.0, 0.0)]
    }}});
    for (key, part) in more.as_object().expect("parts of blocks") {
        blocks[key] = part.clone();
    }
    json!({ "blocks": blocks })
}

#[test]
fn a_jointed_box_rests_on_bed_rock() {
    let bed = json!({"fixed": [{"from": [0, 0, 0], "to": [4, 4, 1]}]});
    let scene = scene(&joints(&bed));
    let blocks = scene.blocks.as_ref().expect("blocks");
    assert_eq!((blocks.number, blocks.fixed), (32, 16));
    assert_relative_eq!(blocks.volume, 32.0, max_relative = 1e-13);
    for block in &blocks.list {
        assert_eq!(block.fixed, block.solid.position.z < 1.0);
    }
    assert_eq!(scene.first_grain(), 32);
    assert!(scene.polyhedron(31).is_some() && scene.polyhedron(32).is_none());
}

/// Saves blocks and reads them back from a file, with those that never move.
#[test]
fn a_file_holds_what_the_joints_made() {
    let bed = json!({"fixed": [{"from": [0, 0, 0], "to": [4, 4, 1]}]});
    let made = scene(&joints(&bed)).blocks.expect("blocks");
    let folder = tempfile::tempdir().expect("a folder");
    let entries = made.list.iter().map(|b| super::list::SavedBlock {
        solid: &b.solid,
        material: "slate",
        fixed: b.fixed,
    });
    let text = super::list::write(entries);
    std::fs::write(folder.path().join("blocks.json"), text).expect("a file");
    let file =
        json!({"blocks": {"material": "granite", "initial": {"file": {"path": "blocks.json"}}}});
    let read = plan(&file, folder.path()).expect("a good case").scene;
    let read = read.blocks.expect("blocks");
    assert_eq!((read.number, read.fixed), (32, 16));
    for (one, other) in made.list.iter().zip(&read.list) {
        assert_relative_eq!(one.solid.position, other.solid.position, epsilon = 1e-14);
        assert_eq!((other.material, other.fixed), (1, one.fixed));
    }
}

/// Checks that a block of a list is at the position of its vertices or at its stated position, and rotates about its
/// centroid.
#[test]
fn blocks_of_a_list_stand_and_turn() {
    let hull = json!({"vertices": [[1, 1, 1], [2, 1, 1], [1, 2, 1], [1, 1, 2]]});
    let scene = scene(&list(&json!([
        {"shape": hull},
        {"shape": hull, "position": [3, 3, 3], "orientation": {"axis": [0, 0, 2], "angle_degrees": 90},
            "material": "slate"},
        {"shape": {"half_spaces": [[1,0,0,3],[-1,0,0,-2.5],[0,1,0,1],[0,-1,0,-0.5],[0,0,1,1],[0,0,-1,-0.5]]}}
    ])));
    let blocks = scene.blocks.expect("blocks").list;
    assert_relative_eq!(
        blocks[0].solid.position,
        Vector3::repeat(1.25),
        epsilon = 1e-14
    );
    assert_relative_eq!(
        blocks[2].solid.position,
        Vector3::new(2.75, 0.75, 0.75),
        epsilon = 1e-14
    );
    assert_eq!(blocks[1].material, 1);
    // (x, y) from the centroid becomes (-y, x).
    for (before, after) in blocks[0]
        .solid
        .vertices()
        .iter()
        .zip(blocks[1].solid.vertices())
    {
        let [x, y, z]: [f64; 3] = (before - Vector3::repeat(1.25)).into();
        let expected = Vector3::new(3.0 - y, 3.0 + x, 3.0 + z);
        assert_relative_eq!(after, expected, epsilon = 1e-14);
    }
}

#[test]
fn a_mesh_is_a_body() {
    let folder = tempfile::tempdir().expect("a folder");
    let corners = [
        [0.0, 0.0, 0.0],
        [1000.0, 0.0, 0.0],
        [0.0, 1000.0, 0.0],
        [0.0, 0.0, 1000.0],
    ];
    let mut text = String::from("solid t\n");
    for face in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in face.map(|c| corners[c]) {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    std::fs::write(folder.path().join("t.stl"), text + "endsolid\n").expect("a file");
    let body = json!({"bodies": [{
        "name": "tetrahedron", "shape": {"mesh": {"path": "t.stl", "scale": 0.001}}, "position": [2, 2, 2],
        "motion": {"free": {}}, "material": "slate"
    }], "box_wall_material": "slate"});
    let scene = plan(&body, folder.path()).expect("a good case").scene;
    let solid = scene.bodies[0].solid.as_ref().expect("a polyhedron");
    assert_relative_eq!(solid.shape.volume(), 1.0 / 6.0, max_relative = 1e-6);
    assert_eq!(solid.position, Vector3::repeat(2.0));
}

#[test]
fn overlaps_are_named_with_both() {
    let cube = |x: f64| json!({"shape": {"cuboid": {"edges": [1, 1, 1]}}, "position": [x, 2, 2]});
    // A twentieth of the radius of the sphere inside, 0.025 m, is allowed.
    assert!(plan(&list(&json!([cube(1.0), cube(1.98)])), Path::new("")).is_ok());
    let problems = plan(&list(&json!([cube(1.0), cube(1.97)])), Path::new("")).expect_err("deep");
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert_eq!(problems[0].path, "blocks.initial.list[1].position");
    assert!(
        problems[0]
            .reason
            .contains("block 1 overlaps block 0 by 0.03 m"),
        "{}",
        problems[0]
    );

    let mut mixed = list(&json!([cube(1.0)]));
    mixed["grains"] = json!({"material": "slate", "initial": {"list": [{"position": [1.7, 2, 2], "radius": 0.25}]}});
    let problems = plan(&mixed, Path::new("")).expect_err("a grain in a block");
    assert!(problems[0].reason.contains("0.05 m"), "{}", problems[0]);
    mixed["grains"]["initial"]["list"][0]["position"] = json!([1.75, 2, 2]);
    assert!(plan(&mixed, Path::new("")).is_ok());
}

/// Places a cube next to a polygon: the inscribed sphere, of radius 0.5 m, may overlap the polygon by 0.025 m.
#[test]
fn a_wall_of_facets_is_not_inside_a_block() {
    let beside = |x: f64| {
        let cube = json!([{"shape": {"cuboid": {"edges": [1, 1, 1]}}, "position": [x, 2, 2]}]);
        let mut parts = list(&cube);
        parts["walls"] = json!([{"name": "screen", "material": "slate",
            "shape": {"polygon": [[2, 0, 0], [2, 4, 0], [2, 4, 4], [2, 0, 4]]}}]);
        plan(&parts, Path::new(""))
    };
    assert!(beside(1.52).is_ok() && beside(2.48).is_ok());
    for x in [1.53, 2.0, 2.47] {
        let problems = beside(x).expect_err("a screen in a block");
        assert!(
            problems[0]
                .reason
                .contains("block 0 overlaps the wall `screen`"),
            "{}",
            problems[0]
        );
    }
}

/// Checks the solid step of a cube of mass m between six neighbours: a tenth of sqrt(2 m/K) with K = 2 k_n A + 4 k_s A.
#[test]
fn the_step_follows_from_mass_and_faces() {
    let cube = json!([{"shape": {"cuboid": {"edges": [0.5, 0.5, 0.5]}}, "position": [2, 2, 2]}]);
    let limit = |stiffness: Value| {
        let mut parts = list(&cube);
        parts["contact"] =
            json!({"blocks": {"normal_stiffness": stiffness, "shear_to_normal_stiffness": 0.5}});
        let clock = plan(&parts, Path::new("")).expect("a good case").clock;
        assert_relative_eq!(
            clock.solid_time_step,
            0.1 * clock.critical_solid_time_step.expect("springs"),
            max_relative = 1e-3
        );
        clock.critical_solid_time_step.expect("springs")
    };
    let mass = 2600.0 * 0.125;
    let per_area = (2.0 * mass / (4.0 * 1e9 * 0.25_f64)).sqrt();
    assert_relative_eq!(
        limit(json!({"per_area": 1e9})),
        per_area,
        max_relative = 1e-12
    );
    let per_contact = (2.0 * mass / (4.0 * 1e7_f64)).sqrt();
    assert_relative_eq!(
        limit(json!({"per_contact": 1e7})),
        per_contact,
        max_relative = 1e-12
    );
}
