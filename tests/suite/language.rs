//! Reads sources and pages, and counts violations of the language rules (section Language of
//! `.github/CONTRIBUTING.md`).
//!
//! `tests/language.csv` contains the number of present faults by rule and file. A number may only decrease: a file
//! with more faults than its number fails the test, and a file that is not listed may have none.
//! `SOLVER_LANGUAGE=record cargo test --test suite -- language` writes the present numbers, after a page was mended
//! or renamed, or two branches were merged.
//!
//! | rule | fault |
//! |---|---|
//! | opening | a doc comment that begins with What, Whether, Where, Who, How, Of, As or The same |
//! | boolean | a doc comment of a `bool`, or of a function that returns one, without "`true`" in its first paragraph |
//! | type | a public type whose name more than two public types of the program have |
//! | function | a function with a name of [`FUNCTIONS`] |
//! | width | a line of Rust with more than [`WIDTH`] characters |
//! | word | a word of [`WORDS`] in a comment of Rust, or in a page |
//! | reference | a path of the repository, in a comment or on a page, that does not exist |
//!
//! The comment of an option of the command line is its help, so that the rule `boolean` does not apply to it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Words with which a doc comment may not begin.
const OPENINGS: &[&str] = &[
    "What", "Whether", "Where", "Who", "How", "Of", "As", "The same",
];

/// Names that do not describe a function.
const FUNCTIONS: &[&str] = &[
    "of", "at", "look", "tell", "some", "share", "place", "holder", "nature",
];

/// Words to be replaced by precise terms of the field.
const WORDS: &[&str] = &[
    "beside",
    "somebody",
    "nobody",
    "dearest",
    "kin",
    "tell",
    "tells",
    "told",
    "dice",
    "look",
    "looks",
    "room",
    "rooms",
    "goes on",
    "left behind",
];

/// Maximum number of characters in a line of Rust.
const WIDTH: usize = 120;

/// Maximum number of public types with the same name.
const NAMESAKES: usize = 2;

/// Folders whose paths in texts are checked.
const FOLDERS: &[&str] = &[
    "src/",
    "decomposition/",
    "io/src/",
    "tests/",
    "benches/",
    "jobs/",
    ".github/",
    ".ci/",
];

/// Folders that are skipped: built or generated files, and the list of faults itself.
const SKIPPED: &[&str] = &["target", "results", "__pycache__", "build", ".git"];

/// Fault with its rule, file, line, and text.
#[derive(Debug, PartialEq)]
struct Fault {
    rule: &'static str,
    file: String,
    line: usize,
    text: String,
}

/// Collects the Rust, Markdown, shell and Python files below a folder, as paths from the root.
fn files(root: &Path, folder: &Path, found: &mut Vec<(String, String)>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_str().unwrap_or_default();
        if path.is_dir() {
            let hidden = name.starts_with('.') && !matches!(name, ".github" | ".ci");
            if !hidden && !SKIPPED.contains(&name) && !name.ends_with(".egg-info") {
                files(root, &path, found);
            }
        } else if [".rs", ".md", ".sh", ".py"]
            .iter()
            .any(|end| name.ends_with(end))
        {
            let relative = path.strip_prefix(root).unwrap().to_str().unwrap();
            found.push((relative.to_owned(), std::fs::read_to_string(&path).unwrap()));
        }
    }
}

/// Returns the text of a doc comment without its mark, if the line is one.
fn doc(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let text = line
        .strip_prefix("///")
        .or_else(|| line.strip_prefix("//!"))?;
    Some(text.strip_prefix(' ').unwrap_or(text))
}

/// Returns the comment of a line of Rust, if it has one outside of a string.
fn comment(line: &str) -> Option<&str> {
    let start = line.find("//")?;
    let quotes = line[..start].matches('"').count();
    (quotes.is_multiple_of(2) && !line[..start].ends_with(':'))
        .then(|| line[start..].trim_start_matches('/'))
}

