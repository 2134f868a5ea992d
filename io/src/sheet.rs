//! Tables that users write or export: samples, profiles, rasters, polygons.
//!
//! The first line names the columns, in any order and independent of upper and lower case. Cells are separated by
//! commas, semicolons, tabs or spaces. A unit in brackets after a name, or in a line of units below the names, is
//! converted to SI. The names may be in a comment line above the numbers (`#x y z r`, `#format x_y_z_r`). Byte
//! order marks, blank lines, comments (`#`, `%`), a line `sep=;` and empty cells at the end of a line are ignored.
//! Rows of another length, decimal commas and a missing line of names are refused.

use crate::csv;
use ::csv::{ReaderBuilder, StringRecord};
use std::borrow::Cow;

/// Dimension of the numbers of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Length \[m\].
    Length,
    /// Velocity [m/s].
    Velocity,
    /// Rotation rate [rad/s].
    Rotation,
    /// Area \[m2\].
    Area,
    /// Time \[s\].
    Time,
    /// Ratio \[1\].
    Ratio,
    /// Text or whole numbers.
    Text,
}

/// Divisors that convert a length to m.
const LENGTHS: [(&str, f64); 13] = [
    ("m", 1.0),
    ("dm", 10.0),
    ("cm", 100.0),
    ("mm", 1e3),
    ("µm", 1e6),
    ("μm", 1e6),
    ("um", 1e6),
    ("micron", 1e6),
    ("nm", 1e9),
    ("km", 1e-3),
    ("in", 1.0 / 0.0254),
    ("inch", 1.0 / 0.0254),
    ("ft", 1.0 / 0.3048),
];

fn length(text: &str) -> Option<f64> {
    let found = LENGTHS.iter().find(|(name, _)| *name == text);
    found.map(|(_, over)| *over)
}

fn time(text: &str) -> Option<f64> {
    match text.to_lowercase().as_str() {
        "s" | "sec" | "second" | "seconds" => Some(1.0),
        "ms" => Some(1e3),
        "min" | "minute" | "minutes" => Some(1.0 / 60.0),
        "h" | "hr" | "hour" | "hours" => Some(1.0 / 3600.0),
        "d" | "day" | "days" => Some(1.0 / 86_400.0),
        "a" | "year" | "years" => Some(1.0 / 31_557_600.0),
        _ => None,
    }
}

impl Unit {
    /// Returns the SI unit of numbers without a stated unit.
    const fn name(self) -> &'static str {
        match self {
            Self::Length => "m",
            Self::Velocity => "m/s",
            Self::Rotation => "rad/s",
            Self::Area => "m2",
            Self::Time => "s",
            Self::Ratio => "1",
            Self::Text => "",
        }
    }

    /// Returns the divisor that converts numbers of a unit to SI; `None` for a unit of another dimension.
    fn divisor(self, written: &str) -> Option<f64> {
        let text: String = written
            .chars()
            .filter(|c| !c.is_whitespace() && !matches!(c, '^' | '*' | '·'))
            .collect();
        let text = text.replace('²', "2").replace("⁻¹", "-1");
        if matches!(text.as_str(), "" | "-" | "SI" | "si") || self == Self::Text {
            return Some(1.0);
        }
        let per_second = || text.strip_suffix("/s").or_else(|| text.strip_suffix("s-1"));
        match self {
            Self::Length => length(&text),
            Self::Velocity => match text.split_once('/') {
                Some((way, span)) => Some(length(way)? / time(span)?),
                None => per_second().and_then(length),
            },
            Self::Rotation => match text.as_str() {
                "rpm" => Some(30.0 / std::f64::consts::PI),
                _ => match per_second()? {
                    "rad" | "1" | "" => Some(1.0),
                    "deg" | "°" => Some(180.0 / std::f64::consts::PI),
                    _ => None,
                },
            },
            Self::Area => match text.to_lowercase().as_str() {
                "darcy" | "d" => Some(1.0 / 9.869_233e-13),
                "md" => Some(1.0 / 9.869_233e-16),
                _ => text
                    .strip_suffix('2')
                    .and_then(length)
                    .map(|over| over * over),
            },
            Self::Time => time(&text),
            Self::Ratio => match text.as_str() {
                "1" => Some(1.0),
                "%" => Some(100.0),
                _ => None,
            },
            Self::Text => None,
        }
    }
}

/// Possible column of a table.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Name of the column in messages and in tables of this program.
    pub name: &'static str,
    /// Alternative names, in small letters with `_` between words, and the divisor of their numbers: 2 for a
    /// diameter instead of a radius.
    pub aliases: &'static [(&'static str, f64)],
    /// Dimension of the column's numbers.
    pub unit: Unit,
    /// `true` if every table must have it.
    pub required: bool,
}

