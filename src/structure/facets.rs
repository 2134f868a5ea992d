//! Surfaces as convex facets with shared vertices, and the outlines of 2-D solids as triangles.

use super::{Point, cross, norm, plus, times};
use base::number::{real, to_u32, whole};
use std::collections::HashMap;

/// Convex facets with shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facets {
    /// Corners \[m\].
    pub vertices: Vec<Point>,
    /// Vertices of each facet, counter-clockwise as seen from outside.
    pub faces: Vec<Vec<u32>>,
    known: HashMap<[u64; 3], u32>,
}

impl Facets {
    fn vertex(&mut self, at: Point) -> u32 {
        // -0 and 0 are the same coordinate.
        let key = at.map(|x| (x + 0.0).to_bits());
        let vertices = &mut self.vertices;
        *self.known.entry(key).or_insert_with(|| {
            vertices.push(at);
            to_u32(vertices.len() - 1)
        })
    }

    /// Adds a facet.
    pub(super) fn face(&mut self, corners: &[Point]) {
        let face = corners.iter().map(|at| self.vertex(*at)).collect();
        self.faces.push(face);
    }

    /// Adds other facets, shifted by a vector.
    pub(super) fn add(&mut self, other: &Self, shift: Point) {
        for face in &other.faces {
            let corners: Vec<Point> = face
                .iter()
                .map(|&k| plus(other.vertices[k as usize], shift))
                .collect();
            self.face(&corners);
        }
    }

    /// Returns the sides of a prism along z over an outline, without its ends.
    #[must_use]
    pub fn along_z(outline: &[[f64; 2]], depth: f64) -> Self {
        let mut facets = Self::default();
        facets.sides(outline, 2, -depth, depth);
        facets
    }

    /// Returns a prism over an outline along an axis: its sides and its ends.
    #[must_use]
    pub fn along(outline: &[[f64; 2]], axis: usize, from: f64, to: f64) -> Self {
        let mut facets = Self::default();
        facets.sides(outline, axis, from, to);
        for piece in pieces(outline) {
            let at = |level: f64| -> Vec<Point> {
                let corners = piece.iter();
                corners
                    .map(|&k| point_across(outline[k], axis, level))
                    .collect()
            };
            let (mut low, mut high) = (at(from), at(to));
            // Viewed along the axis, x and z run clockwise.
            if axis == 1 {
                high.reverse();
            } else {
                low.reverse();
            }
            facets.face(&low);
            facets.face(&high);
        }
        facets
    }

    /// Returns the area enclosed by an outline as facets.
    #[must_use]
    pub fn area(outline: &[[f64; 2]]) -> Self {
        let mut facets = Self::default();
        for piece in pieces(outline) {
            let corners: Vec<Point> = piece
                .iter()
                .map(|&k| point_across(outline[k], 2, 0.0))
                .collect();
            facets.face(&corners);
        }
        facets
    }

    fn sides(&mut self, outline: &[[f64; 2]], axis: usize, from: f64, to: f64) {
        for (k, a) in outline.iter().enumerate() {
            let b = &outline[(k + 1) % outline.len()];
            let mut side = [
                point_across(*a, axis, from),
                point_across(*b, axis, from),
                point_across(*b, axis, to),
                point_across(*a, axis, to),
            ];
            if axis == 1 {
                side.reverse();
            }
            self.face(&side);
        }
    }
}

/// Returns a point of a plane normal to an axis.
fn point_across([p, q]: [f64; 2], axis: usize, level: f64) -> Point {
    match axis {
        0 => [level, p, q],
        1 => [p, level, q],
        _ => [p, q, level],
    }
}

/// Returns two unit vectors normal to a unit vector, which form a right-handed frame with it.
pub(super) fn across(axis: Point) -> (Point, Point) {
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs()));
    let mut unit = [0.0; 3];
    unit[least.unwrap_or(0)] = 1.0;
    let u = cross(unit, axis);
    let u = times(u, 1.0 / norm(u));
    (u, cross(axis, u))
}

/// Returns the number of edges of a regular polygon inside a circle with a maximum distance of `tolerance` from it.
pub(super) fn segments(radius: f64, tolerance: f64) -> usize {
    const MAX_EDGES: f64 = 2048.0;
    let half = (1.0 - tolerance / radius).clamp(-1.0, 1.0).acos();
    // A multiple of 8, so that corners lie on the axes.
    let count = (std::f64::consts::PI / half).clamp(32.0, MAX_EDGES);
    8 * whole((count / 8.0).ceil())
}

/// Returns the distance of the edges of this polygon from the circle.
pub(super) fn sagitta(radius: f64, tolerance: f64) -> f64 {
    let half = std::f64::consts::PI / real(segments(radius, tolerance));
    2.0 * radius * (0.5 * half).sin().powi(2)
}

/// Returns the corners of a regular polygon around the origin, counter-clockwise.
pub(super) fn circle(radius: f64, tolerance: f64) -> impl Iterator<Item = [f64; 2]> {
    let n = segments(radius, tolerance);
    (0..n).map(move |k| {
        let (s, c) = (std::f64::consts::TAU * real(k) / real(n)).sin_cos();
        [radius * c, radius * s]
    })
}

/// Returns twice the area of a polygon, positive if it runs counter-clockwise.
pub(super) fn double_area(points: &[[f64; 2]]) -> f64 {
    let o = points[0];
    let pairs = points.iter().zip(points.iter().cycle().skip(1));
    pairs.map(|(a, b)| turn(o, *a, *b)).sum()
}

/// Returns twice the area of a triangle, positive if it runs counter-clockwise.
pub(super) fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Divides a simple counter-clockwise polygon into convex pieces: itself, or triangles.
fn pieces(outline: &[[f64; 2]]) -> Vec<Vec<usize>> {
    let n = outline.len();
    let convex = (0..n).all(|k| {
        let [a, b, c] = [k, k + 1, k + 2].map(|k| outline[k % n]);
        turn(a, b, c) >= 0.0
    });
    if convex && n > 2 {
        return vec![(0..n).collect()];
    }
    triangles(outline).iter().map(|t| t.to_vec()).collect()
}

/// Divides a simple counter-clockwise polygon into triangles by cutting off ears one after another (G. H. Meisters,
/// Amer. Math. Monthly 82 (1975) 648).
fn triangles(outline: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..outline.len()).collect();
    let mut found = Vec::new();
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&k| {
            let corners = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
            let [a, b, c] = corners.map(|k| outline[k]);
            turn(a, b, c) > 0.0
                && left.iter().all(|p| {
                    let at = outline[*p];
                    corners.contains(p)
                        || turn(a, b, at) < 0.0
                        || turn(b, c, at) < 0.0
                        || turn(c, a, at) < 0.0
                })
        });
        // A corner on a straight edge is not an ear and needs no triangle.
        let ear = ear.or_else(|| {
            (0..n).find(|&k| {
                let corners = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
                let [a, b, c] = corners.map(|k| outline[k]);
                turn(a, b, c).abs() <= 1e-14 * double_area(outline).abs()
            })
        });
        let Some(k) = ear else {
            break;
        };
        let corners = [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
        let [a, b, c] = corners.map(|k| outline[k]);
        if turn(a, b, c) > 0.0 {
            found.push(corners);
        }
        left.remove(k);
    }
    if let [a, b, c] = left[..] {
        found.push([a, b, c]);
    }
    found
}
