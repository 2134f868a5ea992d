//! Blocks through the whole engine: slopes, free flight and collisions through a periodic face, a stack, and a pile
//! with the same bits in all modes of execution.

use std::sync::{Arc, OnceLock};

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::super::contact::blocks::BlockLaw;
use super::super::polyhedron::{self, BlockContactModel, Polyhedron, Stiffness};
use super::super::state::{Contacts, NamedColumns};
use super::same_bits::{bits, on_slabs};
use super::*;
use base::random::Stream;
use decomposition::SplitAxis;

const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 2600.0;

fn law(normal: f64, friction: f64, damping: f64, mass_damping: f64) -> Law {
    let law = polyhedron::BlockPairLaw {
        stiffness: Stiffness::PerArea {
            normal,
            shear: 0.5 * normal,
        },
        friction,
        normal_damping_ratio: damping,
        shear_damping_ratio: damping,
    };
    Law::Blocks(BlockLaw {
        parameters: PairTable::uniform(1, law),
        model: BlockContactModel::Pressure,
        mass_damping,
    })
}

fn cuboid(x: f64, y: f64, z: f64) -> Polyhedron {
    Polyhedron::cuboid(Vector3::new(x, y, z)).unwrap()
}

fn motion_at(position: Vector3<f64>, velocity: Vector3<f64>, spin: Vector3<f64>) -> Motion<Volume> {
    Motion {
        position,
        velocity,
        spin,
    }
}

fn floor() -> Wall<Volume> {
    Wall::new(Vector3::zeros(), Vector3::z(), 0)
}

/// Returns stationary bodies of these shapes at these positions.
fn resting(blocks: &[(Polyhedron, Vector3<f64>, UnitQuaternion<f64>)]) -> Particles<Volume> {
    let mut particles = Particles::new();
    let shapes: Vec<_> = blocks.iter().map(|one| one.0.clone()).collect();
    particles.set_shapes(shapes.into()).unwrap();
    for (k, (shape, place, orientation)) in (0..).zip(blocks) {
        let body = Body::of_block(u64::from(k), shape, DENSITY, 0);
        let motion = motion_at(*place, Vector3::zeros(), Vector3::zeros());
        particles.add_block(body, motion, k, *orientation).unwrap();
    }
    particles
}

/// Checks a block on a slope: it is stationary for tan(theta) < mu, and otherwise slides with g (sin - mu cos).
#[test]
fn a_block_on_a_slope() {
    for (slope, friction) in [
        (15.0_f64, 20.0_f64),
        (25.0, 20.0),
        (30.0, 0.0),
        (45.0, 30.0),
    ] {
        let (angle, mu) = (slope.to_radians(), friction.to_radians().tan());
        let mut settings = DemSettings::new(about_origin(50.0), 2e-4, 0.02);
        settings.gravity = Vector3::new(angle.sin(), 0.0, -angle.cos()) * GRAVITY;
        let stiffness = 1e8;
        let sunk = DENSITY * 0.2 * GRAVITY * angle.cos() / stiffness;
        let place = Vector3::new(0.0, 0.0, 0.1 - 0.4 * sunk);
        let mut particles = resting(&[(cuboid(1.0, 1.0, 0.2), place, UnitQuaternion::identity())]);
        let mut dem = Dem::new(law(stiffness, mu, 0.3, 0.0), settings, vec![floor()]).unwrap();
        dem.advance_many(&mut particles, &alone(), 2000).unwrap();
        let before = particles.motion[0];
        dem.advance_many(&mut particles, &alone(), 3000).unwrap();
        let now = particles.motion[0];
        let rate = (now.velocity.x - before.velocity.x) / 0.6;
        let expected = GRAVITY * (angle.sin() - mu * angle.cos());
        if angle.tan() < mu {
            assert!(now.velocity.norm() < 1e-6, "{}", now.velocity.norm());
            assert!((now.position - before.position).norm() < 1e-7);
        } else {
            assert_relative_eq!(rate, expected, max_relative = 2e-3);
        }
    }
}

