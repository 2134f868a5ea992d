//! Pairs of bodies: masses, separations measured in blocks, and the action of the law.

use super::{Action, WallFailure};
use crate::contact::{ContactKinematics, ContactLaw, Failure, PairProperties, PairTable};
use crate::deepest::{Partner, Record};
use crate::particles::{Body, Load, Motion, ParticlesView};
use crate::space::{Components, Space};
use crate::walls::Wall;

/// Listed pair, lower id first. Reading these dominates the time of a step: 64 bytes in the linear law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<C, M> {
    pub(super) first: u32,
    pub(super) second: u32,
    /// Sum of the radii \[m\].
    pub(super) reach: f64,
    /// Radius of the first body \[m\].
    pub(super) radius: f64,
    /// Index in the table of material pairs.
    pub(super) row: u32,
    /// Index in the table of separation offsets.
    pub(super) offset: u32,
    pub(super) scale: C,
    pub(super) history: M,
}

impl<C, M> Pair<C, M> {
    #[inline(always)]
    pub(super) fn ends(&self) -> (usize, usize) {
        (self.first as usize, self.second as usize)
    }
}

/// Listed pair of a wall and an owned grain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallPair<C, M> {
    pub(super) wall: u32,
    pub(super) grain: u32,
    pub(super) radius: f64,
    pub(super) constants: C,
    pub(super) history: M,
}

pub(super) fn effective_mass<S: Space>(
    particles: &ParticlesView<'_, S>,
    i: usize,
    j: usize,
) -> f64 {
    let masses = [particles.body[i].mass, particles.body[j].mass];
    match [i, j].map(|k| particles.mobility[k].meets_all()) {
        [true, false] => masses[0],
        [false, true] => masses[1],
        _ => masses[0] * masses[1] / (masses[0] + masses[1]),
    }
}

/// Returns the effective moment of inertia `(1/I1 + 1/I2)^-1` [kg m²] about the contact point.
pub(super) fn rolling_inertia<S: Space>(
    particles: &ParticlesView<'_, S>,
    i: usize,
    j: usize,
) -> f64 {
    let about = [i, j].map(|k| surface_inertia(&particles.body[k]));
    match [i, j].map(|k| particles.mobility[k].meets_all()) {
        [true, false] => about[0],
        [false, true] => about[1],
        _ => about[0] * about[1] / (about[0] + about[1]),
    }
}

/// Returns the moment of inertia about a point of the surface [kg m²].
pub(super) fn surface_inertia(body: &Body) -> f64 {
    body.inertia + body.mass * body.radius * body.radius
}

/// Returns the properties of a pair of a grain and a wall.
pub(super) fn at_wall(material: u32, body: &Body) -> PairProperties {
    PairProperties {
        materials: [material, body.material],
        diameter: 2.0 * body.radius,
        mass: body.mass,
        rolling_radius: body.radius,
        rolling_inertia: surface_inertia(body),
    }
}

/// Motion and moisture of all entries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grains<'a, S: Space> {
    pub(super) motion: &'a [Motion<S>],
    /// Empty in scenes without unsaturated ground.
    pub(super) moisture: &'a [[f64; 2]],
}

impl<S: Space> Grains<'_, S> {
    /// Returns the mean moisture of two entries for the law `L`.
    #[inline(always)]
    pub(super) fn moisture<L: ContactLaw<S>>(&self, first: u32, second: u32) -> [f64; 2] {
        if !L::NEEDS_MOISTURE {
            return [0.0; 2];
        }
        let one = |k: u32| self.moisture.get(k as usize).copied().unwrap_or_default();
        let (a, b) = (one(first), one(second));
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    }
}

/// Returns the entries for a law that does not depend on their moisture.
pub(super) fn dry<S: Space>(motion: &[Motion<S>]) -> Grains<'_, S> {
    Grains {
        motion,
        moisture: &[],
    }
}

