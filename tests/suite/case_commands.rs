//! Commands that need no run, executed with the binary.

use assert_cmd::Command;
use serde_json::Value;
use std::path::PathBuf;

fn solver() -> Command {
    let mut command = Command::cargo_bin("solver").expect("the binary");
    for rank in [
        "OMPI_COMM_WORLD_RANK",
        "OMPI_COMM_WORLD_SIZE",
        "PMIX_RANK",
        "PMI_RANK",
        "SLURM_PROCID",
    ] {
        command.env_remove(rank);
    }
    command
}

fn example(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    let output = solver().args(["example", name]).output().unwrap();
    assert!(output.status.success());
    let path = folder.path().join(format!("{name}.json"));
    std::fs::write(&path, output.stdout).unwrap();
    path
}

fn plan(path: &PathBuf, more: &[&str]) -> Value {
    let output = solver()
        .arg("plan")
        .arg(path)
        .arg("--json")
        .args(more)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn set_changes_any_field_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "piping");
    let before = plan(&path, &[]);
    let after = plan(
        &path,
        &[
            "--set",
            "time.end=0.6",
            "--set",
            "title=another title",
            "--set",
            "probes[0].every=0.004",
            "--set",
            "contact.cohesive_frictional.cohesion.per_diameter=1.27",
            "--set",
            "probes[1]={\"name\": \"p\", \"every\": 0.01, \"at\": {\"point\": {\"position\": [0.001, 0.002]}}}",
        ],
    );
    assert_eq!(before["clock"]["steps"], 96000);
    assert_eq!(after["clock"]["steps"], 4800);
    assert_eq!(after["scene"]["title"], "another title");
    assert_eq!(after["scene"]["probes"][0]["every"], 0.004);
    assert_eq!(after["scene"]["probes"][1]["name"], "p");
    let cohesion = "contact.cohesive_frictional.cohesion.per_diameter";
    assert_eq!(before["sources"][cohesion]["source"], "paper");
    assert_eq!(after["sources"][cohesion]["source"], "command line");
    assert_ne!(before["case_hash"], after["case_hash"]);
    assert_eq!(before["case_hash"], plan(&path, &[])["case_hash"]);
}

#[test]
fn a_value_with_a_source_is_the_same_case_as_the_bare_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "couette");
    let bare = plan(&path, &[]);
    let annotated = plan(
        &path,
        &[
            "--set",
            r#"fluid.lattice_boltzmann.density={"value": 1000, "source": "assumed", "note": "water"}"#,
        ],
    );
    let density = "fluid.lattice_boltzmann.density";
    assert_eq!(bare["case_hash"], annotated["case_hash"]);
    assert_eq!(annotated["sources"][density]["source"], "assumed");
    assert_eq!(annotated["sources"][density]["note"], "water");
    let output = solver()
        .arg("plan")
        .arg(&path)
        .args([
            "--set",
            r#"fluid.lattice_boltzmann.density={"value": 1000, "source": "a handbook"}"#,
        ])
        .output()
        .unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("a handbook"));
}

#[test]
fn exit_codes_tell_usage_case_and_file_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "couette");
    solver().assert().code(2);
    solver().arg("--help").assert().code(0);
    solver().arg("--version").assert().code(0);
    solver().arg("schema").assert().code(0);
    solver().args(["schema", "study"]).assert().code(0);
    solver().arg("example").assert().code(0);
    solver().args(["example", "pipping"]).assert().code(2);
    solver().arg("validate").arg(&path).assert().code(0);
    solver()
        .arg("validate")
        .arg(folder.path().join("none.json"))
        .assert()
        .code(5);
    solver()
        .arg(folder.path().join("none.json"))
        .assert()
        .code(5);
    solver()
        .arg("validate")
        .arg(&path)
        .args(["--set", "nothing"])
        .assert()
        .code(2);
    solver()
        .arg(&path)
        .args(["--max-walltime", "soon"])
        .assert()
        .code(2);
    solver()
        .arg(&path)
        .args(["--threads", "0"])
        .assert()
        .code(2);
    solver()
        .arg("validate")
        .arg(&path)
        .arg("--unknown")
        .assert()
        .code(2);
    let binary = folder.path().join("binary.json");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    solver().arg("validate").arg(&binary).assert().code(3);
}

