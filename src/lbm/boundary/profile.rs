//! Velocity profile over a face: uniform, parabolic, a wall law, or a table.

use super::site::{Place, Site};
use base::error::Report;
use base::geometry::UniformVelocity;
use base::number::real;
use base::units::LatticeUnits;
use base::vector::dot;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Velocity on a face as a function of the position in cells (lattice units).
pub type FaceVelocity = Box<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>;

/// Function that reads the table at a path of a case, or returns a sentence about an error in it.
pub type ReadTable<'a> = &'a dyn Fn(&Path) -> Result<VelocityTable, String>;

/// A velocity over a face or patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum VelocityProfile {
    /// Uniform velocity [m/s]: the list of the components, or an object with `velocity`.
    Uniform(UniformVelocity),
    /// A parabola over the face or patch, along the inward normal: a factor 4 s (1 - s) for each axis of the face, with
    /// s from 0 to 1 between the ends of the patch. A periodic axis that the patch spans has no factor, because no wall
    /// bounds the flow along it.
    Parabolic {
        /// Velocity at the centre [m/s]. A positive value flows into the domain.
        peak: f64,
    },
    /// A power law for turbulent flow in ducts and channels, along the inward normal: u is proportional to the distance
    /// from the nearest wall, at the ends of the patch, raised to the exponent, and has the given mean.
    PowerLaw {
        /// Mean velocity over the patch [m/s]. A positive value flows into the domain.
        mean: f64,
        /// Exponent \[1\]: one seventh in smooth ducts at Reynolds numbers near 1e5 (Schlichting 1979).
        #[serde(default = "seventh")]
        #[schemars(range(min = 0, max = 1))]
        exponent: f64,
    },
    /// The logarithmic law of rough walls for rivers, canals and rough ducts, along the inward normal: u is
    /// proportional to ln(1 + 30 y/k), with the distance y from the nearest wall at the ends of the patch and the
    /// roughness k (Nikuradse 1933), and has the given mean.
    LogLaw {
        /// Mean velocity over the patch [m/s]. A positive value flows into the domain.
        mean: f64,
        /// Equivalent sand roughness k \[m\].
        #[schemars(extend("exclusiveMinimum" = 0))]
        roughness: f64,
    },
    /// Velocities from a table in a file.
    File {
        /// Table, relative to the case, whose first line names the columns: the tangential coordinates (`y` and, in
        /// 3-D, `z` on a face across x) \[m\] and the velocity components `u`, `v` and, in 3-D, `w` [m/s]. Values are
        /// interpolated linearly between rows.
        path: PathBuf,
        /// Rows of the table, once they are read.
        #[serde(skip)]
        table: Option<VelocityTable>,
    },
}

