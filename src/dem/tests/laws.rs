//! Trajectories of single pairs and grains against exact results and other codes.

use approx::assert_relative_eq;
use nalgebra::{Vector2, Vector3};

use super::super::contact::hertz_mindlin::{self, HertzMindlin};
use super::*;

/// Returns the nearest whole number.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of steps, positive and small"
)]
fn whole(value: f64) -> u64 {
    value.round() as u64
}

/// Returns the restitution, duration over `sqrt(m*/k)` and depth over `v0 sqrt(m*/k)` of a head-on collision of unequal
/// grains.
fn collide<S: Space>(zeta: f64, attraction: bool) -> [f64; 3] {
    let parameters = linear::LinearParameters {
        normal_damping_ratio: zeta,
        attraction,
        friction: 0.0,
        ..SPRINGS
    };
    let bodies = [
        Body::uniform::<S>(1, 1e-3, 2600.0, 0),
        Body::uniform::<S>(2, 2e-3, 2600.0, 0),
    ];
    let mass = bodies[0].mass * bodies[1].mass / (bodies[0].mass + bodies[1].mass);
    let unit = (mass / 1e5_f64).sqrt();
    let settings = DemSettings::new(about_origin::<S>(1.0), unit * 5e-5, 1e-4);
    let mut dem = linear(parameters, settings, Vec::new());
    let mut particles = Particles::new();
    let speed = 0.3;
    for (k, body) in bodies.into_iter().enumerate() {
        let mut motion = Motion::<S>::default();
        motion.position.set(0, if k == 0 { 0.0 } else { 3e-3 });
        motion.velocity.set(0, if k == 0 { speed } else { 0.0 });
        particles.insert(body, motion);
    }
    let (mut steps, mut depth) = (0.0, 0.0_f64);
    loop {
        dem.advance(&mut particles, &alone()).unwrap();
        let overlap = 3e-3 - (particles.motion[1].position - particles.motion[0].position).length();
        depth = depth.max(overlap);
        if overlap <= 0.0 {
            break;
        }
        // Without attraction the contact ends where the force does; the surfaces part later.
        if attraction || particles.contact[0].force.length() > 0.0 {
            steps += 1.0;
        }
        assert!(steps < 2e5);
    }
    let leaving = particles.motion[1].velocity.get(0) - particles.motion[0].velocity.get(0);
    [
        leaving / speed,
        steps * settings.time_step / unit,
        depth / (speed * unit),
    ]
}

/// Checks the restitution and the duration of damped collisions; the rows of the table are e, zeta, duration, depth,
/// and the last two without attraction.
#[test]
fn a_damped_collision_restitutes_as_the_oscillator() {
    for row in rows(include_str!(
        "../../../tests/reference/spring_dashpot_collision.csv"
    )) {
        let [e, zeta, duration, depth, duration_pushing, e_pushing] = row[..] else {
            panic!()
        };
        let [found, time, deepest] = collide::<PlaneSpace>(zeta, true);
        assert_relative_eq!(found, e, max_relative = 1e-3);
        assert_relative_eq!(time, duration, max_relative = 1e-3);
        assert_relative_eq!(deepest, depth, max_relative = 1e-3);
        let [found, time, _] = collide::<Volume>(zeta, false);
        assert_relative_eq!(found, e_pushing, max_relative = 1e-3);
        assert_relative_eq!(time, duration_pushing, max_relative = 1e-3);
    }
}