/// Returns a name in small letters with `_` between words.
fn plain(name: &str) -> String {
    let word = |c: char| match c {
        '-' | '.' | ' ' | ':' => '_',
        c => c,
    };
    name.trim().to_lowercase().chars().map(word).collect()
}

/// Splits a name of a column from the unit after it: `x [mm]`, `x (mm)`, `x / mm`.
fn split_unit(cell: &str) -> (&str, Option<&str>) {
    let cell = cell.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}')] {
        if let Some(inner) = cell.strip_suffix(close)
            && let Some((name, unit)) = inner.rsplit_once(open)
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    match cell.split_once('/') {
        Some((name, unit)) => (name.trim(), Some(unit.trim())),
        None => (cell, None),
    }
}

/// Returns `true` if a cell names one of these columns.
fn is_known(columns: &[Column], cell: &str) -> bool {
    let name = plain(split_unit(cell).0);
    let other = |c: &Column| c.aliases.iter().any(|(other, _)| *other == name);
    columns.iter().any(|c| c.name == name || other(c))
}

/// Returns the separator of the cells of a line.
fn separator(line: &str) -> u8 {
    match line.trim() {
        line if line.contains(';') => b';',
        line if line.contains('\t') => b'\t',
        line if line.contains(',') => b',',
        line if line.contains(char::is_whitespace) => b' ',
        _ => b',',
    }
}

fn separator_name(separator: u8) -> &'static str {
    match separator {
        b';' => "semicolons",
        b'\t' => "tabs",
        b' ' => "spaces",
        _ => "commas",
    }
}

/// Returns a line with the separating spaces replaced by tabs; a unit in brackets remains with its name.
fn tabbed(line: &str) -> String {
    let mut tabbed = String::with_capacity(line.len());
    for word in line.split_whitespace() {
        if !tabbed.is_empty() {
            let unit = word.starts_with(['[', '(', '{']);
            tabbed.push(if unit { ' ' } else { '\t' });
        }
        tabbed.push_str(word);
    }
    tabbed
}

/// Returns the cells of one line, without empty ones at its end.
fn cells(line: &str, separator: u8) -> Vec<String> {
    let (line, separator): (Cow<'_, str>, u8) = match separator {
        b' ' => (tabbed(line).into(), b'\t'),
        other => (line.trim().into(), other),
    };
    let mut record = StringRecord::new();
    let mut reader = reader(&line, separator);
    // Reading text in memory cannot fail if rows may differ in length.
    let _ = reader.read_record(&mut record);
    let mut cells: Vec<String> = record.iter().map(|cell| cell.trim().to_owned()).collect();
    while cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    cells
}

fn reader(text: &str, separator: u8) -> ::csv::Reader<&[u8]> {
    ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator)
        .from_reader(text.as_bytes())
}

/// Returns a name for a message. A file that is not a table may contain secrets, so that only text like a name is
/// quoted.
fn quotable(name: &str, at: usize) -> String {
    let plain =
        |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | ' ' | '[' | ']' | '.' | '^');
    if name.chars().count() <= 40 && name.chars().all(plain) && !name.is_empty() {
        name.to_owned()
    } else {
        format!("number {}", at + 1)
    }
}

/// First words of grids of maps: of ESRI, GRASS and Surfer.
const GRID: [&str; 7] = [
    "ncols",
    "nrows",
    "xllcorner",
    "xllcenter",
    "cellsize",
    "north:",
    "dsaa",
];

/// Returns a line of names for cells that are separated by this sign.
fn example(columns: &[Column], separator: u8) -> String {
    let required = columns.iter().filter(|c| c.required).map(|c| c.name);
    let between = match separator {
        b';' => ";",
        b',' => ",",
        _ => " ",
    };
    required.collect::<Vec<_>>().join(between)
}

/// Returns `true` if the line is blank or a comment.
fn skipped(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with(['#', '%'])
}

fn uncommented(line: &str) -> &str {
    line.trim().trim_start_matches(['#', '%']).trim_start()
}

/// Returns `true` if all cells are numbers, including those with decimal commas.
fn numeric(cells: &[String]) -> bool {
    let number = |cell: &String| cell.is_empty() || cell.replace(',', ".").parse::<f64>().is_ok();
    !cells.is_empty() && cells.iter().all(number)
}

