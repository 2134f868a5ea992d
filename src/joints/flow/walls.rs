//! Gaps, volumes and channels of a network as its blocks move. Joints between blocks that do not move are left as they
//! are.
//!
//! Volumes and gaps follow every motion, the channels of the links one that exceeds the part [`FOLLOWED`] of the
//! aperture: the discharge is off by at most three times this part.

use super::{CellSize, GAP, JointFlow, Storage, Walls};
use crate::cells::Cell;
use crate::motion::{Lever, Mover, arm};
use crate::network::Network;
use crate::pairs::{Rock, follow};
use crate::polygon::LinearField;
use nalgebra::{Vector2, Vector6};

/// Change of a gap, as a part of the smallest aperture of its joint, within which the channels stay as they are.
const FOLLOWED: f64 = 1e-5;

/// Returns the cells of a network for the computation of their volumes.
fn sizes(network: &Network) -> Vec<CellSize> {
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

/// Returns the joints of moving blocks and their cells.
fn moving(network: &Network, of_rock: &[Option<usize>]) -> [Vec<usize>; 2] {
    let moves = |rock: usize| of_rock.get(rock).copied().flatten().is_some();
    let of = |joint: usize| {
        network.joints[joint]
            .faces
            .iter()
            .any(|face| moves(face.rock))
    };
    let joints = (0..network.joints.len()).filter(|joint| of(*joint));
    let cells = (0..network.cells.len()).filter(|cell| of(network.joint_of[*cell]));
    [joints.collect(), cells.collect()]
}

/// Returns the levers of the blocks at both sides of a joint.
fn levers_of(
    network: &Network,
    movers: (&[Mover], &[Option<usize>]),
    joint: usize,
) -> [Option<Lever>; 2] {
    [0, 1].map(|side| Lever::new(network, (joint, side), movers))
}

impl Walls {
    /// Returns the gaps of a network; `of_rock` is the mover of each block.
    pub(super) fn new(network: &Network, movers: &[Mover], of_rock: Vec<Option<usize>>) -> Self {
        let gaps: Vec<LinearField> = network.joints.iter().map(|joint| joint.gap).collect();
        let moving = moving(network, &of_rock);
        let levers = |joint: &usize| levers_of(network, (movers, &of_rock), *joint);
        let levers = moving[0].iter().map(levers).collect();
        let reach = |joint: &usize| network.joints[*joint].overlap.reach();
        let reaches = moving[0].iter().map(reach).collect();
        Self {
            base_gaps: gaps.clone(),
            followed: gaps.clone(),
            renews: vec![false; gaps.len()],
            openings: vec![LinearField::default(); gaps.len()],
            gaps,
            of_rock,
            moving,
            levers,
            reaches,
        }
    }
}

impl Storage {
    /// Returns the cells of a network, whose volumes are measured later.
    pub(super) fn new(network: &Network) -> Self {
        let nodes = network.nodes();
        Self {
            sizes: sizes(network),
            volumes: vec![0.0; nodes],
            fills: vec![0.0; nodes],
            opened: vec![0.0; nodes],
            surplus: vec![0.0; nodes],
        }
    }
}

impl JointFlow {
    /// Computes the volumes of the cells at the present gaps.
    pub(super) fn measure_volumes(&mut self) {
        for cell in 0..self.storage.sizes.len() {
            self.measure_fill(cell);
            self.measure_volume(cell);
        }
    }

    /// Computes the volume that follows the walls of a cell without the displacements of the blocks.
    fn measure_fill(&mut self, number: usize) {
        let size = &self.storage.sizes[number];
        self.storage.fills[number] =
            size.area * self.walls.base_gaps[size.joint].value(&size.centroid);
    }

    /// Computes the volumes of a cell at the present gap.
    fn measure_volume(&mut self, number: usize) {
        let residual = self.network.settings.residual_aperture;
        let size = &self.storage.sizes[number];
        let gap = &self.walls.gaps[size.joint];
        let middle = gap.value(&size.centroid);
        // Clearly above the residual aperture everywhere, also after rounding.
        let open = middle - gap.slope.norm() * size.radius > residual * (1.0 + 1e-9);
        self.storage.volumes[number] = if open {
            size.area * middle
        } else {
            let outline = &self.network.cells[number].outline;
            outline.integral_above(gap, residual)
        };
        // Apart, so that small displacements keep their digits.
        self.storage.opened[number] =
            size.area * self.walls.openings[size.joint].value(&size.centroid);
    }

    /// Updates the gap of a joint of moving blocks, by its number among them, from their present displacements.
    fn place_wall(&mut self, number: usize) {
        let joint = self.walls.moving[0][number];
        let mut opening = LinearField::default();
        for lever in self.walls.levers[number].iter().flatten() {
            lever.add(&self.movers, &mut opening);
        }
        let base = &self.walls.base_gaps[joint];
        self.walls.openings[joint] = opening;
        self.walls.gaps[joint] = LinearField {
            constant: base.constant + opening.constant,
            slope: base.slope + opening.slope,
        };
    }

    /// Returns `true` if the gap of a joint of moving blocks, by its number among them, is no longer that of its
    /// channels.
    fn has_moved(&self, number: usize) -> bool {
        let (joint, reach) = (self.walls.moving[0][number], self.walls.reaches[number]);
        let (now, followed) = (&self.walls.gaps[joint], &self.walls.followed[joint]);
        let turned = (now.slope - followed.slope).norm() * reach;
        let smallest = followed.constant - followed.slope.norm() * reach;
        let smallest = smallest.max(self.network.settings.residual_aperture);
        (now.constant - followed.constant).abs() + turned > FOLLOWED * smallest
    }

    /// Restores the gaps of the channels in joints of moving blocks.
    pub(super) fn restore_channels(&mut self, gaps: &[f64]) {
        let joints = self.walls.moving[0].iter();
        for (&joint, gap) in joints.zip(gaps.chunks_exact(GAP)) {
            self.walls.followed[joint] = LinearField {
                constant: gap[0],
                slope: Vector2::new(gap[1], gap[2]),
            };
        }
        (0..self.links.channels.len()).for_each(|link| self.set_channel(link));
    }

    /// Updates gaps, volumes and responses in a stage of the joints of moving blocks; those of other joints do not
    /// change.
    pub(super) fn place_moving_walls(&mut self, interval: f64) {
        let mut any = false;
        for number in 0..self.walls.levers.len() {
            self.place_wall(number);
            let joint = self.walls.moving[0][number];
            let moved = self.has_moved(number);
            self.walls.renews[joint] = moved;
            if moved {
                self.walls.followed[joint] = self.walls.gaps[joint];
                any = true;
            }
        }
        if any {
            self.renew_answers(interval);
        }
        let [joints, cells] = std::mem::take(&mut self.walls.moving);
        cells.iter().for_each(|cell| self.measure_volume(*cell));
        self.walls.moving = [joints, cells];
    }

    /// Updates gaps, volumes and coefficients from the present displacements of the blocks.
    pub(super) fn place_walls(&mut self) {
        self.walls.gaps.copy_from_slice(&self.walls.base_gaps);
        (0..self.walls.levers.len()).for_each(|number| self.place_wall(number));
        self.walls.followed.copy_from_slice(&self.walls.gaps);
        (0..self.links.channels.len()).for_each(|link| self.set_channel(link));
        self.links.responses_of = None;
        self.measure_volumes();
    }

    /// Sets the positions of the blocks. Each node conserves its water: if the faces differ from the displacements
    /// of the last step, the pressure adjusts in the next step. Displacements are measured from these positions.
    pub fn move_to(&mut self, rocks: &[Rock]) {
        self.place_blocks(rocks);
        (0..self.walls.levers.len()).for_each(|number| self.place_wall(number));
        let [joints, cells] = std::mem::take(&mut self.walls.moving);
        for &cell in &cells {
            let before = [
                self.storage.fills[cell],
                self.storage.opened[cell],
                self.storage.volumes[cell],
            ];
            self.measure_fill(cell);
            self.measure_volume(cell);
            let (more, _) = self.settings.water.compression(self.pressure[cell]);
            let [fill, opened, volume] = before;
            let moved = (fill - self.storage.fills[cell]) + (opened - self.storage.opened[cell]);
            self.storage.surplus[cell] += moved + (volume - self.storage.volumes[cell]) * more;
        }
        self.walls.moving = [joints, cells];
    }

    /// Sets the positions of the moving blocks, from which displacements are measured, with the faces of their joints.
    fn place_blocks(&mut self, rocks: &[Rock]) {
        for &joint in &self.walls.moving[0] {
            self.walls.base_gaps[joint] = follow(&mut self.network.joints[joint], rocks);
        }
        for mover in &mut self.movers {
            mover.displacement = Vector6::zeros();
            mover.centroid = rocks[mover.rock].position;
        }
        let movers = (&self.movers[..], &self.walls.of_rock[..]);
        for (levers, &joint) in self.walls.levers.iter_mut().zip(&self.walls.moving[0]) {
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
