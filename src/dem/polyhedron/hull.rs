//! Half-spaces of the convex hull of points.
//!
//! Every plane through three points with no point outside is a face. All triples are tried, except those within a
//! known face. The worst-case cost is n³, once per block. Incremental algorithms suffer from rounding if many
//! points lie on one plane or line; this one does not. For a few dozen corners it takes microseconds.

use nalgebra::Vector3;

use super::HalfSpace;
use super::shape_error::ShapeError;

/// Maximum number of points of a hull.
pub(super) const MAX_POINTS: usize = 1000;

/// Returns the half-spaces of the hull; points within `tolerance` \[m\] of a plane lie on it.
pub(super) fn half_spaces(
    points: &[Vector3<f64>],
    tolerance: f64,
) -> Result<Vec<HalfSpace>, ShapeError> {
    let mut known: Vec<(HalfSpace, Vec<bool>)> = Vec::new();
    let n = points.len();
    for i in 0..n {
        for j in i + 1..n {
            let edge = points[j] - points[i];
            // Indices of the faces that contain both ends of the edge.
            let mut beside: Vec<usize> = (0..known.len())
                .filter(|&face| known[face].1[i] && known[face].1[j])
                .collect();
            for k in j + 1..n {
                if beside.iter().any(|&face| known[face].1[k]) {
                    continue;
                }
                let other = points[k] - points[i];
                let cross = edge.cross(&other);
                let area = cross.norm();
                // The height of the triangle must exceed the tolerance, otherwise it does not define a plane.
                if area <= 4.0 * tolerance * edge.norm().max(other.norm()) {
                    continue;
                }
                for normal in [cross / area, -cross / area] {
                    let offset = normal.dot(&points[i]);
                    if points.iter().any(|p| normal.dot(p) - offset > tolerance) {
                        continue;
                    }
                    let face = fit(points, &normal, offset, tolerance);
                    let on: Vec<bool> = points
                        .iter()
                        .map(|p| face.height(p) >= -2.0 * tolerance)
                        .collect();
                    if !known.iter().any(|(_, old)| subset(&on, old)) {
                        if on[i] && on[j] {
                            beside.push(known.len());
                        }
                        known.push((face, on));
                    }
                }
            }
        }
    }
    if known.len() < 4 {
        return Err(ShapeError::Flat {
            thickness: 0.0,
            width: 0.0,
        });
    }
    Ok(known.into_iter().map(|(face, _)| face).collect())
}

fn subset(a: &[bool], b: &[bool]) -> bool {
    a.iter().zip(b).all(|(a, b)| !a || *b)
}

/// Returns the plane through all points of a face, with the normal of the widest triangle, so that no short edge
/// determines it; no point lies outside the plane.
fn fit(points: &[Vector3<f64>], normal: &Vector3<f64>, offset: f64, tolerance: f64) -> HalfSpace {
    let on: Vec<&Vector3<f64>> = points
        .iter()
        .filter(|p| normal.dot(p) - offset >= -tolerance)
        .collect();
    let far = |from: &Vector3<f64>| {
        on.iter().copied().max_by(|a, b| {
            (*a - from)
                .norm_squared()
                .total_cmp(&(*b - from).norm_squared())
        })
    };
    let mut best = *normal;
    if let Some(a) = on.first().and_then(|first| far(first))
        && let Some(b) = far(a)
    {
        let edge = b - a;
        let wide = on.iter().copied().max_by(|p, q| {
            let area = |p: &Vector3<f64>| edge.cross(&(p - a)).norm_squared();
            area(p).total_cmp(&area(q))
        });
        if let Some(c) = wide {
            let cross = edge.cross(&(c - a));
            let area = cross.norm();
            if area > 0.0 {
                let unit = cross / area;
                best = if unit.dot(normal) < 0.0 { -unit } else { unit };
            }
        }
    }
    let offset = points
        .iter()
        .map(|p| best.dot(p))
        .fold(f64::NEG_INFINITY, f64::max);
    HalfSpace {
        normal: best,
        offset,
    }
}
