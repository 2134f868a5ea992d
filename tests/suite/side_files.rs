//! Mutants of every kind of file that a case names: samples, lists of other programs, profiles, rasters, meshes
//! and lists of blocks.
//!
//! Only the file is changed. The case that names it is planned, or refused with a path, a reason and a remedy; no
//! number from an accepted file is NaN or infinite. One mutant in twenty is also given to the real binary.
//!
//! ```text
//! SOLVER_SIDE_FILES=2000 SOLVER_MUTANTS_FROM=0 cargo test --test suite -- side_files --nocapture
//! ```
//!
//! makes as many mutants with the seeds from 0 on; without the variable it makes 80.

use crate::case_mutants::{HANG, processor_time};
use crate::dice::Dice;
use crate::mutants::{
    Mutant, SQUARE, TETRAHEDRON, in_process, record, scramble, through_binary, variable,
};
use crate::ranks::Cores;
use serde_json::{Value, json};
use solver::case::examples::find;
use solver::plan::Plan;
use solver::scene::grains::GrainSource;
use std::collections::BTreeMap;

/// Number of mutants without `SOLVER_SIDE_FILES`.
const FEW: u64 = 80;

/// Case with the file that it names.
struct Named {
    kind: &'static str,
    case: Value,
    file: &'static str,
    bytes: Vec<u8>,
}

fn example(name: &str) -> Value {
    serde_json::from_str(find(name).unwrap().text).unwrap()
}

const LIGGGHTS: &str = "ITEM: TIMESTEP\n5000\nITEM: NUMBER OF ATOMS\n2\n\
    ITEM: BOX BOUNDS ff ff ff\n0 0.1\n0 0.1\n0 0.1\n\
    ITEM: ATOMS id type x y z vx vy vz fx fy fz omegax omegay omegaz radius\n\
    2 1 0.03 0.02 0.05 0 0 -0.1 0 0 0 0 0 0 0.004\n1 1 0.02 0.02 0.02 0 0.2 0 0 0 0 1 0 0 0.005\n";
const LAMMPS: &str = "ITEM: UNITS\nsi\nITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\n\
    ITEM: BOX BOUNDS pp pp ff\n0 0.1\n0 0.1\n0 0.1\n\
    ITEM: ATOMS id type diameter x y z\n1 1 0.01 0.02 0.02 0.02\n2 1 0.008 0.05 0.05 0.05\n";
const YADE: &str = "#format x_y_z_r\n0.02\t0.02\t0.02\t0.005\n0.05\t0.05\t0.05\t0.004\n";
const PFC: &str = "model new\nmodel domain extent 0 0.1\n\
    ball create id 1 radius 0.005 position (0.02,0.02,0.02) group 'a'\n\
    ball create id 2 radius 0.004 position 0.05 0.05 0.05 velocity 0.1 0 0\n";
const SAMPLE: &str =
    "id,x [m],y [m],z [mm],radius,velocity_z\n1,0.02,0.02,20,0.005,-0.1\n2,0.05,0.05,50,0.004,0\n";
const PROFILE: &str = "y,u,v\n0,0,0\n0.0025,0.001,0\n0.005,0.0015,1e-5\n0.0075,0.001,0\n0.01,0,0\n";
const RASTER: &str =
    "x,y,z,hydraulic_conductivity\n0,0,0,1e-4\n0.05,0,0,2e-4\n0,0.05,0,3e-4\n0.05,0.05,0,4e-4\n";

const ROCK: &str = r#"{"blocks": [
  {"id": 0, "half_spaces": [[1,0,0,2],[-1,0,0,-1],[0,1,0,2],[0,-1,0,-1],[0,0,1,1],[0,0,-1,0]], "fixed": true},
  {"id": 1, "vertices": [[1,1,1.5],[2,1,1.5],[1,2,1.5],[1,1,2.5]], "material": "granite"}
]}"#;
/// A tetrahedron as UnBlocks-Gen writes it.
const VTK: &str = "# vtk DataFile Version 3.0\nblocks\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0\n1 0 0\n\
0 1 0\n0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n";
/// This tetrahedron as LMGC90 writes it.
const LMGC90: &str = "$bdyty\n RBDY3      1\n$nodty\n NO6xx 1 coo1= 0.0D+00  coo2= 0.0D+00  coo3= 0.0D+00\n\
coo4= 0.0D+00  coo5= 0.0D+00  coo6= 0.0D+00\n$tacty\n POLYR 1  color  BLEUx  nb_vertex= 4  nb_face= 4\n\
coo1= 0.0D+00  coo2= 0.0D+00  coo3= 0.0D+00\ncoo1= 1.0D+00  coo2= 0.0D+00  coo3= 0.0D+00\n\
coo1= 0.0D+00  coo2= 1.0D+00  coo3= 0.0D+00\ncoo1= 0.0D+00  coo2= 0.0D+00  coo3= 1.0D+00\n\
ver1= 1  ver2= 2  ver3= 3\nver1= 1  ver2= 2  ver3= 4\nver1= 1  ver2= 3  ver3= 4\nver1= 2  ver2= 3  ver3= 4\n$$$$$$\n";
const SPARK_ROCKS: &str = r#"{"centerX":1.5,"centerY":1.5,"centerZ":0.5,"generation":3,"faces":[
{"a":1,"b":0,"c":0,"d":0.5,"phi":30,"cohesion":0},{"a":1,"b":0,"c":0,"d":-0.5,"phi":30,"cohesion":0},
{"a":0,"b":1,"c":0,"d":0.5,"phi":30,"cohesion":0},{"a":0,"b":-1,"c":0,"d":0.5,"phi":30,"cohesion":0},
{"a":0,"b":0,"c":1,"d":0.5,"phi":30,"cohesion":0},{"a":0,"b":0,"c":-1,"d":0.5,"phi":30,"cohesion":0}]}
"#;

