//! Space that the water of a network occupies, on the lattice of another fluid: cells with their centres there belong
//! to the network.
//!
//! A cover is a prism over the overlap of a joint, as thick as its gap. Edges where joints meet end at the corner
//! between the joints, which belongs to neither overlap: the prism is longer there by the gaps of the other joints.
//! Open edges end where the water outside begins.

use crate::network::Network;
use crate::polygon::LinearField;
use nalgebra::{Vector2, Vector3};

/// Largest deviation of the direction of a piece from that of its edge.
const SAME_DIRECTION: f64 = 1e-6;

/// Space of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Cover {
    origin: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    normal: Vector3<f64>,
    gap: LinearField,
    /// Outward normal and offset of each edge, and `true` if water lies outside.
    edges: Vec<(Vector2<f64>, f64, bool)>,
    /// Lower and upper corner of a box around the space \[m\].
    bounds: [Vector3<f64>; 2],
}

impl Cover {
    /// Returns `true` if a point \[m\] lies in the space, or beyond its faces and edges by at most a margin \[m\];
    /// open edges have no margin.
    #[must_use]
    pub fn contains(&self, point: &Vector3<f64>, margin: f64) -> bool {
        let offset = point - self.origin;
        let flat = Vector2::new(self.axes[0].dot(&offset), self.axes[1].dot(&offset));
        let half = 0.5 * self.gap.value(&flat).max(0.0);
        self.normal.dot(&offset).abs() <= half + margin
            && self.edges.iter().all(|(outward, reach, open)| {
                let margin = if *open { 0.0 } else { margin };
                outward.dot(&flat) <= reach + margin
            })
    }

    /// Returns the lower and the upper corner of a box around the space \[m\], without a margin.
    #[must_use]
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        self.bounds
    }
}

/// Piece of an edge: its direction out of the joint, and the largest gap of the other joints that meet there \[m\];
/// none for a piece that is open.
type Ending = (Vector3<f64>, Option<f64>);

/// Returns the spaces of all joints of a network, in their order.
#[must_use]
pub fn covers(network: &Network) -> Vec<Cover> {
    let mut endings: Vec<Vec<Ending>> = vec![Vec::new(); network.joints.len()];
    // Where other joints meet, the space reaches to them.
    for piece in network.open.iter().filter(|piece| !piece.meets) {
        endings[piece.joint].push((piece.outward, None));
    }
    for junction in &network.junctions {
        for piece in &junction.pieces {
            let others = junction.pieces.iter().filter(|p| p.joint != piece.joint);
            let gaps = others.map(|other| widest(network, other.joint));
            endings[piece.joint].push((piece.outward, Some(gaps.fold(0.0, f64::max))));
        }
    }
    let joints = endings.iter().enumerate();
    joints
        .map(|(joint, endings)| cover(network, joint, endings))
        .collect()
}

/// Returns the largest gap of a joint \[m\].
fn widest(network: &Network, joint: usize) -> f64 {
    let joint = &network.joints[joint];
    let corners = joint.overlap.corners().iter();
    let gaps = corners.map(|(corner, _)| joint.gap.value(corner));
    gaps.fold(network.settings.residual_aperture, f64::max)
}

fn cover(network: &Network, number: usize, endings: &[Ending]) -> Cover {
    let joint = &network.joints[number];
    let mut edges = Vec::new();
    let mut most = 0.0_f64;
    for (from, to, _) in joint.overlap.edges() {
        let step = (to - from).normalize();
        let outward = Vector2::new(step.y, -step.x);
        let direction = joint.direction(&outward);
        let own = endings.iter();
        let own = own.filter(|(along, _)| direction.dot(along) > 1.0 - SAME_DIRECTION);
        // An edge that is open in part ends where it is.
        let reaches: Option<Vec<f64>> = own.map(|(_, reach)| *reach).collect();
        let reach = reaches.map(|reaches| reaches.into_iter().fold(0.0, f64::max));
        most = most.max(reach.unwrap_or(0.0));
        let offset = outward.dot(&from) + reach.unwrap_or(0.0);
        edges.push((outward, offset, reach.is_none()));
    }
    let corners = joint.overlap.corners().iter();
    let corners = corners.map(|(corner, _)| joint.point(corner));
    let [low, high] = corners.fold([joint.origin; 2], |[low, high], corner| {
        [low.inf(&corner), high.sup(&corner)]
    });
    // Corners of at least 30 degrees move at most four times as far as their edges.
    let more = 4.0 * most + 0.5 * widest(network, number);
    Cover {
        origin: joint.origin,
        axes: joint.axes,
        normal: joint.normal,
        gap: joint.gap,
        edges,
        bounds: [low.add_scalar(-more), high.add_scalar(more)],
    }
}
