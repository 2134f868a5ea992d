//! Servo walls in the engine: the stress that they reach, what they do without contacts, and equal bits.

use decomposition::SplitAxis;
use nalgebra::Vector2;

use super::same_bits::on_slabs;
use super::*;

const RADIUS: f64 = 1e-3;

fn settings() -> DemSettings<PlaneSpace> {
    let region = GrainDomain::closed(Vector2::zeros(), Vector2::new(0.02, 0.03), 1e-3);
    let mut settings = DemSettings::new(region, 2e-6, 2e-4);
    settings.local_damping = 0.3;
    settings
}

/// Returns two rows of ten discs on a floor between two sides; the plate above them is 0.02 mm away.
fn grains() -> Vec<(Body, Motion<PlaneSpace>)> {
    let place = |n: u64| {
        let (row, column) = (n / 10, n % 10);
        let at = |k: u64| RADIUS * (2.0 * f64::from(u32::try_from(k).unwrap()) + 1.0);
        Vector2::new(at(column), at(row))
    };
    let body = |n| Body::uniform::<PlaneSpace>(n, RADIUS, 2600.0, 0);
    let motion = |n| Motion {
        position: place(n),
        ..Motion::default()
    };
    (0..20).map(|n| (body(n), motion(n))).collect()
}

fn pressed(stress: f64, limit: f64) -> Dem<PlaneSpace> {
    let region = settings().region;
    let mut walls = Wall::of_box(region.lower, region.upper, [true, false, false], 0);
    walls.push(Wall::new(Vector2::zeros(), Vector2::new(0.0, 1.0), 0));
    let plate = Vector2::new(0.0, 4.0 * RADIUS + 2e-5);
    walls.push(Wall::new(plate, Vector2::new(0.0, -1.0), 0));
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(1e6),
        normal_damping_ratio: 0.2,
        friction: 0.0,
        ..SPRINGS
    };
    let mut dem = linear(parameters, settings(), walls);
    dem.set_servos(vec![Servo {
        wall: 3,
        stress,
        gain: 0.5,
        velocity_limit: limit,
        sliding: Vector2::new(0.01, 0.0),
    }]);
    dem
}

fn filled(particles: &mut Particles<PlaneSpace>) {
    for (body, motion) in grains() {
        particles.insert(body, motion);
    }
}

/// Checks a plate that approaches at its velocity limit and then bears the stress: 2 rows and 3 contacts in series,
/// each with the force of a disc, shorten by 3 sigma d/k. The plate slides along its face all the time.
#[test]
fn a_plate_reaches_its_stress() {
    let (stress, limit) = (5e3, 0.05);
    let domain = alone();
    let (mut dem, mut particles) = (pressed(stress, limit), Particles::new());
    filled(&mut particles);
    dem.advance_many(&mut particles, &domain, 10).unwrap();
    let plate = |dem: &Dem<PlaneSpace>| dem.walls()[3].clone();
    assert_eq!(plate(&dem).velocity, Vector2::new(0.01, -limit));
    dem.advance_many(&mut particles, &domain, 20_000).unwrap();
    let height = 4.0 * RADIUS - plate(&dem).point.y;
    let known = 3.0 * stress * 2.0 * RADIUS / 1e6;
    approx::assert_relative_eq!(height, known, max_relative = 1e-6);
    let mut force = 0.0;
    dem.for_each_contact(&particles, |contact| {
        if contact.wall == Some(3) {
            force += contact.normal_force;
        }
    });
    approx::assert_relative_eq!(force / 0.02, stress, max_relative = 1e-6);
    assert!((plate(&dem).velocity.x - 0.01).abs() < 1e-15);
    assert!(plate(&dem).velocity.y.abs() < 1e-8, "{:?}", plate(&dem));
    // It follows another stress, down to none.
    dem.set_servo_stress(0, 1e3);
    dem.advance_many(&mut particles, &domain, 20_000).unwrap();
    let height = 4.0 * RADIUS - plate(&dem).point.y;
    approx::assert_relative_eq!(height, 0.2 * known, max_relative = 1e-6);
}

/// Checks that a plate keeps its stress on a disc that recedes or advances at a constant velocity, for two gains. The
/// disc is too heavy for the plate to move. A control that did not follow the disc would lack 1 % and 5 % of it.
#[test]
fn a_plate_keeps_its_stress_on_a_moving_disc() {
    let (stress, domain) = (1e3, alone());
    for (speed, gain) in [(0.05, 0.5), (0.05, 0.1), (-0.05, 0.1)] {
        let (mut dem, mut particles) = (pressed(stress, 0.2), Particles::new());
        dem.set_servos(vec![Servo {
            wall: 3,
            stress,
            gain,
            velocity_limit: 0.2,
            sliding: Vector2::zeros(),
        }]);
        let motion = Motion {
            position: Vector2::new(0.01, 3.0 * RADIUS),
            velocity: Vector2::new(0.0, -speed),
            ..Motion::default()
        };
        particles.insert(Body::uniform::<PlaneSpace>(0, RADIUS, 1e15, 0), motion);
        dem.advance_many(&mut particles, &domain, 4000).unwrap();
        let mut force = 0.0;
        dem.for_each_contact(&particles, |contact| force += contact.normal_force);
        approx::assert_relative_eq!(force / 0.02, stress, max_relative = 1e-6);
        approx::assert_relative_eq!(particles.motion[0].velocity.y, -speed, max_relative = 1e-5);
    }
}

/// Positions and velocities of all grains and of the plate by id, as bits.
fn bits(dem: &Dem<PlaneSpace>, particles: &Particles<PlaneSpace>) -> Vec<(u64, [u64; 4])> {
    let plate = &dem.walls()[3];
    let of = |at: &Vector2<f64>, v: &Vector2<f64>| [at.x, at.y, v.x, v.y].map(f64::to_bits);
    let mut all = vec![(u64::MAX, of(&plate.point, &plate.velocity))];
    all.extend((0..particles.owned()).map(|k| {
        let motion = &particles.motion[k];
        (particles.body[k].id, of(&motion.position, &motion.velocity))
    }));
    all
}

/// Checks that the motion of a plate cut by slabs depends neither on the slabs nor on the division of the steps into
/// calls.
#[test]
fn a_plate_moves_alike_on_any_number_of_ranks() {
    let run = |bounds: &[usize], calls: u64| {
        let parts = on_slabs(SplitAxis::X, bounds, |domain| {
            let (mut dem, mut particles) = (pressed(5e3, 0.05), Particles::new());
            if domain.rank() == 0 {
                filled(&mut particles);
            }
            for _ in 0..calls {
                dem.advance_many(&mut particles, &domain, 1200 / calls)
                    .unwrap();
            }
            bits(&dem, &particles)
        });
        let mut all: Vec<_> = parts.into_iter().flatten().collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let one = run(&[0, 20], 1);
    assert_eq!(one.len(), 21);
    assert_eq!(one, run(&[0, 20], 300));
    assert_eq!(one, run(&[0, 9, 20], 1));
    assert_eq!(one, run(&[0, 5, 12, 20], 4));
}