/// Checks that at the default step, a tenth of 2 sqrt(m/k), the restitution equals that of continuous time, whenever
/// within a step the contact begins.
#[test]
fn the_restitution_at_the_default_step_is_the_exact_one() {
    for zeta in [0.05_f64, 0.2, 0.5] {
        let exact = (-2.0 * zeta * zeta.acos() / (1.0 - zeta * zeta).sqrt()).exp();
        let all: Vec<f64> = (0..8)
            .map(|part| rebound(zeta, f64::from(part) / 8.0, false))
            .collect();
        for found in &all {
            assert_relative_eq!(*found, exact, max_relative = 0.025);
        }
        assert_relative_eq!(all.iter().sum::<f64>() / 8.0, exact, max_relative = 0.01);
        let pulling = (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
        for part in 0..32 {
            let found = rebound(zeta, f64::from(part) / 32.0, true);
            assert_relative_eq!(found, pulling, max_relative = 0.01);
        }
    }
}

/// Returns the restitution of two spheres whose contact begins at the fraction `part` of a default step.
fn rebound(zeta: f64, part: f64, attraction: bool) -> f64 {
    let parameters = linear::LinearParameters {
        normal_damping_ratio: zeta,
        attraction,
        friction: 0.0,
        ..SPRINGS
    };
    let body = Body::uniform::<Volume>(1, 1e-3, 2600.0, 0);
    let step = 0.2 * (body.mass / 1e5_f64).sqrt();
    let settings = DemSettings::new(about_origin::<Volume>(1.0), step, 1e-4);
    let mut dem = linear(parameters, settings, Vec::new());
    let mut particles = Particles::new();
    let speed = 0.3;
    for k in 0..2_u64 {
        let mut motion = Motion::<Volume>::default();
        motion.position[0] = if k == 0 {
            0.0
        } else {
            2e-3 + part * speed * step
        };
        motion.velocity[0] = if k == 0 { speed } else { 0.0 };
        particles.insert(Body { id: k, ..body }, motion);
    }
    dem.advance_many(&mut particles, &alone(), 60).unwrap();
    (particles.motion[1].velocity[0] - particles.motion[0].velocity[0]) / speed
}

/// Compares two spheres of 2 mm that meet obliquely, one of them spinning, against LIGGGHTS.
fn compare_collision(table: &str, friction: f64, gamma: f64) {
    let body = Body::uniform::<Volume>(1, 1e-3, 2600.0, 0);
    let normal_damping_ratio = 0.5 * gamma * (0.5 * body.mass / 1e5_f64).sqrt();
    // LIGGGHTS takes its dashpot at the velocity of half a step before, and from the start of the step in which a
    // contact begins: both are worth half a step of decay.
    let first_order = 0.5 * gamma * 1e-7;
    let parameters = linear::LinearParameters {
        friction,
        normal_damping_ratio,
        attraction: true,
        ..SPRINGS
    };
    let mut dem = linear(
        parameters,
        DemSettings::new(about_origin::<Volume>(0.01), 1e-7, 2e-4),
        Vec::new(),
    );
    let mut particles = Particles::new();
    let start = |sign: f64| Motion::<Volume> {
        position: Vector3::new(-1.005e-3 * sign, 0.0, 0.0),
        velocity: Vector3::new(0.5, 0.3, 0.0) * sign,
        spin: Vector3::new(0.0, 0.0, if sign > 0.0 { 50.0 } else { 0.0 }),
    };
    particles.insert(body, start(1.0));
    particles.insert(Body { id: 2, ..body }, start(-1.0));
    for row in rows(table) {
        let [t, overlap, fx, fy, vx1, vy1, wz1, vx2, vy2, wz2] = row[..] else {
            panic!()
        };
        let steps = (t / 1e-7).round();
        while (dem.steps() as f64) < steps {
            dem.advance(&mut particles, &alone()).unwrap();
        }
        let [a, b] = [&particles.motion[0], &particles.motion[1]];
        let force = particles.contact[0].force;
        // While the dashpot pulls, LIGGGHTS lets friction act with its magnitude, and this law without.
        let loose = if gamma > 0.0 && t > 3.25e-5 { 3e3 } else { 1.0 };
        assert_relative_eq!(
            2e-3 - (b.position - a.position).norm(),
            overlap,
            epsilon = 2e-11 * loose + 2e-5 * first_order
        );
        // The force of a dashpot is up to half of the peak of 0.5 N.
        assert_relative_eq!(force[0], fx, epsilon = 1e-6 * loose + first_order);
        assert_relative_eq!(force[1], fy, epsilon = 1e-6 * loose + first_order);
        for (found, expected) in [
            (a.velocity[0], vx1),
            (a.velocity[1], vy1),
            (b.velocity[0], vx2),
            (b.velocity[1], vy2),
        ] {
            assert_relative_eq!(found, expected, epsilon = 1e-6 * loose + first_order);
        }
        let of_spin = 1e-3 * loose + 2e2 * first_order;
        assert_relative_eq!(a.spin[2], wz1, epsilon = of_spin);
        assert_relative_eq!(b.spin[2], wz2, epsilon = of_spin);
    }
    // Angular momentum about the origin.
    let total: f64 = (0..2)
        .map(|k| {
            let m = &particles.motion[k];
            body.mass * m.position.cross(&m.velocity)[2] + body.inertia * m.spin[2]
        })
        .sum();
    let before = body.inertia * 50.0 - 2.0 * body.mass * 1.005e-3 * 0.3;
    assert_relative_eq!(total, before, max_relative = 1e-11);
}

#[test]
fn an_elastic_oblique_collision_follows_liggghts() {
    compare_collision(
        include_str!("../../../tests/reference/two_spheres_elastic.csv"),
        0.5,
        0.0,
    );
}

#[test]
fn a_sliding_oblique_collision_follows_liggghts() {
    compare_collision(
        include_str!("../../../tests/reference/two_spheres_low_friction.csv"),
        0.1,
        0.0,
    );
}

#[test]
fn a_damped_oblique_collision_follows_liggghts() {
    compare_collision(
        include_str!("../../../tests/reference/two_spheres_damped.csv"),
        0.5,
        8000.0,
    );
}

/// Checks a sphere on a plane of 30 degrees against LAMMPS: sliding (mu 0.1) and rolling (mu 0.5).
#[test]
fn a_sphere_on_an_incline_follows_lammps() {
    for (mu, table) in [
        (
            0.1,
            include_str!("../../../tests/reference/incline_sphere_mu0.1.csv"),
        ),
        (
            0.5,
            include_str!("../../../tests/reference/incline_sphere_mu0.5.csv"),
        ),
    ] {
        let body = Body::uniform::<Volume>(1, 5e-3, 2600.0, 0);
        let damping = 0.5 * 2000.0 * (body.mass / 1e5_f64).sqrt();
        let parameters = linear::LinearParameters {
            friction: mu,
            normal_damping_ratio: damping,
            ..SPRINGS
        };
        let mut settings = DemSettings::new(about_origin::<Volume>(1.0), 1e-6, 1e-3);
        settings.gravity = Vector3::new(0.5, 0.0, -0.75_f64.sqrt()) * 9.81;
        let floor = Wall::new(Vector3::zeros(), Vector3::z(), 0);
        let mut dem = linear(parameters, settings, vec![floor]);
        let mut particles = Particles::new();
        let position = Vector3::new(0.0, 0.0, 5e-3 - 2e-8);
        particles.insert(
            body,
            Motion {
                position,
                ..Motion::default()
            },
        );
        for row in rows(table) {
            let [t, _, z, vx, wy] = row[..] else { panic!() };
            let due = whole(t / 1e-6);
            dem.advance_many(&mut particles, &alone(), due - dem.steps())
                .unwrap();
            let motion = &particles.motion[0];
            assert_relative_eq!(motion.velocity[0], vx, epsilon = 2e-4);
            assert_relative_eq!(motion.spin[1], wy, epsilon = 0.15);
            assert_relative_eq!(motion.position[2], z, epsilon = 5e-7);
        }
    }
}

/// Runs a grain on a plane and checks the final speed of a body that first slides and then rolls.
fn slide_to_roll<S: Space>(mu: f64, shape: f64) {
    let (radius, g) = (0.05, 9.81);
    let body = Body::uniform::<S>(1, radius, 2600.0, 0);
    let stiffness = 1e7;
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(stiffness),
        friction: mu,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.3,
        ..SPRINGS
    };
    let mut settings = DemSettings::new(
        about_origin::<S>(3.0),
        0.05 * (body.mass / stiffness).sqrt(),
        1e-2,
    );
    settings.gravity.set(1, -g);
    let mut up = S::Vector::default();
    up.set(1, 1.0);
    let mut dem = linear(
        parameters,
        settings,
        vec![Wall::new(S::Vector::default(), up, 0)],
    );
    let mut particles = Particles::new();
    let mut motion = Motion::<S>::default();
    motion.position.set(1, radius - body.mass * g / stiffness);
    motion.velocity.set(0, 1.0);
    particles.insert(body, motion);
    // It rolls once mu g t (1 + 1/shape) = v0, at v0 / (1 + shape).
    let rolls = 1.0 / (mu * g * (1.0 + 1.0 / shape));
    let steps = |t: f64| whole(t / settings.time_step);
    dem.advance_many(&mut particles, &alone(), steps(0.9 * rolls))
        .unwrap();
    assert_relative_eq!(
        particles.motion[0].velocity.get(0),
        1.0 - mu * g * 0.9 * rolls,
        max_relative = 2e-3
    );
    dem.advance_many(&mut particles, &alone(), steps(0.4 * rolls))
        .unwrap();
    let speed = particles.motion[0].velocity.get(0);
    assert_relative_eq!(speed, 1.0 / (1.0 + shape), max_relative = 5e-3);
    let spin = particles.motion[0].spin.length();
    assert_relative_eq!(spin * radius, speed, max_relative = 5e-3);
}

