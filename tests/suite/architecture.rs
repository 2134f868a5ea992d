//! Reads the sources and checks who may use whom, and where dangerous code may stand.
//!
//! `src/ARCHITECTURE.md` draws the dependencies (section Modules); the table [`ROOMS`] states each of them.
//!
//! Looked at is the code without comments, strings and what follows the first `#[cfg(test)]`; files of tests are left
//! out.

use std::collections::BTreeSet;
use std::path::Path;

/// The longest a file may be, its tests apart [lines].
const LONGEST: usize = 950;

/// Modules that every module may use.
const EVERYBODYS: &[&str] = &["error", "family", "number"];

/// A module at the root: the modules and the crates besides std that it may name.
const ROOMS: &[(&str, &[&str], &[&str])] = &[
    (
        "main",
        &["allocator", "cli", "environment", "provenance"],
        &[],
    ),
    (
        "cli",
        &[
            "case",
            "critical_gradient",
            "figures",
            "output",
            "plan",
            "provenance",
            "simulation",
            "sweep",
            "uncertainty",
        ],
        &["io"],
    ),
    (
        "critical_gradient",
        &["analysis", "case", "darcy", "plan", "scene", "simulation"],
        &["decomposition", "io"],
    ),
    (
        "sweep",
        &[
            "analysis", "case", "figures", "output", "plan", "random", "scene",
        ],
        &["io"],
    ),
    // The models that an estimate varies are named by their types.
    (
        "uncertainty",
        &["case", "darcy", "plan", "scene", "sweep", "units"],
        &["io"],
    ),
    (
        "simulation",
        &[
            "analysis",
            "case",
            "checkpoint",
            "coupling",
            "darcy",
            "dem",
            "figures",
            "lbm",
            "output",
            "plan",
            "preparation",
            "provenance",
            "random",
            "scene",
            "structure",
            "units",
        ],
        &["decomposition", "io"],
    ),
    (
        "output",
        &[
            "case", "coupling", "darcy", "dem", "lbm", "plan", "scene", "units",
        ],
        &["decomposition", "io"],
    ),
    (
        "checkpoint",
        &["darcy", "dem", "lbm", "output"],
        &["decomposition", "io"],
    ),
    ("figures", &["analysis"], &["io"]),
    ("analysis", &["random"], &["io"]),
    // Packings and depositions are made by the engine of the grains.
    (
        "preparation",
        &["case", "dem", "plan", "random", "scene"],
        &["decomposition", "io"],
    ),
    // Shapes of walls and blocks are those of the engine of the grains; models judge their own parameters.
    (
        "scene",
        &[
            "case",
            "coupling",
            "darcy",
            "dem",
            "geometry",
            "lbm",
            "random",
            "structure",
            "units",
        ],
        &["io"],
    ),
    // The plan judges by the formulas of the models themselves: stiffness of contacts, coefficients of drag,
    // eigenvalues of collisions.
    (
        "plan",
        &["case", "coupling", "darcy", "dem", "lbm", "scene", "units"],
        &[],
    ),
    // The kernels of GPUs: the root of a crate of its own, made of files of the lattice.
    ("gpu", &["ball", "lbm"], &[]),
    // The parameters of a model are defined with its formula.
    (
        "case",
        &[
            "coupling",
            "darcy",
            "dem",
            "geometry",
            "lbm",
            "structure",
            "units",
        ],
        &[],
    ),
    (
        "coupling",
        &[
            "ball",
            "thread_pool",
            "darcy",
            "dem",
            "lbm",
            "structure",
            "units",
        ],
        &["decomposition"],
    ),
    // Boundaries and fluctuations convert their own parameters.
    (
        "lbm",
        &[
            "allocator",
            "ball",
            "thread_pool",
            "geometry",
            "random",
            "units",
        ],
        &["decomposition"],
    ),
    ("dem", &["thread_pool", "random"], &["decomposition"]),
    (
        "darcy",
        &["ball", "random", "structure"],
        &["decomposition"],
    ),
    // A shape holds its own parameters.
    ("structure", &["geometry", "random"], &[]),
    ("ball", &[], &[]),
    ("geometry", &[], &[]),
    ("provenance", &[], &[]),
    ("units", &[], &[]),
    ("random", &[], &[]),
    ("thread_pool", &[], &[]),
    ("allocator", &[], &[]),
    ("environment", &[], &[]),
    ("error", &[], &[]),
    ("family", &[], &[]),
    ("number", &[], &[]),
    // The functions of the models that are compiled with them.
    ("instances", &["coupling", "dem", "lbm"], &[]),
    ("lib", &[], &[]),
    // The build script speaks to cargo on its standard output.
    ("build", &[], &[]),
    // The other crates, each one module.
    ("decomposition", &[], &["mpi"]),
    ("io", &[], &["hdf5", "hdf5_sys", "mpi_sys"]),
];

