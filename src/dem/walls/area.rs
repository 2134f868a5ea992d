//! Area of the part of a plane wall that grains can reach, which turns a force on the wall into a mean stress.
//!
//! A plane has no end. Its part is what lies within the domain and in front of all other plane walls: a convex polygon,
//! cut from a large square by one half-space after the other (I. E. Sutherland, G. W. Hodgman, Commun. ACM 17 (1974)
//! 32, doi:10.1145/360767.360802). In two dimensions it is a strip 1 m deep. Planes parallel to the wall do not cut it.

use super::Wall;
use crate::space::Space;
use nalgebra::Vector3;

/// Cosine of the angle between two normals from which planes count as parallel.
const PARALLEL: f64 = 1.0 - 1e-9;

/// Plane, and the half-space on the side of its unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Point of the plane \[m\].
    pub point: Vector3<f64>,
    /// Unit normal into the half-space.
    pub normal: Vector3<f64>,
}

impl HalfSpace {
    /// Returns the height of a point above the plane \[m\].
    fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(&(point - self.point))
    }
}

/// Buffers of the polygon, reused between walls.
#[derive(Clone, Debug, Default)]
pub struct PlaneArea {
    polygon: Vec<Vector3<f64>>,
    cut: Vec<Vector3<f64>>,
}

impl PlaneArea {
    /// Returns the area \[m²\] of the part of `plane` within the box from `lower` to `upper` \[m\] and in front of
    /// `others`. A box in the plane is 1 m deep.
    pub fn within(
        &mut self,
        plane: &HalfSpace,
        corners: [Vector3<f64>; 2],
        others: impl Iterator<Item = HalfSpace>,
    ) -> f64 {
        self.part(plane, corners, others);
        self.area()
    }

    /// Returns the corners of the part of `plane` within the box from `lower` to `upper` \[m\] and in front of
    /// `others`, counter-clockwise seen against the normal; planes parallel to it do not cut it.
    pub fn part(
        &mut self,
        plane: &HalfSpace,
        [lower, upper]: [Vector3<f64>; 2],
        others: impl Iterator<Item = HalfSpace>,
    ) -> &[Vector3<f64>] {
        let reach = 2.0 * (upper - lower).norm();
        let middle = 0.5 * (lower + upper);
        let centre = middle - plane.normal * plane.height(&middle);
        let axis = plane.normal.iamin();
        let first = plane.normal.cross(&Vector3::ith(axis, 1.0)).normalize() * reach;
        let second = plane.normal.cross(&first);
        self.polygon.clear();
        self.polygon.extend([
            centre - first - second,
            centre + first - second,
            centre + first + second,
            centre - first + second,
        ]);
        for a in 0..3 {
            for (point, side) in [(lower, 1.0), (upper, -1.0)] {
                let normal = Vector3::ith(a, side);
                self.keep(plane, &HalfSpace { point, normal });
            }
        }
        for other in others {
            self.keep(plane, &other);
        }
        &self.polygon
    }

    /// Returns the area \[m²\] of plane wall number `wall` of `walls` in a box from `lower` to `upper` \[m\].
    pub fn of_wall<S: Space>(
        &mut self,
        walls: &[Wall<S>],
        wall: usize,
        [lower, upper]: [S::Vector; 2],
    ) -> f64 {
        let plane = |wall: &Wall<S>| HalfSpace {
            point: S::to_volume(&wall.point),
            normal: S::to_volume(&wall.normal),
        };
        let mut corners = [S::to_volume(&lower), S::to_volume(&upper)];
        if S::DIMENSION == 2 {
            corners[1].z = corners[0].z + 1.0;
        }
        let others = walls.iter().enumerate();
        let others = others.filter(|(n, other)| *n != wall && !other.open);
        let planes = others.filter(|(_, other)| other.surface.is_none());
        let planes = planes.map(|(_, other)| plane(other));
        self.within(&plane(&walls[wall]), corners, planes)
    }

    /// Cuts off the part behind a plane that is not parallel to the wall.
    fn keep(&mut self, wall: &HalfSpace, by: &HalfSpace) {
        if wall.normal.dot(&by.normal).abs() > PARALLEL {
            return;
        }
        self.cut.clear();
        let ends = self.polygon.iter().cycle().skip(1);
        for (from, to) in self.polygon.iter().zip(ends) {
            let (a, b) = (by.height(from), by.height(to));
            if a >= 0.0 {
                self.cut.push(*from);
            }
            if (a >= 0.0) != (b >= 0.0) {
                self.cut.push(from + (to - from) * (a / (a - b)));
            }
        }
        std::mem::swap(&mut self.polygon, &mut self.cut);
    }

    /// Returns the area of the polygon \[m²\].
    fn area(&self) -> f64 {
        let Some(first) = self.polygon.first() else {
            return 0.0;
        };
        let edges = self.polygon.windows(2);
        let sum: Vector3<f64> = edges
            .map(|ends| (ends[0] - first).cross(&(ends[1] - first)))
            .sum();
        0.5 * sum.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{PlaneSpace, Volume};
    use approx::assert_relative_eq;
    use nalgebra::Vector2;

    /// Checks the side of a box between a floor and a plate, and a plane across the corners of a cube: a regular
    /// hexagon of side 1/sqrt(2).
    #[test]
    fn a_part_of_a_plane_has_its_area() {
        let up = Vector3::new(0.0, 1.0, 0.0);
        let mut walls = Wall::<Volume>::of_box(
            Vector3::zeros(),
            Vector3::new(2.0, 5.0, 3.0),
            [true, true, false],
            0,
        );
        walls.push(Wall::new(Vector3::new(0.0, 4.0, 0.0), -up, 0));
        let corners = [Vector3::zeros(), Vector3::new(2.0, 5.0, 3.0)];
        let mut area = PlaneArea::default();
        assert_relative_eq!(area.of_wall(&walls, 0, corners), 12.0, max_relative = 1e-14);
        assert_relative_eq!(area.of_wall(&walls, 4, corners), 6.0, max_relative = 1e-14);
        // A plate that is not there does not cut the side.
        walls[4].open = true;
        assert_relative_eq!(area.of_wall(&walls, 0, corners), 15.0, max_relative = 1e-14);
        let across =
            Wall::<Volume>::new(Vector3::new(0.5, 0.5, 0.5), Vector3::new(1.0, 1.0, 1.0), 0);
        let cube = [Vector3::zeros(), Vector3::new(1.0, 1.0, 1.0)];
        let hexagon = 1.5 * 3.0_f64.sqrt() * 0.5;
        assert_relative_eq!(
            area.of_wall(&[across], 0, cube),
            hexagon,
            max_relative = 1e-14
        );
    }

    /// Checks that in the plane an incline from the floor to the side of a box cuts the floor, and has the area of its
    /// own length.
    #[test]
    fn a_strip_has_its_length() {
        let floor = Wall::<PlaneSpace>::new(Vector2::zeros(), Vector2::new(0.0, 1.0), 0);
        let incline = Wall::new(Vector2::new(3.0, 0.0), Vector2::new(-1.0, 1.0), 0);
        let walls = [floor, incline];
        let corners = [Vector2::zeros(), Vector2::new(7.0, 9.0)];
        let mut area = PlaneArea::default();
        assert_relative_eq!(area.of_wall(&walls, 0, corners), 3.0, max_relative = 1e-14);
        let length = 4.0 * 2.0_f64.sqrt();
        assert_relative_eq!(
            area.of_wall(&walls, 1, corners),
            length,
            max_relative = 1e-14
        );
    }
}
