//! Walls of convex facets (polygons and triangulated surfaces), and the contact points of a sphere with them.
//!
//! The closest point of a facet lies on its face, on an edge or at a vertex. **A contact is a local minimum of the
//! distance from the centre of the sphere to the surface.** The closest point on a face is always such a minimum. A
//! point on an edge or at a vertex is a minimum only where it is the closest point of *every* facet that shares this
//! edge or vertex. This has three consequences:
//!
//! - A sphere on a face is not subject to forces from its edges and vertices: there are no bumps on interior edges.
//! - An edge or vertex acts once, however many facets share it.
//! - A concave corner acts with its faces only.
//!
//! If an edge ends on another facet or lies in one, as where solids overlap, this facet counts as well.
//!
//! Minima whose normals differ by less than 10 degrees count as one contact, the nearest. The facets of a slightly
//! curved surface therefore do not act twice, nor does an interior edge exactly below a sphere. Both sides of a
//! facet act. Facets share vertices: the vertex indices give the neighbours of a facet.
//!
//! In a periodic domain a surface is repeated ([`repeated`]).
//!
//! The hierarchy of faces, edges and vertices follows M. Santasusana, J. Irazábal, E. Oñate, J. M. Carbonell, Comput.
//! Part. Mech. 3 (2016) 407, doi:10.1007/s40571-016-0109-4.

mod faces;
mod repeated;

use nalgebra::{Matrix3, Vector3};

use super::ghosts::index;
use super::polyhedron::cut::CUBE_FACES;
use base::error::Error;
use base::number::whole;
pub(super) use faces::Faces;
use repeated::Repeated;

/// Stationary convex facets with shared vertices; the motion is that of the wall.
#[derive(Clone, Debug, PartialEq)]
pub struct FacetSurface {
    vertices: Vec<Vector3<f64>>,
    /// Vertex indices of all facets, one facet after another.
    corners: Vec<u32>,
    facets: Vec<Facet>,
    /// Groups of neighbouring facets.
    groups: Vec<Group>,
    /// Periodic images of the surface.
    repeated: Option<Box<Repeated>>,
    /// Projection of a velocity onto the directions normal to its facets; none if these span all directions.
    across: Option<Matrix3<f64>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Facet {
    first: u32,
    end: u32,
    normal: Vector3<f64>,
    /// Largest extent of the facet \[m\].
    size: f64,
}

/// Group of neighbouring facets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub(super) facets: Vec<u32>,
    /// Bounding box \[m\].
    pub(super) bounds: [Vector3<f64>; 2],
}

/// Feature of a facet that contains its closest point, by vertex indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Feature {
    Face,
    Edge(u32, u32),
    Vertex(u32),
}

/// Contact of a sphere with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Index of the facet.
    pub facet: u32,
    /// Distance of the centre \[m\].
    pub distance: f64,
    /// Unit normal from the surface to the centre.
    pub normal: Vector3<f64>,
    feature: Feature,
}

impl Nearest {
    /// Returns `true` if the closest point lies on an edge or at a vertex.
    pub(super) fn is_on_rim(&self) -> bool {
        self.feature != Feature::Face
    }

    /// Returns `true` if a plane with this normal, at this `distance` \[m\] from the centre, lies in the same
    /// direction and at most as far away.
    pub(super) fn yields_to(&self, normal: &Vector3<f64>, distance: f64) -> bool {
        distance <= self.distance * (1.0 + ON_RIM) && self.normal.dot(normal) > SAME_CONTACT_COSINE
    }

    /// Returns `true` if this contact, which a bond or a bridge holds, replaces one with another wall: that wall lies
    /// in the same direction, and its plane passes through the contact point of this one or behind it.
    pub(super) fn holds_instead_of(&self, other: &Self) -> bool {
        let cosine = self.normal.dot(&other.normal);
        cosine > SAME_CONTACT_COSINE && other.distance >= self.distance * cosine * (1.0 - ON_RIM)
    }

    /// Returns `true` if this contact replaces one with another wall. `first` breaks ties; `on` returns `true` if
    /// the contact point of the other one lies on a facet of this wall.
    pub(super) fn replaces(&self, other: &Self, first: bool, on: impl FnOnce() -> bool) -> bool {
        let nearer = self.distance < other.distance * (1.0 - ON_RIM)
            || self.distance <= other.distance * (1.0 + ON_RIM) && first;
        nearer
            && (self.normal.dot(&other.normal) > SAME_CONTACT_COSINE
                || other.feature != Feature::Face && on())
    }
}

