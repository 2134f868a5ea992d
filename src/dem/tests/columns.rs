//! Tests of the data of a grain that are exchanged between ranks, and of the events at which they are.

use super::*;
use crate::columns::Crosses;
use crate::engine::rebuild::{pack_grains, unpack_grains};
use crate::message::{Reader, Writer};
use crate::polyhedron::{Polyhedron, RotationState};
use nalgebra::{UnitQuaternion, Vector3};

/// Returns a fixed, a driven and a free sphere and a block with all optional arrays of a scene, and no two equal
/// values.
fn all_arrays() -> Particles<Volume> {
    let mut particles = Particles::<Volume>::new();
    let cube = Polyhedron::cuboid(Vector3::new(0.5, 0.25, 1.0)).unwrap();
    particles.set_shapes(vec![cube].into()).unwrap();
    let motion = |x: f64| Motion {
        position: Vector3::new(x, 0.5 * x, 0.25),
        velocity: Vector3::new(0.5, -x, 1.5),
        spin: Vector3::new(x, 2.0, -0.75),
    };
    for (id, x, kind) in [
        (3, -0.25_f64, Kind::Fixed),
        (5, 2.5, Kind::Driven),
        (7, 0.75, Kind::Free),
    ] {
        let mut body = Body::uniform::<Volume>(id, 0.1 * x.abs(), 2600.0, 1);
        body.kind = kind;
        particles.insert(body, motion(x));
    }
    let block = Body {
        id: 11,
        radius: 0.0,
        mass: 2.0,
        inertia: 0.25,
        material: 1,
        kind: Kind::Free,
    };
    let turned = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
    particles.add_block(block, motion(-1.5), 0, turned).unwrap();
    particles.allocate_fluid_loads();
    particles.keep_extra();
    particles.mark_start();
    particles.keep_last_velocity();
    for (k, number) in (0..particles.owned()).zip([0.5, 1.5, 2.5, 3.5]) {
        particles.motion[k].position.z += number;
        particles.contact[k].force = Vector3::new(number, 0.25, -number);
        particles.contact[k].torque = Vector3::new(0.125, number, 2.0);
        particles.fluid[k].force = Vector3::new(4.0, number, number + 1.0);
        particles.fluid[k].torque = Vector3::new(number, 8.0, -1.0);
        for (n, extra) in (0_u32..).zip(&mut particles.extra[k]) {
            *extra = number * f64::from(n);
        }
    }
    particles
}

#[test]
fn arrays_cross_ranks_when_the_list_says() {
    let particles = all_arrays();
    let all: Vec<usize> = (0..particles.owned()).collect();
    let empty = || {
        let mut empty = Particles::<Volume>::new();
        empty.set_shapes(particles.shapes.clone()).unwrap();
        empty.allocate_fluid_loads();
        empty.keep_extra();
        empty.mark_start();
        empty.keep_last_velocity();
        empty
    };
    // A grain that changes its owner keeps all its data.
    let mut writer = Writer::default();
    pack_grains(&particles, &all, &mut writer);
    let mut owner = empty();
    let mut reader = Reader(&writer.0);
    unpack_grains(&mut owner, &mut reader).unwrap();
    assert!(reader.is_empty());
    assert_eq!(owner.table(), particles.table());
    // A ghost has no loads; its motion and rotation are updated in each step.
    let mut writer = Writer::default();
    for &k in &all {
        particles.pack(k, [0, 1, 0], Crosses::Creation, &mut writer);
    }
    let mut ghosts = empty();
    let mut reader = Reader(&writer.0);
    while !reader.is_empty() {
        ghosts.unpack(Crosses::Creation, &mut reader).unwrap();
    }
    assert_eq!((ghosts.owned(), ghosts.len()), (0, 4));
    assert_eq!(ghosts.body, particles.body);
    assert_eq!(ghosts.shift, [[0, 1, 0]; 4]);
    assert_eq!(*ghosts.shape, *particles.shape);
    assert_eq!(ghosts.contact, [Load::default(); 4]);
    ghosts.motion.fill(Motion::default());
    ghosts.rotation.fill(RotationState::default());
    let mut writer = Writer::default();
    particles.pack_step(&[3, 1], &mut writer);
    assert_eq!(writer.0.len(), 2 * particles.step_bytes());
    ghosts.unpack_step(1..3, &mut Reader(&writer.0)).unwrap();
    assert_eq!(
        ghosts.motion[1..3],
        [particles.motion[3], particles.motion[1]]
    );
    assert_eq!(
        ghosts.rotation[1..3],
        [particles.rotation[3], particles.rotation[1]]
    );
    assert_eq!(ghosts.motion[0], Motion::default());
}
