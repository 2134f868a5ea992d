//! Time integration of grains: velocity Verlet as kick - drift - kick.
//!
//! ```text
//! v' = v + a(t) dt/2,   x(t+dt) = x + v' dt,   a(t+dt) from x(t+dt) and v',   v(t+dt) = v' + a(t+dt) dt/2
//! ```
//!
//! Spins follow the same scheme. The acceleration is `a = (contact + fluid)/m + g`. Fixed and driven grains keep their
//! velocity. Non-viscous damping is optional (P. A. Cundall 1987): it reduces each component of the total force by the fraction
//! `damping` where the component acts along the velocity, and increases it by the same fraction where it acts against it.

pub(super) mod blocks;

use super::particles::{Load, Mobility, Motion, Particles};
use super::space::{Components, Space};
use crate::thread_pool;

/// How velocities change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kick<S: Space> {
    pub(super) gravity: S::Vector,
    pub(super) time_step: f64,
    pub(super) damping: f64,
}

/// The fastest grain after a drift: its squared speed, and whether any number went bad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fastest {
    pub(super) speed_squared: f64,
    pub(super) bad: bool,
}

impl Fastest {
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            speed_squared: self.speed_squared.max(other.speed_squared),
            bad: self.bad || other.bad,
        }
    }
}

/// Beyond this squared speed [m²/s²] a grain counts as blown up.
pub(super) const SPEED_LIMIT: f64 = 1e16;

/// A component `a` of an acceleration under non-viscous damping, where the velocity's is `v`.
#[inline(always)]
fn damped(a: f64, v: f64, damping: f64) -> f64 {
    let power = a * v;
    // Three constants to choose from: no branch that vibration could make unpredictable.
    let factor = if power > 0.0 {
        1.0 - damping
    } else if power < 0.0 {
        1.0 + damping
    } else {
        1.0
    };
    a * factor
}

#[inline(always)]
fn kick<S: Space, const DAMPED: bool>(
    motion: &mut Motion<S>,
    load: &Load<S>,
    mobility: &Mobility,
    kick: &Kick<S>,
) {
    let half = 0.5 * kick.time_step;
    let mut linear = load.force * mobility.inverse_mass + kick.gravity * mobility.free;
    let mut angular = load.torque * mobility.inverse_inertia;
    if DAMPED {
        let damp = |a: f64, v: f64| damped(a, v, kick.damping);
        linear = linear.combine(&motion.velocity, damp);
        angular = angular.combine(&motion.spin, damp);
    }
    motion.velocity += linear * half;
    motion.spin += angular * half;
}

/// Adds the load of the fluid to that of the contacts.
#[inline(always)]
fn together<S: Space>(contact: &Load<S>, fluid: &Load<S>) -> Load<S> {
    Load {
        force: contact.force + fluid.force,
        torque: contact.torque + fluid.torque,
    }
}

/// `fluid` is empty unless `WET`: a dry grain reads no load of a fluid.
#[inline(always)]
fn drift_all<S: Space, const DAMPED: bool, const AGAIN: bool, const WET: bool>(
    motion: &mut [Motion<S>],
    contact: &[Load<S>],
    fluid: &[Load<S>],
    mobility: &[Mobility],
    how: &Kick<S>,
) -> Fastest {
    let grains = motion.len();
    let (contact, mobility) = (&contact[..grains], &mobility[..grains]);
    let fluid = if WET { &fluid[..grains] } else { fluid };
    let mut speed_squared = 0.0;
    let mut bad = false;
    for k in 0..grains {
        let load = if WET {
            together(&contact[k], &fluid[k])
        } else {
            contact[k]
        };
        let motion = &mut motion[k];
        if AGAIN {
            kick::<S, DAMPED>(motion, &load, &mobility[k], how);
        }
        kick::<S, DAMPED>(motion, &load, &mobility[k], how);
        motion.position += motion.velocity * how.time_step;
        let squared = motion.velocity.scalar(&motion.velocity);
        // A comparison that a NaN fails too.
        let bounded = squared < SPEED_LIMIT;
        bad |= !bounded;
        speed_squared = if squared > speed_squared {
            squared
        } else {
            speed_squared
        };
    }
    Fastest { speed_squared, bad }
}

