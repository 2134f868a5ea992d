//! Grain lists of other programs, converted to a table with a header. Rows keep their line numbers.
//!
//! | program | form |
//! |---|---|
//! | LAMMPS, LIGGGHTS | `dump custom` as text: the last snapshot; `ITEM: ATOMS` names the columns |
//! | LAMMPS, LIGGGHTS | data file of the atom style `sphere`, with its velocities |
//! | YADE, Woo | sphere pack without names: `##PERIODIC:: x y z`, then `x y z r` or `x y z r clump` |
//! | ParaView | table of points: `Points:0`, `Points:1`, `Points:2` |
//! | PFC | `ball create`, `ball generate`, `ball id 1 ...`: `id`, `radius`, `position`, `x`, `y`, `z` and velocities |
//!
//! Text files of YADE (`#format x_y_z_r`, `# x y z r`) are tables with the names in a comment, which
//! [`io::sheet`] reads. `attrs` in a format stands for any number of trailing columns, which are ignored.

use io::sheet::{Column, Header};
use std::fmt::Write;

/// Reason why a list of grains of another program cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum FormatError {
    /// Table that cannot be read.
    #[error("{0}")]
    Table(String),
    /// Sphere pack without a sphere.
    #[error("this sphere pack contains no sphere")]
    EmptyPack,
    /// Shape of a pack that is not a sphere.
    #[error("line {line}: `{kind}` is not a sphere, but samples can contain spheres only")]
    NotASphere { line: usize, kind: String },
    /// LAMMPS data file whose atoms have no diameters, because its types have masses.
    #[error(
        "line {line}: this data file has a mass for each type and therefore no diameters; atoms of the style \
         `sphere` ({SPHERE}) have them: {DUMP}"
    )]
    Masses { line: usize },
    /// Atom without a style that has not as many columns as a sphere.
    #[error(
        "line {line}: an atom has {columns} columns, and `Atoms` names no style; only atoms of the style \
         `sphere` ({SPHERE}) contain their diameters: {DUMP}"
    )]
    AtomColumns { line: usize, columns: usize },
    /// Atom without a style whose numbers are not those of a sphere.
    #[error(
        "line {line}: `Atoms` names no style, and this is not an atom of the style `sphere` ({SPHERE}), \
         because its {name} would be {word}: {DUMP}"
    )]
    NotOfSpheres {
        line: usize,
        name: &'static str,
        word: String,
    },
    /// LAMMPS data file of another style.
    #[error(
        "line {line}: the atoms of this data file have the style `{style}`, which, unlike `sphere`, \
         contains no diameters: {DUMP}"
    )]
    Style { line: usize, style: String },
    /// Sphere of a LAMMPS data file with too few columns.
    #[error("line {line}: an atom of the style `sphere` must have the columns {SPHERE}")]
    FewColumns { line: usize },
    /// Dump without the line of its columns.
    #[error("this is a dump without a line `{ATOMS}` that names its columns")]
    NoAtoms,
    /// Dump with scaled coordinates.
    #[error(
        "line {line}: the coordinates of this dump are scaled with its box: dump `x y z radius`"
    )]
    Scaled { line: usize },
    /// Dump without radii.
    #[error(
        "line {line}: this dump has no column `radius` or `diameter`: write a dump of `id x y z radius`"
    )]
    NoRadius { line: usize },
    /// Dump of superquadrics.
    #[error("line {line}: this is a dump of superquadrics, but samples can contain spheres only")]
    Superquadrics { line: usize },
    /// Last snapshot of a dump that is incomplete.
    #[error("the last snapshot of this dump has only {found} of its {stated} grains")]
    ShortSnapshot { found: usize, stated: usize },
    /// Ball of PFC without a value.
    #[error("line {line}: this ball has no {name}")]
    Ball { line: usize, name: &'static str },
    /// Command of PFC that places balls by itself.
    #[error(
        "line {line}: with this command PFC itself chooses the positions of the balls: export the balls with \
         their positions"
    )]
    Generated { line: usize },
    /// Keyword of PFC without a number.
    #[error("line {line}: `{word}` is followed by {found}, but a number is needed")]
    NoNumber {
        line: usize,
        word: String,
        found: String,
    },
}

