//! Planes, polygons and meshes act as the same wall if they describe the same plane; corners and interior edges.

use std::sync::Arc;

use approx::assert_relative_eq;
use nalgebra::{Rotation3, Vector3};

use super::super::contact::contact_bond;
use super::bonds::{CLAY, clay};
use super::*;
use base::random::Stream;

/// Returns the square about the origin across z, of half width 1, as `n` by `n` squares of two triangles.
pub(super) fn mesh(n: u32, half: f64) -> FacetSurface {
    let place = |k: u32| half * (2.0 * f64::from(k) / f64::from(n) - 1.0);
    let (vertices, facets) = triangles(n, place);
    FacetSurface::new(vertices, &facets).unwrap()
}

fn polygon(half: f64) -> FacetSurface {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners
        .map(|[x, y]| Vector3::new(half * x, half * y, 0.0))
        .to_vec();
    FacetSurface::new(vertices, &[vec![0, 1, 2, 3]]).unwrap()
}

const GLASS: linear::LinearParameters = linear::LinearParameters {
    normal_stiffness: Scaled::Absolute(1e5),
    stiffness_ratio: 0.8,
    friction: 0.3,
    normal_damping_ratio: 0.1,
    shear_damping_ratio: 0.05,
    ..SPRINGS
};

/// Returns the motion after the rebound of a ball thrown at the floor.
fn throw(floor: Wall<Volume>, at: [f64; 2], velocity: Vector3<f64>) -> Motion<Volume> {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let mut dem = linear(
        GLASS,
        DemSettings::new(about_origin::<Volume>(1.0), 2e-6, 1e-3),
        vec![floor],
    );
    let mut particles = Particles::new();
    let motion = Motion {
        position: Vector3::new(at[0], at[1], 0.0101),
        velocity,
        spin: Vector3::new(3.0, -20.0, 8.0),
    };
    particles.insert(body, motion);
    dem.advance_many(&mut particles, &alone(), 1500).unwrap();
    assert!(
        particles.motion[0].position[2] > 0.01,
        "it must have left again"
    );
    particles.motion[0]
}

/// Checks oblique rebounds with friction and spin from a plane, a polygon and a mesh, also over interior edges and
/// vertices.
#[test]
fn plane_polygon_and_mesh_rebound_alike() {
    let shapes = [polygon(0.1), mesh(1, 0.1), mesh(8, 0.1), mesh(40, 0.1)].map(Arc::new);
    let mut largest = 0.0_f64;
    for (k, at) in [
        [0.0, 0.0],
        [0.0123, -0.034],
        [0.025, 0.02],
        [0.0249, 0.0249],
        [-0.05, 0.05],
    ]
    .into_iter()
    .enumerate()
    {
        let mut draw = Stream::new(6, k as u64, 0);
        let velocity = Vector3::new(
            draw.uniform() - 0.5,
            draw.uniform() - 0.5,
            -0.5 - draw.uniform(),
        );
        let expected = throw(Wall::new(Vector3::zeros(), Vector3::z(), 0), at, velocity);
        assert!(expected.velocity[2] > 0.4);
        for shape in &shapes {
            let found = throw(Wall::of_surface(Arc::clone(shape), 0), at, velocity);
            for (a, b) in [
                (found.velocity, expected.velocity),
                (found.spin * 0.01, expected.spin * 0.01),
                (found.position, expected.position),
            ] {
                largest = largest.max((a - b).norm());
            }
        }
    }
    assert!(largest < 1e-12, "{largest}");
}

/// Returns a square between two coordinates along x.
fn strip(from: f64, to: f64) -> FacetSurface {
    let corners = [[from, -0.1], [to, -0.1], [to, 0.1], [from, 0.1]];
    let corners = corners.map(|[x, y]| Vector3::new(x, y, 0.0)).to_vec();
    FacetSurface::new(corners, &[vec![0, 1, 2, 3]]).unwrap()
}

/// Returns the motion of a ball 1500 steps after it began to fall on walls, and the number of its contacts after
/// `steps` of them.
fn drop_on(walls: Vec<Wall<Volume>>, x: f64, steps: u64) -> (Motion<Volume>, usize) {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let settings = DemSettings::new(about_origin::<Volume>(1.0), 2e-6, 1e-3);
    let mut dem = linear(GLASS, settings, walls);
    let mut particles = Particles::new();
    let motion = Motion {
        position: Vector3::new(x, 0.0013, 0.0101),
        velocity: Vector3::new(0.1, 0.0, -1.0),
        spin: Vector3::zeros(),
    };
    particles.insert(body, motion);
    dem.advance_many(&mut particles, &alone(), steps).unwrap();
    let mut contacts = 0;
    dem.for_each_contact(&particles, |_| contacts += 1);
    dem.advance_many(&mut particles, &alone(), 1500 - steps)
        .unwrap();
    (particles.motion[0], contacts)
}

