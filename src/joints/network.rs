//! Network of joints as nodes and links: cells, junctions, and flow paths between them.
//!
//! Nodes are numbered by cells, joint after joint, then junctions. A link connects two nodes, or a cell with an
//! open piece of an edge. All numbers depend on the blocks only, in the order of their ids.

use crate::cells::{Cell, Side, divide};
use crate::edges::{Junction, Piece, ends};
use crate::pairs::{Joint, PairLimits, Rock, RockFace, joints, joints_after, joints_of};
use crate::sets::root;
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeSet;

/// Settings of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkSettings {
    /// Limits within which faces form a joint.
    pub limits: PairLimits,
    /// Minimum aperture for the conductivity and storage of a joint \[m\], which the roughness of its walls keeps open.
    pub residual_aperture: f64,
    /// Maximum size of a cell \[m\].
    pub cell: f64,
    /// Limits of the apertures if a lattice computes the water outside; none without a lattice.
    pub under: Option<UnderLattice>,
}

/// Aperture above which a joint occupies cells of a lattice \[cells\].
pub const WIDE_CELLS: f64 = 0.5;

/// Limits of the apertures of joints under a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnderLattice {
    /// Aperture above which a joint occupies cells of the lattice \[m\].
    pub wide: f64,
    /// Aperture above which the lattice takes over the water of a joint \[m\].
    pub takeover: f64,
}

/// Aperture below which a joint returns from the lattice to the network, divided by that of the takeover.
const RETURN: f64 = 0.75;

/// End of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Node, by its index.
    Node(usize),
    /// Open piece of an edge, by its index.
    Open(usize),
}

/// Flow path within a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Number of the joint.
    pub joint: usize,
    /// Cell at the start of the link.
    pub from: usize,
    /// End of the link.
    pub to: End,
    /// Start and end in the plane of the joint \[m\].
    pub path: [Vector2<f64>; 2],
    /// Width \[m\].
    pub width: f64,
    /// Length \[m\].
    pub length: f64,
}

/// Network of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// Settings of the network.
    pub settings: NetworkSettings,
    /// Joints, in the order of their faces.
    pub joints: Vec<Joint>,
    /// Cells of all joints.
    pub cells: Vec<Cell>,
    /// Joint of each cell.
    pub joint_of: Vec<usize>,
    /// Index of the first cell of each joint, and the number of all cells at the end.
    pub firsts: Vec<usize>,
    /// Junctions; their nodes follow the nodes of the cells.
    pub junctions: Vec<Junction>,
    /// Open pieces of edges.
    pub open: Vec<Piece>,
    /// Links of the network.
    pub links: Vec<Link>,
    /// Positions of the nodes \[m\].
    pub positions: Vec<Vector3<f64>>,
}

impl Network {
    /// Returns the network of these blocks.
    #[must_use]
    pub fn new(rocks: &[Rock], settings: &NetworkSettings) -> Self {
        Self::of_joints(joints(rocks, &settings.limits), settings)
    }

    /// Returns the network of blocks that have moved, and the joints that a lattice takes over. The known joints are
    /// kept as long as their faces overlap ([`joints_after`]). A joint that is wider than the limit has opened into the
    /// water outside, and is removed, if it meets no other joint or if one of its blocks moves and has no narrower
    /// joint: such a block has left its socket. Under a lattice joints are removed at the aperture of the takeover
    /// instead, and only joints that are narrower by a quarter are added.
    #[must_use]
    pub fn after(&self, rocks: &[Rock], moves: impl Fn(usize) -> bool) -> (Self, Vec<Joint>) {
        let mut limits = self.settings.limits;
        if let Some(under) = self.settings.under {
            limits.distance = limits.distance.min(RETURN * under.takeover);
        }
        let mut joints = joints_after(rocks, &limits, &self.pairs());
        if let Some(under) = self.settings.under {
            let wide = |joint: &Joint| joint.gap.constant > under.takeover;
            let left = joints.iter().filter(|joint| wide(joint)).cloned();
            let left = left.collect();
            joints.retain(|joint| !wide(joint));
            return (Self::of_joints(joints, &self.settings), left);
        }
        (self.without_opened(joints, moves), Vec::new())
    }