/// Number of facets in a group.
const GROUP: usize = 16;
/// Maximum distance of a closest point from the rim of a facet, in facet sizes, at which it lies on the rim.
const ON_RIM: f64 = 1e-9;
/// Maximum distance of a point from a facet, in facet sizes, at which it lies on the facet.
const ON_FACET: f64 = 1e-6;
/// Cosine of the angle between normals above which two minima are one contact.
const SAME_CONTACT_COSINE: f64 = 0.984_807_753_012_208;

impl FacetSurface {
    /// Returns a surface of facets with at least three corners each, given by indices of `vertices` \[m\].
    ///
    /// # Errors
    /// If there is no facet, or one is degenerate, not plane or not convex, or refers to a missing vertex; the text
    /// names it.
    pub fn new(vertices: Vec<Vector3<f64>>, facets: &[Vec<u32>]) -> Result<Self, Error> {
        let refuse = |k: usize, what: &str| Err(Error::Numerical(format!("facet {k} {what}")));
        let mut surface = Self {
            vertices,
            corners: Vec::new(),
            facets: Vec::new(),
            groups: Vec::new(),
            repeated: None,
            across: None,
        };
        if facets.is_empty() {
            return Err(Error::Numerical("the surface has no facets".into()));
        }
        for (k, corners) in facets.iter().enumerate() {
            let points: Option<Vec<Vector3<f64>>> = corners
                .iter()
                .map(|&c| surface.vertices.get(c as usize).copied())
                .collect();
            let Some(points) = points else {
                return refuse(k, "refers to a vertex that does not exist");
            };
            if points.len() < 3 || points.iter().any(|p| !p.norm_squared().is_finite()) {
                return refuse(k, "needs at least three corners with finite coordinates");
            }
            // Newell's normal: twice the vector area, for any corners.
            let mut area = Vector3::zeros();
            let mut size = 0.0_f64;
            for (n, a) in points.iter().enumerate() {
                let b = &points[(n + 1) % points.len()];
                area += (a - points[0]).cross(&(b - points[0]));
                size = size.max((b - points[0]).norm());
            }
            let twice = area.norm();
            if twice <= 1e-12 * size * size || size <= 0.0 {
                return refuse(k, "has no area");
            }
            let normal = area / twice;
            for (n, a) in points.iter().enumerate() {
                let (b, c) = (
                    &points[(n + 1) % points.len()],
                    &points[(n + 2) % points.len()],
                );
                if normal.dot(&(a - points[0])).abs() > 1e-6 * size {
                    return refuse(k, "is not planar");
                }
                if (b - a).cross(&(c - b)).dot(&normal) < -1e-9 * size * size {
                    return refuse(k, "is not convex");
                }
            }
            let first = index(surface.corners.len());
            surface.corners.extend_from_slice(corners);
            surface.facets.push(Facet {
                first,
                end: index(surface.corners.len()),
                normal,
                size,
            });
        }
        surface.groups = surface.neighbours();
        surface.across = surface.directions_across();
        Ok(surface)
    }

    /// Returns all facets in groups of neighbours, sorted along a space-filling (Morton) curve.
    fn neighbours(&self) -> Vec<Group> {
        let none = Vector3::repeat(f64::INFINITY);
        let join = |[low, high]: [Vector3<f64>; 2], at: Vector3<f64>| [low.inf(&at), high.sup(&at)];
        let [low, high] = self.vertices.iter().copied().fold([none, -none], join);
        let scale = (high - low).map(|length| if length > 0.0 { 1023.0 / length } else { 0.0 });
        let place = |facet: usize| {
            let first = self.numbers(facet)[0];
            let at = (self.vertices[first as usize] - low).component_mul(&scale);
            let cells: [usize; 3] = [at[0], at[1], at[2]].map(whole);
            let bits = (0..10).flat_map(|bit| (0..3).map(move |axis| (bit, axis)));
            bits.fold(0_usize, |key, (bit, axis)| {
                key | (cells[axis] >> bit & 1) << (3 * bit + axis)
            })
        };
        let mut order: Vec<(usize, usize)> = (0..self.len()).map(|k| (place(k), k)).collect();
        order.sort_unstable();
        let groups = order.chunks(GROUP).map(|group| {
            let corners = group.iter().flat_map(|(_, facet)| self.corners(*facet));
            Group {
                facets: group.iter().map(|(_, facet)| index(*facet)).collect(),
                bounds: corners.fold([none, -none], join),
            }
        });
        groups.collect()
    }

