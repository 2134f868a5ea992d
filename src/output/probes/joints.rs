//! Probes of the water in joints.

use super::Heading;
use coupling::joint_water::JointWater;
use nalgebra::Vector3;

/// Columns of the load on a block.
pub(super) const BLOCK: [Heading; 9] = [
    ("force_x", "N"),
    ("force_y", "N"),
    ("force_z", "N"),
    ("torque_x", "N m"),
    ("torque_y", "N m"),
    ("torque_z", "N m"),
    ("smallest_pressure", "Pa"),
    ("largest_pressure", "Pa"),
    ("area", "m2"),
];

/// Returns pressure, aperture and position of the cell nearest to a point \[m\]; of equally near cells the first.
pub(super) fn nearest(water: &JointWater, point: [f64; 3]) -> [f64; 5] {
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
    let aperture = gap.max(network.settings.residual);
    [flow.pressures()[cell], aperture, x, y, z]
}

/// Returns the load on a block; its pressures are NaN if the block has no joint.
pub(super) fn block(water: &JointWater, block: usize) -> [f64; 9] {
    let load = water.loads().get(block).copied().unwrap_or_default();
    let [low, high] = load
        .pressure
        .map(|p| if p.is_finite() { p } else { f64::NAN });
    let (force, moment) = (load.force, load.moment);
    [
        force.x, force.y, force.z, moment.x, moment.y, moment.z, low, high, load.area,
    ]
}
