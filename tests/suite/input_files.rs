//! Files that a case, a study or a command names are data: those that are broken, endless or of another kind are
//! refused with the path of the field, both by `validate` and by a run, and a run writes only into its own folder.

use crate::ranks::{Cores, ENVIRONMENT, SOLVER, Study, beside_others, run};
use serde_json::{Value, json};
use solver::case::Document;
use solver::case::examples::{EXAMPLES, find};
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use solver::scene::grains::GrainSource;
use std::path::Path;
use std::process::{Command, Output};

/// Returns the problems of a case whose paths start at `folder`.
fn problems(case: &Value, folder: &Path) -> Vec<Problem> {
    match Document::read(&case.to_string(), &[], folder).and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

#[track_caller]
fn says(case: &Value, folder: &Path, path: &str, reason: &str) {
    let found = problems(case, folder);
    assert!(
        found
            .iter()
            .any(|p| p.path == path && p.reason.contains(reason)),
        "{path} {reason}: {found:#?}"
    );
}

fn example(name: &str) -> Value {
    serde_json::from_str(find(name).unwrap().text).unwrap()
}

/// Returns the output of the program with arguments; a run of a minute counts as hanging.
fn solver(arguments: &[&str]) -> Output {
    let mut command = Command::new("timeout");
    command
        .args(["--kill-after=5", "60", SOLVER])
        .args(arguments);
    command.output().unwrap()
}

#[track_caller]
fn ends(arguments: &[&str], code: i32, reason: &str) {
    let done = solver(arguments);
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(code), "{arguments:?}: {told}");
    assert!(told.contains(reason), "{arguments:?}: {told}");
}

fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn lists_of_other_lengths_are_refused_in_every_example() {
    fn lists(node: &Value, at: &str, found: &mut Vec<String>) {
        match node {
            Value::Object(map) => {
                for (key, child) in map {
                    lists(child, &format!("{at}/{key}"), found);
                }
            }
            Value::Array(list) => {
                if list.iter().all(Value::is_number) {
                    found.push(at.to_owned());
                }
                for (n, child) in list.iter().enumerate().take(3) {
                    lists(child, &format!("{at}/{n}"), found);
                }
            }
            _ => {}
        }
    }
    for example in EXAMPLES {
        let case: Value = serde_json::from_str(example.text).unwrap();
        let mut found = Vec::new();
        lists(&case, "", &mut found);
        for path in found {
            for length in [0, 1, 4, 7] {
                let mut changed = case.clone();
                *changed.pointer_mut(&path).unwrap() = json!(vec![1; length]);
                // There is at least one problem.
                problems(&changed, Path::new(""));
            }
        }
    }
    says(
        &{
            let mut case = example("first-flow");
            case["domain"]["size"] = json!([1, 1, 1, 1]);
            case
        },
        Path::new(""),
        "domain.size",
        "this list has 4 values",
    );
}

#[test]
fn huge_and_deep_texts_cost_little() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.json");
    let name = path.to_str().unwrap();
    let many: Vec<String> = (0..300_000).map(|n| format!("\"k{n}\":1")).collect();
    std::fs::write(&path, format!("{{{}}}", many.join(","))).unwrap();
    let done = solver(&["validate", name]);
    let told = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(3));
    assert!(told.contains("{300000 keys}"), "{told}");
    assert!(told.lines().count() < 60, "{told}");
    // Every entry of a list is invalid, and no object is large.
    let mut case = example("settling-disc");
    let grain = json!({"position": [1e9, 1e9], "radius": 1e-5, "colour": 1});
    case["grains"] = json!({"material": "disc", "initial": {"list": vec![grain; 5_000]}});
    let found = problems(&case, Path::new(""));
    assert!(found.len() < 200, "{}", found.len());
    assert!(
        found.iter().any(|p| p.value.contains("more problems")),
        "{found:#?}"
    );

    std::fs::write(&path, "[".repeat(200_000)).unwrap();
    ends(&["validate", name], 3, "not valid JSON");
    // A sparse file takes no space on the disk at any length.
    let file = std::fs::File::create(&path).unwrap();
    file.set_len(300 << 20).unwrap();
    ends(&["validate", name], 5, "at most 268435456 are read");
    let deep = format!("x{}=1", "[0]".repeat(30_000));
    std::fs::write(&path, find("first-flow").unwrap().text).unwrap();
    ends(
        &["validate", name, "--set", &deep],
        3,
        "not a path of a field",
    );
}