/// Returns the names of columns in a comment, if one of them is known.
fn names_in_comment(line: &str, known: &dyn Fn(&str) -> bool) -> Option<Vec<String>> {
    let text = uncommented(line);
    let names = match text.strip_prefix("format ") {
        Some(format) => format
            .split('_')
            .map(|name| name.trim().to_owned())
            .collect(),
        None => cells(text, separator(text)),
    };
    let told = names
        .iter()
        .filter(|name| known(split_unit(name).0))
        .count();
    (told >= 2).then_some(names)
}

/// Names of the columns of a text, and the rows below.
#[derive(Debug)]
pub struct Header<'t> {
    /// Names of the columns, with their units in brackets.
    pub names: Vec<String>,
    /// Units from a separate line.
    pub units: Vec<String>,
    /// Text of the rows.
    pub rows: Cow<'t, str>,
    /// Number of lines above the rows.
    pub above: u64,
    /// Separator of the cells of a row; a space represents any white space.
    pub separator: u8,
}

impl<'t> Header<'t> {
    /// Finds the names of the columns in a text, given the possible columns.
    ///
    /// # Errors
    /// If the text has no names or no lines; the error is a sentence.
    pub fn find(text: &'t str, columns: &[Column]) -> Result<Self, String> {
        let text = text.trim_start_matches('\u{feff}');
        // Line ends of old Macintosh systems.
        if text.contains('\r') && !text.contains('\n') {
            let text = text.replace('\r', "\n");
            let found = Header::find_in(&text, columns)?;
            return Ok(Self {
                names: found.names,
                units: found.units,
                rows: found.rows.into_owned().into(),
                above: found.above,
                separator: found.separator,
            });
        }
        Self::find_in(text, columns)
    }

    /// Returns `true` if one of the names, in small letters with `_` between words, begins in this way.
    #[must_use]
    pub fn has_name_that_begins(&self, begin: &str) -> bool {
        let mut names = self.names.iter().map(|name| plain(split_unit(name).0));
        names.any(|name| name.starts_with(begin))
    }

    fn find_in(text: &'t str, columns: &[Column]) -> Result<Self, String> {
        let known = |name: &str| is_known(columns, name);
        let mut comment = None;
        let (mut rows, mut above, mut stated) = (text, 0, None);
        while !rows.is_empty() {
            let (line, below) = rows.split_once('\n').unwrap_or((rows, ""));
            if let Some(sign) = line.trim().to_lowercase().strip_prefix("sep=") {
                stated = sign.bytes().next();
            } else if skipped(line) {
                comment = names_in_comment(line, &known).or(comment);
            } else {
                let separator = stated.unwrap_or_else(|| separator(line));
                let names = cells(line, separator);
                if let [first, ..] = &names[..]
                    && GRID.contains(&first.to_lowercase().as_str())
                {
                    return Err(format!(
                        "line {}: this is a grid of a map (ESRI, GRASS, Surfer), whose numbers have no coordinates: \
                         write a table with a row for each node and a first line such as `{}`",
                        above + 1,
                        example(columns, b',')
                    ));
                }
                if !numeric(&names) {
                    let header = Self {
                        names,
                        units: Vec::new(),
                        rows: below.into(),
                        above: above + 1,
                        separator,
                    };
                    return Ok(header.with_units());
                }
                if let Some(names) = comment {
                    return Ok(Self {
                        names,
                        units: Vec::new(),
                        rows: rows.into(),
                        above,
                        separator,
                    });
                }
                return Err(format!(
                    "line {} holds numbers where the names of the columns are expected: add a first line such as `{}`",
                    above + 1,
                    example(columns, separator)
                ));
            }
            (rows, above) = (below, above + 1);
        }
        Err("the file is empty".into())
    }

    /// Removes a line of units below the names, with or without a comment sign, from the rows.
    fn with_units(self) -> Self {
        let Cow::Borrowed(rows) = self.rows else {
            return self;
        };
        let (line, below) = rows.split_once('\n').unwrap_or((rows, ""));
        let units = cells(uncommented(line), self.separator);
        let all = [
            Unit::Length,
            Unit::Velocity,
            Unit::Rotation,
            Unit::Area,
            Unit::Time,
            Unit::Ratio,
        ];
        let is_unit = |cell: &String| {
            let cell = without_brackets(cell);
            cell.is_empty() || all.iter().any(|unit| unit.divisor(cell).is_some())
        };
        let some = units.iter().any(|cell| !without_brackets(cell).is_empty());
        if some && !numeric(&units) && units.len() <= self.names.len() && units.iter().all(is_unit)
        {
            return Self {
                units,
                rows: below.into(),
                above: self.above + 1,
                ..self
            };
        }
        self
    }
}