/// Drops a ball on the seam of two walls in one plane, and next to it: it rebounds as from one wall.
#[test]
fn two_walls_that_touch_push_once() {
    let drop = |walls: Vec<Wall<Volume>>, x: f64| drop_on(walls, x, 1500);
    let wall = |surface: FacetSurface| Wall::of_surface(Arc::new(surface), 0);
    for x in [0.0, 1e-4, -1e-4, 4e-4] {
        let (one, _) = drop(vec![wall(strip(-0.1, 0.1))], x);
        let block =
            FacetSurface::of_box(Vector3::new(0.0, -0.1, -0.05), Vector3::new(0.1, 0.1, 0.0));
        for second in [strip(0.0, 0.1), strip(-0.02, 0.1), block.unwrap()] {
            let (two, _) = drop(vec![wall(strip(-0.1, 0.0)), wall(second)], x);
            assert_relative_eq!(two.velocity.z, one.velocity.z, max_relative = 1e-6);
            assert_relative_eq!(two.velocity.x, one.velocity.x, max_relative = 0.02);
        }
    }
}

/// Returns the number of bonds of a heavy ball of 1 mm at a position above walls of clay, and the forces on it after
/// one step and when it has moved by a fifth of the shear at which a bond breaks, along each direction of the plane.
fn bonded(walls: Vec<Wall<Volume>>, [x, y]: [f64; 2], overlap: f64) -> (u64, Vec<Vector3<f64>>) {
    let parameters = contact_bond::ContactBondParameters {
        bonding_gap: 1e-6,
        ..CLAY
    };
    let settings = DemSettings::new(about_origin::<Volume>(1.0), 1.0, 1e-4);
    let mut dem = clay(parameters, settings, walls);
    let mut particles = Particles::new();
    let body = Body {
        mass: 1e30,
        inertia: 1e30,
        ..Body::uniform::<Volume>(1, 1e-3, 2600.0, 0)
    };
    let motion = Motion {
        position: Vector3::new(x, y, 1e-3 - overlap),
        ..Motion::default()
    };
    particles.insert(body, motion);
    let bonds = dem
        .bond_existing_contacts(&mut particles, &alone())
        .unwrap();
    let mut forces = Vec::new();
    for direction in [
        Vector3::zeros(),
        Vector3::x(),
        -2.0 * Vector3::x(),
        Vector3::y(),
    ] {
        particles.motion[0].velocity = direction * 1e-6;
        dem.advance_many(&mut particles, &alone(), 10).unwrap();
        forces.push(particles.contact[0].force);
    }
    assert!(dem.take_breaks().is_empty());
    (bonds, forces)
}

/// Checks that a grain has one bond over the seam of pieces of one plane, and over facets of several walls next to a
/// plane, with the force of a bond with one wall, k_n times the overlap, in compression, tension and shear.
#[test]
fn a_bond_over_a_seam_is_one_bond() {
    let wall = |surface: FacetSurface| Wall::of_surface(Arc::new(surface), 0);
    let cuboid = |from: f64, to: f64| {
        let (low, high) = (Vector3::new(from, -0.1, -0.05), Vector3::new(to, 0.1, 0.0));
        wall(FacetSurface::of_box(low, high).unwrap())
    };
    let plane = || Wall::<Volume>::new(Vector3::zeros(), Vector3::z(), 0);
    for overlap in [2e-6, -5e-7] {
        let (bonds, one) = bonded(vec![wall(strip(-0.1, 0.1))], [0.0, 0.0], overlap);
        assert_eq!(bonds, 1);
        assert_relative_eq!(one[0].z, 1e6 * overlap, max_relative = 1e-9);
        assert_relative_eq!(one[1].x, -10.0, max_relative = 1e-3);
        for walls in [
            vec![wall(strip(-0.1, 0.0)), wall(strip(0.0, 0.1))],
            vec![cuboid(-0.1, 0.0), cuboid(0.0, 0.1)],
            vec![cuboid(0.0, 0.1), wall(strip(-0.1, 0.0))],
            vec![
                wall(strip(-0.1, 0.05)),
                cuboid(0.0, 0.1),
                wall(mesh(8, 0.1)),
            ],
            vec![wall(mesh(8, 0.1)), wall(polygon(0.1))],
            vec![plane(), cuboid(0.0, 0.1)],
            vec![cuboid(0.0, 0.1), plane()],
        ] {
            let (bonds, several) = bonded(walls, [0.0, 0.0], overlap);
            assert_eq!(bonds, 1);
            // Next to the seam the bond ends at the edge of its piece. Its normal turns by 1e-5 m over the radius,
            // which adds a part of the normal force along the plane and of the shear of 10 N across it, and the bond
            // becomes longer by 5e-8 m.
            let turn = 1e-5 / 1e-3;
            let along = 1.05 * 1e6 * overlap.abs() * turn;
            let across = 1.05 * (10.0 * turn + 1e6 * 5e-8);
            for (several, one) in several.iter().zip(&one) {
                assert_relative_eq!(several.x, one.x, epsilon = along);
                assert_relative_eq!(several.y, one.y, epsilon = along);
                assert_relative_eq!(several.z, one.z, epsilon = across);
            }
        }
    }
}

