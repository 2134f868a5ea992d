//! Velocities over a face from a CSV file: the tangential coordinates \[m\], then the velocity components [m/s].
//!
//! The first line is a header. Empty lines and lines that begin with `#` are skipped. [`Table`] interpolates between the rows.

use crate::lbm::boundary::profile::Table;
use io::csv::Reader;
use std::path::Path;

/// Rows of a table at most.
pub const MOST_ROWS: usize = 1_000_000;
/// Longest file \[bytes\]: so many rows of five numbers with all their digits.
const LONGEST: u64 = 256 << 20;

/// The table of a file.
///
/// # Errors
/// A sentence that names the file and the line.
pub(crate) fn read(path: &Path, dimension: usize) -> Result<Table, String> {
    let text = io::plain::text(path, LONGEST).map_err(|e| e.to_string())?;
    let rows = rows(&text, dimension).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(Table::new(dimension, rows))
}

/// The rows of a text in rising order of the first coordinate.
fn rows(text: &str, dimension: usize) -> Result<Vec<Vec<f64>>, String> {
    let numbers = 2 * dimension - 1;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut lines = Reader::new(text).ok_or("there are no rows below the header")?;
    while let Some(line) = lines.row() {
        if rows.len() >= MOST_ROWS {
            return Err(format!("more than {MOST_ROWS} rows"));
        }
        let row: Result<Vec<f64>, String> = (0..line.cells().count().min(numbers + 1))
            .map(|column| line.number(column))
            .collect();
        match row {
            Ok(row) if row.len() == numbers && row.iter().all(|v| v.abs() <= LARGEST) => {
                rows.push(row);
            }
            _ => {
                let names = if dimension == 2 {
                    "a coordinate and two velocity components"
                } else {
                    "two coordinates and three velocity components"
                };
                return Err(format!(
                    "line {} needs {numbers} finite numbers: {names}",
                    line.line()
                ));
            }
        }
    }
    if rows.is_empty() {
        return Err("there are no rows below the header".into());
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(rows)
}

/// No coordinate and no velocity is larger, as anywhere in a case.
const LARGEST: f64 = 1e30;

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str, dimension: usize) -> Result<Table, String> {
        Ok(Table::new(dimension, rows(text, dimension)?))
    }

    #[test]
    fn rows_are_read_in_rising_order() {
        let flat = table("y,u,v\n# note\n\n1,4,-3\n0,2,0\n", 2).unwrap();
        assert_eq!(flat.at(&[0.5]), [3.0, -1.5, 0.0]);
        let solid = table("y,z,u,v,w\n0,0,1,0,0\n1,1,0,0,2\n", 3).unwrap();
        assert_eq!(solid.at(&[0.9, 0.6]), [0.0, 0.0, 2.0]);
    }

    #[test]
    fn what_is_no_table_is_told_with_its_line() {
        let error = |text: &str| table(text, 2).unwrap_err();
        assert!(error("").contains("no rows"));
        assert!(error("y,u,v\n").contains("no rows"));
        assert!(error("y,u,v\n0,1,2\n1,2\n").contains("line 3 needs 3"));
        assert!(error("y,u,v\n0,1,2,3\n").contains("line 2"));
        assert!(error("y,u,v\n0,1,nan\n").contains("line 2"));
        assert!(error("y,u,v\n0,1,1e300\n").contains("line 2"));
        assert!(error("y,u,v\n0,1,fast\n").contains("line 2"));
    }
}
