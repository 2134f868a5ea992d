//! The law of Hertz and Mindlin: collisions compared with closed forms, conserved quantities, and the critical time
//! step.

use approx::assert_relative_eq;
use nalgebra::{Rotation3, Vector3};

use super::super::contact::hertz_mindlin::{
    Elastic, HertzMindlin, HertzMindlinParameters, damping,
};
use super::*;
use base::random::Stream;

/// Chung and Ooi's glass.
const GLASS: Elastic = Elastic {
    young_modulus: 4.8e10,
    poisson_ratio: 0.2,
};

pub(super) fn elastic(friction: f64, restitution: f64, attraction: bool) -> Law {
    Law::HertzMindlin(HertzMindlin {
        parameters: PairTable::uniform(
            1,
            HertzMindlinParameters {
                moduli: GLASS.effective(GLASS),
                friction,
                damping: damping(restitution, attraction),
                attraction,
                impact_speed: 1.0,
            },
        ),
        materials: Vec::new(),
    })
}

/// Checks that the restitution is the given one at every speed and size, with and without attraction.
#[test]
fn restitution_does_not_depend_on_the_speed() {
    for (e, speed, attraction) in [
        (1.0, 1.0, false),
        (0.9, 0.01, false),
        (0.5, 1.0, false),
        (0.5, 30.0, true),
        (0.2, 1.0, true),
        (0.2, 0.1, false),
        (0.05, 1.0, false),
    ] {
        let law = elastic(0.3, e, attraction);
        let bodies = [1e-3, 2e-3].map(|r| Body::uniform::<Volume>(1, r, 2500.0, 0));
        let mass = bodies[0].mass * bodies[1].mass / (bodies[0].mass + bodies[1].mass);
        let [young, _] = GLASS.effective(GLASS);
        // Hertz: 2.87 (m*²/(R* E*² v))^(1/5).
        let duration = 2.868 * (mass * mass / (2e-3 / 3.0 * young * young * speed)).powf(0.2);
        let settings = DemSettings::new(about_origin::<Volume>(0.1), duration / 4000.0, 1e-4);
        let mut dem = Dem::new(law, settings, Vec::new()).unwrap();
        let mut particles = Particles::new();
        for (k, body) in (0..2_u32).zip(bodies) {
            let motion = Motion {
                position: Vector3::new(3e-3 * f64::from(k), 0.0, 0.0),
                velocity: Vector3::new(speed * (1.0 - f64::from(k)), 0.0, 0.0),
                ..Motion::default()
            };
            let id = u64::from(k) + 1;
            particles.insert(Body { id, ..body }, motion);
        }
        dem.advance_many(&mut particles, &alone(), 40_000).unwrap();
        let leaving = particles.motion[1].velocity[0] - particles.motion[0].velocity[0];
        assert_relative_eq!(leaving / speed, e, max_relative = 2e-3);
    }
}

/// Checks oblique collisions with friction, spin and dashpots: the angular momentum is constant to 1e-10 of its parts,
/// and the energy of elastic collisions never grows.
#[test]
fn collisions_keep_angular_momentum() {
    let (mut worst, mut stuck) = (0.0_f64, 0);
    for k in 0..20 {
        let mut draw = Stream::new(21, k, 0);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * (2.0 * draw.uniform() - 1.0));
        let turn = Rotation3::new(vector(3.0));
        let between = turn * Vector3::new(2.7001e-3, 0.0, 0.0);
        let tangential = if k % 2 == 0 { 0.05 } else { 0.4 };
        let e = if k % 4 < 2 { 1.0 } else { 0.6 };
        let settings = DemSettings::new(about_origin::<Volume>(0.02), 5e-9, 1e-4);
        let mut dem = Dem::new(elastic(0.35, e, false), settings, Vec::new()).unwrap();
        let mut particles = Particles::new();
        let first = vector(1e-3);
        for (id, radius, position, sign) in
            [(1, 1e-3, first, 1.0), (2, 1.7e-3, first + between, -1.0)]
        {
            let motion = Motion {
                position,
                velocity: vector(tangential) + between * (150.0 * sign),
                spin: vector(tangential * 500.0),
            };
            particles.insert(Body::uniform::<Volume>(id, radius, 2600.0, 0), motion);
        }
        let total = |particles: &Particles<Volume>| {
            let (mut sum, mut scale, mut energy) = (Vector3::zeros(), 0.0, 0.0);
            for (body, m) in particles.body.iter().zip(&particles.motion) {
                let orbit = m.position.cross(&m.velocity) * body.mass;
                let spin = m.spin * body.inertia;
                sum += orbit + spin;
                scale += orbit.norm() + spin.norm();
                energy += 0.5 * (body.mass * m.velocity.norm_squared() + m.spin.dot(&spin));
            }
            (sum, scale, energy)
        };
        let (before, scale, energy) = total(&particles);
        dem.advance_many(&mut particles, &alone(), 4000).unwrap();
        let apart = particles.motion[1].position - particles.motion[0].position;
        assert!(apart.norm() > 2.7e-3, "they must have parted");
        let (after, _, left) = total(&particles);
        worst = worst.max((after - before).norm() / scale);
        assert!(left < energy * (1.0 + 1e-6), "{left} of {energy}");
        stuck += u32::from(e >= 1.0 && left > 0.97 * energy);
    }
    assert!(worst < 1e-10, "{worst:e}");
    assert!(stuck > 0, "some collisions must stick and lose little");
}

