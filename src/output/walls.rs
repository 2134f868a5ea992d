//! Walls as surfaces, written once: their position at time 0, the velocity with which they move, with a table in time
//! the mean velocity of the run, and the times between which they exist. A plane is drawn where it lies in the domain
//! and in front of the other planes.

use super::group::RankGroup;
use super::polygons::Polygons;
use base::error::Error;
use base::history::TimeTable;
use base::number::{to_i32, to_i64};
use dem::walls::area::{HalfSpace, PlaneArea};
use io::{Column, Data};
use nalgebra::Vector3;
use plan::scene::Scene;
use plan::scene::walls::SceneWall;
use std::path::Path;

/// Returns the walls that are written as surfaces, with their numbers. Structures have a series of their own, a wall of
/// the preparation does not exist in the run, and the positions of a plane with a servo are not known at the start.
pub(super) fn surfaces(scene: &Scene) -> impl Iterator<Item = (usize, &SceneWall)> {
    let space = scene.grid.dimension == 3;
    let walls = scene.walls.iter().enumerate();
    walls.filter(move |(_, wall)| {
        let drawn = wall.surface.is_some() || space && wall.servo.is_none();
        drawn && wall.structure.is_none() && !wall.temporary
    })
}

/// Returns the faces of a wall, and the velocity of its shape \[m/s\]: a plane is moved by the normal component alone.
fn faces(scene: &Scene, wall: &SceneWall) -> (Vec<Vec<Vector3<f64>>>, Vector3<f64>) {
    let factor = TimeTable::new(wall.history.as_deref(), 1.0).mean(0.0, scene.time.end);
    let velocity = Vector3::from(wall.velocity.map(|v| v * factor));
    if let Some(surface) = &wall.surface {
        let facets = (0..surface.len()).map(|facet| surface.corners(facet).collect());
        return (facets.collect(), surface.moving(&velocity));
    }
    let plane = |wall: &SceneWall| HalfSpace {
        point: Vector3::from(wall.point),
        normal: Vector3::from(wall.normal),
    };
    let still = |other: &&SceneWall| {
        let moves = other.servo.is_some() || other.velocity.iter().any(|v| *v != 0.0);
        other.surface.is_none() && !moves && !other.is_timed() && !other.temporary
    };
    let others = scene.walls.iter().filter(still);
    let others = others
        .filter(|other| !std::ptr::eq(*other, wall))
        .map(plane);
    let corners = [Vector3::zeros(), Vector3::from(scene.grid.size)];
    let mut area = PlaneArea::default();
    let part = area.part(&plane(wall), corners, others);
    let normal = Vector3::from(wall.normal);
    // The part of a plane along a face of the domain is not cut off where the plane lies outside.
    let height = |corner: usize| {
        let corner = Vector3::from_fn(|a, _| corners[corner >> a & 1][a]);
        normal.dot(&(corner - Vector3::from(wall.point)))
    };
    let near = 1e-9 * corners[1].norm();
    let crosses = (0..8).any(|k| height(k) <= near) && (0..8).any(|k| height(k) >= -near);
    let drawn = crosses && part.len() > 2;
    let faces = drawn.then(|| part.to_vec()).into_iter().collect();
    (faces, normal * normal.dot(&velocity))
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
    let (mut from, mut until) = (Vec::new(), Vec::new());
    let mine = if group.0.rank() == 0 { usize::MAX } else { 0 };
    for (n, one) in surfaces(scene).take(mine) {
        let (faces, moves) = faces(scene, one);
        for face in &faces {
            let first = polygons.points.len() / 3;
            polygons.points.extend(
                face.iter()
                    .flat_map(|corner| [corner.x, corner.y, corner.z]),
            );
            polygons.sizes.push(face.len());
            polygons.corners.extend(first..first + face.len());
            id.push(to_i64(n as u64));
            wall.push(to_i32(n));
            velocity.extend([moves.x, moves.y, moves.z]);
            from.push(one.from.unwrap_or(0.0));
            until.push(one.until.unwrap_or(f64::MAX));
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
        column("from", "s", 1, Data::F64(&from)),
        column("until", "s", 1, Data::F64(&until)),
    ];
    polygons.write((folder, "walls"), columns, provenance, group)
}
