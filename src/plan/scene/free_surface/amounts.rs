//! Number of cells with water and of cells that its surface passes, for the estimate of the cost and for slabs of equal
//! cost.
//!
//! The cells that a surface passes form a closed layer. In a plane its number of cells is the length of the surface
//! along the axes: one for each column, and one for each cell of a step between columns. Water that stands next to air
//! spreads until its surface is level, as fast as the front of a dam break over a dry floor, `2 (g H)^(1/2)` with the
//! height H of the water (Ritter 1892).

use super::FreeSurface;
use base::number::{floor_i64, real};

/// Maximum number of cells whose state is computed; for larger domains columns represent their neighbours.
const MOST: usize = 100_000;
/// Maximum number of cells that are compared with solids.
const MOST_IN_SOLIDS: usize = 10_000;

/// Number of cells of a plane of the domain that contain water, and that the surface passes.
pub type WaterCells = [f64; 2];

/// Columns of cells that represent their neighbours, so that a limited number of cells is looked at.
struct Columns {
    /// Number of cells along each axis; 1 along that of gravity.
    across: [usize; 3],
    /// Number of cells along each axis that a column represents.
    steps: [usize; 3],
}

impl Columns {
    fn new(cells: [usize; 3], up: usize, most: usize) -> Self {
        let across = [0, 1, 2].map(|a| if a == up { 1 } else { cells[a] });
        // The same number of columns represents each other along both horizontal axes.
        let columns = across.iter().product::<usize>();
        let many = (columns * cells[up]).div_ceil(most);
        let wide = across.iter().filter(|count| **count > 1).count().max(1);
        let stride = floor_i64(real(many).powf(1.0 / real(wide)).ceil()).unsigned_abs();
        let stride = usize::try_from(stride).unwrap_or(1).max(1);
        let steps = across.map(|count| stride.min(count));
        Self { across, steps }
    }

    /// Returns the first cell of each column, and the number of cells that it represents along each axis.
    fn all(&self) -> impl Iterator<Item = [[usize; 3]; 2]> + '_ {
        let along = |a: usize| (0..self.across[a]).step_by(self.steps[a]);
        let firsts = along(0)
            .flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])));
        firsts.map(|first| {
            let widths = |a: usize| self.steps[a].min(self.across[a] - first[a]);
            [first, std::array::from_fn(widths)]
        })
    }
}

impl FreeSurface {
    /// Returns the mean number of cells that the surface passes until `end` \[s\], in a domain of `cells`: from the
    /// surface of the initial water to a level one. `is_solid` returns `true` for points in solids.
    #[must_use]
    pub fn interface_cells(
        &self,
        cells: [usize; 3],
        end: f64,
        is_solid: impl Fn([f64; 3]) -> bool,
    ) -> f64 {
        let columns = Columns::new(cells, self.axis, MOST);
        let height = cells[self.axis];
        let top = self.above(self.standing_head());
        let (mut first, mut level, mut dry) = (0.0, 0.0, 0.0);
        for [at, widths] in columns.all() {
            let weight = widths.iter().map(|width| real(*width)).product::<f64>();
            let mut middle = self.middle(at, widths);
            let wet = self.wet_cells(middle, height);
            first += weight * real(wet.windows(2).filter(|pair| pair[0] != pair[1]).count());
            for a in (0..3).filter(|a| *a != self.axis) {
                let mut next = at;
                next[a] += widths[a];
                if next[a] < cells[a] {
                    let beyond = std::array::from_fn(|b| columns.steps[b].min(cells[b] - next[b]));
                    let beside = self.middle(next, beyond);
                    let steps = self.step_between([middle, beside], &wet, &is_solid);
                    first += real(steps) * weight / real(widths[a]);
                }
            }
            middle[self.axis] = top;
            if !is_solid(middle) {
                level += weight;
                dry += if wet.contains(&true) { 0.0 } else { weight };
            }
        }
        let horizontal = (0..self.dimension).filter(|a| *a != self.axis);
        let longest = horizontal.map(|a| self.size[a]).fold(0.0, f64::max);
        let front = 2.0 * (self.gravity * self.standing_head()).sqrt();
        let spreads = longest * (dry / level) / front;
        if spreads <= end {
            level + 0.5 * (spreads / end) * (first - level)
        } else if spreads.is_finite() {
            first + 0.5 * (end / spreads) * (level - first)
        } else {
            first
        }
    }