/// Returns header and rows of a text written by another program; none for a table.
///
/// # Errors
/// If a text begins like one of the formats but cannot be read.
pub(super) fn header<'t>(
    text: &'t str,
    columns: &[Column],
) -> Result<Option<Header<'t>>, FormatError> {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with([';', '#']));
    let first = first.unwrap_or_default();
    if first.starts_with("ITEM:") {
        return dump(text).map(Some);
    }
    let word = first
        .split_whitespace()
        .next()
        .unwrap_or_default()
        .to_lowercase();
    if let Some(at) = text.find(PERIODIC) {
        return pack(text, at).map(Some);
    }
    if let Some(at) = atoms_section(text) {
        return data(text, at).map(Some);
    }
    let begins = COMMANDS.contains(&word.as_str());
    if begins && text.lines().any(|line| ball(line).is_some()) {
        return balls(text).map(Some);
    }
    let mut comments = text
        .lines()
        .map(str::trim)
        .take_while(|line| line.is_empty() || line.starts_with('#'));
    if let Some(format) = comments.find_map(|line| line.strip_prefix("#format ")) {
        let found = Header::find(text, columns).map_err(FormatError::Table)?;
        return Ok(Some(without_attributes(found, format)));
    }
    let of_points = ["points:0", "points_0"];
    if of_points
        .iter()
        .any(|name| first.to_lowercase().contains(name))
    {
        return Header::find(text, columns)
            .map(Some)
            .map_err(FormatError::Table);
    }
    Ok(None)
}

/// First words of PFC command lists.
const COMMANDS: [&str; 10] = [
    "model", "new", "domain", "ball", "program", "fish", "def", "define", "set", "restore",
];

/// Returns a table without the trailing attributes of its rows, of which a format may have any number.
fn without_attributes<'t>(mut found: Header<'t>, format: &str) -> Header<'t> {
    let Some(names) = format.trim().strip_suffix("_attrs") else {
        return found;
    };
    found.names = names.split('_').map(str::to_owned).collect();
    let count = found.names.len();
    let cut = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().take(count).collect();
        words.join("\t") + "\n"
    };
    found.rows = found.rows.lines().map(cut).collect::<String>().into();
    found.separator = b'\t';
    found
}

/// First word of a sphere pack.
const PERIODIC: &str = "##PERIODIC::";

/// Converts a sphere pack, whose rows have no column names: the number and the kind of a shape may come first.
fn pack(text: &str, at: usize) -> Result<Header<'_>, FormatError> {
    let above = text[..at].lines().count() + 1;
    let rows = text[at..].split_once('\n').map_or("", |(_, rows)| rows);
    let mut lines = (above + 1..).zip(rows.lines());
    let filled = |line: &str| !line.trim().is_empty() && !line.starts_with('#');
    let Some((_, first)) = lines.clone().find(|(_, line)| filled(line)) else {
        return Err(FormatError::EmptyPack);
    };
    let words: Vec<&str> = first.split_whitespace().collect();
    let names: &[&str] = match words[..] {
        [_, _, _, _] => &["x", "y", "z", "r"],
        [_, _, _, _, _] => &["x", "y", "z", "r", "clump"],
        _ => &["shape", "kind", "x", "y", "z", "r"],
    };
    let kind = |line: &str| line.split_whitespace().nth(1).map(str::to_owned);
    if names.len() == 6
        && let Some((n, line)) =
            lines.find(|(_, line)| filled(line) && kind(line).is_none_or(|kind| kind != "Sphere"))
    {
        let kind = kind(line).unwrap_or_default();
        return Err(FormatError::NotASphere { line: n, kind });
    }
    Ok(Header {
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        units: Vec::new(),
        rows: rows.into(),
        above: u64::try_from(above).unwrap_or(0),
        separator: b' ',
    })
}

