//! Probes of the water in joints.

use super::quantity::Quantity;
use super::{Heading, POSITION, Rows, no_fluid};
use crate::view::StateView;
use base::error::Error;
use coupling::joint_water::JointWater;
use dem::space::Space;
use nalgebra::Vector3;
use plan::scene::Scene;

/// The cell of a joint that is nearest to a point \[m\].
#[derive(Debug)]
pub(super) struct JointCell(pub(super) [f64; 3]);

impl Quantity for JointCell {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        [
            [("pressure", "Pa"), ("aperture", "m")].as_slice(),
            &POSITION,
        ]
        .concat()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = nearest(water(view)?, self.0);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Mouth of the joints, by its index.
#[derive(Debug)]
pub(super) struct Mouth(pub(super) usize);

impl Quantity for Mouth {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        vec![("inflow", "m3/s"), ("pressure", "Pa")]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = water(view)?.mouth(self.0);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Load of the water in the joints on a block, by its index.
#[derive(Debug)]
pub(super) struct BlockLoad(pub(super) usize);

impl Quantity for BlockLoad {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        BLOCK.to_vec()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = block(water(view)?, self.0);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns the water in the joints of a scene that has it.
fn water<'a, S: Space>(view: &StateView<'a, S>) -> Result<&'a JointWater, Error> {
    view.joints.ok_or_else(no_fluid)
}

/// Columns of the load on a block.
const BLOCK: [Heading; 15] = [
    ("force_x", "N"),
    ("force_y", "N"),
    ("force_z", "N"),
    ("torque_x", "N m"),
    ("torque_y", "N m"),
    ("torque_z", "N m"),
    ("smallest_pressure", "Pa"),
    ("largest_pressure", "Pa"),
    ("area", "m2"),
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("velocity_x", "m/s"),
    ("velocity_y", "m/s"),
    ("velocity_z", "m/s"),
];

/// Returns pressure, aperture and position of the cell nearest to a point \[m\]; of equally near cells the first.
fn nearest(water: &JointWater, point: [f64; 3]) -> [f64; 5] {
    let flow = water.flow();
    let network = flow.network();
    let point = Vector3::from(point);
    let distances = network.positions[..network.cells.len()].iter();
    let distances = distances.map(|position| (position - point).norm_squared());
    let nearest = distances
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let Some((cell, _)) = nearest else {
        return [f64::NAN; 5];
    };
    let joint = network.joint_of[cell];
    let gap = flow.gaps()[joint].value(&network.cells[cell].point);
    let [x, y, z] = network.positions[cell].into();
    let aperture = gap.max(network.settings.residual_aperture);
    [flow.pressures()[cell], aperture, x, y, z]
}

/// Returns load, position and velocity of a block; its pressures are NaN if the block has no joint.
fn block(water: &JointWater, block: usize) -> [f64; 15] {
    let load = water.loads().get(block).copied().unwrap_or_default();
    let [low, high] = load
        .pressure
        .map(|p| if p.is_finite() { p } else { f64::NAN });
    let (force, moment) = (load.force, load.moment);
    let [[x, y, z], [u, v, w]] = water.motion(block).map(Into::into);
    let (force, moment): ([f64; 3], [f64; 3]) = (force.into(), moment.into());
    let ([fx, fy, fz], [mx, my, mz]) = (force, moment);
    [
        fx, fy, fz, mx, my, mz, low, high, load.area, x, y, z, u, v, w,
    ]
}
