//! The records of a ground collapse: their columns, and how they are written and read.
//!
//! | file | row | one row per |
//! |---|---|---|
//! | `collapse.csv` | [`CollapseRecord`] | sample |
//! | `collapse_points.csv` | [`PointRecord`] | sample and seepage point |
//! | `clusters.csv` | [`ClusterRecord`] | sample, kind and size of the clusters present |
//! | `surface.csv` | [`SurfaceRecord`] | sample and column of cells that was ground |
//! | `summary.json`, key `collapse` | [`CollapseSummary`] | run |
//!
//! Undefined values, such as the shape of a front that does not move, are `NaN`.

use crate::erosion_law::RecordRow;
use crate::erosion_law::record::{Value, csv_row};
use serde::{Deserialize, Serialize};

csv_row! {
/// The ground at one time: a row of `collapse.csv`.
pub struct CollapseRecord {
    /// Step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Mass that left through the seepage points so far, kg.
    eroded_mass: f64 = "eroded_mass [kg]",
    /// Eroded fraction of the mass of all grains at time 0.
    eroded_fraction: f64 = "eroded_fraction [1]",
    /// Grains that left through the seepage points so far.
    eroded_grains: u64 = "eroded_grains [1]",
    /// Number of voids connected with seepage points.
    voids: u64 = "voids [1]",
    /// Volume of soil missing in the voids, m^3.
    void_volume: f64 = "void_volume [m^3]",
    /// Largest height of the top of a void above the lowest ground at its point, m.
    arch_height: f64 = "arch_height [m]",
    /// Largest moving fraction of the cover of a point.
    front: f64 = "front [1]",
    /// Moving length in the upper half of the moving zone divided by that in the lower half, at the point of the
    /// largest front.
    front_shape: f64 = "front_shape [1]",
    /// Largest settlement of a column, m.
    settlement_max: f64 = "settlement_max [m]",
    /// Largest settlement of a column over a point, or of both of two neighbouring columns, m.
    sinkhole: f64 = "sinkhole [m]",
    /// Mean settlement over the middle third of the long axis, m.
    settlement_middle: f64 = "settlement_middle [m]",
    /// The requested percentile of the settlement, m.
    settlement_percentile: f64 = "settlement_percentile [m]",
    /// Length along the long axis over which the surface has settled, m.
    extension: f64 = "extension [m]",
    /// Growth rate of this length since the last row, m/s.
    extension_rate: f64 = "extension_rate [m/s]",
    /// Mean displacement of the soil at the sides of the points towards the points, m.
    inward: f64 = "inward [m]",
    /// Number of stages that have begun.
    stages: u64 = "stages [1]",
}
}

csv_row! {
/// Quantities over one seepage point at one time: a row of `collapse_points.csv`.
pub struct PointRecord {
    /// Step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Number of the point, in the order of `summary.json`, from 0.
    point: u64 = "point",
    /// Mass that left through the point so far, kg.
    eroded_mass: f64 = "eroded_mass [kg]",
    /// Number of grains that left through the point so far.
    eroded_grains: u64 = "eroded_grains [1]",
    /// Volume of soil missing in the void over the point, m^3.
    void_volume: f64 = "void_volume [m^3]",
    /// Height of the top of the void above the lowest ground at the point, m.
    arch_height: f64 = "arch_height [m]",
    /// Thickness of the ground over the point at time 0, m.
    cover: f64 = "cover [m]",
    /// Moving fraction of the cover.
    front: f64 = "front [1]",
    /// Moving length in the upper half of the moving zone divided by that in the lower half.
    front_shape: f64 = "front_shape [1]",
}
}

/// Kind of grains in a cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClusterKind {
    /// Loosened grains in the ground.
    Loose,
    /// Grains that left since the last row, by the loose cluster to which they then belonged.
    Left,
}

impl Value for ClusterKind {
    fn put(&self, line: &mut String) {
        line.push_str(match self {
            Self::Loose => "loose",
            Self::Left => "left",
        });
    }
}

csv_row! {
/// Number of clusters of a size: a row of `clusters.csv`.
pub struct ClusterRecord {
    /// Step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Kind of the clustered grains.
    kind: ClusterKind = "kind",
    /// Number of grains of one cluster.
    size: u64 = "size [1]",
    /// Number of clusters of this size.
    count: u64 = "count [1]",
}
}

csv_row! {
/// The surface over one column of cells at one time: a row of `surface.csv`.
pub struct SurfaceRecord {
    /// Step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Column along the long axis.
    ix: u64 = "ix",
    /// Column along the transverse axis.
    iy: u64 = "iy",
    /// Middle of the column along the long axis, m.
    long: f64 = "long [m]",
    /// Middle of the column along the transverse axis, m.
    across: f64 = "across [m]",
    /// Top of the highest grain with neighbours, above the lower end of the domain, m; NaN if there is none.
    elevation: f64 = "elevation [m]",
    /// Settlement since time 0, m.
    settlement: f64 = "settlement [m]",
}
}

/// Start of each stage, s; none if the stage did not begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Time t1 of the hidden hole.
    pub hidden_hole: Option<f64>,
    /// Time t2 of the arch.
    pub arch: Option<f64>,
    /// Time t3 of the sinkhole.
    pub sinkhole: Option<f64>,
    /// Time t4 of the extension.
    pub extension: Option<f64>,
    /// Shape of the moving front at t2: 1/3 is a triangle with its apex up, 1 a rectangle.
    #[serde(default)]
    pub arch_shape: Option<f64>,
    /// Shape of the moving front at t3.
    #[serde(default)]
    pub sinkhole_shape: Option<f64>,
}

/// Grains and mass that left through one point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointSummary {
    /// Name of the point.
    pub name: String,
    /// Number of grains.
    pub eroded_grains: u64,
    /// Mass of these grains, kg.
    pub eroded_mass: f64,
}

/// Data of a run that a study needs in addition to its record: the value of the key `collapse` of `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CollapseSummary {
    /// Start of each stage.
    pub stages: StageTimes,
    /// The seepage points in the order of `collapse_points.csv`.
    pub points: Vec<PointSummary>,
    /// Mass of the grains at time 0, kg.
    pub initial_mass: f64,
    /// Mean diameter of the grains, m.
    pub mean_diameter: f64,
    /// Edges of a cell along the long, transverse and upward axes, m.
    pub cell: [f64; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_read_back() {
        let row = ClusterRecord {
            step: 7,
            time: 0.1 + 0.2,
            kind: ClusterKind::Left,
            size: 8,
            count: 3,
        };
        let text = format!(
            "{}\n{}\n7,0,lost,1,1\n",
            ClusterRecord::header(),
            row.to_csv()
        );
        let mut lines = io::csv::Reader::new(&text).unwrap();
        assert_eq!(lines.names(), ClusterRecord::COLUMNS);
        assert_eq!(lines.row().unwrap().read(), Ok(row));
        let wrong = lines.row().unwrap().read::<ClusterRecord>().unwrap_err();
        assert_eq!(
            wrong,
            "line 3: unknown variant `lost`, expected `loose` or `left`"
        );
    }
}
