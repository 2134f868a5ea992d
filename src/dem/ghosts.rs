//! Who owns a grain and who sees it: migration and ghosts, both done when the neighbour lists are made.
//!
//! A grain belongs to the rank whose planes hold its centre: `floor((x - origin) / spacing)` along the split axis, clamped to
//! the outermost planes where the axis is not periodic. Its ghosts go to every rank that may need them: where the slab,
//! widened by the largest radius *that rank* owns, comes within the interaction range, so that one giant does not make all
//! grains ghosts everywhere. A body larger than a slab is a normal case: every rank in its range is listed.

use super::escape::Escape;
use super::particles::{GhostPlan, Particles, pack_ghost, unpack_ghost};
use super::ranks::{Ranks, Reader, Writer, gather_all};
use super::space::{Components, Space};
use crate::error::Error;

/// The box the grains live in, and the planes of the split axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region<S: Space> {
    /// Lower corner (m).
    pub lower: S::Vector,
    /// Upper corner (m).
    pub upper: S::Vector,
    /// Which axes are periodic.
    pub periodic: [bool; 3],
    /// Thickness of one plane of the split axis (m), counted from the lower corner.
    pub spacing: f64,
}

impl<S: Space> Region<S> {
    /// A box without periodic axes, split in planes of `spacing` (m).
    #[must_use]
    pub fn closed(lower: S::Vector, upper: S::Vector, spacing: f64) -> Self {
        Self {
            lower,
            upper,
            periodic: [false; 3],
            spacing,
        }
    }

    pub(super) fn length(&self, axis: usize) -> f64 {
        self.upper.get(axis) - self.lower.get(axis)
    }

    /// Length along periodic axes, else 0.
    pub(super) fn periodic_lengths(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.periodic[axis] {
                self.length(axis)
            } else {
                0.0
            }
        })
    }

    /// The lower corner, 0 along axes that are not there.
    pub(super) fn origin(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION {
                self.lower.get(axis)
            } else {
                0.0
            }
        })
    }

    pub(super) fn any_periodic(&self) -> bool {
        self.periodic[..S::DIMENSION].contains(&true)
    }
}

/// The plane a coordinate lies in, clamped to `0..planes`.
#[expect(
    clippy::cast_possible_truncation,
    reason = "clamped; a cast of a float saturates"
)]
fn plane_of(coordinate: f64, origin: f64, spacing: f64, planes: i64) -> i64 {
    (((coordinate - origin) / spacing).floor() as i64).clamp(0, planes - 1)
}

/// How many box lengths to add to bring a raw `coordinate` into `[lower, lower + length)`: nothing else decides.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a grain beyond 2^31 box lengths is caught as lost"
)]
pub(super) fn wraps(coordinate: f64, lower: f64, length: f64) -> i32 {
    -(((coordinate - lower) / length).floor() as i32)
}

#[expect(
    clippy::cast_precision_loss,
    reason = "plane counts are far below 2^53"
)]
fn edge(plane: i64, lower: f64, spacing: f64) -> f64 {
    lower + plane as f64 * spacing
}

/// Brings every owned grain's shift into the box and checks that none is lost.
pub(super) fn wrap<S: Space>(
    particles: &mut Particles<S>,
    region: &Region<S>,
) -> Result<(), Error> {
    for k in 0..particles.owned() {
        for axis in 0..S::DIMENSION {
            let at = particles.location(k).get(axis);
            let (lower, length) = (region.lower.get(axis), region.length(axis));
            if !at.is_finite() || (at - lower).abs() > 1e6 * length {
                return Err(lost(particles, k, "is lost"));
            }
            if region.periodic[axis] {
                let raw = particles.motion[k].position.get(axis);
                particles.shift[k][axis] = wraps(raw, lower, length);
            } else if !(lower - length..=lower + 2.0 * length).contains(&at) {
                let escape = Escape {
                    grain: particles.body[k].id,
                    axis,
                    upper: at > lower,
                };
                return Err(named(particles, k, &escape.to_string()));
            }
        }
    }
    Ok(())
}

/// The error that names a grain.
pub(super) fn lost<S: Space>(particles: &Particles<S>, k: usize, what: &str) -> Error {
    named(
        particles,
        k,
        &format!("grain {} {what}", particles.body[k].id),
    )
}

/// A sentence about a grain with where it is and how it moves.
fn named<S: Space>(particles: &Particles<S>, k: usize, what: &str) -> Error {
    let motion = &particles.motion[k];
    let show = |v: &S::Vector| {
        let numbers: Vec<String> = (0..S::DIMENSION)
            .map(|axis| format!("{:e}", v.get(axis)))
            .collect();
        numbers.join(", ")
    };
    Error::Numerical(format!(
        "{what}: position ({}) m, velocity ({}) m/s",
        show(&particles.location(k)),
        show(&motion.velocity)
    ))
}

/// The rank that owns each own grain now.
pub(super) fn owners<S: Space>(
    particles: &Particles<S>,
    region: &Region<S>,
    ranks: &dyn Ranks,
) -> Result<Vec<usize>, Error> {
    let axis = ranks.axis();
    let slabs: Vec<_> = (0..ranks.size())
        .map(|rank| ranks.planes_of(rank))
        .collect();
    (0..particles.owned())
        .map(|k| {
            let at = particles.location(k).get(axis);
            let plane = plane_of(at, region.lower.get(axis), region.spacing, ranks.planes());
            slabs
                .iter()
                .position(|slab| slab.contains(&plane))
                .ok_or_else(|| Error::Internal(format!("plane {plane} belongs to no rank")))
        })
        .collect()
}

