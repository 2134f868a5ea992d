//! Reads the sources and checks the dependencies between packages and modules, and the places of unsafe code.
//!
//! `src/ARCHITECTURE.md` shows the dependencies (section Modules). The compiler enforces those between packages;
//! the table [`PACKAGES`] lists each of them, so that a new one is deliberate, and [`MODULES`] those between the
//! modules of one package.
//!
//! It reads the code without comments, strings and the part after the first `#[cfg(test)]`; test files are omitted.

use std::collections::BTreeSet;
use std::path::Path;

/// Maximum number of lines of a file without its tests.
const LONGEST: usize = 950;

/// Packages with their dependencies in this repository; tests may use others.
const PACKAGES: &[(&str, &[&str])] = &[
    ("base", &[]),
    ("structure", &["base"]),
    ("dem", &["base", "decomposition"]),
    ("darcy", &["base", "decomposition", "structure"]),
    ("lbm", &["base", "decomposition"]),
    ("joints", &["base", "decomposition", "dem"]),
    (
        "coupling",
        &[
            "base",
            "darcy",
            "decomposition",
            "dem",
            "joints",
            "lbm",
            "structure",
        ],
    ),
    // The parameters of a model are defined with its formula.
    (
        "case",
        &["base", "darcy", "dem", "joints", "lbm", "structure"],
    ),
    ("analysis", &["base", "io"]),
    ("figures", &["analysis", "base", "io"]),
    // The plan uses the formulas of the models: stiffness of contacts, drag coefficients, eigenvalues.
    (
        "plan",
        &[
            "base",
            "case",
            "darcy",
            "dem",
            "io",
            "joints",
            "lbm",
            "structure",
        ],
    ),
    (
        "output",
        &[
            "base",
            "case",
            "coupling",
            "darcy",
            "decomposition",
            "dem",
            "io",
            "lbm",
            "plan",
        ],
    ),
    // The engine of the grains makes packings and depositions.
    (
        "preparation",
        &["base", "case", "decomposition", "dem", "io", "plan"],
    ),
    (
        "simulation",
        &[
            "analysis",
            "base",
            "case",
            "coupling",
            "darcy",
            "decomposition",
            "dem",
            "figures",
            "io",
            "joints",
            "lbm",
            "output",
            "plan",
            "preparation",
            "structure",
        ],
    ),
    // The models varied by an estimate are named by their types.
    (
        "studies",
        &[
            "analysis",
            "base",
            "case",
            "darcy",
            "decomposition",
            "figures",
            "io",
            "output",
            "plan",
            "simulation",
        ],
    ),
    (
        "cli",
        &[
            "base",
            "case",
            "figures",
            "io",
            "output",
            "plan",
            "simulation",
            "studies",
        ],
    ),
];

/// Modules of packages with several parts, and the modules of their package that they may use.
const MODULES: &[(&str, &[&str])] = &[
    ("src/plan/scene", &["scene"]),
    ("src/studies/sweep", &["sweep"]),
    ("src/studies/uncertainty", &["sweep", "uncertainty"]),
    ("src/studies/threshold", &["section", "sweep", "threshold"]),
    (
        "src/studies/critical_gradient",
        &["critical_gradient", "section"],
    ),
    ("src/studies/section", &["section"]),
];

/// Files with `unsafe`: MPI datatypes, calls of HDF5 and of the operating system, memory, vector lanes, data shared
/// by threads, and the environment before there are threads.
const UNSAFE: &[&str] = &[
    "src/main.rs",
    "src/base/environment.rs",
    "src/base/allocator.rs",
    "src/base/thread_pool.rs",
    "src/base/thread_pool/board.rs",
    "src/base/thread_pool/sync.rs",
    "decomposition/",
    "io/",
    "src/lbm/",
];

/// Returns the code with comments and strings blanked out and tests removed; line breaks are kept.
pub(crate) fn code_of(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '/' if rest.peek() == Some(&'/') => {
                for c in rest.by_ref() {
                    if c == '\n' {
                        code.push('\n');
                        break;
                    }
                }
            }
            '"' => {
                let mut escaped = false;
                for c in rest.by_ref() {
                    if c == '\n' {
                        code.push('\n');
                    }
                    if c == '"' && !escaped {
                        break;
                    }
                    escaped = c == '\\' && !escaped;
                }
            }
            '\'' => {
                // A quote begins a character, unless it is a lifetime.
                let mut ahead = rest.clone();
                match (ahead.next(), ahead.next()) {
                    (Some('\\'), _) => {
                        rest.next();
                        rest.next();
                        for c in rest.by_ref() {
                            if c == '\'' {
                                break;
                            }
                        }
                    }
                    (Some(_), Some('\'')) => {
                        rest.next();
                        rest.next();
                    }
                    _ => code.push('\''),
                }
            }
            c => code.push(c),
        }
    }
    match code.find("#[cfg(test)]") {
        Some(end) => code[..end].to_owned(),
        None => code,
    }
}