/// Returns the cases with their files.
fn corpus() -> Vec<Named> {
    let grains = json!({
        "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.005},
        "materials": {"glass": {"density": 2500}},
        "grains": {"material": "glass", "initial": {"file": {"path": "sample.txt"}}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "friction_angle_degrees": 20}},
        "time": {"end": 0.001}
    });
    let profile = json!({
        "domain": {"size": [0.02, 0.01], "spacing": 0.0005},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "time_step": 0.001,
            "boundaries": [
                {"name": "in", "face": "x_min",
                 "condition": {"velocity": {"profile": {"file": {"path": "inlet.csv"}}}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
            ]
        }},
        "time": {"end": 0.01}
    });
    let raster = json!({
        "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.01},
        "gravity": [0, 0, -9.81],
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 0.001,
            "zones": [{"name": "map", "raster": {"path": "map.csv"}, "without_grains": true}],
            "boundaries": [
                {"name": "low", "face": "z_min", "condition": {"head": {"value": 1}}},
                {"name": "high", "face": "z_max", "condition": {"head": {"value": 1.1}}}
            ]
        }},
        "time": {"end": 0.01}
    });
    let mut wall = example("avalanche");
    wall["walls"][0]["shape"] = json!({"mesh": {"path": "wall.stl"}});
    let mut solid = grains.clone();
    solid["grains"]["initial"] =
        json!({"list": [{"position": [0.09, 0.09, 0.09], "radius": 0.005}]});
    let scaled = json!({"surface": {"mesh": {"path": "solid.stl", "scale": 0.05}}});
    solid["structures"] = json!([{"name": "sill", "shape": scaled}]);
    let blocks = json!({
        "domain": {"size": [4, 4, 4], "spacing": 0.5},
        "gravity": [0, 0, -9.81],
        "materials": {"granite": {"density": 2600}},
        "box_walls": ["z_min"],
        "blocks": {"material": "granite", "initial": {"file": {"path": "rock.json"}}},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 30}},
        "time": {"end": 0.1}
    });
    let mut binary = vec![0_u8; 80];
    binary.extend(2_u32.to_le_bytes());
    for corners in [
        [0.0_f32, 0.0, 2.0, 0.0, 2.0, 2.0],
        [0.0, 0.0, 2.0, 2.0, 0.0, 2.0],
    ] {
        binary.extend([0.0_f32, 0.0, 1.0].iter().flat_map(|n| n.to_le_bytes()));
        for corner in corners.chunks(2) {
            let corner = [corner[0], corner[1], 0.0];
            binary.extend(corner.iter().flat_map(|x| x.to_le_bytes()));
        }
        binary.extend([0, 0]);
    }
    let named = |kind, case: &Value, file, bytes: &[u8]| Named {
        kind,
        case: case.clone(),
        file,
        bytes: bytes.to_vec(),
    };
    vec![
        named("sample", &grains, "sample.txt", SAMPLE.as_bytes()),
        named("LIGGGHTS", &grains, "sample.txt", LIGGGHTS.as_bytes()),
        named("LAMMPS", &grains, "sample.txt", LAMMPS.as_bytes()),
        named("YADE", &grains, "sample.txt", YADE.as_bytes()),
        named("PFC", &grains, "sample.txt", PFC.as_bytes()),
        named("profile", &profile, "inlet.csv", PROFILE.as_bytes()),
        named("raster", &raster, "map.csv", RASTER.as_bytes()),
        named("wall mesh", &wall, "wall.stl", SQUARE.as_bytes()),
        named("binary mesh", &wall, "wall.stl", &binary),
        named("solid mesh", &solid, "solid.stl", TETRAHEDRON.as_bytes()),
        named("blocks", &blocks, "rock.json", ROCK.as_bytes()),
        named("SparkRocks", &blocks, "rock.json", SPARK_ROCKS.as_bytes()),
        named("VTK", &blocks, "rock.json", VTK.as_bytes()),
        named("LMGC90", &blocks, "rock.json", LMGC90.as_bytes()),
    ]
}

