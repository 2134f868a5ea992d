//! Wrong usage is reported in one sentence with exit code 2; text of a file is never interpreted as a command by a
//! terminal or a script; information about the program itself.

use assert_cmd::Command;
use serde_json::Value;
use std::process::Output;

fn solver(arguments: &[&str]) -> Output {
    let mut command = Command::cargo_bin("solver").expect("the binary");
    for rank in [
        "OMPI_COMM_WORLD_RANK",
        "PMIX_RANK",
        "PMI_RANK",
        "SLURM_PROCID",
        "SOLVER",
    ] {
        command.env_remove(rank);
    }
    command.args(arguments).output().unwrap()
}

/// Returns the exit code and the text written to the standard error.
fn refused(arguments: &[&str]) -> (Option<i32>, String) {
    let output = solver(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!errors.contains('\u{1b}'), "{errors:?}");
    (output.status.code(), errors)
}

/// Returns the output of a command that succeeds.
fn written(arguments: &[&str]) -> String {
    let output = solver(arguments);
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_word_that_is_nothing_is_an_error_of_usage() {
    let (code, errors) = refused(&["frobnicate"]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(
        errors.contains("there is no command or file `frobnicate`"),
        "{errors}"
    );
    let (code, errors) = refused(&["restrat", "results/x"]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("did you mean `restart`?"), "{errors}");
    // A possible file name is reported as a file that cannot be read.
    assert_eq!(refused(&["frobnicate.json"]).0, Some(5));
    let (code, errors) = refused(&["example", "pipping"]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("did you mean `piping`?"), "{errors}");
    for threads in ["0", "1025", "65535"] {
        let (code, errors) = refused(&["run", "none.json", "--threads", threads]);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains("1 to 1024 threads"), "{errors}");
    }
}

#[test]
fn control_characters_are_refused_with_their_path() {
    let folder = tempfile::tempdir().unwrap();
    let text = written(&["example", "couette"]);
    let mut case: Value = serde_json::from_str(&text).unwrap();
    case["title"] = "\u{1b}]0;owned\u{7}\u{9b}31m".into();
    let path = folder.path().join("case.json");
    std::fs::write(&path, case.to_string()).unwrap();
    let path = path.to_str().unwrap();
    for command in ["validate", "plan", "run"] {
        let (code, errors) = refused(&[command, path]);
        assert_eq!(code, Some(3), "{errors}");
        assert!(errors.contains("error: title = "), "{errors}");
        assert!(errors.contains("control character U+001B"), "{errors}");
        assert!(!errors.contains('\u{9b}'), "{errors:?}");
    }
    let report = solver(&["validate", path, "--json"]);
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    assert_eq!(report["valid"], false);
    assert_eq!(report["findings"][0]["path"], "title");
    // A value in a message, which JSON does not escape.
    let (code, errors) = refused(&["validate", path, "--set", "time.end=\u{9b}2J"]);
    assert_eq!(code, Some(3), "{errors}");
    assert!(
        errors.contains(r"time.end = ") && errors.contains(r"\u009b2J"),
        "{errors}"
    );
    assert!(!errors.contains('\u{9b}'), "{errors:?}");
}

#[test]
fn a_line_break_in_the_name_of_a_study_is_no_command() {
    let folder = tempfile::tempdir().unwrap();
    let study = written(&["example", "sweep"]);
    let case = written(&["example", "couette"]);
    for name in ["couette", "channel"] {
        std::fs::write(folder.path().join(format!("{name}.json")), &case).unwrap();
    }
    let path = folder.path().join("a\ntouch owned\n.json");
    std::fs::write(&path, &study).unwrap();
    let output = solver(&["sweep", path.to_str().unwrap(), "--slurm"]);
    let script = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    assert!(!script.contains("touch"), "{script}");
    let mut tree: Value = serde_json::from_str(&study).unwrap();
    tree["title"] = "x\nrm -rf y".into();
    let path = folder.path().join("study.json");
    std::fs::write(&path, tree.to_string()).unwrap();
    let (code, errors) = refused(&["sweep", path.to_str().unwrap(), "--list"]);
    assert_eq!(code, Some(3), "{errors}");
    assert!(errors.contains("title = \"x\\nrm"), "{errors}");
}

#[test]
fn restart_names_a_damaged_case() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.json");
    let text = written(&["example", "couette"]);
    std::fs::write(&path, &text[..text.len() / 2]).unwrap();
    let (code, errors) = refused(&["restart", folder.path().to_str().unwrap()]);
    assert_eq!(code, Some(3), "{errors}");
    let named = format!("{}: line ", path.display());
    assert!(errors.contains(&named), "{errors}");
}

