//! Ownership of grains, wrapping of positions into the box, and the bytes of grains that change their rank.
//!
//! [`super::engine`] sends these bytes with the histories of the contacts.
//!
//! A grain belongs to the rank whose planes contain its centre: plane `floor((x - origin) / spacing)` along the
//! split axis, clamped to the outermost planes if the axis is not periodic. Ownership changes only when lists are
//! built.

use super::columns::Crosses;
use super::escape::Escape;
use super::message::{Reader, Writer};
use super::particles::{Motion, Particles, image_position};
use super::region::{GrainDomain, plane_of, wraps};
use super::space::{Components, Space};
use base::error::Error;
use base::thread_pool;
use decomposition::Domain;
use std::sync::atomic::{AtomicBool, Ordering};

/// Sets the shift of every owned grain so that its image lies in the box, and checks that no grain is lost.
pub(super) fn wrap<S: Space>(
    particles: &mut Particles<S>,
    region: &GrainDomain<S>,
) -> Result<(), Error> {
    let owned = particles.owned();
    let lengths = particles.lengths;
    let (motion, shifts) = (&particles.motion[..owned], &mut particles.shift[..owned]);
    let astray = AtomicBool::new(false);
    thread_pool::each_item(shifts, PER_THREAD, |k, shift| {
        match shift_of::<S>(&motion[k], *shift, &lengths, region) {
            Ok(into) => *shift = into,
            Err(_) => astray.store(true, Ordering::Relaxed),
        }
    });
    if astray.into_inner() {
        for k in 0..owned {
            let found = shift_of::<S>(&particles.motion[k], particles.shift[k], &lengths, region);
            match found {
                Ok(_) => {}
                Err(StrayReason::Lost) => return Err(lost(particles, k, "is lost")),
                Err(StrayReason::Out { axis, upper }) => {
                    let grain = particles.body[k].id;
                    let escape = Escape { grain, axis, upper };
                    return Err(named(particles, k, &escape.to_string()));
                }
            }
        }
    }
    Ok(())
}

/// Minimum number of grains per thread.
const PER_THREAD: usize = 1000;

/// Reason why a grain is outside the box.
enum StrayReason {
    /// Position very far away or not finite.
    Lost,
    /// Position beyond the box by more than its length.
    Out { axis: usize, upper: bool },
}

/// Returns the shift that moves a grain into the box.
fn shift_of<S: Space>(
    motion: &Motion<S>,
    mut shift: [i32; 3],
    lengths: &[f64; 3],
    region: &GrainDomain<S>,
) -> Result<[i32; 3], StrayReason> {
    let place = image_position(motion, shift, lengths);
    for axis in 0..S::DIMENSION {
        let at = place.get(axis);
        let (lower, length) = (region.lower.get(axis), region.length(axis));
        if !at.is_finite() || (at - lower).abs() > 1e6 * length {
            return Err(StrayReason::Lost);
        }
        if region.periodic[axis] {
            shift[axis] = wraps(motion.position.get(axis), lower, length);
        } else if !(lower - length..=lower + 2.0 * length).contains(&at)
            && !region.passed_an_exit(&place)
        {
            let upper = at > lower;
            return Err(StrayReason::Out { axis, upper });
        }
    }
    Ok(shift)
}

/// Returns the error that names a grain.
pub(super) fn lost<S: Space>(particles: &Particles<S>, k: usize, what: &str) -> Error {
    named(
        particles,
        k,
        &format!("grain {} {what}", particles.body[k].id),
    )
}

/// Returns an error about a grain with its position and velocity.
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

/// Returns the present owner of each owned grain.
pub(super) fn owners<S: Space>(
    particles: &Particles<S>,
    region: &GrainDomain<S>,
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

/// Appends the grains written by [`pack_grains`] on another rank; call it when there are no ghosts.
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
