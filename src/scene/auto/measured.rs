//! Measured errors of forces and flows over the number of cells, relative to published values.
//!
//! A row of `measured.csv` is a problem with a known solution at one resolution. Its error is the largest over several positions of the body
//! relative to the nodes, at this and at every finer resolution: the error on a staircase boundary does not decrease evenly, and a body is
//! not at the best position in general. Its cost is that of the fluid in a box of one diameter (a wall problem: one width d) over the time d²/nu.
//!
//! A run differs from the problem of the row, so that the error of the row must be at most half the target. Boundary layers have a thickness of
//! d/Re^½: from a row at a given Reynolds number the number of cells is scaled with the square root of the Reynolds number of the run.

use io::csv::Reader;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

const TABLE: &str = include_str!("measured.csv");
/// Beyond this Reynolds number the layers are turbulent, and eddies are modelled where they are too small.
const MOST_REYNOLDS: f64 = 1000.0;

/// A measured row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The problem.
    pub problem: String,
    /// 2 or 3.
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
    /// Reynolds number with the diameter or width; 0 for creeping flow.
    pub reynolds: f64,
    /// Largest relative error.
    pub error: f64,
    /// Core-seconds for one diameter cubed (2-D: squared) over d²/nu.
    pub core_seconds: f64,
    /// Source of the measurement, and its reference.
    pub place: String,
}

impl Row {
    /// Cells that a flow of this Reynolds number needs for the resolution of the row. Slower flow than that of the row may have
    /// fewer cells only if there are rows of creeping flow.
    #[must_use]
    pub fn cells_at(&self, reynolds: f64) -> f64 {
        if self.reynolds > 0.0 {
            let creeping = group(self.dimension, &self.obstacle, false).next();
            let least = creeping.map_or(self.reynolds, |_| 0.0);
            self.cells * (reynolds.min(MOST_REYNOLDS).max(least) / self.reynolds).sqrt()
        } else {
            self.cells
        }
    }

    /// The row in words.
    #[must_use]
    pub fn name(&self) -> String {
        let reynolds = if self.reynolds > 0.0 {
            format!(" at Re {}", self.reynolds)
        } else {
            String::new()
        };
        format!(
            "`{}{reynolds}, {}, {} cells: {:.1} %`",
            self.problem,
            self.obstacle,
            self.cells,
            100.0 * self.error
        )
    }
}

/// All rows.
pub(crate) fn rows() -> impl Iterator<Item = &'static Row> {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| {
        let mut reader = Reader::new(TABLE);
        let mut rows = Vec::new();
        while let Some(row) = reader.as_mut().and_then(Reader::row) {
            // A test reads every row.
            rows.extend(row.read());
        }
        rows
    });
    ROWS.iter()
}

/// Rows of creeping flow, or of flow with inertia.
fn group(dimension: usize, obstacle: &str, inertia: bool) -> impl Iterator<Item = &'static Row> {
    rows().filter(move |row| {
        row.dimension == dimension && row.obstacle == obstacle && (row.reynolds > 0.0) == inertia
    })
}

/// The row that requires most cells at this Reynolds number, of the cheapest that meet the target in creeping flow and
/// in flow with inertia; if none meets it, the most accurate.
pub(crate) fn needed(
    dimension: usize,
    obstacle: &str,
    reynolds: f64,
    target: f64,
) -> Option<&'static Row> {
    let pick = |inertia: bool| {
        group(dimension, obstacle, inertia)
            .filter(|row| row.error <= 0.5 * target)
            .min_by(|a, b| a.core_seconds.total_cmp(&b.core_seconds))
            .or_else(|| {
                group(dimension, obstacle, inertia).min_by(|a, b| a.error.total_cmp(&b.error))
            })
    };
    let picked = [false, true].into_iter().filter_map(pick);
    picked.max_by(|a, b| a.cells_at(reynolds).total_cmp(&b.cells_at(reynolds)))
}

/// The row with the error of this number of cells: the larger one of creeping flow and of flow with inertia; none where there are
/// fewer cells than in any row.
pub(crate) fn covering(
    dimension: usize,
    obstacle: &str,
    reynolds: f64,
    cells: f64,
) -> Option<&'static Row> {
    let best = |inertia: bool| {
        group(dimension, obstacle, inertia)
            .filter(|row| row.cells_at(reynolds) <= cells * (1.0 + 1e-9))
            .min_by(|a, b| a.error.total_cmp(&b.error))
    };
    let known = [false, true].map(|inertia| {
        let measured = group(dimension, obstacle, inertia).next().is_some();
        measured.then(|| best(inertia))
    });
    let known: Option<Vec<&'static Row>> = known.into_iter().flatten().collect();
    known?
        .into_iter()
        .max_by(|a, b| a.error.total_cmp(&b.error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_a_row_with_a_place() {
        assert_eq!(rows().count() + 1, TABLE.lines().count());
        for row in rows() {
            assert!(
                row.error > 0.0 && row.cells > 1.0 && row.core_seconds > 0.0,
                "{row:?}"
            );
            assert!(
                row.relaxation_time > 0.5 && !row.place.is_empty(),
                "{row:?}"
            );
        }
    }

    #[test]
    fn a_smaller_target_never_takes_fewer_cells() {
        for dimension in [2, 3] {
            for obstacle in [
                "interpolated links",
                "half-way links",
                "partially saturated cells",
                "blocks: viscosity matched",
                "blocks: non-equilibrium bounce-back",
                "walls",
            ] {
                if dimension == 2 && obstacle.starts_with("blocks") {
                    continue;
                }
                for reynolds in [0.0, 20.0, 1e6] {
                    let cells = |target| {
                        let row = needed(dimension, obstacle, reynolds, target).unwrap();
                        row.cells_at(reynolds)
                    };
                    assert!(cells(0.1) <= cells(0.05) && cells(0.05) <= cells(0.02));
                }
            }
        }
    }
}
