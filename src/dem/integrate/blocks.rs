//! Time integration of blocks, and of spheres in scenes with blocks.
//!
//! ```text
//! x'' + alpha x' = F/m + g,     dL/dt + alpha L = M,     w = R I^-1 R^T L
//! ```
//!
//! The scheme is kick - drift - kick as for grains, with the rotation of [`crate::polyhedron::rotation`].
//! Mass-proportional damping `alpha` [1/s] is exact for a constant force. Non-viscous damping acts on the components of
//! force and moment in the axes of space, as for grains. Driven blocks rotate with their prescribed spin.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::super::blocks::{in_space, out_of_space};
use super::super::particles::{Body, Kind, Load, Motion, Particles};
use super::super::polyhedron::{Damping, Polyhedron, RotationState};
use super::super::space::Space;
use super::{Fastest, Kick, Phase, SPEED_LIMIT, damped};

/// Properties and loads that determine the motion of a body.
#[derive(Clone, Copy)]
struct Moved<'a, S: Space> {
    body: &'a Body,
    shape: Option<&'a Polyhedron>,
    contact: &'a Load<S>,
    /// Load by the fluid; 0 in a dry scene.
    fluid: Load<S>,
}

/// Parameters of the velocity update, with mass-proportional damping.
#[derive(Clone, Copy)]
struct VelocityUpdate<'a, S: Space> {
    kick: &'a Kick<S>,
    damping: Damping,
}

/// Makes a half kick of a free body.
fn kick<S: Space>(
    motion: &mut Motion<S>,
    rotation: &mut RotationState,
    by: &Moved<'_, S>,
    update: &VelocityUpdate<'_, S>,
) {
    if by.body.kind != Kind::Free {
        return;
    }
    let damp = |rate: &Vector3<f64>, speed: &Vector3<f64>| {
        rate.zip_map(speed, |a, v| damped(a, v, update.kick.damping))
    };
    let velocity = S::to_volume(&motion.velocity);
    let force = (by.contact.force + by.fluid.force) * (1.0 / by.body.mass) + update.kick.gravity;
    let force = damp(&S::to_volume(&force), &velocity);
    motion.velocity = S::from_volume(&update.damping.kick(&velocity, &force));

    let spin = in_space(&motion.spin);
    let moment = damp(&in_space(&(by.contact.torque + by.fluid.torque)), &spin);
    let spin = match by.shape {
        None => update
            .damping
            .kick(&spin, &(moment * (1.0 / by.body.inertia))),
        Some(shape) => {
            rotation.kick(&moment, &update.damping);
            rotation.spin(&by.body.moments(shape))
        }
    };
    motion.spin = out_of_space(&spin);
}

/// Rotates a free block over a step; returns an upper bound of the path \[m\] of any of its points about the
/// centre.
fn turn<S: Space>(
    motion: &mut Motion<S>,
    rotation: &mut RotationState,
    (body, shape): (&Body, &Polyhedron),
    dt: f64,
) -> f64 {
    let before = rotation.orientation;
    let inertia = body.moments(shape);
    match body.kind {
        Kind::Free => {
            rotation.drift(&inertia, dt);
            motion.spin = out_of_space(&rotation.spin(&inertia));
        }
        Kind::Driven => {
            let spin = in_space(&motion.spin);
            let turned = UnitQuaternion::from_scaled_axis(spin * dt) * before;
            let turned = UnitQuaternion::new_normalize(turned.into_inner());
            *rotation = RotationState::new(turned, &spin, &inertia);
        }
        Kind::Fixed | Kind::Held => {}
    }
    // The chord 2 sin(angle/2) of the rotation is at most twice the distance between the quaternions.
    2.0 * body.radius * (rotation.orientation.coords - before.coords).norm()
}

/// Moves one body in a phase of the step; returns the squared path of its fastest point divided by dt.
fn move_one<S: Space>(
    motion: &mut Motion<S>,
    rotation: &mut RotationState,
    by: &Moved<'_, S>,
    update: &VelocityUpdate<'_, S>,
    phase: Phase,
) -> Fastest {
    let dt = update.kick.time_step;
    if phase != Phase::First {
        kick(motion, rotation, by, update);
    }
    if phase == Phase::Last {
        return Fastest::default();
    }
    kick(motion, rotation, by, update);
    drift_one(motion, rotation, by, dt)
}

/// Moves one body with its velocities over `dt` \[s\]; returns the path of its fastest point over dt, squared.
fn drift_one<S: Space>(
    motion: &mut Motion<S>,
    rotation: &mut RotationState,
    by: &Moved<'_, S>,
    dt: f64,
) -> Fastest {
    motion.position += motion.velocity * dt;
    let turned = by
        .shape
        .map_or(0.0, |shape| turn(motion, rotation, (by.body, shape), dt));
    let speed = S::to_volume(&motion.velocity).norm() + turned / dt;
    let speed_squared = speed * speed;
    // A comparison that is false for NaN, too.
    let bounded = speed_squared < SPEED_LIMIT;
    Fastest {
        speed_squared: if bounded { speed_squared } else { 0.0 },
        bad: !bounded,
    }
}

/// Calls `step` for every owned body; returns the fastest of all.
fn each<S: Space>(
    particles: &mut Particles<S>,
    parallel: bool,
    step: impl Fn(&mut Motion<S>, &mut RotationState, &Moved<'_, S>) -> Fastest + Sync,
) -> Fastest {
    let owned = particles.owned();
    let Particles {
        motion,
        contact,
        fluid,
        body,
        shapes,
        shape,
        rotation,
        ..
    } = particles;
    if !shape.is_allocated() {
        return Fastest::default();
    }
    let one = |(k, (motion, rotation)): (usize, (&mut Motion<S>, &mut RotationState))| {
        let by = Moved {
            body: &body[k],
            shape: shapes.get(shape[k] as usize),
            contact: &contact[k],
            fluid: fluid.get(k).copied().unwrap_or_default(),
        };
        step(motion, rotation, &by)
    };
    let (motion, rotation) = (&mut motion[..owned], &mut rotation[..owned]);
    if parallel {
        let all = motion.par_iter_mut().zip(rotation).enumerate();
        all.with_min_len(64)
            .map(one)
            .reduce(Fastest::default, Fastest::or)
    } else {
        let all = motion.iter_mut().zip(rotation).enumerate();
        all.map(one).fold(Fastest::default(), Fastest::or)
    }
}

/// Moves all own bodies with their velocities for a time \[s\].
pub(crate) fn drift<S: Space>(particles: &mut Particles<S>, time: f64, parallel: bool) -> Fastest {
    each(particles, parallel, |motion, rotation, by| {
        drift_one(motion, rotation, by, time)
    })
}

/// Moves all owned bodies in a phase of the step; the drift includes the free rotation.
pub(crate) fn advance<S: Space>(
    particles: &mut Particles<S>,
    kick: &Kick<S>,
    mass_damping: f64,
    (phase, parallel): (Phase, bool),
) -> Fastest {
    let update = VelocityUpdate {
        kick,
        damping: Damping::new(mass_damping, 0.5 * kick.time_step),
    };
    each(particles, parallel, |motion, rotation, by| {
        move_one(motion, rotation, by, &update, phase)
    })
}
