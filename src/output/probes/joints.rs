//! Probes of the water in joints.

use super::Heading;
use coupling::joint_water::JointWater;
use nalgebra::Vector3;

/// Columns of a block.
pub(super) const BLOCK: [Heading; 15] = [
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

/// Returns pressure, aperture and position of the cell nearest to a point \[m\]; of equally near ones of the first.
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

/// Returns load, position and velocity of a block; no pressures for a block without a joint.
pub(super) fn block(water: &JointWater, block: usize) -> [f64; 15] {
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