/// What all ranks know of each other when lists are made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Census {
    pub(super) owned: u64,
    pub(super) added: u64,
    pub(super) removed: u64,
    pub(super) smallest: f64,
    pub(super) largest: f64,
}

/// Every rank's census, by rank. Collective.
pub(super) fn census<S: Space>(
    particles: &Particles<S>,
    ranks: &dyn Ranks,
) -> Result<Vec<Census>, Error> {
    let mut mine = Writer::default();
    mine.integer(particles.owned() as u64);
    mine.integer(particles.added);
    mine.integer(particles.removed);
    let radii = || {
        particles.body[..particles.owned()]
            .iter()
            .map(|body| body.radius)
    };
    mine.float(radii().fold(f64::INFINITY, f64::min));
    mine.float(radii().fold(0.0, f64::max));
    gather_all(ranks, &mine.0)?
        .iter()
        .map(|bytes| {
            let mut reader = Reader(bytes);
            Ok(Census {
                owned: reader.integer()?,
                added: reader.integer()?,
                removed: reader.integer()?,
                smallest: reader.float()?,
                largest: reader.float()?,
            })
        })
        .collect()
}

/// Makes the ghosts of every rank. `range` is what the gap between two surfaces may be for the pair to be listed, `margin` how
/// far beyond a slab a body is wanted for other reasons than contacts. Call without ghosts. Collective.
pub(super) fn make<S: Space>(
    particles: &mut Particles<S>,
    region: &Region<S>,
    census: &[Census],
    range: f64,
    margin: f64,
    ranks: &dyn Ranks,
) -> Result<(), Error> {
    let owned = particles.owned();
    if owned >= u32::MAX as usize / 2 {
        return Err(Error::Internal(format!(
            "{owned} grains on one rank are more than the lists can number"
        )));
    }
    let split = ranks.axis();
    let mut plan = GhostPlan::default();
    let mut images: Vec<(usize, [i32; 3])> = Vec::new();
    let mut shifts = Vec::new();
    let mut messages = Vec::new();
    for (target, of_target) in census.iter().enumerate() {
        let slab = ranks.planes_of(target);
        if slab.is_empty() || (target == ranks.rank() && !region.any_periodic()) {
            continue;
        }
        let (mut lower, mut upper) = (region.lower, region.upper);
        for axis in 0..S::DIMENSION {
            if axis == split && ranks.size() > 1 {
                lower.set(
                    axis,
                    edge(slab.start, region.lower.get(axis), region.spacing),
                );
                upper.set(axis, edge(slab.end, region.lower.get(axis), region.spacing));
            }
            if !region.periodic[axis] {
                // Grains outside the box belong to the outermost planes.
                if axis != split || slab.start == 0 {
                    lower.set(axis, f64::NEG_INFINITY);
                }
                if axis != split || slab.end == ranks.planes() {
                    upper.set(axis, f64::INFINITY);
                }
            }
        }
        let mut writer = Writer::default();
        let mut entries = Vec::new();
        for k in 0..owned {
            // A little more than needed, so that rounding on the way never decides.
            let reach =
                (particles.body[k].radius + of_target.largest.max(margin) + range) * (1.0 + 1e-9);
            image_shifts(particles, k, region, (&lower, &upper), reach, &mut shifts);
            for &shift in &shifts {
                if target == ranks.rank() {
                    if shift != particles.shift[k] {
                        images.push((k, shift));
                    }
                } else {
                    pack_ghost(particles, k, shift, &mut writer);
                    entries.push(index(k));
                }
            }
        }
        if !entries.is_empty() {
            plan.sends.push((target, entries));
        }
        if !writer.0.is_empty() {
            messages.push((target, writer.0));
        }
    }
    for (k, shift) in images {
        plan.images.push((index(k), index(particles.len())));
        particles.push_image(k, shift);
    }
    for (source, bytes) in ranks.exchange(messages)? {
        let start = particles.len();
        let mut reader = Reader(&bytes);
        while !reader.is_empty() {
            unpack_ghost(particles, &mut reader)?;
        }
        plan.receives.push((source, start..particles.len()));
    }
    particles.plan = plan;
    Ok(())
}

/// An entry's number in 32 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "`make` refuses more than 2^31 grains on a rank"
)]
pub(super) fn index(k: usize) -> u32 {
    k as u32
}

/// The shifts of all images of grain `k` whose centre lies within `reach` of the box `bounds`.
fn image_shifts<S: Space>(
    particles: &Particles<S>,
    k: usize,
    region: &Region<S>,
    bounds: (&S::Vector, &S::Vector),
    reach: f64,
    shifts: &mut Vec<[i32; 3]>,
) {
    shifts.clear();
    let mut spans = [(0, 0); 3];
    let at = particles.location(k);
    for (axis, span) in spans.iter_mut().enumerate().take(S::DIMENSION) {
        let x = at.get(axis);
        let (low, high) = (bounds.0.get(axis) - reach, bounds.1.get(axis) + reach);
        if region.periodic[axis] {
            let length = region.length(axis);
            *span = (-whole((x - low) / length), whole((high - x) / length));
        } else if x < low || x > high {
            return;
        }
    }
    for a in spans[0].0..=spans[0].1 {
        for b in spans[1].0..=spans[1].1 {
            for c in spans[2].0..=spans[2].1 {
                let own = particles.shift[k];
                shifts.push([own[0] + a, own[1] + b, own[2] + c]);
            }
        }
    }
}

/// The next whole number below.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a few box lengths at most: grains lie inside the box"
)]
fn whole(value: f64) -> i32 {
    value.floor() as i32
}