/// Checks an asymmetric block in free flight through a periodic face: momentum and angular momentum are constant to the
/// last bit, energy to second order in the time step.
#[test]
fn a_free_block_keeps_energy_and_angular_momentum() {
    let mut region = about_origin::<Volume>(1.0);
    region.periodic[0] = true;
    let shape = cuboid(0.3, 0.2, 0.1);
    let swing = |time_step: f64, steps: u64| {
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let body = Body::of_block(7, &shape, DENSITY, 0);
        let motion = motion_at(
            Vector3::new(0.9, 0.0, 0.0),
            Vector3::new(2.0, 0.0, 0.0),
            Vector3::new(0.3, 12.0, 0.5),
        );
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.9);
        particles.add_block(body, motion, 0, turn).unwrap();
        let settings = DemSettings::new(region, time_step, 0.05);
        let mut dem = Dem::new(law(1e8, 0.5, 0.0, 0.0), settings, vec![]).unwrap();
        let momentum = particles.polyhedron(0).unwrap().1.angular_momentum;
        let energy = particles.kinetic_energy(0);
        let mut worst = 0.0_f64;
        for _ in 0..40 {
            dem.advance_many(&mut particles, &alone(), steps / 40)
                .unwrap();
            worst = worst.max((particles.kinetic_energy(0) / energy - 1.0).abs());
        }
        let (_, state) = particles.polyhedron(0).unwrap();
        assert_eq!(state.angular_momentum, momentum);
        assert_eq!(particles.motion[0].velocity, motion.velocity);
        assert!(particles.location(0).x.abs() <= 1.0 && particles.motion[0].position.x > 2.0);
        // Derived quantities follow the state.
        let inertia = shape.inertia(DENSITY);
        assert_eq!(particles.motion[0].spin, state.spin(&inertia));
        worst
    };
    let (coarse, fine) = (swing(1e-3, 2000), swing(5e-4, 4000));
    assert!(coarse < 1e-4, "{coarse}");
    assert_relative_eq!(coarse / fine, 4.0, max_relative = 0.1);
}

/// Checks that two blocks that collide across a periodic face move as in an unbounded domain.
#[test]
fn a_collision_through_a_periodic_face() {
    let shapes: Arc<[Polyhedron]> = [cuboid(0.3, 0.3, 0.3), cuboid(0.4, 0.25, 0.3)].into();
    let collide = |periodic: bool| {
        let mut region = about_origin::<Volume>(1.0);
        region.periodic[0] = periodic;
        let settings = DemSettings::new(region, 2e-5, 0.02);
        let mut dem = Dem::new(law(1e9, 0.3, 0.0, 0.0), settings, vec![]).unwrap();
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes(Arc::clone(&shapes)).unwrap();
        // In the open both stand half a box length nearer to the middle.
        let shift = if periodic { 0.0 } else { 1.0 };
        for (id, x, z, speed, turn) in [(3, 0.8, 0.0, 1.5, 0.0), (4, 1.2, 0.1, -0.5, 0.4)] {
            let wrapped = periodic && x > 1.0;
            let x = x - shift - if wrapped { 2.0 } else { 0.0 };
            let shape = u32::from(id == 4);
            let body = Body::of_block(id, &shapes[shape as usize], DENSITY, 0);
            let motion = motion_at(
                Vector3::new(x, 0.0, z),
                Vector3::new(speed, 0.0, 0.0),
                Vector3::zeros(),
            );
            let turn = UnitQuaternion::from_euler_angles(0.3, turn, 0.2);
            particles.add_block(body, motion, shape, turn).unwrap();
        }
        let before = momentum(&particles);
        dem.advance_many(&mut particles, &alone(), 8000).unwrap();
        assert!((momentum(&particles) - before).norm() < 1e-12 * before.norm());
        assert!(particles.motion[1].velocity.x > 0.1, "no collision");
        (0..2)
            .map(|k| (particles.motion[k], *particles.polyhedron(k).unwrap().1))
            .collect::<Vec<_>>()
    };
    for (one, other) in collide(true).iter().zip(&collide(false)) {
        let (a, b) = (&one.1, &other.1);
        assert_relative_eq!(one.0.velocity, other.0.velocity, epsilon = 1e-9);
        assert_relative_eq!(a.angular_momentum, b.angular_momentum, epsilon = 1e-8);
        assert_relative_eq!(a.orientation, b.orientation, epsilon = 1e-9);
    }
}

fn momentum(particles: &Particles<Volume>) -> Vector3<f64> {
    let all = particles.body.iter().zip(&particles.motion);
    let own = all.take(particles.owned());
    own.map(|(body, motion)| motion.velocity * body.mass).sum()
}

