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
    /// Eroded part of the mass of all grains at time 0.
    eroded_fraction: f64 = "eroded_fraction [1]",
    /// Grains that left through the seepage points so far.
    eroded_grains: u64 = "eroded_grains [1]",
    /// Voids connected with seepage points.
    voids: u64 = "voids [1]",
    /// Soil missing in them, m^3.
    void_volume: f64 = "void_volume [m^3]",
    /// Highest top of a void over the lowest ground at its point, m.
    arch_height: f64 = "arch_height [m]",
    /// Largest part of the cover of a point that moves.
    front: f64 = "front [1]",
    /// Upper half of the moving zone over its lower half, at the point with that front.
    front_shape: f64 = "front_shape [1]",
    /// Largest settlement of a column, m.
    settlement_max: f64 = "settlement_max [m]",
    /// Largest settlement of a column over a point, or that two neighbouring columns share, m.
    sinkhole: f64 = "sinkhole [m]",
    /// Mean settlement over the middle third of the long axis, m.
    settlement_middle: f64 = "settlement_middle [m]",
    /// The requested percentile of the settlement, m.
    settlement_percentile: f64 = "settlement_percentile [m]",
    /// Length along the long axis that has settled, m.
    extension: f64 = "extension [m]",
    /// Growth since the last row, m/s.
    extension_rate: f64 = "extension_rate [m/s]",
    /// Mean displacement of the soil at the sides of the points towards them, m.
    inward: f64 = "inward [m]",
    /// Stages that have begun.
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
    /// Mass that left through it so far, kg.
    eroded_mass: f64 = "eroded_mass [kg]",
    /// Grains that left through it so far.
    eroded_grains: u64 = "eroded_grains [1]",
    /// Soil missing in the void over it, m^3.
    void_volume: f64 = "void_volume [m^3]",
    /// Top of the void over the lowest ground at the point, m.
    arch_height: f64 = "arch_height [m]",
    /// Thickness of the ground over it at time 0, m.
    cover: f64 = "cover [m]",
    /// Part of the cover that moves.
    front: f64 = "front [1]",
    /// Upper half of the moving zone over its lower half.
    front_shape: f64 = "front_shape [1]",
}
}

/// Kind of grains that a cluster is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClusterKind {
    /// Grains in the ground that have come loose.
    Loose,
    /// Grains that left since the last row, by the loose cluster they belonged to then.
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
    /// Grains of one cluster.
    size: u64 = "size [1]",
    /// Clusters of this size.
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
    /// Column across.
    iy: u64 = "iy",
    /// Middle of the column along the long axis, m.
    long: f64 = "long [m]",
    /// Middle of the column across, m.
    across: f64 = "across [m]",
    /// Top of the highest grain in company, over the lower end of the domain, m; NaN if there is none.
    elevation: f64 = "elevation [m]",
    /// Settlement since time 0, m.
    settlement: f64 = "settlement [m]",
}
}

/// Start of each stage, s; none if it did not begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// t1.
    pub hidden_hole: Option<f64>,
    /// t2.
    pub arch: Option<f64>,
    /// t3.
    pub sinkhole: Option<f64>,
    /// t4.
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
    /// Name.
    pub name: String,
    /// Grains.
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
    /// Edges of a cell along the long axis, across and up, m.
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
