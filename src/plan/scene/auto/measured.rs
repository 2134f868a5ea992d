//! Measured errors of forces and flows relative to published values, as a function of the number of cells.
//!
//! A row of `measured.csv` is a problem with a known solution at one resolution. Its error is the largest over several
//! positions of the body relative to the nodes, at this and at every finer resolution: the error on a staircase
//! boundary does not decrease evenly, and a body is generally not at the most favourable position. Its cost is that
//! of the fluid in a box of one diameter (a wall problem: one width d) over the time d²/nu.
//!
//! [`bound`](super::bound) computes a bound of the error from all rows of an obstacle.

use io::csv::Reader;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

const TABLE: &str = include_str!("measured.csv");

/// A measured row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredRow {
    /// Problem with a known solution.
    pub problem: String,
    /// Dimension: 2 or 3.
    pub dimension: usize,
    /// Obstacle in the fluid: `walls`, a coupling, or `blocks: ` with the solid collision operator.
    pub obstacle: String,
    /// Velocity set.
    pub lattice: String,
    /// Collision operator.
    pub operator: String,
    /// Cells across the body or from wall to wall.
    pub cells: f64,
    /// Relaxation time tau.
    pub relaxation_time: f64,
    /// Lattice velocity U dt/h.
    pub lattice_velocity: f64,
    /// Reynolds number based on the diameter or width; 0 for creeping flow.
    pub reynolds: f64,
    /// Largest relative error.
    pub error: f64,
    /// Cost of one diameter cubed (2-D: squared) over a time d²/nu \[core-seconds\].
    pub core_seconds: f64,
    /// Source of the measurement, and its reference.
    pub place: String,
}

/// Returns all rows.
pub(crate) fn rows() -> impl Iterator<Item = &'static MeasuredRow> {
    static ROWS: LazyLock<Vec<MeasuredRow>> = LazyLock::new(|| read(TABLE));
    ROWS.iter()
}

/// Returns the rows of a table of this program. A test of each table checks that every row can be read.
pub(super) fn read<R: DeserializeOwned>(table: &str) -> Vec<R> {
    let mut reader = Reader::new(table);
    let mut rows = Vec::new();
    while let Some(row) = reader.as_mut().and_then(Reader::row) {
        rows.extend(row.read());
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_a_row_with_a_place() {
        assert_eq!(rows().count() + 1, TABLE.lines().count());
        for row in rows() {
            assert!(
                row.error > 0.0 && row.cells >= 0.4 && row.core_seconds > 0.0,
                "{row:?}"
            );
            assert!(
                row.relaxation_time > 0.5 && !row.place.is_empty(),
                "{row:?}"
            );
        }
    }
}
