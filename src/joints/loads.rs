//! Force and moment of the water of a network on the faces of its blocks.
//!
//! The pressure of a cell acts on its area on both faces, normal to the faces. Its work in a small motion of the
//! blocks is the pressure times the change of the cell's volume.

use crate::network::Network;
use nalgebra::Vector3;

/// Load of the water on a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RockLoad {
    /// Force \[N\].
    pub force: Vector3<f64>,
    /// Moment about the centroid of the block \[N m\].
    pub moment: Vector3<f64>,
    /// Area of its faces in joints \[m²\].
    pub area: f64,
    /// Smallest and largest gauge pressure on the block \[Pa\]; infinite without adjacent joints.
    pub pressure: [f64; 2],
}

/// Returns the loads on the blocks with these centroids \[m\], in the order of the blocks, at the pressures of the
/// nodes \[Pa\].
#[must_use]
pub fn loads(network: &Network, pressure: &[f64], centroids: &[Vector3<f64>]) -> Vec<RockLoad> {
    let none = RockLoad {
        pressure: [f64::INFINITY, f64::NEG_INFINITY],
        ..RockLoad::default()
    };
    let mut loads = vec![none; centroids.len()];
    let cells = network.cells.iter().zip(&network.joint_of);
    for ((cell, &joint), &pressure) in cells.zip(pressure) {
        let joint = &network.joints[joint];
        let centre = joint.point(&cell.centroid);
        for (face, tilt) in joint.faces.iter().zip(&joint.tilts) {
            let load = &mut loads[face.rock];
            let force = -tilt * (pressure * cell.area);
            load.force += force;
            load.moment += (centre - centroids[face.rock]).cross(&force);
            load.area += cell.area * tilt.norm();
            load.pressure = [
                load.pressure[0].min(pressure),
                load.pressure[1].max(pressure),
            ];
        }
    }
    loads
}
