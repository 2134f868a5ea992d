//! Bound of the error as a function of the number of cells and the Reynolds number, from all measured rows of an
//! obstacle.
//!
//! The bound is e = (1 + [`MARGIN`]/k) exp(a) N^-p (1 + Re)^q, for rows of k problems. At given p and q, a is the
//! 95th percentile of ln e + p ln N - q ln(1 + Re) over the rows; p and q have the smallest loss of the quantile
//! regression (R. Koenker and G. Bassett, Econometrica 46 (1978) 33-50), by trial of all values on a grid. The
//! bound is defined from the smallest number of cells and up to the largest Reynolds number of the rows. More cells
//! than in any row have the bound of the largest number in the rows.

use super::measured::{MeasuredRow, rows};
use base::number::{real, whole};
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Fraction of the rows that lie below the bound, before its margin.
const CONFIDENCE: f64 = 0.95;
/// Margin for scenes that differ from the problems of the rows: the fewer problems, the less is known about the
/// differences. With this margin, bounds computed without one of the problems hold for 95 % of its rows
/// (`jobs/automatic/left_out.csv`).
const MARGIN: f64 = 3.0;
/// Reynolds number below which inertia changes forces and flows by less than the scatter of the rows, so that rows
/// of creeping flow apply.
const CREEPING: f64 = 1.0;
/// Step of p, which ranges from 0.2 to 3.5, and of q, which ranges from 0 to 0.8.
const STEP: f64 = 0.1;
/// Number of values, between the smallest and the largest number of cells of the rows, at which a target is sought.
const TRIALS: usize = 400;

/// Measured error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Number of cells.
    pub(super) cells: f64,
    /// Reynolds number.
    pub(super) reynolds: f64,
    /// Relative error.
    pub(super) error: f64,
}

impl From<&MeasuredRow> for Point {
    fn from(row: &MeasuredRow) -> Self {
        Self {
            cells: row.cells,
            reynolds: row.reynolds,
            error: row.error,
        }
    }
}

/// Error bound of an obstacle.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    /// Coefficient a.
    constant: f64,
    /// Exponent p.
    order: f64,
    /// Exponent q.
    inertia: f64,
    /// Factor for scenes that differ from those of the rows.
    margin: f64,
    /// Smallest and largest number of cells of a row.
    pub(crate) cells: [f64; 2],
    /// Largest Reynolds number of a row.
    most_reynolds: f64,
    /// Number of rows.
    pub(crate) rows: usize,
    /// Names of the problems.
    pub(crate) problems: Vec<&'static str>,
}

impl Bound {
    /// Returns the bound of an obstacle; none if the obstacle was not measured.
    pub(crate) fn for_obstacle(dimension: usize, obstacle: &str) -> Option<&'static Self> {
        static BOUNDS: LazyLock<BTreeMap<(usize, &'static str), Bound>> = LazyLock::new(all);
        let found = BOUNDS.range((dimension, "")..=(dimension, "~"));
        found
            .into_iter()
            .find(|((_, name), _)| *name == obstacle)
            .map(|(_, bound)| bound)
    }

