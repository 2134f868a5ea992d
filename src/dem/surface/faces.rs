//! Plane faces of a surface, and their action on a block.
//!
//! Facets of one plane that share edges are one face. Where two faces meet at a convex edge, a block that rests on one
//! of them touches the other one only with the rim of its thin overlap:
//!
//! - A face whose back is visible from the centroid of the block lies behind the face on which the block rests.
//!   Both hide the same points of the block, and only the front one acts.
//! - A face whose front is visible acts with its springs, whose force is of the order of the square of the overlap.
//!   The square root of a small stiffness is not small, so that its dashpot acts only in proportion to the ratio of
//!   both overlaps.

use super::{FacetSurface, ON_FACET, ON_RIM, index};
use nalgebra::{Matrix3, Vector3};

/// Index that marks an edge without an adjacent facet.
const NONE: u32 = u32::MAX;
/// Sine of the angle between a normal and the directions found so far, above which the normal is another direction.
const DIRECTION: f64 = 1e-4;
/// Ratio of the overlap behind a face to that behind a neighbouring face, up to which the dashpot acts in full.
const RATIO: f64 = 10.0;

/// Plane faces of a surface.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    /// First facet of the face of each facet.
    first: Vec<u32>,
    /// First given facet of the face to which each facet belongs, also for periodic images of the face.
    name: Vec<u32>,
    /// Facet on the other side of each edge, in the order of the corners of all facets.
    opposite: Vec<u32>,
}

impl Faces {
    /// Returns the first facet of the face of a facet.
    pub(crate) fn first(&self, facet: u32) -> u32 {
        self.first[facet as usize]
    }

    /// Returns the name of the face of a facet, which is equal on both sides of a periodic face.
    pub(crate) fn name(&self, facet: u32) -> u32 {
        self.name[facet as usize]
    }
}

