//! Discharge through a plane of cells, means over its fluid cells, largest speed, and part of the plane that is fluid.

use super::points::clamped;
use super::quantity::Quantity;
use super::{Heading, Rows, discharge_unit, face_area, fluid};
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use coupling::FluidView;
use decomposition::ExactSum;
use dem::space::Space;
use plan::scene::Scene;

/// Plane normal to an axis.
#[derive(Debug)]
pub(super) struct Plane {
    pub(super) axis: usize,
    /// Coordinate \[m\].
    pub(super) position: f64,
}

impl Quantity for Plane {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        vec![
            ("discharge", discharge_unit(scene.grid.dimension)),
            ("mean_velocity_x", "m/s"),
            ("mean_velocity_y", "m/s"),
            ("mean_velocity_z", "m/s"),
            ("mean_pressure", "Pa"),
            ("largest_speed", "m/s"),
            ("fluid_share", "-"),
        ]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = plane(view, fluid(view)?, self.axis, self.position);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns the discharge through a plane, means over its fluid cells, largest speed and fluid fraction; NaN if
/// there is no fluid.
fn plane<S: Space>(
    view: &StateView<S>,
    fluid: &dyn FluidView,
    axis: usize,
    position: f64,
) -> [f64; 7] {
    let (grid, units) = (&view.plan.scene.grid, fluid.units());
    let neighbours = clamped(position, grid, axis);
    let mut sums: [ExactSum; 5] = std::array::from_fn(|_| ExactSum::new());
    let mut largest = f64::NEG_INFINITY;
    let (start, cells) = (fluid.start(), fluid.cells());
    for (plane, weight) in neighbours {
        let Some(local) = plane
            .checked_sub(start[axis])
            .filter(|local| *local < cells[axis] && weight > 0.0)
        else {
            continue;
        };
        let (mut from, mut to) = ([0; 3], cells);
        (from[axis], to[axis]) = (local, local + 1);
        for z in from[2]..to[2] {
            for y in from[1]..to[1] {
                for x in from[0]..to[0] {
                    let fill = fluid.fill([x, y, z]);
                    if fluid.solid_at([x, y, z]) || fill <= 0.0 {
                        continue;
                    }
                    let weight = weight * fill;
                    let (deviation, [u, v, w]) = fluid.state([x, y, z]);
                    for (sum, value) in sums.iter_mut().zip([u, v, w, deviation, 1.0]) {
                        sum.add(weight * value);
                    }
                    largest = largest.max(u * u + v * v + w * w);
                }
            }
        }
    }
    let communicator = view.domain.communicator();
    let [u, v, w, deviation, number] = sums.map(|mut sum| {
        sum.all_reduce(communicator);
        sum.value()
    });
    let largest = communicator.all_reduce_max_f64(largest);
    let all: f64 = (0..3)
        .filter(|&a| a != axis)
        .map(|a| real(grid.cells[a]))
        .product();
    let discharge = units.velocity_to_si([u, v, w][axis]) * face_area(units);
    let speed = if number > 0.0 {
        units.velocity_to_si(largest.sqrt())
    } else {
        f64::NAN
    };
    [
        discharge,
        units.velocity_to_si(u / number),
        units.velocity_to_si(v / number),
        units.velocity_to_si(w / number),
        units.density_deviation_to_pressure(deviation / number),
        speed,
        number / all,
    ]
}