#[test]
fn the_version_says_what_the_program_is_made_of() {
    let short = written(&["-V"]);
    assert_eq!(short.lines().count(), 1, "{short}");
    let long = written(&["--version"]);
    assert_eq!(long.lines().next(), short.lines().next());
    for start in [
        "MPI       MPI ",
        "HDF5      ",
        "features  mpio",
        "lanes     ",
        "profile   ",
    ] {
        assert!(
            long.lines().any(|line| line.starts_with(start)),
            "{start}: {long}"
        );
    }
    let hdf5 = long.lines().find(|line| line.starts_with("HDF5")).unwrap();
    assert_eq!(hdf5.matches('.').count(), 2, "{hdf5}");
}

#[test]
fn completions_and_the_manual_page_name_every_command() {
    let help = written(&["--help"]);
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(commands.len() >= 13, "{commands:?}");
    let mut texts: Vec<String> = ["bash", "zsh", "fish"]
        .iter()
        .map(|shell| written(&["completions", shell]))
        .collect();
    texts.push(written(&["man"]).replace("\\-", "-").to_lowercase());
    for text in &texts {
        for command in &commands {
            assert!(text.contains(command), "{command}: {text}");
        }
    }
    assert_eq!(refused(&["completions", "cmd"]).0, Some(2));
}

/// Checks that a jet erosion test needs its complete apparatus, and gives the law in customary units.
#[test]
fn the_law_of_a_jet_comes_from_its_record() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("specimen.csv");
    // Distances of tau_c = 2 Pa and k_d = 1 cm3/(N s) under a nozzle of a quarter inch and a head of 0.6 m.
    let rows = "0,0.06\n1446.6,0.08\n4080,0.1\n8597,0.12\n22103.6,0.15\n59810.8,0.18\n";
    std::fs::write(&table, format!("time,distance\n{rows}")).unwrap();
    let (table, output) = (table.to_str().unwrap(), folder.path().to_str().unwrap());
    let (code, errors) = refused(&["erosion-law", table, "--nozzle", "0.00635"]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("--head"), "{errors}");
    let jet = ["erosion-law", table, "--nozzle", "0.00635", "--head", "1"];
    for (option, value) in [
        ("--nozzle", "0"),
        ("--nozzle", "-1"),
        ("--nozzle", "1e300"),
        ("--head", "-0.6"),
        ("--head", "inf"),
        ("--water-density", "-1000"),
        ("--water-density", "1"),
        ("--jet-friction", "NaN"),
        ("--jet-friction", "6"),
        ("--jet-core", "-6.3"),
        ("--bulk-density", "1.6"),
        ("--published", "-1,2,3"),
    ] {
        let mut arguments: Vec<&str> = jet.into();
        match arguments.iter().position(|word| *word == option) {
            Some(at) => arguments[at + 1] = value,
            None => arguments.extend([option, value]),
        }
        let (code, errors) = refused(&arguments);
        assert_eq!(code, Some(2), "{errors}");
        let named = format!("invalid value '{value}' for '{option}");
        assert!(errors.contains(&named), "{errors}");
    }
    // A number of any command is named with its option.
    let (code, errors) = refused(&["run", "case.json", "--threads", "-1"]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("'-1' for '--threads"), "{errors}");
    let jet = ["--nozzle", "0.00635", "--head", "0.6", "--output", output];
    let words = written(&[["erosion-law", table].as_slice(), &jet].concat());
    assert!(words.contains("k_d of the law: 1.00 cm3/(N s)"), "{words}");
    assert!(words.contains("2.00 ["), "{words}");
    assert!(folder.path().join("jet_erosion.svg").exists());
}