/// Returns the words of a line without its comment.
fn words(line: &str) -> Vec<&str> {
    let line = line.split('#').next().unwrap_or_default();
    line.split_whitespace().collect()
}

/// Returns the line number of `Atoms` in a LAMMPS data file; none for another text.
fn atoms_section(text: &str) -> Option<usize> {
    let head = || text.lines().take(40).map(words);
    if !(head().any(|words| matches!(words[..], [_, "atoms"]))
        && head().any(|words| words.ends_with(&["xlo", "xhi"])))
    {
        return None;
    }
    let mut from = 0;
    for line in text.split_inclusive('\n') {
        if words(line).first() == Some(&"Atoms") {
            return Some(from);
        }
        from += line.len();
    }
    None
}

/// Returns the rows of a section as words with their line numbers; a section ends at a line that begins with a
/// letter.
fn section(text: &str, at: usize) -> Vec<(usize, Vec<&str>)> {
    let above = text[..at].lines().count();
    let lines = (above + 1..).zip(text[at..].lines()).skip(1);
    let words = lines.map(|(n, line)| (n, words(line)));
    let name = |words: &[&str]| {
        let first = words.first().and_then(|word| word.chars().next());
        first.is_some_and(char::is_alphabetic)
    };
    words
        .take_while(|(_, words)| !name(words))
        .filter(|(_, words)| !words.is_empty())
        .collect()
}

/// Row of an atom of the style `sphere`.
const SPHERE: &str = "`id type diameter density x y z`";
/// Advice for a data file whose atoms are not spheres.
const DUMP: &str = "write a dump of `id x y z radius`";

/// Returns the style that is written behind `Atoms`; none for another comment.
fn style_of(line: &str) -> Option<&str> {
    let comment = line.split_once('#')?.1.trim();
    let name = |word: &str| {
        word.chars()
            .all(|c| c.is_ascii_alphanumeric() || "/_".contains(c))
    };
    let one = comment.split_whitespace().count() == 1 || comment.starts_with("hybrid ");
    (one && comment.len() <= 40 && comment.split_whitespace().all(name)).then_some(comment)
}

/// Checks that the atoms of a data file that names no style can be spheres. Other styles have as many columns, with
/// other content: those of `full` are a molecule, a type and a charge.
fn check_spheres(text: &str, atoms: &[(usize, Vec<&str>)]) -> Result<(), FormatError> {
    let mut lines = (1..).zip(text.lines());
    if let Some((n, _)) = lines.find(|(_, line)| words(line) == ["Masses"]) {
        return Err(FormatError::Masses { line: n });
    }
    for (n, words) in atoms {
        let columns = words.len();
        if !matches!(columns, 7 | 10) {
            return Err(FormatError::AtomColumns { line: *n, columns });
        }
        let above_0 = |word: &str| word.parse::<f64>().is_ok_and(|number| number > 0.0);
        if let Some((name, word)) = [("diameter", words[2]), ("density", words[3])]
            .into_iter()
            .find(|(_, word)| !above_0(word))
        {
            return Err(FormatError::NotOfSpheres {
                line: *n,
                name,
                word: word.to_owned(),
            });
        }
    }
    Ok(())
}

