//! Motion of blocks in the water of their joints, solved together with the water pressures.
//!
//! A block has the mass `m` and the inertia `J`; its velocity `v` and its rotation rate follow from the external load
//! and the pressures of the cells on its faces ([`crate::loads`]). The volume of a cell changes with the motion by
//! the same numbers `S` with which its pressure loads the block, so that water and block exchange work and no energy
//! is lost or gained between them:
//!
//! ```text
//! d(V_i r(p_i))/dt = sum of Q,     dV_i/dt = sum over blocks of S_ib . v_b
//! m dv_b/dt = F_b + sum over cells of S_ib p_i
//! ```
//!
//! A thin layer resists the motion like a damper of `mu L^4/h^3` and carries an added mass of `rho L^3 w/(12 h)`;
//! both grow without bound as the layer closes, so that a load that is only updated between steps is unstable in
//! thin joints. The velocities are therefore unknowns of each implicit stage together with the pressures: in the
//! small system
//!
//! ```text
//! | S' + g L     g S  |
//! |  g S^T      -m    |
//! ```
//!
//! the first block is positive definite and the last negative definite, so that it has a solution and its factors exist
//! for every step `g` and aperture ([`crate::ldl`]). The stages are L-stable in time.
//!
//! **Another integrator.** The stages give the displacement of a step as well. A program that takes the load of a
//! step as constant and moves the block itself, by the mean of its old and new velocities, is unstable in thin
//! joints: with the distance `e` between its position and that of the water, the limit of a massless block gives
//! `e_(n+1) = e_n + k (e_n + e_(n-1))/2` with `k = (1 - 2g)/g² = 4.8`, which grows. Such a program must use the
//! displacement and velocity computed here.
//!
//! **Small motion.** The faces move as planes, to first order in the rotation, and the overlap of a joint is
//! constant. A block that slides or rotates by more than a small fraction of a cell requires a new network.

use crate::network::Network;
use crate::polygon::LinearField;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Number of degrees of freedom of a block.
pub const FREEDOMS: usize = 6;

/// Moving block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mover {
    /// Number of the block in the list of the network.
    pub rock: usize,
    /// Mass \[kg\].
    pub mass: f64,
    /// Moment of inertia about the centroid, along the axes of space [kg m²].
    pub inertia: Matrix3<f64>,
    /// Centroid in the network \[m\].
    pub centroid: Vector3<f64>,
    /// External force \[N\] and moment \[N m\], constant during a step.
    pub load: Vector6<f64>,
    /// Displacement \[m\] and rotation \[rad\] since the network was built.
    pub displacement: Vector6<f64>,
    /// Velocity [m/s] and rotation rate [rad/s].
    pub velocity: Vector6<f64>,
}

impl Mover {
    /// Returns a stationary block in its initial position.
    #[must_use]
    pub fn new(rock: usize, mass: f64, inertia: Matrix3<f64>, centroid: Vector3<f64>) -> Self {
        Self {
            rock,
            mass,
            inertia,
            centroid,
            load: Vector6::zeros(),
            displacement: Vector6::zeros(),
            velocity: Vector6::zeros(),
        }
    }

    /// Returns the momentum and angular momentum at a velocity.
    #[must_use]
    pub fn momentum(&self, velocity: &Vector6<f64>) -> Vector6<f64> {
        let linear = velocity.fixed_rows::<3>(0) * self.mass;
        let angular = self.inertia * velocity.fixed_rows::<3>(3);
        Vector6::new(
            linear[0], linear[1], linear[2], angular[0], angular[1], angular[2],
        )
    }
}

/// Cell next to a moving block, with the load of its pressure on the block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LoadedCell {
    pub(crate) cell: usize,
    pub(crate) mover: usize,
    /// Face of the joint, 0 or 1, on which the cell loads the block.
    pub(crate) side: usize,
    /// Force and moment per unit of pressure \[m²\], \[m³\].
    pub(crate) arm: Vector6<f64>,
}

/// Returns the cells next to moving blocks, in the order of the cells.
pub(crate) fn touches(
    network: &Network,
    movers: &[Mover],
    of_rock: &[Option<usize>],
) -> Vec<LoadedCell> {
    let mut all = Vec::new();
    for (cell, &joint) in network.joint_of.iter().enumerate() {
        for (side, face) in network.joints[joint].faces.iter().enumerate() {
            if let Some(mover) = of_rock.get(face.rock).copied().flatten() {
                all.push(LoadedCell {
                    cell,
                    mover,
                    side,
                    arm: arm(network, (cell, side), &movers[mover].centroid),
                });
            }
        }
    }
    all
}

/// Returns force and moment per unit of pressure of a cell on the block at a side of its joint \[m²\], \[m³\].
pub(crate) fn arm(
    network: &Network,
    (cell, side): (usize, usize),
    centroid: &Vector3<f64>,
) -> Vector6<f64> {
    let (joint, cell) = (
        &network.joints[network.joint_of[cell]],
        &network.cells[cell],
    );
    let force = -joint.tilts[side] * cell.area;
    let moment = (joint.face_point(side, &cell.centroid) - centroid).cross(&force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Returns the number of the mover of each block, up to the last that moves.
pub(crate) fn movers_of(movers: &[Mover]) -> Vec<Option<usize>> {
    let mut of_rock = Vec::new();
    for (number, mover) in movers.iter().enumerate() {
        of_rock.resize(of_rock.len().max(mover.rock + 1), None);
        of_rock[mover.rock] = Some(number);
    }
    of_rock
}

/// Change of the gap of a joint by the motion of one of its blocks, to first order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lever {
    mover: usize,
    /// Change of the gap at the origin per displacement and rotation \[1\], \[m\].
    constant: Vector6<f64>,
    /// Change of the slopes of the gap per rotation \[1/rad\].
    slopes: [Vector3<f64>; 2],
}

impl Lever {
    /// Returns the lever of the block at a side of a joint; none for a block that does not move.
    pub(crate) fn new(
        network: &Network,
        (joint, side): (usize, usize),
        (movers, of_rock): (&[Mover], &[Option<usize>]),
    ) -> Option<Self> {
        let joint = &network.joints[joint];
        let mover = of_rock.get(joint.faces[side].rock).copied().flatten()?;
        let (tilt, height) = (&joint.tilts[side], &joint.heights[side]);
        // The same points of the faces as those of the loads, of which the position is a linear function.
        let arm = joint.origin + joint.normal * height.constant - movers[mover].centroid;
        let turn = arm.cross(tilt);
        let across = joint.normal.cross(tilt);
        Some(Self {
            mover,
            constant: -Vector6::new(tilt.x, tilt.y, tilt.z, turn.x, turn.y, turn.z),
            slopes: [0, 1].map(|k| -joint.axes[k].cross(tilt) - across * height.slope[k]),
        })
    }

    /// Adds the change of the gap by the displacement of the block.
    pub(crate) fn add(&self, movers: &[Mover], gap: &mut LinearField) {
        let displacement = &movers[self.mover].displacement;
        let turn: Vector3<f64> = displacement.fixed_rows::<3>(3).into();
        gap.constant += self.constant.dot(displacement);
        for (slope, per_turn) in gap.slope.iter_mut().zip(&self.slopes) {
            *slope += per_turn.dot(&turn);
        }
    }
}