#[test]
fn sliding_ends_in_rolling() {
    for mu in [0.1, 0.2, 0.3, 0.5] {
        slide_to_roll::<PlaneSpace>(mu, 0.5);
        slide_to_roll::<Volume>(mu, 0.4);
    }
}

/// Checks that a grain rolls down an incline with `g sin / (1 + shape)` if friction suffices.
fn roll_down<S: Space>(degrees: f64, mu: f64) -> f64 {
    let body = Body::uniform::<S>(1, 0.05, 2600.0, 0);
    let stiffness = 1e7;
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(stiffness),
        friction: mu,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.3,
        ..SPRINGS
    };
    let mut settings = DemSettings::new(
        about_origin::<S>(3.0),
        0.05 * (body.mass / stiffness).sqrt(),
        1e-2,
    );
    let (sin, cos) = degrees.to_radians().sin_cos();
    settings.gravity.set(0, 9.81 * sin);
    settings.gravity.set(1, -9.81 * cos);
    let mut up = S::Vector::default();
    up.set(1, 1.0);
    let mut dem = linear(
        parameters,
        settings,
        vec![Wall::new(S::Vector::default(), up, 0)],
    );
    let mut particles = Particles::new();
    let mut motion = Motion::<S>::default();
    motion
        .position
        .set(1, 0.05 - body.mass * 9.81 * cos / stiffness);
    particles.insert(body, motion);
    dem.advance_many(&mut particles, &alone(), whole(0.3 / settings.time_step))
        .unwrap();
    particles.motion[0].velocity.get(0) / dem.time()
}