/// Converts a LAMMPS data file of spheres: `id type diameter density x y z` and, in the section of velocities,
/// `id vx vy vz wx wy wz`.
fn data(text: &str, at: usize) -> Result<Header<'_>, FormatError> {
    let line = text[at..].lines().next().unwrap_or_default();
    let number = text[..at].lines().count() + 1;
    let atoms = section(text, at);
    match style_of(line) {
        Some("sphere" | "granular") => {}
        Some(style) => {
            return Err(FormatError::Style {
                line: number,
                style: style.to_owned(),
            });
        }
        None => check_spheres(text, &atoms)?,
    }
    let velocities = text
        .match_indices("\nVelocities")
        .next()
        .map(|(n, _)| section(text, n + 1))
        .unwrap_or_default();
    let moving: std::collections::HashMap<&str, &[&str]> = velocities
        .iter()
        .map(|(_, words)| (words[0], &words[1..]))
        .collect();
    let mut rows = String::new();
    let mut below = number;
    for (n, words) in &atoms {
        let [id, _, diameter, _, x, y, z, ..] = words[..] else {
            return Err(FormatError::FewColumns { line: *n });
        };
        // Empty lines preserve the line numbers.
        rows.extend(std::iter::repeat_n('\n', n - below - 1));
        below = *n;
        let _ = write!(rows, "{id}\t{diameter}\t{x}\t{y}\t{z}");
        let motion = moving.get(id).copied().unwrap_or_default();
        for k in 0..6 {
            let _ = write!(rows, "\t{}", motion.get(k).copied().unwrap_or("0"));
        }
        rows.push('\n');
    }
    let names = [
        "id", "diameter", "x", "y", "z", "vx", "vy", "vz", "omegax", "omegay", "omegaz",
    ];
    Ok(Header {
        names: names.map(str::to_owned).to_vec(),
        units: Vec::new(),
        rows: rows.into(),
        above: u64::try_from(number).unwrap_or(0),
        separator: b'\t',
    })
}

const ATOMS: &str = "ITEM: ATOMS";

/// Converts the last snapshot of a dump.
fn dump(text: &str) -> Result<Header<'_>, FormatError> {
    let Some(at) = text.rfind(ATOMS) else {
        return Err(FormatError::NoAtoms);
    };
    let above = text[..at].lines().count();
    let (names, rows) = text[at..].split_once('\n').unwrap_or((&text[at..], ""));
    let mut names: Vec<&str> = names[ATOMS.len()..].split_whitespace().collect();
    if !["x", "xu"].iter().any(|plain| names.contains(plain))
        && ["xs", "xsu"].iter().any(|scaled| names.contains(scaled))
    {
        return Err(FormatError::Scaled { line: above + 1 });
    }
    if !names.contains(&"radius") && !names.contains(&"diameter") {
        return Err(FormatError::NoRadius { line: above + 1 });
    }
    if names.contains(&"shapex") || names.contains(&"blockiness1") {
        return Err(FormatError::Superquadrics { line: above + 1 });
    }
    // If a quantity is given in two forms, the first is read.
    for [first, second] in [
        ["x", "xu"],
        ["y", "yu"],
        ["z", "zu"],
        ["radius", "diameter"],
    ] {
        if names.contains(&first)
            && let Some(other) = names.iter_mut().find(|name| **name == second)
        {
            *other = "again";
        }
    }
    let end = rows.find("ITEM:").unwrap_or(rows.len());
    let rows = &rows[..end];
    let found = rows.lines().filter(|row| !row.trim().is_empty()).count();
    if let Some(stated) = number_of_atoms(&text[..at]).filter(|stated| *stated != found) {
        return Err(FormatError::ShortSnapshot { found, stated });
    }
    Ok(Header {
        names: names.into_iter().map(str::to_owned).collect(),
        units: Vec::new(),
        rows: rows.into(),
        above: u64::try_from(above + 1).unwrap_or(0),
        separator: b' ',
    })
}

/// Returns the number of atoms stated for the last snapshot.
fn number_of_atoms(above: &str) -> Option<usize> {
    let (_, below) = above.rsplit_once("ITEM: NUMBER OF ATOMS")?;
    below.lines().nth(1)?.trim().parse().ok()
}