/// Checks that ten blocks on top of each other, each slightly rotated and shifted, are stationary.
#[test]
fn a_stack_of_ten_stands() {
    let blocks: Vec<_> = (0..10)
        .map(|k| {
            let k = f64::from(k);
            let place = Vector3::new(
                0.02 * (2.0 * k).sin(),
                0.02 * (3.0 * k).cos(),
                0.25 + 0.5 * k,
            );
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * (0.1 * k));
            (cuboid(1.0, 1.0, 0.5), place, turn)
        })
        .collect();
    let mut particles = resting(&blocks);
    let mut settings = DemSettings::new(about_origin(20.0), 1e-4, 0.02);
    settings.gravity = Vector3::z() * -GRAVITY;
    let mut dem = Dem::new(law(1e9, 0.5, 0.1, 20.0), settings, vec![floor()]).unwrap();
    dem.advance_many(&mut particles, &alone(), 10_000).unwrap();
    let before = particles.motion.clone();
    dem.advance_many(&mut particles, &alone(), 10_000).unwrap();
    for (now, before) in particles.motion.iter().zip(&before) {
        assert!(now.velocity.norm() < 1e-6, "{}", now.velocity.norm());
        assert!((now.position - before.position).norm() < 1e-5);
        assert!(now.spin.norm() < 1e-6);
    }
    // The floor carries all ten blocks, each joint those above it.
    let weight = DENSITY * 0.5 * GRAVITY;
    let mut carried = Vec::new();
    dem.for_each_contact(&particles, |contact| {
        carried.push(contact.normal_force / weight);
    });
    carried.sort_by(f64::total_cmp);
    assert_eq!(carried.len(), 10);
    for (k, carried) in (1..).zip(carried) {
        assert_relative_eq!(carried, f64::from(k), max_relative = 1e-4);
    }
    let now = dem.statistics(&particles);
    assert_eq!((now.contacts, now.bonds), (10, 0));
}

/// Rolls a sphere off a block: momentum is conserved, and a sphere on a plane next to a block is subject to the same
/// law.
#[test]
fn spheres_and_blocks_meet_either_way_round() {
    // The lower id comes first in a pair: both orders must give the mirrored outcome.
    let meet = |ids: [u64; 2]| {
        let shape = cuboid(0.4, 0.4, 0.4);
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let still = Vector3::zeros();
        let motion = motion_at(Vector3::new(0.0, 0.0, 0.0), still, still);
        let body = Body::of_block(ids[0], &shape, DENSITY, 0);
        let turn = UnitQuaternion::from_euler_angles(0.2, 0.3, 0.0);
        particles.add_block(body, motion, 0, turn).unwrap();
        particles.insert(
            Body::uniform::<Volume>(ids[1], 0.1, DENSITY, 0),
            motion_at(
                Vector3::new(0.5, 0.05, 0.0),
                Vector3::new(-2.0, 0.0, 0.0),
                Vector3::new(0.0, 0.0, 30.0),
            ),
        );
        let settings = DemSettings::new(about_origin(2.0), 1e-5, 0.02);
        let mut dem = Dem::new(law(1e9, 0.4, 0.05, 0.0), settings, vec![]).unwrap();
        let before = momentum(&particles);
        dem.advance_many(&mut particles, &alone(), 12_000).unwrap();
        assert!((momentum(&particles) - before).norm() < 1e-12 * before.norm());
        let block = (0..2).find(|&k| particles.polyhedron(k).is_some()).unwrap();
        (particles.motion[block], particles.motion[1 - block])
    };
    let (one, other) = (meet([1, 2]), meet([2, 1]));
    assert!(one.1.velocity.x > -1.0, "no collision");
    for (a, b) in [(one.0, other.0), (one.1, other.1)] {
        assert_relative_eq!(a.velocity, b.velocity, epsilon = 1e-12);
        assert_relative_eq!(a.spin, b.spin, epsilon = 1e-10);
    }
}

/// Returns a square of side 2 `half` in z = 0, `n` by `n` squares of two triangles each, every third of them facing
/// down.
fn mesh(half: f64, n: u32) -> FacetSurface {
    let place = |k: u32| 2.0 * half * f64::from(k) / f64::from(n) - half;
    let (vertices, mut facets) = triangles(n, place);
    for facet in facets.iter_mut().step_by(3) {
        facet.reverse();
    }
    FacetSurface::new(vertices, &facets).unwrap()
}

