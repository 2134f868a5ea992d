//! The shape of a block: a convex polyhedron in its own frame, with the origin at the centroid and axes along the
//! principal axes.
//!
//! A shape is constructed from vertices, half-spaces, edge lengths of a box, or the triangles of an STL file. The
//! input may be anywhere in space; [`PlacedPolyhedron`] contains the position and orientation of the block. Volume,
//! centroid and inertia tensor are exact sums over tetrahedra. A cube, or another solid with a diagonal inertia
//! tensor, keeps its axes.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::HalfSpace;
use super::cut::{Cut, count_f64, number};
use super::hull;
use super::linear_program::{NO_BASIS, Verdict, solve};
use super::shape_error::ShapeError;

/// Ratio of thickness to width below which a solid is flat.
const FLAT: f64 = 1e-9;
/// Maximum distance of a corner of an STL file from a plane, in widths of the solid, at which it lies on the plane:
/// the file has single precision.
const STL_PLANE: f64 = 2e-6;

/// Edge between two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Indices of the vertices at both ends.
    pub ends: [u32; 2],
    /// Faces on both sides.
    pub faces: [u32; 2],
}

/// Convex polyhedron in its body frame: see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyhedron {
    half_spaces: Vec<HalfSpace>,
    vertices: Vec<Vector3<f64>>,
    corners: Vec<u32>,
    starts: Vec<u32>,
    edges: Vec<Edge>,
    volume: f64,
    inertia: Vector3<f64>,
    radius: f64,
}

/// Block as given: its shape and its position in the input.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedPolyhedron {
    /// Shape in its body frame.
    pub shape: Polyhedron,
    /// Centroid \[m\].
    pub position: Vector3<f64>,
    /// Rotation from the body frame into the frame of the input.
    pub orientation: UnitQuaternion<f64>,
}

impl Polyhedron {
    /// Returns a box with these edge lengths \[m\] and axes along the edges.
    ///
    /// # Errors
    /// If a length is not positive, or less than a billionth of another.
    pub fn cuboid(edges: Vector3<f64>) -> Result<Self, ShapeError> {
        if let Some(index) = (0..3).find(|&k| !(edges[k].is_finite() && edges[k] > 0.0)) {
            return Err(ShapeError::Unusable {
                what: "edge",
                index,
            });
        }
        let planes: Vec<HalfSpace> = (0..6)
            .map(|k| {
                let mut normal = Vector3::zeros();
                normal[k / 2] = if k % 2 == 0 { -1.0 } else { 1.0 };
                HalfSpace {
                    normal,
                    offset: 0.5 * edges[k / 2],
                }
            })
            .collect();
        if edges.min() < FLAT * edges.max() {
            return Err(ShapeError::Flat {
                thickness: edges.min(),
                width: edges.max(),
            });
        }
        Ok(Self::between(&planes, edges.max())?.shape)
    }

    /// Returns the convex hull of `points` \[m\]. The work grows with the cube of their number.
    ///
    /// # Errors
    /// If there are fewer than four or more than a thousand points, one is not finite, or they lie in a plane.
    pub fn from_vertices(points: &[Vector3<f64>]) -> Result<PlacedPolyhedron, ShapeError> {
        let Centred {
            local,
            middle,
            width,
            noise,
        } = centred("vertices", "vertex", points)?;
        if points.len() > hull::MAX_POINTS {
            return Err(ShapeError::Many {
                what: "vertices",
                found: points.len(),
                most: hull::MAX_POINTS,
            });
        }
        let planes =
            hull::half_spaces(&local, noise.max(1e-11 * width)).map_err(|_| ShapeError::Flat {
                thickness: 0.0,
                width,
            })?;
        Ok(Self::between(&planes, 2.0 * width)?.moved(&middle))
    }