impl FacetSurface {
    /// Computes the plane faces.
    pub(crate) fn faces(&self) -> Faces {
        fn first_of(of: &[u32], mut k: u32) -> u32 {
            while of[k as usize] != k {
                k = of[k as usize];
            }
            k
        }
        fn join(of: &mut [u32], [a, b]: [u32; 2]) {
            let [a, b] = [first_of(of, a), first_of(of, b)];
            of[a.max(b) as usize] = a.min(b);
        }
        let count = index(self.len());
        let mut edges: Vec<([u32; 2], u32)> = Vec::new();
        for facet in 0..count {
            let numbers = self.numbers(facet as usize);
            for (k, &a) in numbers.iter().enumerate() {
                let b = numbers[(k + 1) % numbers.len()];
                edges.push(([a.min(b), a.max(b)], facet));
            }
        }
        edges.sort_unstable();
        let mut of: Vec<u32> = (0..count).collect();
        let mut with_images = of.clone();
        let mut opposite = vec![NONE; self.corners.len()];
        // Where images end in one plane, four facets share an edge.
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            for (n, &(_, a)) in group.iter().enumerate() {
                for &(_, b) in &group[n + 1..] {
                    if self.in_one_plane(a as usize, b as usize) {
                        join(&mut of, [a, b]);
                        join(&mut with_images, [a, b].map(|facet| self.given(facet)));
                    }
                }
            }
            if let [(edge, a), (_, b)] = *group {
                self.link(edge, [a, b], &mut opposite);
            }
        }
        Faces {
            first: (0..count).map(|k| first_of(&of, k)).collect(),
            name: (0..count)
                .map(|k| first_of(&with_images, self.given(k)))
                .collect(),
            opposite,
        }
    }

    /// Records two facets on both sides of an edge as neighbours if they run along it in opposite directions, so
    /// that their fronts are on the same side.
    fn link(&self, edge: [u32; 2], facets: [u32; 2], opposite: &mut [u32]) {
        let places = facets.map(|facet| {
            let numbers = self.numbers(facet as usize);
            let next = |k: usize| numbers[(k + 1) % numbers.len()];
            let runs = |k: &usize| [numbers[*k].min(next(*k)), numbers[*k].max(next(*k))] == edge;
            let place = (0..numbers.len()).find(runs)?;
            let first = self.facets[facet as usize].first as usize;
            Some((first + place, numbers[place]))
        });
        if let [Some((one, from)), Some((other, towards))] = places
            && from != towards
        {
            opposite[one] = facets[1];
            opposite[other] = facets[0];
        }
    }

    fn in_one_plane(&self, a: usize, b: usize) -> bool {
        let (one, two) = (self.facets[a], self.facets[b]);
        one.normal.cross(&two.normal).norm() <= ON_RIM
            && self
                .corners(a)
                .zip(self.corners(b))
                .all(|(p, q)| one.normal.dot(&(q - p)).abs() <= ON_RIM * one.size.max(two.size))
    }

    /// Returns the height \[m\] of a point above the plane of a facet, on the side of its normal.
    fn height(&self, facet: usize, point: &Vector3<f64>) -> f64 {
        let corner = self.vertices[self.numbers(facet)[0] as usize];
        self.facets[facet].normal.dot(&(point - corner))
    }

    /// Returns the facets across the convex edges of a facet whose fronts are visible from a point.
    fn in_front<'a>(
        &'a self,
        faces: &'a Faces,
        facet: usize,
        point: &'a Vector3<f64>,
    ) -> impl Iterator<Item = usize> + 'a {
        let place = self.facets[facet];
        let around = faces.opposite[place.first as usize..place.end as usize].iter();
        let around = around.filter(|other| **other != NONE);
        around.map(|other| *other as usize).filter(move |&other| {
            let side = if self.height(other, point) < 0.0 {
                -1.0
            } else {
                1.0
            };
            let heights = self.corners(facet).map(|at| side * self.height(other, &at));
            heights.fold(0.0, f64::min) < -ON_FACET * place.size
        })
    }

    /// Removes from `order`, pairs of a face and a facet in ascending order of faces, the faces that a block at
    /// `centre` sees only from behind, past another face in front of them.
    pub(crate) fn leave_seen(
        &self,
        faces: &Faces,
        centre: &Vector3<f64>,
        order: &mut Vec<[u32; 2]>,
    ) {
        let above = |facet: usize| self.height(facet, centre) >= 0.0;
        let sides = order.iter().map(|[_, facet]| above(*facet as usize));
        let fronts = sides.filter(|above| *above).count();
        if fronts == 0 || fronts == order.len() {
            return;
        }
        let distances = order
            .iter()
            .map(|[_, facet]| (self.distance(*facet as usize, centre), *facet));
        let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let Some((_, nearest)) = nearest else {
            return;
        };
        let side = above(nearest as usize);
        let hidden = |facet: usize| {
            let mut in_front = self.in_front(faces, facet, centre);
            above(facet) != side && in_front.any(|other| above(other) == side)
        };
        let (mut kept, mut from) = (0, 0);
        while from < order.len() {
            let face = order[from][0];
            let face_facets = order[from..].iter().take_while(|pair| pair[0] == face);
            let to = from + face_facets.clone().count();
            let is_hidden = face_facets.map(|pair| pair[1] as usize).any(hidden);
            if !is_hidden {
                order.copy_within(from..to, kept);
                kept += to - from;
            }
            from = to;
        }
        order.truncate(kept);
    }

    /// Returns the fraction of the dashpot with which a face acts on a block at `centre`; `deepest` returns the
    /// distance \[m\] from the centre to the farthest point of the block along a direction.
    pub(crate) fn damped(
        &self,
        faces: &Faces,
        face: &[[u32; 2]],
        centre: &Vector3<f64>,
        deepest: impl Fn(&Vector3<f64>) -> f64,
    ) -> f64 {
        let behind = |facet: usize| {
            let height = self.height(facet, centre);
            let side = if height < 0.0 { -1.0 } else { 1.0 };
            deepest(&(self.facets[facet].normal * -side)) - height.abs()
        };
        let mut part = 1.0_f64;
        for facet in face.iter().map(|pair| pair[1] as usize) {
            let above = self.height(facet, centre) >= 0.0;
            for other in self.in_front(faces, facet, centre) {
                if (self.height(other, centre) >= 0.0) != above {
                    continue;
                }
                let (own, front) = (behind(facet), behind(other));
                if front > 0.0 && own > RATIO * front {
                    part = part.min(RATIO * front / own);
                }
            }
        }
        part
    }

    /// Returns the projection of velocities onto the directions normal to the facets; none if these span all
    /// directions.
    pub(super) fn directions_across(&self) -> Option<Matrix3<f64>> {
        let mut basis: Vec<Vector3<f64>> = Vec::new();
        for facet in &self.facets {
            let known = basis.iter().map(|axis| axis * axis.dot(&facet.normal));
            let own = facet.normal - known.sum::<Vector3<f64>>();
            if own.norm() > DIRECTION {
                basis.push(own.normalize());
            }
            if basis.len() == 3 {
                return None;
            }
        }
        Some(basis.iter().map(|axis| axis * axis.transpose()).sum())
    }

    /// Returns the part of a velocity that moves the surface: the remainder is tangential to all its facets, as for
    /// a belt.
    #[must_use]
    pub fn moving(&self, velocity: &Vector3<f64>) -> Vector3<f64> {
        self.across
            .map_or(*velocity, |projection| projection * velocity)
    }
}