/// Checks that interior edges have no effect: a block that tumbles and slides over triangles moves as on a plane.
#[test]
fn a_flat_mesh_is_a_plane() {
    let slide = |wall: Wall<Volume>| {
        let shape = cuboid(1.0, 0.8, 0.3);
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let motion = motion_at(
            Vector3::new(-1.0, 0.1, 0.25),
            Vector3::new(3.0, 0.5, 0.0),
            Vector3::z() * 2.0,
        );
        let turn = UnitQuaternion::from_euler_angles(0.1, -0.15, 0.3);
        let body = Body::of_block(0, &shape, DENSITY, 0);
        particles.add_block(body, motion, 0, turn).unwrap();
        let mut settings = DemSettings::new(about_origin(10.0), 1e-4, 0.02);
        settings.gravity = Vector3::z() * -GRAVITY;
        let mut dem = Dem::new(law(1e8, 0.3, 0.2, 0.0), settings, vec![wall]).unwrap();
        dem.advance_many(&mut particles, &alone(), 6000).unwrap();
        let mut contacts = Vec::new();
        dem.for_each_contact(&particles, |contact| contacts.push(contact));
        (
            particles.motion[0],
            *particles.polyhedron(0).unwrap().1,
            contacts,
        )
    };
    let plane = slide(floor());
    assert!(
        plane.0.position.x > -0.2 && plane.0.velocity.x > 0.1,
        "{:?}",
        plane.0
    );
    for n in [2, 7, 40] {
        let meshed = slide(Wall::of_surface(Arc::new(mesh(4.0, n)), 0));
        assert_relative_eq!(meshed.0.position, plane.0.position, epsilon = 1e-9);
        assert_relative_eq!(meshed.0.velocity, plane.0.velocity, epsilon = 1e-8);
        assert_relative_eq!(meshed.1.orientation, plane.1.orientation, epsilon = 1e-9);
        let (one, other) = (meshed.2[0], plane.2[0]);
        assert_eq!([meshed.2.len(), plane.2.len()], [1, 1]);
        assert_relative_eq!(one.normal_force, other.normal_force, max_relative = 1e-6);
        assert_relative_eq!(one.normal, other.normal, epsilon = 1e-12);
    }
}

/// Checks that a block that overhangs the edge of a box is stable if its centroid is above the box, and falls
/// otherwise.
#[test]
fn a_block_overhangs_the_edge_of_a_box() {
    for (x, rests) in [(-0.1, true), (0.1, false)] {
        let ledge =
            FacetSurface::of_box(Vector3::new(-1.0, -1.0, -1.0), Vector3::new(0.0, 1.0, 0.0))
                .unwrap();
        let place = Vector3::new(x, 0.1, 0.1);
        let mut particles = resting(&[(cuboid(1.0, 0.4, 0.2), place, UnitQuaternion::identity())]);
        let mut settings = DemSettings::new(about_origin(10.0), 1e-4, 0.02);
        settings.gravity = Vector3::z() * -GRAVITY;
        let walls = vec![Wall::of_surface(Arc::new(ledge), 0)];
        let mut dem = Dem::new(law(1e9, 0.5, 0.3, 20.0), settings, walls).unwrap();
        dem.advance_many(&mut particles, &alone(), 8000).unwrap();
        let now = particles.motion[0];
        if rests {
            assert!(now.velocity.norm() < 1e-6, "{}", now.velocity.norm());
            assert!(
                (now.position - place).norm() < 1e-4,
                "{}",
                now.position - place
            );
            let mut carried = 0.0;
            dem.for_each_contact(&particles, |contact| {
                carried += contact.normal_force * contact.normal.z;
            });
            let weight = particles.body[0].mass * GRAVITY;
            assert_relative_eq!(carried, weight, max_relative = 1e-4);
        } else {
            assert!(now.spin.y > 0.1 && now.position.z < 0.09, "{now:?}");
        }
    }
}

/// Returns a box of facets between two corners.
fn piece(from: [f64; 3], to: [f64; 3]) -> Wall<Volume> {
    Wall::of_surface(
        Arc::new(FacetSurface::of_box(from.into(), to.into()).unwrap()),
        0,
    )
}

/// Returns a square of facets across z, 2 m wide, from `x` on.
fn tile(x: f64) -> Wall<Volume> {
    let corners = [[0.0, -1.0], [2.0, -1.0], [2.0, 1.0], [0.0, 1.0]];
    let corners = corners.map(|[a, y]| Vector3::new(x + a, y, 0.0)).to_vec();
    Wall::of_surface(
        Arc::new(FacetSurface::new(corners, &[vec![0, 1, 2, 3]]).unwrap()),
        0,
    )
}