/// Returns the words after `ball create` and similar commands; none for another command.
fn ball(line: &str) -> Option<String> {
    let line = line.split(';').next().unwrap_or_default().to_lowercase();
    let spaced: String = line
        .chars()
        .map(|c| {
            if matches!(c, '=' | ',' | '(' | ')') {
                ' '
            } else {
                c
            }
        })
        .collect();
    let words = spaced.trim_start().strip_prefix("ball ")?.trim_start();
    let created = ["create ", "generate "]
        .iter()
        .find_map(|verb| words.strip_prefix(verb));
    let begins = ["id", "rad", "x ", "pos"]
        .iter()
        .any(|word| words.starts_with(word));
    match created {
        Some(words) => Some(words.to_owned()),
        None => begins.then(|| words.to_owned()),
    }
}

/// Keywords of commands that place balls at random or on a lattice, whose positions are not stated.
const GENERATED: [&str; 7] = [
    "number",
    "num",
    "box",
    "cubic",
    "hexagonal",
    "gauss",
    "tries",
];

/// Column names of a converted command list.
const NAMES: [&str; 8] = [
    "x",
    "y",
    "z",
    "radius",
    "id",
    "velocity_x",
    "velocity_y",
    "velocity_z",
];
const ID: usize = 4;

/// Converts commands that create balls to one row per line of the text, empty for lines that create none.
fn balls(text: &str) -> Result<Header<'_>, FormatError> {
    let all: Vec<Option<[Option<f64>; 8]>> = text
        .lines()
        .enumerate()
        .map(|(n, line)| ball(line).map(|words| created(&words, n + 1)).transpose())
        .collect::<Result<_, _>>()?;
    let stated = |k: &usize| all.iter().flatten().any(|ball| ball[*k].is_some());
    let columns: Vec<usize> = (0..NAMES.len()).filter(stated).collect();
    let mut rows = String::new();
    for (n, ball) in all.iter().enumerate() {
        for k in columns.iter().filter(|_| ball.is_some()) {
            let number = ball.and_then(|ball| ball[*k]);
            // Writing to a String cannot fail.
            let _ = match number {
                Some(id) if *k == ID => write!(rows, "{id:.0}\t"),
                Some(number) => write!(rows, "{number:?}\t"),
                None if *k > ID => write!(rows, "0\t"),
                None => {
                    return Err(FormatError::Ball {
                        line: n + 1,
                        name: NAMES[*k],
                    });
                }
            };
        }
        rows.push('\n');
    }
    Ok(Header {
        names: columns.iter().map(|k| NAMES[*k].to_owned()).collect(),
        units: Vec::new(),
        rows: rows.into(),
        above: 0,
        separator: b'\t',
    })
}

/// Returns the values of a command in the columns of [`NAMES`].
fn created(words: &str, line: usize) -> Result<[Option<f64>; 8], FormatError> {
    let mut ball = [None; 8];
    if words
        .split_whitespace()
        .any(|word| GENERATED.contains(&word))
    {
        return Err(FormatError::Generated { line });
    }
    let mut words = words.split_whitespace().peekable();
    while let Some(word) = words.next() {
        let first = match word {
            "x" | "y" | "z" | "position-x" | "position-y" | "position-z" => {
                usize::from(word.as_bytes()[word.len() - 1] - b'x')
            }
            "position" | "pos" => 0,
            "radius" | "rad" => 3,
            "id" => ID,
            "velocity" | "vel" | "velocity-x" | "xvel" => 5,
            "velocity-y" | "yvel" => 6,
            "velocity-z" | "zvel" => 7,
            // Groups, properties and other keywords are skipped with their values.
            _ => continue,
        };
        let many = matches!(word, "position" | "pos" | "velocity" | "vel");
        for k in first..first + if many { 3 } else { 1 } {
            let number = words.peek().and_then(|word| word.parse::<f64>().ok());
            let Some(number) = number.filter(|number| number.is_finite()) else {
                if many && k > first + 1 {
                    break;
                }
                let found = words.peek().copied().unwrap_or("nothing");
                return Err(FormatError::NoNumber {
                    line,
                    word: word.to_owned(),
                    found: found.to_owned(),
                });
            };
            ball[k] = Some(number);
            words.next();
        }
    }
    Ok(ball)
}

#[cfg(test)]
mod tests;
