//! Structures as surfaces, written once because they are stationary.

use super::group::RankGroup;
use base::error::Error;
use base::number::{to_i32, to_i64};
use io::{Cells, Column, Data, MeshData, Mode, OutputTime, Series};
use plan::scene::Scene;
use std::path::Path;

/// Maximum distance between a facet and the round surface that it approximates, as a fraction of the domain.
const SAGITTA: f64 = 1e-4;

/// Writes the series `structures`, with one output at time 0, on the first rank. Collective.
pub(super) fn write(
    scene: &Scene,
    folder: &Path,
    provenance: &[(String, String)],
    group: &RankGroup,
) -> Result<(), Error> {
    let mut series = group.checked(Series::create(folder, "structures", group))?;
    let (mut points, mut sizes, mut corners) = (Vec::new(), Vec::new(), Vec::new());
    let (mut id, mut structure, mut water, mut grains) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let extent = scene.grid.size[..scene.grid.dimension]
        .iter()
        .fold(0.0_f64, |most, x| most.max(*x));
    let mine = if group.0.rank() == 0 { usize::MAX } else { 0 };
    for (n, one) in scene.structures.iter().enumerate().take(mine) {
        let facets = one.solid.drawn(SAGITTA * extent);
        let first = points.len() / 3;
        points.extend(facets.vertices.iter().flatten());
        for face in &facets.faces {
            sizes.push(face.len());
            corners.extend(face.iter().map(|&k| first + k as usize));
            id.push(to_i64(n as u64));
            structure.push(to_i32(n));
            water.push(u8::from(one.stops.water()));
            grains.push(u8::from(one.stops.grains()));
        }
    }
    let column = |name, data| Column {
        name,
        units: "-",
        components: 1,
        data,
    };
    let mesh = MeshData {
        points: Data::F64(&points),
        cells: Cells::Polygons {
            sizes: &sizes,
            corners: &corners,
        },
        point_columns: Vec::new(),
        cell_columns: vec![
            column("id", Data::I64(&id)),
            column("structure", Data::I32(&structure)),
            column("stops_water", Data::U8(&water)),
            column("stops_grains", Data::U8(&grains)),
        ],
    };
    let when = OutputTime { step: 0, time: 0.0 };
    group.checked(series.write_mesh(when, &mesh, provenance, group, Mode::Collective))?;
    Ok(())
}
