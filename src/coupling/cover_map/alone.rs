//! Bodies that are separate from all others and from the walls.
//!
//! Full cells of two bodies are neighbours only if the bodies nearly touch, because both reach the corner that the
//! cells share. A body whose bounding sphere has a minimum distance from all others and from the walls therefore
//! has no such cells, and the lattice need not check their neighbours ([`lbm::saturation::CoveringBody::alone`]). A
//! result is valid until a body has moved by half of the margin used in the search.

use super::super::body_map::MapGrid;
use super::super::solid_fraction::FractionMethod;
use base::number::real;
use lbm::lanes::{Level, Work};
use std::cmp::Ordering;

/// Margin of the search, in cells.
const SEARCH_MARGIN: f64 = 0.25;

/// Bounding sphere of a body or of its image, in cells from the corner of the domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sphere {
    pub(super) centre: [f64; 3],
    pub(super) radius: f64,
}

/// Results of the last search.
#[derive(Debug, Default)]
pub(super) struct Alone {
    found_for: Vec<Sphere>,
    alone: Vec<bool>,
    /// Indices of the spheres sorted along an axis.
    order: Vec<u32>,
    sorted: Sorted,
}

/// Spheres in the order of [`Alone::order`], with an array per coordinate, so that several neighbours are tested by
/// one instruction.
#[derive(Debug, Default)]
struct Sorted {
    centre: [Vec<f64>; 3],
    radius: Vec<f64>,
    /// Start of each sphere along the axis.
    low: Vec<f64>,
    /// 1 if the sphere is near another, otherwise 0.
    near: Vec<u64>,
}

/// Operation that marks each sphere that is near another.
struct Pairs<'a> {
    sorted: &'a mut Sorted,
    axis: usize,
    reach: f64,
}

impl Work for Pairs<'_> {
    #[inline(always)]
    fn run(self) {
        let Self {
            sorted,
            axis,
            reach,
        } = self;
        let Sorted {
            centre: [x, y, z],
            radius,
            low,
            near,
        } = sorted;
        let along = [&*x, &*y, &*z][axis];
        for k in 0..radius.len() {
            let end = along[k] + radius[k] + reach;
            let beyond = k
                + 1
                + low[k + 1..]
                    .partition_point(|low| low.partial_cmp(&end) != Some(Ordering::Greater));
            let (own, size) = ([x[k], y[k], z[k]], radius[k] + reach);
            let mut found = 0;
            let count = beyond - (k + 1);
            let (x, y, z) = (&x[k + 1..beyond], &y[k + 1..beyond], &z[k + 1..beyond]);
            let radius = &radius[k + 1..beyond];
            let others = &mut near[k + 1..beyond];
            for n in 0..count {
                let (dx, dy, dz) = (own[0] - x[n], own[1] - y[n], own[2] - z[n]);
                let apart = size + radius[n];
                // Written so that NaN counts as near.
                let meets = u64::from(dx * dx + dy * dy + dz * dz > apart * apart) ^ 1;
                others[n] |= meets;
                found |= meets;
            }
            near[k] |= found;
        }
    }
}

impl Alone {
    /// Returns `true` if a sphere of the last update is separate from all others.
    #[must_use]
    pub(super) fn is_separate(&self, k: usize) -> bool {
        self.alone[k]
    }

    /// Checks the spheres again if one of them moved far enough.
    pub(super) fn update(
        &mut self,
        spheres: impl ExactSizeIterator<Item = Sphere> + Clone,
        grid: &MapGrid,
        method: FractionMethod,
        dimension: usize,
    ) {
        let stays = |(old, new): (&Sphere, Sphere)| {
            let moved: f64 = (0..3)
                .map(|a| (old.centre[a] - new.centre[a]).powi(2))
                .sum();
            // A NaN counts as moved.
            moved <= (0.5 * SEARCH_MARGIN).powi(2) && old.radius.total_cmp(&new.radius).is_eq()
        };
        if self.found_for.len() == spheres.len()
            && self.found_for.iter().zip(spheres.clone()).all(stays)
        {
            return;
        }
        self.found_for.clear();
        self.found_for.extend(spheres);
        // A cell counts as full if at most 1e-6 of it is missing. The fractions by samples and by the linear rule
        // have errors of parts of a cell at each of two bodies.
        let reach = match method {
            FractionMethod::Exact => 0.25,
            FractionMethod::Samples(_) | FractionMethod::Linear => 2.0,
        } + SEARCH_MARGIN;
        self.search(grid, reach, dimension);
    }

