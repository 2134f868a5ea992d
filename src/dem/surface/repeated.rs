//! Surfaces in periodic domains.
//!
//! A surface is repeated with the domain. Its images are created once, up to half a period beyond the domain, so
//! that a sphere in the domain finds every facet that it can touch. Vertices that coincide with an image of another
//! vertex are one vertex: an edge at the seam is an interior edge, and a surface that joins its own image has no
//! rim there. Two facets that meet an image of each other back to back, as the ends of a box of one period, lie
//! inside the solid and are left out.
//!
//! The wrapped position of a sphere depends on its raw position alone. A contact is identified by its *name*: the
//! number of the given facet, and the offset in periods of its image from the position of the sphere before it is
//! brought into the domain. The name remains when the sphere passes a periodic face, and is the same on all ranks.

use super::super::ghosts::index;
use super::super::region::wraps;
use super::{FacetSurface, Nearest};
use base::error::Error;
use base::number::{floor_i32, floor_i64, real};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Vertex position: its index in the domain, and its offset from there in periods.
type Place = (u32, [i32; 3]);

/// Periodic images of a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Repeated {
    lower: [f64; 3],
    /// Periods \[m\], 0 along axes that are not periodic.
    lengths: [f64; 3],
    /// Number of given facets, which come first.
    pub(super) given: u32,
    /// Given facet of which each facet is an image, and the offset of the image in periods.
    images: Vec<(u32, [i32; 3])>,
    /// Index of each vertex, equal for a vertex and its images.
    vertices: Vec<u32>,
    /// The images of given facet k are `of_given[starts[k]..starts[k + 1]]`.
    starts: Vec<u32>,
    of_given: Vec<u32>,
}

impl Repeated {
    pub(super) fn given_vertex(&self, vertex: u32) -> u32 {
        self.vertices[vertex as usize]
    }
}

/// Maximum distance of coinciding vertices, as a fraction of the shortest period: above the rounding of
/// single-precision files.
const COINCIDENCE: f64 = 1e-6;
/// Maximum number of facets with all images.
const MAX_FACETS: f64 = 2e7;