/// Checks that a block thrown along a plane stops after v²/(2 mu g), also over the edge of a ledge from which less than
/// half of its base protrudes, and over seams between boxes, polygons and both.
#[test]
fn a_block_slides_over_edges_and_seams() {
    let (speed, mu) = (1.0, 20.0_f64.to_radians().tan());
    let distance = speed * speed / (2.0 * mu * GRAVITY);
    let low = [-3.0, -1.0, -0.5];
    let ledges = [
        ("ledge", vec![piece(low, [0.25, 1.0, 0.0])]),
        (
            "boxes",
            vec![
                piece(low, [0.05, 1.0, 0.0]),
                piece([0.05, -1.0, -0.5], [3.0, 1.0, 0.0]),
            ],
        ),
        (
            "unequal boxes",
            vec![
                piece(low, [0.05, 1.0, 0.0]),
                piece([0.05, -0.7, -0.2], [3.0, 0.8, 0.0]),
            ],
        ),
        ("polygons", vec![tile(-1.95), tile(0.05)]),
        (
            "box and polygon",
            vec![piece(low, [0.05, 1.0, 0.0]), tile(0.05)],
        ),
    ];
    for (name, walls) in ledges {
        for step in [4e-5, 2e-5] {
            let shape = cuboid(0.4, 0.4, 0.2);
            let sunk = DENSITY * 0.2 * GRAVITY / 1e9;
            let place = Vector3::new(0.0, 0.0, 0.1 - sunk);
            let mut particles = resting(&[(shape, place, UnitQuaternion::identity())]);
            particles.motion[0].velocity.x = speed;
            let mut settings = DemSettings::new(about_origin(10.0), step, 0.02);
            settings.gravity = Vector3::z() * -GRAVITY;
            let mut dem = Dem::new(law(1e9, mu, 0.3, 0.0), settings, walls.clone()).unwrap();
            let steps = base::number::whole(0.4 / step);
            dem.advance_many(&mut particles, &alone(), steps as u64)
                .unwrap();
            let now = particles.motion[0];
            assert!(now.velocity.norm() < 1e-4, "{name}: {}", now.velocity);
            assert_relative_eq!(now.position.x, distance, max_relative = 0.01);
            assert!(now.position.y.abs() < 1e-4, "{name}: {}", now.position);
        }
    }
}

/// Checks a cube that spins flat on a floor: friction has the moment mu m g times the mean arm of the square, 0.3826 of
/// its edge.
#[test]
fn a_spinning_cube_is_braked_by_its_patch() {
    let (edge, mu) = (0.3, 8.0_f64.to_radians().tan());
    let sunk = DENSITY * edge * GRAVITY / 1e9;
    for sideways in [0.0, 1e-3] {
        let place = Vector3::new(0.0, 0.0, 0.5 * edge - sunk);
        let cube = cuboid(edge, edge, edge);
        let mut particles = Particles::new();
        particles.set_shapes(vec![cube.clone()].into()).unwrap();
        let body = Body::of_block(0, &cube, DENSITY, 0);
        let motion = motion_at(place, Vector3::x() * sideways, Vector3::z() * 2.0);
        particles
            .add_block(body, motion, 0, UnitQuaternion::identity())
            .unwrap();
        let mut settings = DemSettings::new(about_origin(10.0), 2e-5, 0.02);
        settings.gravity = Vector3::z() * -GRAVITY;
        let mut dem = Dem::new(law(1e9, mu, 1.0, 0.0), settings, vec![floor()]).unwrap();
        dem.advance_many(&mut particles, &alone(), 2500).unwrap();
        let before = particles.motion[0].spin.z;
        dem.advance_many(&mut particles, &alone(), 2500).unwrap();
        let spin = particles.motion[0].spin;
        let rate = (before - spin.z) / 0.05;
        let exact = 0.3826 * edge * mu * GRAVITY / (edge * edge / 6.0);
        assert_relative_eq!(rate, exact, max_relative = 0.015);
        assert!(spin.xy().norm() < 1e-3 * spin.z, "rocks: {spin}");
    }
}

