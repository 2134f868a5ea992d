//! Velocities over a face from a CSV file: the tangential coordinates \[m\], then the velocity components [m/s].
//!
//! The first line is a header; empty lines and lines that begin with `#` are skipped. In 2-D the velocity is linear
//! between rows, in 3-D it is that of the nearest row; beyond the rows it is that of the outermost one.

use io::csv::Reader;
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows of a table at most.
pub const MOST_ROWS: usize = 1_000_000;
/// Longest file \[bytes\]: so many rows of five numbers with all their digits.
const LONGEST: u64 = 256 << 20;

/// A table of velocities; in texts it stands as its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    path: PathBuf,
    dimension: usize,
    /// In rising order of the first coordinate.
    rows: Arc<Vec<Vec<f64>>>,
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.path.serialize(serializer)
    }
}

impl Table {
    /// A table that holds nothing, in the place of one that cannot be read.
    pub(crate) fn empty(path: PathBuf, dimension: usize) -> Self {
        Self {
            path,
            dimension,
            rows: Arc::new(Vec::new()),
        }
    }

    /// The table of a file.
    ///
    /// # Errors
    /// A sentence that names the file and the line.
    pub(crate) fn read(path: PathBuf, dimension: usize) -> Result<Self, String> {
        let text = io::plain::text(&path, LONGEST).map_err(|e| e.to_string())?;
        let rows = rows(&text, dimension).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self {
            path,
            dimension,
            rows: Arc::new(rows),
        })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// No row at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The largest speed of any row [m/s].
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let speed = |row: &Vec<f64>| {
            let squares = row[self.dimension - 1..].iter().map(|u| u * u);
            squares.sum::<f64>().sqrt()
        };
        self.rows.iter().map(speed).fold(0.0, f64::max)
    }

    /// The velocity [m/s] at the tangential coordinates \[m\] of a place.
    #[must_use]
    pub fn at(&self, across: &[f64]) -> [f64; 3] {
        let rows = &self.rows;
        let mut velocity = [0.0; 3];
        if rows.is_empty() {
            return velocity;
        }
        if self.dimension == 2 {
            let k = rows.partition_point(|row| row[0] < across[0]);
            let (low, high) = (&rows[k.saturating_sub(1)], &rows[k.min(rows.len() - 1)]);
            let width = high[0] - low[0];
            let s = if width > 0.0 {
                ((across[0] - low[0]) / width).clamp(0.0, 1.0)
            } else {
                0.0
            };
            for (to, c) in velocity.iter_mut().zip(1..3) {
                *to = low[c] + s * (high[c] - low[c]);
            }
        } else {
            let distance =
                |row: &Vec<f64>| (row[0] - across[0]).powi(2) + (row[1] - across[1]).powi(2);
            let nearest = rows
                .iter()
                .min_by(|a, b| distance(a).total_cmp(&distance(b)));
            for (to, u) in velocity
                .iter_mut()
                .zip(nearest.iter().flat_map(|row| &row[2..]))
            {
                *to = *u;
            }
        }
        velocity
    }
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
        let rows = rows(text, dimension)?;
        Ok(Table {
            rows: Arc::new(rows),
            ..Table::empty(PathBuf::new(), dimension)
        })
    }

    #[test]
    fn rows_are_interpolated_and_the_fastest_is_known() {
        let flat = table("y,u,v\n# note\n\n1,4,-3\n0,2,0\n", 2).unwrap();
        assert_eq!(flat.at(&[0.5]), [3.0, -1.5, 0.0]);
        assert_eq!(flat.at(&[-1.0]), [2.0, 0.0, 0.0]);
        assert_eq!(flat.at(&[9.0]), [4.0, -3.0, 0.0]);
        assert_eq!(flat.fastest(), 5.0);
        let solid = table("y,z,u,v,w\n0,0,1,0,0\n1,1,0,0,2\n", 3).unwrap();
        assert_eq!(solid.at(&[0.9, 0.6]), [0.0, 0.0, 2.0]);
        assert_eq!(solid.fastest(), 2.0);
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
