//! Gaps, volumes and channels of a network as its blocks move. Joints between blocks that do not move are left as they
//! are.

use super::JointFlow;
use crate::motion::{opening, touches};
use crate::network::Network;
use crate::pairs::{Rock, follow};
use crate::polygon::LinearField;
use nalgebra::Vector6;

/// Returns the joints of moving blocks, their links and their cells.
pub(super) fn moving(network: &Network, of_rock: &[Option<usize>]) -> [Vec<usize>; 3] {
    let moves = |rock: usize| of_rock.get(rock).copied().flatten().is_some();
    let of = |joint: usize| {
        network.joints[joint]
            .faces
            .iter()
            .any(|face| moves(face.rock))
    };
    let (links, cells) = (network.links.len(), network.cells.len());
    [
        (0..network.joints.len())
            .filter(|joint| of(*joint))
            .collect(),
        (0..links)
            .filter(|link| of(network.links[*link].joint))
            .collect(),
        (0..cells)
            .filter(|cell| of(network.joint_of[*cell]))
            .collect(),
    ]
}

impl JointFlow {
    /// Computes the volumes of the cells at the present gaps.
    pub(super) fn measure_volumes(&mut self) {
        for cell in 0..self.network.cells.len() {
            self.measure_volume(cell);
        }
    }

    /// Computes the volumes of a cell at the present gap.
    fn measure_volume(&mut self, number: usize) {
        let residual = self.network.settings.residual_aperture;
        let (cell, joint) = (&self.network.cells[number], self.network.joint_of[number]);
        let at = &cell.centroid;
        self.volumes[number] = cell.outline.integral_above(&self.gaps[joint], residual);
        self.fills[number] = cell.area * self.base_gaps[joint].value(at);
        // Apart, so that small displacements keep their digits.
        self.opened[number] = cell.area * self.openings[joint].value(at);
    }

    /// Updates the gap of a joint from the present displacements of its blocks.
    fn place_wall(&mut self, joint: usize) {
        let movers = (&self.movers[..], &self.of_rock[..]);
        let opening = opening(&self.network, joint, movers);
        let base = &self.base_gaps[joint];
        self.openings[joint] = opening;
        self.gaps[joint] = LinearField {
            constant: base.constant + opening.constant,
            slope: base.slope + opening.slope,
        };
    }

    /// Updates gaps, volumes and coefficients of the joints of moving blocks; those of other joints do not change.
    pub(super) fn place_moving_walls(&mut self) {
        let [joints, links, cells] = std::mem::take(&mut self.moving);
        joints.iter().for_each(|joint| self.place_wall(*joint));
        for &link in &links {
            self.channels[link] = self.channel(link);
        }
        cells.iter().for_each(|cell| self.measure_volume(*cell));
        self.moving = [joints, links, cells];
    }

    /// Updates gaps, volumes and coefficients from the present displacements of the blocks.
    pub(super) fn place_walls(&mut self) {
        for joint in 0..self.base_gaps.len() {
            self.place_wall(joint);
        }
        for link in 0..self.channels.len() {
            self.channels[link] = self.channel(link);
        }
        self.decays_of = None;
        self.measure_volumes();
    }

    /// Sets the positions of the blocks. Each node conserves its water: if the faces differ from the displacements
    /// of the last step, the pressure adjusts in the next step. Displacements are measured from these positions.
    pub fn move_to(&mut self, rocks: &[Rock]) {
        self.add_water(1.0);
        self.set_positions(rocks);
        self.add_water(-1.0);
    }

    /// Adds the water of the nodes, multiplied by a factor, to their surplus.
    fn add_water(&mut self, factor: f64) {
        for (number, surplus) in self.surplus.iter_mut().enumerate() {
            let (more, _) = self.settings.water.compression(self.pressure[number]);
            *surplus += factor * self.fills[number];
            *surplus += factor * self.opened[number];
            *surplus += factor * self.volumes[number] * more;
        }
    }

    /// Sets the positions of the blocks, from which displacements are measured, and with them volumes and channels.
    pub fn set_positions(&mut self, rocks: &[Rock]) {
        for (number, base) in self.base_gaps.iter_mut().enumerate() {
            *base = follow(&mut self.network.joints[number], rocks);
        }
        for mover in &mut self.movers {
            mover.displacement = Vector6::zeros();
            mover.centroid = rocks[mover.rock].position;
        }
        self.touches = touches(&self.network, &self.movers, &self.of_rock);
        self.place_walls();
    }
}
