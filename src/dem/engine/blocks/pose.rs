//! Poses of bodies: rotation and axis-parallel box.

use nalgebra::{Matrix3, Vector3};

use super::super::super::ParticlesView;
use super::super::super::polyhedron::{Placed, Polyhedron};
use super::super::super::space::Space;

/// Rotation from the body frame into space, and the axis-parallel box about the centre \[m\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    pub(super) rotation: Matrix3<f64>,
    pub(super) low: Vector3<f64>,
    pub(super) high: Vector3<f64>,
}

impl Pose {
    pub(super) fn from_view<S: Space>(view: &ParticlesView<'_, S>, k: usize) -> Self {
        let Some((shape, rotation)) = view.polyhedron(k) else {
            let half = Vector3::repeat(view.body[k].radius);
            return Self {
                rotation: Matrix3::identity(),
                low: -half,
                high: half,
            };
        };
        let rotation = rotation.matrix();
        let (mut low, mut high) = (Vector3::zeros(), Vector3::zeros());
        for vertex in shape.vertices() {
            let corner = rotation * vertex;
            low = corner.inf(&low);
            high = corner.sup(&high);
        }
        Self {
            rotation,
            low,
            high,
        }
    }

    pub(super) fn placed<'a>(&self, shape: &'a Polyhedron) -> Placed<'a> {
        Placed {
            shape,
            rotation: self.rotation,
        }
    }
}

/// Returns `true` if the boxes of two bodies, the second shifted by `between` \[m\] from the first, have a gap of
/// at most `gap` \[m\].
#[inline(always)]
pub(super) fn boxes_meet([one, two]: [&Pose; 2], between: &Vector3<f64>, gap: f64) -> bool {
    (0..3).all(|axis| {
        between[axis] + two.low[axis] <= one.high[axis] + gap
            && one.low[axis] <= between[axis] + two.high[axis] + gap
    })
}
