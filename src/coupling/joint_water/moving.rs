//! Blocks that move in the water of their joints, in a run.
//!
//! A step has three parts. The engine of the solids gives the contact loads half a step ahead, constant over the step
//! ([`dem::Dem::loads_ahead`]). The network then moves water and blocks together, implicitly ([`joints::motion`]), so
//! that the stiffness of a thin layer does not limit the step; only contacts do. The engine takes the new positions
//! ([`dem::Dem::carried`]). Without water this is velocity Verlet.
//!
//! Momentum and angular momentum are the state of a block: the angular momentum is constant in space while the block
//! rotates freely, so that the gyroscopic moment needs no term of its own. The network is rebuilt when a block has
//! moved by a small part of a cell.
//!
//! The water of a mouth that presses on blocks covers every part of the surface of a block that no joint covers: the
//! top of a block flush with its bed, and its sides as it rises. Such blocks are those with a face whose centroid lies
//! in the box of the mouth at the beginning.

use super::{JointWater, Mouths, NetworkBlock, rocks};
use base::error::Error;
use base::number::{real, whole};
use decomposition::Domain;
use dem::particles::Particles;
use dem::polyhedron::{PlacedPolyhedron, RotationState};
use dem::space::Space;
use dem::{BlockMotion, Kind};
use joints::loads::{RockLoad, cells_at, outside};
use joints::motion::Mover;
use joints::network::Network;
use joints::pairs::RockFace;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3, Vector6};
use std::time::Instant;

/// Motion of a block, divided by the size of a cell, after which its network is rebuilt.
const RENEWAL: f64 = 0.1;
/// Number of values of a block that ranks exchange: force and torque, position, velocity, orientation, angular
/// momentum.
const NUMBERS: usize = 19;
/// Number of values of a block in a checkpoint: its present pose, its pose in the network, and the time at which it
/// left its joints.
const SAVED_NUMBERS: usize = 15;
/// Number of values of a joint in a checkpoint.
const PAIR: usize = 4;
/// Value in a checkpoint for a block that has not left its joints, in place of the time at which it left them.
const NOT_LEFT: f64 = -1.0;

/// Position and orientation of a block.
type Pose = (Vector3<f64>, UnitQuaternion<f64>);

/// Block that moves.
#[derive(Clone, Debug)]
struct Body {
    /// Index of the block in the network.
    rock: usize,
    mass: f64,
    /// Principal moments of inertia [kg m²].
    moments: Vector3<f64>,
    /// Position and orientation when the network was made.
    built: Pose,
    /// Mouth whose water surrounds the block, if any.
    mouth: Option<usize>,
    /// Cells of joints at the faces of the block.
    covered: Vec<(RockFace, Vec<usize>)>,
    /// Time at which the last joint of the block vanished \[s\]; none while it has a joint.
    left: Option<f64>,
}

impl Body {
    /// Returns the inertia tensor about the axes of space.
    fn inertia(&self, orientation: &UnitQuaternion<f64>) -> Matrix3<f64> {
        let turn = orientation.to_rotation_matrix().into_inner();
        turn * Matrix3::from_diagonal(&self.moments) * turn.transpose()
    }
}

/// Blocks that move.
#[derive(Clone, Debug)]
pub(super) struct Moving {
    bodies: Vec<Body>,
}

/// Block that has left its joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Departure {
    /// Number of the block.
    pub block: usize,
    /// Time at which the last joint of the block vanished \[s\].
    pub time: f64,
}

fn pose(solid: &PlacedPolyhedron) -> Pose {
    (solid.position, solid.orientation)
}

impl Moving {
    /// Returns the blocks that move, if any.
    pub(super) fn new(
        blocks: &[NetworkBlock],
        mouths: &Mouths,
        network: &Network,
    ) -> Option<Box<Self>> {
        let mut bodies = Vec::new();
        for (rock, block) in blocks.iter().enumerate() {
            let Some(density) = block.density else {
                continue;
            };
            let shape = &block.solid.shape;
            bodies.push(Body {
                rock,
                mass: density * shape.volume(),
                moments: shape.inertia(density),
                built: pose(&block.solid),
                mouth: mouth_round(&block.solid, mouths),
                covered: cells_at(network, rock),
                left: None,
            });
        }
        (!bodies.is_empty()).then(|| Box::new(Self { bodies }))
    }

