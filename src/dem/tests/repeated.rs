//! Walls of facets in domains with periodic axes: the seam has no effect.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::super::contact::blocks::BlockLaw;
use super::super::polyhedron::{self, BlockContactModel, Polyhedron, Stiffness};
use super::*;
use base::error::{Remedy, Report};
use base::number::single;
use structure::{Frame, Images, Shape};

const PERIOD: f64 = 0.1;

const GLASS: linear::LinearParameters = linear::LinearParameters {
    normal_stiffness: Scaled::Absolute(1e5),
    stiffness_ratio: 0.8,
    friction: 0.3,
    normal_damping_ratio: 0.1,
    shear_damping_ratio: 0.05,
    ..SPRINGS
};

/// Returns a domain of one period along x and y from the origin, and 0.4 m along z.
fn region() -> GrainDomain<Volume> {
    let upper = Vector3::new(PERIOD, PERIOD, 0.4);
    let mut region = GrainDomain::closed(Vector3::new(0.0, 0.0, -0.2), upper, 0.004);
    region.periodic = [true, true, false];
    region
}

/// Returns a square of one period across z, as `n` by `n` squares of two triangles; its corner is at `from`, and
/// coordinates are rounded as in a binary STL file.
fn mesh(n: u32, from: f64) -> Wall<Volume> {
    let place = |k: u32| f64::from(single(from + PERIOD * f64::from(k) / f64::from(n)));
    let (vertices, facets) = triangles(n, place);
    wall(FacetSurface::new(vertices, &facets).unwrap())
}

fn wall(surface: FacetSurface) -> Wall<Volume> {
    let surface = surface.repeated([0.0, 0.0, -0.2], [PERIOD, PERIOD, 0.0]);
    Wall::of_surface(Arc::new(surface.unwrap()), 0)
}

struct Silent;

impl Report for Silent {
    fn error(&mut self, path: &str, reason: String, _: Remedy) {
        panic!("{path}: {reason}");
    }

    fn unknown_material(&mut self, path: &str, name: &str, _: &[&str]) {
        panic!("{path}: {name}");
    }
}

/// Returns the surface of a structure as a wall.
fn structure(shape: &str) -> Wall<Volume> {
    let shape: Shape = serde_json::from_str(shape).unwrap();
    let frame = Frame {
        dimension: 3,
        size: [PERIOD, PERIOD, 0.4],
    };
    let read = |_: &base::geometry::Mesh| Err("no file".into());
    let solid = shape.solid(&frame, "shape", &read, &mut Silent).unwrap();
    let images = Images::new(solid, frame, [true, true, false], 0.01);
    let facets = images.facets(1e-5, 1.0);
    let vertices = facets.vertices.iter().map(|at| Vector3::from(*at));
    wall(FacetSurface::new(vertices.collect(), &facets.faces).unwrap())
}

fn plane() -> Wall<Volume> {
    Wall::new(Vector3::zeros(), Vector3::z(), 0)
}

fn floors() -> Vec<(&'static str, Wall<Volume>)> {
    vec![
        ("two triangles", mesh(1, 0.0)),
        ("a fine mesh", mesh(20, 0.0)),
        ("a seam inside the domain", mesh(7, -0.037)),
        (
            "a box",
            structure(r#"{"box": {"from": [0, 0, -0.1], "to": [0.1, 0.1, 0]}}"#),
        ),
        (
            "a box of several periods",
            structure(r#"{"box": {"from": [-1, -1, -0.1], "to": [1, 1, 0]}}"#),
        ),
        (
            "a prism of several periods across its axis",
            structure(
                r#"{"polygon": {"points": [[-0.2, -0.1], [0.23, -0.1], [0.23, 0], [-0.2, 0]],
                    "axis": "y", "from": -1, "to": 1}}"#,
            ),
        ),
    ]
}

/// Returns the motion of a ball thrown along the floor, and the minimum of friction over normal force while it slides.
fn slide(floor: Wall<Volume>, velocity: Vector3<f64>) -> (Motion<Volume>, f64) {
    let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
    let mut settings = DemSettings::new(region(), 5e-6, 1e-3);
    settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut dem = linear(GLASS, settings, vec![floor]);
    let mut particles = Particles::new();
    let motion = Motion {
        position: Vector3::new(0.0913, 0.0717, 0.01 - body.mass * 9.81 / 1e5),
        velocity,
        spin: Vector3::zeros(),
    };
    particles.insert(body, motion);
    let mut least = f64::INFINITY;
    for _ in 0..1000 {
        dem.advance_many(&mut particles, &alone(), 40).unwrap();
        if dem.time() < 0.19 {
            let force = particles.contact[0].force;
            least = least.min(force.xy().norm() / force[2]);
        }
    }
    (particles.motion[0], least)
}

/// Checks a ball that crosses both seams several times: its motion is that on a plane, and friction acts throughout.
#[test]
fn a_grain_slides_over_the_seam() {
    let velocity = Vector3::new(2.0, 0.7, 0.0);
    let (expected, friction) = slide(plane(), velocity);
    assert!(expected.position[0] > 0.35 && expected.position[1] > 0.11);
    assert!(friction > 0.299, "{friction}");
    for (what, floor) in floors() {
        let (found, friction) = slide(floor, velocity);
        let away = (found.position - expected.position).norm();
        let faster = (found.velocity - expected.velocity).norm();
        assert!(away < 1e-8 && faster < 1e-6, "{what}: {away} {faster}");
        assert!(friction > 0.299, "{what}: {friction}");
    }
}