/// Crates of the workspace and what lies beneath them: who names one must be allowed to.
const CRATES: &[&str] = &[
    "decomposition",
    "io",
    "mpi",
    "mpi_sys",
    "hdf5",
    "hdf5_sys",
    "solver",
];

/// Modules with `unsafe`: MPI's datatypes, HDF5's calls and the operating system's, memory, vector lanes, data that
/// threads share.
const UNSAFE: &[&str] = &[
    "allocator",
    "decomposition",
    "gpu",
    "io",
    "lbm",
    "thread_pool",
];

/// Comments and strings blanked out, tests cut off; line breaks stay.
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
                // A character, unless a lifetime.
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

/// Words of the code with what stands before them.
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
            // First words of the list, at depth one.
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
            // A function or type at the root belongs to no module.
            if path.starts_with(word) {
                named.insert(word.to_owned());
            }
        }
    }
    named
}

/// Returns the crates of the workspace named as `x::`, wherever they start a path.
fn crates_named(code: &str) -> BTreeSet<String> {
    words(code)
        .filter(|(before, word, after)| {
            CRATES.contains(word) && after.starts_with("::") && !before.ends_with("::")
        })
        .map(|(_, word, _)| word.to_owned())
        .collect()
}

/// Returns the module at the root that a file belongs to. The models are a package of their own, but their modules are
/// named like the others.
fn room_of(path: &str) -> &str {
    match path.split_once('/') {
        Some(("src", rest)) => {
            let rest = rest.strip_prefix("physics/").unwrap_or(rest);
            let name = rest.split('/').next().unwrap_or(rest);
            name.strip_suffix(".rs").unwrap_or(name)
        }
        Some((krate, _)) => krate,
        None => path,
    }
}

