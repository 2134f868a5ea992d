//! Uplift of seepage: force of the water on the base of a structure, its torque, mean pressure, and area.

use super::quantity::Quantity;
use super::section::Section;
use super::{Heading, Rows, area_unit, sampled_if_solved};
use crate::grains::{force_unit, torque_unit};
use crate::view::StateView;
use base::error::Error;
use coupling::seepage::Seepage;
use decomposition::ExactSum;
use dem::space::Space;
use plan::scene::Scene;

/// Base of a structure.
#[derive(Debug)]
pub(super) struct Uplift {
    base: Section,
    /// Point of the torque \[m\].
    about: [f64; 3],
}

impl Uplift {
    /// Returns the uplift of a section with its torque about a point \[m\].
    pub(super) fn new(base: Section, about: [f64; 3]) -> Self {
        Self { base, about }
    }

    /// Returns the force of the pressure in the cells before the plane along the axis, its torque about a point,
    /// the mean pressure and the area. The pressure of a face is that of its cell, extrapolated by the gradient in
    /// the cell.
    fn measure<S: Space>(&self, seepage: &Seepage<S>) -> [f64; 6] {
        let Section {
            axis,
            plane,
            ref ranges,
        } = self.base;
        let about = self.about;
        let (grid, pressure) = (seepage.grid(), seepage.pressure());
        let mut sums: [ExactSum; 4] = std::array::from_fn(|_| ExactSum::new());
        let mut whole = ExactSum::new();
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            let held = (0..3).all(|a| a == axis || ranges[a].contains(&cell[a]));
            if !held || cell[axis] + 1 != plane || seepage.pores().porosity()[index] <= 0.0 {
                continue;
            }
            let (gradient, weight) = (pressure.inner_gradient(index), pressure.weight());
            let slope: [f64; 3] = std::array::from_fn(|a| gradient[a] + weight[a]);
            let mut arm = grid.centre(cell);
            let (area, widths) = (grid.area(axis, cell), grid.widths(cell));
            arm[axis] += 0.5 * widths[axis];
            let force = area * (pressure.pressure(index) + 0.5 * widths[axis] * slope[axis]);
            // Computes first moments of the linear pressure over the face, then the torque r x F.
            let moment: [f64; 3] = std::array::from_fn(|a| {
                let across = if a == axis || a >= grid.dimension {
                    0.0
                } else {
                    area * slope[a] * widths[a].powi(2) / 12.0
                };
                force * (arm[a] - about[a]) + across
            });
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            sums[0].add(force);
            sums[1 + b].add(moment[c]);
            sums[1 + c].add(-moment[b]);
            whole.add(area);
        }
        let [force, x, y, z] = sums.map(|sum| sum.value());
        let area = whole.value();
        [force, x, y, z, force / area, area]
    }
}

impl Quantity for Uplift {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        let torque = torque_unit(dimension);
        vec![
            ("force", force_unit(dimension)),
            ("torque_x", torque),
            ("torque_y", torque),
            ("torque_z", torque),
            ("mean_pressure", "Pa"),
            ("area", area_unit(dimension)),
        ]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let values = self.measure(seepage);
            rows.iter_mut().for_each(|row| row.extend(values));
        })
    }
}