#[test]
fn grains_roll_or_slide_down_an_incline() {
    for row in rows(include_str!("../../../tests/reference/rolling_incline.csv")) {
        let [degrees, sphere_mu, disc_mu, sphere, disc] = row[..] else {
            panic!()
        };
        assert_relative_eq!(
            roll_down::<Volume>(degrees, 1.05 * sphere_mu),
            sphere,
            max_relative = 5e-3
        );
        assert_relative_eq!(
            roll_down::<PlaneSpace>(degrees, 1.05 * disc_mu),
            disc,
            max_relative = 5e-3
        );
        // With half the friction it slides.
        let (sin, cos) = degrees.to_radians().sin_cos();
        let slides = 9.81 * (sin - 0.5 * disc_mu * cos);
        assert_relative_eq!(
            roll_down::<PlaneSpace>(degrees, 0.5 * disc_mu),
            slides,
            max_relative = 5e-3
        );
    }
}

/// Checks a block, a sphere that cannot rotate: it slides with `g (sin - tan(phi) cos)`, or is stationary except for
/// the deflection m g sin / k_s of its shear spring, in the linear law and in that of elastic spheres.
#[test]
fn a_block_slides_or_stays_on_an_incline() {
    const G: f64 = 9.81;
    let body = Body {
        inertia: 1e30,
        ..Body::uniform::<Volume>(1, 0.05, 2600.0, 0)
    };
    let moduli = [1e9, 4e8];
    for row in rows(include_str!("../../../tests/reference/block_incline.csv")) {
        let [slope, friction, acceleration, ..] = row[..] else {
            panic!()
        };
        let (sin, cos) = slope.to_radians().sin_cos();
        let weight = body.mass * G;
        let friction = friction.to_radians().tan();
        // The overlap that bears the weight, and the shear stiffness there.
        let hertz = 4.0 / 3.0 * moduli[0] * 0.05_f64.sqrt();
        let deep = (weight * cos / hertz).powf(2.0 / 3.0);
        let laws = [
            (
                Law::Linear(Linear {
                    parameters: PairTable::uniform(
                        1,
                        linear::LinearParameters {
                            normal_stiffness: Scaled::Absolute(1e7),
                            friction,
                            normal_damping_ratio: 0.3,
                            // Critical: an overshoot of the sudden load would slip.
                            shear_damping_ratio: 1.0,
                            ..SPRINGS
                        },
                    ),
                }),
                weight * cos / 1e7,
                1e7,
            ),
            (
                Law::HertzMindlin(HertzMindlin {
                    parameters: PairTable::uniform(
                        1,
                        hertz_mindlin::HertzMindlinParameters {
                            moduli,
                            friction,
                            damping: 1.0,
                            attraction: false,
                            impact_speed: 0.1,
                        },
                    ),
                    materials: Vec::new(),
                }),
                deep,
                8.0 * moduli[1] * (0.05 * deep).sqrt(),
            ),
        ];
        for (law, overlap, stiffness) in laws {
            let mut settings = DemSettings::new(about_origin::<Volume>(3.0), 1e-5, 1e-2);
            settings.gravity = Vector3::new(sin, 0.0, -cos) * G;
            let floor = Wall::new(Vector3::zeros(), Vector3::z(), 0);
            let mut dem = Dem::new(law, settings, vec![floor]).unwrap();
            let mut particles = Particles::new();
            let motion = Motion {
                position: Vector3::new(0.0, 0.0, 0.05 - overlap),
                ..Motion::default()
            };
            particles.insert(body, motion);
            // The spring takes a moment to reach the limit of friction.
            dem.advance_many(&mut particles, &alone(), 2000).unwrap();
            let before = particles.motion[0];
            dem.advance_many(&mut particles, &alone(), 18_000).unwrap();
            let motion = &particles.motion[0];
            if acceleration > 0.0 {
                let gain = motion.velocity[0] - before.velocity[0];
                assert_relative_eq!(gain, acceleration * 0.18, max_relative = 5e-3);
                let way = before.velocity[0] * 0.18 + 0.5 * acceleration * 0.18 * 0.18;
                let gone = motion.position[0] - before.position[0];
                assert_relative_eq!(gone, way, max_relative = 5e-3);
            } else {
                let deflection = weight * sin / stiffness;
                assert_relative_eq!(motion.position[0], deflection, max_relative = 1e-3);
                assert!(motion.velocity[0].abs() < 1e-9, "{}", motion.velocity[0]);
            }
        }
    }
}

