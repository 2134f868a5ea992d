//! A lattice over jointed rock: the water in joints thinner than a cell is a network, the water above it a lattice.
//!
//! The network meets the lattice at its mouths: open pieces of edges whose joint ends in front of a cell of water. In a
//! step the lattice moves first. The pressures of the cells at the mouths then drive the network, implicitly, as
//! constants of the step. The water that left a mouth enters its cell at the end of the step, without velocity, so that
//! the total mass of water is conserved to rounding; the momentum of the jet out of a joint is neglected.
//!
//! Both waters load a block. The lattice loads its surface at the links between its cells and cells of water; no such
//! link lies in a joint, because no cell has its centre there. The network loads the faces in joints. No part of a
//! surface has both loads.
//!
//! **Stability.** The discharge that a pressure makes in a step is bounded by the inertia of the water between the
//! mouth and the first cell of the joint. With an aperture `a` and half a cell of the joint `l` it changes the density
//! of its cell on the lattice by `a/(3 l)` of the one that made it, which the scene keeps well below 1.
//!
//! **Pressures** are those of the lattice. Where gravity does not act on its water they are the excess over
//! hydrostatic, in the joints as well, and the buoyancy of the whole block comes with the load of the lattice.

use crate::bounce_back::BounceBack;
use crate::joint_water::{JointWater, MouthAt};
use crate::lattice::LatticeFlow;
use crate::{Flow, FluidView};
use base::error::Error;
use base::number::{real, whole};
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;
use lbm::lanes::Stored;
use nalgebra::Vector3;

/// Bytes of a pressure that ranks exchange: index of the mouth, side of the joint, pressure.
const ROW: usize = 24;
/// Distance from a mouth of the two points, one on each side of its joint, where water is searched \[cells\].
const MOUTH_DISTANCE: f64 = 0.25;

/// Lattice with bodies, and the water in the joints between them.
pub struct Jointed<Sp: Space, S: Stored> {
    lattice: BounceBack<Sp, S>,
    joints: JointWater,
    /// Cell of the domain in front of each mouth, in the last step.
    cells: Vec<Option<[usize; 3]>>,
}

impl<Sp: Space, S: Stored> Jointed<Sp, S> {
    /// Combines a lattice and the water in joints.
    #[must_use]
    pub fn new(lattice: BounceBack<Sp, S>, joints: JointWater) -> Self {
        Self {
            lattice,
            joints,
            cells: Vec::new(),
        }
    }

    /// Returns the lattice.
    #[must_use]
    pub fn lattice(&self) -> &BounceBack<Sp, S> {
        &self.lattice
    }

    /// Returns the lattice, to set its state.
    pub fn lattice_mut(&mut self) -> &mut BounceBack<Sp, S> {
        &mut self.lattice
    }

    /// Returns the water in joints.
    #[must_use]
    pub fn joints(&self) -> &JointWater {
        &self.joints
    }

    /// Returns the water in joints, to move its blocks or to set its state.
    pub fn joints_mut(&mut self) -> &mut JointWater {
        &mut self.joints
    }

    /// Returns the cell of the domain that contains a point \[m\]; none outside the domain.
    fn cell_of_domain(&self, point: &Vector3<f64>) -> Option<[usize; 3]> {
        let fluid = LatticeFlow::fluid(&self.lattice);
        let (all, periodic) = (fluid.domain_cells(), fluid.periodic());
        let spacing = self.lattice.units().spacing;
        let mut cell = [0; 3];
        for axis in 0..3 {
            let length = real(all[axis]);
            let mut at = (point[axis] / spacing).floor();
            if periodic[axis] {
                at -= (at / length).floor() * length;
            }
            if !(at >= 0.0 && at < length) {
                return None;
            }
            cell[axis] = whole(at);
        }
        Some(cell)
    }

    /// Returns the coordinates in the slab of a cell of the domain, if the slab contains it.
    fn cell_of_slab(&self, cell: [usize; 3]) -> Option<[usize; 3]> {
        let (start, cells) = (self.lattice.start(), self.lattice.cells());
        let mut local = [0; 3];
        for axis in 0..3 {
            local[axis] = cell[axis].checked_sub(start[axis])?;
            if local[axis] >= cells[axis] {
                return None;
            }
        }
        Some(local)
    }

