//! Checks for walls in one plane, where only the plane wall acts.

use super::super::findings::Findings;
use super::SceneWall;
use base::vector::{dot, minus};
use case::Case;
use nalgebra::Vector3;

/// Maximum distance of a corner from a plane, in facet sizes, at which it lies in the plane.
const IN_PLANE_DISTANCE: f64 = 1e-6;

/// Returns `true` if a facet of `wall` that faces the grains lies in a plane.
fn has_a_facet_in(wall: &SceneWall, plane: &SceneWall) -> bool {
    let Some(surface) = &wall.surface else {
        return false;
    };
    let (point, normal) = (Vector3::from(plane.point), Vector3::from(plane.normal));
    // Both sides of a single facet face the grains; of a solid only the outer sides do.
    let two_sided = surface.len() == 1;
    (0..surface.len()).any(|facet| {
        let reach = IN_PLANE_DISTANCE * surface.size(facet);
        let mut corners = surface.corners(facet);
        (two_sided || surface.normal(facet).dot(&normal) > 0.0)
            && corners.all(|corner| normal.dot(&(corner - point)).abs() <= reach)
    })
}

/// Returns `true` if two walls are the same plane.
fn are_one_plane(one: &SceneWall, other: &SceneWall) -> bool {
    let between = dot(one.normal, minus(other.point, one.point));
    let along = dot(one.normal, other.normal);
    one.surface.is_none() && other.surface.is_none() && along > 1.0 - 1e-12 && between.abs() <= 1e-9
}

/// Returns `true` if two walls have different velocities or controls.
fn moves_otherwise(one: &SceneWall, other: &SceneWall) -> bool {
    one.servo != other.servo
        || one.history != other.history
        || (one.velocity.iter().zip(&other.velocity)).any(|(a, b)| a - b != 0.0)
}

/// Warns of walls without effect, because a plane wall of another material or velocity lies in their plane.
pub(super) fn check(case: &Case, walls: &[SceneWall], findings: &mut Findings) {
    for (n, plane) in walls.iter().enumerate() {
        if plane.surface.is_some() {
            continue;
        }
        for (m, wall) in walls.iter().enumerate() {
            let differs = plane.material != wall.material || moves_otherwise(plane, wall);
            let hidden = has_a_facet_in(wall, plane) || m > n && are_one_plane(plane, wall);
            if !(differs && hidden) {
                continue;
            }
            let path = match (wall.structure, wall.face) {
                (Some(structure), _) => format!("structures[{structure}]"),
                (None, Some(_)) => "box_walls".into(),
                (None, None) if m < case.walls.len() => format!("walls[{m}]"),
                (None, None) => "walls".into(),
            };
            findings.warn(
                &path,
                format!(
                    "`{}` lies in the plane of `{}`: grains there are affected by the material and velocity of \
                     `{}` only",
                    wall.name, plane.name, plane.name
                ),
                format!(
                    "move `{}` from this plane towards the grains, by more than the overlap of a contact, or \
                     remove `{}`",
                    wall.name, plane.name
                ),
            );
        }
    }
}
