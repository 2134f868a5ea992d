//! A lattice over jointed rock: the water in joints is a network, the water above it a lattice.
//!
//! The network meets the lattice at its mouths: open pieces of edges whose joint ends in front of cells of water. In a
//! step the lattice moves first. The pressures of the cells at the mouths then drive the network, implicitly, as
//! constants of the step. The water that left a mouth enters the lattice at the end of the step, so that the total mass
//! of water is conserved to rounding. At a mouth with closed cells behind it, it enters through the links into these
//! cells, with its velocity, and the pressure is that on the mouth (`mouth_links`). A joint thinner than a cell has no
//! closed cells: its water enters the cell in front of its mouth without velocity, and the pressure is that of the cell
//! (`mouths`). The error of this pressure, the normal stress of the divergence, is `a³/(4 l h²)` of that along a joint
//! of the aperture a and the length l on cells h. A joint of more than half a cell without closed cells has all cells
//! of water in front of the rectangle of its mouth: their mean pressure counts, by the parts of the rectangle, and they
//! receive the discharge in these parts.
//!
//! Both waters load a block. The lattice loads its surface at the links between its cells and cells of water. No such
//! link lies in a joint of the network: cells with their centres there are closed
//! ([`crate::body_map::BodyMap::set_joint_cells`]), so that no part of a surface has both loads. In joints wider than
//! half a cell the network also gives the friction of its discharge to both faces.
//!
//! **Takeover.** Where blocks move apart, the lattice takes over a joint at a stated aperture: its cells open, with the
//! pressure and the velocity that the network had there ([`joints::takeover`]). The lattice averages loads over two
//! half steps; the load of the network takes the part of the first, so that the force on a block has no
//! jump. A joint that closes again returns to the network where it is narrower by a quarter.
//!
//! **Mass.** A block in the lattice contains water, which its moving surface exchanges with the water outside, so that
//! the sum over all cells is constant ([`crate::bounce_back`]). The water outside therefore follows the position of the
//! surface, and the number of its cells follows that position rounded to cells. Cells that the network gives to the
//! lattice, or takes, have this number as well: their water differs from that of the joint by the part of a row of
//! cells between the faces and the rounded faces. That difference is water inside the block, and comes back with the
//! motion of the block. The sum over the cells that are not closed, the network and this difference is constant to
//! rounding, and a joint that opens and closes again leaves no difference. Closed cells contain nothing and cost
//! nothing.
//!
//! **Stability.** A network that is driven by the pressure before the water enters gives less energy than the lattice
//! receives: the difference acts as a negative resistance, `rho/(6 h dt)` at a mouth of one cell `h` with steps `dt`,
//! which friction exceeds in narrow joints alone. At mouths with links, and at those of joints of up to half a cell,
//! the pressure therefore includes half of the water of the step, implicitly (`mouth_links`, `mouths`). At cells in
//! front of a wide mouth it has half of the increase by the discharge of the end of the last step; the change of the
//! discharge in a step remains. It reduces the inertia of the water between a mouth and the first point of the joint,
//! half a cell `l` of the joint, by a quarter of `h/(3 l)`. Cells of the joint of at least `h` keep it positive.
//!
//! **Several steps.** The joints may make one step in several of the lattice: the means of pressures and loads drive
//! it, and its water returns evenly (`window` of [`crate::joint_water`]). Water on its way belongs to neither.
//!
//! **Pressures** are those of the lattice. Where gravity does not act on its water they are the excess over
//! hydrostatic, in the joints as well, and the buoyancy of the whole block comes with the load of the lattice.

mod mouth_links;
mod mouths;

use crate::body_map::CellChange;
use crate::bounce_back::BounceBack;
use crate::joint_water::JointWater;
use crate::lattice::LatticeFlow;
use crate::{Flow, FluidView};
use base::error::Error;
use base::number::{floor_i32, real, to_i32};
use decomposition::{Domain, ExactSum};
use dem::particles::Particles;
use dem::space::Space;
use joints::cover::covers;
use joints::takeover::TakenOver;
use lbm::lanes::Stored;
use mouth_links::MouthLinks;
use mouths::MouthCells;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::time::Instant;

/// Motion of a face between two networks, divided by the size of a cell of the joints, within which cells are closed.
const MARGIN: f64 = 0.15;

/// Lattice with bodies, and the water in the joints between them.
pub struct Jointed<Sp: Space, S: Stored> {
    lattice: BounceBack<Sp, S>,
    joints: JointWater,
    /// Links through the mouths of joints with closed cells, and cells in front of other mouths.
    links: MouthLinks,
    cells: MouthCells,
    /// Joint of each closed cell, in local coordinates.
    joint_of: HashMap<[i32; 3], usize>,
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
            links: MouthLinks::default(),
            cells: MouthCells::default(),
            joint_of: HashMap::new(),
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

