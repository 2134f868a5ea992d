//! Walls in one plane: a contact that a plane wall already has is not counted again.
//!
//! Grains cannot pass a plane wall. Facets in its plane or behind it are therefore hidden as long as both
//! move with the same normal velocity, and the plane acts with its material and velocity. Of two walls in the same
//! plane the first acts. A contact of a sphere with a facet in the direction of an equally near plane does not
//! count, nor does one with an edge or a vertex on the plane, as at the foot of a ramp.

use crate::space::{Components, Space};
use crate::surface::{FacetSurface, Nearest};
use crate::walls::Wall;
use nalgebra::Vector3;

/// Maximum distance of a point from a plane, in sizes of a facet or a grain, at which it lies in the plane.
const IN_PLANE: f64 = 1e-6;

/// Returns the active plane walls.
fn planes<S: Space>(walls: &[Wall<S>]) -> impl Iterator<Item = &Wall<S>> {
    let stands = |wall: &&Wall<S>| wall.surface.is_none() && !wall.open;
    walls.iter().filter(stands)
}

/// Planes that may hide the facets of a wall.
pub(super) struct Planes {
    /// Point \[m\] and normal of each plane.
    planes: Vec<[Vector3<f64>; 2]>,
    /// Displacement of the wall \[m\].
    moved: Vector3<f64>,
}

impl Planes {
    /// Returns the planes whose normal velocity equals that of `wall`.
    pub(super) fn in_front_of<S: Space>(wall: &Wall<S>, walls: &[Wall<S>]) -> Self {
        let moves = |plane: &Wall<S>| plane.normal.scalar(&(wall.drift() - plane.drift())) != 0.0;
        let planes = planes(walls).filter(|plane| !moves(plane));
        let planes = planes.map(|plane| [plane.point, plane.normal].map(|v| S::to_volume(&v)));
        Self {
            planes: planes.collect(),
            moved: S::to_volume(&wall.point),
        }
    }

    /// Returns `true` if a facet lies in one of the planes or behind it.
    pub(super) fn hide(&self, surface: &FacetSurface, facet: u32) -> bool {
        let reach = IN_PLANE * surface.size(facet as usize);
        self.planes.iter().any(|[point, normal]| {
            let mut corners = surface.corners(facet as usize);
            corners.all(|corner| normal.dot(&(corner + self.moved - point)) <= reach)
        })
    }
}

/// Returns `true` if the gap between a grain and a plane wall is below `gap` \[m\].
pub(super) fn is_by_plane<S: Space>(
    walls: &[Wall<S>],
    position: &S::Vector,
    radius: f64,
    gap: f64,
) -> bool {
    planes(walls).any(|plane| plane.distance(position) <= radius + gap)
}

/// Removes the contacts of a sphere that a plane wall already has, except those for which `keep` returns `true`.
pub(super) fn drop_doubled_by_planes<S: Space>(
    walls: &[Wall<S>],
    (position, radius): (&S::Vector, f64),
    found: &mut Vec<Nearest>,
    keep: impl Fn(&Nearest) -> bool,
) {
    found.retain(|one| {
        let foot = *position - S::from_volume(&one.normal) * one.distance;
        let doubled = planes(walls).any(|plane| {
            one.yields_to(&S::to_volume(&plane.normal), plane.distance(position))
                || one.is_on_rim() && plane.distance(&foot) <= IN_PLANE * radius
        });
        keep(one) || !doubled
    });
}

/// Returns `true` if a plane wall before `wall` lies in the same plane, up to a fraction of the skin \[m\], and moves
/// with it.
pub(super) fn repeats_a_plane<S: Space>(walls: &[Wall<S>], wall: usize, skin: f64) -> bool {
    let one = &walls[wall];
    let along = |plane: &Wall<S>| plane.normal.scalar(&plane.drift());
    planes(&walls[..wall]).any(|plane| {
        plane.normal.scalar(&one.normal) > 1.0 - 1e-12
            && plane.distance(&one.point).abs() <= IN_PLANE * skin
            && along(plane) - along(one) == 0.0
    })
}