impl VelocityProfile {
    /// Checks the vector and reads the table; `path` is the JSON path of the profile.
    pub(super) fn resolve(
        &mut self,
        (site, path): (&Site<'_>, &str),
        read: ReadTable<'_>,
        report: &mut dyn Report,
    ) {
        match self {
            Self::Uniform(UniformVelocity { velocity }) => {
                let path = format!("{path}.uniform.velocity");
                velocity.resolve(site.dimension, &path, report);
            }
            Self::Parabolic { .. } | Self::PowerLaw { .. } | Self::LogLaw { .. } => {}
            Self::File { path: file, table } => match read(file) {
                Ok(rows) => *table = Some(rows),
                Err(reason) => report.error(
                    &format!("{path}.file.path"),
                    reason,
                    "correct the path (relative to the case) or the file".into(),
                ),
            },
        }
    }

    /// Returns the field that determines the largest speed, and this speed [m/s].
    pub(super) fn fastest(&self) -> (&'static str, f64) {
        match self {
            Self::Uniform(UniformVelocity { velocity }) => {
                let squares = velocity.to_array().map(|x| x * x);
                (
                    "profile.uniform.velocity",
                    squares.iter().sum::<f64>().sqrt(),
                )
            }
            Self::Parabolic { peak } => ("profile.parabolic.peak", peak.abs()),
            // Ratio of maximum and mean in a square duct, where it is largest.
            Self::PowerLaw { mean, exponent } => (
                "profile.power_law.mean",
                mean.abs() * 0.5 * (1.0 + exponent) * (2.0 + exponent),
            ),
            Self::LogLaw { mean, .. } => ("profile.log_law.mean", LARGEST_OF_LOG * mean.abs()),
            Self::File { table, .. } => {
                let fastest = table.as_ref().map_or(0.0, VelocityTable::fastest);
                ("profile.file.path", fastest)
            }
        }
    }

    /// Returns the mean velocity into the domain [m/s]; `None` for a table, which requires the cells.
    pub(super) fn mean_inflow(&self, place: &Place<'_>) -> Option<f64> {
        match self {
            Self::Uniform(UniformVelocity { velocity }) => {
                let (velocity, inward) = (velocity.to_array(), place.site.face.inward());
                Some(dot(velocity, inward))
            }
            // The mean of 4 s (1 - s) is 2/3.
            Self::Parabolic { peak } => Some(
                bounded(place)
                    .into_iter()
                    .filter(|bounded| *bounded)
                    .fold(*peak, |mean, _| mean * 2.0 / 3.0),
            ),
            Self::PowerLaw { mean, .. } | Self::LogLaw { mean, .. } => Some(*mean),
            Self::File { .. } => None,
        }
    }

    /// Returns the mean velocity of a table into the domain over the cells of a patch [m/s]; `None` for other
    /// profiles, and for patches with too many cells.
    pub(super) fn mean_of_table(&self, place: &Place<'_>) -> Option<f64> {
        match self {
            Self::File {
                table: Some(table), ..
            } if !table.is_empty() => mean_inflow(table, place),
            _ => None,
        }
    }

    /// Returns the profile in lattice units.
    pub(super) fn on_lattice(&self, place: &Place<'_>, units: &LatticeUnits) -> FaceVelocity {
        match self {
            Self::Uniform(UniformVelocity { velocity }) => {
                let u = velocity.to_array().map(|x| units.velocity_to_lattice(x));
                Box::new(move |_| u)
            }
            Self::Parabolic { peak } => parabola(place, units.velocity_to_lattice(*peak)),
            Self::PowerLaw { mean, exponent } => {
                let exponent = *exponent;
                let law = move |distance: f64| distance.powf(exponent);
                from_walls(place, units.velocity_to_lattice(*mean), law)
            }
            Self::LogLaw { mean, roughness } => {
                let part = 30.0 * units.spacing / roughness;
                let law = move |distance: f64| (part * distance).ln_1p();
                from_walls(place, units.velocity_to_lattice(*mean), law)
            }
            Self::File { table, .. } => {
                let none = || VelocityTable::new(place.site.dimension, Vec::new());
                of_table(table.clone().unwrap_or_else(none), place, *units)
            }
        }
    }
}

fn seventh() -> f64 {
    1.0 / 7.0
}

/// Upper bound of the ratio of maximum to mean velocity in a logarithmic profile: with a roughness of a tenth of
/// the width of a square duct.
const LARGEST_OF_LOG: f64 = 1.7;

/// Maximum number of evaluations of a table before the run.
const MAX_EVALUATIONS: usize = 20_000_000;

fn mean_inflow(table: &VelocityTable, place: &Place<'_>) -> Option<f64> {
    let Place { site, from, to, .. } = place;
    let (axis, inward) = (site.face.axis(), site.face.inward());
    let cells = (0..3).map(|a| to[a].saturating_sub(from[a]));
    let cells = cells.fold(1, usize::saturating_mul);
    let looks = if site.dimension == 2 { 20 } else { table.len() };
    if cells.saturating_mul(looks) > MAX_EVALUATIONS || cells == 0 {
        return None;
    }
    let (mut sum, mut area) = (0.0, 0.0);
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            for x in from[0]..to[0] {
                let part = place.part([x, y, z]);
                let centre = [x, y, z].map(|i| (real(i) + 0.5) * site.spacing);
                let across: Vec<f64> = (0..site.dimension)
                    .filter(|&a| a != axis)
                    .map(|a| centre[a])
                    .collect();
                let u = table.velocity_at(&across);
                sum += part * dot(u, inward);
                area += part;
            }
        }
    }
    (area > 0.0).then_some(sum / area)
}

