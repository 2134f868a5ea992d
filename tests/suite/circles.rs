//! Finds cyclic dependencies between files of a crate.
//!
//! There is an arrow from a file to the file that defines a name it uses; names that a file re-exports are followed
//! to their definition. A module and the files below it are one unit, so that arrows between them do not count.
//! Test code is omitted.

use super::architecture::{code_of, sources};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Allowed cycles: each list contains the files of one cycle.
const ALLOWED: &[&[&str]] = &[
    // A drag law may be used as a resistance: the list of resistances contains it, and its file implements both
    // traits.
    &[
        "src/darcy/drag.rs",
        "src/darcy/drag/di_felice.rs",
        "src/darcy/drag/gidaspow.rs",
        "src/darcy/resistance.rs",
        "src/darcy/resistance/ergun.rs",
        "src/darcy/resistance/kozeny_carman.rs",
    ],
];

/// Path of a module: `["dem", "engine"]`.
type Module = Vec<String>;

/// File with the names that it defines, re-exports and uses.
#[derive(Default)]
struct File {
    path: String,
    defined: BTreeSet<String>,
    /// Names that other files may import from here, with the paths they represent.
    exported: BTreeMap<String, Vec<String>>,
    used: Vec<Vec<String>>,
}

/// Collects the paths of a `use` tree: `a::{b, c::d as e}` gives the local name and the whole path of each leaf.
fn leaves(tree: &str, before: &[String], all: &mut Vec<(String, Vec<String>)>) {
    let tree = tree.trim();
    let (head, list) = match tree.find('{') {
        Some(at) => (&tree[..at], tree[at + 1..].strip_suffix('}')),
        None => (tree, None),
    };
    let (head, renamed) = match head.split_once(" as ") {
        Some((path, name)) => (path, Some(name.trim().to_owned())),
        None => (head, None),
    };
    let mut path = before.to_vec();
    let words = head.split("::").map(str::trim).filter(|w| !w.is_empty());
    path.extend(words.map(str::to_owned));
    let Some(list) = list else {
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        if let Some(last) = path.last().cloned() {
            all.push((renamed.unwrap_or(last), path));
        }
        return;
    };
    let (mut depth, mut start) = (0, 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                leaves(&list[start..at], &path, all);
                start = at + 1;
            }
            _ => {}
        }
    }
    if !list[start..].trim().is_empty() {
        leaves(&list[start..], &path, all);
    }
}

/// Reads the code of a module; the first `root` words of the module path are those of its package.
fn read(path: &str, code: &str, module: &Module, root: usize) -> File {
    let mut file = File {
        path: path.to_owned(),
        ..File::default()
    };
    let mut rest = String::new();
    let mut statements = code.split("use ");
    // The text before a `use` determines if it is a statement and if it is public.
    let mut before = statements.next().unwrap_or_default().to_owned();
    rest.push_str(&before);
    for part in statements {
        let last = before.trim_end();
        let begins =
            last.is_empty() || last.ends_with([';', '}', ']', '{', ')']) || last.ends_with("pub");
        if let (true, Some(end)) = (begins, part.find(';')) {
            let mut all = Vec::new();
            leaves(&part[..end].replace('\n', " "), &[], &mut all);
            let public = last.ends_with("pub") || last.ends_with(')');
            for (name, path) in all {
                if public {
                    file.exported.insert(name, path);
                } else {
                    file.used.push(path);
                }
            }
            rest.push_str(&part[end..]);
        } else {
            rest.push_str(part);
        }
        before = part.to_owned();
    }
    // Defined names, and paths inside the code.
    let tokens: Vec<&str> = rest
        .split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':' || c == '!'))
        .filter(|token| !token.is_empty())
        .collect();
    for pair in tokens.windows(2) {
        let word = pair[1].trim_matches(':').to_owned();
        if [
            "struct",
            "enum",
            "trait",
            "fn",
            "const",
            "static",
            "type",
            "mod",
            "macro_rules!",
        ]
        .contains(&pair[0])
        {
            file.defined.insert(word);
        }
    }
    for token in tokens.iter().filter(|token| token.contains("::")) {
        let path: Vec<String> = token.split("::").map(str::to_owned).collect();
        if !path[0].is_empty() {
            file.used.push(path);
        }
    }
    // Full paths of this file, with `super`, `self` and the names of modules at its top resolved.
    let full = |path: &Vec<String>| -> Vec<String> {
        let mut from = module.clone();
        let mut words = path.iter().peekable();
        match words.peek().map(|word| word.as_str()) {
            Some("crate") => {
                from.truncate(root);
                words.next();
            }
            Some("self") => {
                words.next();
            }
            Some("super") => {
                while words.next_if(|word| *word == "super").is_some() {
                    from.pop();
                }
            }
            _ => {}
        }
        from.extend(words.cloned());
        from
    };
    file.used = file.used.iter().map(full).collect();
    for path in file.exported.values_mut() {
        *path = full(path);
    }
    file
}