    /// Returns the solid bounded by all `planes`, `normal . x <= offset`; normals need not be unit vectors.
    /// Redundant planes are dropped.
    ///
    /// # Errors
    /// If the planes leave no volume, or the solid is unbounded.
    pub fn from_half_spaces(planes: &[HalfSpace]) -> Result<PlacedPolyhedron, ShapeError> {
        let few = ShapeError::Few {
            what: "half-spaces",
            found: planes.len(),
            least: 4,
        };
        if planes.len() < 4 {
            return Err(few);
        }
        if planes.len() > hull::MAX_POINTS {
            return Err(ShapeError::Many {
                what: "half-spaces",
                found: planes.len(),
                most: hull::MAX_POINTS,
            });
        }
        let mut unit = Vec::with_capacity(planes.len());
        for (index, plane) in planes.iter().enumerate() {
            let length = plane.normal.norm();
            if !(length.is_finite() && length > 0.0 && plane.offset.is_finite()) {
                return Err(ShapeError::Unusable {
                    what: "half-space",
                    index,
                });
            }
            unit.push(HalfSpace {
                normal: plane.normal / length,
                offset: plane.offset / length,
            });
        }
        // The solid is bounded if the normals surround the origin.
        let normals: Vec<Vector3<f64>> = unit.iter().map(|plane| plane.normal).collect();
        let around = hull::half_spaces(&normals, 1e-12).unwrap_or_default();
        let tightest = around
            .iter()
            .min_by(|a, b| a.offset.total_cmp(&b.offset))
            .copied();
        let narrow = match tightest {
            Some(plane) if plane.offset > 1e-9 => plane.offset,
            Some(plane) => {
                return Err(ShapeError::Unbounded {
                    direction: plane.normal.into(),
                });
            }
            // All normals lie in a plane: the solid is unbounded along that plane, or normal to it if the plane
            // does not contain the origin.
            None => {
                return Err(ShapeError::Unbounded {
                    direction: common_normal(&normals).into(),
                });
            }
        };
        let far = |planes: &[HalfSpace]| {
            let farthest = planes.iter().map(|p| p.offset.abs()).fold(0.0, f64::max);
            2.0 * farthest.max(f64::MIN_POSITIVE) / narrow
        };
        // Deepest point, computed twice: the second time from near it.
        let mut middle = Vector3::zeros();
        let mut depth = 0.0;
        for _ in 0..2 {
            match solve(&unit, unit.len(), 4.0 * far(&unit), &mut NO_BASIS.clone()) {
                Verdict::Overlap {
                    point,
                    depth: found,
                } => {
                    middle += point;
                    depth = found;
                    for plane in &mut unit {
                        plane.offset -= plane.normal.dot(&point);
                    }
                }
                Verdict::Apart { gap, .. } if gap > FLAT * far(&unit) => {
                    return Err(ShapeError::Empty { gap });
                }
                Verdict::Apart { .. } | Verdict::Open => {
                    return Err(ShapeError::Flat {
                        thickness: 0.0,
                        width: far(&unit),
                    });
                }
            }
        }
        let nearest = unit.iter().map(|p| p.offset).fold(f64::INFINITY, f64::min);
        let noise = 1e-15 * middle.amax();
        if depth <= noise || nearest <= noise {
            return Err(ShapeError::Flat {
                thickness: 2.0 * depth,
                width: far(&unit),
            });
        }
        Ok(Self::between(&unit, far(&unit))?.moved(&middle))
    }