    fn from(rows: &[&'static MeasuredRow]) -> Self {
        let points: Vec<Point> = rows.iter().map(|row| Point::from(*row)).collect();
        let problems = rows.iter().map(|row| row.problem.as_str());
        Self::of_points(&points, problems.collect(), [CONFIDENCE, MARGIN])
    }

    /// Returns the bound of measured points, with the problem of each, for a fraction of the points and a margin.
    pub(super) fn of_points(
        points: &[Point],
        mut problems: Vec<&'static str>,
        [confidence, margin]: [f64; 2],
    ) -> Self {
        let slow = points
            .iter()
            .all(|row| row.reynolds <= 0.0 || row.reynolds >= points[0].reynolds);
        let fast = points.iter().all(|row| row.reynolds <= points[0].reynolds);
        let trials = |steps: usize| (0..=steps).map(|n| STEP * real(n));
        let mut best: Option<(f64, [f64; 3])> = None;
        for order in trials(33).map(|p| 0.2 + p) {
            for inertia in trials(if slow && fast { 0 } else { 8 }) {
                let (constant, loss) = at_quantile(points, confidence, [order, inertia]);
                if best.is_none_or(|(least, _)| loss < least * (1.0 - 1e-9)) {
                    best = Some((loss, [constant, order, inertia]));
                }
            }
        }
        let [constant, order, inertia] = best.map_or([f64::INFINITY, 0.0, 0.0], |(_, fit)| fit);
        let cells = points.iter().map(|row| row.cells);
        problems.sort_unstable();
        problems.dedup();
        Self {
            constant,
            order,
            inertia,
            margin: 1.0 + margin / real(problems.len()),
            cells: [
                cells.clone().fold(f64::INFINITY, f64::min),
                cells.fold(0.0, f64::max),
            ],
            most_reynolds: points.iter().map(|row| row.reynolds).fold(0.0, f64::max),
            rows: points.len(),
            problems,
        }
    }

    /// Returns the bound of the relative error; none outside the range of the rows.
    pub(crate) fn error(&self, cells: f64, reynolds: f64) -> Option<f64> {
        let enough = cells >= self.cells[0] * (1.0 - 1e-9);
        let covered = enough && reynolds <= self.largest_reynolds();
        covered.then(|| self.formula(cells.clamp(self.cells[0], self.cells[1]), reynolds))
    }

    /// Returns the largest Reynolds number for which the bound is defined.
    pub(crate) fn largest_reynolds(&self) -> f64 {
        self.most_reynolds.max(CREEPING)
    }

    fn formula(&self, cells: f64, reynolds: f64) -> f64 {
        let log = self.constant - self.order * cells.ln() + self.inertia * reynolds.ln_1p();
        self.margin * log.exp()
    }

    /// Returns the smallest number of cells with at most this error, or the largest number of the rows if the error
    /// is not reached. For a Reynolds number above the rows the cells follow the thickness of boundary layers,
    /// which decreases with its square root.
    pub(crate) fn cells_for(&self, target: f64, reynolds: f64) -> f64 {
        let [few, many] = self.cells;
        let slower = reynolds.min(self.most_reynolds);
        let layers = if reynolds > slower {
            let at_most = reynolds.min(MAX_REYNOLDS).max(self.most_reynolds);
            ((1.0 + at_most) / (1.0 + self.most_reynolds)).sqrt()
        } else {
            1.0
        };
        let trial = |n: usize| few * (many / few).powf(real(n) / real(TRIALS));
        let found = (0..=TRIALS)
            .map(trial)
            .find(|n| self.formula(*n, slower) <= target);
        found.unwrap_or(many) * layers
    }
}

/// Reynolds number above which the layers are turbulent and an eddy viscosity represents unresolved eddies.
const MAX_REYNOLDS: f64 = 1000.0;

/// Returns the coefficient a of a bound with these exponents, and the loss of the quantile regression.
fn at_quantile(rows: &[Point], confidence: f64, [order, inertia]: [f64; 2]) -> (f64, f64) {
    let value =
        |row: &Point| row.error.ln() + order * row.cells.ln() - inertia * row.reynolds.ln_1p();
    let mut values: Vec<f64> = rows.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    let place = whole((confidence * real(rows.len() - 1)).ceil());
    let constant = values[place];
    let loss = |value: &f64| {
        let above = value - constant;
        if above > 0.0 {
            confidence * above
        } else {
            (confidence - 1.0) * above
        }
    };
    (constant, values.iter().map(loss).sum())
}

fn all() -> BTreeMap<(usize, &'static str), Bound> {
    let mut groups: BTreeMap<(usize, &'static str), Vec<&'static MeasuredRow>> = BTreeMap::new();
    for row in rows() {
        let key = (row.dimension, row.obstacle.as_str());
        groups.entry(key).or_default().push(row);
    }
    let made = groups
        .into_iter()
        .map(|(key, rows)| (key, Bound::from(&rows)));
    made.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_obstacle_has_a_bound_above_its_rows_that_falls_with_cells() {
        let mut outside = 0;
        let mut known = 0;
        for row in rows() {
            let bound = Bound::for_obstacle(row.dimension, &row.obstacle).unwrap();
            let error = bound.error(row.cells, row.reynolds).unwrap();
            known += 1;
            outside += usize::from(error < row.error);
            for slower in [0.0, 0.5 * row.reynolds] {
                assert!(bound.error(row.cells, slower).is_some());
            }
            let mut last = f64::INFINITY;
            for n in 0..50 {
                let cells = bound.cells[0] * 1.1_f64.powi(n);
                let error = bound.error(cells, row.reynolds).unwrap();
                assert!(error <= last * (1.0 + 1e-9), "{row:?}: {cells}");
                last = error;
            }
            assert_eq!(bound.error(0.9 * bound.cells[0], 0.0), None);
            let faster = 1.01 * bound.largest_reynolds();
            assert_eq!(bound.error(row.cells, faster), None);
        }
        assert!(
            outside * 20 <= known,
            "{outside} of {known} rows above their bound"
        );
    }

    /// Problem left out of a bound, and the agreement of its rows with the bound of the other problems.
    struct LeftOut {
        key: (usize, &'static str),
        problem: &'static str,
        others: usize,
        rows: usize,
        judged: usize,
        kept: usize,
        /// Largest ratio of error to bound; 0 if nothing is judged.
        largest_ratio: f64,
    }

    fn left_out() -> Vec<LeftOut> {
        let mut groups: BTreeMap<(usize, &'static str), Vec<&'static MeasuredRow>> =
            BTreeMap::new();
        for row in rows() {
            let key = (row.dimension, row.obstacle.as_str());
            groups.entry(key).or_default().push(row);
        }
        let mut list = Vec::new();
        for (key, rows) in groups {
            let problems = Bound::from(&rows).problems;
            for problem in problems.iter().copied().filter(|_| problems.len() > 1) {
                let others = rows.iter().copied().filter(|row| row.problem != problem);
                let bound = Bound::from(&others.collect::<Vec<_>>());
                let own = rows.iter().filter(|row| row.problem == problem);
                let ratio =
                    |row: &&MeasuredRow| Some(row.error / bound.error(row.cells, row.reynolds)?);
                let ratios: Vec<f64> = own.clone().copied().filter_map(|row| ratio(&row)).collect();
                list.push(LeftOut {
                    key,
                    problem,
                    others: problems.len() - 1,
                    rows: own.count(),
                    judged: ratios.len(),
                    kept: ratios.iter().filter(|ratio| **ratio <= 1.0).count(),
                    largest_ratio: ratios.iter().copied().fold(0.0, f64::max),
                });
            }
        }
        list
    }

    /// Minimum number of other problems: a single one shows no differences between problems.
    const MIN_PROBLEMS: usize = 2;

    /// Checks that bounds computed without a problem hold for it: for 95 % of its rows, with a largest excess below
    /// twice the bound.
    #[test]
    fn a_problem_that_is_left_out_keeps_the_bound_of_the_others() {
        let (mut judged, mut kept) = (0, 0);
        for one in left_out().iter().filter(|one| one.others >= MIN_PROBLEMS) {
            judged += one.judged;
            kept += one.kept;
            let (key, problem) = (one.key, one.problem);
            assert!(
                one.largest_ratio <= 2.0,
                "{key:?}, {problem}: {}",
                one.largest_ratio
            );
        }
        assert!(
            judged > 1000 && 20 * kept >= 19 * judged,
            "{kept} of {judged}"
        );
    }

    /// Checks that `jobs/automatic/left_out.csv` is the output of this test.
    #[test]
    fn the_table_of_problems_left_out_is_that_of_the_rows() {
        let mut table = "dimension,obstacle,problem,other problems,rows,covered by the others,below their bound,\
            largest error over their bound\n".to_owned();
        for one in left_out() {
            let (dimension, obstacle) = one.key;
            let worst = if one.judged > 0 {
                format!("{:.2}", one.largest_ratio)
            } else {
                String::new()
            };
            let (problem, others, rows) = (one.problem, one.others, one.rows);
            let (judged, kept) = (one.judged, one.kept);
            table += &format!(
                "{dimension},{obstacle},{problem},{others},{rows},{judged},{kept},{worst}\n"
            );
        }
        println!("{table}");
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../jobs/automatic/left_out.csv"
        );
        let held = std::fs::read_to_string(path).unwrap();
        assert_eq!(held, table, "renew jobs/automatic/left_out.csv");
    }

    #[test]
    fn a_smaller_target_never_takes_fewer_cells() {
        for row in rows() {
            let bound = Bound::for_obstacle(row.dimension, &row.obstacle).unwrap();
            for reynolds in [0.0, 20.0, 1e6] {
                let cells = |target| bound.cells_for(target, reynolds);
                assert!(cells(0.1) <= cells(0.05) && cells(0.05) <= cells(0.02));
            }
        }
    }
}