/// Checks that a plane wall and facets in its plane, of a polygon, a box, a mesh or a second plane, act as one plane.
#[test]
fn facets_in_a_plane_wall_push_once() {
    let plane = || {
        let up = Vector3::new(0.0, 0.0, 1.0);
        Wall::<Volume>::new(Vector3::zeros(), up, 0)
    };
    let drop = |walls: Vec<Wall<Volume>>, x: f64| drop_on(walls, x, 110);
    let wall = |surface: FacetSurface| Wall::of_surface(Arc::new(surface), 0);
    let cuboid = |from: f64, high: f64| {
        FacetSurface::of_box(
            Vector3::new(from, -0.1, -0.05),
            Vector3::new(0.1, 0.1, high),
        )
        .unwrap()
    };
    for x in [0.0, 1e-4, -1e-4, 0.05] {
        let (alone, contacts) = drop(vec![plane()], x);
        assert_eq!(contacts, 1);
        for second in [
            wall(polygon(0.5)),
            wall(mesh(8, 0.1)),
            wall(strip(0.0, 0.1)),
            wall(cuboid(0.0, 0.0)),
            wall(cuboid(0.0, -0.001)),
            plane(),
        ] {
            for walls in [vec![plane(), second.clone()], vec![second, plane()]] {
                let (both, contacts) = drop(walls, x);
                assert_eq!(contacts, 1, "at {x}");
                assert_eq!(both, alone, "at {x}");
            }
        }
    }
}

/// Checks that the edge at the foot of a ramp on a plane wall exerts no force: the plane carries the ball. A ramp of 12
/// degrees touches a ball of 10 mm with its face up to 2.1 mm before its foot; the edge is in an overlap of 0.29 mm up
/// to 2.4 mm before it.
#[test]
fn the_foot_of_a_ramp_on_a_plane_wall_is_no_bump() {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let up = Vector3::new(0.0, 0.0, 1.0);
    let high = 0.2 * 12.0_f64.to_radians().tan();
    let corners = [
        [0.0, -0.1, 0.0],
        [0.0, 0.1, 0.0],
        [0.2, 0.1, high],
        [0.2, -0.1, high],
        [-0.1, 0.1, 0.0],
        [-0.1, -0.1, 0.0],
    ];
    let corners = corners.map(Vector3::from).to_vec();
    let ramp = FacetSurface::new(corners.clone(), &[vec![0, 1, 2, 3]]).unwrap();
    let with_floor = FacetSurface::new(corners, &[vec![0, 1, 2, 3], vec![5, 4, 1, 0]]).unwrap();
    let plane = || Wall::<Volume>::new(Vector3::zeros(), up, 0);
    let fall = |walls: Vec<Wall<Volume>>| {
        let settings = DemSettings::new(about_origin::<Volume>(1.0), 2e-6, 1e-3);
        let mut dem = linear(GLASS, settings, walls);
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(-0.00225, 0.0, 0.0101),
            velocity: Vector3::new(0.0, 0.0, -1.0),
            spin: Vector3::zeros(),
        };
        particles.insert(body, motion);
        dem.advance_many(&mut particles, &alone(), 1500).unwrap();
        particles.motion[0]
    };
    let level = fall(vec![plane()]);
    for surface in [ramp, with_floor] {
        let found = fall(vec![plane(), Wall::of_surface(Arc::new(surface), 0)]);
        assert_eq!(found, level);
    }
}