    /// Returns the groups of neighbouring facets; each facet is in one group.
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Returns `true` if a facet may be within `reach` \[m\] of a point, judged by its first corner and its size.
    #[inline(always)]
    pub(super) fn may_reach(&self, facet: usize, point: &Vector3<f64>, reach: f64) -> bool {
        let Facet { first, size, .. } = self.facets[facet];
        let corner = self.vertices[self.corners[first as usize] as usize];
        let farthest = (1.0 + ON_RIM) * (reach + size);
        (point - corner).norm_squared() <= farthest * farthest
    }

    /// Returns the faces of a box between two corners \[m\] as a surface.
    ///
    /// # Errors
    /// If the box has no volume.
    pub fn of_box(lower: Vector3<f64>, upper: Vector3<f64>) -> Result<Self, Error> {
        let vertices = (0..8)
            .map(|k: usize| {
                Vector3::from_fn(|axis, _| {
                    if k >> axis & 1 == 0 {
                        lower[axis]
                    } else {
                        upper[axis]
                    }
                })
            })
            .collect();
        Self::new(vertices, &CUBE_FACES.map(|face| face.to_vec()))
    }

    /// Returns the number of facets, including the images in a periodic domain.
    #[must_use]
    pub fn len(&self) -> usize {
        self.facets.len()
    }

    /// Returns `true` if there are no facets, which never occurs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }

