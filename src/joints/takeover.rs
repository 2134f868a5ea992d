//! Joints that have opened so far that a lattice takes over their water.
//!
//! The lattice continues from the pressures and discharges of the network. In a cell of the network the pressure is a
//! linear function of the position, fitted to the pressures at the ends of its links, and the flux is that of its
//! links. Across the aperture the velocity along the faces has the profile of laminar flow; between two faces that move
//! apart it goes from the velocity of one to that of the other.

use crate::cover::{Cover, covers};
use crate::flow::JointFlow;
use crate::loads::{RockLoad, add_wide_loads};
use crate::network::End;
use crate::pairs::{Joint, Rock};
use decomposition::ExactSum;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Result of a new network for blocks that have moved.
#[derive(Clone, Debug, Default)]
pub struct Renewal {
    /// Volume of water that is no longer in the network because overlaps have changed, at the density of atmospheric
    /// pressure \[m³\]; negative if the network has gained water.
    pub water: f64,
    /// Volume of water that passed to the lattice with whole joints, minus that which returned \[m³\].
    pub exchanged: f64,
    /// Joints that the lattice takes over.
    pub taken: Vec<TakenOver>,
}

/// Water at the point of a cell of a joint.
#[derive(Clone, Debug, PartialEq)]
struct LocalWater {
    /// Position \[m\].
    position: Vector3<f64>,
    /// Pressure \[Pa\] and its gradient [Pa/m].
    pressure: f64,
    gradient: Vector3<f64>,
    /// Discharge per width [m²/s].
    flux: Vector3<f64>,
}

/// Motion of a block: centroid \[m\], velocity [m/s], rotation rate [rad/s].
type Motion = [Vector3<f64>; 3];

/// Sums over the links of a cell: products of their directions, differences of pressure per length, discharges per
/// width.
type LinkSums = (Matrix2<f64>, Vector2<f64>, Vector2<f64>);

/// Joint that a lattice takes over.
#[derive(Clone, Debug, PartialEq)]
pub struct TakenOver {
    /// Joint at the present positions of its blocks.
    pub joint: Joint,
    /// Space that the network had occupied.
    pub cover: Cover,
    /// Volume of water at the density of atmospheric pressure \[m³\].
    pub water: f64,
    /// Last loads of the water on both blocks.
    pub loads: [RockLoad; 2],
    cells: Vec<LocalWater>,
    motions: [Motion; 2],
}

impl TakenOver {
    /// Returns pressure \[Pa\] and velocity [m/s] at a point \[m\].
    #[must_use]
    pub fn state(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let distance = |cell: &&LocalWater| (cell.position - point).norm_squared();
        let nearest = self
            .cells
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let Some(cell) = nearest else {
            return (0.0, Vector3::zeros());
        };
        let joint = &self.joint;
        let offset = point - joint.origin;
        let flat = Vector2::new(joint.axes[0].dot(&offset), joint.axes[1].dot(&offset));
        let gap = joint.gap.value(&flat).max(f64::MIN_POSITIVE);
        // Fraction of the way from the first face to the second.
        let part = (joint.normal.dot(&offset) / gap + 0.5).clamp(0.0, 1.0);
        let wall = |[centroid, velocity, rate]: &Motion| velocity + rate.cross(&(point - centroid));
        let [first, second] = [wall(&self.motions[0]), wall(&self.motions[1])];
        let profile = 6.0 * part * (1.0 - part) / gap;
        let velocity = first * (1.0 - part) + second * part + cell.flux * profile;
        let pressure = cell.pressure + cell.gradient.dot(&(point - cell.position));
        (pressure, velocity)
    }
}

impl JointFlow {
    /// Returns the volume of water in the cells of a joint at the density of atmospheric pressure \[m³\].
    fn stored_in(&self, joint: usize) -> f64 {
        let network = self.network();
        let mut sum = ExactSum::new();
        for cell in network.firsts[joint]..network.firsts[joint + 1] {
            for part in self.stored_at(cell) {
                sum.add(part);
            }
        }
        sum.value()
    }