/// Checks that `--json` gives JSON with the fields of other findings if the case is a folder or does not exist.
#[test]
fn a_file_that_cannot_be_read_is_a_finding_in_json() {
    let folder = tempfile::tempdir().unwrap();
    for file in [folder.path().to_owned(), folder.path().join("none.json")] {
        for command in ["validate", "plan"] {
            let done = solver()
                .arg(command)
                .arg(&file)
                .arg("--json")
                .assert()
                .code(5);
            let tree: Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
            assert_eq!(tree["verdict"], "refused", "{tree}");
            assert_eq!(
                (&tree["valid"], &tree["exit_code"]),
                (&false.into(), &5.into()),
                "{tree}"
            );
            let finding = &tree["findings"][0];
            for field in ["path", "value", "reason", "remedy", "severity"] {
                assert!(finding[field].is_string(), "{field}: {tree}");
            }
        }
    }
}

/// Checks that a case that is not UTF-8 has a finding, as JSON on request: UTF-16 with its mark, and Latin-1.
#[test]
fn a_case_in_another_encoding_has_a_finding() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.json");
    let wide: Vec<u8> = "\u{feff}{\"title\": \"a\"}"
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let latin = b"{\"title\": \"gr\xfcn\"}".to_vec();
    for (bytes, named) in [(wide, "UTF-16"), (latin, "from byte 13 on")] {
        std::fs::write(&path, bytes).unwrap();
        for command in ["validate", "plan"] {
            let output = solver().arg(command).arg(&path).arg("--json").output();
            let output = output.unwrap();
            assert_eq!(output.status.code(), Some(3), "{output:?}");
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(report["verdict"], "refused");
            let findings = report["findings"].as_array().unwrap();
            assert_eq!(findings.len(), 1, "{report}");
            let reason = findings[0]["reason"].as_str().unwrap();
            assert!(reason.contains(named), "{reason}");
        }
        let output = solver().arg("validate").arg(&path).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains("UTF-8") && told.contains(named), "{told}");
    }
}

#[test]
fn only_the_first_rank_speaks() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "couette");
    // A rank without a number of ranks is left over from the job of a shell.
    for (rank, size, silent) in [
        ("0", "2", false),
        ("1", "2", true),
        ("1", "", false),
        ("1", "1", false),
    ] {
        let output = solver()
            .env("OMPI_COMM_WORLD_RANK", rank)
            .env("OMPI_COMM_WORLD_SIZE", size)
            .env("PMIX_SERVER_URI2", "1.0;tcp4://127.0.0.1:9")
            .arg(&path)
            .args(["--set", "time.end=-1"])
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(3));
        assert_eq!(output.stderr.is_empty(), silent);
    }
}