    /// Returns the displacements of the periodic images of the domain \[m\], beginning with none.
    fn shifts(&self) -> Vec<Vector3<f64>> {
        let fluid = LatticeFlow::fluid(&self.lattice);
        let (cells, periodic) = (fluid.domain_cells(), fluid.periodic());
        let spacing = self.lattice.units().spacing;
        let mut shifts = vec![Vector3::zeros()];
        for axis in (0..3).filter(|axis| periodic[*axis]) {
            let mut step = Vector3::zeros();
            step[axis] = real(cells[axis]) * spacing;
            let images = |shift: &Vector3<f64>| [*shift, shift - step, shift + step];
            shifts = shifts.iter().flat_map(images).collect();
        }
        shifts
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
        let shifts = self.shifts();
        self.joint_of.clear();
        for (joint, cover) in covers(network).into_iter().enumerate() {
            for shift in &shifts {
                let [low, high] = cover.bounds().map(|corner| corner + shift);
                let range = |axis: usize| {
                    let cell = |at: f64| floor_i32(at / spacing).saturating_sub(start[axis]);
                    let first = cell(low[axis] - margin).max(held[axis][0]);
                    let end = cell(high[axis] + margin).saturating_add(1);
                    first..end.min(held[axis][1])
                };
                for local in range(2)
                    .flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])))
                {
                    let at = |axis: usize| (f64::from(local[axis] + start[axis]) + 0.5) * spacing;
                    let centre = Vector3::new(at(0), at(1), at(2)) - shift;
                    if cover.contains(&centre, margin) {
                        self.joint_of.entry(local).or_insert(joint);
                    }
                }
            }
        }
        let cells = self.joint_of.keys().copied();
        self.lattice.map_mut().set_joint_cells(cells);
    }

    /// Sets the cells that have opened or closed: those that opened have the state of the network there, those that
    /// closed contain nothing. `first` is `true` for the first map of a run. Collective.
    fn exchange_cells(&mut self, taken: &[TakenOver], first: bool, domain: &Domain) {
        let units = *self.lattice.units();
        let start = self.lattice.start();
        let volume = units.spacing.powi(3);
        let [mut opened, mut from_rock] = [ExactSum::new(), ExactSum::new()];
        let changes = self.lattice.map().joint_changes().to_vec();
        for (cell, change) in changes {
            let fluid = LatticeFlow::fluid(&self.lattice);
            let position = fluid.populations().interior_cell(cell);
            let (content, sign) = match change {
                CellChange::WaterOpened => {
                    let at = |axis: usize| (real(cell[axis] + start[axis]) + 0.5) * units.spacing;
                    let point = Vector3::new(at(0), at(1), at(2));
                    let (pressure, velocity) = self.state_at(&point, taken);
                    let deviation = pressure / units.density_deviation_to_pressure(1.0);
                    let velocity = velocity.map(|v| units.velocity_to_lattice(v)).into();
                    let fluid = LatticeFlow::fluid_mut(&mut self.lattice);
                    fluid.set_equilibrium(position, deviation, velocity);
                    let (content, _) = fluid.populations().moments(position);
                    (content, 1.0)
                }
                // Its populations are zero already.
                CellChange::BodyOpened => (0.0, 1.0),
                CellChange::WaterClosed | CellChange::BodyClosed => {
                    let fluid = LatticeFlow::fluid_mut(&mut self.lattice);
                    let (content, _) = fluid.populations().moments(position);
                    fluid.empty(position);
                    (content, -1.0)
                }
            };
            let sum = match change {
                CellChange::WaterOpened | CellChange::WaterClosed => &mut opened,
                CellChange::BodyOpened | CellChange::BodyClosed => &mut from_rock,
            };
            sum.add(sign * volume);
            sum.add(sign * volume * content);
        }
        if first || self.lattice.map().joints_altered() {
            let closed = self.lattice.map().closed_cells();
            LatticeFlow::fluid_mut(&mut self.lattice).leave_out(&closed);
        }
        if !first && self.joints.moves_blocks() {
            let ratio = self.joints.density_ratio();
            let exchanged = [opened, from_rock].map(|mut sum| {
                sum.all_reduce(domain.communicator());
                sum.value() / ratio
            });
            self.joints.add_cells(exchanged);
        }
    }

    /// Returns pressure \[Pa\] and velocity [m/s] at a point \[m\] where a cell has opened: those of the joint that the
    /// lattice takes over there, or the pressure of the nearest node of the network.
    fn state_at(&self, point: &Vector3<f64>, taken: &[TakenOver]) -> (f64, Vector3<f64>) {
        let flow = self.joints.flow();
        let margin = MARGIN * flow.network().settings.cell;
        let mut holders = taken.iter();
        if let Some(joint) = holders.find(|joint| joint.cover.contains(point, margin)) {
            return joint.state(point);
        }
        let nodes = flow.network().positions.iter().zip(flow.pressures());
        let nearest = nodes.min_by(|a, b| {
            let distance = |node: &Vector3<f64>| (node - point).norm_squared();
            distance(a.0).total_cmp(&distance(b.0))
        });
        let pressure = nearest.map_or(0.0, |(_, pressure)| *pressure);
        (pressure, Vector3::zeros())
    }

    /// Adds the last loads of joints that the lattice takes over to those of the half step before. Collective.
    fn carry_loads(&self, taken: &[TakenOver], particles: &mut Particles<Sp>) {
        if !self.lattice.averages_loads() {
            return;
        }
        let units = self.lattice.units();
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
        let begin = Instant::now();
        LatticeFlow::fluid_mut(&mut self.lattice).clear_left_out();
        let fronts = self.fronts(domain);
        self.joints.meet_lattice(fronts, particles, domain);
        self.joints.add_time(begin);
        self.joints.advance(particles, domain)
    }

    fn update_bodies(
        &mut self,
        particles: &mut Particles<Sp>,
        domain: &Domain,
    ) -> Result<(), Error> {
        let begin = Instant::now();
        self.return_water();
        let first = self.closed_for.is_none();
        self.close_joints();
        self.joints.add_time(begin);
        self.lattice.update_bodies(particles, domain)?;
        let begin = Instant::now();
        let taken = self.joints.take_taken_over();
        self.exchange_cells(&taken, first, domain);
        self.carry_loads(&taken, particles);
        self.joints.add_time(begin);
        Ok(())
    }
}
