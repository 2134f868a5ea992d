//! Porosity and mean diameter of every cell from the grains in it.
//!
//! ```text
//! eps = 1 - sum_i w_i V_i / V_inside        w_i: the part of grain i in the cell
//! ```
//!
//! A porosity method gives the fraction of a grain in each cell. Each method has its own file below this module and
//! one line in the list.
//!
//! Sums are integers (steps of 2^-62 of a cell): they do not depend on the order of grains or ranks.

use super::enclosure::Openness;
use super::grid::SeepageGrid;
use super::mean_diameter::MeanDiameter;
use base::family::family;
use base::number::real;
use decomposition::{Communicator, quantise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

family! {
    /// Porosity methods. A new line makes a method available to cases, to their schema, to `plan` and to runs.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case", deny_unknown_fields)]
    #[schemars(inline)]
    pub enum PorosityMethod: dyn PorosityFormula, summary {
        centroid: Centroid,
        divided: Divided,
        #[default]
        exact: Exact,
    }
}

/// Porosity method: the fraction of a grain in each cell.
pub trait PorosityFormula {
    /// Returns the description of the method in the schema of the case: one line.
    fn summary() -> &'static str
    where
        Self: Sized;

    /// Returns the method with its parameters for the tables of `plan`.
    fn description(&self) -> String;

    /// Appends (cell, fraction) for the cells that contain a part of the grain; parts outside the grid are dropped.
    fn parts(
        &self,
        grid: &SeepageGrid,
        centre: [f64; 3],
        radius: f64,
        parts: &mut Vec<(usize, f64)>,
    );
}

/// Returns the volume of a sphere; in 2-D the area of a disc.
#[must_use]
pub fn measure(dimension: usize, radius: f64) -> f64 {
    if dimension == 2 {
        PI * radius * radius
    } else {
        4.0 / 3.0 * PI * radius * radius * radius
    }
}

/// Pores of the grid, computed from grains with [`Pores::clear`], [`Pores::add`] for every owned grain,
/// [`Pores::finish`].
#[derive(Clone, Debug)]
pub struct Pores {
    grid: SeepageGrid,
    method: PorosityMethod,
    mean: MeanDiameter,
    /// Unit in which diameters are summed \[m\].
    unit: f64,
    /// Sums per cell as signed integers in steps of 2^-62: solid volume over that of the cell, sum w d^(k+1),
    /// sum w d^k. Empty as long as there is no grain.
    sums: Vec<[u128; 3]>,
    porosity: Vec<f64>,
    diameter: Vec<f64>,
    mean_diameter: f64,
    finite: bool,
}

impl Pores {
    /// Returns the pore space of a grid without grains.
    #[must_use]
    pub fn new(grid: SeepageGrid, method: PorosityMethod, mean: MeanDiameter) -> Self {
        let n = grid.count();
        let unit = (0..grid.dimension)
            .map(|a| 2.0 * grid.spacing[a])
            .fold(f64::INFINITY, f64::min);
        Self {
            grid,
            method,
            mean,
            unit,
            sums: Vec::new(),
            porosity: vec![1.0; n],
            diameter: vec![0.25 * unit; n],
            mean_diameter: 0.25 * unit,
            finite: true,
        }
    }

    /// Returns the kind of mean diameter.
    #[must_use]
    pub fn mean(&self) -> MeanDiameter {
        self.mean
    }

    /// Resets the sums.
    pub fn clear(&mut self) {
        self.sums.fill([0; 3]);
        self.finite = true;
    }

    /// Replaces `parts` by the cells that contain a part of a grain, each with the fraction of the grain; parts
    /// outside the grid are dropped.
    #[inline]
    pub fn parts(&self, centre: [f64; 3], radius: f64, parts: &mut Vec<(usize, f64)>) {
        parts.clear();
        self.append_parts(centre, radius, parts);
    }

    /// Appends the result of [`Self::parts`] to the list.
    #[inline]
    pub fn append_parts(&self, centre: [f64; 3], radius: f64, parts: &mut Vec<(usize, f64)>) {
        self.method.model().parts(&self.grid, centre, radius, parts);
    }

    /// Adds a grain with its [`Self::parts`]; each grain must be added on one rank only. All cells must be equal.
    pub fn add(&mut self, centre: [f64; 3], radius: f64, parts: &[(usize, f64)]) {
        let volume = measure(self.grid.dimension, radius) / self.grid.volume([0; 3]);
        let d = 2.0 * radius / self.unit;
        let weight = d.powi(self.mean.power());
        self.allocate();
        let mut finite = centre.iter().all(|x| x.is_finite());
        for &(cell, part) in parts {
            let terms = [part * volume, part * weight * d, part * weight];
            for (sum, term) in self.sums[cell].iter_mut().zip(terms) {
                finite &= term.abs() < 2.0;
                *sum = sum.wrapping_add(i128::from(quantise(term)).cast_unsigned());
            }
        }
        self.finite &= finite;
    }

    /// Allocates the sums if that was not done before.
    fn allocate(&mut self) {
        if self.sums.is_empty() {
            self.sums.resize(self.grid.count(), [0; 3]);
        }
    }

    /// Sums over the ranks and derives porosity and diameters. Collective.
    ///
    /// # Errors
    /// If the position of a grain is not finite, or a grain is far larger than a cell.
    pub fn finish(
        &mut self,
        openness: &Openness,
        communicator: &Communicator,
    ) -> Result<(), super::SeepageError> {
        let state = match (self.finite, self.sums.is_empty()) {
            (false, _) => 2,
            (true, false) => 1,
            (true, true) => 0,
        };
        match communicator.all_reduce_max_u64(state) {
            0 => {}
            1 => {
                self.allocate();
                communicator.all_reduce_sum_u128s(self.sums.as_flattened_mut());
            }
            _ => return Err(super::SeepageError::NotFinite("a grain")),
        }
        let mut all = [0_i128; 2];
        for sums in &self.sums {
            all[0] += sums[1].cast_signed();
            all[1] += sums[2].cast_signed();
        }
        let mean = |upper: i128, lower: i128| {
            (lower > SLIVER).then(|| self.unit * (real(upper) / real(lower)))
        };
        if let Some(d) = mean(all[0], all[1]) {
            self.mean_diameter = d;
        }
        for cell in 0..self.porosity.len() {
            let sums = self.sums.get(cell).copied().unwrap_or_default();
            let sums = sums.map(u128::cast_signed);
            let solid = real(sums[0]) * STEP;
            self.porosity[cell] = if openness.blocked(cell) {
                0.0
            } else {
                1.0 - solid / openness.inside[cell]
            };
            self.diameter[cell] = mean(sums[1], sums[2]).unwrap_or(self.mean_diameter);
        }
        Ok(())
    }

    /// Returns the porosity of each cell: 1 without grains, 0 outside the walls; below 0 if a cell is overfull.
    #[must_use]
    pub fn porosity(&self) -> &[f64] {
        &self.porosity
    }

    /// Returns the mean diameter in each cell \[m\]; that of all grains for a cell without grains.
    #[must_use]
    pub fn diameter(&self) -> &[f64] {
        &self.diameter
    }

    /// Returns the volume of the grains in a cell \[m3; m2 in 2-D\].
    #[must_use]
    pub fn solid_volume(&self, cell: usize) -> f64 {
        let volume = self.sums.get(cell).map_or(0, |sums| sums[0].cast_signed());
        real(volume) * STEP * self.grid.volume(self.grid.cell(cell))
    }
}

/// Largest sum that is too coarse for a quotient: a grain overlaps the cell by less than about 2^-40 of the cell.
const SLIVER: i128 = 1 << 22;
/// Step of the sums: 2^-62.
const STEP: f64 = 1.0 / 4_611_686_018_427_387_904.0;
#[cfg(test)]
mod tests {
    use super::*;
    use crate::enclosure::Enclosure;
    use base::number::real;
    use base::random::SplitMix;

    fn grid(dimension: usize) -> SeepageGrid {
        SeepageGrid {
            cells: if dimension == 2 { [6, 5, 1] } else { [6, 5, 4] },
            origin: [-0.01, 0.0, if dimension == 2 { 0.0 } else { 0.02 }],
            spacing: [0.01, 0.012, if dimension == 2 { 1.0 } else { 0.011 }],
            dimension,
            ..SeepageGrid::default()
        }
    }

    fn cloud(grid: &SeepageGrid, count: usize) -> Vec<([f64; 3], f64)> {
        let mut draws = SplitMix::new(5);
        (0..count)
            .map(|_| {
                let r = 0.0005 + 0.002 * draws.uniform();
                let at = std::array::from_fn(|a| {
                    let length = real(grid.cells[a]) * grid.spacing[a];
                    grid.origin[a] + r + draws.uniform() * (length - 2.0 * r)
                });
                (at, r)
            })
            .collect()
    }

    fn add(pores: &mut Pores, centre: [f64; 3], radius: f64) {
        let mut parts = Vec::new();
        pores.parts(centre, radius, &mut parts);
        pores.add(centre, radius, &parts);
    }

    fn pores(grid: &SeepageGrid, method: PorosityMethod, grains: &[([f64; 3], f64)]) -> Pores {
        let open = Openness::measure(grid, &Enclosure::Everything);
        let mut pores = Pores::new(grid.clone(), method, MeanDiameter::Sauter);
        for (at, r) in grains {
            add(&mut pores, *at, *r);
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
            for method in [
                PorosityMethod::Centroid,
                PorosityMethod::Divided,
                PorosityMethod::Exact,
            ] {
                let pores = pores(&grid, method, &grains);
                let solid: f64 = (0..grid.count()).map(|k| pores.solid_volume(k)).sum();
                assert!((solid / exact - 1.0).abs() < 1e-13, "{method:?} {solid}");
                let voids: f64 = pores
                    .porosity()
                    .iter()
                    .map(|e| (1.0 - e) * grid.volume([0; 3]))
                    .sum();
                assert!((voids / exact - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_order_of_grains_does_not_show() {
        let grid = grid(3);
        let mut grains = cloud(&grid, 300);
        let one = pores(&grid, PorosityMethod::Exact, &grains);
        grains.reverse();
        let two = pores(&grid, PorosityMethod::Exact, &grains);
        assert_eq!(one.porosity(), two.porosity());
        assert_eq!(one.diameter(), two.diameter());
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
            let mut pores = Pores::new(grid.clone(), PorosityMethod::Centroid, mean);
            for d in [a, a, b, a] {
                add(&mut pores, at, 0.5 * d);
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
        let mut pores = Pores::new(grid.clone(), PorosityMethod::Centroid, MeanDiameter::Sauter);
        let r = 0.002;
        add(&mut pores, [-0.0075, 0.006, 0.025], r);
        pores.finish(&open, &Communicator::serial()).unwrap();
        let exact = 1.0 - measure(3, r) / (0.5 * grid.volume([0; 3]));
        assert!((pores.porosity()[0] - exact).abs() < 1e-14);
        assert!(pores.porosity()[1] <= 0.0);
    }
}