    /// Returns the number of cells outside solids that water fills through the openings: up to the highest level or
    /// energy line, or all if no opening lets water out.
    #[must_use]
    pub fn cells_filled(&self, cells: [usize; 3], is_solid: impl Fn([f64; 3]) -> bool) -> f64 {
        let leaves = self.openings.iter().any(|opening| opening.lowest.is_some());
        let highest = if leaves { self.head() } else { f64::INFINITY };
        self.count(cells, |at| self.height(at) < highest && !is_solid(at))
    }

    /// Returns the number of cells outside solids that are without water at the start.
    #[must_use]
    pub fn cells_empty(&self, cells: [usize; 3], is_solid: impl Fn([f64; 3]) -> bool) -> f64 {
        self.count(cells, |at| self.depth(at) <= 0.0 && !is_solid(at))
    }

    /// Returns the number of cells whose middle meets a condition, from sampled columns.
    fn count(&self, cells: [usize; 3], meets: impl Fn([f64; 3]) -> bool) -> f64 {
        let mut sum = 0.0;
        for [first, widths] in Columns::new(cells, self.axis, MOST_IN_SOLIDS).all() {
            let weight = widths.iter().map(|width| real(*width)).product::<f64>();
            let mut at = self.middle(first, widths);
            let found = (0..cells[self.axis]).filter(|n| {
                at[self.axis] = (real(*n) + 0.5) * self.spacing;
                meets(at)
            });
            sum += weight * real(found.count());
        }
        sum
    }

    /// Returns the number of cells that are wet in one of two columns and air in the other. `wet` are the wet cells of
    /// the first column.
    fn step_between(
        &self,
        columns: [[f64; 3]; 2],
        wet: &[bool],
        is_solid: &impl Fn([f64; 3]) -> bool,
    ) -> usize {
        let others = self.wet_cells(columns[1], wet.len());
        let differ = (0..wet.len()).filter(|n| wet[*n] != others[*n]);
        let open = differ.filter(|n| {
            let mut ends = columns.into_iter().map(|mut at| {
                at[self.axis] = (real(*n) + 0.5) * self.spacing;
                at
            });
            !ends.any(is_solid)
        });
        open.count()
    }