#[test]
fn formulas_of_a_study_are_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.json");
    let nested = |n: usize| format!("={}1{}", "(".repeat(n), ")".repeat(n));
    for (formula, reason) in [
        (nested(40_000), "the formula has 80001 bytes"),
        (
            format!("={}1", "-".repeat(100_000)),
            "the formula has 100001 bytes",
        ),
        (nested(2000), "nest more than 100 deep"),
    ] {
        let study = json!({
            "case": example("first-flow"),
            "vary": {"time.end": [0.001, formula]},
            "outputs": {"n": {"summary": "steps"}},
        });
        std::fs::write(&path, study.to_string()).unwrap();
        ends(&["sweep", path.to_str().unwrap(), "--list"], 3, reason);
        let study = json!({
            "case": example("first-flow"),
            "vary": {"time.end": [0.001]},
            "outputs": {"a": {"is": &formula[1..]}},
        });
        std::fs::write(&path, study.to_string()).unwrap();
        ends(
            &["sweep", path.to_str().unwrap(), "--list"],
            3,
            "outputs.a.is",
        );
    }
}

#[test]
fn what_is_no_plain_file_is_refused_wherever_it_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.csv");
    pipe(&fifo);
    let fifo = fifo.to_str().unwrap();
    for special in [
        fifo,
        "/dev/full",
        "/dev/zero",
        folder.path().to_str().unwrap(),
    ] {
        ends(&["validate", special], 5, "not a plain file");
        ends(&["sweep", special, "--list"], 5, "not a plain file");
        let mut case = example("couette");
        case["grains"] = json!({"material": "m", "initial": {"file": {"path": special}}});
        case["materials"] = json!({"m": {"density": 2000}});
        says(
            &case,
            folder.path(),
            "grains.initial.file.path",
            "not a plain file",
        );
        let mut case = example("first-flow");
        case["fluid"]["lattice_boltzmann"]["initial"] = json!({"file": {"path": special}});
        says(
            &case,
            folder.path(),
            "fluid.lattice_boltzmann.initial.file.path",
            "not a plain file",
        );
        let mut case = example("avalanche");
        case["blocks"]["initial"] = json!({"file": {"path": special}});
        says(
            &case,
            folder.path(),
            "blocks.initial.file.path",
            "not a plain file",
        );
        case["walls"] =
            json!([{"name": "w", "shape": {"mesh": {"path": special}}, "material": "granite"}]);
        says(
            &case,
            folder.path(),
            "walls[0].shape.mesh.path",
            "not a plain file",
        );
        let study = json!({"case": special, "vary": {"time.end": [1]}, "outputs": {"n": {"summary": "steps"}}});
        let path = folder.path().join("study.json");
        std::fs::write(&path, study.to_string()).unwrap();
        ends(
            &["sweep", path.to_str().unwrap(), "--list"],
            3,
            "not a plain file",
        );
    }
    ends(&["info", fifo], 5, "it is a pipe");
}

