//! A lattice over jointed rock: the water in joints is a network, the water above it a lattice.
//!
//! The network meets the lattice at its mouths: open pieces of edges whose joint ends in front of cells of water. In a
//! step the lattice moves first. The pressures of the cells at the mouths then drive the network, implicitly, as
//! constants of the step. The water that left a mouth enters its cells at the end of the step, without velocity, so
//! that the total mass of water is conserved to rounding; the momentum of the jet out of a joint is neglected. A joint
//! of up to half a cell has one cell at a mouth. A wider one has all cells of water in front of the rectangle of its
//! mouth: their mean pressure counts, by the parts of the rectangle, and they receive the discharge in these parts.
//!
//! Both waters load a block. The lattice loads its surface at the links between its cells and cells of water. No such
//! link lies in a joint of the network: cells with their centres there are closed
//! ([`crate::body_map::BodyMap::set_joint_cells`]), so that no part of a surface has both loads. In joints wider than
//! half a cell the network also gives the friction of its discharge to both faces.
//!
//! **Takeover.** Where blocks move apart, the lattice takes over a joint at a stated aperture: its cells open, with the
//! pressure and the velocity that the network had there ([`joints::takeover`]). The lattice averages loads over two
//! half steps; the load of the network takes the part of the first, so that the force on a block has no
//! jump. The volume of the cells differs from that of the joint by the rounding of its faces to cells, and their
//! density follows the compressibility of the lattice: water that passes from one to the other is counted on both
//! sides, and the difference is reported. A joint that closes again returns to the network where it is narrower by a
//! quarter.
//!
//! **Stability.** In the norm in which the populations of a lattice lose energy (the sum of `f²/w` over the weights
//! `w`), a volume `V` that enters a cell of density deviation `p` gains it `V (p + V/2)` in lattice units. A network
//! that is driven by the pressure before the water enters gives this energy and receives `V p`: the difference acts as
//! a negative resistance, which friction exceeds in narrow joints alone. The pressure at wide mouths therefore has half
//! of the increase by the discharge of the end of the last step. What remains of the difference is the change of the
//! discharge in a step; it reduces the inertia of the water between a mouth and the first point of the joint, half a
//! cell `l` of the joint, by a quarter of `h/(3 l)` with cells `h` of the lattice. Cells of the joint of at least `h`
//! keep it positive.
//!
//! **Pressures** are those of the lattice. Where gravity does not act on its water they are the excess over
//! hydrostatic, in the joints as well, and the buoyancy of the whole block comes with the load of the lattice.

use crate::bounce_back::BounceBack;
use crate::joint_water::{JointWater, MouthAt};
use crate::lattice::LatticeFlow;
use crate::{Flow, FluidView};
use base::error::Error;
use base::number::{floor_i32, real, to_i32, whole};
use decomposition::{Domain, ExactSum};
use dem::particles::Particles;
use dem::space::Space;
use joints::cover::covers;
use joints::network::WIDE_CELLS;
use joints::takeover::TakenOver;
use lbm::lanes::Stored;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Bytes of a pressure that ranks exchange: index of the mouth, index of the cell at the mouth, pressure.
const ROW: usize = 24;
/// Distance from a mouth of the two points, one on each side of its joint, where water is searched \[cells\].
const MOUTH_DISTANCE: f64 = 0.25;
/// Points per cell, along each side of the rectangle of a mouth, at which cells of water are searched.
const POINTS_PER_CELL: f64 = 2.0;
/// Motion of a face between two networks, divided by the size of a cell of the joints, within which cells are closed.
const MARGIN: f64 = 0.15;

/// Cell outside every domain.
const OUTSIDE: [usize; 3] = [usize::MAX; 3];

/// Cell of the domain at a mouth, and the part of the mouth in front of it.
type MouthCell = ([usize; 3], f64);

/// Lattice with bodies, and the water in the joints between them.
pub struct Jointed<Sp: Space, S: Stored> {
    lattice: BounceBack<Sp, S>,
    joints: JointWater,
    /// Cells of water in front of each mouth, in the last step.
    cells: Vec<Vec<MouthCell>>,
    /// Number of the network whose cells are closed.
    closed_for: Option<u64>,
}

