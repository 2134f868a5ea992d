//! Porosity and mean diameter of every cell from the grains in it (C-10, C-11).
//!
//! ```text
//! eps = 1 - sum_i w_i V_i / V_inside        w_i: the part of grain i in the cell
//! ```
//!
//! | method | the part of a grain in a cell |
//! |---|---|
//! | centroid | all of it where its centre stands |
//! | divided | the share of 29 points (17 in 2-D) of equal weight: one in the centre, 14 (8) on each of two shells |
//! | exact | the volume of sphere and box in common ([`super::overlap`]) |
//!
//! The points of the second method stand in the 6 + 8 directions of the axes and corners, on the mean radius of shells of 14/29
//! of the volume each; the innermost 1/29 is the centre's. It smooths the jump of a centre that crosses a face to 1/29.
//!
//! Sums are integers (steps of 2^-62 of a cell): no order of grains or ranks can show.

use super::enclosure::Openness;
use super::grid::{Grid, number};
use super::overlap::{disc_rectangle, sphere_box};
use super::permeability::MeanDiameter;
use decomposition::{Communicator, quantise};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// How a grain counts for the cells it touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Where its centre stands.
    Centroid,
    /// By points of equal weight inside it.
    Divided,
    /// By its exact overlap with each cell.
    Exact,
}

/// Volume of a sphere; in 2-D area of a disc.
#[must_use]
pub fn measure(dimension: usize, radius: f64) -> f64 {
    if dimension == 2 {
        PI * radius * radius
    } else {
        4.0 / 3.0 * PI * radius * radius * radius
    }
}

/// Mean radius of a shell between two radii in a ball (or disc) of radius 1.
fn mean_radius(inner: f64, outer: f64, dimension: i32) -> f64 {
    let n = f64::from(dimension);
    n / (n + 1.0) * (outer.powi(dimension + 1) - inner.powi(dimension + 1))
        / (outer.powi(dimension) - inner.powi(dimension))
}

/// The points of the divided method, for a grain of radius 1.
fn satellites(dimension: usize) -> Vec<[f64; 3]> {
    let mut directions: Vec<[f64; 3]> = Vec::new();
    for axis in 0..dimension {
        for sign in [-1.0, 1.0] {
            let mut unit = [0.0; 3];
            unit[axis] = sign;
            directions.push(unit);
        }
    }
    let c = if dimension == 2 {
        FRAC_1_SQRT_2
    } else {
        1.0 / 3.0_f64.sqrt()
    };
    let signs: &[f64] = if dimension == 2 { &[0.0] } else { &[-c, c] };
    for &z in signs {
        for y in [-c, c] {
            for x in [-c, c] {
                directions.push([x, y, z]);
            }
        }
    }
    let (total, n) = (number(1 + 2 * directions.len()), directions.len());
    let (power, exponent) = if dimension == 2 {
        (2, 0.5)
    } else {
        (3, 1.0 / 3.0)
    };
    let first = (1.0 / total).powf(exponent);
    let second = (number(1 + n) / total).powf(exponent);
    let shells = [
        mean_radius(first, second, power),
        mean_radius(second, 1.0, power),
    ];
    let mut points = vec![[0.0; 3]];
    for shell in shells {
        points.extend(directions.iter().map(|d| d.map(|x| x * shell)));
    }
    points
}

/// The pores of the grid: made from grains with [`Pores::clear`], [`Pores::add`] for every owned grain, [`Pores::finish`].
#[derive(Clone, Debug)]
pub struct Pores {
    grid: Grid,
    method: Method,
    mean: MeanDiameter,
    points: Vec<[f64; 3]>,
    /// Diameters are summed in units of this \[m\].
    unit: f64,
    /// Per cell: solid volume over the cell's, sum w d^(k+1), sum w d^k, in steps of 2^-62.
    sums: Vec<[i128; 3]>,
    words: Vec<u128>,
    porosity: Vec<f64>,
    diameter: Vec<f64>,
    mean_diameter: f64,
    finite: bool,
}

impl Pores {
    /// No grains.
    #[must_use]
    pub fn new(grid: Grid, method: Method, mean: MeanDiameter) -> Self {
        let n = grid.count();
        let unit = (0..grid.dimension)
            .map(|a| 2.0 * grid.spacing[a])
            .fold(f64::INFINITY, f64::min);
        Self {
            grid,
            method,
            mean,
            points: if method == Method::Divided {
                satellites(grid.dimension)
            } else {
                Vec::new()
            },
            unit,
            sums: vec![[0; 3]; n],
            words: vec![0; 3 * n],
            porosity: vec![1.0; n],
            diameter: vec![0.25 * unit; n],
            mean_diameter: 0.25 * unit,
            finite: true,
        }
    }

    /// The mean diameter that is formed.
    #[must_use]
    pub fn mean(&self) -> MeanDiameter {
        self.mean
    }

    /// Forgets all grains.
    pub fn clear(&mut self) {
        self.sums.fill([0; 3]);
        self.finite = true;
    }

