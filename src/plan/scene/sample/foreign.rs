//! Lists of grains that other programs write, converted to a table with a line of names. Lines keep their numbers.
//!
//! | program | form |
//! |---|---|
//! | LAMMPS, LIGGGHTS | `dump custom` as text: the last snapshot; `ITEM: ATOMS` names the columns |
//! | PFC | `ball create` commands (also `ball generate`, `ball id 1 ...`): `id`, `radius`, position and velocities |
//!
//! Text files of YADE (`#format x_y_z_r`, `# x y z r`) are tables with the names in a comment, which [`io::sheet`]
//! reads.

use io::sheet::{Column, Header};
use std::fmt::Write;

/// Returns the names and rows of a text of another program; none for a table.
///
/// # Errors
/// A sentence about a text that begins like one of the forms and cannot be read.
pub(super) fn header<'t>(text: &'t str, columns: &[Column]) -> Result<Option<Header<'t>>, String> {
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
    let begins = ["model", "new", "domain", "ball", "program"].contains(&word.as_str());
    if begins && text.lines().any(|line| ball(line).is_some()) {
        return balls(text).map(Some);
    }
    let mut comments = text
        .lines()
        .map(str::trim)
        .take_while(|line| line.is_empty() || line.starts_with('#'));
    if comments.any(|line| line.starts_with("#format ")) {
        return Header::find(text, columns).map(Some);
    }
    Ok(None)
}

const ATOMS: &str = "ITEM: ATOMS";

/// Converts the last snapshot of a dump.
fn dump(text: &str) -> Result<Header<'_>, String> {
    let Some(at) = text.rfind(ATOMS) else {
        return Err(format!(
            "this is a dump without a line `{ATOMS}` that names its columns"
        ));
    };
    let above = text[..at].lines().count();
    let (names, rows) = text[at..].split_once('\n').unwrap_or((&text[at..], ""));
    let names: Vec<&str> = names[ATOMS.len()..].split_whitespace().collect();
    if ["xs", "xsu"].iter().any(|scaled| names.contains(scaled)) {
        return Err(format!(
            "line {}: the coordinates of this dump are scaled with its box: dump `x y z radius`",
            above + 1
        ));
    }
    if !names.contains(&"radius") && !names.contains(&"diameter") {
        return Err(format!(
            "line {}: this dump has no column `radius` or `diameter`: dump `id x y z radius`",
            above + 1
        ));
    }
    let end = rows.find("ITEM:").unwrap_or(rows.len());
    let rows = &rows[..end];
    let found = rows.lines().filter(|row| !row.trim().is_empty()).count();
    if let Some(stated) = number_of_atoms(&text[..at]).filter(|stated| *stated != found) {
        return Err(format!(
            "the last snapshot of this dump has {found} of its {stated} grains"
        ));
    }
    Ok(Header {
        names: names.into_iter().map(str::to_owned).collect(),
        units: Vec::new(),
        rows: rows.into(),
        above: u64::try_from(above + 1).unwrap_or(0),
        separator: b' ',
    })
}

/// Returns the number of atoms that the last snapshot states.
fn number_of_atoms(above: &str) -> Option<usize> {
    let (_, below) = above.rsplit_once("ITEM: NUMBER OF ATOMS")?;
    below.lines().nth(1)?.trim().parse().ok()
}

/// Returns the words behind `ball create` and similar commands; none for another command.
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
    let words = ["create ", "generate "]
        .iter()
        .find_map(|verb| words.strip_prefix(verb))
        .unwrap_or(words);
    let begins = ["id", "rad", "x ", "pos"]
        .iter()
        .any(|word| words.starts_with(word));
    begins.then(|| words.to_owned())
}

/// Names of the columns of a converted list of commands.
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

/// Converts commands that create balls: one row for each line of the text, empty where it creates none.
fn balls(text: &str) -> Result<Header<'_>, String> {
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
                    let name = NAMES[*k];
                    return Err(format!("line {}: this ball has no {name}", n + 1));
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

/// Returns the values of a command by the columns of [`NAMES`].
fn created(words: &str, line: usize) -> Result<[Option<f64>; 8], String> {
    let mut ball = [None; 8];
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
            // Groups, properties and other keywords with their values.
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
                return Err(format!(
                    "line {line}: `{word}` is followed by {found}, expected a number"
                ));
            };
            ball[k] = Some(number);
            words.next();
        }
    }
    Ok(ball)
}

#[cfg(test)]
mod tests;