/// Returns `true` for the axes of the face along which the flow through a patch is bounded: not for a periodic axis
/// that the patch spans.
fn bounded(place: &Place<'_>) -> [bool; 3] {
    let Place { site, from, to, .. } = place;
    std::array::from_fn(|a| {
        let spans = from[a] == 0 && to[a] == site.cells[a];
        a != site.face.axis() && a < site.dimension && !(site.periodic[a] && spans)
    })
}

/// Returns the product of a parabola for each bounded axis of the patch, along the inward normal.
fn parabola(place: &Place<'_>, peak: f64) -> FaceVelocity {
    let (axis, bounded) = (place.site.face.axis(), bounded(place));
    let ends = place.ends;
    let inward = if place.site.face.is_max() {
        -peak
    } else {
        peak
    };
    Box::new(move |position| {
        let mut speed = inward;
        for a in (0..3).filter(|&a| bounded[a]) {
            let [low, high] = ends[a];
            let s = ((position[a] - low) / (high - low)).clamp(0.0, 1.0);
            speed *= 4.0 * s * (1.0 - s);
        }
        let mut u = [0.0; 3];
        u[axis] = speed;
        u
    })
}

/// Returns a profile along the inward normal that is a function of the distance from the nearest wall \[cells\],
/// scaled to a mean over the cells of the patch.
fn from_walls(
    place: &Place<'_>,
    mean: f64,
    law: impl Fn(f64) -> f64 + Send + Sync + 'static,
) -> FaceVelocity {
    let (axis, inward) = (place.site.face.axis(), place.site.face.inward());
    let sides = place.sides();
    let (mut sum, mut area) = (0.0, 0.0);
    for x in place.from[0]..place.to[0] {
        for y in place.from[1]..place.to[1] {
            for z in place.from[2]..place.to[2] {
                let part = place.part([x, y, z]);
                let centre = [x, y, z].map(|n| real(n) + 0.5);
                sum += part * sides.from_wall(centre).map_or(1.0, &law);
                area += part;
            }
        }
    }
    let factor = if sum > 0.0 {
        inward[axis] * mean * area / sum
    } else {
        0.0
    };
    Box::new(move |position| {
        let mut u = [0.0; 3];
        u[axis] = factor * sides.from_wall(position).map_or(1.0, &law);
        u
    })
}

fn of_table(table: VelocityTable, place: &Place<'_>, units: LatticeUnits) -> FaceVelocity {
    let (axis, dimension) = (place.site.face.axis(), place.site.dimension);
    Box::new(move |position| {
        let across: Vec<f64> = (0..dimension)
            .filter(|&a| a != axis)
            .map(|a| position[a] * units.spacing)
            .collect();
        table
            .velocity_at(&across)
            .map(|v| units.velocity_to_lattice(v))
    })
}

/// Table of velocities over a face: each row contains the tangential coordinates \[m\], then the velocity
/// components [m/s].
///
/// In 2-D the velocity is linear between rows; in 3-D it is that of the nearest row. Outside the rows it is that of
/// the outermost row.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocityTable {
    dimension: usize,
    /// Rows in ascending order of the first coordinate.
    rows: Arc<Vec<Vec<f64>>>,
}

