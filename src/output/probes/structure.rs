//! Force and torque of the water of a lattice on a structure.

use super::quantity::Quantity;
use super::{Heading, Rows, fluid};
use crate::grains::{force_unit, torque_unit};
use crate::view::StateView;
use base::error::Error;
use coupling::FluidView;
use coupling::loads::about_centre;
use dem::space::Space;
use lbm::links::Load;
use plan::scene::Scene;

/// Load on a structure.
#[derive(Debug)]
pub(super) struct StructureLoad {
    /// Index among the structures in contact with water.
    pub(super) index: usize,
    /// Point of the torque \[m\].
    pub(super) about: [f64; 3],
}

/// Returns the columns of a force and a torque of the fluid.
pub(super) fn load_headings(dimension: usize) -> Vec<Heading> {
    let (force, torque) = (force_unit(dimension), torque_unit(dimension));
    vec![
        ("fluid_force_x", force),
        ("fluid_force_y", force),
        ("fluid_force_z", force),
        ("fluid_torque_x", torque),
        ("fluid_torque_y", torque),
        ("fluid_torque_z", torque),
    ]
}

impl Quantity for StructureLoad {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        load_headings(scene.grid.dimension)
    }

    fn delay(&self) -> f64 {
        0.5
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = structure(view, fluid(view)?, self.index, self.about);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns the force and torque of the water on a structure in the last step, with the torque about a point \[m\].
fn structure<S: Space>(
    view: &StateView<S>,
    fluid: &dyn FluidView,
    index: usize,
    about: [f64; 3],
) -> [f64; 6] {
    let mine = fluid.structure_loads().get(index).copied();
    let communicator = view.domain.communicator();
    let load: Load = mine.unwrap_or([0; 6]).map(|part| {
        let sum = communicator.all_reduce_sum_u128(part.cast_unsigned());
        sum.cast_signed()
    });
    let units = fluid.units();
    let [x, y, z, a, b, c] = about_centre([0.0; 3], &load);
    let [x, y, z] = [x, y, z].map(|f| units.force_to_si(f));
    let [a, b, c] = [a, b, c].map(|m| units.torque_to_si(m));
    // A reference point at the corner of the domain leaves the bits unchanged.
    let [p, q, r] = about;
    [
        x,
        y,
        z,
        a - (q * z - r * y),
        b - (r * x - p * z),
        c - (p * y - q * x),
    ]
}