/// Returns the module of a file below the folder of the crate. The library re-exports the modules of the package
/// `physics` at its own root.
fn module_of(path: &str, folder: &str) -> Module {
    let inside = path.strip_prefix(folder).unwrap_or(path);
    let inside = inside.trim_start_matches('/').trim_end_matches(".rs");
    let words = inside.split('/').filter(|word| *word != "lib");
    words.map(str::to_owned).collect()
}

/// Returns the cycles among files, each in alphabetical order.
fn circles(sources: &[(String, String)], folder: &str) -> Vec<Vec<String>> {
    let files: BTreeMap<Module, File> = sources
        .iter()
        .map(|(path, text)| {
            let module = module_of(path, folder);
            let root = usize::from(folder == "src");
            let file = read(path, &code_of(text), &module, root);
            (module, file)
        })
        .collect();
    // Module that defines the name at the end of a path.
    let definer = |path: &[String]| -> Option<Module> {
        let mut path = path.to_vec();
        // Maximum number of successive re-exports.
        for _ in 0..8 {
            let length = (0..=path.len())
                .rev()
                .find(|n| files.contains_key(&path[..*n]))?;
            let file = &files[&path[..length]];
            let Some(name) = path.get(length) else {
                return Some(path);
            };
            if file.defined.contains(name) {
                return Some(path[..length].to_vec());
            }
            let mut further = file.exported.get(name)?.clone();
            further.extend_from_slice(&path[length + 1..]);
            path = further;
        }
        None
    };
    let related = |a: &Module, b: &Module| a.starts_with(b) || b.starts_with(a);
    let arrows: BTreeMap<&Module, BTreeSet<Module>> = files
        .iter()
        .map(|(module, file)| {
            let used = file.used.iter().filter_map(|path| definer(path));
            let others = used.filter(|other| !other.is_empty() && !related(module, other));
            (module, others.collect())
        })
        .collect();
    let reach = |from: &Module| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = next.pop() {
            for other in &arrows[&module] {
                if seen.insert(other.clone()) {
                    next.push(other.clone());
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&Module, BTreeSet<Module>> =
        files.keys().map(|module| (module, reach(module))).collect();
    let mut found = BTreeSet::new();
    for (module, others) in &reached {
        if others.contains(*module) {
            let circle = others
                .iter()
                .filter(|other| reached[other].contains(*module));
            found.insert(
                circle
                    .map(|other| files[other].path.clone())
                    .collect::<Vec<_>>(),
            );
        }
    }
    found.into_iter().collect()
}

#[test]
fn files_use_each_other_in_no_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for folder in ["src", "decomposition/src", "io/src"] {
        let mut all = Vec::new();
        sources(root, folder, &mut all);
        found.extend(circles(&all, folder));
    }
    let allowed = |circle: &Vec<String>| {
        let in_list = |list: &&[&str]| circle.iter().all(|file| list.contains(&file.as_str()));
        ALLOWED.iter().any(in_list)
    };
    let new: Vec<_> = found.iter().filter(|circle| !allowed(circle)).collect();
    assert!(new.is_empty(), "new circles: {new:#?}");
}

#[test]
fn a_circle_is_found_through_lists_and_re_exports() {
    let file = |path: &str, text: &str| (path.to_owned(), text.to_owned());
    let all = [
        file("src/x/lib.rs", "pub mod a; pub mod b; pub mod c;"),
        file(
            "src/x/a.rs",
            "pub mod deep; pub use deep::{Thing, Other as Another};",
        ),
        file(
            "src/x/a/deep.rs",
            "use crate::c::f; pub struct Thing; pub struct Other;",
        ),
        file(
            "src/x/b.rs",
            "use crate::{a::{Another}, units::X}; pub fn g() {}",
        ),
        file(
            "src/x/c.rs",
            "pub fn f() { crate::b::g() }\n#[cfg(test)] mod tests { use crate::d::h; }",
        ),
        file("src/x/d.rs", "use super::c::f; pub fn h() { f() }"),
    ];
    assert_eq!(
        circles(&all, "src"),
        [["src/x/a/deep.rs", "src/x/b.rs", "src/x/c.rs"]]
    );
}

#[test]
fn a_module_and_its_children_are_no_circle() {
    let file = |path: &str, text: &str| (path.to_owned(), text.to_owned());
    let all = [
        file(
            "src/x/a.rs",
            "mod deep; pub struct Shared; fn f() { deep::g() }",
        ),
        file("src/x/a/deep.rs", "use super::Shared; pub fn g() {}"),
    ];
    assert_eq!(circles(&all, "src"), Vec::<Vec<String>>::new());
}