#[test]
fn a_sample_is_read_in_full_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let mut case = example("collision");
    case["grains"]["initial"] = json!({"file": {"path": "sample.csv"}});
    let path = "grains.initial.file.path";
    let with = |text: &str, change: &[(&str, Value)]| {
        std::fs::write(here.join("sample.csv"), text).unwrap();
        let mut case = case.clone();
        for (key, value) in change {
            case[*key] = value.clone();
        }
        case
    };
    let good = "x,y,radius,velocity_x,angular_velocity_z,id\n0.12,0.05,0.01,-1,0,9\n0.08,0.05,0.01,1,3,4\n";
    let document = Document::read(&with(good, &[]).to_string(), &[], here).unwrap();
    let plan = Plan::prepare(document).unwrap();
    let Some(GrainSource::File { grains, .. }) = plan.scene.grains.map(|grains| grains.source)
    else {
        panic!("the grains are those of the file");
    };
    let motion = grains.iter().map(|g| [g.velocity, g.angular_velocity]);
    assert_eq!(
        json!(motion.collect::<Vec<_>>()),
        json!([
            [[1.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
            [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        ])
    );
    for (text, reason) in [
        (
            "x,y,radius,velocity\n0.1,0.05,0.01,1\n",
            "did you mean `velocity_",
        ),
        ("x,y,radius,z\n0.1,0.05,0.01,1\n", "2-D problem"),
        (
            "x,y,radius,id\n0.1,0.05,0.01,-1\n",
            "line 2: the id is `-1`",
        ),
        ("x,y,radius,velocity_y\n0.1,0.05,0.01,up\n", "`velocity_y`"),
        ("x,y,radius,material\n0.1,0.05,0.01,light\n", "no material"),
    ] {
        says(&with(text, &[]), here, path, reason);
    }
    let wide = "x,y,radius\n0.1,0.05,0.06\n";
    let domain = json!({"size": [0.2, 0.1], "spacing": 0.005, "periodic": ["y"]});
    says(
        &with(wide, &[("domain", domain)]),
        here,
        path,
        "overlap itself across the periodic axis y: its diameter can be at most 0.1 m",
    );
    let weightless = json!({"glass": {"density": 2500}, "light": {}});
    let mixed = "x,y,radius,material\n0.1,0.05,0.01,light\n";
    let weightless = with(mixed, &[("materials", weightless)]);
    says(
        &weightless,
        here,
        "materials.light.density",
        "needs the density",
    );
    // A gate may have supported the sample when it was made; here it supports nothing.
    let gate = json!([{
        "name": "gate", "material": "glass", "during": "preparation",
        "shape": {"plane": {"point": [0.15, 0], "normal": [-1, 0]}}
    }]);
    let held = with(good, &[("walls", gate)]);
    says(&held, here, "walls[0].during", "never acts");
    assert!(
        problems(&held, here)
            .iter()
            .all(|p| p.severity == Severity::Warning)
    );
}

/// Checks a sample that was made in cm round the origin, as a dump or a table.
#[test]
fn a_sample_is_moved_and_scaled_into_the_domain() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let mut case = example("collision");
    let text = "x,y,radius,velocity_x,angular_velocity_z,id\n2,0,1,-100,5,1\n-2,0,1,0,0,2\n";
    std::fs::write(here.join("sample.csv"), text).unwrap();
    let file = json!({"path": "sample.csv", "scale": 0.01, "origin": [0.1, 0.05]});
    case["grains"]["initial"] = json!({"file": file});
    let document = Document::read(&case.to_string(), &[], here).unwrap();
    let plan = Plan::prepare(document).unwrap();
    let Some(GrainSource::File { grains, .. }) = plan.scene.grains.map(|grains| grains.source)
    else {
        panic!("the grains are those of the file");
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-15;
    let [right, left] = &grains[..] else {
        panic!("two grains");
    };
    assert!(near(right.position[0], 0.12) && near(right.position[1], 0.05));
    assert!(near(left.position[0], 0.08) && near(left.radius, 0.01));
    assert_eq!(
        right.velocity.map(f64::to_bits),
        [-1.0, 0.0, 0.0].map(f64::to_bits)
    );
    assert_eq!(
        right.angular_velocity.map(f64::to_bits),
        [0.0, 0.0, 5.0].map(f64::to_bits)
    );
    case["grains"]["initial"] = json!({"file": {"path": "sample.csv", "scale": 0.01}});
    let found = problems(&case, here);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].reason.contains("x -0.02 … 0.02 m"), "{found:#?}");
    let remedy = found[0].remedy.to_string();
    assert!(remedy.contains("the domain is 0 … 0.2, 0.1 m"), "{remedy}");
    assert!(remedy.contains("`origin` next to `path`"), "{remedy}");
    let long = json!({"path": "sample.csv", "scale": 0.01, "origin": [0.1, 0.05, 0.0]});
    case["grains"]["initial"] = json!({"file": long});
    says(&case, here, "grains.initial.file.origin", "");
    let none = json!({"path": "sample.csv", "scale": 0.0, "origin": [0.1, 0.05]});
    case["grains"]["initial"] = json!({"file": none});
    says(&case, here, "grains.initial.file.scale", "");
    assert_eq!(problems(&case, here).len(), 1);
    let small = json!({"path": "sample.csv", "scale": 1e-30, "origin": [0.1, 0.05]});
    std::fs::write(here.join("sample.csv"), "x,y,radius\n0,0,1e-300\n").unwrap();
    case["grains"]["initial"] = json!({"file": small});
    says(&case, here, "grains.initial.file.path", "a radius of 0 m");
}

/// Returns a channel with an inlet velocity from a table.
fn with_profile(text: &str, folder: &Path) -> Value {
    std::fs::write(folder.join("inlet.csv"), text).unwrap();
    json!({
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
    })
}

