//! Contact bonds and resistance to rolling.

use approx::assert_relative_eq;
use nalgebra::Vector3;

use super::super::contact::contact_bond::{self, ContactBond};
use super::super::contact::rolling::{self, Rolling};
use super::super::contact::{ContactLaw, ContactModel};
use super::*;

/// Clay with contact bonds: k_n = k_s = 1e6 N/m, strength 10 N in tension and 50 N in shear. A bond breaks at an
/// opening of 1e-5 m or a shear displacement of 5e-5 m.
pub(super) const CLAY: contact_bond::ContactBondParameters = contact_bond::ContactBondParameters {
    linear: linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(1e6),
        ..SPRINGS
    },
    tensile_strength: 10.0,
    shear_strength: 50.0,
    bonding_gap: 0.0,
    unstressed: false,
};

pub(super) fn clay<S: Space>(
    parameters: contact_bond::ContactBondParameters,
    settings: DemSettings<S>,
    walls: Vec<Wall<S>>,
) -> Dem<S> {
    let law = Law::ContactBond(ContactBond {
        parameters: PairTable::uniform(1, parameters),
    });
    Dem::new(law, settings, walls).unwrap()
}

const DIAMETER: f64 = 2e-3;

/// Returns a fixed sphere and one too heavy for contacts to move, bonded at `overlap`; the second's velocity is metres
/// per step.
fn pair(
    parameters: contact_bond::ContactBondParameters,
    overlap: f64,
) -> (Dem<Volume>, Particles<Volume>, u64) {
    let settings = DemSettings::new(about_origin::<Volume>(0.1), 1.0, 1e-4);
    let mut dem = clay(parameters, settings, Vec::new());
    let mut particles = Particles::new();
    let body = Body::uniform::<Volume>(1, 0.5 * DIAMETER, 2600.0, 0);
    particles.insert(
        Body {
            kind: Kind::Fixed,
            ..body
        },
        Motion::default(),
    );
    let heavy = Body {
        id: 2,
        mass: 1e30,
        inertia: 1e30,
        ..body
    };
    let motion = Motion {
        position: Vector3::new(DIAMETER - overlap, 0.0, 0.0),
        ..Motion::default()
    };
    particles.insert(heavy, motion);
    let bonds = dem
        .bond_existing_contacts(&mut particles, &alone())
        .unwrap();
    (dem, particles, bonds)
}

#[test]
fn a_bond_pulls_up_to_its_tensile_strength() {
    let (mut dem, mut particles, bonds) = pair(CLAY, 1e-9);
    assert_eq!(bonds, 1);
    let step = 2e-8;
    particles.motion[1].velocity = Vector3::new(step, 0.0, 0.0);
    let mut opened = None;
    let mut most = 0.0_f64;
    for _ in 0..600 {
        dem.advance(&mut particles, &alone()).unwrap();
        let gap = particles.motion[1].position[0] - DIAMETER;
        let pull = -particles.contact[1].force[0];
        if let Some(broken) = dem.take_breaks().pop() {
            assert_eq!(
                (broken.mode, broken.grain, broken.other),
                (Failure::Tension, 1, Some(2))
            );
            assert_eq!(pull, 0.0);
            opened = Some(gap);
        } else if opened.is_none() {
            assert_relative_eq!(pull, 1e6 * gap, epsilon = 1e-6);
            most = most.max(pull);
        } else {
            assert_eq!(pull, 0.0, "a broken bond does not heal");
        }
    }
    // T/k_n = 1e-5 m, to one step.
    assert_relative_eq!(opened.unwrap(), 1e-5, epsilon = 1.01 * step);
    assert_relative_eq!(most, 10.0, epsilon = 1.01e6 * step);
    assert_eq!(dem.statistics(&particles).bonds, 0);
}

/// Checks a bond sheared under 20 N: no sliding at mu F_n = 10 N, failure at 50 N, then friction alone.
#[test]
fn a_bond_does_not_slip_and_fails_in_shear() {
    let (mut dem, mut particles, _) = pair(CLAY, 2e-5);
    let step = 1e-7;
    particles.motion[1].velocity = Vector3::new(0.0, step, 0.0);
    let (mut most, mut failed) = (0.0_f64, None);
    for n in 1..=700_u32 {
        dem.advance(&mut particles, &alone()).unwrap();
        let normal = particles.motion[1].position.normalize();
        let force = particles.contact[1].force;
        let shear = (force - normal * force.dot(&normal)).norm();
        if let Some(broken) = dem.take_breaks().pop() {
            assert_eq!(broken.mode, Failure::Shear);
            failed = Some(f64::from(n) * step);
        }
        if failed.is_none() {
            most = most.max(shear);
        }
    }
    assert_relative_eq!(failed.unwrap(), 5e-5, max_relative = 0.01);
    assert_relative_eq!(most, 50.0, max_relative = 0.01);
    let force = particles.contact[1].force;
    // The line of centres has turned by 0.03: friction is along the turned tangent.
    let distance = particles.motion[1].position.norm();
    let normal = particles.motion[1].position / distance;
    let pressure = force.dot(&normal);
    let shear = (force - normal * pressure).norm();
    assert_relative_eq!(pressure, 1e6 * (DIAMETER - distance), max_relative = 1e-9);
    assert_relative_eq!(shear, 0.5 * pressure, max_relative = 1e-9);
}