/// Returns the words of the code with the texts before and after them.
fn words(code: &str) -> impl Iterator<Item = (&str, &str, &str)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at + code[at..].find(is_word)?;
        let end = code[start..]
            .find(|c| !is_word(c))
            .map_or(code.len(), |n| start + n);
        at = end;
        Some((&code[..start], &code[start..end], &code[end..]))
    })
}

/// Returns the modules named as `crate::x` or in `crate::{x, y::z}`.
fn modules_named(code: &str) -> BTreeSet<String> {
    let mut named = BTreeSet::new();
    for (_, _, after) in words(code).filter(|(_, word, _)| *word == "crate") {
        let Some(path) = after.strip_prefix("::") else {
            continue;
        };
        if let Some(list) = path.strip_prefix('{') {
            // First words of the list entries, at depth one.
            let (mut depth, mut fresh) = (0, true);
            for (before, word, _) in words(list) {
                let between = &before[before
                    .rfind(|c: char| c.is_alphanumeric() || c == '_')
                    .map_or(0, |n| n + 1)..];
                for c in between.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        ',' if depth == 0 => fresh = true,
                        _ => {}
                    }
                }
                if depth < 0 {
                    break;
                }
                if depth == 0 && fresh {
                    named.insert(word.to_owned());
                }
                fresh = false;
            }
        } else if let Some((_, word, _)) = words(path).next() {
            // A function or type at the root of a package has no module.
            if path.starts_with(word) {
                named.insert(word.to_owned());
            }
        }
    }
    named
}

/// Returns the faults of one file.
fn complaints(path: &str, text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    let code = code_of(text);
    let lines = code.lines().count();
    if lines > LONGEST {
        wrong.push(format!("{path}: {lines} lines, more than {LONGEST}"));
    }
    let within = |place: &&(&str, &[&str])| {
        let below = path.strip_prefix(place.0);
        below.is_some_and(|below| below.starts_with(['/', '.']))
    };
    if let Some((_, modules)) = MODULES.iter().find(within) {
        for module in modules_named(&code) {
            if !modules.contains(&module.as_str()) {
                wrong.push(format!("{path}: may not use the module {module}"));
            }
        }
    }
    let speaks = path.starts_with("src/cli/") || path.contains("/bin/") || path == "src/build.rs";
    for (before, word, after) in words(&code) {
        let line = || before.lines().count().max(1);
        match word {
            "unsafe" if !UNSAFE.iter().any(|place| path.starts_with(place)) => {
                wrong.push(format!("{path}:{}: unsafe outside its places", line()));
            }
            "println" | "eprintln" | "print" | "eprint" | "dbg"
                if after.starts_with('!') && !speaks =>
            {
                wrong.push(format!("{path}:{}: {word}! outside cli", line()));
            }
            "todo" | "unimplemented" if after.starts_with('!') => {
                wrong.push(format!("{path}:{}: {word}!", line()));
            }
            _ => {}
        }
    }
    wrong
}

/// Returns the packages of this repository among the dependencies of a manifest, in alphabetical order.
fn dependencies(manifest: &str) -> Vec<&str> {
    let section = manifest.split("[dependencies]").nth(1).unwrap_or_default();
    let lines = section.lines().take_while(|line| !line.starts_with('['));
    let here = lines.filter(|line| line.contains("path = "));
    let mut names: Vec<&str> = here.filter_map(|line| line.split(" = ").next()).collect();
    names.sort_unstable();
    names
}

/// Returns `true` if the doc comments of a source contain code that a doc test runs: a block without the mark of
/// another language.
fn has_doc_tests(text: &str) -> bool {
    let docs = text.lines().filter_map(|line| {
        let line = line.trim_start();
        line.strip_prefix("///").or(line.strip_prefix("//!"))
    });
    let fences = docs.filter_map(|line| line.trim().strip_prefix("```"));
    fences
        .step_by(2)
        .any(|mark| !matches!(mark, "text" | "json"))
}

/// Collects all sources below a folder, without tests.
pub(crate) fn sources(root: &Path, folder: &str, all: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(root.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let path = format!("{folder}/{name}");
        if entry.file_type().unwrap().is_dir() {
            if name != "tests" {
                sources(root, &path, all);
            }
        } else if name.ends_with(".rs") && name != "tests.rs" && name != "build.rs" {
            all.push((path, std::fs::read_to_string(entry.path()).unwrap()));
        }
    }
}

