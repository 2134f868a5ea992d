//! Exhaustive test of two convex polyhedra: the largest gap over all face normals and all cross products of edges.
//!
//! If two convex polyhedra are separate, one of these directions separates them (S. Gottschalk, M. C. Lin, D.
//! Manocha, SIGGRAPH 1996). Otherwise the direction of the smallest overlap is the shortest way to separate them.
//! The cost is the product of both numbers of edges. Without iterations that could fail, the test decides the pairs
//! that the linear program leaves undecided.

use nalgebra::{Matrix3, Vector3};

use super::shape::Polyhedron;

/// Sine of the angle between two edges below which their cross product defines no direction.
const PARALLEL: f64 = 1e-10;

/// Returns the unit axis with the largest gap, in the frame of the first body and pointing to the second, and the
/// gap \[m\] along it, negative if the bodies overlap. The second body is at `separation` and rotated by `turn`,
/// both in the frame of the first.
pub(super) fn widest_gap(
    first: &Polyhedron,
    second: &Polyhedron,
    turn: &Matrix3<f64>,
    separation: &Vector3<f64>,
) -> (Vector3<f64>, f64) {
    let mut best = (Vector3::x(), f64::NEG_INFINITY);
    let mut offer = |axis: Vector3<f64>| {
        let wide = gap(first, second, turn, separation, &axis);
        if wide > best.1 {
            best = (axis, wide);
        }
    };
    for plane in first.half_spaces() {
        offer(plane.normal);
    }
    for plane in second.half_spaces() {
        offer(-(turn * plane.normal));
    }
    let along = |shape: &Polyhedron, ends: [u32; 2]| {
        shape.vertices()[ends[1] as usize] - shape.vertices()[ends[0] as usize]
    };
    for one in first.edges() {
        let p = along(first, one.ends);
        for other in second.edges() {
            let q = turn * along(second, other.ends);
            let cross = p.cross(&q);
            let length = cross.norm();
            if length > PARALLEL * p.norm() * q.norm() {
                offer(cross / length);
                offer(-cross / length);
            }
        }
    }
    best
}

/// Returns the gap \[m\] along a unit axis in the frame of the first body that points to the second.
#[inline]
pub(super) fn gap(
    first: &Polyhedron,
    second: &Polyhedron,
    turn: &Matrix3<f64>,
    separation: &Vector3<f64>,
    axis: &Vector3<f64>,
) -> f64 {
    let near = second.support(&-turn.tr_mul(axis)).1;
    axis.dot(separation) - near - first.support(axis).1
}