impl FacetSurface {
    /// Returns the surface with its images in a domain that is periodic along the axes with `lengths` \[m\] above
    /// 0, with the lower corner `lower` \[m\].
    ///
    /// # Errors
    /// If there would be too many images.
    pub fn repeated(self, lower: [f64; 3], lengths: [f64; 3]) -> Result<Self, Error> {
        let shortest = lengths.iter().copied().filter(|&length| length > 0.0);
        let shortest = shortest.fold(f64::INFINITY, f64::min);
        if shortest.is_infinite() {
            return Ok(self);
        }
        let near = COINCIDENCE * shortest;
        let (places, reduced) = reduce(&self.vertices, (lower, lengths), near);
        let place = |(root, by): Place| {
            let at: Vector3<f64> = reduced[root as usize];
            Vector3::from_fn(|a, _| at[a] + f64::from(by[a]) * lengths[a])
        };
        let mut kept: Vec<usize> = (0..self.len()).collect();
        let inner = self.inner(&places);
        kept.retain(|&facet| !inner[facet]);
        let given = kept.len();
        let mut images = Vec::new();
        for (number, &facet) in kept.iter().enumerate() {
            let mut spans = [[0, 0]; 3];
            for (a, span) in spans.iter_mut().enumerate() {
                let length = lengths[a];
                if length <= 0.0 {
                    continue;
                }
                let corners = self.corners(facet).map(|at| at[a]);
                let (low, high) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                    (l.min(x), h.max(x))
                });
                let beyond = [lower[a] - 0.5 * length, lower[a] + 1.5 * length];
                let (first, last) = ((beyond[0] - high) / length, (beyond[1] - low) / length);
                if last - first > MAX_FACETS {
                    return Err(too_many());
                }
                *span = [-floor_i32(-first), floor_i32(last)];
            }
            let count: f64 = spans
                .iter()
                .map(|[first, last]| f64::from(*last) - f64::from(*first) + 1.0)
                .product();
            if real(images.len()) + count > MAX_FACETS {
                return Err(too_many());
            }
            for x in spans[0][0]..=spans[0][1] {
                for y in spans[1][0]..=spans[1][1] {
                    for z in spans[2][0]..=spans[2][1] {
                        if [x, y, z] != [0; 3] {
                            images.push(([x, y, z], index(number)));
                        }
                    }
                }
            }
        }
        // The order of any two images does not depend on the other images.
        images.sort_unstable();
        let own = (0..given).map(|facet| ([0; 3], index(facet)));
        let all: Vec<([i32; 3], u32)> = own.chain(images).collect();

        let mut known: HashMap<Place, u32> = HashMap::new();
        let (mut vertices, mut roots) = (Vec::new(), Vec::new());
        let mut facets = Vec::with_capacity(all.len());
        for (by, facet) in &all {
            let corners = self.numbers(kept[*facet as usize]).iter();
            let corners = corners.map(|&corner| {
                let (root, stands) = places[corner as usize];
                let at = (root, std::array::from_fn(|a| stands[a] + by[a]));
                *known.entry(at).or_insert_with(|| {
                    vertices.push(place(at));
                    roots.push(root);
                    index(vertices.len() - 1)
                })
            });
            facets.push(corners.collect());
        }
        let mut surface = Self::new(vertices, &facets)?;
        let mut of_given: Vec<(u32, u32)> = (0..)
            .zip(&all)
            .map(|(number, (_, facet))| (*facet, number))
            .collect();
        of_given.sort_unstable();
        let starts = (0..=index(given))
            .map(|k| index(of_given.partition_point(|(facet, _)| *facet < k)))
            .collect();
        surface.repeated = Some(Box::new(Repeated {
            lower,
            lengths,
            given: index(given),
            images: all.iter().map(|(by, facet)| (*facet, *by)).collect(),
            vertices: roots,
            starts,
            of_given: of_given.iter().map(|(_, number)| *number).collect(),
        }));
        Ok(surface)
    }

    /// Returns `true` for each facet that coincides back to back with an image of another facet.
    fn inner(&self, places: &[Place]) -> Vec<bool> {
        let mut known: HashMap<Vec<Place>, Vec<(usize, [i32; 3])>> = HashMap::new();
        let mut inner = vec![false; self.len()];
        for facet in 0..self.len() {
            let numbers = self.numbers(facet);
            let mut corners: Vec<_> = numbers.iter().map(|&v| places[v as usize]).collect();
            corners.sort_unstable();
            // Images have the same corners relative to their first corner.
            let (_, first) = corners[0];
            for (_, stands) in &mut corners {
                *stands = std::array::from_fn(|a| stands[a] - first[a]);
            }
            let others = known.entry(corners).or_default();
            let back = others.iter().find(|(other, stands)| {
                *stands != first && self.normal(*other).dot(&self.normal(facet)) < 0.0
            });
            if let Some(&(other, _)) = back {
                inner[facet] = true;
                inner[other] = true;
            }
            others.push((facet, first));
        }
        inner
    }

    /// Returns `true` if the surface is repeated with these periods \[m\], 0 along axes without.
    pub(crate) fn repeats_by(&self, lower: [f64; 3], lengths: [f64; 3]) -> bool {
        let none = lengths.iter().all(|&length| length <= 0.0);
        self.repeated.as_ref().map_or(none, |repeated| {
            same(repeated.lower, lower) && same(repeated.lengths, lengths)
        })
    }

    /// Returns the largest radius \[m\] of a body about its centre for which all facets are found: half a period.
    #[must_use]
    pub fn longest_reach(&self) -> f64 {
        self.repeated.as_ref().map_or(f64::INFINITY, |repeated| {
            let lengths = repeated.lengths.iter().filter(|&&length| length > 0.0);
            lengths.fold(f64::INFINITY, |reach, length| reach.min(0.5 * length))
        })
    }

    /// Returns the given facet of which a facet is an image.
    pub(super) fn given(&self, facet: u32) -> u32 {
        self.repeated
            .as_ref()
            .map_or(facet, |repeated| repeated.images[facet as usize].0)
    }

    /// Returns the given facet with a name.
    pub(super) fn named(&self, name: u32) -> u32 {
        self.repeated
            .as_ref()
            .map_or(name, |repeated| name % repeated.given)
    }

    /// Returns a point \[m\] wrapped into the domain, and the number of periods by which it was moved.
    #[inline]
    pub(crate) fn in_domain(&self, point: &Vector3<f64>) -> (Vector3<f64>, [i32; 3]) {
        let (mut at, mut by) = (*point, [0; 3]);
        if let Some(repeated) = &self.repeated {
            for a in 0..3 {
                let length = repeated.lengths[a];
                if length > 0.0 {
                    by[a] = wraps(at[a], repeated.lower[a], length);
                    at[a] += f64::from(by[a]) * length;
                }
            }
        }
        (at, by)
    }

    /// Sets the names of the facets of contacts found with a centre that was moved by these periods.
    #[inline]
    pub(crate) fn name(&self, found: &mut [Nearest], by: [i32; 3]) {
        let Some(repeated) = &self.repeated else {
            return;
        };
        for one in found {
            let (given, stands) = repeated.images[one.facet as usize];
            let place = (0..3).fold(0, |place, a| {
                3 * place + (stands[a] - by[a]).rem_euclid(3).unsigned_abs()
            });
            one.facet = given + place * repeated.given;
        }
    }

    /// Calls `visit` with all images of a facet if a point of the domain is nearer than `gap` \[m\] to a periodic face:
    /// the point may cross the face and is then near other images.
    pub(crate) fn images_beyond(
        &self,
        facet: u32,
        point: &Vector3<f64>,
        gap: f64,
        visit: impl FnMut(u32),
    ) {
        let Some(repeated) = &self.repeated else {
            return;
        };
        let passes = (0..3).any(|a| {
            let (length, height) = (repeated.lengths[a], point[a] - repeated.lower[a]);
            length > 0.0 && height.min(length - height) <= gap * (1.0 + 1e-6)
        });
        if passes {
            let given = repeated.images[facet as usize].0 as usize;
            let [start, end] = [given, given + 1].map(|k| repeated.starts[k] as usize);
            repeated.of_given[start..end]
                .iter()
                .copied()
                .for_each(visit);
        }
    }
}

