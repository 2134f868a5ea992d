//! Tests of the initial positions of grains, which are moved together with a grain between lists.

use crate::engine::rebuild::{pack_grains, unpack_grains};
use crate::message::{Reader, Writer};
use crate::particles::{Body, Motion, Particles};
use crate::space::Volume;
use nalgebra::Vector3;

/// Checks that grains keep their initial positions across migration, checkpoints and a periodic face, on request.
#[test]
fn displacements_are_raw_and_survive_a_table() {
    let mut particles = Particles::<Volume>::new();
    let motion = |x: f64| Motion {
        position: Vector3::new(x, 0.5, 0.25),
        ..Motion::default()
    };
    for (id, x) in [(3, 0.9), (1, 0.2)] {
        particles.insert(Body::uniform::<Volume>(id, 0.1, 2600.0, 0), motion(x));
    }
    assert_eq!(particles.displacement(0), None);
    assert!(
        !particles
            .table()
            .columns
            .iter()
            .any(|(name, _)| name.starts_with("start"))
    );
    particles.mark_start();
    particles.motion[0].position.x = 1.4;
    particles.insert(Body::uniform::<Volume>(2, 0.1, 2600.0, 0), motion(0.6));
    particles.sort();
    let moved = |particles: &Particles<Volume>| -> Vec<Vector3<f64>> {
        (0..particles.owned())
            .filter_map(|k| particles.displacement(k))
            .collect()
    };
    let expected = [
        Vector3::zeros(),
        Vector3::zeros(),
        Vector3::new(1.4 - 0.9, 0.0, 0.0),
    ];
    assert_eq!(moved(&particles), expected);
    // Through a file, and through a message to a rank without grains.
    let restored = Particles::<Volume>::from_table(&particles.table()).unwrap();
    assert_eq!(moved(&restored), expected);
    let mut writer = Writer::default();
    pack_grains(&particles, &[0, 1, 2], &mut writer);
    let mut other = Particles::<Volume>::new();
    other.mark_start();
    let mut reader = Reader(&writer.0);
    unpack_grains(&mut other, &mut reader).unwrap();
    assert_eq!(moved(&other), expected);
    let gone = particles.remove(|particles, k| particles.body[k].id == 1);
    assert_eq!(gone.len(), 1);
    assert_eq!(moved(&particles), expected[1..]);
    particles.forget_start();
    assert!(!particles.has_start());
}