    /// Returns the moving blocks in the form that the network reads.
    pub(super) fn movers(&self, blocks: &[NetworkBlock]) -> Vec<Mover> {
        let mover = |body: &Body| {
            let solid = &blocks[body.rock].solid;
            let inertia = body.inertia(&solid.orientation);
            let mut mover = Mover::new(body.rock, body.mass, inertia, solid.position);
            let velocity = blocks[body.rock].velocity;
            mover.velocity.fixed_rows_mut::<3>(0).copy_from(&velocity);
            mover
        };
        self.bodies.iter().map(mover).collect()
    }

    /// Appends positions and joints to the values of a checkpoint.
    pub(super) fn save(&self, solids: &[PlacedPolyhedron], network: &Network, to: &mut Vec<f64>) {
        for body in &self.bodies {
            for (position, orientation) in [pose(&solids[body.rock]), body.built] {
                to.extend(position.iter());
                to.extend(orientation.coords.iter());
            }
            to.push(body.left.unwrap_or(NOT_LEFT));
        }
        to.push(real(network.joints.len()));
        for face in network.joints.iter().flat_map(|joint| joint.faces) {
            to.extend([real(face.rock), real(face.face)]);
        }
    }
}

/// Returns the first mouth that presses on blocks and whose box contains the centroid of a face of this block.
fn mouth_round(solid: &PlacedPolyhedron, mouths: &Mouths) -> Option<usize> {
    let faces = 0..solid.shape.half_spaces().len();
    let centroids: Vec<Vector3<f64>> = faces
        .map(|face| {
            let corners = solid.shape.face(face);
            let at = |&vertex: &u32| solid.shape.vertices()[vertex as usize];
            let sum: Vector3<f64> = corners.iter().map(at).sum();
            solid.position + solid.orientation * (sum / real(corners.len()))
        })
        .collect();
    mouths.list.iter().position(|mouth| {
        mouth.presses_on_blocks && centroids.iter().any(|point| mouth.contains(point))
    })
}

/// Returns a position and an orientation from seven numbers.
fn saved_pose(numbers: &[f64]) -> Pose {
    let q = Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]);
    // Not normalised: the bits stay the same.
    let orientation = UnitQuaternion::new_unchecked(q);
    (Vector3::from_column_slice(&numbers[..3]), orientation)
}

impl JointWater {
    /// Returns `true` if blocks move with the water.
    #[must_use]
    pub fn moves_blocks(&self) -> bool {
        self.moving.is_some()
    }

    /// Returns the blocks that have left all of their joints.
    #[must_use]
    pub fn departures(&self) -> Vec<Departure> {
        let bodies = self.moving.iter().flat_map(|moving| &moving.bodies);
        let departure = |body: &Body| {
            body.left.map(|time| Departure {
                block: body.rock,
                time,
            })
        };
        bodies.filter_map(departure).collect()
    }

    /// Returns position \[m\] and velocity [m/s] of the centroid of a block; zeros for a number without a block.
    #[must_use]
    pub fn motion(&self, block: usize) -> [Vector3<f64>; 2] {
        let position = self.solids.get(block).map(|solid| solid.position);
        let mover = self.flow.movers().iter().find(|mover| mover.rock == block);
        let velocity = mover.map(|mover| mover.velocity.fixed_rows::<3>(0).into());
        [position, velocity].map(Option::unwrap_or_default)
    }

    /// Adds the load of the water of mouths on surfaces that no joint covers.
    pub(super) fn add_outside(&mut self) {
        let Some(moving) = &self.moving else { return };
        let time = self.time();
        let (network, rocks) = (self.flow.network(), rocks(&self.solids));
        for body in &moving.bodies {
            let Some(mouth) = body.mouth else { continue };
            let mouth = &self.mouths.list[mouth];
            let rock = (body.rock, &rocks[body.rock]);
            let more = outside(network, rock, &body.covered, |point| {
                mouth.pressure_at(point, &self.mouths.weight, time)
            });
            let load = &mut self.loads[body.rock];
            load.force += more.force;
            load.moment += more.moment;
            load.area += more.area;
        }
    }