/// Returns the damping ratio with which a dashpot that only pushes has the restitution `e`: T. Schwager, T. Pöschel,
/// Granular Matter 9 (2007) 465.
fn pushing_damping(e: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64, 0.7);
    for _ in 0..60 {
        let zeta = 0.5 * (low + high);
        let omega = (1.0 - zeta * zeta).sqrt();
        let phase =
            std::f64::consts::PI - (2.0 * zeta * omega / (omega * omega - zeta * zeta)).atan();
        if (-zeta / omega * phase).exp() > e {
            low = zeta;
        } else {
            high = zeta;
        }
    }
    low
}

/// Checks Chung and Ooi's test 6: a sphere with spin hits a plane and slides throughout: v_t = mu (1+e) v_n, dw = -3
/// rad/s.
#[test]
fn an_oblique_impact_slides_as_chung_and_ooi_say() {
    let parameters = linear::LinearParameters {
        stiffness_ratio: 20.0,
        friction: 0.4,
        normal_damping_ratio: pushing_damping(0.5),
        ..SPRINGS
    };
    for row in rows(include_str!(
        "../../../tests/reference/chung_ooi_6_sliding.csv"
    )) {
        let (spin, expected_speed, expected_spin) = (row[0], row[4], row[5]);
        let body = Body::uniform::<Volume>(1, 0.1, 2699.0, 0);
        let settings = DemSettings::new(
            about_origin::<Volume>(1.0),
            1e-3 * (body.mass / 1e5_f64).sqrt(),
            1e-2,
        );
        let mut dem = linear(
            parameters,
            settings,
            vec![Wall::new(Vector3::zeros(), Vector3::z(), 0)],
        );
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(0.0, 0.0, 0.1),
            velocity: Vector3::new(0.0, 0.0, -0.2),
            spin: Vector3::new(0.0, spin, 0.0),
        };
        particles.insert(body, motion);
        dem.advance_many(&mut particles, &alone(), 8000).unwrap();
        let motion = &particles.motion[0];
        assert_relative_eq!(motion.velocity[2], 0.1, max_relative = 2e-3);
        // The overlap shortens the lever arm by a thousandth; the spring needs a moment to reach the limit.
        assert_relative_eq!(motion.velocity[0], expected_speed, max_relative = 5e-3);
        assert_relative_eq!(motion.spin[1], expected_spin, max_relative = 5e-3);
    }
}