const PROFILE: &str = "fluid.lattice_boltzmann.boundaries[0].condition.velocity.profile.file.path";

#[test]
fn a_profile_is_read_by_validate() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (text, reason) in [
        ("", "empty"),
        ("y,u,v\n", "no rows"),
        ("0,0,0\n0.01,1e-3,0\n", "line 1 holds numbers"),
        ("y,u,v\n0,1\n", "line 2 has 2 cells"),
        ("y,u,v\n0,1e-3,0\n0.01,nan,0\n", "line 3"),
        ("y,u,v\n0,1e-3,0,4\n", "line 2"),
        ("y,u,v\n0;1e-3;0\n", "line 2"),
    ] {
        says(&with_profile(text, here), here, PROFILE, reason);
    }
    let case = with_profile("y,u,v\n0,1,0\n", here);
    std::fs::write(here.join("inlet.csv"), [0xff, 0xfe, 0x00]).unwrap();
    says(&case, here, PROFILE, "not text");
    std::fs::remove_file(here.join("inlet.csv")).unwrap();
    says(&case, here, PROFILE, "No such file");
    let good = with_profile("y,u,v\n0,0.001,0\n0.01,0.001,0\n", here);
    assert_eq!(problems(&good, here), []);
}

#[test]
fn the_speeds_of_a_profile_are_judged_like_constants() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // Three times the largest speed allowed on the lattice, at a single point.
    let fast = with_profile("y,u,v\n0,0,0\n0.005,1.5,0\n0.01,0,0\n", here);
    let mut constant = fast.clone();
    constant["fluid"]["lattice_boltzmann"]["boundaries"][0]["condition"]["velocity"]["profile"] =
        json!({"uniform": [1.5, 0]});
    let reasons = |case: &Value| -> Vec<String> {
        let refused = problems(case, here);
        let errors = refused
            .iter()
            .filter(|p| p.reason.contains("imposed velocity"));
        errors.map(|p| p.reason.clone()).collect()
    };
    assert!(
        !reasons(&constant).is_empty(),
        "{:#?}",
        problems(&constant, here)
    );
    assert_eq!(reasons(&fast), reasons(&constant));
}

#[test]
fn an_initial_field_of_other_cells_is_refused_by_validate() {
    let _beside = beside_others();
    let study = Study::from_example(
        "taylor-green",
        &[("time.end", "0.005"), ("output.fluid.every", "0.005")],
    );
    let path = "fluid.lattice_boltzmann.initial.file.path";
    let here = study.path("");
    let mut case = example("taylor-green");
    for (text, reason) in [("", ""), ("no HDF5", "")] {
        std::fs::write(study.path("field.vtkhdf"), text).unwrap();
        case["fluid"]["lattice_boltzmann"]["initial"] = json!({"file": {"path": "field.vtkhdf"}});
        says(&case, &here, path, reason);
    }
    case["fluid"]["lattice_boltzmann"]["initial"] = json!({"file": {"path": "none.vtkhdf"}});
    says(&case, &here, path, "No such file");
    study.run("run", 0, 1, &[]);
    let mut fields: Vec<String> = std::fs::read_dir(study.path("run"))
        .unwrap()
        .map(|entry| entry.unwrap().path().to_str().unwrap().to_owned())
        .filter(|name| name.ends_with(".vtkhdf"))
        .collect();
    fields.sort();
    let last = fields.last().expect("a field").clone();
    case["fluid"]["lattice_boltzmann"]["initial"] = json!({"file": {"path": last}});
    assert!(problems(&case, &here).iter().all(|p| p.path != path));
    let size = case["domain"]["size"][0].as_f64().unwrap();
    case["domain"]["size"][0] = json!(2.0 * size);
    says(&case, &here, path, "but the case has");
    // The run reads the field on two ranks as on one.
    let set = format!("fluid.lattice_boltzmann.initial={{\"file\": {{\"path\": {last:?}}}}}");
    study.run("again", 0, 1, &[&set]);
    study.run("together", 2, 1, &[&set]);
    assert_eq!(study.hash("again"), study.hash("together"));
}

