//! Memory of a network and its flow, counted from the types.

use super::{CellSize, Channel, JointFlow, LinkResponse, LinkShape};
use crate::cells::{Cell, Side};
use crate::edges::{Junction, Piece};
use crate::motion::{LoadedCell, Mover};
use crate::network::Link;
use crate::pairs::Joint;
use nalgebra::{Vector2, Vector3, Vector6};
use std::mem::size_of;

/// Numbers of a node: position, volumes, pressure, and buffers of a step.
const NODE: usize = size_of::<Vector3<f64>>() + 12 * size_of::<f64>();

impl JointFlow {
    /// Returns the memory of the network and the flow \[bytes\], which every rank holds.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let network = &self.network;
        let corner = size_of::<(Vector2<f64>, Side)>();
        let corners = network
            .cells
            .iter()
            .map(|cell| cell.outline.corners().len());
        let overlaps = network
            .joints
            .iter()
            .map(|joint| joint.overlap.corners().len());
        let joined: usize = network.junctions.iter().map(|one| one.pieces.len()).sum();
        let geometry = network.joints.len() * size_of::<Joint>()
            + network.cells.len()
                * (size_of::<Cell>() + size_of::<usize>() + size_of::<CellSize>())
            + (corners.sum::<usize>() + overlaps.sum::<usize>()) * corner
            + network.junctions.len() * size_of::<Junction>()
            + (joined + network.open.len()) * size_of::<Piece>()
            + network.links.len() * size_of::<Link>();
        let link = size_of::<Channel>() + size_of::<LinkShape>() + 2 * size_of::<LinkResponse>();
        let link = link + 3 * size_of::<f64>();
        let modes = size_of_val(&self.links.mode[..]) + size_of_val(&self.links.turbulences[..]);
        let movers = self.movers.len() * (size_of::<Mover>() + 2 * size_of::<Vector6<f64>>());
        let touches = self.touches.len() * (size_of::<LoadedCell>() + 6 * size_of::<f64>());
        geometry
            + network.nodes() * NODE
            + network.links.len() * link
            + modes
            + movers
            + touches
            + self.system.factors.bytes()
            + self
                .system
                .factored
                .iter()
                .map(|part| size_of_val(&part[..]))
                .sum::<usize>()
    }

    /// Returns the number of entries of the factors below their diagonal.
    #[must_use]
    pub fn factor_entries(&self) -> usize {
        self.system.factors.entries()
    }
}