    /// Moves water and blocks by a step, under the contact loads of the blocks. Returns the longest path of an owned
    /// block \[m\]. Collective.
    ///
    /// # Errors
    ///
    /// If the pressures do not converge or a block of the network is missing.
    pub fn carry<S: Space>(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<f64, Error> {
        let Some(mut moving) = self.moving.take() else {
            return Ok(0.0);
        };
        let begin = Instant::now();
        let all = gather(particles, domain, self.first, moving.bodies.len())?;
        self.set_movers(&moving.bodies, &all);
        self.advance_water()?;
        let moved = self.place_bodies(&moving.bodies);
        let cell = self.flow.network().settings.cell;
        let far = |body: &Body| {
            let (position, orientation) = pose(&self.solids[body.rock]);
            let turned = (orientation.coords - body.built.1.coords).norm();
            let radius = self.solids[body.rock].shape.radius();
            (position - body.built.0).norm() + 2.0 * radius * turned > RENEWAL * cell
        };
        if moving.bodies.iter().any(far) || self.opens_to_lattice() {
            let renewal = self.flow.renew(&rocks(&self.solids));
            self.release(renewal.water);
            self.balance.released += renewal.exchanged;
            self.balance.taken_over += renewal.exchanged;
            self.taken = renewal.taken;
            self.networks += 1;
            self.take_network(&mut moving);
        } else {
            self.flow.move_to(&rocks(&self.solids));
        }
        self.moving = Some(moving);
        self.measure();
        self.add_taken_over();
        self.set_loads(particles);
        let mut path = 0.0_f64;
        for k in 0..particles.owned() {
            let id = particles.body[k].id;
            // Blocks come in the order of their ids.
            if let Ok(at) = moved.binary_search_by_key(&id, |(rock, _)| self.first + rock) {
                path = path.max(particles.set_block_motion(k, &moved[at].1));
            }
        }
        self.add_time(begin);
        Ok(path)
    }

    /// Returns `true` if a joint is so wide that the lattice takes it over.
    fn opens_to_lattice(&self) -> bool {
        let under = self.flow.network().settings.under;
        under.is_some_and(|under| {
            let mut gaps = self.flow.gaps().iter();
            gaps.any(|gap| gap.constant > under.takeover)
        })
    }

    /// Sets velocities, positions and external loads of the moving blocks in the network; `all` is the result of
    /// [`gather`].
    fn set_movers(&mut self, bodies: &[Body], all: &[(u64, [f64; NUMBERS])]) {
        let middle = self.time() + 0.5 * self.interval;
        let rocks = rocks(&self.solids);
        let gravity = self.gravity;
        let mut loads = Vec::with_capacity(bodies.len());
        let wide = self.wide_loads();
        for (body, (_, numbers)) in bodies.iter().zip(all) {
            let mut load = Vector6::from_column_slice(&numbers[..6]);
            for axis in 0..3 {
                load[axis] += body.mass * gravity[axis];
            }
            if let Some([force, torque]) = self.of_lattice.get(body.rock) {
                for axis in 0..3 {
                    load[axis] += force[axis];
                    load[3 + axis] += torque[axis];
                }
            }
            if let Some(more) = wide.get(body.rock) {
                for axis in 0..3 {
                    load[axis] += more.force[axis];
                    load[3 + axis] += more.moment[axis];
                }
            }
            if let Some(mouth) = body.mouth {
                let mouth = &self.mouths.list[mouth];
                let rock = (body.rock, &rocks[body.rock]);
                let more = outside(self.flow.network(), rock, &body.covered, |point| {
                    mouth.pressure_at(point, &self.mouths.weight, middle)
                });
                for axis in 0..3 {
                    load[axis] += more.force[axis];
                    load[3 + axis] += more.moment[axis];
                }
            }
            loads.push(load);
        }
        let movers = self.flow.movers_mut().iter_mut();
        for (((mover, body), (_, numbers)), load) in movers.zip(bodies).zip(all).zip(loads) {
            let momentum = Vector3::from_column_slice(&numbers[16..]);
            let rotation = RotationState {
                orientation: self.solids[body.rock].orientation,
                angular_momentum: momentum,
            };
            let spin = rotation.spin(&body.moments);
            mover.inertia = body.inertia(&rotation.orientation);
            mover.load = load;
            mover.velocity =
                Vector6::new(numbers[9], numbers[10], numbers[11], spin.x, spin.y, spin.z);
        }
    }

    /// Returns the loads of wide joints under a lattice on all blocks; empty if no joint is wide.
    fn wide_loads(&self) -> Vec<RockLoad> {
        let Some(under) = self.flow.network().settings.under else {
            return Vec::new();
        };
        let mut gaps = self.flow.gaps().iter();
        if !gaps.any(|gap| gap.constant > under.wide) {
            return Vec::new();
        }
        let centroids: Vec<_> = self.solids.iter().map(|solid| solid.position).collect();
        let mut loads = vec![RockLoad::default(); centroids.len()];
        self.add_wide_loads(&centroids, &mut loads);
        loads
    }

    /// Copies the positions of the moving blocks from the network. Returns the id of each block and its motion.
    fn place_bodies(&mut self, bodies: &[Body]) -> Vec<(u64, BlockMotion)> {
        let mut moved = Vec::with_capacity(bodies.len());
        for (mover, body) in self.flow.movers().iter().zip(bodies) {
            let solid = &mut self.solids[body.rock];
            let spin: Vector3<f64> = mover.velocity.fixed_rows::<3>(3).into();
            let turn: Vector3<f64> = mover.displacement.fixed_rows::<3>(3).into();
            solid.position += mover.displacement.fixed_rows::<3>(0);
            let turned = UnitQuaternion::from_scaled_axis(turn) * solid.orientation;
            solid.orientation = UnitQuaternion::new_normalize(turned.into_inner());
            let motion = BlockMotion {
                position: solid.position,
                velocity: mover.velocity.fixed_rows::<3>(0).into(),
                rotation: RotationState {
                    orientation: solid.orientation,
                    angular_momentum: mover.inertia * spin,
                },
            };
            moved.push((body.rock as u64, motion));
        }
        moved
    }

    /// Updates the mouths and the covered faces for a new network.
    fn take_network(&mut self, moving: &mut Moving) {
        let time = self.time();
        let network = self.flow.network();
        self.mouths.reassign_mouths(network);
        for body in &mut moving.bodies {
            body.built = pose(&self.solids[body.rock]);
            body.covered = cells_at(network, body.rock);
            if body.covered.is_empty() && body.left.is_none() {
                log::info!(
                    "block {} has left its joints at time {time:.6e} s",
                    body.rock
                );
                body.left = Some(time);
            }
        }
    }

    /// Restores positions and network from the values of a checkpoint; returns the values that follow, or none if they
    /// belong to other blocks.
    pub(super) fn restore_positions<'a>(&mut self, numbers: &'a [f64]) -> Option<&'a [f64]> {
        let mut moving = self.moving.take()?;
        let (poses, after) = numbers.split_at_checked(SAVED_NUMBERS * moving.bodies.len())?;
        let mut built = self.solids.clone();
        for (body, saved) in moving
            .bodies
            .iter_mut()
            .zip(poses.chunks_exact(SAVED_NUMBERS))
        {
            let solid = &mut self.solids[body.rock];
            (solid.position, solid.orientation) = saved_pose(saved);
            let (position, orientation) = saved_pose(&saved[7..]);
            (built[body.rock].position, built[body.rock].orientation) = (position, orientation);
            body.built = (position, orientation);
            body.left = (saved[14] >= 0.0).then_some(saved[14]);
        }
        let (count, after) = after.split_first()?;
        let count = whole(*count);
        let (pairs, after) = after.split_at_checked(PAIR.checked_mul(count)?)?;
        let pairs: Option<Vec<[RockFace; 2]>> = pairs
            .chunks_exact(PAIR)
            .map(|numbers| self.pair(numbers))
            .collect();
        let settings = self.flow.network().settings;
        let network = Network::of_pairs(&rocks(&built), &pairs?, &settings);
        if network.joints.len() != count {
            return None;
        }
        self.mouths.reassign_mouths(&network);
        for body in &mut moving.bodies {
            body.covered = cells_at(&network, body.rock);
        }
        let movers = self.flow.movers().to_vec();
        let mut flow = joints::JointFlow::with_movers(network, *self.flow.settings(), movers);
        flow.set_positions(&rocks(&self.solids));
        self.flow = flow;
        self.moving = Some(moving);
        Some(after)
    }

    /// Returns the pair of faces with these indices, if the blocks have them.
    fn pair(&self, numbers: &[f64]) -> Option<[RockFace; 2]> {
        let face = |at: usize| {
            let (rock, face) = (whole(numbers[at]), whole(numbers[at + 1]));
            let faces = self.solids.get(rock)?.shape.half_spaces().len();
            (face < faces).then_some(RockFace { rock, face })
        };
        Some([face(0)?, face(2)?])
    }
}