    /// Returns the water in wide joints that another network does not have, which comes from the lattice \[m³\].
    pub(crate) fn returned_from_lattice(&self, old: &Self) -> f64 {
        let network = self.network();
        let Some(under) = network.settings.under else {
            return 0.0;
        };
        let known = old.network().pairs();
        let mut sum = ExactSum::new();
        for (number, joint) in network.joints.iter().enumerate() {
            if joint.gap.constant > under.wide && known.binary_search(&joint.faces).is_err() {
                sum.add(self.stored_in(number));
            }
        }
        sum.value()
    }

    /// Returns the water of a joint of this network in its present position `joint`; none if the network does not have
    /// it.
    pub(crate) fn taken_over(&self, joint: Joint, rocks: &[Rock]) -> Option<TakenOver> {
        let network = self.network();
        let number = network
            .joints
            .iter()
            .position(|known| known.faces == joint.faces)?;
        let cells = network.firsts[number]..network.firsts[number + 1];
        let waters = self.local_waters(number, cells.clone());
        let centroids: Vec<_> = rocks.iter().map(|rock| rock.position).collect();
        let mut all = vec![RockLoad::default(); rocks.len()];
        let front = |piece: usize| self.front(piece);
        add_wide_loads(self, Some(number), front, &centroids, &mut all);
        let old = &network.joints[number];
        for cell in cells {
            let centroid = &network.cells[cell].centroid;
            let pressure = self.pressures()[cell] * network.cells[cell].area;
            for (side, (face, tilt)) in old.faces.iter().zip(&old.tilts).enumerate() {
                let centre = old.face_point(side, centroid);
                let force = -tilt * pressure;
                all[face.rock].add(&force, &(centre - centroids[face.rock]));
            }
        }
        let motion = |rock: usize| {
            let mover = self.movers().iter().find(|mover| mover.rock == rock);
            let [velocity, rate] = mover.map_or([Vector3::zeros(); 2], |mover| {
                [0, 3].map(|first| mover.velocity.fixed_rows::<3>(first).into())
            });
            [rocks[rock].position, velocity, rate]
        };
        Some(TakenOver {
            cover: covers(network).swap_remove(number),
            water: self.stored_in(number),
            loads: old.faces.map(|face| all[face.rock]),
            cells: waters,
            motions: joint.faces.map(|face| motion(face.rock)),
            joint,
        })
    }

    /// Returns pressure, gradient and flux in the cells of a joint.
    fn local_waters(&self, joint: usize, cells: std::ops::Range<usize>) -> Vec<LocalWater> {
        let network = self.network();
        let first = cells.start;
        let mut sums = vec![LinkSums::default(); cells.len()];
        for (number, link) in network.links.iter().enumerate() {
            if link.joint != joint {
                continue;
            }
            let along = (link.path[1] - link.path[0]) / link.length;
            let rise = self.rise(number).map(|rise| rise / link.length);
            let flux = self.discharges()[number] / link.width;
            let mut add = |cell: usize| {
                if let Some(rise) = rise {
                    let (matrix, gradient, fluxes) = &mut sums[cell - first];
                    *matrix += along * along.transpose();
                    *gradient += along * rise;
                    *fluxes += along * flux;
                }
            };
            add(link.from);
            match link.to {
                End::Node(to) if cells.contains(&to) => add(to),
                _ => {}
            }
        }
        let known = &network.joints[joint];
        let water = |(cell, (matrix, gradient, flux)): (usize, &LinkSums)| {
            // In a direction without links there is neither gradient nor flux.
            let least = Matrix2::identity() * SINGULAR;
            let inverse = (matrix + least).try_inverse().unwrap_or_default();
            LocalWater {
                position: network.positions[cell],
                pressure: self.pressures()[cell],
                gradient: known.direction(&(inverse * gradient)),
                flux: known.direction(&(inverse * flux)),
            }
        };
        cells.zip(&sums).map(water).collect()
    }
}

/// Smallest eigenvalue of the directions of the links of a cell.
const SINGULAR: f64 = 1e-9;