/// Checks Chung and Ooi's test 4: a small sphere hits a plane obliquely and slides throughout.
#[test]
fn an_oblique_impact_restitutes_as_chung_and_ooi_measured() {
    let (radius, speed) = (2.5e-3, 3.9);
    let stiffness = 1e9;
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(stiffness),
        stiffness_ratio: 20.0,
        friction: 0.092,
        normal_damping_ratio: pushing_damping(0.98),
        ..SPRINGS
    };
    for row in rows(include_str!(
        "../../../tests/reference/chung_ooi_4_sliding.csv"
    )) {
        let [degrees, measured, sliding, measured_spin, sliding_spin] = row[..] else {
            panic!()
        };
        let body = Body::uniform::<Volume>(1, radius, 4000.0, 0);
        let settings = DemSettings::new(
            about_origin::<Volume>(0.1),
            1e-3 * (body.mass / stiffness).sqrt(),
            1e-4,
        );
        let floor = Wall::new(Vector3::zeros(), Vector3::z(), 0);
        let mut dem = linear(parameters, settings, vec![floor]);
        let mut particles = Particles::new();
        let (sin, cos) = degrees.to_radians().sin_cos();
        let motion = Motion {
            position: Vector3::new(0.0, 0.0, radius),
            velocity: Vector3::new(sin, 0.0, -cos) * speed,
            ..Motion::default()
        };
        particles.insert(body, motion);
        dem.advance_many(&mut particles, &alone(), 4500).unwrap();
        let motion = &particles.motion[0];
        assert_relative_eq!(motion.velocity[2], 0.98 * speed * cos, max_relative = 2e-3);
        let restitution = motion.velocity[0] / (speed * sin);
        assert_relative_eq!(restitution, sliding, max_relative = 2e-3);
        assert_relative_eq!(restitution, measured, max_relative = 1e-2);
        // The paper counts the spin the other way round.
        assert_relative_eq!(motion.spin[1], -sliding_spin, max_relative = 5e-3);
        assert_relative_eq!(motion.spin[1], -measured_spin, max_relative = 3e-2);
    }
}