/// Returns `true` if a text contains a word or a group of words between characters that are not letters.
fn has_word(text: &str, word: &str) -> bool {
    let letter = |c: char| c.is_alphanumeric() || matches!(c, '_' | '`');
    text.match_indices(word).any(|(start, _)| {
        let before = text[..start].chars().next_back();
        let after = text[start + word.len()..].chars().next();
        !before.is_some_and(letter) && !after.is_some_and(letter)
    })
}

/// Returns the name after a keyword at the start of an item, and `true` if the item is public.
fn named<'a>(line: &'a str, keywords: &[&str]) -> Option<(&'a str, bool)> {
    let mut rest = line.trim_start();
    let mut public = false;
    if let Some(after) = rest.strip_prefix("pub") {
        public = after.starts_with(' ');
        rest = match after.strip_prefix('(') {
            Some(scope) => scope.split_once(')')?.1,
            None => after,
        };
        rest = rest.trim_start();
    }
    for prefix in ["const ", "unsafe ", "async "] {
        if keywords == ["fn"] {
            rest = rest.strip_prefix(prefix).unwrap_or(rest);
        }
    }
    let rest = keywords
        .iter()
        .find_map(|keyword| rest.strip_prefix(keyword)?.strip_prefix(' '))?;
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
    let name = &rest[..end.unwrap_or(rest.len())];
    (!name.is_empty()).then_some((name, public))
}

/// Returns `true` if the item that begins here is a `bool`: a field, a constant, or the result of a function.
fn is_boolean(lines: &[&str]) -> bool {
    let attribute = |line: &&&str| line.trim_start().starts_with("#[") || line.trim().is_empty();
    let Some(first) = lines.iter().find(|line| !attribute(line)) else {
        return false;
    };
    let mut attributes = lines.iter().take_while(attribute);
    if attributes.any(|line| line.trim_start().starts_with("#[arg(")) {
        return false;
    }
    if named(first, &["fn"]).is_none() {
        let item = first.trim().trim_end_matches(',').trim_end_matches(';');
        let item = item.split(" = ").next().unwrap_or(item);
        return item.ends_with(": bool") || item.ends_with(": Option<bool>");
    }
    let start = lines.iter().position(|line| line == first).unwrap_or(0);
    let mut signature = String::new();
    for line in &lines[start..] {
        signature.push_str(line.trim());
        if line.trim_end().ends_with(['{', ';', '}']) {
            break;
        }
    }
    let end = signature.trim_end_matches(['{', ';', ' ']);
    end.ends_with("-> bool") || end.contains("-> bool where")
}

/// Adds the faults of the doc comments of a file.
fn doc_faults(file: &str, lines: &[&str], faults: &mut Vec<Fault>) {
    let mut add = |rule, line: usize, text: &str| {
        faults.push(Fault {
            rule,
            file: file.to_owned(),
            line: line + 1,
            text: text.trim().to_owned(),
        });
    };
    let mut n = 0;
    while n < lines.len() {
        let Some(first) = doc(lines[n]) else {
            n += 1;
            continue;
        };
        let length = lines[n..]
            .iter()
            .take_while(|line| doc(line).is_some())
            .count();
        let begins = |word: &&str| {
            let after = first.strip_prefix(*word);
            after.is_some_and(|after| !after.starts_with(char::is_alphanumeric))
        };
        if OPENINGS.iter().any(begins) {
            add("opening", n, first);
        }
        let paragraph = lines[n..n + length].iter().filter_map(|line| doc(line));
        let mut paragraph = paragraph.take_while(|line| !line.is_empty());
        let inner = lines[n].trim_start().starts_with("//!");
        if !inner
            && is_boolean(&lines[n + length..])
            && !paragraph.any(|line| line.contains("`true`"))
        {
            add("boolean", n, first);
        }
        n += length;
    }
}

