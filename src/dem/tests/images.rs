//! Grains that have crossed periodic faces many times.

use decomposition::{Communicator, Domain, Slabs, SplitAxis};
use nalgebra::Vector2;

use super::*;
use crate::particles::{Body, Motion, Particles};
use base::random::Stream;

/// Number of discs along each axis.
const SIDE: u32 = 32;

/// Returns the loads and the number of contacts of touching discs in a periodic box of 1 m, each moved by `periods`.
/// All positions are exact, so that periods change no bit.
fn loads(mut periods: impl FnMut() -> [f64; 2]) -> (Vec<Vector2<f64>>, u64) {
    let spacing = 1.0 / f64::from(SIDE);
    let mut region =
        GrainDomain::<PlaneSpace>::closed(Vector2::zeros(), Vector2::new(1.0, 1.0), spacing);
    region.periodic = [true, true, false];
    let settings = DemSettings::new(region, 1e-6, 0.01 * spacing);
    let mut dem = linear(SPRINGS, settings, Vec::new());
    let slabs = Slabs::from_bounds(SplitAxis::X, vec![0, SIDE as usize], true).unwrap();
    let domain = Domain::new(Communicator::serial(), slabs).unwrap();
    let mut particles = Particles::new();
    for n in 0..SIDE * SIDE {
        let radius = spacing * (0.501 + 0.001 * f64::from(n % 3));
        let [right, up] = periods();
        let x = (f64::from(n % SIDE) + 0.5) * spacing + right;
        let y = (f64::from(n / SIDE) + 0.5) * spacing + up;
        let body = Body::uniform::<PlaneSpace>(u64::from(n), radius, 2600.0, 0);
        let motion = Motion {
            position: Vector2::new(x, y),
            ..Motion::default()
        };
        particles.insert(body, motion);
    }
    dem.prepare(&mut particles, &domain).unwrap();
    let forces = particles.contact[..particles.owned()].iter();
    let contacts = dem.statistics(&particles).contacts;
    (forces.map(|load| load.force).collect(), contacts)
}

/// Checks that discs touch alike whatever periods they have crossed. Their differences are a million: with a table of
/// all of them, or a search in it, this would take hours.
#[test]
fn discs_that_crossed_faces_touch_like_discs_that_did_not() {
    let (still, contacts) = loads(|| [0.0; 2]);
    assert_eq!(contacts, u64::from(2 * SIDE * SIDE));
    assert!(still.iter().any(|force| force.norm() > 0.0));
    let mut stream = Stream::new(7, 0, 0);
    let mut periods = || (4000.0 * stream.uniform()).floor() - 2000.0;
    let (crossed, again) = loads(|| [periods(), periods()]);
    assert_eq!(again, contacts);
    assert_eq!(crossed, still);
}