/// Returns a bonded pair of grains of diameter `d` in the paper's law, the first fixed, the second with this motion and
/// too heavy for the contact to change it.
fn cohesive_pair(d: f64, motion: Motion<PlaneSpace>) -> (Dem<PlaneSpace>, Particles<PlaneSpace>) {
    let mut dem = cohesive(
        PAPER,
        DemSettings::new(about_origin::<PlaneSpace>(0.01), 1.0, 1e-5),
        Vec::new(),
    );
    let mut particles = Particles::new();
    let fixed = Body {
        kind: Kind::Fixed,
        ..Body::uniform::<PlaneSpace>(1, d / 2.0, 2600.0, 0)
    };
    let moved = Body {
        mass: 1e30,
        inertia: 1e30,
        ..Body::uniform::<PlaneSpace>(2, d / 2.0, 2600.0, 0)
    };
    particles.insert(fixed, Motion::default());
    particles.insert(moved, motion);
    assert_eq!(
        dem.bond_existing_contacts(&mut particles, &alone())
            .unwrap(),
        1
    );
    (dem, particles)
}

/// Returns a pair in the paper's law, the second moved by `velocity` (m per step), against YADE: largest error of both
/// forces (N), and the step at which the bond failed.
fn compare_cohesive(
    table: &str,
    overlap: f64,
    velocity: Vector2<f64>,
) -> (f64, f64, Option<BondBreak<PlaneSpace>>) {
    let d = 2e-4;
    // Bonded at a touch of 1e-18 m where the test starts without overlap.
    let motion = Motion {
        position: Vector2::new(d - overlap.max(1e-18), 0.0),
        velocity,
        spin: 0.0,
    };
    let (mut dem, mut particles) = cohesive_pair(d, motion);
    let (mut normal_error, mut shear_error) = (0.0_f64, 0.0_f64);
    for row in rows(table) {
        let [step, _, _, normal, shear, broken] = row[..] else {
            panic!()
        };
        let steps = whole(step) - dem.steps();
        dem.advance_many(&mut particles, &alone(), steps).unwrap();
        let force = particles.contact[1].force;
        let line = (particles.motion[1].position - particles.motion[0].position).normalize();
        // YADE's normal force is one step late and may fail one step later: leave out the step between.
        if broken == 0.0 && dem.statistics(&particles).bonds == 0 {
            continue;
        }
        normal_error = normal_error.max((force.dot(&line) - normal).abs());
        shear_error = shear_error.max((line.perp(&force) - shear).abs());
    }
    let mut breaks = dem.take_breaks();
    assert!(breaks.len() <= 1);
    (normal_error, shear_error, breaks.pop())
}

#[test]
fn a_bond_pulled_apart_follows_yade() {
    let step = 1.265e-11;
    let table = include_str!("../../../tests/reference/cohesive_pull.csv");
    let (normal, shear, failed) = compare_cohesive(table, 0.0, Vector2::new(step, 0.0));
    // One step's worth, k_n times the step.
    assert!(normal <= 1.01 * 3e4 * step, "{normal}");
    assert!(shear < 1e-12, "{shear}");
    let failed = failed.unwrap();
    assert_eq!(
        (failed.mode, failed.grain, failed.other),
        (Failure::Tension, 1, Some(2))
    );
    // It opens by C/k_n = 3.373e-9 m.
    assert!((failed.step as f64 * step - 0.506 / 150e6).abs() < 2.0 * step);
}

#[test]
fn a_bond_sheared_under_pressure_follows_yade() {
    let step = 1.686_666_667e-10;
    let table = include_str!("../../../tests/reference/cohesive_shear_compressed.csv");
    let (normal, shear, failed) = compare_cohesive(table, 1e-8, Vector2::new(0.0, step));
    assert!(normal < 3e-9, "{normal}");
    assert!(shear < 2e-8, "{shear}");
    let failed = failed.unwrap();
    assert_eq!(failed.mode, Failure::Shear);
    // k_s u = F_n tan 20 + C.
    let peak = 3e-4 * 20.0_f64.to_radians().tan() + 0.506 * 2e-4;
    assert_relative_eq!(
        12_000.0 * failed.step as f64 * step,
        peak,
        max_relative = 0.01
    );
}

