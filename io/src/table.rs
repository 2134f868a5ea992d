//! Time series as CSV. Each row is written completely before the next step.
//!
//! The first column is the step. The line after the header may contain units as a comment (`# -,s,kg`), which
//! readers with support for comments skip. Numbers have the smallest number of digits that reproduces the same
//! bits.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::atomic;
use crate::csv;
use crate::error::{Error, Result};
use crate::plain;

/// Growing CSV file, written by one rank only.
#[derive(Debug)]
pub struct CsvTable {
    path: PathBuf,
    file: File,
    columns: usize,
    line: String,
}

/// Name and unit of a column; if all units are empty, the line of units is omitted.
pub type Heading<'a> = (&'a str, &'a str);

fn header(columns: &[Heading]) -> String {
    let mut names = String::from("step");
    let mut units = String::from("# -");
    for (name, unit) in columns {
        names.push(',');
        names.push_str(name);
        units.push(',');
        units.push_str(unit);
    }
    names.push('\n');
    if columns.iter().any(|c| !c.1.is_empty()) {
        names.push_str(&units);
        names.push('\n');
    }
    names
}

fn check(columns: &[Heading]) -> Result<()> {
    for (name, unit) in columns {
        let special = |c: char| matches!(c, ',' | '"' | '\n' | '\r' | '#');
        if name.is_empty() || name.contains(special) || unit.contains(special) {
            return Err(Error::invalid(
                name,
                "a heading has no comma, quote, # or line break",
            ));
        }
    }
    Ok(())
}

impl CsvTable {
    /// Starts a new table with `step` and the given columns.
    ///
    /// # Errors
    /// If the system refuses an operation, or if a heading would need quoting ([`Error::Invalid`]).
    pub fn create(path: &Path, columns: &[Heading]) -> Result<Self> {
        check(columns)?;
        atomic::write(path, header(columns).as_bytes())?;
        Self::append(path, columns.len())
    }

    /// Continues a table after a restart: rows with a step after `step`, and an incomplete last row after a crash,
    /// are dropped. A missing table is created.
    ///
    /// # Errors
    /// If the system refuses an operation, or if the columns differ or a row is invalid ([`Error::Corrupt`]).
    pub fn resume(path: &Path, columns: &[Heading], step: u64) -> Result<Self> {
        check(columns)?;
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Self::create(path, columns);
            }
            Err(e) => return Err(Error::io("read", path, &e)),
        };
        let head = header(columns);
        let Some(rows) = text.strip_prefix(&head) else {
            return Err(Error::corrupt(
                path,
                format!("its columns are not {}", head.trim_end()),
            ));
        };
        let mut kept = head.clone();
        for row in rows.split_inclusive('\n').filter(|row| row.ends_with('\n')) {
            let at = csv::step_of(row)
                .ok_or_else(|| Error::corrupt(path, format!("{row:?} begins with no step")))?;
            if at <= step {
                kept.push_str(row);
            }
        }
        if kept.len() < text.len() {
            atomic::write(path, kept.as_bytes())?;
        }
        Self::append(path, columns.len())
    }

    fn append(path: &Path, columns: usize) -> Result<Self> {
        let file = atomic::append(path)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            columns,
            line: String::new(),
        })
    }

    /// Adds a row in one write. It allocates only for a row longer than all earlier ones.
    ///
    /// # Errors
    /// If the system refuses an operation, or if the number of values differs from that of the columns
    /// ([`Error::Invalid`]).
    pub fn row(&mut self, step: u64, values: &[f64]) -> Result<()> {
        if values.len() != self.columns {
            return Err(Error::invalid(
                &self.path.display().to_string(),
                format!("{} values for {} columns", values.len(), self.columns),
            ));
        }
        self.line.clear();
        // Writing to a String cannot fail.
        let _ = write!(self.line, "{step}");
        for value in values {
            let _ = write!(self.line, ",{value:?}");
        }
        self.line.push('\n');
        self.file
            .write_all(self.line.as_bytes())
            .map_err(|e| Error::io("write", &self.path, &e))
    }

    /// Flushes the rows to the disk, for example before a checkpoint.
    ///
    /// # Errors
    /// If the system refuses an operation.
    pub fn sync(&self) -> Result<()> {
        self.file
            .sync_data()
            .map_err(|e| Error::io("flush", &self.path, &e))
    }
}