    /// Returns the solid of a closed convex surface of `triangles` \[m\], with all corners counter-clockwise seen
    /// from outside, or all clockwise. Coplanar triangles become one face.
    ///
    /// # Errors
    /// If the surface is not convex, not closed or flat.
    pub fn from_triangles(triangles: &[[Vector3<f64>; 3]]) -> Result<PlacedPolyhedron, ShapeError> {
        let corners: Vec<Vector3<f64>> = triangles.iter().flatten().copied().collect();
        let Centred {
            local,
            middle,
            width,
            ..
        } = centred("corners of triangles", "corner", &corners)?;
        let tolerance = STL_PLANE * width;
        let enclosed = local
            .chunks_exact(3)
            .map(|t| t[0].dot(&t[1].cross(&t[2])) / 6.0)
            .sum::<f64>();
        let side = 1_f64.copysign(enclosed);
        // Large triangles first: their planes are the most accurate.
        let mut order: Vec<(f64, usize)> = local
            .chunks_exact(3)
            .map(|t| (t[1] - t[0]).cross(&(t[2] - t[0])).norm())
            .zip(0..)
            .filter(|&(area, _)| area > 0.0)
            .collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut planes: Vec<HalfSpace> = Vec::new();
        for (area, triangle) in order {
            let [a, b, c] = [0, 1, 2].map(|k| local[3 * triangle + k]);
            let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
            let known = |plane: &HalfSpace| {
                [a, b, c]
                    .iter()
                    .all(|p| plane.height(p).abs() <= 2.0 * tolerance)
            };
            if area <= 2.0 * tolerance * longest || planes.iter().any(known) {
                continue;
            }
            let normal = (b - a).cross(&(c - a)) * (side / area);
            let offset = normal.dot(&((a + b + c) / 3.0));
            let height = local
                .iter()
                .map(|p| normal.dot(p) - offset)
                .fold(0.0, f64::max);
            // The normal of a flat triangle is only as accurate as its corners relative to its height.
            if height > tolerance * (1.0 + width * longest / area) {
                return Err(ShapeError::NotConvex { triangle, height });
            }
            planes.push(HalfSpace {
                normal,
                offset: offset + height,
            });
        }
        let not_closed = |volume| ShapeError::NotClosed {
            enclosed: enclosed.abs(),
            volume,
        };
        let solid = Self::between(&planes, 2.0 * width).map_err(|_| not_closed(f64::INFINITY))?;
        let volume = solid.shape.volume;
        if (volume - enclosed.abs()).abs() > 1e-4 * volume + 8.0 * tolerance * width * width {
            return Err(not_closed(volume));
        }
        Ok(solid.moved(&middle))
    }

    /// Returns the solid bounded by `planes`, which contains the origin and extends at most `reach` \[m\] from it.
    fn between(planes: &[HalfSpace], reach: f64) -> Result<PlacedPolyhedron, ShapeError> {
        let flat = |thickness, width| ShapeError::Flat { thickness, width };
        let cut = Cut::from_planes(planes, reach).ok_or(flat(0.0, reach))?;
        let first = moments(&cut, &Vector3::zeros()).centroid;
        let VolumeMoments { volume, second, .. } = moments(&cut, &first);
        let width = cut
            .vertices
            .iter()
            .map(|v| (v - first).norm())
            .fold(0.0, f64::max);
        if !(volume.is_finite() && volume > 0.0) {
            return Err(flat(0.0, width));
        }
        let inertia = Matrix3::identity() * second.trace() - second;
        let (principal, axes) = principal_axes(&inertia);
        let thickness = 2.0
            * planes
                .iter()
                .map(|plane| -plane.height(&first))
                .fold(f64::INFINITY, f64::min);
        if thickness < FLAT * width {
            return Err(flat(thickness, width));
        }
        let mut shape = Self {
            half_spaces: Vec::new(),
            vertices: cut
                .vertices
                .iter()
                .map(|v| axes.inverse() * (v - first))
                .collect(),
            corners: Vec::new(),
            starts: vec![0],
            edges: Vec::new(),
            volume,
            inertia: principal,
            radius: width,
        };
        for (name, corners) in &cut.faces {
            let plane = planes.get(*name).ok_or(flat(0.0, width))?;
            shape.half_spaces.push(HalfSpace {
                normal: axes.inverse() * plane.normal,
                offset: -plane.height(&first),
            });
            shape.corners.extend_from_slice(corners);
            shape.starts.push(number(shape.corners.len()));
        }
        shape.edges = edges(&cut).ok_or(flat(0.0, width))?;
        Ok(PlacedPolyhedron {
            shape,
            position: first,
            orientation: UnitQuaternion::from_rotation_matrix(&axes),
        })
    }

    /// Returns the half-spaces \[m\], one per face, in the order of the faces.
    #[must_use]
    pub fn half_spaces(&self) -> &[HalfSpace] {
        &self.half_spaces
    }

    /// Returns the vertices \[m\].
    #[must_use]
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Returns the vertices of a face, counter-clockwise seen from outside.
    #[must_use]
    #[inline]
    pub fn face(&self, face: usize) -> &[u32] {
        &self.corners[self.starts[face] as usize..self.starts[face + 1] as usize]
    }