#[test]
fn packages_depend_on_those_of_the_table_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = |folder: &str| {
        let path = root.join(folder).join("Cargo.toml");
        std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    };
    for (package, known) in PACKAGES {
        let text = manifest(&format!("src/{package}"));
        assert_eq!(dependencies(&text), *known, "src/{package}/Cargo.toml");
    }
    for package in ["decomposition", "io"] {
        assert_eq!(dependencies(&manifest(package)), [""; 0], "{package}");
    }
    // The list contains every folder.
    for entry in std::fs::read_dir(root.join("src")).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let folder = entry.file_type().unwrap().is_dir();
        assert!(
            !folder || PACKAGES.iter().any(|(package, _)| *package == name),
            "src/{name} is not in the table of packages"
        );
    }
}

/// Packages without code in their doc comments start no doc tests, which each read the whole package.
#[test]
fn packages_run_doc_tests_where_they_have_some() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = PACKAGES.iter().map(|(package, _)| format!("src/{package}"));
    for folder in folders.chain(["decomposition", "io"].map(str::to_owned)) {
        let path = root.join(&folder).join("Cargo.toml");
        let manifest = std::fs::read_to_string(path).unwrap();
        let mut all = Vec::new();
        sources(root, &folder, &mut all);
        let found = all.iter().find(|(_, text)| has_doc_tests(text));
        assert_eq!(
            found.is_some(),
            !manifest.contains("doctest = false"),
            "{folder}: {:?}",
            found.map(|(path, _)| path)
        );
    }
    assert!(has_doc_tests(
        "/// A sum.\n///\n/// ```\n/// f();\n/// ```\n"
    ));
    assert!(has_doc_tests(
        "//! ```text\n//! ```\n//! ```no_run\n//! ```\n"
    ));
    assert!(!has_doc_tests("/// ```text\n/// x\n/// ```\n// ```\n"));
}

#[test]
fn sources_keep_the_rules_of_the_house() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    for folder in ["src", "decomposition/src", "io/src"] {
        sources(root, folder, &mut all);
    }
    assert!(all.len() > 80, "only {} sources found", all.len());
    let wrong: Vec<String> = all
        .iter()
        .flat_map(|(path, text)| complaints(path, text))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn faults_are_found() {
    let long = "\n".repeat(LONGEST + 1);
    for (path, text, found) in [
        (
            "src/plan/scene/speed.rs",
            "use crate::envelope::margins;",
            "may not use the module envelope",
        ),
        (
            "src/plan/scene.rs",
            "use crate::{scene::grid, models::{a, b}};",
            "may not use the module models",
        ),
        (
            "src/studies/sweep/runner.rs",
            "fn f() { crate::uncertainty::grids(); }",
            "may not use the module uncertainty",
        ),
        (
            "src/dem/engine.rs",
            "\nlet x = unsafe { *p };",
            "src/dem/engine.rs:2: unsafe",
        ),
        (
            "src/plan/lib.rs",
            "println!(\"a\");",
            "println! outside cli",
        ),
        ("src/plan/lib.rs", "fn f() { todo!() }", "todo!"),
        ("src/plan/lib.rs", &long, "more than"),
    ] {
        let wrong = complaints(path, text);
        assert!(
            wrong.iter().any(|line| line.contains(found)),
            "{path}: {text:?} gave {wrong:?}, not {found:?}"
        );
    }
    let manifest = "[dependencies]\nlbm = { path = \"../lbm\" }\nlog = \"0.4\"\nbase = { path = \"../base\" }\n\n\
        [dev-dependencies]\ndem = { path = \"../dem\" }\n";
    assert_eq!(dependencies(manifest), ["base", "lbm"]);
}

#[test]
fn sound_code_has_no_faults() {
    for (path, text) in [
        (
            "src/plan/scene/speed.rs",
            "// crate::envelope is another room\nuse crate::scene::grid; use case::Case;",
        ),
        (
            "src/plan/scene/speed.rs",
            "let text = \"crate::envelope \\\" println!\"; let c = '\"'; use base::error::Error;",
        ),
        (
            "src/lbm/kernel.rs",
            "unsafe { pass() }; use std::io::Write; fn f<'a>(x: &'a str) {}",
        ),
        ("src/cli/lib.rs", "println!(\"a\"); use simulation::run;"),
        (
            "src/plan/scene/grains.rs",
            "#[cfg(test)]\nmod tests { use crate::Plan; }",
        ),
        ("src/main.rs", "use solver::cli;"),
    ] {
        assert_eq!(
            complaints(path, text),
            Vec::<String>::new(),
            "{path}: {text}"
        );
    }
}