#[test]
fn a_run_writes_into_its_own_folder_only() {
    let mut case = example("piping");
    for name in [
        "/tmp/x.csv",
        "../x.csv",
        "a/b.csv",
        "case.json",
        "Summary.json",
        "erosion.csv",
        "STOP",
        "checkpoints",
        "probe_a.csv",
        "fluid.xmf",
        "grains_000000001.vtkhdf",
        "x.part",
        ".",
        "..",
        "",
    ] {
        case["grains"]["save"] = json!(name);
        let found = problems(&case, Path::new(""));
        let told = found.iter().find(|p| p.path == "grains.save");
        assert!(
            told.is_some_and(|p| p.remedy.contains("sample.csv")),
            "{name}: {found:#?}"
        );
    }
    case["grains"]["save"] = json!("sample.csv");
    assert_eq!(
        problems(&case, Path::new(""))
            .iter()
            .filter(|p| p.path == "grains.save")
            .count(),
        0
    );
    let mut case = example("avalanche");
    case["blocks"]["save"] = json!("../blocks.json");
    says(
        &case,
        Path::new(""),
        "blocks.save",
        "the name of a file in the folder",
    );
}

#[test]
fn the_folder_of_the_case_is_no_output_folder() {
    let _beside = beside_others();
    let study = Study::from_example("first-flow", &[]);
    let before = std::fs::read(study.path("case.json")).unwrap();
    let done = run(0, &study.arguments("", 1, &[])).expect(2);
    assert!(
        done.stderr.contains("would overwrite its own case"),
        "{}",
        done.stderr
    );
    assert_eq!(std::fs::read(study.path("case.json")).unwrap(), before);
}

#[test]
fn a_limit_of_file_sizes_ends_with_a_sentence() {
    let _beside = beside_others();
    let study = Study::eroding(&[("checkpoint.every", "0.008")]);
    study.run("full", 0, 1, &["time.end=0.012"]);
    let size = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().metadata().unwrap().len();
    let folder = study.path("full").join("checkpoints");
    let largest = std::fs::read_dir(folder).unwrap().map(size).max().unwrap();
    for (limit, ranks) in [(largest / 1024 / 2, 1), (4, 1), (largest / 1024 / 2, 2)] {
        let name = format!("limited-{limit}-{ranks}");
        let mut words = ["mpirun", "--oversubscribe", "-n"]
            .map(str::to_owned)
            .to_vec();
        words.push(ranks.to_string());
        // mpirun writes files itself, so that only its child processes are limited.
        words.extend(["bash", "-c"].map(str::to_owned));
        words.push(format!("ulimit -f {limit}; exec \"$0\" \"$@\""));
        words.push(SOLVER.to_owned());
        words.extend(study.arguments(&name, 1, &[]));
        let mut command = Command::new("timeout");
        command.args(["--kill-after=5", "60"]).args(&words);
        command.envs(ENVIRONMENT);
        // Shared memory is a file too: with limited file sizes, messages need another transport.
        command.env_remove("OMPI_MCA_btl");
        // The other rank has time to end.
        command.env(
            "OMPI_MCA_odls_base_sigkill_timeout",
            (ranks - 1).to_string(),
        );
        let _cores = Cores::acquire(1);
        let done = command.output().unwrap();
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(5), "{limit}: {told}");
        assert!(told.contains("File too large"), "{limit}: {told}");
    }
    // The earlier files are intact: the unlimited run continues.
    study.restart("full", 0, &["time.end=0.016"]).expect(0);
}

/// Returns a channel with the given texts for inlet and initial state.
fn stream(inlet: &Value, start: &Value) -> Value {
    json!({
        "domain": {"size": [0.02, 0.01], "spacing": 0.0005},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.8, "initial": {"uniform": start},
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": inlet}}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
            ]
        }},
        "time": {"end": 0.01}
    })
}

#[test]
fn a_uniform_velocity_is_a_list_or_an_object_at_inlets_as_at_the_start() {
    let here = Path::new(".");
    let (list, object) = (json!([1e-3, 0]), json!({"velocity": [1e-3, 0]}));
    let scene = |inlet: &Value, start: &Value| {
        let document = Document::read(&stream(inlet, start).to_string(), &[], here).unwrap();
        format!("{:?}", Plan::prepare(document).unwrap().scene.flow)
    };
    let wanted = scene(&list, &list);
    for (inlet, start) in [(&list, &object), (&object, &list), (&object, &object)] {
        assert_eq!(scene(inlet, start), wanted);
    }
    let pressed = scene(&list, &json!({"velocity": [1e-3, 0], "pressure": 1e-3}));
    assert_ne!(pressed, wanted);

    // Each form is recognised by the position and the value of its fault.
    let fluid = "fluid.lattice_boltzmann";
    let profile = format!("{fluid}.boundaries[0].condition.velocity.profile.uniform");
    let start = format!("{fluid}.initial.uniform");
    for wrong in [json!([1e-3, 0, 0]), json!({"velocity": [1e-3, 0, 0]})] {
        let case = stream(&wrong, &wrong);
        for path in [&profile, &start] {
            says(&case, here, &format!("{path}.velocity"), "3 components");
        }
    }
    let case = stream(&json!({"velocity": [1e-3, 0], "pressure": 1}), &list);
    says(&case, here, &format!("{profile}.pressure"), "no field");
    for path in [&profile, &start] {
        says(
            &stream(&json!({}), &json!({})),
            here,
            &format!("{path}.velocity"),
            "required",
        );
        says(
            &stream(&json!("fast"), &json!("fast")),
            here,
            path,
            "needed",
        );
    }
}

