//! Water in joints under a lattice: pressures at its mouths, loads of the lattice, water that returns to the lattice.

use super::{JointWater, MouthAt};
use base::number::real;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;
use joints::takeover::TakenOver;
use nalgebra::Vector3;

/// Number of values of a block that ranks exchange: id, force, torque.
const NUMBERS: usize = 7;

impl JointWater {
    /// Returns the open pieces of edges, with the apertures at which the network was made.
    #[must_use]
    pub fn mouths_at(&self) -> Vec<MouthAt> {
        let network = self.flow.network();
        let mouth = |piece: &joints::edges::Piece| {
            let gap = &network.joints[piece.joint].gap;
            let aperture = gap
                .value(&piece.path[1])
                .max(network.settings.residual_aperture);
            MouthAt {
                middle: piece.middle,
                outward: piece.outward,
                normal: network.joints[piece.joint].normal,
                size: [aperture, piece.width],
            }
        };
        network.open.iter().map(mouth).collect()
    }

    /// Returns the time step of the lattice \[s\].
    #[must_use]
    pub fn lattice_step(&self) -> f64 {
        self.interval / real(self.lattice_steps())
    }

    /// Returns the id of a block of the network.
    #[must_use]
    pub fn id_of(&self, block: usize) -> u64 {
        self.first + block as u64
    }

    /// Returns the number of networks built so far; it increases when the network is rebuilt.
    #[must_use]
    pub fn networks(&self) -> u64 {
        self.networks
    }

    /// Returns the joints that the lattice takes over after this step, once.
    pub fn take_taken_over(&mut self) -> Vec<TakenOver> {
        std::mem::take(&mut self.taken)
    }

    /// Adds the volume of water in the cells that the lattice received from joints, minus that in the cells that joints
    /// took \[m³\]: of cells of water, and of cells in rock.
    pub fn add_cells(&mut self, [water, rock]: [f64; 2]) {
        self.balance.opened += water;
        self.balance.into_rock += rock;
    }

    /// Adds the loads of joints that the lattice takes over: they act until the next step.
    pub(super) fn add_taken_over(&mut self) {
        for joint in &self.taken {
            for (face, load) in joint.joint.faces.iter().zip(&joint.loads) {
                self.loads[face.rock].force += load.force;
                self.loads[face.rock].moment += load.moment;
            }
        }
    }

    /// Records the water that returns to the lattice. What an earlier step left at mouths that have closed waits there.
    pub(super) fn note_returned(&mut self) {
        let fronts = self.mouths.fronts.iter().flatten();
        let all = self.flow.passed().iter().zip(fronts).enumerate();
        let open = all.filter(|(_, (_, front))| front.is_some());
        let passed = open.map(|(mouth, (passed, _))| (mouth, *passed)).collect();
        for (mouth, volume) in std::mem::replace(&mut self.returned, passed) {
            if volume == 0.0 {
                continue;
            }
            match self.returned.binary_search_by_key(&mouth, |one| one.0) {
                Ok(at) => self.returned[at].1 += volume,
                Err(at) => self.returned.insert(at, (mouth, volume)),
            }
        }
    }

    /// Returns the water of vanished overlaps \[m³\] to the lattice, in equal parts through all mouths; without a mouth
    /// or a lattice it leaves the network.
    pub(super) fn release(&mut self, water: f64) {
        let mut open: Vec<usize> = (0..self.returned.len()).collect();
        open.retain(|at| self.window.is_open(self.returned[*at].0));
        if self.mouths.fronts.is_none() || open.is_empty() {
            self.balance.released += water;
            return;
        }
        for &at in &open {
            self.returned[at].1 += water / real(open.len());
        }
        self.balance.entered -= water;
    }

    /// Returns the density of the water with its air at atmospheric pressure divided by that of water without air.
    #[must_use]
    pub fn density_ratio(&self) -> f64 {
        1.0 - self.flow.settings().water.air
    }

    /// Adds the pressures in front of the mouths \[Pa\] with their increase per discharge out of the joint [Pa s/m³],
    /// and the loads of the lattice on all blocks, in a step of the lattice. Collective.
    pub fn meet_lattice<S: Space>(
        &mut self,
        (fronts, resistances): (Vec<Option<f64>>, Vec<f64>),
        particles: &Particles<S>,
        domain: &Domain,
    ) {
        self.mouths.resistances = resistances;
        let mut bytes = Vec::new();
        for k in 0..particles.owned() {
            let Some([force, torque]) = particles.block_fluid_load(k) else {
                continue;
            };
            bytes.extend(particles.body[k].id.to_le_bytes());
            for number in force.iter().chain(&torque) {
                bytes.extend(number.to_le_bytes());
            }
        }
        let mut loads = vec![[Vector3::zeros(); 2]; self.solids.len()];
        for message in domain.communicator().all_gather_bytes(&bytes) {
            for row in message.chunks_exact(8 * NUMBERS) {
                let word = |at: usize| {
                    let mut bytes = [0; 8];
                    bytes.copy_from_slice(&row[8 * at..8 * at + 8]);
                    bytes
                };
                let number = u64::from_le_bytes(word(0)).checked_sub(self.first);
                let number = number.and_then(|number| usize::try_from(number).ok());
                let Some(load) = number.and_then(|number| loads.get_mut(number)) else {
                    continue;
                };
                for axis in 0..3 {
                    load[0][axis] = f64::from_le_bytes(word(1 + axis));
                    load[1][axis] = f64::from_le_bytes(word(4 + axis));
                }
            }
        }
        if let Some((fronts, loads)) = self.window.add(fronts, loads) {
            self.mouths.fronts = Some(fronts);
            self.of_lattice = loads;
        }
    }
}