/// Returns the paths below [`FOLDERS`] that a text names.
fn paths(text: &str) -> Vec<&str> {
    let part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '/' | '-');
    let mut found = Vec::new();
    for folder in FOLDERS {
        for (start, _) in text.match_indices(folder) {
            if text[..start].chars().next_back().is_some_and(part) {
                continue;
            }
            let rest = &text[start..];
            let end = rest.find(|c| !part(c)).unwrap_or(rest.len());
            let open = rest[end..].starts_with(['*', '<', '{', '$', '[', '…']);
            let path = rest[..end].trim_end_matches(['.', '-']);
            // A name in capitals represents any file.
            let any = path
                .split('/')
                .any(|name| name.len() > 1 && name.chars().all(|c| c.is_ascii_uppercase()));
            if !open && !any {
                found.push(path);
            }
        }
    }
    found
}

/// Returns the relative targets of the links of a page.
fn links(line: &str) -> Vec<&str> {
    let targets = line
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'));
    let targets = targets.map(|(target, _)| target.split('#').next().unwrap_or(target));
    targets
        .filter(|target| {
            !target.is_empty() && !target.contains("://") && !target.starts_with("mailto:")
        })
        .collect()
}

/// Adds the faults of a file that depend on its lines only.
fn line_faults(root: &Path, file: &str, lines: &[&str], faults: &mut Vec<Fault>) {
    let rust = file.ends_with(".rs");
    let page = file.ends_with(".md");
    let mut add = |rule, line: usize, text: &str| {
        faults.push(Fault {
            rule,
            file: file.to_owned(),
            line: line + 1,
            text: text.trim().to_owned(),
        });
    };
    let whole = root.join(file);
    let folder = whole.parent().unwrap_or(root);
    let mut fenced = false;
    for (n, line) in lines.iter().enumerate() {
        if rust && line.chars().count() > WIDTH {
            add("width", n, line);
        }
        if rust
            && let Some((name, _)) = named(line, &["fn"])
            && FUNCTIONS.contains(&name)
        {
            add("function", n, line);
        }
        if page && line.trim_start().starts_with("```") {
            fenced = !fenced;
        }
        let prose = if page {
            (!fenced).then_some(*line)
        } else if rust {
            comment(line)
        } else {
            line.trim_start().strip_prefix('#')
        };
        let Some(prose) = prose else {
            continue;
        };
        if rust || page {
            let small = prose.to_lowercase();
            for word in WORDS.iter().filter(|word| has_word(&small, word)) {
                add("word", n, &format!("{word}: {prose}"));
            }
        }
        for path in paths(prose) {
            let exists = |folder: &Path| folder.join(path).exists();
            // Paths relative to the root, a folder above, or the folder of the modules of a file.
            let modules = whole.with_extension("");
            if !exists(&modules) && !folder.ancestors().any(exists) {
                add("reference", n, path);
            }
        }
        if page {
            for target in links(line) {
                if !folder.join(target).exists() {
                    add("reference", n, target);
                }
            }
        }
    }
}

/// Returns the public types of the program with a name used too often.
fn type_faults(sources: &[(String, String)]) -> Vec<Fault> {
    let mut types: BTreeMap<&str, Vec<(&str, usize)>> = BTreeMap::new();
    for (file, text) in sources {
        let program = ["src/", "decomposition/src/", "io/src/"];
        let tests = file.contains("/tests/") || file.ends_with("tests.rs");
        if tests || !file.ends_with(".rs") || !program.iter().any(|f| file.starts_with(f)) {
            continue;
        }
        for (n, line) in text.lines().enumerate() {
            if let Some((name, true)) = named(line, &["struct", "enum", "trait", "type"]) {
                types.entry(name).or_default().push((file, n + 1));
            }
        }
    }
    let mut faults = Vec::new();
    for (name, places) in types.into_iter().filter(|(_, all)| all.len() > NAMESAKES) {
        for (file, line) in places {
            faults.push(Fault {
                rule: "type",
                file: file.to_owned(),
                line,
                text: name.to_owned(),
            });
        }
    }
    faults
}

/// Returns all faults of the files.
fn faults(root: &Path, sources: &[(String, String)]) -> Vec<Fault> {
    let mut all = type_faults(sources);
    for (file, text) in sources {
        let lines: Vec<&str> = text.lines().collect();
        if file.ends_with(".rs") {
            doc_faults(file, &lines, &mut all);
        }
        line_faults(root, file, &lines, &mut all);
    }
    all
}

