//! Gaps, volumes and channels of a network as its blocks move. Joints between blocks that do not move are left as they
//! are.

use super::{CellSize, JointFlow};
use crate::cells::Cell;
use crate::motion::{Lever, Mover, arm};
use crate::network::Network;
use crate::pairs::{Rock, follow};
use crate::polygon::LinearField;
use nalgebra::Vector6;

/// Returns the cells of a network for the computation of their volumes.
pub(super) fn sizes(network: &Network) -> Vec<CellSize> {
    let size = |(cell, &joint): (&Cell, &usize)| {
        let corners = cell.outline.corners().iter();
        let distances = corners.map(|(corner, _)| (corner - cell.centroid).norm());
        CellSize {
            area: cell.area,
            centroid: cell.centroid,
            radius: distances.fold(0.0, f64::max),
            joint,
        }
    };
    network
        .cells
        .iter()
        .zip(&network.joint_of)
        .map(size)
        .collect()
}

/// Returns the joints of moving blocks and their cells, and `true` for each of their links.
pub(super) fn moving(network: &Network, of_rock: &[Option<usize>]) -> ([Vec<usize>; 2], Vec<bool>) {
    let moves = |rock: usize| of_rock.get(rock).copied().flatten().is_some();
    let of = |joint: usize| {
        network.joints[joint]
            .faces
            .iter()
            .any(|face| moves(face.rock))
    };
    let joints = (0..network.joints.len()).filter(|joint| of(*joint));
    let cells = (0..network.cells.len()).filter(|cell| of(network.joint_of[*cell]));
    let links = network.links.iter().map(|link| of(link.joint));
    ([joints.collect(), cells.collect()], links.collect())
}

/// Returns the levers of the blocks at both sides of a joint.
pub(super) fn levers_of(
    network: &Network,
    movers: (&[Mover], &[Option<usize>]),
    joint: usize,
) -> [Option<Lever>; 2] {
    [0, 1].map(|side| Lever::new(network, (joint, side), movers))
}

impl JointFlow {
    /// Computes the volumes of the cells at the present gaps.
    pub(super) fn measure_volumes(&mut self) {
        for cell in 0..self.sizes.len() {
            self.measure_fill(cell);
            self.measure_volume(cell);
        }
    }

    /// Computes the volume that follows the walls of a cell without the displacements of the blocks.
    fn measure_fill(&mut self, number: usize) {
        let size = &self.sizes[number];
        self.fills[number] = size.area * self.base_gaps[size.joint].value(&size.centroid);
    }

    /// Computes the volumes of a cell at the present gap.
    fn measure_volume(&mut self, number: usize) {
        let residual = self.network.settings.residual_aperture;
        let size = &self.sizes[number];
        let gap = &self.gaps[size.joint];
        let middle = gap.value(&size.centroid);
        // Clearly above the residual aperture everywhere, also after rounding.
        let open = middle - gap.slope.norm() * size.radius > residual * (1.0 + 1e-9);
        self.volumes[number] = if open {
            size.area * middle
        } else {
            let outline = &self.network.cells[number].outline;
            outline.integral_above(gap, residual)
        };
        // Apart, so that small displacements keep their digits.
        self.opened[number] = size.area * self.openings[size.joint].value(&size.centroid);
    }

    /// Updates the gap of a joint of moving blocks, by its number among them, from their present displacements.
    fn place_wall(&mut self, number: usize) {
        let joint = self.moving[0][number];
        let mut opening = LinearField::default();
        for lever in self.levers[number].iter().flatten() {
            lever.add(&self.movers, &mut opening);
        }
        let base = &self.base_gaps[joint];
        self.openings[joint] = opening;
        self.gaps[joint] = LinearField {
            constant: base.constant + opening.constant,
            slope: base.slope + opening.slope,
        };
    }

    /// Updates gaps, volumes and responses in a stage of the joints of moving blocks; those of other joints do not
    /// change.
    pub(super) fn place_moving_walls(&mut self, interval: f64) {
        (0..self.levers.len()).for_each(|number| self.place_wall(number));
        self.renew_answers(interval);
        let [joints, cells] = std::mem::take(&mut self.moving);
        cells.iter().for_each(|cell| self.measure_volume(*cell));
        self.moving = [joints, cells];
    }

    /// Updates gaps, volumes and coefficients from the present displacements of the blocks.
    pub(super) fn place_walls(&mut self) {
        self.gaps.copy_from_slice(&self.base_gaps);
        (0..self.levers.len()).for_each(|number| self.place_wall(number));
        for link in 0..self.channels.len() {
            self.set_channel(link);
        }
        self.responses_of = None;
        self.measure_volumes();
    }

    /// Sets the positions of the blocks. Each node conserves its water: if the faces differ from the displacements
    /// of the last step, the pressure adjusts in the next step. Displacements are measured from these positions.
    pub fn move_to(&mut self, rocks: &[Rock]) {
        self.place_blocks(rocks);
        (0..self.levers.len()).for_each(|number| self.place_wall(number));
        let [joints, cells] = std::mem::take(&mut self.moving);
        for &cell in &cells {
            let before = [self.fills[cell], self.opened[cell], self.volumes[cell]];
            self.measure_fill(cell);
            self.measure_volume(cell);
            let (more, _) = self.settings.water.compression(self.pressure[cell]);
            let [fill, opened, volume] = before;
            let moved = (fill - self.fills[cell]) + (opened - self.opened[cell]);
            self.surplus[cell] += moved + (volume - self.volumes[cell]) * more;
        }
        self.moving = [joints, cells];
    }

    /// Sets the positions of the moving blocks, from which displacements are measured, with the faces of their joints.
    fn place_blocks(&mut self, rocks: &[Rock]) {
        for &joint in &self.moving[0] {
            self.base_gaps[joint] = follow(&mut self.network.joints[joint], rocks);
        }
        for mover in &mut self.movers {
            mover.displacement = Vector6::zeros();
            mover.centroid = rocks[mover.rock].position;
        }
        let movers = (&self.movers[..], &self.of_rock[..]);
        for (levers, &joint) in self.levers.iter_mut().zip(&self.moving[0]) {
            *levers = levers_of(&self.network, movers, joint);
        }
        for touch in &mut self.touches {
            let centroid = &self.movers[touch.mover].centroid;
            touch.arm = arm(&self.network, (touch.cell, touch.side), centroid);
        }
    }

    /// Sets the positions of the blocks, from which displacements are measured, and with them volumes and channels.
    pub fn set_positions(&mut self, rocks: &[Rock]) {
        self.place_blocks(rocks);
        self.place_walls();
    }
}