#[test]
fn planes_across_a_periodic_axis_are_refused_before_the_run() {
    let here = Path::new(".");
    let case = |planes: Value, structures: Value, periodic: Value| {
        json!({
            "domain": {"size": [0.1, 0.1], "spacing": 0.01, "periodic": periodic},
            "gravity": [0, -9.81],
            "materials": {"sand": {"density": 2650}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e6}}},
            "grains": {"initial": {"list": [{"position": [0.05, 0.05], "radius": 0.002}]}, "material": "sand"},
            "walls": planes, "structures": structures,
            "time": {"end": 0.01, "solid_time_step": 1e-6}
        })
    };
    let wall = |normal: [f64; 2]| {
        json!([{"name": "end", "shape": {"plane": {"point": [0, 0], "normal": normal}},
        "material": "sand"}])
    };
    let solid = |normal: [f64; 2]| {
        json!([{"name": "rock", "shape": {"plane": {"point": [0.01, 0.01],
        "normal": normal}}}])
    };
    let path = "walls[0].shape.plane.normal";
    for normal in [[1.0, 0.0], [1e-3, 1.0]] {
        let closed = case(wall(normal), json!([]), json!(["x"]));
        says(&closed, here, path, "the periodic axis");
        let closed = case(json!([]), solid(normal), json!(["x"]));
        says(&closed, here, "structures[0].stops", "the periodic axis");
    }
    let errors = |case: &Value| {
        let all = problems(case, here).into_iter();
        all.filter(|p| p.severity == Severity::Error)
            .collect::<Vec<_>>()
    };
    for [walls, structures] in [
        [wall([0.0, 1.0]), json!([])],
        [json!([]), solid([0.0, 1.0])],
    ] {
        assert_eq!(errors(&case(walls, structures, json!(["x"]))), []);
    }
    assert_eq!(errors(&case(wall([1.0, 0.0]), json!([]), json!([]))), []);
}

#[test]
fn grains_of_a_file_do_not_start_in_structures() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    std::fs::write(
        here.join("sample.csv"),
        "x,y,radius\n0.05,0.05,0.002\n0.02,0.02,0.002\n0.08,0.08,0.002\n",
    )
    .unwrap();
    let case = |cut: Value| {
        json!({
            "domain": {"size": [0.1, 0.1], "spacing": 0.01},
            "materials": {"sand": {"density": 2650}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e6}}},
            "grains": {"initial": {"file": {"path": "sample.csv"}}, "material": "sand", "cut": cut},
            "structures": [{"name": "pier", "shape": {"disc": {"centre": [0.05, 0.05], "radius": 0.01}}}],
            "time": {"end": 0.01, "solid_time_step": 1e-6}
        })
    };
    let path = "grains.initial.file.path";
    says(
        &case(json!([])),
        here,
        path,
        "1 grains of the sample reach into the structure `pier`",
    );
    let cut = json!([{"name": "pit", "box": {"from": [0.04, 0.04], "to": [0.06, 0.06]}}]);
    let found = problems(&case(cut), here);
    assert!(found.iter().all(|p| p.path != path), "{found:#?}");
}