/// Returns an error if a number that came from a file is not finite.
fn all_finite(plan: &Plan) -> Result<(), String> {
    if let Some(GrainSource::File { grains, .. }) = plan.scene.grains.as_ref().map(|g| &g.source) {
        let numbers = |g: &solver::scene::sample::ListedGrain| {
            let vectors = [g.position, g.velocity, g.angular_velocity];
            vectors.iter().flatten().all(|x| x.is_finite()) && g.radius.is_finite()
        };
        if let Some(grain) = grains.iter().find(|grain| !numbers(grain)) {
            return Err(format!("accepted {grain:?}"));
        }
    }
    let text = format!("{:?}", plan.scene);
    if text.contains("NaN") {
        return Err("a scene with NaN".into());
    }
    Ok(())
}

#[test]
fn the_files_as_they_are_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for named in corpus() {
        std::fs::write(folder.path().join(named.file), &named.bytes).unwrap();
        let mutant = Mutant {
            text: named.case.to_string(),
            set: Vec::new(),
            files: Vec::new(),
            study: false,
            what: named.kind.to_owned(),
            touches_file: true,
        };
        let document = solver::case::Document::read(&mutant.text, &[], folder.path());
        let plan = document.and_then(Plan::prepare);
        let plan = plan.unwrap_or_else(|problems| panic!("{}: {problems:#?}", named.kind));
        all_finite(&plan).unwrap();
    }
}

#[test]
fn side_files_are_read_or_refused_and_nothing_else() {
    let count = variable("SOLVER_SIDE_FILES").unwrap_or(FEW);
    let first = variable("SOLVER_MUTANTS_FROM").unwrap_or(0);
    let corpus = corpus();
    let folder = tempfile::tempdir().unwrap();
    let mut kinds: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    let mut codes: BTreeMap<i32, u64> = BTreeMap::new();
    let mut wrong = Vec::new();
    for seed in first..first + count {
        let _core = Cores::acquire(1);
        let mut dice = Dice::new(seed ^ 0x51de_f11e);
        let named = &corpus[usize::try_from(seed).unwrap() % corpus.len()];
        let mut bytes = named.bytes.clone();
        let notes: Vec<String> = (0..1 + dice.below(4))
            .map(|_| scramble(&mut bytes, &mut dice))
            .collect();
        let what = format!("seed {seed}: {}: {}", named.kind, notes.join("; "));
        let mutant = Mutant {
            text: named.case.to_string(),
            set: Vec::new(),
            files: vec![(named.file.to_owned(), bytes.clone())],
            study: false,
            what: what.clone(),
            touches_file: true,
        };
        std::fs::write(folder.path().join(named.file), &bytes).unwrap();
        let begun = processor_time();
        let judged = in_process(&mutant, folder.path());
        let taken = processor_time() - begun;
        if taken > HANG {
            wrong.push(format!("{what}: took {taken:?}"));
        }
        let count = kinds.entry(named.kind).or_default();
        count.0 += 1;
        match judged {
            Ok(Some(plan)) => {
                count.1 += 1;
                if let Err(reason) = all_finite(&plan) {
                    wrong.push(format!("{what}: {reason}"));
                }
            }
            Ok(None) => {}
            Err(reason) => wrong.push(format!("{what}: {reason}")),
        }
        if seed % 20 == 0 {
            let text = folder.path().join("case.json");
            std::fs::write(&text, &mutant.text).unwrap();
            match through_binary(&["validate".to_owned(), text.to_str().unwrap().to_owned()]) {
                Ok(code) => *codes.entry(code).or_default() += 1,
                Err(reason) => wrong.push(format!("{what}: {reason}")),
            }
        }
    }
    println!(
        "{count} side files from seed {first}: mutants and accepted ones of each kind {kinds:?}; validate {codes:?}"
    );
    for (kind, (count, accepted)) in &kinds {
        let kind = format!("side files: {kind}");
        record(&kind, (first, *count), *accepted, &[], 0);
    }
    let accepted = kinds.values().map(|(_, accepted)| accepted).sum();
    let codes: Vec<(i32, u64)> = codes.into_iter().collect();
    record("side files", (first, count), accepted, &codes, wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