/// Places a stationary grain over the seam, at its corner and next to it: there is one contact, which bears the weight.
#[test]
fn a_grain_rests_over_the_seam() {
    for (what, floor) in floors() {
        for at in [[0.0, 0.05], [0.0, 0.0], [0.0999, 0.0002], [-0.0012, 0.06]] {
            let body = Body::uniform::<Volume>(1, 0.01, 2600.0, 0);
            let mut settings = DemSettings::new(region(), 1e-5, 1e-3);
            settings.gravity = Vector3::new(0.0, 0.0, -9.81);
            settings.local_damping = 0.5;
            let mut dem = linear(GLASS, settings, vec![floor.clone()]);
            let mut particles = Particles::new();
            let motion = Motion {
                position: Vector3::new(at[0], at[1], 0.0101),
                ..Motion::default()
            };
            particles.insert(body, motion);
            dem.advance_many(&mut particles, &alone(), 10_000).unwrap();
            let mut forces = Vec::new();
            dem.for_each_contact(&particles, |contact| forces.push(contact.normal_force));
            let weight = body.mass * 9.81;
            assert_eq!(forces.len(), 1, "{what} {at:?}");
            assert!((forces[0] / weight - 1.0).abs() < 1e-6, "{what} {forces:?}");
            let moved = (particles.motion[0].position.xy() - motion.position.xy()).norm();
            assert!(moved < 1e-9, "{what} {at:?} {moved}");
        }
    }
}

/// Checks that a box that ends in the domain has real edges: a grain that rolls over its end falls.
#[test]
fn edges_that_meet_no_image_stay() {
    let short = structure(r#"{"box": {"from": [0.02, -1, -0.1], "to": [0.09, 1, 0]}}"#);
    let surface = short.surface.as_ref().unwrap();
    for (at, distance) in [
        ([0.095, 0.0, 0.0], 0.005),
        ([0.005, 0.099, 0.0], 0.015),
        ([0.096, 0.05, 0.003], 0.006_f64.hypot(0.003)),
    ] {
        let found = surface.clearance(&Vector3::from(at));
        assert!((found - distance).abs() < 1e-12, "{found} {distance}");
    }
}

/// Checks that a floor that moves within its own plane drags like a plane, for any number of periods.
#[test]
fn a_moving_mesh_drags_as_a_plane() {
    let run = |mut floor: Wall<Volume>| {
        floor.velocity = Vector3::new(3.0, -1.1, 0.0);
        slide(floor, Vector3::zeros()).0
    };
    let expected = run(plane());
    assert!(expected.velocity[0] > 0.3);
    for (what, floor) in floors() {
        let found = run(floor);
        let away = (found.position - expected.position).norm();
        let faster = (found.velocity - expected.velocity).norm();
        assert!(away < 1e-8 && faster < 1e-6, "{what}: {away} {faster}");
    }
}

/// Checks that a block slides over the seam with the deceleration g mu.
#[test]
fn a_block_slides_over_the_seam() {
    let run = |floor: Wall<Volume>| {
        let law = polyhedron::BlockPairLaw {
            stiffness: Stiffness::PerArea {
                normal: 1e8,
                shear: 5e7,
            },
            friction: 0.3,
            normal_damping_ratio: 0.3,
            shear_damping_ratio: 0.3,
        };
        let law = Law::Blocks(BlockLaw {
            parameters: PairTable::uniform(1, law),
            model: BlockContactModel::Pressure,
            mass_damping: 0.0,
        });
        let mut settings = DemSettings::new(region(), 2e-5, 1e-3);
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
        let mut dem = Dem::new(law, settings, vec![floor]).unwrap();
        let shape = Polyhedron::cuboid(Vector3::new(0.02, 0.02, 0.005)).unwrap();
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let body = Body::of_block(0, &shape, 2600.0, 0);
        let motion = Motion {
            position: Vector3::new(0.06, 0.07, 0.0025 - 0.4e-6),
            velocity: Vector3::new(1.0, 0.2, 0.0),
            spin: Vector3::zeros(),
        };
        let turn = UnitQuaternion::identity();
        particles.add_block(body, motion, 0, turn).unwrap();
        dem.advance_many(&mut particles, &alone(), 10_000).unwrap();
        particles.motion[0]
    };
    let expected = run(plane());
    assert!(expected.position[0] > 0.2);
    for (what, floor) in floors().into_iter().take(5) {
        let found = run(floor);
        let away = (found.position - expected.position).norm();
        let faster = (found.velocity - expected.velocity).norm();
        assert!(away < 1e-9 && faster < 1e-8, "{what}: {away} {faster}");
    }
}

/// Bodies that extend over half a period would need images that do not exist.
#[test]
fn bodies_too_large_for_the_period_are_refused() {
    let mut dem = linear(
        GLASS,
        DemSettings::new(region(), 5e-6, 1e-3),
        vec![mesh(1, 0.0)],
    );
    let mut particles = Particles::new();
    particles.insert(
        Body::uniform::<Volume>(1, 0.0495, 2600.0, 0),
        Motion::default(),
    );
    let error = dem.advance(&mut particles, &alone()).unwrap_err();
    assert!(error.to_string().contains("half a period"), "{error}");
}