/// Returns id, contact load and motion of all blocks that move, in the order of their ids, on every rank. Collective.
fn gather<S: Space>(
    particles: &Particles<S>,
    domain: &Domain,
    first: u64,
    expected: usize,
) -> Result<Vec<(u64, [f64; NUMBERS])>, Error> {
    let mut bytes = Vec::new();
    for k in 0..particles.owned() {
        let body = &particles.body[k];
        let Some((motion, [force, torque])) = particles.block_motion(k) else {
            continue;
        };
        if body.kind != Kind::Free || body.id < first {
            continue;
        }
        bytes.extend(body.id.to_le_bytes());
        let rotation = &motion.rotation;
        let numbers = force.iter().chain(&torque).chain(&motion.position);
        let numbers = numbers
            .chain(&motion.velocity)
            .chain(&rotation.orientation.coords);
        for number in numbers.chain(&rotation.angular_momentum) {
            bytes.extend(number.to_le_bytes());
        }
    }
    let mut all = Vec::with_capacity(expected);
    for message in domain.communicator().all_gather_bytes(&bytes) {
        for row in message.chunks_exact(8 * (NUMBERS + 1)) {
            let mut words = row.chunks_exact(8).map(|word| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(word);
                bytes
            });
            let id = u64::from_le_bytes(words.next().unwrap_or_default());
            let mut numbers = [0.0; NUMBERS];
            for (number, word) in numbers.iter_mut().zip(words) {
                *number = f64::from_le_bytes(word);
            }
            all.push((id, numbers));
        }
    }
    all.sort_unstable_by_key(|(id, _)| *id);
    if all.len() != expected {
        return Err(Error::Numerical(format!(
            "only {} of the {expected} blocks that move in the water of joints remain",
            all.len()
        )));
    }
    Ok(all)
}

/// Returns an upper bound of the number of values in a checkpoint of `movers` moving blocks; `nodes` and `links` are
/// the numbers at the start, of which a moving block has at most [`GROWTH`] times as many.
#[must_use]
pub fn most_numbers(movers: usize, nodes: usize, links: usize, inertia: bool) -> usize {
    let modes = if inertia { joints::slot::MODES } else { 0 };
    let network = super::numbers(2 * nodes + links * (1 + modes)) + PAIR * links;
    // Gaps of the channels, and the matrix of the factors: nodes, links, each cell with the freedoms of two blocks.
    let network = network + 3 * links + 13 * nodes + links + 9 * movers + 1;
    GROWTH * (network + SAVED_NUMBERS * movers + 1)
}

/// Largest growth of a network by the motion of its blocks, for the check of a checkpoint.
const GROWTH: usize = 8;