impl<Sp: Space, S: Stored> Jointed<Sp, S> {
    /// Combines a lattice and the water in joints.
    #[must_use]
    pub fn new(lattice: BounceBack<Sp, S>, joints: JointWater) -> Self {
        Self {
            lattice,
            joints,
            cells: Vec::new(),
            closed_for: None,
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

    /// Returns the cells in front of a mouth. At a narrow joint the first of two that contains water counts, one on
    /// each side of the joint; at a wide one all count that contain water.
    fn cells_before(&self, mouth: &MouthAt, to: &mut Vec<MouthCell>) {
        to.clear();
        let spacing = self.lattice.units().spacing;
        let point = mouth.middle + mouth.outward * (0.5 * spacing);
        let [aperture, width] = mouth.size;
        if aperture <= WIDE_CELLS * spacing {
            let beside = mouth.normal * (MOUTH_DISTANCE * spacing);
            let cells = [point + beside, point - beside];
            to.extend(cells.map(|point| (self.cell_of_domain(&point).unwrap_or(OUTSIDE), 1.0)));
            return;
        }
        let count = |length: f64| (POINTS_PER_CELL * length / spacing - 1e-6).ceil().max(2.0);
        let counts = [count(aperture), count(width)];
        let steps = [
            mouth.normal * (aperture / counts[0]),
            mouth.normal.cross(&mouth.outward) * (width / counts[1]),
        ];
        for row in 0..whole(counts[1]) {
            for column in 0..whole(counts[0]) {
                let at = [real(column), real(row)];
                let offsets: [Vector3<f64>; 2] =
                    std::array::from_fn(|k| steps[k] * (at[k] + 0.5 - 0.5 * counts[k]));
                let Some(cell) = self.cell_of_domain(&(point + offsets[0] + offsets[1])) else {
                    continue;
                };
                match to.iter_mut().find(|(known, _)| *known == cell) {
                    Some((_, points)) => *points += 1.0,
                    None => to.push((cell, 1.0)),
                }
            }
        }
    }

    /// Finds the cells of water in front of each mouth and returns their mean pressure \[Pa\]; none if there is no
    /// water. Collective.
    fn fronts(&mut self, domain: &Domain) -> Vec<Option<f64>> {
        let units = self.lattice.units();
        let mouths = self.joints.mouths_at();
        let mut bytes = Vec::new();
        let mut before = Vec::new();
        for (number, mouth) in (0_u64..).zip(&mouths) {
            self.cells_before(mouth, &mut before);
            for (choice, (cell, _)) in (0_u64..).zip(&before) {
                let Some(cell) = self.cell_of_slab(*cell) else {
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
        let mut found: Vec<Vec<(usize, f64)>> = vec![Vec::new(); mouths.len()];
        for message in domain.communicator().all_gather_bytes(&bytes) {
            for row in message.chunks_exact(ROW) {
                let word = |at: usize| {
                    let mut bytes = [0; 8];
                    bytes.copy_from_slice(&row[8 * at..8 * at + 8]);
                    u64::from_le_bytes(bytes)
                };
                let index = |at: usize| usize::try_from(word(at)).unwrap_or(usize::MAX);
                if let Some(front) = found.get_mut(index(0)) {
                    front.push((index(1), f64::from_bits(word(2))));
                }
            }
        }
        let spacing = self.lattice.units().spacing;
        let mut cells = std::mem::take(&mut self.cells);
        cells.resize_with(mouths.len(), Vec::new);
        let mut fronts = Vec::with_capacity(mouths.len());
        for ((mouth, found), cells) in mouths.iter().zip(&mut found).zip(&mut cells) {
            // The same order on any number of ranks.
            found.sort_unstable_by_key(|(choice, _)| *choice);
            if mouth.size[0] <= WIDE_CELLS * spacing {
                found.truncate(1);
            }
            self.cells_before(mouth, &mut before);
            cells.clear();
            cells.extend(found.iter().filter_map(|(choice, _)| before.get(*choice)));
            let points: f64 = cells.iter().map(|(_, points)| points).sum();
            let mut pressure = 0.0;
            for ((_, part), (_, found)) in cells.iter_mut().zip(&*found) {
                *part /= points;
                pressure += *part * found;
            }
            fronts.push((!cells.is_empty()).then_some(pressure));
        }
        self.cells = cells;
        self.add_half_of_discharge(&mouths, &mut fronts);
        fronts
    }

    /// Adds half of the increase of the pressure by the last discharge to the pressures at wide mouths.
    fn add_half_of_discharge(&self, mouths: &[MouthAt], fronts: &mut [Option<f64>]) {
        let units = self.lattice.units();
        let wide = |mouth: &MouthAt| mouth.size[0] > WIDE_CELLS * units.spacing;
        if !mouths.iter().any(wide) {
            return;
        }
        let outflows = self.joints.flow().outflows();
        let mut volumes: BTreeMap<[usize; 3], f64> = BTreeMap::new();
        for ((mouth, cells), outflow) in mouths.iter().zip(&self.cells).zip(&outflows) {
            for (cell, part) in cells.iter().filter(|_| wide(mouth)) {
                *volumes.entry(*cell).or_default() += part * outflow * self.joints.interval();
            }
        }
        let ratio = self.joints.density_ratio() / units.spacing.powi(3);
        let half = 0.5 * units.density_deviation_to_pressure(ratio);
        let all = mouths.iter().zip(&self.cells).zip(fronts);
        for ((_, cells), front) in all.filter(|((mouth, _), _)| wide(mouth)) {
            let Some(front) = front else { continue };
            for (cell, part) in cells {
                *front += part * half * volumes.get(cell).copied().unwrap_or(0.0);
            }
        }
    }

    /// Adds the water that left the joints in the last step to the cells in front of the mouths.
    fn return_water(&mut self) {
        let ratio = self.joints.density_ratio() / self.lattice.units().spacing.powi(3);
        for &(mouth, volume) in self.joints.returned() {
            let cells = self.cells.get(mouth);
            for &(cell, part) in cells.into_iter().flatten() {
                let Some(cell) = self.cell_of_slab(cell) else {
                    continue;
                };
                let populations = LatticeFlow::fluid_mut(&mut self.lattice).populations_mut();
                let cell = populations.interior_cell(cell);
                for i in 0..populations.velocities().q() {
                    let weight = populations.velocities().w[i];
                    let position = populations.incoming(cell, i);
                    let number = &mut populations.numbers_mut()[position];
                    *number = S::from_f64(number.to_f64() + weight * (volume * part) * ratio);
                }
            }
        }
    }

    /// Closes the cells in joints if the network was rebuilt.
    fn close_joints(&mut self) {
        if self.closed_for == Some(self.joints.networks()) {
            return;
        }
        self.closed_for = Some(self.joints.networks());
        let spacing = self.lattice.units().spacing;
        let start = self.lattice.start().map(to_i32);
        let network = self.joints.flow().network();
        let margin = MARGIN * network.settings.cell;
        let held: [[i32; 2]; 3] = std::array::from_fn(|axis| self.lattice.map().held_range(axis));
        let mut cells = Vec::new();
        for cover in covers(network) {
            let [low, high] = cover.bounds();
            let range = |axis: usize| {
                let cell = |at: f64| floor_i32(at / spacing).saturating_sub(start[axis]);
                let first = cell(low[axis] - margin).max(held[axis][0]);
                first
                    ..cell(high[axis] + margin)
                        .saturating_add(1)
                        .min(held[axis][1])
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let local = [x, y, z];
                        let at =
                            |axis: usize| (f64::from(local[axis] + start[axis]) + 0.5) * spacing;
                        let centre = Vector3::new(at(0), at(1), at(2));
                        if cover.contains(&centre, margin) {
                            cells.push(local);
                        }
                    }
                }
            }
        }
        self.lattice.map_mut().set_joint_cells(cells.into_iter());
    }

    /// Continues joints on the lattice with the water of the network, in the cells that have opened. Collective.
    fn take_over(
        &mut self,
        taken: &[TakenOver],
        closed: &[[usize; 3]],
        particles: &mut Particles<Sp>,
        domain: &Domain,
    ) {
        let units = *self.lattice.units();
        let start = self.lattice.start();
        let margin = MARGIN * self.joints.flow().network().settings.cell;
        let mut volume = ExactSum::new();
        for &cell in closed {
            if self.lattice.map().is_closed(cell) {
                continue;
            }
            let at = |axis: usize| (real(cell[axis] + start[axis]) + 0.5) * units.spacing;
            let point = Vector3::new(at(0), at(1), at(2));
            let mut holders = taken.iter();
            let Some(joint) = holders.find(|joint| joint.cover.contains(&point, margin)) else {
                continue;
            };
            let (pressure, velocity) = joint.state(&point);
            let deviation = pressure / units.density_deviation_to_pressure(1.0);
            let velocity = velocity.map(|v| units.velocity_to_lattice(v)).into();
            let fluid = LatticeFlow::fluid_mut(&mut self.lattice);
            let position = fluid.populations().interior_cell(cell);
            fluid.set_equilibrium(position, deviation, velocity);
            volume.add(units.spacing.powi(3));
            volume.add(deviation * units.spacing.powi(3));
        }
        volume.all_reduce(domain.communicator());
        self.joints.add_opened(volume.value());
        if !self.lattice.averages_loads() {
            return;
        }
        for k in 0..particles.owned() {
            for joint in taken {
                for (face, load) in joint.joint.faces.iter().zip(&joint.loads) {
                    if self.joints.id_of(face.rock) != particles.body[k].id {
                        continue;
                    }
                    for axis in 0..3 {
                        let (force, moment) = (load.force[axis], load.moment[axis]);
                        particles.extra[k][axis] += units.force_to_lattice(force);
                        particles.extra[k][3 + axis] += units.torque_to_lattice(moment);
                    }
                }
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
        self.close_joints();
        let taken = self.joints.take_taken_over();
        if taken.is_empty() {
            return self.lattice.update_bodies(particles, domain);
        }
        let closed: Vec<_> = self.lattice.map().closed_cells().collect();
        self.lattice.update_bodies(particles, domain)?;
        self.take_over(&taken, &closed, particles, domain);
        Ok(())
    }
}
