//! Number of cells with water at the start, for the estimate of the cost and for slabs of equal cost.

use super::FreeSurface;
use base::number::{floor_i64, real};

/// Maximum number of cells whose state is computed; for larger domains columns represent their neighbours.
const MOST: usize = 100_000;

/// Number of cells of a plane of the domain that contain water, and that the surface passes.
pub type WaterCells = [f64; 2];

impl FreeSurface {
    /// Returns the cells with water at the start in each plane of cells normal to `axis`, in a domain of `cells`.
    #[must_use]
    pub fn cells_of_planes(&self, cells: [usize; 3], axis: usize) -> Vec<WaterCells> {
        let mut planes = vec![[0.0; 2]; cells[axis]];
        let across = [0, 1, 2].map(|a| if a == self.axis { 1 } else { cells[a] });
        // The same number of columns represents each other along both horizontal axes.
        let columns = across.iter().product::<usize>();
        let many = (columns * cells[self.axis]).div_ceil(MOST);
        let wide = across.iter().filter(|count| **count > 1).count().max(1);
        let stride = floor_i64(real(many).powf(1.0 / real(wide)).ceil()).unsigned_abs();
        let stride = usize::try_from(stride).unwrap_or(1).max(1);
        let steps = across.map(|count| stride.min(count));
        for x in (0..across[0]).step_by(steps[0]) {
            for y in (0..across[1]).step_by(steps[1]) {
                for z in (0..across[2]).step_by(steps[2]) {
                    let first = [x, y, z];
                    let widths: [usize; 3] =
                        std::array::from_fn(|a| steps[a].min(across[a] - first[a]));
                    self.add_column(first, widths, axis, &mut planes, cells[self.axis]);
                }
            }
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
        let is_wet = |n: usize| {
            let mut at: [f64; 3] =
                std::array::from_fn(|a| (real(first[a]) + 0.5 * real(widths[a])) * self.spacing);
            at[up] = (real(n) + 0.5) * self.spacing;
            self.depth(at) > 0.0
        };
        let weight = widths.iter().map(|width| real(*width)).product::<f64>();
        let mut before = is_wet(0);
        for n in 0..height {
            let wet = before;
            before = n + 1 < height && is_wet(n + 1);
            // The surface passes the last wet cell below air, or the first one above it.
            let surface = wet != before && n + 1 < height;
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
}