/// Checks that a wall with an invalid polygon has a finding about the polygon at its path.
#[test]
fn an_invalid_polygon_of_a_wall_is_named_as_a_polygon() {
    for (corners, reason) in [
        (
            json!([
                [0, 0, 0.02],
                [0.01, 0, 0.02],
                [0.002, 0.002, 0.02],
                [0, 0.01, 0.02]
            ]),
            "the polygon is not convex",
        ),
        (
            json!([[0, 0, 0.02], [0.005, 0, 0.02], [0.01, 0, 0.02]]),
            "the polygon has no area",
        ),
        (
            json!([[0, 0, 0.02], [0.01, 0, 0.02]]),
            "the polygon needs at least three corners",
        ),
    ] {
        let mut case = example("deposition");
        case["walls"][0]["shape"] = json!({ "polygon": corners });
        let found = problems(&case, Path::new("."));
        let about = found
            .iter()
            .find(|p| p.path == "walls[0].shape.polygon")
            .unwrap_or_else(|| panic!("{found:#?}"));
        assert!(about.reason.starts_with(reason), "{about}");
    }
}

/// Checks that a rank variable in the environment of a shell, without a number of ranks, does not silence any command.
#[test]
fn a_rank_in_the_environment_of_a_shell_does_not_silence_the_program() {
    for name in ["SLURM_PROCID", "PMI_RANK", "PMIX_RANK"] {
        let mut command = Command::new(SOLVER);
        command.arg("example").env(name, "3");
        for size in [
            "OMPI_COMM_WORLD_SIZE",
            "OMPI_COMM_WORLD_RANK",
            "PMI_SIZE",
            "SLURM_STEP_NUM_TASKS",
        ] {
            command.env_remove(size);
        }
        let done = command.output().unwrap();
        assert_eq!(done.status.code(), Some(0));
        assert!(!done.stdout.is_empty(), "{name}");
    }
    let mut command = Command::new(SOLVER);
    command
        .arg("example")
        .env("OMPI_COMM_WORLD_RANK", "1")
        .env("OMPI_COMM_WORLD_SIZE", "2");
    // A batch job may export both. Only the address of a launcher makes the process one of its ranks.
    for version in ["", "2", "21", "3", "4"] {
        command.env_remove(format!("PMIX_SERVER_URI{version}"));
    }
    assert!(!command.output().unwrap().stdout.is_empty());
    command.env("PMIX_SERVER_URI2", "1.0;tcp4://127.0.0.1:9");
    assert!(command.output().unwrap().stdout.is_empty());
}

/// Checks that the program writes only into the folder of the run: links there are replaced or refused, and their
/// targets are unchanged.
#[test]
fn links_in_the_folder_of_a_run_are_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case.json");
    std::fs::write(&case, example("collision").to_string()).unwrap();
    let target = folder.path().join("precious");
    let place = |name: &str| {
        let out = folder.path().join(format!("out_{name}"));
        std::fs::create_dir(&out).unwrap();
        std::fs::write(&target, "precious").unwrap();
        std::os::unix::fs::symlink(&target, out.join(name)).unwrap();
        let arguments = [
            case.to_str().unwrap().to_owned(),
            "--output".into(),
            out.to_str().unwrap().into(),
            "--set".into(),
            "time.end=0.001".into(),
            "--overwrite".into(),
        ];
        let done = solver(&arguments.each_ref().map(String::as_str));
        assert_eq!(
            std::fs::read_to_string(&target).unwrap(),
            "precious",
            "{name}"
        );
        (
            done.status.code(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        )
    };
    let (code, told) = place("run.lock");
    assert_eq!(code, Some(5), "{told}");
    assert!(told.contains("this is a link"), "{told}");
    for name in ["summary.json.part", "case.json.part", "summary.json"] {
        let (code, told) = place(name);
        assert_eq!(code, Some(0), "{name}: {told}");
    }
}