    /// Returns the area \[m²\] of a face.
    #[must_use]
    pub fn face_area(&self, face: usize) -> f64 {
        let corners = self.face(face);
        let at = |k: usize| self.vertices[corners[k] as usize] - self.vertices[corners[0] as usize];
        let twice = (2..corners.len()).map(|k| at(k - 1).cross(&at(k)));
        0.5 * twice.sum::<Vector3<f64>>().norm()
    }

    /// Returns the edges.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the volume \[m³\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.volume
    }

    /// Returns the principal moments of inertia [kg m²] at a density [kg/m³].
    #[must_use]
    pub fn inertia(&self, density: f64) -> Vector3<f64> {
        self.inertia * density
    }

    /// Returns the radius \[m\] of the enclosing sphere about the centroid.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Returns the surface area \[m²\].
    #[must_use]
    pub fn area(&self) -> f64 {
        let areas = (0..self.half_spaces.len()).map(|face| self.face_area(face));
        areas.sum()
    }

    /// Returns the vertex farthest along a direction of the body frame, and its distance \[m, times the length of
    /// the direction\].
    #[must_use]
    #[inline]
    pub fn support(&self, direction: &Vector3<f64>) -> (usize, f64) {
        let mut best = (0, f64::NEG_INFINITY);
        for (k, vertex) in self.vertices.iter().enumerate() {
            let height = direction.dot(vertex);
            if height > best.1 {
                best = (k, height);
            }
        }
        best
    }
}

impl PlacedPolyhedron {
    /// Returns the half-spaces \[m\] in the frame of the input, in the order of the faces.
    #[must_use]
    pub fn half_spaces(&self) -> Vec<HalfSpace> {
        let standing = |plane: &HalfSpace| {
            let normal = self.orientation * plane.normal;
            HalfSpace {
                normal,
                offset: plane.offset + normal.dot(&self.position),
            }
        };
        self.shape.half_spaces().iter().map(standing).collect()
    }

    /// Returns the vertices \[m\] in the frame of the input.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vector3<f64>> {
        let standing = |v: &Vector3<f64>| self.position + self.orientation * v;
        self.shape.vertices().iter().map(standing).collect()
    }

    fn moved(mut self, by: &Vector3<f64>) -> Self {
        self.position += by;
        self
    }
}

/// Points relative to their middle \[m\].
struct Centred {
    local: Vec<Vector3<f64>>,
    middle: Vector3<f64>,
    /// Width of the points.
    width: f64,
    /// Rounding error of the points.
    noise: f64,
}

/// Returns points relative to their middle; refuses coplanar points.
fn centred(
    what: &'static str,
    one: &'static str,
    points: &[Vector3<f64>],
) -> Result<Centred, ShapeError> {
    if points.len() < 4 {
        return Err(ShapeError::Few {
            what,
            found: points.len(),
            least: 4,
        });
    }
    if let Some(index) = points.iter().position(|p| !p.norm_squared().is_finite()) {
        return Err(ShapeError::Unusable { what: one, index });
    }
    let mut low = points[0];
    let mut high = points[0];
    for point in points {
        low = low.inf(point);
        high = high.sup(point);
    }
    let middle = (low + high) * 0.5;
    let mut local: Vec<Vector3<f64>> = points.iter().map(|p| p - middle).collect();
    let inside = local.iter().sum::<Vector3<f64>>() / count_f64(local.len());
    for point in &mut local {
        *point -= inside;
    }
    let width = (high - low).norm();
    let noise = 4.0 * f64::EPSILON * low.amax().max(high.amax());
    // The widest triangle from a farthest pair, and the point farthest from its plane.
    let far = |of: &dyn Fn(&Vector3<f64>) -> f64| {
        local
            .iter()
            .copied()
            .max_by(|a, b| of(a).total_cmp(&of(b)))
            .unwrap_or_default()
    };
    let a = far(&|p| p.norm_squared());
    let b = far(&|p| (p - a).norm_squared());
    let edge = (b - a).try_normalize(0.0).unwrap_or_default();
    let c = far(&|p| (p - a).cross(&edge).norm_squared());
    let normal = (c - a).cross(&edge).try_normalize(0.0).unwrap_or_default();
    let d = far(&|p| (p - a).dot(&normal).abs());
    let thickness = (d - a).dot(&normal).abs();
    if thickness <= (FLAT * width).max(16.0 * noise) {
        return Err(ShapeError::Flat { thickness, width });
    }
    Ok(Centred {
        local,
        middle: middle + inside,
        width,
        noise,
    })
}