/// Checks that a sphere that rolls down a block accelerates as on a plane, by 5/7 g sin.
#[test]
fn a_sphere_rolls_down_a_block() {
    let angle = 10.0_f64.to_radians();
    let slope = (
        cuboid(8.0, 1.0, 0.2),
        Vector3::new(3.0, 0.0, -0.1),
        UnitQuaternion::identity(),
    );
    let mut particles = resting(&[slope]);
    particles.body[0].kind = Kind::Fixed;
    let sphere = Body::uniform::<Volume>(1, 0.05, DENSITY, 0);
    let place = Vector3::new(0.0, 0.0, 0.05);
    particles.insert(sphere, motion_at(place, Vector3::zeros(), Vector3::zeros()));
    let mut settings = DemSettings::new(about_origin(20.0), 4e-6, 0.02);
    settings.gravity = Vector3::new(angle.sin(), 0.0, -angle.cos()) * GRAVITY;
    let mut dem = Dem::new(law(1e11, 0.8, 0.3, 0.0), settings, vec![]).unwrap();
    let speed = |particles: &Particles<Volume>| {
        let k = particles.body.iter().position(|body| body.id == 1);
        particles.motion[k.unwrap()].velocity.x
    };
    dem.advance_many(&mut particles, &alone(), 25_000).unwrap();
    let before = speed(&particles);
    dem.advance_many(&mut particles, &alone(), 100_000).unwrap();
    let rate = (speed(&particles) - before) / 0.4;
    assert_relative_eq!(rate, 5.0 / 7.0 * GRAVITY * angle.sin(), max_relative = 1e-3);
}

#[test]
fn what_blocks_cannot_do_is_refused() {
    let refusal = |result: Result<(), Error>| result.unwrap_err().to_string();
    let flat = Dem::new(
        law(1e8, 0.5, 0.0, 0.0),
        DemSettings::new(about_origin::<PlaneSpace>(1.0), 1e-4, 0.1),
        vec![],
    );
    assert!(refusal(flat.map(|_| ())).contains("two dimensions"));
    let settings = DemSettings::new(about_origin::<Volume>(1.0), 1e-4, 0.1);
    // Shapes that are not in the table, and blocks under a law is for spheres.
    let shape = cuboid(0.1, 0.1, 0.1);
    let mut particles = Particles::<Volume>::new();
    let body = Body::of_block(1, &shape, DENSITY, 0);
    let still = Motion::default();
    let turn = UnitQuaternion::identity();
    assert!(refusal(particles.add_block(body, still, 0, turn)).contains("table has 0"));
    particles.set_shapes([shape].into()).unwrap();
    particles.add_block(body, still, 0, turn).unwrap();
    let mut spheres = linear(SPRINGS, settings, vec![]);
    assert!(refusal(spheres.prepare(&mut particles, &alone())).contains("law is for spheres"));
    let mut restored = Particles::<Volume>::from_table(&particles.table()).unwrap();
    let mut dem = Dem::new(law(1e8, 0.5, 0.0, 0.0), settings, vec![]).unwrap();
    assert!(refusal(dem.prepare(&mut restored, &alone())).contains("table has 0"));
    assert!(
        Particles::<PlaneSpace>::new()
            .set_shapes(Arc::default())
            .is_err()
    );
}

#[test]
fn the_critical_step_is_below_that_of_the_largest_face() {
    let shape = cuboid(0.1, 0.2, 0.4);
    let body = Body::of_block(1, &shape, DENSITY, 0);
    // m = rho a b c, k = 1e9 b c: sqrt(rho a/1e9).
    let exact = (DENSITY * 0.1 / 1e9_f64).sqrt();
    let bound = law(1e9, 0.5, 0.0, 0.0).critical_time_step::<Volume>([&body], 1);
    assert!(bound < exact && bound > 0.3 * exact, "{bound} {exact}");
}

// --- the same bits ---

/// Pile of blocks of all kinds and some spheres; some of the bodies are wider than a slab.
#[derive(Clone, Copy)]
struct Pile {
    periodic: bool,
    skin: f64,
}

const STEPS: u64 = 2400;
const WIDTH: f64 = 0.24;

impl Pile {
    fn settings(self) -> DemSettings<Volume> {
        let upper = Vector3::new(WIDTH, WIDTH, 0.4);
        let mut region = GrainDomain::<Volume>::closed(Vector3::zeros(), upper, 0.01);
        region.periodic[0] = self.periodic;
        let mut settings = DemSettings::new(region, 1e-4, self.skin);
        settings.gravity = Vector3::new(2.0, 0.0, -GRAVITY);
        settings.local_damping = 0.05;
        settings.ghost_margin = 0.01;
        settings
    }