type Counts = BTreeMap<(String, String), usize>;

fn counts(faults: &[Fault]) -> Counts {
    let mut counts = Counts::new();
    for fault in faults {
        *counts
            .entry((fault.rule.to_owned(), fault.file.clone()))
            .or_default() += 1;
    }
    counts
}

fn read(text: &str) -> Counts {
    let rows = text.lines().skip(1).map(|row| {
        let mut cells = row.split(',');
        let mut cell = || cells.next().unwrap().to_owned();
        let key = (cell(), cell());
        (key, cell().parse().unwrap())
    });
    rows.collect()
}

fn written(counts: &Counts) -> String {
    let mut text = String::from("rule,file,count\n");
    for ((rule, file), count) in counts {
        text.push_str(&format!("{rule},{file},{count}\n"));
    }
    text
}

/// Returns a message for each rule and file with more faults than allowed: the number, and all its faults with
/// their lines.
fn complaints(faults: &[Fault], allowed: &Counts) -> Vec<String> {
    let mut complaints = Vec::new();
    for ((rule, file), count) in counts(faults) {
        let most = allowed
            .get(&(rule.clone(), file.clone()))
            .copied()
            .unwrap_or(0);
        if count > most {
            complaints.push(format!(
                "{file}: {count} faults of the rule `{rule}`, at most {most} are allowed:"
            ));
            let own = faults.iter().filter(|f| f.rule == rule && f.file == file);
            complaints.extend(own.map(|f| format!("  {file}:{}: {rule}: {}", f.line, f.text)));
        }
    }
    complaints
}

#[test]
fn faults_of_language_do_not_grow() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    files(root, root, &mut sources);
    assert!(sources.len() > 400, "only {} files found", sources.len());
    let found = faults(root, &sources);
    let list = root.join("tests/language.csv");
    if std::env::var("SOLVER_LANGUAGE").is_ok_and(|word| word == "record") {
        std::fs::write(&list, written(&counts(&found))).unwrap();
    }
    let allowed = read(&std::fs::read_to_string(&list).unwrap());
    let complaints = complaints(&found, &allowed);
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn each_rule_finds_its_fault_and_nothing_else() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let check = |file: &str, text: &str| {
        let sources = [(file.to_owned(), text.to_owned())];
        let found = faults(root, &sources);
        found.iter().map(|f| (f.rule, f.line)).collect::<Vec<_>>()
    };
    let quoted = format!("// {}", WORDS[0]);
    for opening in OPENINGS {
        let text = format!("/// {opening} it is.\nconst A: u8 = 1;\n");
        assert_eq!(check("src/a.rs", &text), [("opening", 1)], "{opening}");
    }
    let fine = "/// Offers a list.\n/// Of two lines.\nconst A: u8 = 1;\n\n/// `true` if it moves.\npub moves: bool,\n";
    assert_eq!(check("src/a.rs", fine), []);
    let moves = "/// It moves.\n#[must_use]\npub fn moves(\n    &self,\n) -> bool {\n";
    assert_eq!(check("src/a.rs", moves), [("boolean", 1)]);
    assert_eq!(
        check("src/a.rs", "/// It moves.\npub moves: bool,\n"),
        [("boolean", 1)]
    );
    assert_eq!(
        check("src/a.rs", "/// Print JSON.\n#[arg(long)]\njson: bool,\n"),
        []
    );
    assert_eq!(
        check(
            "src/a.rs",
            "/// Returns `true` if it moves.\nfn moves() -> bool {\n"
        ),
        []
    );
    assert_eq!(
        check(
            "src/a.rs",
            "/// Returns a test.\nfn test(moves: bool) -> u8 {\n"
        ),
        []
    );
    assert_eq!(
        check(
            "src/a.rs",
            "/// Does nothing.\nfn test(_: bool) {}\n\nfn moves() -> bool {\n"
        ),
        []
    );
    assert_eq!(
        check("src/a.rs", "    pub(crate) const fn share(\n"),
        [("function", 1)]
    );
    assert_eq!(
        check("src/a.rs", "fn shared() {}\nlet at = of(place);\n"),
        []
    );
    assert_eq!(check("src/a.rs", &"é".repeat(WIDTH)), []);
    assert_eq!(check("src/a.rs", &"x".repeat(WIDTH + 1)), [("width", 1)]);
    assert_eq!(
        check("src/a.rs", "let n = 1; // Nobody reads it.\n"),
        [("word", 1)]
    );
    assert_eq!(
        check("src/a.rs", &format!("let room = {quoted:?}; // kinetic\n")),
        []
    );
    assert_eq!(
        check("page.md", "It goes on.\n```\ntell\n```\n"),
        [("word", 1)]
    );
    assert_eq!(
        check("src/a.rs", "// See src/none/such.rs and src/lib.rs.\n"),
        [("reference", 1)]
    );
    assert_eq!(
        check(
            "page.md",
            "[a](none.md) [b](README.md#a) `src/NAME/a.rs` src/*.rs"
        ),
        [("reference", 1)]
    );
    let twice = "pub struct Row;\npub(crate) enum Row {}\npub struct Row;\n";
    assert_eq!(check("src/a.rs", twice), []);
    let thrice = format!("{twice}pub trait Row {{}}\n");
    assert_eq!(
        check("src/a.rs", &thrice),
        [("type", 1), ("type", 3), ("type", 4)]
    );
}

