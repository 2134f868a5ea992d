//! Tests that need more than one file of the module.

mod energy;
mod motion;
mod pairs;
mod shapes;
mod tops;
mod values;

use nalgebra::{UnitQuaternion, Vector3};

use super::{Placed, Polyhedron};
use base::random::Stream;

/// Returns a number in a range.
fn between(draw: &mut Stream, low: f64, high: f64) -> f64 {
    low + (high - low) * draw.uniform()
}

/// Returns a direction, uniform over the sphere.
fn direction(draw: &mut Stream) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| between(draw, -1.0, 1.0));
        if (0.01..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

/// Returns a random orientation.
fn random_orientation(draw: &mut Stream) -> UnitQuaternion<f64> {
    let axis = nalgebra::Unit::new_normalize(direction(draw));
    UnitQuaternion::from_axis_angle(&axis, between(draw, 0.0, 6.0))
}

fn placed<'a>(shape: &'a Polyhedron, orientation: &UnitQuaternion<f64>) -> Placed<'a> {
    Placed {
        shape,
        rotation: orientation.to_rotation_matrix().into_inner(),
    }
}

/// Returns the hull of random points on an ellipsoid.
fn random_hull(draw: &mut Stream, count: usize) -> Polyhedron {
    let axes = Vector3::from_fn(|_, _| between(draw, 0.4, 1.0));
    let points: Vec<Vector3<f64>> = (0..count)
        .map(|_| direction(draw).component_mul(&axes))
        .collect();
    Polyhedron::from_vertices(&points).unwrap().shape
}