/// Checks that a belt, a wall that moves within its own plane, is stationary as a surface and drags like a plane, and
/// that a wall moves normal to its facets.
#[test]
fn a_belt_drags_and_stays() {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let carry = |mut belt: Wall<Volume>, velocity: Vector3<f64>| {
        let mut settings = DemSettings::new(about_origin::<Volume>(1.0), 5e-6, 1e-3);
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
        belt.velocity = velocity;
        let mut dem = linear(GLASS, settings, vec![belt]);
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(-0.09, 0.0, 0.01 - body.mass * 9.81 / 1e5),
            velocity: Vector3::zeros(),
            spin: Vector3::zeros(),
        };
        particles.insert(body, motion);
        dem.advance_many(&mut particles, &alone(), 40_000).unwrap();
        (particles.motion[0], dem.walls()[0].point)
    };
    let along = Vector3::new(0.4, 0.1, 0.0);
    let (plane, _) = carry(Wall::new(Vector3::zeros(), Vector3::z(), 0), along);
    for shape in [polygon(0.1), mesh(8, 0.1)] {
        let shape = Arc::new(shape);
        let (found, moved) = carry(Wall::of_surface(Arc::clone(&shape), 0), along);
        assert_relative_eq!(found.position, plane.position, epsilon = 1e-9);
        assert_eq!(moved, Vector3::zeros());
        let up = along + Vector3::new(0.0, 0.0, 0.01);
        let (lifted, moved) = carry(Wall::of_surface(shape, 0), up);
        assert_relative_eq!(moved, Vector3::new(0.0, 0.0, 0.002), epsilon = 1e-12);
        assert!(lifted.position.z > 0.0119, "{}", lifted.position);
    }
    // A box has facets across all directions.
    let cup = FacetSurface::of_box(Vector3::repeat(-0.1), Vector3::repeat(0.1)).unwrap();
    let (_, moved) = carry(Wall::of_surface(Arc::new(cup), 0), along);
    assert_relative_eq!(moved, along * 0.2, epsilon = 1e-12);
}

/// Checks sliding over 80 interior edges: friction does not decrease, the grain does not jump, and the shear force is
/// transferred.
#[test]
fn a_grain_slides_over_interior_edges() {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let slide = |floor: Wall<Volume>| {
        let mut settings = DemSettings::new(about_origin::<Volume>(1.0), 5e-6, 1e-3);
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
        let mut dem = linear(GLASS, settings, vec![floor]);
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(-0.05, 0.0013, 0.01 - body.mass * 9.81 / 1e5),
            velocity: Vector3::new(0.5, 0.01, 0.0),
            spin: Vector3::zeros(),
        };
        particles.insert(body, motion);
        let mut lowest_friction = f64::INFINITY;
        for _ in 0..400 {
            dem.advance_many(&mut particles, &alone(), 40).unwrap();
            if dem.time() < 0.045 {
                let force = particles.contact[0].force;
                lowest_friction = lowest_friction.min(force.xy().norm() / force[2]);
            }
        }
        (particles.motion[0], lowest_friction)
    };
    let (expected, friction) = slide(Wall::new(Vector3::zeros(), Vector3::z(), 0));
    assert!(expected.position[0] > -0.03 && friction > 0.29);
    let (found, friction) = slide(Wall::of_surface(Arc::new(mesh(80, 0.1)), 0));
    assert!((found.position - expected.position).norm() < 1e-10);
    assert!((found.velocity - expected.velocity).norm() < 1e-8);
    assert!(friction > 0.29, "{friction}");
}