/// Pairs within the gap are bonded and no others; across a gap a bond acts immediately or starts without a force.
#[test]
fn bonds_form_across_the_bonding_gap() {
    let gap = 4e-6;
    for (bonding_gap, unstressed, bonds, pull) in [
        (0.0, false, 0, 0.0),
        (3.9e-6, false, 0, 0.0),
        (4.1e-6, false, 1, 4.0),
        (4.1e-6, true, 1, 0.0),
    ] {
        let parameters = contact_bond::ContactBondParameters {
            bonding_gap,
            unstressed,
            ..CLAY
        };
        let (mut dem, mut particles, made) = pair(parameters, -gap);
        assert_eq!(made, bonds);
        dem.advance(&mut particles, &alone()).unwrap();
        assert_relative_eq!(-particles.contact[1].force[0], pull, epsilon = 1e-9);
        let mut reported = Vec::new();
        dem.for_each_contact(&particles, |contact| reported.push(contact.normal_force));
        assert_eq!(reported.len() as u64, bonds);
        if let Some(force) = reported.pop() {
            assert_relative_eq!(-force, pull, epsilon = 1e-9);
        }
        if bonds > 0 {
            // The bond breaks at an opening of T/k_n, measured from its zero-force position.
            particles.motion[1].velocity = Vector3::new(1e-8, 0.0, 0.0);
            let mut steps = 0.0;
            while dem.take_breaks().is_empty() {
                dem.advance(&mut particles, &alone()).unwrap();
                steps += 1.0;
                assert!(steps < 2000.0);
            }
            let open = if unstressed { gap } else { 0.0 } + 1e-5;
            assert_relative_eq!(gap + steps * 1e-8, open, epsilon = 2.1e-8);
        }
    }
}

/// Checks a sphere on a plane with rolling friction mu_r: it decelerates by 5/7 mu_r g, and is stationary on a slope
/// below mu_r (Ai 2011).
#[test]
fn rolling_friction_slows_and_holds() {
    let (radius, g, mu_r) = (0.05, 9.81, 0.1);
    let body = Body::uniform::<Volume>(1, radius, 2600.0, 0);
    let stiffness = 1e6;
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(stiffness),
        friction: 0.8,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.3,
        ..SPRINGS
    };
    let roll = |speed: f64, slope: f64, time: f64| {
        let law = Law::RollingLinear(Rolling {
            law: Linear {
                parameters: PairTable::uniform(1, parameters),
            },
            parameters: PairTable::uniform(
                1,
                rolling::RollingParameters {
                    friction: mu_r,
                    damping_ratio: 0.3,
                },
            ),
        });
        let mut settings = DemSettings::new(
            about_origin::<Volume>(5.0),
            0.05 * (body.mass / stiffness).sqrt(),
            1e-2,
        );
        let (sin, cos) = slope.sin_cos();
        settings.gravity = Vector3::new(g * sin, 0.0, -g * cos);
        let floor = Wall::new(Vector3::zeros(), Vector3::z(), 0);
        let mut dem = Dem::new(law, settings, vec![floor]).unwrap();
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(0.0, 0.0, radius - body.mass * g * cos / stiffness),
            velocity: Vector3::new(speed, 0.0, 0.0),
            spin: Vector3::new(0.0, speed / radius, 0.0),
        };
        particles.insert(body, motion);
        while dem.time() < time {
            dem.advance_many(&mut particles, &alone(), 50).unwrap();
        }
        (particles.motion[0], dem.time())
    };
    let (motion, time) = roll(1.0, 0.0, 0.5);
    assert_relative_eq!(
        motion.velocity[0],
        1.0 - 5.0 / 7.0 * mu_r * g * time,
        max_relative = 0.01
    );
    assert_relative_eq!(
        motion.spin[1] * radius,
        motion.velocity[0],
        max_relative = 0.01
    );
    // Below the slope of mu_r it creeps no further than the springs bend; above it rolls with the rest.
    let (held, _) = roll(0.0, 0.09_f64.atan(), 0.5);
    assert!(
        held.position[0].abs() < 2e-3 && held.velocity[0].abs() < 1e-3,
        "{held:?}"
    );
    let slope = 0.2_f64.atan();
    let (rolls, time) = roll(0.0, slope, 0.5);
    let expected = 5.0 / 7.0 * g * (slope.sin() - mu_r * slope.cos());
    assert_relative_eq!(rolls.velocity[0] / time, expected, max_relative = 0.02);
}

#[test]
fn soft_springs_of_a_preparation_reach_no_further_than_grains_touch() {
    let mut law = ContactBond {
        parameters: PairTable::uniform(1, CLAY),
    };
    let opening =
        |law: &ContactBond| ContactLaw::<Volume>::widest_opening(law, [DIAMETER, DIAMETER]);
    assert_relative_eq!(opening(&law), 1e-5);
    // A changed coefficient of friction alone does not affect the bonds.
    ContactModel::prepare(&mut law, None, Some(0.1));
    assert_relative_eq!(opening(&law), 1e-5);
    // Bonds of full strength on springs of 1 kN/m would open by 1e-2 m, five diameters.
    ContactModel::prepare(&mut law, Some(1e3), None);
    assert_relative_eq!(opening(&law), 0.0);
}