fn drift_pieces<S: Space, const DAMPED: bool, const AGAIN: bool, const WET: bool>(
    particles: &mut Particles<S>,
    how: &Kick<S>,
    parallel: bool,
) -> Fastest {
    let owned = particles.owned();
    let motion = &mut particles.motion[..owned];
    let (contact, mobility) = (&particles.contact[..owned], &particles.mobility[..owned]);
    let fluid = &particles.fluid[..if WET { owned } else { 0 }];
    if !parallel {
        return drift_all::<S, DAMPED, AGAIN, WET>(motion, contact, fluid, mobility, how);
    }
    let threads = thread_pool::threads();
    let mut fastest = [Fastest::default(); thread_pool::MOST];
    let shared = (
        thread_pool::evenly(&mut fastest[..threads], threads),
        thread_pool::evenly(motion, threads),
    );
    thread_pool::each_of(threads, shared, |piece, (fastest, motion)| {
        let part = owned * piece / threads..owned * (piece + 1) / threads;
        let fluid = &fluid[if WET { part.clone() } else { 0..0 }];
        let (contact, mobility) = (&contact[part.clone()], &mobility[part]);
        fastest[0] = drift_all::<S, DAMPED, AGAIN, WET>(motion, contact, fluid, mobility, how);
    });
    fastest.into_iter().fold(Fastest::default(), Fastest::or)
}

/// First half kick and drift; `again`: the second half kick of the step before comes first.
pub(super) fn drift<S: Space>(
    particles: &mut Particles<S>,
    how: &Kick<S>,
    again: bool,
    parallel: bool,
) -> Fastest {
    let drift = match (how.damping > 0.0, again, particles.fluid.is_allocated()) {
        (false, false, false) => drift_pieces::<S, false, false, false>,
        (false, false, true) => drift_pieces::<S, false, false, true>,
        (false, true, false) => drift_pieces::<S, false, true, false>,
        (false, true, true) => drift_pieces::<S, false, true, true>,
        (true, false, false) => drift_pieces::<S, true, false, false>,
        (true, false, true) => drift_pieces::<S, true, false, true>,
        (true, true, false) => drift_pieces::<S, true, true, false>,
        (true, true, true) => drift_pieces::<S, true, true, true>,
    };
    drift(particles, how, parallel)
}

/// Second half kick.
pub(super) fn finish<S: Space>(particles: &mut Particles<S>, how: &Kick<S>, parallel: bool) {
    let finish = match (how.damping > 0.0, particles.fluid.is_allocated()) {
        (false, false) => finish_pieces::<S, false, false>,
        (false, true) => finish_pieces::<S, false, true>,
        (true, false) => finish_pieces::<S, true, false>,
        (true, true) => finish_pieces::<S, true, true>,
    };
    finish(particles, how, parallel);
}

fn finish_pieces<S: Space, const DAMPED: bool, const WET: bool>(
    particles: &mut Particles<S>,
    how: &Kick<S>,
    parallel: bool,
) {
    let owned = particles.owned();
    let motion = &mut particles.motion[..owned];
    let (contact, mobility) = (&particles.contact[..owned], &particles.mobility[..owned]);
    let fluid = &particles.fluid[..if WET { owned } else { 0 }];
    let pieces = if parallel { thread_pool::threads() } else { 1 };
    thread_pool::each_of(
        pieces,
        thread_pool::evenly(motion, pieces),
        |piece, motion| {
            let part = owned * piece / pieces..owned * (piece + 1) / pieces;
            let fluid = &fluid[if WET { part.clone() } else { 0..0 }];
            let (contact, mobility) = (&contact[part.clone()], &mobility[part]);
            for (k, motion) in motion.iter_mut().enumerate() {
                let load = if WET {
                    together(&contact[k], &fluid[k])
                } else {
                    contact[k]
                };
                kick::<S, DAMPED>(motion, &load, &mobility[k], how);
            }
        },
    );
}