fn same(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 0.0)
}

fn too_many() -> Error {
    Error::Numerical(format!(
        "the surface and its periodic images have more than {MAX_FACETS} facets"
    ))
}

/// Returns for each vertex its index in the domain and its offset from there in periods; then the positions of
/// these indices. Vertices of the same image are never merged.
fn reduce(
    vertices: &[Vector3<f64>],
    (lower, lengths): ([f64; 3], [f64; 3]),
    near: f64,
) -> (Vec<Place>, Vec<Vector3<f64>>) {
    let mut reduced: Vec<Vector3<f64>> = Vec::new();
    let mut stand: Vec<[i32; 3]> = Vec::new();
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut places = Vec::with_capacity(vertices.len());
    for vertex in vertices {
        let by: [i32; 3] = std::array::from_fn(|a| {
            if lengths[a] > 0.0 {
                -wraps(vertex[a] + near, lower[a], lengths[a])
            } else {
                0
            }
        });
        let at = Vector3::from_fn(|a, _| vertex[a] - f64::from(by[a]) * lengths[a]);
        let cell: [i64; 3] = std::array::from_fn(|a| floor_i64((at[a] - lower[a]) / (2.0 * near)));
        let beside = |k: i64| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
        let same = (0..27).find_map(|k| {
            let cell = std::array::from_fn(|a| cell[a].saturating_add(beside(k)[a]));
            let members = cells.get(&cell)?;
            members.iter().copied().find(|&root| {
                (reduced[root as usize] - at).norm() <= near && stand[root as usize] != by
            })
        });
        let root = same.unwrap_or_else(|| {
            let root = index(reduced.len());
            reduced.push(at);
            stand.push(by);
            cells.entry(cell).or_default().push(root);
            root
        });
        places.push((root, by));
    }
    (places, reduced)
}