    /// Returns the corners of a facet \[m\], in order.
    pub fn corners(&self, facet: usize) -> impl DoubleEndedIterator<Item = Vector3<f64>> + '_ {
        self.numbers(facet)
            .iter()
            .map(|&v| self.vertices[v as usize])
    }

    /// Returns the largest extent of a facet \[m\].
    #[must_use]
    pub fn size(&self, facet: usize) -> f64 {
        self.facets[facet].size
    }

    /// Returns the area of all facets \[m²\], without the images in a periodic domain.
    #[must_use]
    pub fn area(&self) -> f64 {
        let given = self
            .repeated
            .as_ref()
            .map(|repeated| repeated.given as usize);
        let facets = 0..given.unwrap_or(self.len());
        let area = |facet| {
            let corners: Vec<Vector3<f64>> = self.corners(facet).collect();
            let edges = corners.windows(2);
            let sum: Vector3<f64> = edges
                .map(|ends| (ends[0] - corners[0]).cross(&(ends[1] - corners[0])))
                .sum();
            0.5 * sum.norm()
        };
        facets.map(area).sum()
    }

    /// Returns the unit normal of a facet.
    #[must_use]
    pub fn normal(&self, facet: usize) -> Vector3<f64> {
        self.facets[facet].normal
    }

    fn numbers(&self, facet: usize) -> &[u32] {
        let facet = &self.facets[facet];
        &self.corners[facet.first as usize..facet.end as usize]
    }

    /// Returns the distance \[m\] of a point from a facet. In a periodic domain the point must lie in the domain.
    #[must_use]
    pub fn distance(&self, facet: usize, point: &Vector3<f64>) -> f64 {
        self.nearest(facet, point, f64::INFINITY)
            .map_or(f64::INFINITY, |near| near.distance)
    }

    /// Returns the distance \[m\] of a point from the nearest facet.
    #[must_use]
    pub fn clearance(&self, point: &Vector3<f64>) -> f64 {
        let (point, _) = self.in_domain(point);
        (0..self.len())
            .map(|facet| self.distance(facet, &point))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns `true` if the surface is nearer to a point than `reach` \[m\]: equivalent to a test of
    /// [`Self::clearance`], at a fraction of its cost.
    #[must_use]
    pub fn is_within(&self, point: &Vector3<f64>, reach: f64) -> bool {
        let (point, _) = self.in_domain(point);
        self.groups.iter().any(|group| {
            let [low, high] = group.bounds;
            let outside = (low - point).sup(&(point - high)).sup(&Vector3::zeros());
            outside.norm_squared() <= reach * reach
                && group
                    .facets
                    .iter()
                    .map(|facet| *facet as usize)
                    .any(|facet| {
                        self.may_reach(facet, &point, reach)
                            && self.nearest(facet, &point, reach).is_some()
                    })
        })
    }

    /// Returns `true` if a point lies on one of these facets.
    pub(super) fn stands_on(&self, near: &[u32], point: &Vector3<f64>) -> bool {
        near.iter().map(|facet| *facet as usize).any(|facet| {
            let reach = ON_FACET * self.facets[facet].size;
            self.nearest(facet, point, reach).is_some()
        })
    }

    /// Returns `true` if two facets are equal or share a vertex; facets are given by index or by name.
    #[must_use]
    pub fn adjacent(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|name| self.numbers(self.named(name) as usize));
        match &self.repeated {
            None => a.iter().any(|v| b.contains(v)),
            Some(repeated) => {
                let known = |v: &u32| repeated.given_vertex(*v);
                a.iter().any(|v| b.iter().any(|w| known(v) == known(w)))
            }
        }
    }

    /// Returns the closest point of a facet, if it is nearer than `reach`.
    #[inline]
    fn nearest(&self, facet: usize, point: &Vector3<f64>, reach: f64) -> Option<Nearest> {
        let Facet { normal, size, .. } = self.facets[facet];
        let numbers = self.numbers(facet);
        let vertex = |k: usize| self.vertices[numbers[k] as usize];
        let height = normal.dot(&(point - vertex(0)));
        if height.abs() >= reach {
            return None;
        }
        let mut closest = (f64::INFINITY, Feature::Face, Vector3::zeros());
        let mut inside = true;
        let mut k = numbers.len() - 1;
        for next in 0..numbers.len() {
            let (a, b) = (vertex(k), vertex(next));
            let edge = b - a;
            // Signed distance outside the edge, times the length of the edge.
            if edge.cross(&normal).dot(&(point - a)) > -ON_RIM * size * edge.norm() {
                inside = false;
                // The bits do not depend on the direction of the edge.
                let low = numbers[k].min(numbers[next]);
                let high = numbers[k].max(numbers[next]);
                let (from, to) = (self.vertices[low as usize], self.vertices[high as usize]);
                let edge = to - from;
                let along = edge.dot(&(point - from)) / edge.norm_squared();
                let (feature, foot) = if along <= ON_RIM {
                    (Feature::Vertex(low), from)
                } else if along >= 1.0 - ON_RIM {
                    (Feature::Vertex(high), to)
                } else {
                    (Feature::Edge(low, high), from + edge * along)
                };
                let between = point - foot;
                let squared = between.norm_squared();
                if squared < closest.0 {
                    closest = (squared, feature, between);
                }
            }
            k = next;
        }
        let (distance, feature, normal) = if inside {
            let side = if height < 0.0 { -1.0 } else { 1.0 };
            (height.abs(), Feature::Face, normal * side)
        } else {
            let distance = closest.0.sqrt();
            let away = if distance > 0.0 {
                closest.2 / distance
            } else {
                normal
            };
            (distance, closest.1, away)
        };
        (distance < reach).then_some(Nearest {
            facet: index(facet),
            distance,
            normal,
            feature,
        })
    }

    /// Finds the contacts of a centre nearer than `reach` \[m\], in ascending order of facets. `near` must contain
    /// all facets within reach. `found` is cleared first.
    pub fn contacts(
        &self,
        near: &[u32],
        centre: &Vector3<f64>,
        reach: f64,
        found: &mut Vec<Nearest>,
    ) {
        found.clear();
        for &facet in near {
            if let Some(nearest) = self.nearest(facet as usize, centre, reach) {
                found.push(nearest);
            }
        }
        if found.len() < 2 {
            return;
        }
        found.sort_unstable_by(|a, b| {
            a.distance
                .total_cmp(&b.distance)
                .then(a.facet.cmp(&b.facet))
        });
        // Contacts that are kept move to the front, past those already tested.
        let mut kept = 0;
        for k in 0..found.len() {
            let one = found[k];
            let known = found[..kept]
                .iter()
                .any(|other| other.normal.dot(&one.normal) > SAME_CONTACT_COSINE);
            let minimum = || match one.feature {
                Feature::Face => true,
                Feature::Edge(a, b) => self.is_minimum(near, &one, centre, &[a, b]),
                Feature::Vertex(a) => self.is_minimum(near, &one, centre, &[a]),
            };
            if !known && minimum() {
                found[kept] = one;
                kept += 1;
            }
        }
        found.truncate(kept);
        found.sort_unstable_by_key(|one| one.facet);
    }

    /// Returns `true` if all facets of `near` that share these vertices have this closest point, and no other facet
    /// through this point comes closer.
    fn is_minimum(
        &self,
        near: &[u32],
        one: &Nearest,
        centre: &Vector3<f64>,
        vertices: &[u32],
    ) -> bool {
        let foot = centre - one.normal * one.distance;
        near.iter().all(|&facet| {
            let numbers = self.numbers(facet as usize);
            let closest = |point: &Vector3<f64>| self.nearest(facet as usize, point, f64::INFINITY);
            if vertices.iter().all(|v| numbers.contains(v)) {
                closest(centre).is_some_and(|other| other.feature == one.feature)
            } else {
                let size = self.facets[facet as usize].size;
                closest(&foot).is_none_or(|at| at.distance > ON_FACET * size)
                    || closest(centre)
                        .is_none_or(|other| other.distance >= one.distance * (1.0 - ON_RIM))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use base::random::Stream;

    fn touch(surface: &FacetSurface, at: [f64; 3], reach: f64) -> Vec<Nearest> {
        let all: Vec<u32> = (0..u32::try_from(surface.len()).unwrap()).collect();
        let mut found = Vec::new();
        surface.contacts(&all, &Vector3::from(at), reach, &mut found);
        found
    }

    /// Returns a plane square divided into `n` by `n` squares of two triangles each.
    fn flat(n: u32) -> FacetSurface {
        let vertices = (0..=n)
            .flat_map(|y| (0..=n).map(move |x| Vector3::new(f64::from(x), f64::from(y), 0.0)))
            .collect();
        let mut facets = Vec::new();
        for y in 0..n {
            for x in 0..n {
                let a = y * (n + 1) + x;
                facets.push(vec![a, a + 1, a + n + 2]);
                facets.push(vec![a, a + n + 2, a + n + 1]);
            }
        }
        FacetSurface::new(vertices, &facets).unwrap()
    }

    #[test]
    fn a_flat_mesh_is_one_plane_everywhere() {
        let mesh = flat(6);
        for k in 0..2000 {
            let mut draw = Stream::new(4, k, 0);
            // Every fourth point lies exactly on grid lines, every eighth at vertices.
            let mut place = || 1.0 + 4.0 * draw.uniform();
            let (mut x, mut y) = (place(), place());
            if k % 4 == 0 {
                x = x.round();
            }
            if k % 8 == 0 {
                y = y.round();
            }
            let found = touch(&mesh, [x, y, 0.7], 1.9);
            assert_eq!(found.len(), 1, "at {x} {y}: {found:?}");
            assert_relative_eq!(found[0].distance, 0.7, epsilon = 1e-12);
            assert_relative_eq!(found[0].normal[2], 1.0, epsilon = 1e-12);
        }
    }

    /// Checks that groups omit no facet, on a wavy mesh whose facets are numbered at random, alone and repeated in a
    /// periodic domain.
    #[test]
    fn what_is_within_reach_is_what_the_clearance_says() {
        let n = 12_u32;
        let at = |i: u32, j: u32| {
            let (x, y) = (f64::from(i), f64::from(j));
            Vector3::new(x, y, (0.7 * x).sin() * (0.5 * y).cos())
        };
        let vertices = (0..=n)
            .flat_map(|i| (0..=n).map(move |j| at(i, j)))
            .collect();
        let number = |i: u32, j: u32| i * (n + 1) + j;
        let mut facets: Vec<Vec<u32>> = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let (a, b) = (number(i, j), number(i + 1, j));
                let (c, d) = (number(i + 1, j + 1), number(i, j + 1));
                [vec![a, b, c], vec![a, c, d]]
            })
            .collect();
        facets.sort_by_key(|corners| {
            u64::from(corners[0] + 7 * corners[1]).wrapping_mul(0x9e37_79b9) % 1009
        });
        let alone = FacetSurface::new(vertices, &facets).unwrap();
        let repeated = alone.clone().repeated([0.0; 3], [12.0, 0.0, 0.0]).unwrap();
        for surface in [&alone, &repeated] {
            let mut within = 0;
            for k in 0..4000 {
                let mut draw = Stream::new(6, k, 0);
                let point = Vector3::new(
                    12.0 * draw.uniform(),
                    14.0 * draw.uniform() - 1.0,
                    6.0 * draw.uniform() - 3.0,
                );
                let reach = 1.5 * draw.uniform();
                let expected = surface.clearance(&point) < reach;
                assert_eq!(
                    surface.is_within(&point, reach),
                    expected,
                    "{point} {reach}"
                );
                within += u32::from(expected);
            }
            assert!((400..3600).contains(&within), "{within}");
        }
    }

    #[test]
    fn a_box_pushes_once_per_wall_edge_or_corner() {
        let cube = FacetSurface::of_box(Vector3::zeros(), Vector3::new(1.0, 1.0, 1.0)).unwrap();
        // Inside, a corner touches three faces and an edge two, without contacts of the edge or vertex.
        assert_eq!(touch(&cube, [0.1, 0.1, 0.1], 0.2).len(), 3);
        assert_eq!(touch(&cube, [0.1, 0.1, 0.5], 0.2).len(), 2);
        assert_eq!(touch(&cube, [0.1, 0.5, 0.5], 0.2).len(), 1);
        // Outside there is one contact, with the corner, the edge or the face.
        for (at, distance) in [
            ([-0.1, -0.1, -0.1], 0.03_f64.sqrt()),
            ([-0.1, -0.1, 0.5], 0.02_f64.sqrt()),
            ([-0.1, 0.5, 0.5], 0.1),
            // Next to the edge only the face is touched.
            ([0.01, 0.5, 1.1], 0.1),
        ] {
            let found = touch(&cube, at, 0.3);
            assert_eq!(found.len(), 1, "{at:?} {found:?}");
            assert_relative_eq!(found[0].distance, distance, epsilon = 1e-12);
        }
    }

    #[test]
    fn closest_points_are_those_of_brute_force() {
        let corners = [
            Vector3::new(0.1, 0.2, 0.3),
            Vector3::new(1.2, 0.1, 0.0),
            Vector3::new(0.4, 0.9, 0.5),
        ];
        let triangle = FacetSurface::new(corners.to_vec(), &[vec![0, 1, 2]]).unwrap();
        for k in 0..200 {
            let mut draw = Stream::new(2, k, 0);
            let point = Vector3::from_fn(|_, _| 2.0 * draw.uniform() - 0.5);
            let mut best = f64::INFINITY;
            let n = 400;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (a, b) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                    let at = corners[0] * a + corners[1] * b + corners[2] * (1.0 - a - b);
                    best = best.min((point - at).norm());
                }
            }
            let found = triangle.distance(0, &point);
            assert!(
                found <= best + 1e-12 && found > best - 3e-3,
                "{found} {best}"
            );
        }
    }

    #[test]
    fn facets_that_are_none_are_refused() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            .map(|[x, y]| Vector3::new(x, y, 0.0))
            .to_vec();
        let refused = |vertices: Vec<Vector3<f64>>, facets: &[Vec<u32>]| {
            FacetSurface::new(vertices, facets).unwrap_err().to_string()
        };
        assert!(refused(square.clone(), &[]).contains("has no facets"));
        assert!(refused(square.clone(), &[vec![0, 1]]).contains("three corners"));
        assert!(refused(square.clone(), &[vec![0, 1, 9]]).contains("does not exist"));
        assert!(refused(square.clone(), &[vec![0, 1, 1]]).contains("no area"));
        assert!(refused(square.clone(), &[vec![0, 2, 1, 3]]).contains("facet 0"));
        let mut bent = square;
        bent[2][2] = 0.5;
        assert!(refused(bent, &[vec![0, 1, 2, 3]]).contains("not planar"));
    }
}