    fn dem(self) -> Dem<Volume> {
        let settings = self.settings();
        let GrainDomain { lower, upper, .. } = settings.region;
        let mut walls = Wall::of_box(lower, upper, [!self.periodic, true, true], 0);
        if !self.periodic {
            // The floor as a mesh, and a step on it.
            walls[4] = Wall::of_surface(Arc::new(mesh(0.3, 9)), 0);
            let corner = Vector3::new(0.17, 0.17, 0.0);
            let step =
                FacetSurface::of_box(corner, corner + Vector3::new(0.05, 0.05, 0.012)).unwrap();
            walls.push(Wall::of_surface(Arc::new(step), 0));
        }
        Dem::new(law(1e8, 0.5, 0.1, 0.5), settings, walls).unwrap()
    }
}

/// Returns random hulls, a plate, a rod, and a cube wider than a slab.
fn shapes() -> Arc<[Polyhedron]> {
    let hull = |n: u64| {
        let mut draw = Stream::new(11, n, 0);
        let points: Vec<Vector3<f64>> = (0..12)
            .map(|_| {
                let v = Vector3::from_fn(|_, _| 2.0 * draw.uniform() - 1.0);
                v.normalize()
                    .component_mul(&Vector3::new(0.02, 0.016, 0.013))
            })
            .collect();
        Polyhedron::from_vertices(&points).unwrap().shape
    };
    let others = [
        cuboid(0.05, 0.04, 0.006),
        cuboid(0.06, 0.01, 0.012),
        cuboid(0.09, 0.09, 0.09),
    ];
    (0..6).map(hull).chain(others).collect()
}

fn fill(particles: &mut Particles<Volume>, mine: impl Fn(u64) -> bool) {
    let shapes = shapes();
    particles.set_shapes(Arc::clone(&shapes)).unwrap();
    let mut place = |id: u64, at: Motion<Volume>, shape: u32, kind: Kind, turn: Vector3<f64>| {
        if mine(id) {
            let body = Body {
                kind,
                ..Body::of_block(id, &shapes[shape as usize], DENSITY, 0)
            };
            let turn = UnitQuaternion::from_scaled_axis(turn);
            particles.add_block(body, at, shape, turn).unwrap();
        }
    };
    let still = Vector3::zeros();
    let giant = motion_at(Vector3::new(0.12, 0.12, 0.08), still, still);
    place(500_000, giant, 8, Kind::Free, Vector3::new(0.5, 0.4, 0.0));
    let fixed = motion_at(Vector3::new(0.03, 0.03, 0.01), still, still);
    place(400_000, fixed, 6, Kind::Fixed, Vector3::new(0.4, 0.0, 0.3));
    let stirs = motion_at(
        Vector3::new(0.12, 0.12, 0.3),
        Vector3::new(0.3, 0.0, -0.6),
        Vector3::z() * 20.0,
    );
    place(3_000, stirs, 7, Kind::Driven, Vector3::new(0.1, 0.0, 0.0));
    let mut spheres = Vec::new();
    for n in 0..72_u64 {
        let mut draw = Stream::new(12, n, 0);
        let (column, layer) = (n % 24, n / 24);
        // Five by five without the middle.
        let cell = if column >= 12 { column + 1 } else { column };
        let step = |k: u64| 0.03 + 0.045 * f64::from(u32::try_from(k).unwrap());
        let z = 0.05 + 0.042 * f64::from(u32::try_from(layer).unwrap());
        let random = |draw: &mut Stream| Vector3::from_fn(|_, _| 2.0 * draw.uniform() - 1.0);
        let velocity = random(&mut draw) * 0.4 - Vector3::z();
        let motion = motion_at(
            Vector3::new(step(cell % 5), step(cell / 5), z),
            velocity,
            random(&mut draw) * 10.0,
        );
        let (id, turn) = ((n * 131) % 997, random(&mut draw) * 3.0);
        if n % 9 == 4 {
            spheres.push((id, motion));
        } else {
            let shape = u32::try_from(n % 8).unwrap();
            place(id, motion, shape, Kind::Free, turn);
        }
    }
    for (id, motion) in spheres.into_iter().filter(|one| mine(one.0)) {
        particles.insert(Body::uniform::<Volume>(id, 0.012, DENSITY, 0), motion);
    }
}

#[derive(Clone, Default)]
struct Saved {
    grains: NamedColumns,
    contacts: Contacts,
    migrated: bool,
}

impl Saved {
    fn bits(&self) -> std::collections::BTreeMap<u64, Vec<u64>> {
        // A shift selects the image of a raw position.
        let mut grains = self.grains.clone();
        grains
            .columns
            .retain(|(name, _)| !name.starts_with("shift"));
        bits(&grains, &self.contacts)
    }
}

