//! Vertices and faces of a set of half-spaces, by cutting a cube with one plane after another.
//!
//! Each cut classifies the vertices as inside, on or outside the plane, with a tolerance, and derives everything else
//! from this classification: the topology of the faces is therefore consistent in spite of rounding. The corners of
//! the cap are sorted by angle, because the cap is convex. Where the cube is much larger than the remaining solid,
//! the cuts are repeated from a smaller cube: corners then do not lie on edges far longer than the solid.

use nalgebra::Vector3;

use super::HalfSpace;

/// Maximum distance of a corner from a cut, in sizes of the cube, at which it lies on the cut.
const ON_CUT: f64 = 1e-10;

/// Convex solid bounded by planes.
#[derive(Clone, Debug, Default)]
pub(super) struct Cut {
    /// Corners \[m\].
    pub(super) vertices: Vec<Vector3<f64>>,
    /// Index of the half-space, and the corners of the face counter-clockwise seen from outside.
    pub(super) faces: Vec<(usize, Vec<u32>)>,
}

/// Corners of the faces of a cube, anticlockwise from outside; bit `a` of a corner is set at the upper end of axis `a`.
pub(crate) const CUBE_FACES: [[u32; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

impl Cut {
    /// Returns a cube of half-width `half` \[m\] around the origin; its faces belong to no half-space.
    fn cube(half: f64) -> Self {
        let vertices = (0..8_u32)
            .map(|k| Vector3::from_fn(|axis, _| if k >> axis & 1 == 0 { -half } else { half }))
            .collect();
        Self {
            vertices,
            faces: CUBE_FACES
                .iter()
                .map(|corners| (usize::MAX, corners.to_vec()))
                .collect(),
        }
    }

    /// Cuts with the half-space of number `name`; returns `true` if any part remains inside.
    pub(super) fn by(&mut self, plane: &HalfSpace, name: usize, tolerance: f64) -> bool {
        let heights: Vec<f64> = self.vertices.iter().map(|v| plane.height(v)).collect();
        let side = |v: u32| {
            let height = heights[v as usize];
            if height > tolerance {
                1
            } else if height < -tolerance {
                -1
            } else {
                0
            }
        };
        let corners = || self.faces.iter().flat_map(|(_, corners)| corners);
        if corners().all(|&v| side(v) <= 0) {
            return true;
        }
        if corners().all(|&v| side(v) >= 0) {
            return false;
        }
        let mut on: Vec<u32> = corners().copied().filter(|&v| side(v) == 0).collect();
        on.sort_unstable();
        on.dedup();
        // New corners, each found from both faces of its edge.
        let mut crossings: Vec<([u32; 2], u32)> = Vec::new();
        let mut faces = Vec::with_capacity(self.faces.len() + 1);
        for (plane_name, corners) in std::mem::take(&mut self.faces) {
            let mut kept = Vec::with_capacity(corners.len() + 1);
            for (k, &a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if side(a) <= 0 {
                    kept.push(a);
                }
                if side(a) * side(b) < 0 {
                    let edge = [a.min(b), a.max(b)];
                    let known = crossings.iter().find(|(e, _)| *e == edge).map(|(_, v)| *v);
                    kept.push(known.unwrap_or_else(|| {
                        let [from, to] = edge.map(|v| v as usize);
                        let part = heights[from] / (heights[from] - heights[to]);
                        let new = number(self.vertices.len());
                        let (p, q) = (self.vertices[from], self.vertices[to]);
                        self.vertices.push(p + (q - p) * part);
                        crossings.push((edge, new));
                        on.push(new);
                        new
                    }));
                }
            }
            // A face of which only an edge or a corner touches the cut is dropped.
            let inside = |&v: &u32| (v as usize) < heights.len() && side(v) < 0;
            if kept.len() >= 3 && kept.iter().any(inside) {
                faces.push((plane_name, kept));
            }
        }
        self.faces = faces;
        if on.len() >= 3 {
            let cap = self.counter_clockwise(&on, &plane.normal);
            self.faces.push((name, cap));
        }
        true
    }

    /// Returns the corners of a convex polygon in counter-clockwise order about `normal`.
    fn counter_clockwise(&self, corners: &[u32], normal: &Vector3<f64>) -> Vec<u32> {
        let at = |v: u32| self.vertices[v as usize];
        let middle =
            corners.iter().map(|&v| at(v)).sum::<Vector3<f64>>() / count_f64(corners.len());
        let (s, t) = across(normal);
        let mut order: Vec<(f64, u32)> = corners
            .iter()
            .map(|&v| {
                let arm = at(v) - middle;
                (arm.dot(&t).atan2(arm.dot(&s)), v)
            })
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, v)| v).collect()
    }

    /// Returns the largest coordinate of a corner of a face \[m\].
    fn extent(&self) -> f64 {
        self.faces
            .iter()
            .flat_map(|(_, corners)| corners)
            .map(|&v| self.vertices[v as usize].amax())
            .fold(0.0, f64::max)
    }

    /// Returns the solid bounded by all `planes`, which contains the origin and extends at most `reach` \[m\] along
    /// the axes; none if nothing remains, or if it is not closed.
    pub(super) fn from_planes(planes: &[HalfSpace], reach: f64) -> Option<Self> {
        let mut half = reach;
        for _ in 0..6 {
            let mut cut = Self::cube(half);
            for (name, plane) in planes.iter().enumerate() {
                if !cut.by(plane, name, ON_CUT * half) {
                    return None;
                }
            }
            let extent = cut.extent();
            if half <= 8.0 * extent {
                let closed = cut.faces.iter().all(|(name, _)| *name != usize::MAX);
                return closed.then(|| cut.without_unused_corners());
            }
            half = 2.0 * extent;
        }
        None
    }

    /// Returns the solid without corners that belong to no face.
    pub(super) fn without_unused_corners(mut self) -> Self {
        let mut new = vec![u32::MAX; self.vertices.len()];
        let mut vertices = Vec::new();
        for (_, corners) in &mut self.faces {
            for v in corners {
                let entry = &mut new[*v as usize];
                if *entry == u32::MAX {
                    *entry = number(vertices.len());
                    vertices.push(self.vertices[*v as usize]);
                }
                *v = *entry;
            }
        }
        self.vertices = vertices;
        self
    }
}

/// Returns two unit vectors normal to a unit vector, right-handed with it.
#[inline]
pub(super) fn across(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    // From J. R. Duff et al., JCGT 6 (2017) 1: no branch except the sign.
    let sign = 1_f64.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        Vector3::new(
            1.0 + sign * normal.x * normal.x * a,
            sign * b,
            -sign * normal.x,
        ),
        Vector3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}

/// Returns an index as the number type of faces.
pub(super) fn number(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

/// Converts a count to a real number.
#[expect(clippy::cast_precision_loss, reason = "counts of corners and faces")]
pub(super) fn count_f64(k: usize) -> f64 {
    k as f64
}