#[test]
fn a_bond_sheared_freely_follows_yade() {
    let step = 4.216_666_667e-11;
    let table = include_str!("../../../tests/reference/cohesive_shear_free.csv");
    let (normal, shear, failed) = compare_cohesive(table, 0.0, Vector2::new(0.0, step));
    assert!(normal < 1e-8, "{normal}");
    assert!(shear < 1e-9, "{shear}");
    let failed = failed.unwrap();
    assert_eq!(failed.mode, Failure::Shear);
    assert_relative_eq!(
        12_000.0 * failed.step as f64 * step,
        0.506 * 2e-4,
        max_relative = 0.01
    );
}

/// Checks that a broken bond does not heal, and that a bond failing in shear while pulled has no force afterwards.
#[test]
fn cohesion_is_lost_for_good() {
    let d = 2e-4;
    let motion = Motion {
        position: Vector2::new(d - 1e-18, 0.0),
        ..Motion::default()
    };
    let (mut dem, mut particles) = cohesive_pair(d, motion);
    // Pull to half the strength, then shear until it fails.
    particles.motion[1].velocity = Vector2::new(0.5 * 3.373e-9 / 50.0, 0.0);
    dem.advance_many(&mut particles, &alone(), 50).unwrap();
    assert_relative_eq!(
        particles.contact[1].force[0],
        -0.5 * 0.506 * d,
        max_relative = 1e-3
    );
    particles.motion[1].velocity = Vector2::new(0.0, 1e-10);
    dem.advance_many(&mut particles, &alone(), 100).unwrap();
    let broken = dem.take_breaks();
    assert_eq!(broken.len(), 1);
    assert_eq!(broken[0].mode, Failure::Shear);
    assert_eq!(particles.contact[1].force, Vector2::zeros());
    // Pressed together again, the contact has friction only and no tension.
    particles.motion[1].velocity = Vector2::new(-1e-10, 0.0);
    dem.advance_many(&mut particles, &alone(), 100).unwrap();
    assert!(particles.contact[1].force[0] > 1e-4);
    particles.motion[1].velocity = Vector2::new(1e-10, 0.0);
    dem.advance_many(&mut particles, &alone(), 200).unwrap();
    assert_eq!(particles.contact[1].force, Vector2::zeros());
    assert_eq!(dem.statistics(&particles).bonds, 0);
}

#[test]
fn a_lost_grain_is_named() {
    let mut dem = linear(
        SPRINGS,
        DemSettings::new(about_origin::<PlaneSpace>(0.1), 1e-5, 1e-3),
        Vec::new(),
    );
    let mut particles = Particles::new();
    let motion = Motion {
        velocity: Vector2::new(100.0, 0.0),
        ..Motion::default()
    };
    particles.insert(Body::uniform::<PlaneSpace>(42, 1e-3, 2600.0, 0), motion);
    let error = dem
        .advance_many(&mut particles, &alone(), 10_000)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("grain 42 is more than one domain length outside"),
        "{error}"
    );
    let mut particles = Particles::new();
    let motion = Motion {
        velocity: Vector2::new(f64::NAN, 0.0),
        ..Motion::default()
    };
    particles.insert(Body::uniform::<PlaneSpace>(43, 1e-3, 2600.0, 0), motion);
    let mut dem = linear(
        SPRINGS,
        DemSettings::new(about_origin::<PlaneSpace>(0.1), 1e-5, 1e-3),
        Vec::new(),
    );
    let error = dem
        .advance(&mut particles, &alone())
        .unwrap_err()
        .to_string();
    assert!(error.contains("grain 43 has no finite motion"), "{error}");
}

#[test]
fn the_critical_step_is_that_of_the_smallest_grain() {
    let law = Law::CohesiveFrictional(CohesiveFrictional {
        parameters: PairTable::uniform(1, PAPER),
    });
    let grains = [1e-4, 1.5e-4].map(|radius| Body::uniform::<PlaneSpace>(1, radius, 2600.0, 0));
    // With the larger partner, k = 150e6 (r1 + r2).
    let expected = (grains[0].mass / (150e6 * 2.5e-4)).sqrt();
    assert_relative_eq!(
        law.critical_time_step::<PlaneSpace>(&grains, 1),
        expected,
        max_relative = 1e-12
    );
}
