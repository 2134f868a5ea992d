//! Which rank owns a grain, the wrap of positions into the box, and the bytes of grains that change their rank.
//!
//! [`super::engine`] sends these bytes with the histories of the contacts.
//!
//! A grain belongs to the rank whose planes contain its centre: plane `floor((x - origin) / spacing)` along the split axis,
//! clamped to the outermost planes where the axis is not periodic. Ownership changes only when lists are made.

use super::columns::Crosses;
use super::escape::Escape;
use super::message::{Reader, Writer};
use super::particles::Particles;
use super::region::{Region, plane_of, wraps};
use super::space::{Components, Space};
use crate::error::Error;
use decomposition::Domain;

/// Moves the shift of every owned grain into the box and checks that none is lost.
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
    domain: &Domain,
) -> Result<Vec<usize>, Error> {
    let (axis, slabs) = (domain.axis().index(), domain.slabs());
    (0..particles.owned())
        .map(|k| {
            let at = particles.location(k).get(axis);
            let plane = plane_of(at, region.lower.get(axis), region.spacing, slabs.planes());
            slabs
                .owner_of_plane(plane)
                .ok_or_else(|| Error::Internal(format!("plane {plane} belongs to no rank")))
        })
        .collect()
}

/// Writes owned grains for their new owner.
pub(super) fn pack_grains<S: Space>(particles: &Particles<S>, leaving: &[usize], to: &mut Writer) {
    to.integer(leaving.len() as u64);
    for &k in leaving {
        particles.pack(k, particles.shift[k], Crosses::Migration, to);
    }
}

/// Appends the grains that [`pack_grains`] wrote on another rank; call without ghosts.
pub(super) fn unpack_grains<S: Space>(
    particles: &mut Particles<S>,
    from: &mut Reader<'_>,
) -> Result<(), Error> {
    for _ in 0..from.integer()? {
        particles.unpack(Crosses::Migration, from)?;
        particles.owned += 1;
    }
    Ok(())
}
