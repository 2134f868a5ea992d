//! Reading and writing of tables as CSV text, with the crate `csv`.
//!
//! The first line names the columns. Lines that begin with `#` and blank lines are skipped; the first `#` line
//! below the names contains the units. If numbers follow a `#` line directly, that line contains the names. White
//! space around a cell is ignored. Cells in quotes may contain commas.

use ::csv::{QuoteStyle, ReaderBuilder, StringRecord, Terminator, WriterBuilder};
use serde::de::DeserializeOwned;

/// Reader of the rows of a text, one after the other.
#[derive(Debug)]
pub struct Reader<'t> {
    text: &'t str,
    rows: ::csv::Reader<&'t [u8]>,
    names: StringRecord,
    units: Option<StringRecord>,
    row: StringRecord,
    /// `true` if the row is the first one and has not been returned.
    pending: bool,
}

impl<'t> Reader<'t> {
    /// Returns a reader of a text; `None` if there is no line of names.
    #[must_use]
    pub fn new(text: &'t str) -> Option<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let rows = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes());
        let mut reader = Self {
            text,
            rows,
            names: StringRecord::new(),
            units: None,
            row: StringRecord::new(),
            pending: false,
        };
        if !reader.advance() {
            return None;
        }
        let above = reader.units.take();
        let numbers = reader
            .row
            .iter()
            .all(|cell| cell.trim().parse::<f64>().is_ok());
        if let (Some(names), true) = (above, numbers) {
            reader.names = names.iter().map(uncommented).collect();
            reader.pending = true;
        } else {
            reader.names = reader.row.iter().map(str::trim).collect();
        }
        Some(reader)
    }

    /// Returns the names of the columns.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        self.names.iter().collect()
    }

    /// Returns the index of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// Returns the units, if a line contained them above the rows read so far.
    #[must_use]
    pub fn units(&self) -> Vec<&str> {
        self.units.iter().flatten().map(uncommented).collect()
    }

    /// Returns the next row.
    pub fn row(&mut self) -> Option<CsvRow<'_>> {
        let there = std::mem::take(&mut self.pending) || self.advance();
        there.then_some(CsvRow {
            text: self.text,
            names: &self.names,
            cells: &self.row,
        })
    }

    /// Reads the next row that is neither a comment nor blank; returns `true` if there is one. Reading text in
    /// memory cannot fail if rows may differ in length.
    fn advance(&mut self) -> bool {
        while matches!(self.rows.read_record(&mut self.row), Ok(true)) {
            let first = self.row.get(0).unwrap_or_default().trim_start();
            if first.starts_with('#') {
                self.units.get_or_insert_with(|| self.row.clone());
            } else if self.row.len() > 1 || !first.is_empty() {
                return true;
            }
        }
        false
    }
}

fn uncommented(cell: &str) -> &str {
    cell.trim().trim_start_matches('#').trim_start()
}

/// Returns the line number of a record in a text, from 1; 0 for a record from another text.
pub(crate) fn line(record: &StringRecord, text: &str) -> u64 {
    let Some(found) = record.position() else {
        return 0;
    };
    // The crate returns the position at which it began to search: blank lines may precede the row.
    let rest = usize::try_from(found.byte()).map_or("", |at| text.get(at..).unwrap_or(""));
    let blank = rest.bytes().take_while(|b| matches!(b, b'\r' | b'\n'));
    found.line() + blank.filter(|b| *b == b'\n').map(|_| 1).sum::<u64>()
}

/// Row below the names.
#[derive(Clone, Copy, Debug)]
pub struct CsvRow<'r> {
    text: &'r str,
    names: &'r StringRecord,
    cells: &'r StringRecord,
}