/// Returns the faults of one file.
fn complaints(path: &str, text: &str) -> Vec<String> {
    let room = room_of(path);
    let mut wrong = Vec::new();
    let Some((_, modules, crates)) = ROOMS.iter().find(|(name, ..)| *name == room) else {
        return vec![format!(
            "{path}: the room {room} is not in the table of rooms"
        )];
    };
    let code = code_of(text);
    let lines = code.lines().count();
    if lines > LONGEST {
        wrong.push(format!("{path}: {lines} lines, more than {LONGEST}"));
    }
    // The crates next to `src` are one module each.
    if path.starts_with("src/") {
        let rooms: BTreeSet<&str> = ROOMS.iter().map(|(name, ..)| *name).collect();
        for module in modules_named(&code) {
            let known = rooms.contains(module.as_str());
            let may = module == room
                || EVERYBODYS.contains(&module.as_str())
                || modules.contains(&module.as_str());
            if known && !may {
                wrong.push(format!("{path}: {room} may not use {module}"));
            }
        }
    }
    for krate in crates_named(&code) {
        let own = krate == room || (room == "main" && krate == "solver");
        if !own && !crates.contains(&krate.as_str()) {
            wrong.push(format!("{path}: {room} may not name the crate {krate}"));
        }
    }
    for (before, word, after) in words(&code) {
        let line = || before.lines().count().max(1);
        match word {
            "unsafe" if !UNSAFE.contains(&room) => {
                wrong.push(format!("{path}:{}: unsafe in {room}", line()));
            }
            "println" | "eprintln" | "print" | "eprint" | "dbg"
                if after.starts_with('!')
                    && !["cli", "build"].contains(&room)
                    && !path.contains("/bin/") =>
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

/// Collects all sources below a folder, tests left out.
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
fn the_arrows_hold() {
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
fn what_is_forbidden_is_found() {
    let long = "\n".repeat(LONGEST + 1);
    for (path, text, found) in [
        (
            "src/physics/lbm/kernel.rs",
            "use crate::dem::Particles;",
            "lbm may not use dem",
        ),
        (
            "src/physics/dem.rs",
            "use crate::{error::Error, lbm::{fluid, halo}};",
            "dem may not use lbm",
        ),
        (
            "src/physics/dem.rs",
            "fn f() { crate::scene::grid::count(1); }",
            "dem may not use scene",
        ),
        (
            "src/output/x.rs",
            "use crate::simulation::Simulation;",
            "output may not use simulation",
        ),
        (
            "src/case.rs",
            "use crate::{\n    units::X,\n    plan::Plan,\n};",
            "case may not use plan",
        ),
        (
            "src/physics/lbm.rs",
            "use mpi::traits::*;",
            "may not name the crate mpi",
        ),
        (
            "src/simulation/run.rs",
            "let f = hdf5::File::open(p);",
            "may not name the crate hdf5",
        ),
        (
            "io/src/hdf.rs",
            "use decomposition::Domain;",
            "io may not name the crate decomposition",
        ),
        (
            "io/src/hdf.rs",
            "use mpi::Comm;",
            "io may not name the crate mpi",
        ),
        (
            "decomposition/src/slab.rs",
            "use solver::lbm;",
            "may not name the crate solver",
        ),
        (
            "src/physics/dem/engine.rs",
            "\nlet x = unsafe { *p };",
            "src/physics/dem/engine.rs:2: unsafe in dem",
        ),
        ("src/plan.rs", "println!(\"a\");", "println! outside cli"),
        ("src/plan.rs", "fn f() { todo!() }", "todo!"),
        ("src/attic/a.rs", "", "attic is not in the table"),
        ("src/plan.rs", &long, "more than"),
    ] {
        let wrong = complaints(path, text);
        assert!(
            wrong.iter().any(|line| line.contains(found)),
            "{path}: {text:?} gave {wrong:?}, not {found:?}"
        );
    }
}

#[test]
fn what_is_allowed_is_not() {
    for (path, text) in [
        (
            "src/physics/lbm/kernel.rs",
            "// crate::dem is another room\nuse crate::lbm::lanes;",
        ),
        (
            "src/physics/lbm/kernel.rs",
            "let text = \"crate::dem \\\" println!\"; let c = '\"'; use crate::error::Error;",
        ),
        (
            "src/physics/lbm/kernel.rs",
            "unsafe { pass() }; use std::io::Write; fn f<'a>(x: &'a str) {}",
        ),
        ("src/cli.rs", "println!(\"a\"); use crate::simulation::run;"),
        (
            "src/physics/dem.rs",
            "#[cfg(test)]\nmod tests { use crate::lbm::Fluid; }",
        ),
        (
            "src/physics/coupling.rs",
            "use crate::{dem::{Dem, plan}, lbm::Fluid};",
        ),
        ("io/src/hdf.rs", "use hdf5::File; use crate::group::Group;"),
        ("decomposition/src/comm.rs", "use mpi::traits::*;"),
        ("src/main.rs", "use solver::cli;"),
    ] {
        assert_eq!(
            complaints(path, text),
            Vec::<String>::new(),
            "{path}: {text}"
        );
    }
}