impl VelocityTable {
    /// Returns the table of rows in ascending order of the first coordinate, each with 2 D - 1 numbers in D
    /// dimensions.
    #[must_use]
    pub fn new(dimension: usize, rows: Vec<Vec<f64>>) -> Self {
        Self {
            dimension,
            rows: Arc::new(rows),
        }
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns `true` if there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the largest speed of any row [m/s].
    #[must_use]
    pub fn fastest(&self) -> f64 {
        let speed = |row: &Vec<f64>| {
            let squares = row[self.dimension - 1..].iter().map(|u| u * u);
            squares.sum::<f64>().sqrt()
        };
        self.rows.iter().map(speed).fold(0.0, f64::max)
    }

    /// Returns the velocity [m/s] at tangential coordinates \[m\].
    #[must_use]
    pub fn velocity_at(&self, across: &[f64]) -> [f64; 3] {
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

#[cfg(test)]
mod tests {
    use super::{VelocityProfile, VelocityTable};
    use crate::boundary::{Place, Site};
    use base::geometry::Face;
    use base::units::LatticeUnits;

    /// Returns two means of a profile over a patch on a face x_min of 10 x 30 cells along y and z: the mean over
    /// its cells, and the stated mean.
    fn means(periodic: [bool; 3], from: [usize; 3], to: [usize; 3]) -> (f64, f64) {
        let site = Site {
            path: "",
            face: Face::XMin,
            dimension: 3,
            spacing: 1.0,
            cells: [20, 10, 30],
            periodic,
            walls: [[true; 2]; 3],
        };
        let place = Place {
            site,
            from,
            to,
            ends: std::array::from_fn(|a| [from[a] as f64, to[a] as f64]),
            openings: &[],
            bodies_move: false,
        };
        let units = LatticeUnits {
            spacing: 1.0,
            time_step: 1.0,
            density: 1.0,
            dimension: 3,
        };
        let parabola = VelocityProfile::Parabolic { peak: 1.0 };
        let profile = parabola.on_lattice(&place, &units);
        let (mut sum, mut cells) = (0.0, 0.0);
        for y in from[1]..to[1] {
            for z in from[2]..to[2] {
                sum += profile([0.0, y as f64 + 0.5, z as f64 + 0.5])[0];
                cells += 1.0;
            }
        }
        (sum / cells, parabola.mean_inflow(&place).unwrap())
    }

    #[test]
    fn a_parabola_has_a_factor_for_each_axis_with_ends() {
        // The mean of a parabola over n cells is 2/3 + 1/(3 n²).
        let parabola = |n: f64| 2.0 / 3.0 + 1.0 / (3.0 * n * n);
        let whole = ([0; 3], [1, 10, 30]);
        let (walls, across, along) = ([false; 3], [false, false, true], [false, true, true]);
        for (periodic, (from, to), mean, stated) in [
            (walls, whole, parabola(10.0) * parabola(30.0), 4.0 / 9.0),
            (across, whole, parabola(10.0), 2.0 / 3.0),
            (along, whole, 1.0, 1.0),
            // A slot that ends within the period has edges there.
            (
                across,
                ([0, 0, 5], [1, 10, 25]),
                parabola(10.0) * parabola(20.0),
                4.0 / 9.0,
            ),
        ] {
            let (found, said) = means(periodic, from, to);
            approx::assert_abs_diff_eq!(found, mean, epsilon = 1e-14);
            approx::assert_abs_diff_eq!(said, stated, epsilon = 1e-14);
        }
    }

    #[test]
    fn rows_are_interpolated_and_the_fastest_is_known() {
        let flat = VelocityTable::new(2, vec![vec![0.0, 2.0, 0.0], vec![1.0, 4.0, -3.0]]);
        assert_eq!(flat.velocity_at(&[0.5]), [3.0, -1.5, 0.0]);
        assert_eq!(flat.velocity_at(&[-1.0]), [2.0, 0.0, 0.0]);
        assert_eq!(flat.velocity_at(&[9.0]), [4.0, -3.0, 0.0]);
        assert_eq!(flat.fastest(), 5.0);
        let rows = vec![vec![0.0, 0.0, 1.0, 0.0, 0.0], vec![1.0, 1.0, 0.0, 0.0, 2.0]];
        let solid = VelocityTable::new(3, rows);
        assert_eq!(solid.velocity_at(&[0.9, 0.6]), [0.0, 0.0, 2.0]);
        assert_eq!(solid.fastest(), 2.0);
    }
}