/// Makes `steps` steps from a saved state or the start, on ranks with several threads each; bodies are distributed by
/// id.
fn run(
    pile: Pile,
    (axis, bounds, threads): (SplitAxis, &[usize], usize),
    from: Option<&Saved>,
    (steps, batch): (u64, u64),
) -> Saved {
    let size = bounds.len() - 1;
    let parts = on_slabs(axis, bounds, |domain| {
        // The thread of the rank is one of its pool: a domain stays on its thread.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .use_current_thread()
            .build()
            .unwrap();
        let rank = domain.rank();
        let mut dem = pile.dem();
        let mut particles = Particles::new();
        match from {
            Some(saved) => {
                dem.restore(&saved.contacts).unwrap();
                let rows = saved.grains.filter(|row| row % size == rank);
                particles = Particles::from_table(&rows).unwrap();
                particles.set_shapes(shapes()).unwrap();
            }
            None => fill(&mut particles, |id| {
                usize::try_from(id).unwrap() % size == rank
            }),
        }
        dem.prepare(&mut particles, &domain).unwrap();
        let ids = |particles: &Particles<Volume>| -> Vec<u64> {
            let own = particles.body[..particles.owned()].iter();
            own.map(|body| body.id).collect()
        };
        let before = ids(&particles);
        for _ in 0..steps / batch {
            dem.advance_many(&mut particles, &domain, batch).unwrap();
        }
        drop(pool);
        Saved {
            migrated: before != ids(&particles),
            grains: particles.table(),
            contacts: dem.contacts(),
        }
    });
    let mut whole = Saved::default();
    for part in parts {
        append(
            (&mut whole.grains, &mut whole.contacts),
            (&part.grains, part.contacts),
        );
        whole.migrated |= part.migrated;
    }
    whole
}

const CLOSED: Pile = Pile {
    periodic: false,
    skin: 4e-3,
};
const PERIODIC: Pile = Pile {
    periodic: true,
    skin: 4e-3,
};
const ONE: (SplitAxis, &[usize], usize) = (SplitAxis::X, &[0, 24], 1);

/// Returns a pile on one rank, computed once for all tests.
fn straight(pile: Pile) -> &'static Saved {
    static ONES: [OnceLock<Saved>; 2] = [OnceLock::new(), OnceLock::new()];
    ONES[usize::from(pile.periodic)].get_or_init(|| run(pile, ONE, None, (STEPS, STEPS)))
}

#[test]
fn ranks_and_threads_do_not_show_in_a_pile() {
    for pile in [CLOSED, PERIODIC] {
        let one = straight(pile);
        let rows = [one.contacts.grains.rows(), one.contacts.walls.rows()];
        assert!(rows[0] > 100 && rows[1] > 5, "{rows:?}");
        let splits: [(SplitAxis, &[usize], usize); 5] = [
            (SplitAxis::X, &[0, 24], 2),
            (SplitAxis::X, &[0, 12, 24], 2),
            (SplitAxis::Y, &[0, 7, 14, 24], 1),
            (SplitAxis::Z, &[0, 5, 9, 40], 1),
            // An empty slab in between, and slabs thinner than the giant.
            (SplitAxis::X, &[0, 10, 10, 14, 24], 2),
        ];
        // Box walls do not affect the division into slabs: the closed pile is tested with the thin and the empty
        // ones.
        let first = if pile.periodic { 0 } else { 2 };
        for split in &splits[first..] {
            let many = run(pile, *split, None, (STEPS, STEPS));
            assert!(many.migrated || split.1.len() == 2, "none changes ranks");
            assert!(one.bits() == many.bits(), "{split:?}");
        }
    }
}

#[test]
fn skins_calls_and_restarts_do_not_show_in_a_pile() {
    let one = straight(PERIODIC).bits();
    for skin in [5e-4, 2e-2] {
        let pile = Pile { skin, ..PERIODIC };
        assert!(
            one == run(pile, ONE, None, (STEPS, 1)).bits(),
            "skin {skin}"
        );
    }
    let split = (SplitAxis::X, &[0, 9, 24][..], 2);
    for (pile, one) in [(PERIODIC, one), (CLOSED, straight(CLOSED).bits())] {
        let part = STEPS / 3;
        let a = run(pile, split, None, (part, 40));
        let b = run(
            pile,
            (SplitAxis::Z, &[0, 5, 9, 40], 1),
            Some(&a),
            (part, part),
        );
        let c = run(pile, ONE, Some(&b), (part, part));
        assert_eq!(c.contacts.steps, STEPS);
        assert!(one == c.bits());
    }
}
