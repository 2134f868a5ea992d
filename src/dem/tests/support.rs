//! Helpers for tests of other rooms that use grains.

use super::*;

/// Advances with damping until the grains are at rest, and restores the damping.
pub(crate) fn relax<S: Space>(
    dem: &mut Dem<S>,
    particles: &mut Particles<S>,
    domain: &Domain,
    until: &Relaxation,
) -> Stillness {
    let damping = dem.settings().local_damping;
    dem.set_local_damping(until.local_damping);
    let mut steps = 0;
    let still = loop {
        let batch = until.look_every.max(1).min(until.limit - steps);
        dem.advance_many(particles, domain, batch).unwrap();
        steps += batch;
        let now = dem.stillness(particles, domain);
        if steps >= until.limit || now.unbalanced() <= until.tolerance {
            break now;
        }
    };
    dem.set_local_damping(damping);
    still
}
