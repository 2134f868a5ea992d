//! Linear system of the pressures of the nodes and the velocities of the moving blocks.

use super::{ROTATION_PAIRS, System};
use crate::ldl::Factors;
use crate::motion::{FREEDOMS, LoadedCell, Mover};
use crate::network::{End, Network};
use crate::order::dissection;

/// Largest system whose unknowns are eliminated in the order of their degree.
const SMALL_SYSTEM: usize = 10_000;

/// Returns the pairs of unknowns with nonzero entries: those of the links, of the loaded cells of each block, and of
/// the rotations of each block.
fn pairs(network: &Network, movers: &[Mover], touches: &[LoadedCell]) -> Vec<[usize; 2]> {
    let nodes = network.nodes();
    let links = network.links.iter().filter_map(|link| match link.to {
        End::Node(to) => Some([link.from, to]),
        End::Open(_) => None,
    });
    let mut pairs: Vec<[usize; 2]> = links.collect();
    for touch in touches {
        let first = nodes + FREEDOMS * touch.mover;
        pairs.extend((first..first + FREEDOMS).map(|freedom| [touch.cell, freedom]));
    }
    for mover in 0..movers.len() {
        let first = nodes + FREEDOMS * mover;
        pairs.extend(ROTATION_PAIRS.map(|[a, b]| [first + a, first + b]));
    }
    pairs
}

/// Returns the analysis of the system of a network and its blocks with nonzero entries at `pairs`.
fn factors(network: &Network, movers: &[Mover], pairs: &[[usize; 2]]) -> Factors {
    let unknowns = network.nodes() + FREEDOMS * movers.len();
    if unknowns <= SMALL_SYSTEM {
        return Factors::new(unknowns, pairs);
    }
    let centroids = movers.iter().flat_map(|mover| [mover.centroid; FREEDOMS]);
    let positions: Vec<_> = network.positions.iter().copied().chain(centroids).collect();
    Factors::in_order(dissection(&positions, pairs), pairs)
}

impl System {
    /// Returns the system of a network and its moving blocks, without a matrix yet.
    pub(super) fn new(network: &Network, movers: &[Mover], touches: &[LoadedCell]) -> Self {
        let pairs = pairs(network, movers, touches);
        let unknowns = network.nodes() + FREEDOMS * movers.len();
        Self {
            factors: factors(network, movers, &pairs),
            factored: [vec![0.0; unknowns], vec![0.0; pairs.len()]],
            keeps: false,
            extra: 0,
            factorisations: 0,
            held: Vec::new(),
        }
    }
}