/// Returns a unit without its brackets.
fn without_brackets(unit: &str) -> &str {
    unit.trim().trim_matches(['[', ']', '(', ')']).trim()
}

/// Reason for which a table cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Sentence that names the line or the column.
    Sentence(String),
    /// The header contains an unknown column of this name.
    Unknown(String),
}

impl From<String> for Refusal {
    fn from(sentence: String) -> Self {
        Self::Sentence(sentence)
    }
}

/// Returns the sentence about a header without a required column: one of its unknown columns may be meant.
fn without_column(name: &str, unknown: &[String]) -> String {
    /// Maximum number of unknown columns that are named.
    const MAX_NAMED: usize = 6;
    let named: Vec<String> = unknown.iter().map(|name| format!("`{name}`")).collect();
    match &named[..] {
        [] => format!("the header has no column `{name}`"),
        [one] => format!(
            "the header has no column `{name}`, but an unknown column {one}: rename it to `{name}` if it is that, or \
             add the column `{name}`"
        ),
        several => format!(
            "the header has no column `{name}`, but the unknown columns {}{}: rename the one that is meant to \
             `{name}`, or add the column `{name}`",
            several[..several.len().min(MAX_NAMED)].join(", "),
            if several.len() > MAX_NAMED {
                ", .."
            } else {
                ""
            }
        ),
    }
}

/// Rows of a table, one after the other.
#[derive(Debug)]
pub struct Sheet<'t> {
    rows_text: Cow<'t, str>,
    names: Vec<String>,
    /// Position of each known column in a row, and the divisor of its numbers.
    found: Vec<Option<(usize, f64)>>,
    known: Vec<Column>,
    above: u64,
    separator: u8,
}

impl<'t> Sheet<'t> {
    /// Finds the known columns in a text.
    ///
    /// # Errors
    /// If the text cannot be read or has an unknown column; the error names the line or the column.
    pub fn new(text: &'t str, known: &[Column]) -> Result<Self, Refusal> {
        Self::below(Header::find(text, known)?, known, true)
    }

    /// Finds the known columns of a header. With `all` an unknown column is refused, otherwise it is ignored.
    ///
    /// # Errors
    /// If the text cannot be read or has an unknown column; the error names the line or the column.
    pub fn below(header: Header<'t>, known: &[Column], all: bool) -> Result<Self, Refusal> {
        let mut found: Vec<Option<(usize, f64)>> = vec![None; known.len()];
        let mut unknown: Vec<String> = Vec::new();
        for (at, cell) in header.names.iter().enumerate() {
            let (name, unit) = split_unit(cell);
            let called = plain(name);
            let divisor = |column: &Column| {
                let mut names =
                    std::iter::once((column.name, 1.0)).chain(column.aliases.iter().copied());
                names.find(|(known, _)| *known == called)
            };
            let matched = known
                .iter()
                .enumerate()
                .find_map(|(k, column)| Some((k, divisor(column)?)));
            let Some((k, (_, over))) = matched else {
                if all && !header.names.iter().any(|cell| is_known(known, cell)) {
                    return Err(Refusal::Sentence(format!(
                        "line {} names none of the columns: the first line of a table is such as `{}`",
                        header.above,
                        example(known, header.separator)
                    )));
                }
                unknown.push(quotable(name, at));
                continue;
            };
            let below = header.units.get(at).map(|unit| without_brackets(unit));
            let unit = unit.or(below).unwrap_or_default();
            let Some(unit_over) = known[k].unit.divisor(unit) else {
                return Err(Refusal::Sentence(format!(
                    "the column `{cell}` is in {unit}, expected {}",
                    known[k].unit.name()
                )));
            };
            if let Some((other, _)) = found[k] {
                return Err(Refusal::Sentence(
                    if plain(split_unit(&header.names[other]).0) == called {
                        format!("the header names the column `{name}` twice")
                    } else {
                        format!(
                            "the columns `{}` and `{cell}` both state the {}",
                            header.names[other], known[k].name
                        )
                    },
                ));
            }
            found[k] = Some((at, over * unit_over));
        }
        let missing = known.iter().zip(&found);
        let mut missing = missing.filter(|(column, found)| column.required && found.is_none());
        if let Some((column, _)) = missing.next() {
            return Err(Refusal::Sentence(without_column(column.name, &unknown)));
        }
        if let Some(name) = unknown.into_iter().next().filter(|_| all) {
            return Err(Refusal::Unknown(name));
        }
        let rows_text = match header.separator {
            b' ' => header
                .rows
                .lines()
                .map(|line| tabbed(line) + "\n")
                .collect::<String>()
                .into(),
            _ => header.rows,
        };
        Ok(Self {
            rows_text,
            names: header.names,
            found,
            known: known.to_vec(),
            above: header.above,
            separator: header.separator,
        })
    }