    /// Calls `each(cell, part)` for the cells that hold a part of a grain; parts outside the grid are left out.
    #[inline]
    pub fn parts(&self, centre: [f64; 3], radius: f64, mut each: impl FnMut(usize, f64)) {
        match self.method {
            Method::Centroid => {
                if let Some(cell) = self.grid.holding(centre) {
                    each(self.grid.index(cell), 1.0);
                }
            }
            Method::Divided => {
                let share = 1.0 / number(self.points.len());
                for point in &self.points {
                    let at = std::array::from_fn(|a| centre[a] + radius * point[a]);
                    if let Some(cell) = self.grid.holding(at) {
                        each(self.grid.index(cell), share);
                    }
                }
            }
            Method::Exact => self.overlaps(centre, radius, each),
        }
    }

    fn overlaps(&self, centre: [f64; 3], radius: f64, mut each: impl FnMut(usize, f64)) {
        let grid = &self.grid;
        let (mut from, mut to) = ([0; 3], [0; 3]);
        for axis in 0..grid.dimension {
            let last = grid.cells[axis] - 1;
            let upper = grid.origin[axis] + number(last + 1) * grid.spacing[axis];
            if !(centre[axis] + radius > grid.origin[axis] && centre[axis] - radius < upper) {
                return;
            }
            from[axis] = grid.along(axis, centre[axis] - radius).unwrap_or(0);
            to[axis] = grid.along(axis, centre[axis] + radius).unwrap_or(last);
        }
        let whole = measure(grid.dimension, radius);
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    let lower = grid.corner([x, y, z]);
                    let upper = std::array::from_fn(|a| lower[a] + grid.spacing[a]);
                    let common = if grid.dimension == 2 {
                        disc_rectangle(centre, radius, lower, upper)
                    } else {
                        sphere_box(centre, radius, lower, upper)
                    };
                    if common > 0.0 {
                        each(grid.index([x, y, z]), common / whole);
                    }
                }
            }
        }
    }

    /// Adds a grain; every grain on one rank only.
    pub fn add(&mut self, centre: [f64; 3], radius: f64) {
        let mut sums = std::mem::take(&mut self.sums);
        let volume = measure(self.grid.dimension, radius) / self.grid.volume();
        let d = 2.0 * radius / self.unit;
        let weight = d.powi(self.mean.power());
        let mut finite = centre.iter().all(|x| x.is_finite());
        self.parts(centre, radius, |cell, part| {
            for (sum, term) in
                sums[cell]
                    .iter_mut()
                    .zip([part * volume, part * weight * d, part * weight])
            {
                finite &= term.abs() < 2.0;
                *sum += i128::from(quantise(term));
            }
        });
        self.finite &= finite;
        self.sums = sums;
    }

    /// Sums over the ranks and derives porosity and diameters. Collective.
    ///
    /// # Errors
    /// Where a grain has no finite place, or is far larger than a cell.
    pub fn finish(
        &mut self,
        openness: &Openness,
        communicator: &Communicator,
    ) -> Result<(), super::Error> {
        if !communicator.all_true(self.finite) {
            return Err(super::Error::NotFinite("a grain"));
        }
        for (words, sums) in self.words.as_chunks_mut().0.iter_mut().zip(&self.sums) {
            *words = sums.map(i128::cast_unsigned);
        }
        communicator.all_reduce_sum_u128s(&mut self.words);
        let mut all = [0_i128; 2];
        for (words, sums) in self.words.as_chunks::<3>().0.iter().zip(&mut self.sums) {
            *sums = words.map(u128::cast_signed);
            all[0] += sums[1];
            all[1] += sums[2];
        }
        let mean = |upper: i128, lower: i128| {
            (lower > 0).then(|| self.unit * (nearest(upper) / nearest(lower)))
        };
        if let Some(d) = mean(all[0], all[1]) {
            self.mean_diameter = d;
        }
        for (cell, sums) in self.sums.iter().enumerate() {
            let solid = nearest(sums[0]) * STEP;
            self.porosity[cell] = if openness.blocked(cell) {
                0.0
            } else {
                1.0 - solid / openness.inside[cell]
            };
            self.diameter[cell] = mean(sums[1], sums[2]).unwrap_or(self.mean_diameter);
        }
        Ok(())
    }

    /// Porosity of each cell: 1 without grains, 0 outside the walls; below 0 where a cell is overfull.
    #[must_use]
    pub fn porosity(&self) -> &[f64] {
        &self.porosity
    }

    /// Mean diameter in each cell \[m\]; that of all grains where there is none.
    #[must_use]
    pub fn diameter(&self) -> &[f64] {
        &self.diameter
    }

    /// Volume of the grains in a cell \[m3; m2 in 2-D\].
    #[must_use]
    pub fn solid_volume(&self, cell: usize) -> f64 {
        nearest(self.sums[cell][0]) * STEP * self.grid.volume()
    }
}

/// 2^-62.
const STEP: f64 = 1.0 / 4_611_686_018_427_387_904.0;