/// Checks a ball in the V between two facets, which bears on both: N = m g / (2 cos) each, and the edge between them
/// exerts no force.
#[test]
fn a_concave_corner_holds_with_its_faces_alone() {
    let slope = 40.0_f64.to_radians();
    let (cos, tan) = (slope.cos(), slope.tan());
    let vertices = vec![
        Vector3::new(0.0, -0.1, 0.0),
        Vector3::new(0.0, 0.1, 0.0),
        Vector3::new(0.1, 0.1, 0.1 * tan),
        Vector3::new(0.1, -0.1, 0.1 * tan),
        Vector3::new(-0.1, 0.1, 0.1 * tan),
        Vector3::new(-0.1, -0.1, 0.1 * tan),
    ];
    let facets = [vec![0, 1, 2], vec![0, 2, 3], vec![0, 5, 4], vec![0, 4, 1]];
    let surface = FacetSurface::new(vertices, &facets).unwrap();
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let mut settings = DemSettings::new(about_origin::<Volume>(0.2), 1e-5, 1e-3);
    settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    settings.local_damping = 0.5;
    let parameters = linear::LinearParameters {
        friction: 0.0,
        ..GLASS
    };
    let mut dem = linear(
        parameters,
        settings,
        vec![Wall::of_surface(Arc::new(surface), 0)],
    );
    let mut particles = Particles::new();
    let motion = Motion {
        position: Vector3::new(0.002, 0.0, 0.02),
        ..Motion::default()
    };
    particles.insert(body, motion);
    dem.advance_many(&mut particles, &alone(), 40_000).unwrap();
    let mut forces = Vec::new();
    dem.for_each_contact(&particles, |contact| {
        assert_eq!(contact.wall, Some(0));
        forces.push(contact.normal_force);
    });
    assert_eq!(forces.len(), 2);
    let weight = body.mass * 9.81;
    for force in forces {
        assert_relative_eq!(force, weight / (2.0 * cos), max_relative = 1e-4);
    }
}

/// Checks that a moving wall carries its facets along, and that its restitution is that of the plane.
#[test]
fn a_moving_mesh_hits_like_a_moving_plane() {
    let hit = |mut wall: Wall<Volume>| {
        wall.velocity = Vector3::new(0.05, 0.0, 0.4);
        let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
        let settings = DemSettings::new(about_origin::<Volume>(1.0), 2e-6, 1e-3);
        let mut dem = linear(GLASS, settings, vec![wall]);
        let mut particles = Particles::new();
        // Off the edges of the mesh, whose contacts are exact to their rim.
        let motion = Motion {
            position: Vector3::new(0.003, 0.001, 0.0101),
            ..Motion::default()
        };
        particles.insert(body, motion);
        dem.advance_many(&mut particles, &alone(), 3000).unwrap();
        particles.motion[0]
    };
    let expected = hit(Wall::new(Vector3::zeros(), Vector3::z(), 0));
    let found = hit(Wall::of_surface(Arc::new(mesh(5, 0.1)), 0));
    assert!(expected.velocity[2] > 0.6);
    assert_relative_eq!(found.velocity, expected.velocity, epsilon = 1e-12);
    assert!((found.spin - expected.spin).norm() < 1e-9);
}

/// Checks the angular momentum of oblique collisions in space with friction and spin: it is constant to 1e-10 of its
/// parts.
#[test]
fn collisions_keep_angular_momentum() {
    let mut worst = 0.0_f64;
    for k in 0..20 {
        let mut draw = Stream::new(12, k, 0);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * (2.0 * draw.uniform() - 1.0));
        let turn = Rotation3::new(vector(3.0));
        let bodies = [1e-3, 1.7e-3].map(|r| Body::uniform::<Volume>(1, r, 2600.0, 0));
        let between = turn * Vector3::new(2.75e-3, 0.0, 0.0);
        let motions = [
            Motion {
                position: vector(1e-3),
                velocity: vector(0.2) + between * 100.0,
                spin: vector(200.0),
            },
            Motion {
                velocity: vector(0.2) - between * 100.0,
                spin: vector(200.0),
                ..Motion::default()
            },
        ];
        let settings = DemSettings::new(about_origin::<Volume>(0.02), 1e-7, 1e-4);
        let mut dem = linear(GLASS, settings, Vec::new());
        let mut particles = Particles::new();
        for (id, (body, motion)) in (1..).zip(bodies.into_iter().zip(motions)) {
            let position = if id == 1 {
                motion.position
            } else {
                motions[0].position + between
            };
            particles.insert(Body { id, ..body }, Motion { position, ..motion });
        }
        let total = |particles: &Particles<Volume>| {
            let (mut sum, mut scale) = (Vector3::zeros(), 0.0);
            for (body, m) in particles.body.iter().zip(&particles.motion) {
                let parts = [
                    m.position.cross(&m.velocity) * body.mass,
                    m.spin * body.inertia,
                ];
                sum += parts[0] + parts[1];
                scale += parts[0].norm() + parts[1].norm();
            }
            (sum, scale)
        };
        let (before, scale) = total(&particles);
        dem.advance_many(&mut particles, &alone(), 6000).unwrap();
        assert_eq!(dem.statistics(&particles).contacts, 0);
        let change = particles.motion[0].velocity - motions[0].velocity;
        assert!(change.norm() > 0.1, "they must have met");
        worst = worst.max((total(&particles).0 - before).norm() / scale);
    }
    assert!(worst < 1e-10, "{worst}");
}