    /// Returns the two cells in front of a mouth, on both sides of its joint. The first of them that contains water
    /// counts.
    fn cells_before(&self, mouth: &MouthAt) -> [Option<[usize; 3]>; 2] {
        let spacing = self.lattice.units().spacing;
        let point = mouth.middle + mouth.outward * (0.5 * spacing);
        let beside = mouth.normal * (MOUTH_DISTANCE * spacing);
        [point + beside, point - beside].map(|point| self.cell_of_domain(&point))
    }

    /// Finds the cell of water in front of each mouth and returns its pressure \[Pa\]; none if there is no water.
    /// Collective.
    fn fronts(&mut self, domain: &Domain) -> Vec<Option<f64>> {
        let units = self.lattice.units();
        let mouths = self.joints.mouths_at();
        let mut bytes = Vec::new();
        for (number, mouth) in (0_u64..).zip(&mouths) {
            for (choice, cell) in (0_u64..).zip(self.cells_before(mouth)) {
                let Some(cell) = cell.and_then(|cell| self.cell_of_slab(cell)) else {
                    continue;
                };
                if !self.lattice.solid_at(cell) {
                    let (deviation, _) = self.lattice.state(cell);
                    let pressure = units.density_deviation_to_pressure(deviation);
                    for word in [number, choice, pressure.to_bits()] {
                        bytes.extend(word.to_le_bytes());
                    }
                }
            }
        }
        let mut found: Vec<Option<(u64, f64)>> = vec![None; mouths.len()];
        for message in domain.communicator().all_gather_bytes(&bytes) {
            for row in message.chunks_exact(ROW) {
                let word = |at: usize| {
                    let mut bytes = [0; 8];
                    bytes.copy_from_slice(&row[8 * at..8 * at + 8]);
                    u64::from_le_bytes(bytes)
                };
                let number = usize::try_from(word(0)).unwrap_or(usize::MAX);
                let Some(front) = found.get_mut(number) else {
                    continue;
                };
                if front.is_none_or(|(choice, _)| word(1) < choice) {
                    *front = Some((word(1), f64::from_bits(word(2))));
                }
            }
        }
        let cells = mouths.iter().zip(&found).map(|(mouth, front)| {
            let choice = usize::from(front.as_ref()?.0 > 0);
            self.cells_before(mouth)[choice]
        });
        self.cells = cells.collect();
        found.iter().map(|front| Some((*front)?.1)).collect()
    }

    /// Adds the water that left the joints in the last step to the cells in front of the mouths.
    fn return_water(&mut self) {
        let part = self.joints.density_ratio() / self.lattice.units().spacing.powi(3);
        for &(mouth, volume) in self.joints.returned() {
            let cell = self.cells.get(mouth).copied().flatten();
            let Some(cell) = cell.and_then(|cell| self.cell_of_slab(cell)) else {
                continue;
            };
            let populations = LatticeFlow::fluid_mut(&mut self.lattice).populations_mut();
            let cell = populations.interior_cell(cell);
            for i in 0..populations.velocities().q() {
                let weight = populations.velocities().w[i];
                let position = populations.incoming(cell, i);
                let number = &mut populations.numbers_mut()[position];
                *number = S::from_f64(number.to_f64() + weight * volume * part);
            }
        }
    }
}

impl<Sp: Space, S: Stored> Flow<Sp> for Jointed<Sp, S> {
    fn advance(&mut self, particles: &mut Particles<Sp>, domain: &Domain) -> Result<(), Error> {
        self.lattice.advance(particles, domain)?;
        let fronts = self.fronts(domain);
        self.joints.meet_lattice(fronts, particles, domain);
        self.joints.advance(particles, domain)
    }

    fn update_bodies(
        &mut self,
        particles: &mut Particles<Sp>,
        domain: &Domain,
    ) -> Result<(), Error> {
        self.return_water();
        self.lattice.update_bodies(particles, domain)
    }
}