#[expect(
    clippy::cast_precision_loss,
    reason = "the cast rounds to nearest, which is what is wanted"
)]
fn nearest(value: i128) -> f64 {
    value as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::darcy::enclosure::Enclosure;
    use crate::darcy::testing::Draws;

    fn grid(dimension: usize) -> Grid {
        Grid {
            cells: if dimension == 2 { [6, 5, 1] } else { [6, 5, 4] },
            origin: [-0.01, 0.0, if dimension == 2 { 0.0 } else { 0.02 }],
            spacing: [0.01, 0.012, if dimension == 2 { 1.0 } else { 0.011 }],
            dimension,
        }
    }

    fn cloud(grid: &Grid, count: usize) -> Vec<([f64; 3], f64)> {
        let mut draws = Draws::new(5);
        (0..count)
            .map(|_| {
                let r = 0.0005 + 0.002 * draws.next();
                let at = std::array::from_fn(|a| {
                    let length = number(grid.cells[a]) * grid.spacing[a];
                    grid.origin[a] + r + draws.next() * (length - 2.0 * r)
                });
                (at, r)
            })
            .collect()
    }

    fn pores(grid: &Grid, method: Method, grains: &[([f64; 3], f64)]) -> Pores {
        let open = Openness::measure(grid, &Enclosure::Everything);
        let mut pores = Pores::new(*grid, method, MeanDiameter::Sauter);
        for (at, r) in grains {
            pores.add(*at, *r);
        }
        pores.finish(&open, &Communicator::serial()).unwrap();
        pores
    }

    #[test]
    fn every_method_keeps_the_volume_of_the_grains() {
        for dimension in [2, 3] {
            let grid = grid(dimension);
            let grains = cloud(&grid, 400);
            let exact: f64 = grains.iter().map(|(_, r)| measure(dimension, *r)).sum();
            for method in [Method::Centroid, Method::Divided, Method::Exact] {
                let pores = pores(&grid, method, &grains);
                let solid: f64 = (0..grid.count()).map(|k| pores.solid_volume(k)).sum();
                assert!((solid / exact - 1.0).abs() < 1e-13, "{method:?} {solid}");
                let voids: f64 = pores
                    .porosity()
                    .iter()
                    .map(|e| (1.0 - e) * grid.volume())
                    .sum();
                assert!((voids / exact - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_order_of_grains_does_not_show() {
        let grid = grid(3);
        let mut grains = cloud(&grid, 300);
        let one = pores(&grid, Method::Exact, &grains);
        grains.reverse();
        let two = pores(&grid, Method::Exact, &grains);
        assert_eq!(one.porosity(), two.porosity());
        assert_eq!(one.diameter(), two.diameter());
    }

    #[test]
    fn satellites_are_balanced_and_lie_inside() {
        for (dimension, count) in [(2, 17), (3, 29)] {
            let points = satellites(dimension);
            assert_eq!(points.len(), count);
            for axis in 0..3 {
                assert!(points.iter().map(|p| p[axis]).sum::<f64>().abs() < 1e-14);
            }
            assert!(
                points
                    .iter()
                    .all(|p| p.iter().map(|x| x * x).sum::<f64>() < 1.0)
            );
        }
        // Published offsets of the inner shell: 0.6275 of the radius.
        let inner = satellites(3)[1][0].abs();
        assert!((inner - 0.6275).abs() < 2e-4, "{inner}");
    }

    #[test]
    fn means_of_two_sizes() {
        let mut grid = grid(3);
        grid.cells = [1; 3];
        let (a, b) = (0.001_f64, 0.003_f64);
        let at = grid.centre([0; 3]);
        let open = Openness::measure(&grid, &Enclosure::Everything);
        for (mean, exact) in [
            (MeanDiameter::Number, (3.0 * a + b) / 4.0),
            (
                MeanDiameter::Sauter,
                (3.0 * a * a * a + b * b * b) / (3.0 * a * a + b * b),
            ),
            (
                MeanDiameter::Mass,
                (3.0 * a.powi(4) + b.powi(4)) / (3.0 * a.powi(3) + b.powi(3)),
            ),
        ] {
            let mut pores = Pores::new(grid, Method::Centroid, mean);
            for d in [a, a, b, a] {
                pores.add(at, 0.5 * d);
            }
            pores.finish(&open, &Communicator::serial()).unwrap();
            assert!((pores.diameter()[0] / exact - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn porosity_is_relative_to_the_volume_inside() {
        let mut grid = grid(3);
        grid.cells = [2, 1, 1];
        // Half of the first cell, none of the second.
        let wall = Enclosure::HalfSpaces(vec![([1.0, 0.0, 0.0], -0.005)]);
        let open = Openness::measure(&grid, &wall);
        let mut pores = Pores::new(grid, Method::Centroid, MeanDiameter::Sauter);
        let r = 0.002;
        pores.add([-0.0075, 0.006, 0.025], r);
        pores.finish(&open, &Communicator::serial()).unwrap();
        let exact = 1.0 - measure(3, r) / (0.5 * grid.volume());
        assert!((pores.porosity()[0] - exact).abs() < 1e-14);
        assert!(pores.porosity()[1] <= 0.0);
    }
}