    /// Returns the network of joints without those that have opened into the water outside.
    fn without_opened(&self, joints: Vec<Joint>, moves: impl Fn(usize) -> bool) -> Self {
        let network = Self::of_joints(joints, &self.settings);
        let wide = |joint: &Joint| joint.gap.constant > self.settings.limits.distance;
        let mut open: Vec<bool> = network.joints.iter().map(wide).collect();
        let narrow = network.joints.iter().filter(|joint| !wide(joint));
        let held: BTreeSet<usize> = narrow.flat_map(|j| j.faces.map(|face| face.rock)).collect();
        let left = |joint: &Joint| {
            let rocks = joint.faces.iter().map(|face| face.rock);
            wide(joint)
                && rocks
                    .clone()
                    .any(|rock| moves(rock) && !held.contains(&rock))
        };
        for piece in network
            .junctions
            .iter()
            .flat_map(|junction| &junction.pieces)
        {
            open[piece.joint] &= left(&network.joints[piece.joint]);
        }
        if !open.contains(&true) {
            return network;
        }
        let mut open = open.into_iter();
        let mut joints = network.joints;
        joints.retain(|_| !open.next().unwrap_or(false));
        Self::of_joints(joints, &self.settings)
    }

    /// Returns the network of joints between these pairs of faces.
    #[must_use]
    pub fn of_pairs(rocks: &[Rock], pairs: &[[RockFace; 2]], settings: &NetworkSettings) -> Self {
        Self::of_joints(joints_of(rocks, pairs), settings)
    }

    /// Returns the two faces of each joint.
    #[must_use]
    pub fn pairs(&self) -> Vec<[RockFace; 2]> {
        self.joints.iter().map(|joint| joint.faces).collect()
    }

    fn of_joints(joints: Vec<Joint>, settings: &NetworkSettings) -> Self {
        let (mut cells, mut joint_of, mut firsts) = (Vec::new(), Vec::new(), vec![0]);
        for (number, joint) in joints.iter().enumerate() {
            cells.extend(divide(joint, settings.cell));
            joint_of.resize(cells.len(), number);
            firsts.push(cells.len());
        }
        let mut ends = ends(
            &joints,
            &cells,
            &firsts,
            &settings.limits,
            settings.residual_aperture,
        );
        if settings.under.is_none() {
            ends.open.retain(|piece| !piece.meets);
        }
        let mut positions: Vec<Vector3<f64>> = cells
            .iter()
            .zip(&joint_of)
            .map(|(cell, &joint)| joints[joint].point(&cell.point))
            .collect();
        positions.extend(ends.junctions.iter().map(|junction| junction.position));
        let mut links = links_between(&cells, &joint_of, &firsts);
        for (number, junction) in ends.junctions.iter().enumerate() {
            let node = End::Node(cells.len() + number);
            links.extend(junction.pieces.iter().map(|piece| half_link(piece, node)));
        }
        for (number, piece) in ends.open.iter().enumerate() {
            links.push(half_link(piece, End::Open(number)));
        }
        log::debug!(
            "network of {} joints: {} cells, {} junctions, {} open pieces of edges, {} links",
            joints.len(),
            cells.len(),
            ends.junctions.len(),
            ends.open.len(),
            links.len()
        );
        Self {
            settings: *settings,
            joints,
            cells,
            joint_of,
            firsts,
            junctions: ends.junctions,
            open: ends.open,
            links,
            positions,
        }
    }

    /// Returns the number of nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.positions.len()
    }

    /// Returns the connected part of the network that contains each node, identified by the index of its first node.
    #[must_use]
    pub fn parts(&self) -> Vec<usize> {
        let mut parents: Vec<usize> = (0..self.nodes()).collect();
        for link in &self.links {
            if let End::Node(to) = link.to {
                let (one, other) = (root(&mut parents, link.from), root(&mut parents, to));
                parents[one.max(other)] = one.min(other);
            }
        }
        (0..self.nodes())
            .map(|node| root(&mut parents, node))
            .collect()
    }
}

/// Returns the links between the cells of each joint.
fn links_between(cells: &[Cell], joint_of: &[usize], firsts: &[usize]) -> Vec<Link> {
    let mut links = Vec::new();
    for (from, cell) in cells.iter().enumerate() {
        let joint = joint_of[from];
        for (start, end, side) in cell.outline.edges() {
            let Side::Cell(other) = side else { continue };
            let to = firsts[joint] + other;
            if to < from {
                continue;
            }
            let step = cells[to].point - cell.point;
            let middle = 0.5 * (start + end);
            links.push(Link {
                joint,
                from,
                to: End::Node(to),
                // The path crosses the midpoint of the common edge.
                path: [middle - 0.5 * step, middle + 0.5 * step],
                width: (end - start).norm(),
                length: step.norm(),
            });
        }
    }
    links
}

/// Returns the link from a cell to a piece of an edge.
fn half_link(piece: &Piece, to: End) -> Link {
    Link {
        joint: piece.joint,
        from: piece.cell,
        to,
        path: piece.path,
        width: piece.width,
        length: (piece.path[1] - piece.path[0]).norm(),
    }
}