/// Grain next to a wall.
pub(super) struct WallTouch<'a, S: Space> {
    /// Radius of the grain \[m\].
    pub(super) radius: f64,
    /// Distance of its centre from the wall \[m\], along `normal`.
    pub(super) distance: f64,
    pub(super) normal: &'a S::Vector,
    pub(super) grain: &'a Motion<S>,
    /// Velocity of the wall [m/s].
    pub(super) moves: &'a S::Vector,
    /// Moisture of the contact.
    pub(super) moisture: [f64; 2],
}

/// Computes the contact of a grain with a wall and adds it to the load of the grain.
#[inline(always)]
pub(super) fn act_at_wall<S: Space, L: ContactLaw<S>>(
    (constants, history): (&L::Constants, &mut L::History),
    touch: &WallTouch<'_, S>,
    load: &mut Load<S>,
    dt: f64,
) -> Option<Failure> {
    let WallTouch {
        radius,
        distance,
        normal,
        grain,
        moves,
        moisture,
    } = *touch;
    let overlap = radius - distance;
    let arm = radius - 0.5 * overlap;
    let velocity = grain.velocity - *moves;
    let kinematics = ContactKinematics {
        overlap,
        normal: *normal,
        separation_rate: normal.scalar(&velocity),
        slip: S::slip(normal, &velocity, &(grain.spin * arm)),
        roll: grain.spin,
        time_step: dt,
        moisture,
    };
    let force = L::force(constants, history, &kinematics);
    load.force += *normal * force.normal + S::embed(&force.tangent, normal);
    load.torque += S::tangent_moment(&force.tangent, normal) * -arm;
    if L::HAS_ROLLING {
        load.torque += force.moment;
    }
    force.failure
}

/// Computes the contact of a listed grain with its plane and adds it to the load of the grain; returns a bond that
/// failed.
#[inline(always)]
pub(super) fn act_at_plane<S: Space, L: ContactLaw<S>>(
    pair: &mut WallPair<L::Constants, L::History>,
    wall: &Wall<S>,
    grains: Grains<'_, S>,
    (load, record): (&mut Load<S>, &mut Record),
    dt: f64,
) -> Option<WallFailure<S>> {
    let grain = &grains.motion[pair.grain as usize];
    let distance = wall.distance(&grain.position);
    if distance >= pair.radius && !L::holds(&pair.history) {
        pair.history = L::History::default();
        return None;
    }
    record.note(
        pair.radius - distance,
        pair.radius,
        pair.grain,
        Partner::Wall(pair.wall),
    );
    let mode = act_at_wall::<S, L>(
        (&pair.constants, &mut pair.history),
        &WallTouch {
            radius: pair.radius,
            distance,
            normal: &wall.normal,
            grain,
            moves: &wall.velocity,
            moisture: grains.moisture::<L>(pair.grain, pair.grain),
        },
        load,
        dt,
    )?;
    Some(WallFailure {
        grain: pair.grain,
        wall: pair.wall,
        arm: wall.normal * -distance,
        mode,
    })
}

/// Returns the vector from the first centre to the second, and its squared length. This function is the only one
/// that computes separations.
#[inline(always)]
pub(super) fn separation<S: Space>(
    motion: &[Motion<S>],
    (first, second): (usize, usize),
    offset: &S::Vector,
    periodic: bool,
) -> (S::Vector, f64) {
    let mut between = motion[second].position - motion[first].position;
    if periodic {
        between += *offset;
    }
    (between, between.scalar(&between))
}

/// Number of pairs measured at once: enough to hide the latency of roots and divisions.
pub(super) const BLOCK: usize = 16;

/// Separation of a pair.
pub(super) struct PairSpan<'a, S: Space> {
    /// Vector from the first centre to the second \[m\].
    pub(super) between: &'a S::Vector,
    /// Its squared length, its length, and the inverse of it.
    pub(super) squared: f64,
    pub(super) distance: f64,
    pub(super) inverse: f64,
}

