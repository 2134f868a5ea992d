//! A new network for blocks that have moved, with the water of the old one.
//!
//! The overlap of a joint is that of the positions at which its network was made. Where blocks have slid or turned, the
//! network is made again: joints that are known stay, others come and go ([`crate::pairs::joints_after`]). Each new
//! cell takes the pressure of the nearest old cell of its joint, each link the discharges of the nearest old link of
//! its joint in its direction. The water of overlaps that are gone is then outside, and that of new ones came from
//! outside; the difference is returned, so that the sum is closed.

use super::JointFlow;
use crate::network::{End, Network};
use crate::pairs::{Rock, RockFace};
use crate::takeover::{Renewal, TakenOver};
use decomposition::ExactSum;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Minimum cosine between an old and a new link for the new one to inherit the discharges.
const ALONG: f64 = 0.7;

/// Old nodes or links by joint: position and number.
type Known = HashMap<[RockFace; 2], Vec<(Vector3<f64>, usize)>>;

/// Returns the index of the nearest of several positions; the first of equally near ones.
fn nearest(list: &[(Vector3<f64>, usize)], point: &Vector3<f64>) -> Option<usize> {
    let distance = |entry: &(Vector3<f64>, usize)| (entry.0 - point).norm_squared();
    let first = list.iter().min_by(|a, b| {
        let order = distance(a).total_cmp(&distance(b));
        order.then(a.1.cmp(&b.1))
    });
    first.map(|entry| entry.1)
}

/// Returns the middle of a link \[m\] and its unit direction in space.
fn axis(network: &Network, link: usize) -> (Vector3<f64>, Vector3<f64>) {
    let link = &network.links[link];
    let joint = &network.joints[link.joint];
    let [from, to] = link.path;
    let along = joint.direction(&(to - from));
    (joint.point(&(0.5 * (from + to))), along.normalize())
}

impl JointFlow {
    /// Rebuilds the network for the present positions of the blocks.
    pub fn renew(&mut self, rocks: &[Rock]) -> Renewal {
        self.move_to(rocks);
        let before = self.stored();
        let moves = |rock: usize| self.movers.iter().any(|mover| mover.rock == rock);
        let (network, left) = self.network.after(rocks, moves);
        let taken: Vec<TakenOver> = left
            .into_iter()
            .filter_map(|joint| self.taken_over(joint, rocks))
            .collect();
        let mut next = Self::with_movers(network, self.settings, self.movers.clone());
        next.set_positions(rocks);
        next.take_pressures(self);
        next.take_surplus(self);
        next.take_discharges(self);
        next.links.responses_of = None;
        let returned = next.returned_from_lattice(self);
        *self = next;
        let mut water = ExactSum::new();
        water.add(before);
        water.add(-self.stored());
        let mut exchanged = ExactSum::new();
        for joint in &taken {
            exchanged.add(joint.water);
        }
        exchanged.add(-returned);
        water.add(-exchanged.value());
        Renewal {
            water: water.value(),
            exchanged: exchanged.value(),
            taken,
        }
    }

    fn take_pressures(&mut self, old: &Self) {
        let mut by_joint = Known::new();
        let cells = old.network.cells.len();
        for cell in 0..cells {
            let faces = old.network.joints[old.network.joint_of[cell]].faces;
            let entry = (old.network.positions[cell], cell);
            by_joint.entry(faces).or_default().push(entry);
        }
        let all: Vec<_> = old.network.positions[..cells]
            .iter()
            .copied()
            .zip(0..)
            .collect();
        let ends: Vec<_> = old
            .network
            .positions
            .iter()
            .copied()
            .zip(0..)
            .skip(cells)
            .collect();
        for (node, point) in self.network.positions.iter().enumerate() {
            let own = self.network.joint_of.get(node);
            let list = match own {
                Some(&joint) => by_joint
                    .get(&self.network.joints[joint].faces)
                    .unwrap_or(&all),
                None if ends.is_empty() => &all,
                None => &ends,
            };
            if let Some(source) = nearest(list, point) {
                self.pressure[node] = old.pressure[source];
            }
        }
    }

    /// Distributes the surplus of each old joint over the cells of the new joint, by area.
    fn take_surplus(&mut self, old: &Self) {
        let mut sums: HashMap<[RockFace; 2], f64> = HashMap::new();
        for (cell, &joint) in old.network.joint_of.iter().enumerate() {
            let sum = sums.entry(old.network.joints[joint].faces).or_default();
            *sum += old.storage.surplus[cell];
        }
        for (number, joint) in self.network.joints.iter().enumerate() {
            let sum = sums.get(&joint.faces).copied().unwrap_or(0.0);
            let own = self.network.firsts[number]..self.network.firsts[number + 1];
            let (area, _) = joint.overlap.area_and_centroid();
            for cell in own {
                self.storage.surplus[cell] = sum * self.network.cells[cell].area / area;
            }
        }
    }

    fn take_discharges(&mut self, old: &Self) {
        let mut by_joint = Known::new();
        let axes: Vec<_> = (0..old.links.channels.len())
            .map(|link| axis(&old.network, link))
            .collect();
        for (number, link) in old.network.links.iter().enumerate() {
            let faces = old.network.joints[link.joint].faces;
            by_joint
                .entry(faces)
                .or_default()
                .push((axes[number].0, number));
        }
        let mut along = Vec::new();
        for (number, link) in self.network.links.iter().enumerate() {
            let Some(list) = by_joint.get(&self.network.joints[link.joint].faces) else {
                continue;
            };
            let (middle, direction) = axis(&self.network, number);
            let is_open = |link: usize, of: &Network| matches!(of.links[link].to, End::Open(_));
            along.clear();
            along.extend(list.iter().filter(|(_, old_link)| {
                axes[*old_link].1.dot(&direction).abs() >= ALONG
                    && is_open(*old_link, &old.network) == is_open(number, &self.network)
            }));
            let Some(source) = nearest(&along, &middle) else {
                continue;
            };
            let sign = axes[source].1.dot(&direction).signum();
            let part = sign * link.width / old.network.links[source].width;
            self.links.discharge[number] = part * old.links.discharge[source];
            if self.settings.inertia {
                self.links.mode[number] = old.links.mode[source].map(|mode| part * mode);
            }
        }
    }
}