/// Returns the common normal of a plane that contains all of `normals`, on the side on which the solid is
/// unbounded.
fn common_normal(normals: &[Vector3<f64>]) -> Vector3<f64> {
    let first = normals[0];
    let far = |of: &dyn Fn(&Vector3<f64>) -> f64| {
        normals
            .iter()
            .copied()
            .max_by(|a, b| of(a).total_cmp(&of(b)))
            .unwrap_or_default()
    };
    let second = far(&|n| (n - first).norm_squared());
    let edge = second - first;
    let third = far(&|n| (n - first).cross(&edge).norm_squared());
    let cross = (third - first).cross(&edge);
    let normal = cross
        .try_normalize(1e-12)
        .unwrap_or_else(|| super::cut::across(&first).0);
    // All normals are on one side of the origin: the solid is unbounded towards the other side.
    if normal.dot(&first) > 0.0 {
        -normal
    } else {
        normal
    }
}

/// Moments of a solid.
pub(super) struct VolumeMoments {
    /// Volume \[m³\].
    pub(super) volume: f64,
    pub(super) centroid: Vector3<f64>,
    /// Integral of the products of the coordinates about an origin.
    pub(super) second: Matrix3<f64>,
}

/// Returns the volume, centroid, and second moments of the coordinates about `origin`.
pub(super) fn moments(cut: &Cut, origin: &Vector3<f64>) -> VolumeMoments {
    let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for (_, corners) in &cut.faces {
        let at = |k: usize| cut.vertices[corners[k] as usize] - origin;
        for k in 1..corners.len().saturating_sub(1) {
            let (a, b, c) = (at(0), at(k), at(k + 1));
            let part = a.dot(&b.cross(&c));
            let sum = a + b + c;
            volume += part / 6.0;
            first += sum * (part / 24.0);
            second +=
                (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose())
                    * (part / 120.0);
        }
    }
    VolumeMoments {
        volume,
        centroid: origin + first / volume,
        second,
    }
}

/// Returns the principal moments in ascending order and a right-handed frame of their axes; the given frame if it
/// is one already.
fn principal_axes(inertia: &Matrix3<f64>) -> (Vector3<f64>, Rotation3<f64>) {
    let off = inertia[(0, 1)]
        .abs()
        .max(inertia[(0, 2)].abs())
        .max(inertia[(1, 2)].abs());
    if off <= 1e-13 * inertia.trace() {
        return (inertia.diagonal(), Rotation3::identity());
    }
    let eigen = inertia.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [x, y] = [0, 1].map(|k| eigen.eigenvectors.column(order[k]).into_owned());
    // The third axis from the first two: right-handed, and orthogonal to rounding.
    let x = x.normalize();
    let y = (y - x * x.dot(&y)).normalize();
    let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let turned = axes.transpose() * inertia * axes;
    (turned.diagonal(), Rotation3::from_matrix_unchecked(axes))
}

/// Returns the edges; none if an edge does not have a face on each side.
fn edges(cut: &Cut) -> Option<Vec<Edge>> {
    let mut halves: Vec<([u32; 2], u32, bool)> = Vec::new();
    for (face, (_, corners)) in (0..).zip(&cut.faces) {
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            halves.push(([a.min(b), a.max(b)], face, a < b));
        }
    }
    halves.sort_unstable();
    let whole = halves.chunks_exact(2);
    if !whole.remainder().is_empty() {
        return None;
    }
    whole
        .map(|pair| {
            let (one, other) = (pair[0], pair[1]);
            (one.0 == other.0 && one.2 != other.2).then_some(Edge {
                ends: one.0,
                faces: [one.1, other.1],
            })
        })
        .collect()
}