/// Checks Chung and Ooi's test 7: equal and opposite spins roll over each other without slip, so that there is no shear
/// force and the spins remain.
#[test]
fn equal_and_opposite_spins_roll_off_each_other() {
    let settings = DemSettings::new(about_origin::<Volume>(1.0), 1e-6, 1e-3);
    let mut dem = Dem::new(elastic(0.4, 0.5, false), settings, Vec::new()).unwrap();
    let mut particles = Particles::new();
    for (id, sign) in [(1, -1.0), (2, 1.0)] {
        let motion = Motion {
            position: Vector3::new(0.1 * sign, 0.0, 0.0),
            velocity: Vector3::new(-0.2 * sign, 0.0, 0.0),
            spin: Vector3::new(0.0, 0.0, 10.0 * sign),
        };
        particles.insert(Body::uniform::<Volume>(id, 0.1, 2700.0, 0), motion);
    }
    dem.advance_many(&mut particles, &alone(), 3000).unwrap();
    for (motion, sign) in particles.motion.iter().zip([-1.0, 1.0]) {
        assert_relative_eq!(motion.velocity[0], 0.1 * sign, max_relative = 2e-3);
        assert_relative_eq!(motion.spin[2], 10.0 * sign, max_relative = 1e-12);
        assert!(motion.velocity[1].abs() < 1e-12);
    }
}

/// Checks that a spring sheared at a large overlap and released at a small one returns less energy than it received:
/// the part that a smaller contact cannot carry is lost (Thornton et al. 2013).
#[test]
fn a_shrinking_contact_lets_go_of_shear() {
    let settings = DemSettings::new(about_origin::<Volume>(0.1), 1.0, 1e-4);
    let mut dem = Dem::new(elastic(50.0, 1.0, false), settings, Vec::new()).unwrap();
    let mut particles = Particles::new();
    let body = Body::uniform::<Volume>(1, 1e-3, 2600.0, 0);
    let fixed = Body {
        kind: Kind::Fixed,
        ..body
    };
    // Too heavy for the contact to change its motion; steps of 1 s.
    let heavy = Body {
        id: 2,
        mass: 1e30,
        inertia: 1e30,
        ..body
    };
    particles.insert(fixed, Motion::default());
    let motion = Motion {
        position: Vector3::new(2e-3 - 1e-6, 0.0, 0.0),
        ..Motion::default()
    };
    particles.insert(heavy, motion);
    let shear = |particles: &Particles<Volume>| particles.contact[1].force[1].abs();
    particles.motion[1].velocity = Vector3::new(0.0, 1e-9, 0.0);
    dem.advance_many(&mut particles, &alone(), 10).unwrap();
    // 8 G* sqrt(R* overlap) of the way.
    let [_, g] = GLASS.effective(GLASS);
    let stiffness = 8.0 * g * (0.5e-3_f64 * 1e-6).sqrt();
    assert_relative_eq!(shear(&particles), stiffness * 1e-8, max_relative = 1e-3);
    let loaded = shear(&particles);
    particles.motion[1].velocity = Vector3::new(7.5e-8, 0.0, 0.0);
    dem.advance_many(&mut particles, &alone(), 10).unwrap();
    // A quarter of the overlap, half the radius of the contact.
    assert_relative_eq!(shear(&particles), 0.5 * loaded, max_relative = 1e-3);
    // Pressed in again, the force does not return by itself.
    particles.motion[1].velocity = Vector3::new(-7.5e-8, 0.0, 0.0);
    dem.advance_many(&mut particles, &alone(), 10).unwrap();
    assert_relative_eq!(shear(&particles), 0.5 * loaded, max_relative = 1e-3);
}

/// Checks the critical step, sqrt(m/k) at the overlap of the expected impact.
#[test]
fn the_critical_step_is_that_of_the_deepest_overlap() {
    let body = Body::uniform::<Volume>(1, 1e-3, 2600.0, 0);
    let [young, _] = GLASS.effective(GLASS);
    let (mass, radius) = (body.mass, body.radius);
    let overlap = (15.0 * mass / (16.0 * young * radius.sqrt())).powf(0.4);
    let expected = (mass / (2.0 * young * (radius * overlap).sqrt())).sqrt();
    let law = elastic(0.3, 1.0, false);
    let found = law.critical_time_step::<Volume>(&[body], 1);
    assert_relative_eq!(found, expected, max_relative = 1e-12);
}
