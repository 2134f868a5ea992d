//! Structures as surfaces, written once because they are stationary.

use super::group::RankGroup;
use super::polygons::Polygons;
use base::error::Error;
use base::number::{to_i32, to_i64};
use io::{Column, Data};
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
    let mut polygons = Polygons::default();
    let (mut id, mut structure, mut water, mut grains) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let extent = scene.grid.size[..scene.grid.dimension]
        .iter()
        .fold(0.0_f64, |most, x| most.max(*x));
    let mine = if group.0.rank() == 0 { usize::MAX } else { 0 };
    for (n, one) in scene.structures.iter().enumerate().take(mine) {
        let facets = one.solid.drawn(SAGITTA * extent);
        let first = polygons.points.len() / 3;
        polygons.points.extend(facets.vertices.iter().flatten());
        for face in &facets.faces {
            polygons.sizes.push(face.len());
            polygons
                .corners
                .extend(face.iter().map(|&k| first + k as usize));
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
    let columns = vec![
        column("id", Data::I64(&id)),
        column("structure", Data::I32(&structure)),
        column("stops_water", Data::U8(&water)),
        column("stops_grains", Data::U8(&grains)),
    ];
    polygons.write((folder, "structures"), columns, provenance, group)
}
