//! Contacts of a block with a sphere: the point of the block closest to the centre of the sphere.

use nalgebra::{Matrix3, Vector3};

use super::super::shape::Polyhedron;
use super::{Geometry, Narrow, Placed};

impl Narrow {
    /// Returns the contact of a block (first) and a sphere (second) of `radius` \[m\] with its centre at
    /// `separation` \[m\] from the block's centre: at the point of the block closest to the centre of the sphere.
    #[must_use]
    pub fn sphere(
        &self,
        block: &Placed,
        separation: &Vector3<f64>,
        radius: f64,
    ) -> Option<Geometry> {
        let reach = block.shape.radius() + radius;
        if separation.norm_squared() >= reach * reach {
            return None;
        }
        let centre = block.rotation.tr_mul(separation);
        let Foot {
            point: foot,
            normal,
            distance,
        } = closest(block.shape, &centre);
        let depth = radius - distance;
        if depth <= 0.0 {
            return None;
        }
        // Section of the sphere in the middle of the overlap.
        let half = (distance + 0.5 * depth).abs().min(radius);
        let area = std::f64::consts::PI * (radius * radius - half * half);
        let normal = block.rotation * normal;
        // Second moment of a disc, equal about all axes in its plane.
        let moment = area * area / (4.0 * std::f64::consts::PI);
        Some(Geometry {
            arm: block.rotation * foot - normal * (0.5 * depth),
            normal,
            depth,
            area,
            second: (Matrix3::identity() - normal * normal.transpose()) * moment,
            couple: Vector3::zeros(),
            rocks: false,
        })
    }
}

/// Point of a block's surface that is closest to another point.
struct Foot {
    point: Vector3<f64>,
    /// Unit normal.
    normal: Vector3<f64>,
    /// Signed distance of the other point \[m\].
    distance: f64,
}

/// Returns the point of a block's surface closest to a point in the frame of the block.
fn closest(shape: &Polyhedron, point: &Vector3<f64>) -> Foot {
    let mut highest = (f64::NEG_INFINITY, Vector3::z());
    for plane in shape.half_spaces() {
        let height = plane.height(point);
        if height > highest.0 {
            highest = (height, plane.normal);
        }
    }
    if highest.0 <= 0.0 {
        return Foot {
            point: point - highest.1 * highest.0,
            normal: highest.1,
            distance: highest.0,
        };
    }
    let mut best = (f64::INFINITY, *point);
    for (face, plane) in shape.half_spaces().iter().enumerate() {
        let height = plane.height(point);
        if height <= 0.0 || height * height >= best.0 {
            continue;
        }
        let corners = shape.face(face);
        let mut inside = true;
        for (k, &corner) in corners.iter().enumerate() {
            let (a, b) = (corner, corners[(k + 1) % corners.len()]);
            // The bits are the same from both faces of the edge.
            let [from, to] = [a.min(b), a.max(b)].map(|v| shape.vertices()[v as usize]);
            let edge = to - from;
            let out = edge.cross(&plane.normal) * if a < b { 1.0 } else { -1.0 };
            if out.dot(&(point - from)) > 0.0 {
                inside = false;
                let along = (edge.dot(&(point - from)) / edge.norm_squared()).clamp(0.0, 1.0);
                let foot = from + edge * along;
                let squared = (point - foot).norm_squared();
                if squared < best.0 {
                    best = (squared, foot);
                }
            }
        }
        if inside {
            best = (height * height, point - plane.normal * height);
        }
    }
    let away = point - best.1;
    let distance = away.norm();
    let normal = if distance > 0.0 {
        away / distance
    } else {
        highest.1
    };
    Foot {
        point: best.1,
        normal,
        distance,
    }
}
