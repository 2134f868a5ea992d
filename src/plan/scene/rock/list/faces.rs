//! Blocks from points and faces, as formats that list both have them.

use super::{ListError, Listed};
use dem::polyhedron::Polyhedron;
use nalgebra::Vector3;

/// Largest difference between the volume inside the faces and that of the hull, relative to the hull. Coordinates
/// have six digits in most files.
const CONVEX: f64 = 1e-4;

/// Returns the block that is the convex hull of the points of its faces. `faces` has the indices of the points of each
/// face, in one sense or the other.
///
/// # Errors
/// If an index has no point, or the faces enclose another volume than the hull, because the block is not convex.
pub(super) fn block(points: &[Vector3<f64>], faces: &[Vec<usize>]) -> Result<Listed, ListError> {
    let mut used: Vec<usize> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let corners = used
        .iter()
        .map(|at| points.get(*at).copied().ok_or(ListError::NoPoint(*at)));
    let corners: Vec<Vector3<f64>> = corners.collect::<Result<_, _>>()?;
    let solid = Polyhedron::from_vertices(&corners)?;
    let (inside, hull) = (enclosed(points, faces), solid.shape.volume());
    if (inside - hull).abs() > CONVEX * hull {
        return Err(ListError::NotConvex { inside, hull });
    }
    Ok(Listed {
        solid,
        material: None,
        fixed: false,
    })
}

/// Returns the volume inside faces \[m³\]. Each face is a fan of triangles whose normal points away from the mean of
/// the points, so that the order of its points has no effect; for a convex polyhedron the volume is exact.
fn enclosed(points: &[Vector3<f64>], faces: &[Vec<usize>]) -> f64 {
    let corners = faces.iter().flatten().map(|at| points[*at]);
    let count = corners.clone().count().max(1) as f64;
    let middle = corners.sum::<Vector3<f64>>() / count;
    let volume = |face: &Vec<usize>| {
        let from = |at: &usize| points[*at] - middle;
        let fans = face.windows(2).skip(1);
        let fans = fans.map(|pair| from(&face[0]).dot(&from(&pair[0]).cross(&from(&pair[1]))));
        fans.sum::<f64>().abs() / 6.0
    };
    faces.iter().map(volume).sum()
}
