//! Plane walls: infinite, with a material, at rest or moving.

use super::space::{Components, Space};

/// A half-space that grains cannot enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall<S: Space> {
    /// A point of its face (m), now.
    pub point: S::Vector,
    /// Unit normal, into the grains.
    pub normal: S::Vector,
    /// Velocity (m/s): along the face it drags, across it the face moves.
    pub velocity: S::Vector,
    /// Row in the table of contact parameters.
    pub material: u32,
}

impl<S: Space> Wall<S> {
    /// A wall at rest through `point` (m) whose `normal`, of any length, points into the grains.
    #[must_use]
    pub fn new(point: S::Vector, normal: S::Vector, material: u32) -> Self {
        let length = normal.length();
        Self {
            point,
            normal: normal * (1.0 / length),
            velocity: S::Vector::default(),
            material,
        }
    }

    /// Distance (m) of a point from the face, positive on the grains' side.
    #[must_use]
    #[inline(always)]
    pub fn distance(&self, point: &S::Vector) -> f64 {
        self.normal.scalar(&(*point - self.point))
    }

    /// The walls of a box that is not periodic along `axes`: lower and upper face of each, in the order of the axes.
    #[must_use]
    pub fn of_box(
        lower: S::Vector,
        upper: S::Vector,
        closed: [bool; 3],
        material: u32,
    ) -> Vec<Self> {
        let mut walls = Vec::new();
        for axis in (0..S::DIMENSION).filter(|&axis| closed[axis]) {
            for (corner, sign) in [(lower, 1.0), (upper, -1.0)] {
                let mut normal = S::Vector::default();
                normal.set(axis, sign);
                walls.push(Self::new(corner, normal, material));
            }
        }
        walls
    }
}
