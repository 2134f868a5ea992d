//! Walls of facets as surfaces, written once: their position at time 0, and the velocity with which they move; with a
//! table in time the mean velocity of the run.

use super::group::RankGroup;
use super::polygons::Polygons;
use base::error::Error;
use base::history::TimeTable;
use base::number::{to_i32, to_i64};
use io::{Column, Data};
use nalgebra::Vector3;
use plan::scene::Scene;
use plan::scene::walls::SceneWall;
use std::path::Path;

/// Returns the walls that are written as surfaces, with their numbers: planes are infinite, and structures have a
/// series of their own.
pub(super) fn surfaces(scene: &Scene) -> impl Iterator<Item = (usize, &SceneWall)> {
    let walls = scene.walls.iter().enumerate();
    walls.filter(|(_, wall)| wall.surface.is_some() && wall.structure.is_none())
}

/// Writes the series `walls`, with one output at time 0, on the first rank. Collective.
pub(super) fn write(
    scene: &Scene,
    folder: &Path,
    provenance: &[(String, String)],
    group: &RankGroup,
) -> Result<(), Error> {
    let mut polygons = Polygons::default();
    let (mut id, mut wall, mut velocity) = (Vec::new(), Vec::new(), Vec::new());
    let mine = if group.0.rank() == 0 { usize::MAX } else { 0 };
    for (n, one) in surfaces(scene).take(mine) {
        let Some(surface) = &one.surface else {
            continue;
        };
        let factor = TimeTable::new(one.history.as_deref(), 1.0).mean(0.0, scene.time.end);
        let moves = surface.moving(&Vector3::from(one.velocity.map(|v| v * factor)));
        for facet in 0..surface.len() {
            let first = polygons.points.len() / 3;
            polygons.points.extend(
                surface
                    .corners(facet)
                    .flat_map(|corner| [corner.x, corner.y, corner.z]),
            );
            let end = polygons.points.len() / 3;
            polygons.sizes.push(end - first);
            polygons.corners.extend(first..end);
            id.push(to_i64(n as u64));
            wall.push(to_i32(n));
            velocity.extend([moves.x, moves.y, moves.z]);
        }
    }
    let column = |name, units, components, data| Column {
        name,
        units,
        components,
        data,
    };
    let columns = vec![
        column("id", "-", 1, Data::I64(&id)),
        column("wall", "-", 1, Data::I32(&wall)),
        column("velocity", "m/s", 3, Data::F64(&velocity)),
    ];
    polygons.write((folder, "walls"), columns, provenance, group)
}