/// Returns the terms of the glossary of a page, in its order; a row may have several, separated by commas.
fn glossary(page: &str) -> Vec<&str> {
    let section = page.split("## Glossary").nth(1).unwrap_or_default();
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows = section.lines().skip_while(|line| !line.starts_with("|---"));
    let terms = rows
        .skip(1)
        .filter_map(|row| row.strip_prefix("| ")?.split(" | ").next());
    terms.collect()
}

/// Returns `true` if a text contains a term, in the singular or the plural.
fn uses(text: &str, term: &str) -> bool {
    has_word(text, term) || has_word(text, &format!("{term}s"))
}

#[test]
fn the_glossary_is_sorted_and_its_terms_are_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("src/ARCHITECTURE.md")).unwrap();
    let terms = glossary(&page);
    assert!(terms.len() > 30, "{terms:?}");
    let small: Vec<String> = terms.iter().map(|term| term.to_lowercase()).collect();
    assert!(small.is_sorted_by(|a, b| a < b), "{small:?}");
    let mut sources = Vec::new();
    files(root, &root.join("src"), &mut sources);
    let texts: Vec<String> = sources
        .iter()
        .filter(|(file, _)| file.ends_with(".rs"))
        .map(|(_, text)| {
            text.lines()
                .filter_map(comment)
                .collect::<Vec<_>>()
                .join("\n")
                .to_lowercase()
        })
        .collect();
    for term in small.iter().flat_map(|term| term.split(", ")) {
        let number = texts.iter().filter(|text| uses(text, term)).count();
        assert!(
            number >= 4,
            "only {number} files use the term `{term}` of the glossary"
        );
    }
    let unsorted = "## Glossary\n\n| term | meaning |\n|---|---|\n| b, c | d |\n| a | e |\n\n## Next\n\n| f | g |\n";
    assert_eq!(glossary(unsorted), ["b, c", "a"]);
    assert!(uses("two joints meet", "joint") && !uses("jointed rock", "joint"));
}

#[test]
fn a_number_may_fall_and_not_rise() {
    let fault = |line| Fault {
        rule: "word",
        file: "a.md".into(),
        line,
        text: "told".into(),
    };
    let list = read("rule,file,count\nword,a.md,2\n");
    assert_eq!(complaints(&[fault(1)], &list), Vec::<String>::new());
    assert_eq!(
        complaints(&[fault(1), fault(2)], &list),
        Vec::<String>::new()
    );
    let more = complaints(&[fault(1), fault(2), fault(9)], &list);
    assert!(
        more.last().unwrap().contains("a.md:9: word: told"),
        "{more:?}"
    );
    assert_eq!(read(&written(&list)), list);
}