/// Checks that a picture shows a field that the run wrote where the velocity is not among its outputs, and that a
/// request for an absent field or column lists those that are there.
#[test]
fn a_picture_shows_a_field_that_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, end: &str, output: &str| {
        let case = folder.path().join(format!("{name}.json"));
        std::fs::write(&case, example(name).to_string()).unwrap();
        let run = folder.path().join(name);
        let words = [
            case.to_str().unwrap(),
            "--output",
            run.to_str().unwrap(),
            "--set",
            &format!("time.end={end}"),
            "--set",
            &format!("output={output}"),
        ];
        ends(&words, 0, "");
        run
    };
    let flow = r#"{"fluid": {"every": 1, "fields": ["density", "pressure"]}}"#;
    let (flow, grains) = (
        run("couette", "0.01", flow),
        run("collision", "0.002", r#"{"grains": {"every": 1}}"#),
    );
    ends(&["picture", flow.to_str().unwrap()], 0, "");
    let text = std::fs::read_to_string(flow.join("picture.svg")).unwrap();
    assert!(text.contains(">pressure ["), "{text}");
    for (run, option, column, there) in [
        (&flow, "--field", "velocity", "it has density, pressure"),
        (&grains, "--colour", "temperature", "radius"),
        (&grains, "--arrows", "displacement", "radius"),
    ] {
        let done = solver(&["picture", run.to_str().unwrap(), option, column]);
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{told}");
        let starts = format!("{option} {column}: ");
        assert!(told.contains(&starts) && told.contains(there), "{told}");
        assert!(!told.contains("Connectivity"), "{told}");
    }
    ends(
        &["picture", flow.to_str().unwrap(), "--streamlines"],
        2,
        "has no velocity",
    );
    // Options for what a run does not have are no pictures without it.
    let name = grains.to_str().unwrap();
    for (options, reason) in [
        (&["--field", "head"][..], "--field: "),
        (&["--streamlines"][..], "--streamlines: "),
        (&["--flow-net", "5"][..], "--flow-net: "),
    ] {
        let done = solver(&[&["picture", name], options].concat());
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{told}");
        assert!(
            told.contains(reason) && told.contains("no fluid.xmf"),
            "{told}"
        );
    }
    let flow = flow.to_str().unwrap();
    ends(&["picture", flow, "--section", "z=0.1"], 2, "the run in");
    ends(
        &["picture", flow, "--arrows", "velocity"],
        2,
        "no grains.xmf",
    );
    ends(&["erosion-law", name], 5, "analysis.erosion_law");
    ends(&["erosion-law", "nowhere"], 5, "there is no such folder");
    let case = folder.path().join("collision.json");
    ends(
        &["plan", case.to_str().unwrap(), "--pilot"],
        3,
        "fluid.lattice_boltzmann = missing: a pilot",
    );
}

/// Checks that the walls of a run in space are written as surfaces: two polygons, and two planes on faces of the domain
/// as rectangles of its size, but not the floor, which exists only while the sample is prepared.
#[test]
fn planes_are_written_where_they_bound_the_domain() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case.json");
    std::fs::write(&case, example("deposition").to_string()).unwrap();
    let run = folder.path().join("run");
    let words = [
        case.to_str().unwrap(),
        "--output",
        run.to_str().unwrap(),
        "--set",
        "time.end=1e-5",
    ];
    ends(&words, 0, "");
    let file = run.join("walls_000000000.vtkhdf");
    let column = |name: &str| io::fields::read_column(&file, name).unwrap().values;
    assert_eq!(column("wall"), [0.0, 1.0, 3.0, 4.0]);
    assert!(column("until").iter().all(|until| *until >= f64::MAX));
    let points = column("position");
    for (points, y) in points[24..].chunks(12).zip([0.0, 0.02]) {
        for corner in points.chunks(3) {
            let on_edge = |x: f64, end: f64| x.abs() < 1e-12 || (x - end).abs() < 1e-12;
            let [x, at, z] = [corner[0], corner[1], corner[2]];
            assert!(
                (at - y).abs() < 1e-12 && on_edge(x, 0.024) && on_edge(z, 0.06),
                "{corner:?}"
            );
        }
    }
}

/// Checks that a picture replaces pictures, and other plain files only on request.
#[test]
fn a_picture_replaces_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case.json");
    std::fs::write(&case, example("collision").to_string()).unwrap();
    let run = folder.path().join("run");
    let name = run.to_str().unwrap();
    ends(
        &[
            case.to_str().unwrap(),
            "--output",
            name,
            "--set",
            "time.end=0.002",
        ],
        0,
        "",
    );
    let fifo = folder.path().join("fifo.svg");
    pipe(&fifo);
    let own = run.join("case.json");
    for (output, reason) in [
        (fifo.to_str().unwrap(), "not a regular file"),
        ("/dev/null", "not a regular file"),
        (own.to_str().unwrap(), "--overwrite"),
    ] {
        ends(&["picture", name, "--output", output], 2, reason);
    }
    assert!(std::fs::read_to_string(&own).unwrap().starts_with('{'));
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    let free = pictures.join("a.svg");
    for _ in 0..2 {
        ends(
            &["picture", name, "--output", free.to_str().unwrap()],
            0,
            "",
        );
        ends(&["picture", name], 0, "");
    }
    ends(&["picture", name, "--time", "nan"], 2, "a time in seconds");
}
