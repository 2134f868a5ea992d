//! Ground that collapses over two seepage points: hole, arch and sinkhole are found in a run of the program, and every
//! table and figure has the same bits on any number of ranks and after a restart.

use crate::ranks::{Study, beside_others};

/// Diameter of the grains [m].
const D: f64 = 1e-3;

/// Returns columns of touching spheres, 12 x 4 x 6, over two openings of 2 x 2 grains. With a `strength` of the
/// bonds [N] small against the weight of a grain, 1.3e-5 N, the columns over an opening slide out as blocks;
/// without `strength` there are no bonds.
fn case(strength: Option<&str>) -> String {
    let point = |name: &str, from: f64| {
        format!(
            r#"{{"name": "{name}", "box": {{"from": [{from}, 0, 0], "to": [{}, 0.002, 0.0004]}},
                "action": {{"remove": {{"when": "touches"}}}}}}"#,
            from + 0.002
        )
    };
    let bonds = strength.map_or(String::new(), |strength| {
        format!(
            r#""tensile_strength": {strength}, "shear_strength": {strength}, "bonding_gap": 1e-6,"#
        )
    });
    let law = if strength.is_some() {
        "contact_bond"
    } else {
        "linear"
    };
    let bonded = strength.is_some();
    format!(
        r#"{{
  "title": "Columns over two openings",
  "domain": {{"size": [0.012, 0.004, 0.008], "spacing": 0.001, "split": "x"}},
  "gravity": [0, 0, -9.81],
  "materials": {{"soil": {{"density": 2600}}}},
  "grains": {{
    "material": "soil",
    "initial": {{"file": {{"path": "sample.csv"}}}},
    "bond_at_start": {bonded}
  }},
  "contact": {{
    "{law}": {{
      {bonds}
      "normal_stiffness": {{"absolute": 100}},
      "shear_to_normal_stiffness": 1,
      "friction_angle_degrees": 20,
      "normal_damping_ratio": 0.2
    }}
  }},
  "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
  "box_wall_material": "soil",
  "regions": [{}, {}],
  "time": {{"end": 0.04}},
  "output": {{
    "grains": {{"every": 0.02, "displacement": true}},
    "contacts": {{"every": 0.02}}
  }},
  "analysis": {{"ground_collapse": {{"every": 0.001, "stages": {{"hole_grains": 6}}}}}},
  "checkpoint": {{"every": 0.01}}
}}"#,
        point("left", 0.002),
        point("right", 0.008)
    )
}

fn columns() -> String {
    let mut text = String::from("x,y,z,radius\n");
    let step = D * (1.0 - 1e-7);
    for z in 0..6 {
        for y in 0..4 {
            for x in 0..12 {
                let [x, y, z] = [x, y, z].map(|k| 0.5 * D + f64::from(k) * step);
                text += &format!("{x},{y},{z},{}\n", 0.5 * D);
            }
        }
    }
    text
}

fn study(strength: Option<&str>) -> Study {
    study_of(strength, &columns())
}

fn study_of(strength: Option<&str>, sample: &str) -> Study {
    let study = Study::new(&case(strength));
    std::fs::write(study.path("sample.csv"), sample).unwrap();
    study
}

