//! Fraction of a unit cell inside planes, computed from the planes alone, as a reference for the fractions of
//! polyhedra.
//!
//! One plane cuts a cell in closed form (R. Scardovelli, S. Zaleski, J. Comput. Phys. 164 (2000) 228). With several
//! planes the volume is ⅓ Σ area times distance over the faces of the remaining solid, each face clipped
//! independently.

use base::vector::dot;
use lbm::links::CellPlane;
use nalgebra::Vector3;

/// Lengths (in cells) below which a cut does not count.
const TOUCH: f64 = 1e-12;

/// Buffers of the clipping.
#[derive(Default)]
pub(super) struct Buffers {
    pub(super) cuts: Vec<CellPlane>,
    polygon: Vec<Vector3<f64>>,
    clipped: Vec<Vector3<f64>>,
}

/// Returns the volume of the unit cell with this lower corner inside all planes.
pub(super) fn cut_cell(planes: &[CellPlane], lower: [f64; 3], buffers: &mut Buffers) -> f64 {
    let middle = [lower[0] + 0.5, lower[1] + 0.5, lower[2] + 0.5];
    buffers.cuts.clear();
    for plane in planes {
        let n = plane.normal;
        let reach = 0.5 * (n[0].abs() + n[1].abs() + n[2].abs());
        let offset = plane.offset - dot(n, middle);
        if offset <= TOUCH - reach {
            return 0.0;
        }
        if offset < reach - TOUCH {
            // From here on about the centre of the cell.
            buffers.cuts.push(CellPlane { normal: n, offset });
        }
    }
    match buffers.cuts[..] {
        [] => 1.0,
        [only] => cut_once(&only),
        _ => cut_often(buffers),
    }
}

/// Returns the volume of a unit cube about the origin inside one plane that cuts it.
pub(super) fn cut_once(plane: &CellPlane) -> f64 {
    let mut m = plane.normal.map(f64::abs);
    m.sort_by(f64::total_cmp);
    let sum = m[0] + m[1] + m[2];
    // As a plane with positive normal of unit sum, its distance counted from the lowest corner.
    let alpha = 0.5 + plane.offset / sum;
    let [m1, m2, m3] = m.map(|x| x / sum);
    let small = alpha.min(1.0 - alpha).max(0.0);
    let part = smaller_part(small, m1, m2, m3);
    if alpha <= 0.5 { part } else { 1.0 - part }
}

/// Returns Scardovelli and Zaleski's volume below the plane m·x = α ≤ ½ in the unit cube, m1 ≤ m2 ≤ m3, Σ m
/// = 1.
fn smaller_part(alpha: f64, m1: f64, m2: f64, m3: f64) -> f64 {
    const TINY: f64 = 1e-8;
    if m2 < TINY {
        return alpha / m3;
    }
    let below = |x: f64| {
        let y = (alpha - x).max(0.0);
        y * y
    };
    if m1 < TINY {
        return (alpha * alpha - below(m2) - below(m3)) / (2.0 * m2 * m3);
    }
    let m12 = m1 + m2;
    if alpha < m1 {
        alpha * alpha * alpha / (6.0 * m1 * m2 * m3)
    } else if alpha < m2 {
        (alpha * (alpha - m1) + m1 * m1 / 3.0) / (2.0 * m2 * m3)
    } else if alpha < m12.min(m3) {
        let cubic = alpha * alpha * (3.0 * m12 - alpha)
            + m1 * m1 * (m1 - 3.0 * alpha)
            + m2 * m2 * (m2 - 3.0 * alpha);
        cubic / (6.0 * m1 * m2 * m3)
    } else if m3 < m12 {
        let cubic = alpha * alpha * (3.0 - 2.0 * alpha)
            + m1 * m1 * (m1 - 3.0 * alpha)
            + m2 * m2 * (m2 - 3.0 * alpha)
            + m3 * m3 * (m3 - 3.0 * alpha);
        cubic / (6.0 * m1 * m2 * m3)
    } else {
        (2.0 * alpha - m12) / (2.0 * m3)
    }
}

/// Returns the volume of a unit cube about the origin inside the planes of `buffers.cuts`.
pub(super) fn cut_often(buffers: &mut Buffers) -> f64 {
    let Buffers {
        cuts,
        polygon,
        clipped,
    } = buffers;
    let mut volume = 0.0;
    // Faces of the cube.
    for axis in 0..3 {
        for side in [-0.5, 0.5] {
            polygon.clear();
            for corner in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let mut at = Vector3::zeros();
                at[axis] = side;
                at[(axis + 1) % 3] = corner[0];
                at[(axis + 2) % 3] = corner[1];
                polygon.push(at);
            }
            for plane in cuts.iter() {
                clip(polygon, clipped, plane.normal.into(), plane.offset);
            }
            volume += area(polygon) * 0.5;
        }
    }
    // Faces of the body.
    for (k, face) in cuts.iter().enumerate() {
        let n = Vector3::from(face.normal);
        let s = n.cross(&Vector3::ith(n.iamin(), 1.0)).normalize();
        let t = n.cross(&s);
        let foot = n * face.offset;
        polygon.clear();
        for (a, b) in [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)] {
            polygon.push(foot + s * a + t * b);
        }
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut normal = Vector3::zeros();
                normal[axis] = side;
                clip(polygon, clipped, normal, 0.5);
            }
        }
        for (_, other) in cuts.iter().enumerate().filter(|&(other, _)| other != k) {
            clip(polygon, clipped, other.normal.into(), other.offset);
        }
        volume += area(polygon) * face.offset;
    }
    volume / 3.0
}

/// Clips a convex polygon to `normal . x <= offset`.
fn clip(
    polygon: &mut Vec<Vector3<f64>>,
    clipped: &mut Vec<Vector3<f64>>,
    normal: Vector3<f64>,
    offset: f64,
) {
    clipped.clear();
    for (k, from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let (p, q) = (normal.dot(from) - offset, normal.dot(&to) - offset);
        if p <= 0.0 {
            clipped.push(*from);
        }
        if (p < 0.0 && q > 0.0) || (p > 0.0 && q < 0.0) {
            clipped.push(from + (to - from) * (p / (p - q)));
        }
    }
    std::mem::swap(polygon, clipped);
}

/// Returns the area of a plane convex polygon.
fn area(polygon: &[Vector3<f64>]) -> f64 {
    let mut sum = Vector3::zeros();
    if let [first, rest @ ..] = polygon {
        for pair in rest.windows(2) {
            sum += (pair[0] - first).cross(&(pair[1] - first));
        }
    }
    0.5 * sum.norm()
}