impl CsvRow<'_> {
    /// Returns the line number in the text, from 1.
    #[must_use]
    pub fn line(&self) -> u64 {
        line(self.cells, self.text)
    }

    /// Returns the texts of the cells.
    pub fn cells(&self) -> impl Iterator<Item = &str> {
        self.cells.iter().map(str::trim)
    }

    /// Returns the text of a cell; `None` if the row is shorter.
    #[must_use]
    pub fn text(&self, column: usize) -> Option<&str> {
        self.cells.get(column).map(str::trim)
    }

    /// Returns the finite number in a column.
    ///
    /// # Errors
    /// If the cell is not a finite number; the message contains the line, the column and the value.
    pub fn number(&self, column: usize) -> Result<f64, String> {
        let text = self.text(column);
        text.and_then(|cell| cell.parse::<f64>().ok())
            .filter(|x| x.is_finite())
            .ok_or_else(|| {
                let name = self.names.get(column).unwrap_or_default();
                let found = text.map_or("is missing".into(), |text| format!("holds `{text}`"));
                format!(
                    "line {}: column `{name}` {found}, which is not a number",
                    self.line()
                )
            })
    }

    /// Returns the row as a struct whose fields have the names of the columns.
    ///
    /// # Errors
    /// If a value does not fit its column; the message contains the line, the column and the value.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, String> {
        if self.cells.len() != self.names.len() {
            return Err(format!(
                "line {} has {} columns, expected {}",
                self.line(),
                self.cells.len(),
                self.names.len()
            ));
        }
        let mut cells = self.cells.clone();
        cells.trim();
        cells.deserialize(Some(self.names)).map_err(|error| {
            let (field, reason) = match error.kind() {
                ::csv::ErrorKind::Deserialize { err, .. } => (err.field(), err.kind().to_string()),
                _ => (None, error.to_string()),
            };
            let column = field.and_then(|n| usize::try_from(n).ok());
            match column.and_then(|n| Some((self.names.get(n)?, self.text(n)?))) {
                Some((name, value)) => {
                    format!("line {}: column `{name}` cannot be `{value}`", self.line())
                }
                None => format!("line {}: {reason}", self.line()),
            }
        })
    }
}

/// Appends a line of cells to a text. A cell with a comma, a quote or a line break is quoted.
pub fn push_line<C: AsRef<str>>(text: &mut String, cells: impl IntoIterator<Item = C>) {
    let mut writer = WriterBuilder::new()
        .quote_style(QuoteStyle::Necessary)
        .terminator(Terminator::Any(b'\n'))
        .from_writer(Vec::new());
    // Writing to memory cannot fail, and the result is valid UTF-8.
    let written = writer.write_record(cells.into_iter().map(|cell| cell.as_ref().to_owned()));
    if written.is_ok()
        && let Ok(line) = writer.into_inner()
    {
        text.push_str(&String::from_utf8_lossy(&line));
    }
}

/// Returns the step at the beginning of a line.
#[must_use]
pub fn step_of(line: &str) -> Option<u64> {
    line.split(',').next()?.trim_end().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize, PartialEq)]
    struct Grain {
        #[serde(rename = "x [m]")]
        x: f64,
        name: String,
    }

    const TEXT: &str = "# made by hand\nx [m], name\n# m,-\n\n 1e-3 ,sand\r\n  \n2,\"clay, wet\"\n3\nfour,silt\nnan,\
        silt\n";

    #[test]
    fn rows_are_read_with_their_lines_and_units() {
        let mut reader = Reader::new(TEXT).unwrap();
        assert_eq!(reader.names(), ["x [m]", "name"]);
        assert_eq!(reader.column("name"), Some(1));
        let mut seen = Vec::new();
        while let Some(row) = reader.row() {
            seen.push((row.line(), row.read::<Grain>(), row.number(0)));
        }
        assert_eq!(reader.units(), ["m", "-"]);
        let grain = |x, name: &str| Grain {
            x,
            name: name.into(),
        };
        assert_eq!(seen[0], (5, Ok(grain(1e-3, "sand")), Ok(1e-3)));
        assert_eq!(seen[1].1, Ok(grain(2.0, "clay, wet")));
        assert_eq!(seen[2].1, Err("line 8 has 1 columns, expected 2".into()));
        assert_eq!(
            seen[3].1,
            Err("line 9: column `x [m]` cannot be `four`".into())
        );
        assert_eq!(
            seen[4].2,
            Err("line 10: column `x [m]` holds `nan`, which is not a number".into())
        );
        assert!(Reader::new("# nothing\n\n").is_none());
        let mut reader = Reader::new("# y,u\n0,1\n").unwrap();
        assert_eq!(reader.names(), ["y", "u"]);
        assert_eq!(reader.row().unwrap().number(1), Ok(1.0));
        assert!(reader.row().is_none());
    }

    #[test]
    fn lines_are_written_with_quotes_where_they_are_needed() {
        let mut text = String::new();
        push_line(&mut text, ["a", "b, c", "", "say \"d\""]);
        push_line(&mut text, [1.5, 2.0].map(|x: f64| x.to_string()));
        assert_eq!(text, "a,\"b, c\",,\"say \"\"d\"\"\"\n1.5,2\n");
        assert_eq!(step_of("12,0.5\n"), Some(12));
        assert_eq!(step_of("step,time\n"), None);
    }
}