    fn search(&mut self, grid: &MapGrid, reach: f64, dimension: usize) {
        let spheres = &self.found_for;
        let apart_from_walls = |sphere: &Sphere| {
            (0..dimension).all(|a| {
                grid.periodic[a]
                    || (sphere.centre[a] - sphere.radius > reach
                        && sphere.centre[a] + sphere.radius < real(grid.cells[a]) - reach)
            })
        };
        self.alone.clear();
        self.alone.extend(spheres.iter().map(apart_from_walls));
        let extent = |a: usize| {
            let along = spheres.iter().map(|sphere| sphere.centre[a]);
            let (low, high) = along.fold((f64::MAX, f64::MIN), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            high - low
        };
        let axis = (0..dimension)
            .max_by(|&a, &b| extent(a).total_cmp(&extent(b)))
            .unwrap_or(0);
        let low = |k: &u32| {
            let sphere = &spheres[*k as usize];
            sphere.centre[axis] - sphere.radius
        };
        if self.order.len() != spheres.len() {
            self.order.clear();
            self.order.extend((0..).take(spheres.len()));
        }
        // Nearly sorted, except the first time.
        self.order.sort_by(|a, b| low(a).total_cmp(&low(b)));
        let Sorted {
            centre,
            radius,
            low,
            near,
        } = &mut self.sorted;
        for (a, centre) in centre.iter_mut().enumerate() {
            centre.clear();
            // Bodies beyond the plane have no effect.
            centre.extend(self.order.iter().map(|&k| {
                if a < dimension {
                    spheres[k as usize].centre[a]
                } else {
                    0.0
                }
            }));
        }
        radius.clear();
        radius.extend(self.order.iter().map(|&k| spheres[k as usize].radius));
        low.clear();
        low.extend(radius.iter().zip(&centre[axis]).map(|(r, x)| x - r));
        near.clear();
        near.resize(radius.len(), 0);
        Level::best().run(Pairs {
            sorted: &mut self.sorted,
            axis,
            reach,
        });
        for (&k, near) in self.order.iter().zip(&self.sorted.near) {
            self.alone[k as usize] &= *near == 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::random::SplitMix;

    fn grid(periodic: bool) -> MapGrid {
        MapGrid {
            cells: [60, 50, 40],
            start: [0; 3],
            periodic: [periodic; 3],
            mirrored: [[false; 2]; 3],
            origin: [0.0; 3],
            spacing: 1.0,
        }
    }

    fn found(spheres: &[Sphere], periodic: bool) -> Vec<bool> {
        let mut alone = Alone::default();
        alone.update(
            spheres.iter().copied(),
            &grid(periodic),
            FractionMethod::Exact,
            3,
        );
        (0..spheres.len()).map(|k| alone.is_separate(k)).collect()
    }

    fn sphere(x: f64, radius: f64) -> Sphere {
        Sphere {
            centre: [x, 25.0, 20.0],
            radius,
        }
    }

    #[test]
    fn neighbours_and_walls_are_found() {
        let spheres = [
            sphere(10.0, 4.0),
            sphere(19.0, 4.0),
            sphere(32.0, 4.0),
            sphere(54.5, 5.0),
        ];
        assert_eq!(found(&spheres, true), [true, true, true, true]);
        assert_eq!(found(&spheres, false), [true, true, true, false]);
        let close = [sphere(10.0, 4.0), sphere(18.4, 4.0), sphere(32.0, 4.0)];
        assert_eq!(found(&close, true), [false, false, true]);
    }

    #[test]
    fn all_pairs_of_random_spheres_are_found() {
        let mut draws = SplitMix::new(5);
        let spheres: Vec<Sphere> = (0..200)
            .map(|_| Sphere {
                centre: [0.0; 3].map(|_| 60.0 * draws.uniform()),
                radius: 0.5 + 3.0 * draws.uniform(),
            })
            .collect();
        let near = |a: &Sphere, b: &Sphere| {
            let d: f64 = (0..3).map(|k| (a.centre[k] - b.centre[k]).powi(2)).sum();
            d.sqrt() <= a.radius + b.radius + 0.5
        };
        let by_pairs: Vec<bool> = (0..200)
            .map(|i| (0..200).all(|j| i == j || !near(&spheres[i], &spheres[j])))
            .collect();
        let found = found(&spheres, true);
        assert!(found.iter().any(|&alone| alone) && !found.iter().all(|&alone| alone));
        assert_eq!(found, by_pairs);
    }

    #[test]
    fn a_body_that_comes_near_is_found_in_time() {
        let mut alone = Alone::default();
        let mut x = 30.0;
        while x > 18.0 {
            let spheres = [sphere(10.0, 4.0), sphere(x, 4.0)];
            alone.update(
                spheres.iter().copied(),
                &grid(true),
                FractionMethod::Exact,
                3,
            );
            // A gap above a quarter of a cell always counts as separate.
            assert!(x > 18.25 || !alone.is_separate(0), "{x}");
            assert!(x < 18.75 || alone.is_separate(1), "{x}");
            x -= 0.01;
        }
    }
}