    /// Returns the middle of the columns that a column represents \[m\].
    fn middle(&self, first: [usize; 3], widths: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (real(first[a]) + 0.5 * real(widths[a])) * self.spacing)
    }

    /// Returns which of the `height` cells of a column contain water.
    fn wet_cells(&self, mut at: [f64; 3], height: usize) -> Vec<bool> {
        let cells = (0..height).map(|n| {
            at[self.axis] = (real(n) + 0.5) * self.spacing;
            self.depth(at) > 0.0
        });
        cells.collect()
    }

    /// Returns the cells with water at the start in each plane of cells normal to `axis`, in a domain of `cells`.
    #[must_use]
    pub fn cells_of_planes(&self, cells: [usize; 3], axis: usize) -> Vec<WaterCells> {
        let mut planes = vec![[0.0; 2]; cells[axis]];
        for [first, widths] in Columns::new(cells, self.axis, MOST).all() {
            self.add_column(first, widths, axis, &mut planes, cells[self.axis]);
        }
        planes
    }

    /// Adds the cells of a column of `height` cells that represents those of `widths` columns from `first`.
    fn add_column(
        &self,
        first: [usize; 3],
        widths: [usize; 3],
        axis: usize,
        planes: &mut [WaterCells],
        height: usize,
    ) {
        let up = self.axis;
        let wet_cells = self.wet_cells(self.middle(first, widths), height);
        let weight = widths.iter().map(|width| real(*width)).product::<f64>();
        for (n, wet) in wet_cells.iter().copied().enumerate() {
            // The surface passes the last wet cell below air, or the first one above it.
            let surface = wet_cells.get(n + 1).is_some_and(|next| *next != wet);
            if !wet && !surface {
                continue;
            }
            let amounts = [f64::from(u8::from(wet)), f64::from(u8::from(surface))];
            let range = if axis == up {
                n..n + 1
            } else {
                first[axis]..first[axis] + widths[axis]
            };
            let each = weight / real(range.len());
            for plane in &mut planes[range] {
                for (sum, amount) in plane.iter_mut().zip(amounts) {
                    *sum += each * amount;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    #[test]
    fn cells_of_a_column_of_water_are_counted_by_plane() {
        let text = r#"{
          "title": "column", "gravity": [0, -9.81],
          "domain": {"size": [0.4, 0.2], "spacing": 1e-3},
          "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "time_step": 1e-4,
            "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.1, 0.1]}}}]}}},
          "time": {"end": 0.1}
        }"#;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let surface = plan.scene.surface.as_ref().unwrap();
        let along = surface.cells_of_planes(plan.scene.grid.cells, 0);
        let total: f64 = along.iter().map(|plane| plane[0]).sum();
        assert!((total / 1e4 - 1.0).abs() < 0.05, "{total}");
        assert!(along[50] == [100.0, 1.0] && along[300] == [0.0; 2]);
        let up = surface.cells_of_planes(plan.scene.grid.cells, 1);
        let same: f64 = up.iter().map(|plane| plane[0]).sum();
        assert!((same / total - 1.0).abs() < 1e-12);
        assert!(up[150] == [0.0; 2]);
    }

    /// Checks the mean number of cells of the surface of a falling column of water against those counted in the fields
    /// of the run of the example: 60 at the start, 58, 64, 67, 76, 82, 101, 111, 125, 138 and 148 at every tenth of it.
    #[test]
    fn the_surface_of_a_falling_column_grows_to_that_of_the_floor() {
        let text = case::examples::find("dam-break").unwrap().text;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let cells = plan.scene.grid.cells;
        let surface = plan.scene.surface.as_ref().unwrap();
        let mean = |end: f64| surface.interface_cells(cells, end, |_| false);
        let counted = [
            60.0, 58.0, 64.0, 67.0, 76.0, 82.0, 101.0, 111.0, 125.0, 138.0, 148.0,
        ];
        let found = counted.iter().sum::<f64>() / 11.0;
        let planned = mean(0.25);
        assert!((planned / found - 1.0).abs() < 0.25, "{planned} {found}");
        assert!((mean(1e-6) / 60.0 - 1.0).abs() < 0.01, "{}", mean(1e-6));
        // In the end the surface is level over the whole floor of 140 cells.
        assert!((mean(1e3) / 140.0 - 1.0).abs() < 0.01, "{}", mean(1e3));
        // A solid next to the column takes the place of its free side.
        let beside = |at: [f64; 3]| at[0] > 0.05715 && at[1] < 0.1143;
        let closed = surface.interface_cells(cells, 1e-6, beside);
        assert!((closed - 20.0).abs() < 0.1, "{closed}");
    }

    /// Checks the water of a reservoir above a weir: below its level, without the weir.
    #[test]
    fn an_opening_fills_the_domain_up_to_its_level() {
        let text = case::examples::find("broad-crested-weir").unwrap().text;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let scene = Plan::prepare(document).unwrap().scene;
        let surface = scene.surface.as_ref().unwrap();
        let is_solid = |at: [f64; 3]| at[0] > 0.8 && at[1] < 0.24;
        let filled = surface.cells_filled(scene.grid.cells, is_solid);
        let expected = (1.3 * 0.36 - 0.5 * 0.24) / 0.004_f64.powi(2);
        assert!(
            (filled / expected - 1.0).abs() < 0.02,
            "{filled} {expected}"
        );
    }
}
