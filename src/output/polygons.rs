//! Surfaces of polygons, written once at time 0.

use super::group::RankGroup;
use base::error::Error;
use io::{Cells, Column, Data, MeshData, Mode, OutputTime, Series};
use std::path::Path;

/// Polygons, each with corners of its own or shared ones.
#[derive(Default)]
pub(super) struct Polygons {
    /// Coordinates of the corners \[m\].
    pub(super) points: Vec<f64>,
    /// Number of corners of each polygon.
    pub(super) sizes: Vec<usize>,
    /// Corners of each polygon.
    pub(super) corners: Vec<usize>,
}

impl Polygons {
    /// Writes the series of a name with its columns of polygons on the first rank. Collective.
    pub(super) fn write(
        &self,
        (folder, name): (&Path, &str),
        columns: Vec<Column>,
        provenance: &[(String, String)],
        group: &RankGroup,
    ) -> Result<(), Error> {
        let mut series = group.checked(Series::create(folder, name, group))?;
        let mesh = MeshData {
            points: Data::F64(&self.points),
            cells: Cells::Polygons {
                sizes: &self.sizes,
                corners: &self.corners,
            },
            point_columns: Vec::new(),
            cell_columns: columns,
        };
        let when = OutputTime { step: 0, time: 0.0 };
        group.checked(series.write_mesh(when, &mesh, provenance, group, Mode::Collective))?;
        Ok(())
    }
}