/// Returns the rows of a table as texts.
fn table(study: &Study, run: &str, name: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(study.path(run).join(name)).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[test]
fn blocks_leave_a_bonded_ground_and_the_record_is_the_same_on_any_ranks() {
    let _beside = beside_others();
    let study = study(Some("1e-6"));
    let done = study.run("one", 1, 1, &[]);
    let summary = study.summary("one");
    let collapse = &summary["collapse"];
    for stage in ["hidden_hole", "sinkhole", "sinkhole_shape"] {
        assert!(collapse["stages"][stage].is_f64(), "{stage}: {collapse:#}");
    }
    // Whole columns fall with their surface, so that there is no arch.
    assert!(collapse["stages"]["arch"].is_null(), "{collapse:#}");
    for (n, times) in [(1, 1), (2, 0), (3, 1)] {
        let begun = done.stdout.matches(&format!("t{n} ")).count();
        assert_eq!(begun, times, "{}", done.stdout);
    }
    assert_eq!(collapse["points"][0]["name"], "left");
    assert!(collapse["points"][1]["eroded_grains"].as_u64().unwrap() >= 6);
    let rows = table(&study, "one", "collapse.csv");
    assert!(rows.len() >= 40, "{} rows", rows.len());
    let blocks = table(&study, "one", "clusters.csv");
    let large = blocks
        .iter()
        .filter(|row| row[2] == "loose" && row[3] != "1");
    assert!(large.count() > 0, "no block came loose");
    study.run("three", 3, 1, &["domain.split=z"]);
    study.same("one", "three");
    assert_eq!(study.summary("three")["collapse"], *collapse);
    // The run is continued from a checkpoint, with threads and on other ranks.
    study.run("parts", 2, 2, &["time.end=0.013"]);
    study.restart("parts", 3, &["time.end=0.04"]).expect(0);
    study.same("one", "parts");
    assert_eq!(study.summary("parts")["collapse"], *collapse);
}

#[test]
fn sand_leaves_as_single_grains() {
    let _beside = beside_others();
    let study = study(None);
    study.run("sand", 2, 1, &["time.end=0.02"]);
    let rows = table(&study, "sand", "clusters.csv");
    assert!(rows.len() > 5, "{rows:?}");
    assert!(rows.iter().all(|row| row[3] == "1"), "{rows:?}");
    let svg = std::fs::read_to_string(study.path("sand").join("settlement.svg")).unwrap();
    assert!(svg.contains("</svg>"));
    // A run without the analysis at time 0 cannot start it later.
    let without = [
        "analysis={}",
        "output.grains.displacement=false",
        "time.end=0.012",
    ];
    study.run("silent", 1, 1, &without);
    let asked = ["output.grains.displacement=true", "time.end=0.014"];
    let done = study.restart("silent", 1, &asked).expect(3);
    assert!(
        done.stderr.contains("initial positions of its grains"),
        "{}",
        done.stderr
    );
}

/// Checks a large grain that rolls from a crest into a hollow and leaves its column, 2.4 mm long; no grain leaves the
/// domain.
#[test]
fn a_grain_that_rolls_off_its_column_is_no_sinkhole() {
    let _beside = beside_others();
    let perched = format!("0.00242,0.0015,{},{}\n", 7.4 * D, 1.4 * D);
    let study = study_of(None, &(columns() + &perched));
    let closed = |n: usize| format!("regions[{n}].action.remove.when=\"centre\"");
    let (left, right) = (closed(0), closed(1));
    let set = [
        left.as_str(),
        right.as_str(),
        "analysis.ground_collapse.cell_size=0.0024",
    ];
    study.run("rolling", 1, 1, &set);
    let rows = table(&study, "rolling", "surface.csv");
    // The column lost the grain and its elevation decreased by more than two diameters ...
    let elevation = |row: &Vec<String>| row[6].parse::<f64>().unwrap();
    let column = |row: &&Vec<String>| row[2] == "1" && row[3] == "0";
    let of_column: Vec<f64> = rows.iter().filter(column).map(elevation).collect();
    let [first, last] = [of_column[0], of_column[of_column.len() - 1]];
    assert!(first - last > 2.0 * D, "{of_column:?}");
    // ... but no stage has begun.
    let summary = study.summary("rolling");
    let stages = &summary["collapse"]["stages"];
    assert!(
        stages.as_object().unwrap().values().all(|t| t.is_null()),
        "{stages:#}"
    );
    study.run("ranks", 2, 1, &[&set[..], &["domain.split=z"]].concat());
    study.same("rolling", "ranks");
}