#[test]
fn problems_are_json_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "couette");
    let output = solver()
        .arg("validate")
        .arg(&path)
        .args(["--json", "--set", "time.end=-1", "--set", "domain.spcing=1"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["verdict"], "refused");
    assert_eq!(report["valid"], false);
    assert_eq!(report["exit_code"], 3);
    let paths: Vec<&str> = report["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["path"].as_str().unwrap())
        .collect();
    assert!(
        paths.contains(&"time.end") && paths.contains(&"domain.spcing"),
        "{paths:?}"
    );
}

#[test]
fn the_example_list_names_every_example() {
    let output = solver().args(["example", "--json"]).output().unwrap();
    let list: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(list[0]["name"], "piping");
    assert_eq!(
        list.as_array().unwrap().len(),
        solver::case::examples::EXAMPLES.len()
    );
}

/// Lid-driven flow at a cell Reynolds number at which runs failed.
const UNSTABLE: [&str; 2] = ["--set", "fluid.lattice_boltzmann.kinematic_viscosity=2e-8"];

#[test]
fn a_case_has_one_verdict_and_an_unstable_one_runs_only_where_this_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "cavity");
    let call = |command: &str, more: &[&str]| {
        let mut call = solver();
        call.arg(command).arg(&path).args(more).current_dir(&folder);
        let output = call.output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        let (said, complained) = (text(output.stdout), text(output.stderr));
        (output.status.code(), said, complained)
    };
    let (code, said, complained) = call("validate", &[]);
    assert_eq!(
        (code, complained.as_str()),
        (Some(0), ""),
        "a valid case says nothing else"
    );
    assert_eq!(said, format!("{}: valid\n", path.display()));
    for command in ["validate", "plan", "run"] {
        let (code, said, complained) = call(command, &UNSTABLE);
        assert_eq!(code, Some(3), "{command}: {complained}");
        let verdict = format!("{}: unstable, 1 unstable finding", path.display());
        let all = said.clone() + &complained;
        assert_eq!(all.matches(&verdict).count(), 1, "{command}: {all}");
        assert!(!all.contains(": valid"), "{command}: {all}");
        assert!(all.contains("--allow-unstable"), "{command}: {all}");
        assert_eq!(said.contains("limits"), command != "validate", "{said}");
    }
    let allowed = [&UNSTABLE[..], &["--allow-unstable"]].concat();
    for command in ["validate", "plan"] {
        assert_eq!(call(command, &allowed).0, Some(0), "{command}");
    }
    let short = [&allowed[..], &["--set", "time.end=1e-3"]].concat();
    let (code, said, complained) = call("run", &short);
    assert_eq!(code, Some(0), "{said} {complained}");
    assert_eq!(said.matches(": unstable, ").count(), 1, "{said}");
    let (code, said, _) = call("validate", &[&UNSTABLE[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(code, Some(3));
    assert_eq!(report["verdict"], "unstable");
    assert_eq!(report["exit_code"], 3);
    assert_eq!(report["valid"], false);
    let finding = &report["findings"][0];
    assert_eq!(finding["severity"], "unstable");
    for field in ["path", "value", "reason", "remedy"] {
        assert!(finding[field].is_string(), "{field}: {finding}");
    }
    let (_, said, _) = call("plan", &[&UNSTABLE[..], &["--json"]].concat());
    let plan: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(plan["verdict"], "unstable");
}

#[test]
fn an_unstable_run_goes_on_only_where_this_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    // For two discs in a short collision, a time step that would be unstable for a dense packing is sufficient.
    let path = example(&folder, "collision");
    let output = folder.path().join("run");
    let run = |more: &[&str]| {
        let mut run = solver();
        run.arg(&path).arg("--output").arg(&output).args(more);
        run.args(["--set", "time.solid_time_step_safety=0.8"]);
        run.args([
            "--set",
            "time.end=1e3",
            "--set",
            "output={}",
            "--set",
            "probes=[]",
        ]);
        run.args(["--threads", "1", "--max-walltime", "0:00:01"]);
        run.assert()
    };
    run(&[]).code(3);
    assert!(!output.exists());
    run(&["--allow-unstable"]).code(75);
    for (more, code) in [(&[][..], 3), (&["--allow-unstable"][..], 75)] {
        let mut restart = solver();
        restart.arg("restart").arg(&output).args(more);
        restart.args(["--threads", "1", "--max-walltime", "0:00:01"]);
        restart.assert().code(code);
    }
}

#[test]
fn the_reference_is_written_in_both_formats() {
    let folder = tempfile::tempdir().unwrap();
    for (format, first) in [("html", "index.html"), ("markdown", "index.md")] {
        let pages = folder.path().join(format);
        let output = solver()
            .args(["reference", "--format", format, "--output"])
            .arg(&pages)
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(said.contains(first), "{said}");
        let text = std::fs::read_to_string(pages.join(first)).unwrap();
        assert!(text.contains("fluid"), "{text}");
        assert!(std::fs::read_dir(&pages).unwrap().count() > 10);
    }
    let output = solver()
        .args(["reference", "--output"])
        .arg(folder.path().join("html/index.html/below"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(5), "{output:?}");
}

/// Checks that the papers of a case name its models, each publication once, with DOI, and that BibTeX has the same
/// keys.
#[test]
fn cite_lists_the_papers_of_the_models_of_a_case() {
    let folder = tempfile::tempdir().unwrap();
    let path = example(&folder, "piping");
    let cite = |more: &[&str]| {
        let output = solver().arg("cite").arg(&path).args(more).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let text = cite(&[]);
    let (models, papers) = text.split_once("\n\n").unwrap();
    assert!(models.contains("contact: cohesive frictional"), "{models}");
    assert!(models.contains("collision: "), "{models}");
    assert!(papers.contains("doi:10.1017/S0022112094001771"), "{papers}");
    let keys: Vec<&str> = papers
        .lines()
        .map(|line| line.split_once(']').unwrap().0.trim_start_matches('['))
        .collect();
    assert!(keys.len() > 5);
    let bibtex = cite(&["--format", "bibtex"]);
    let entries = bibtex.lines().filter_map(|line| line.strip_prefix('@'));
    let entries: Vec<&str> = entries
        .map(|line| line.split_once('{').unwrap().1.trim_end_matches(','))
        .collect();
    assert_eq!(entries, keys);
    assert_eq!(bibtex.matches('{').count(), bibtex.matches('}').count());

    let json: Value = serde_json::from_str(&cite(&["--json"])).unwrap();
    assert!(
        json.as_array()
            .unwrap()
            .iter()
            .all(|c| !c["publications"].as_array().unwrap().is_empty())
    );
    let changed = cite(&[
        "--set",
        "contact={\"linear\": {\"friction_angle_degrees\": 20}}",
        "--set",
        "grains.bond_at_start=false",
    ]);
    assert!(changed.contains("contact: linear"), "{changed}");

    let broken = solver()
        .arg("cite")
        .arg(&path)
        .args(["--set", "time.end=-1"])
        .output()
        .unwrap();
    assert_eq!(broken.status.code(), Some(3), "{broken:?}");
}