/// Separations of a block of pairs: vector, squared length, length and inverse length.
#[derive(Debug)]
pub(super) struct Spans<S: Space> {
    between: [S::Vector; BLOCK],
    squared: [f64; BLOCK],
    distance: [f64; BLOCK],
    inverse: [f64; BLOCK],
}

impl<S: Space> Default for Spans<S> {
    fn default() -> Self {
        Self {
            between: [S::Vector::default(); BLOCK],
            squared: [1.0; BLOCK],
            distance: [1.0; BLOCK],
            inverse: [1.0; BLOCK],
        }
    }
}

impl<S: Space> Spans<S> {
    /// Measures a block of at most [`BLOCK`] pairs.
    #[inline(always)]
    pub(super) fn measure<'a, L: ContactLaw<S> + 'a, const PERIODIC: bool>(
        &mut self,
        pairs: impl Iterator<Item = &'a Pair<L::Scale, L::History>>,
        motion: &[Motion<S>],
        offsets: &[S::Vector],
    ) {
        let slots = self.between.iter_mut().zip(&mut self.squared);
        for (pair, (between, squared)) in pairs.zip(slots) {
            let offset = if PERIODIC {
                offsets[pair.offset as usize]
            } else {
                S::Vector::default()
            };
            (*between, *squared) = separation(motion, pair.ends(), &offset, PERIODIC);
        }
        // Always the whole block, filled or not, so that the loop has a fixed length.
        for k in 0..BLOCK {
            self.distance[k] = self.squared[k].sqrt();
            self.inverse[k] = 1.0 / self.distance[k];
        }
    }

    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = PairSpan<'_, S>> {
        let lengths = self.distance.iter().zip(&self.inverse);
        self.between.iter().zip(&self.squared).zip(lengths).map(
            |((between, squared), (distance, inverse))| PairSpan {
                between,
                squared: *squared,
                distance: *distance,
                inverse: *inverse,
            },
        )
    }
}

/// Returns the action of one pair, or none if it is neither in contact nor bonded.
#[inline(always)]
pub(super) fn act<S: Space, L: ContactLaw<S>>(
    rows: &PairTable<L::Row>,
    pair: &mut Pair<L::Scale, L::History>,
    grains: Grains<'_, S>,
    PairSpan {
        between,
        squared,
        distance,
        inverse,
    }: PairSpan<'_, S>,
    record: &mut Record,
    dt: f64,
) -> Option<Action<S>> {
    if squared >= pair.reach * pair.reach && !L::holds(&pair.history) {
        pair.history = L::History::default();
        return None;
    }
    let normal = *between * inverse;
    let overlap = pair.reach - distance;
    let smaller = pair.radius.min(pair.reach - pair.radius);
    record.note(overlap, smaller, pair.first, Partner::Entry(pair.second));
    let first_arm = pair.radius - 0.5 * overlap;
    let second_arm = distance - first_arm;
    let motion = grains.motion;
    let (first, second) = (&motion[pair.first as usize], &motion[pair.second as usize]);
    let velocity = second.velocity - first.velocity;
    let rolling = first.spin * first_arm + second.spin * second_arm;
    let kinematics = ContactKinematics {
        overlap,
        normal,
        separation_rate: normal.scalar(&velocity),
        slip: S::slip(&normal, &velocity, &rolling),
        roll: second.spin - first.spin,
        time_step: dt,
        moisture: grains.moisture::<L>(pair.first, pair.second),
    };
    let constants = L::constants(rows.parameters_at(pair.row), &pair.scale, pair.reach);
    let force = L::force(&constants, &mut pair.history, &kinematics);
    let moment = S::tangent_moment(&force.tangent, &normal);
    let mut action = Action {
        force: normal * force.normal + S::embed(&force.tangent, &normal),
        on_first: moment * -first_arm,
        on_second: moment * -second_arm,
        failure: force.failure,
    };
    if L::HAS_ROLLING {
        action.on_first -= force.moment;
        action.on_second += force.moment;
    }
    Some(action)
}