    /// Returns `true` if the table contains this known column.
    #[must_use]
    pub fn has(&self, column: usize) -> bool {
        self.found[column].is_some()
    }

    /// Calls a function with each row until the first error.
    ///
    /// # Errors
    /// If the function fails, or a row and the line of names differ in length.
    pub fn each(
        &self,
        mut take: impl FnMut(&SheetRow<'_>) -> Result<(), String>,
    ) -> Result<(), String> {
        let separator = if self.separator == b' ' {
            b'\t'
        } else {
            self.separator
        };
        let mut rows = reader(&self.rows_text, separator);
        let mut cells = StringRecord::new();
        while matches!(rows.read_record(&mut cells), Ok(true)) {
            let first = cells.get(0).unwrap_or_default().trim_start();
            if first.starts_with(['#', '%']) || cells.iter().all(|cell| cell.trim().is_empty()) {
                continue;
            }
            let row = SheetRow {
                sheet: self,
                cells: &cells,
            };
            row.check_length()?;
            take(&row)?;
        }
        Ok(())
    }
}

/// Row below the names.
#[derive(Clone, Copy, Debug)]
pub struct SheetRow<'r> {
    sheet: &'r Sheet<'r>,
    cells: &'r StringRecord,
}

impl SheetRow<'_> {
    /// Returns the line number in the text, from 1.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.sheet.above + csv::line(self.cells, &self.sheet.rows_text)
    }

    /// Checks that the row has a cell for each name; empty cells at its end are ignored.
    fn check_length(&self) -> Result<(), String> {
        let (names, mut length) = (self.sheet.names.len(), self.cells.len());
        while length > names
            && self
                .cells
                .get(length - 1)
                .is_some_and(|cell| cell.trim().is_empty())
        {
            length -= 1;
        }
        if length == names {
            return Ok(());
        }
        let cells = if length == 1 { "cell" } else { "cells" };
        let separator = self.sheet.separator;
        let advice = if length > names && separator == b',' {
            "; if its commas are decimal signs, write points (4.5 instead of 4,5)".to_owned()
        } else if length == 1 && names > 1 {
            format!(
                "; the header separates its cells by {}",
                separator_name(separator)
            )
        } else {
            String::new()
        };
        Err(format!(
            "line {} has {length} {cells} where the header names {names} columns{advice}",
            self.line()
        ))
    }

    /// Returns the text of a known column; empty if the table does not contain it.
    #[must_use]
    pub fn text(&self, column: usize) -> &str {
        let cell = self.sheet.found[column].and_then(|(at, _)| self.cells.get(at));
        cell.unwrap_or_default().trim()
    }

    /// Returns the finite number in a known column in SI units.
    ///
    /// # Errors
    /// If the cell is not a finite number; the message contains the line, the column and the value.
    pub fn number(&self, column: usize) -> Result<f64, String> {
        let text = self.text(column);
        let over = self.sheet.found[column].map_or(1.0, |(_, over)| over);
        if let Some(number) = text.parse::<f64>().ok().filter(|x| x.is_finite()) {
            return Ok(number / over);
        }
        let advice = if text.contains(',') && text.replace(',', ".").parse::<f64>().is_ok() {
            format!(": write a decimal point, {}", text.replace(',', "."))
        } else {
            String::new()
        };
        let known = self.sheet.known[column].name;
        let name = self.sheet.found[column].and_then(|(at, _)| self.sheet.names.get(at));
        Err(format!(
            "line {}: column `{}` holds `{}`, which is not a number{advice}",
            self.line(),
            name.map_or(known, String::as_str),
            text.chars().take(24).collect::<String>()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks velocities in the units of geotechnical reports.
    #[test]
    fn velocities_have_any_length_and_time() {
        for (unit, over) in [
            ("m/s", 1.0),
            ("cm/s", 100.0),
            ("mm s-1", 1e3),
            ("m/d", 86_400.0),
            ("m/day", 86_400.0),
            ("mm/h", 3.6e6),
        ] {
            let found = Unit::Velocity.divisor(unit).unwrap();
            assert!((found / over - 1.0).abs() < 1e-12, "{unit}: {found}");
        }
        assert!(Unit::Velocity.divisor("m").is_none());
        assert!(Unit::Velocity.divisor("m/kg").is_none());
    }
}