/// Contents of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Names of the columns, `step` first.
    pub columns: Vec<String>,
    /// Units in the same order; empty if the file contains none.
    pub units: Vec<String>,
    /// Steps of the rows.
    pub steps: Vec<u64>,
    /// Values of the rows, without the step.
    pub values: Vec<Vec<f64>>,
}

impl Rows {
    /// Returns the values of one column by name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.columns.iter().skip(1).position(|c| c == name)?;
        Some(self.values.iter().map(|row| row[at]).collect())
    }
}

/// Reads a table.
///
/// # Errors
/// If the system refuses an operation, or if a row does not fit the header ([`Error::Corrupt`], with the line). A
/// last line without its end is a row that is being written, and is omitted.
pub fn read(path: &Path) -> Result<Rows> {
    let text = plain::text(path, plain::LONGEST_TABLE)?;
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let mut rows = Rows {
        columns: Vec::new(),
        units: Vec::new(),
        steps: Vec::new(),
        values: Vec::new(),
    };
    let list = |cells: Vec<&str>| cells.into_iter().map(str::to_owned).collect();
    if let Some(mut reader) = csv::Reader::new(whole) {
        rows.columns = list(reader.names());
        while let Some(row) = reader.row() {
            let wrong = || {
                let cells: Vec<&str> = row.cells().collect();
                let line = cells.join(",");
                Error::corrupt(path, format!("line {} is {line:?}", row.line()))
            };
            let mut cells = row.cells();
            let step = cells
                .next()
                .and_then(|c| c.parse().ok())
                .ok_or_else(wrong)?;
            let values: Vec<f64> = cells
                .map(|c| c.parse().map_err(|_| wrong()))
                .collect::<Result<_>>()?;
            if values.len() + 1 != rows.columns.len() {
                return Err(wrong());
            }
            rows.steps.push(step);
            rows.values.push(values);
        }
        rows.units = list(reader.units());
    }
    if rows.columns.first().map(String::as_str) != Some("step") {
        return Err(Error::corrupt(path, "its first column is not step"));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [Heading; 2] = [("time", "s"), ("eroded_mass", "kg")];

    #[test]
    fn rows_come_back_to_the_bit_and_a_restart_cuts_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("erosion.csv");
        let mut table = CsvTable::create(&path, &COLUMNS).unwrap();
        let values = [0.1 + 0.2, 1e-300, f64::MAX, -0.0];
        for (step, v) in (0_u64..).zip(values) {
            table.row(10 * step, &[v, -v]).unwrap();
        }
        table.sync().unwrap();
        assert!(table.row(50, &[1.0]).is_err());
        let rows = read(&path).unwrap();
        assert_eq!(rows.columns, ["step", "time", "eroded_mass"]);
        assert_eq!(rows.units, ["-", "s", "kg"]);
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&rows.column("time").unwrap()), bits(&values));
        assert_eq!(rows.column("step"), None);

        let mut table = CsvTable::resume(&path, &COLUMNS, 15).unwrap();
        table.row(20, &[2.0, 3.0]).unwrap();
        assert_eq!(read(&path).unwrap().steps, [0, 10, 20]);
    }

    #[test]
    fn a_torn_last_row_is_dropped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        CsvTable::create(&path, &COLUMNS)
            .unwrap()
            .row(1, &[1.0, 2.0])
            .unwrap();
        let whole = fs::read(&path).unwrap();
        fs::write(&path, [&whole[..], b"2,0."].concat()).unwrap();
        assert_eq!(read(&path).unwrap().steps, [1]);
        CsvTable::resume(&path, &COLUMNS, 9).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole);
    }

    #[test]
    fn other_columns_and_broken_rows_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        CsvTable::resume(&path, &[("x", "")], 0).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "step,x\n");
        assert!(CsvTable::resume(&path, &COLUMNS, 0).is_err());
        assert!(CsvTable::create(&path, &[("a,b", "")]).is_err());
        fs::write(&path, "step,x\n1,2,3\n").unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
        fs::write(&path, "step,x\nq,2\n").unwrap();
        assert!(CsvTable::resume(&path, &[("x", "")], 5).is_err());
        fs::write(&path, "").unwrap();
        assert!(read(&path).is_err());
    }
}
