//! Time integration of grains: velocity Verlet as kick - drift - kick.
//!
//! ```text
//! v' = v + a(t) dt/2,   x(t+dt) = x + v' dt,   a(t+dt) from x(t+dt) and v',   v(t+dt) = v' + a(t+dt) dt/2
//! ```
//!
//! Spins follow the same scheme. The acceleration is `a = (contact + fluid)/m + g`. Fixed and driven grains keep their
//! velocity. Non-viscous damping is optional (P. A. Cundall 1987): it reduces each component of the total force by the
//! fraction `damping` where the component acts along the velocity, and increases it by the same fraction where it acts
//! against it.

pub(super) mod blocks;

use super::particles::{Load, Mobility, Motion, Particles};
use super::space::{Components, Space};
use base::thread_pool;

/// Parameters of the velocity update.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kick<S: Space> {
    pub(super) gravity: S::Vector,
    pub(super) time_step: f64,
    pub(super) damping: f64,
}

/// Largest squared speed after a drift, and `true` if any value is not finite or too large.
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

/// Squared speed [m²/s²] above which the motion of a grain counts as diverged.
pub(super) const SPEED_LIMIT: f64 = 1e16;

/// Returns a component `a` of an acceleration under non-viscous damping, for a velocity component `v`.
#[inline(always)]
fn damped(a: f64, v: f64, damping: f64) -> f64 {
    let power = a * v;
    // A choice among three constants, without a branch that vibration could make unpredictable.
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

/// Phase of the scheme: the end of one step and the beginning of the next are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// The first half kick of a step, and its drift.
    First,
    /// The half kick that ends a step, then the first half kick and the drift of the next.
    Between,
    /// The half kick that ends a step.
    Last,
}

/// Loads and mobilities of a range of grains.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loads<'a, S: Space> {
    pub(super) contact: &'a [Load<S>],
    /// Loads of the fluid; empty in a dry scene.
    pub(super) fluid: &'a [Load<S>],
    pub(super) mobility: &'a [Mobility],
}

/// Adds the load of the fluid to that of the contacts.
#[inline(always)]
fn together<S: Space>(contact: &Load<S>, fluid: &Load<S>) -> Load<S> {
    Load {
        force: contact.force + fluid.force,
        torque: contact.torque + fluid.torque,
    }
}

/// Moves all grains. `from` is empty if grains move `IN_PLACE`. `ENDS` a step and `BEGINS` one: see [`Phase`].
fn move_all<
    S: Space,
    const IN_PLACE: bool,
    const DAMPED: bool,
    const ENDS: bool,
    const BEGINS: bool,
    const WET: bool,
>(
    from: &[Motion<S>],
    to: &mut [Motion<S>],
    loads: &Loads<'_, S>,
    kick_by: &Kick<S>,
) -> Fastest {
    let grains = to.len();
    let from = if IN_PLACE { from } else { &from[..grains] };
    let (contact, mobility) = (&loads.contact[..grains], &loads.mobility[..grains]);
    let fluid = if WET { &loads.fluid[..grains] } else { &[] };
    let mut speed_squared = 0.0;
    let mut bad = false;
    for k in 0..grains {
        let load = if WET {
            together(&contact[k], &fluid[k])
        } else {
            contact[k]
        };
        let mut motion = if IN_PLACE { to[k] } else { from[k] };
        if ENDS {
            kick::<S, DAMPED>(&mut motion, &load, &mobility[k], kick_by);
        }
        if BEGINS {
            kick::<S, DAMPED>(&mut motion, &load, &mobility[k], kick_by);
            motion.position += motion.velocity * kick_by.time_step;
            let squared = motion.velocity.scalar(&motion.velocity);
            // A comparison that is false for NaN, too.
            let bounded = squared < SPEED_LIMIT;
            bad |= !bounded;
            speed_squared = if squared > speed_squared {
                squared
            } else {
                speed_squared
            };
        }
        to[k] = motion;
    }
    Fastest { speed_squared, bad }
}

/// Moves grains from their state in `from` to their new state in `to`, an array of the same length; with `IN_PLACE`
/// the states in `to` are updated and `from` is empty.
pub(super) fn move_by<S: Space, const IN_PLACE: bool>(
    from: &[Motion<S>],
    to: &mut [Motion<S>],
    loads: &Loads<'_, S>,
    kick_by: &Kick<S>,
    phase: Phase,
) -> Fastest {
    let wet = !loads.fluid.is_empty();
    let act = match (kick_by.damping > 0.0, phase, wet) {
        (false, Phase::First, false) => move_all::<S, IN_PLACE, false, false, true, false>,
        (false, Phase::First, true) => move_all::<S, IN_PLACE, false, false, true, true>,
        (false, Phase::Between, false) => move_all::<S, IN_PLACE, false, true, true, false>,
        (false, Phase::Between, true) => move_all::<S, IN_PLACE, false, true, true, true>,
        (false, Phase::Last, false) => move_all::<S, IN_PLACE, false, true, false, false>,
        (false, Phase::Last, true) => move_all::<S, IN_PLACE, false, true, false, true>,
        (true, Phase::First, false) => move_all::<S, IN_PLACE, true, false, true, false>,
        (true, Phase::First, true) => move_all::<S, IN_PLACE, true, false, true, true>,
        (true, Phase::Between, false) => move_all::<S, IN_PLACE, true, true, true, false>,
        (true, Phase::Between, true) => move_all::<S, IN_PLACE, true, true, true, true>,
        (true, Phase::Last, false) => move_all::<S, IN_PLACE, true, true, false, false>,
        (true, Phase::Last, true) => move_all::<S, IN_PLACE, true, true, false, true>,
    };
    act(from, to, loads, kick_by)
}

/// Moves all owned grains in place.
pub(super) fn advance<S: Space>(
    particles: &mut Particles<S>,
    kick_by: &Kick<S>,
    phase: Phase,
    parallel: bool,
) -> Fastest {
    let owned = particles.owned();
    let motion = &mut particles.motion[..owned];
    let (contact, mobility) = (&particles.contact[..owned], &particles.mobility[..owned]);
    let fluid = &particles.fluid[..];
    let threads = if parallel { thread_pool::threads() } else { 1 };
    let mut fastest = [Fastest::default(); thread_pool::MAX_THREADS];
    let shared = (
        thread_pool::evenly(&mut fastest[..threads], threads),
        thread_pool::evenly(motion, threads),
    );
    thread_pool::each_of(threads, shared, |piece, (fastest, motion)| {
        let part = owned * piece / threads..owned * (piece + 1) / threads;
        let loads = Loads {
            contact: &contact[part.clone()],
            fluid: fluid.get(part.clone()).unwrap_or_default(),
            mobility: &mobility[part],
        };
        fastest[0] = move_by::<S, true>(&[], motion, &loads, kick_by, phase);
    });
    fastest.into_iter().fold(Fastest::default(), Fastest::or)
}
