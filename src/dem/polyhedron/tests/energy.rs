//! Energy of contacts between blocks: many collisions without friction and dashpots in a closed box.

use nalgebra::Vector3;

use super::super::force::Stiffness;
use super::super::{BlockContactModel, Polyhedron, RotationState};
use super::motion::{Block, World, law};
use super::{between, direction, random_hull, random_orientation};
use base::random::Stream;

const SIZE: f64 = 2.4;

/// Returns cuboids, a tetrahedron, an octahedron and hulls of random points, at random velocities.
fn crowd(seed: u64) -> Vec<Block> {
    let mut draw = Stream::new(seed, 0, 0);
    let mut blocks = Vec::new();
    for n in 0..12 {
        let points = |list: &[[f64; 3]]| {
            let corners: Vec<_> = list.iter().map(|c| Vector3::from(*c) * 0.3).collect();
            Polyhedron::from_vertices(&corners).unwrap().shape
        };
        let shape = match n % 4 {
            0 => Polyhedron::cuboid(Vector3::new(0.6, 0.4, 0.3)).unwrap(),
            1 => points(&[
                [1.0, 1.0, 1.0],
                [1.0, -1.0, -1.0],
                [-1.0, 1.0, -1.0],
                [-1.0, -1.0, 1.0],
            ]),
            2 => Polyhedron::cuboid(Vector3::new(0.4, 0.4, 0.4)).unwrap(),
            _ => {
                let hull = random_hull(&mut draw, 12);
                let corners: Vec<_> = hull.vertices().iter().map(|v| v * 0.4).collect();
                Polyhedron::from_vertices(&corners).unwrap().shape
            }
        };
        let cell = |k: u32, count: u32| SIZE * (f64::from(k % count) + 0.5) / f64::from(count);
        let at = Vector3::new(cell(n, 3), cell(n / 3, 2), cell(n / 6, 2));
        let mut block = Block::new(shape, at);
        block.velocity = direction(&mut draw) * 2.0;
        let spin = direction(&mut draw) * between(&mut draw, 0.0, 4.0);
        block.rotation = RotationState::new(random_orientation(&mut draw), &spin, &block.inertia);
        blocks.push(block);
    }
    blocks
}

/// Returns the largest relative change of the kinetic energy between contacts, over a number of impacts.
fn drift(model: BlockContactModel, stiffness: Stiffness, time_step: f64, impacts: u32) -> f64 {
    let mut law = law(1.0, 0.0, 0.0);
    law.stiffness = stiffness;
    let mut world = World::new(crowd(1), law, model, time_step).closed(SIZE);
    let energy = |world: &World| world.blocks.iter().map(Block::energy).sum::<f64>();
    // There is some overlap at the start: the energy is kinetic once the blocks have separated.
    world.run(1);
    while world.touching() {
        world.run(1);
    }
    let before = energy(&world);
    let (mut worst, mut looks) = (0.0_f64, 0);
    while world.impacts < impacts {
        world.run(20);
        if !world.touching() {
            looks += 1;
            worst = worst.max((energy(&world) / before - 1.0).abs());
        }
    }
    println!("{model:?} {stiffness:?} {time_step}: worst {worst:e} of {looks}",);
    assert!(looks > 10);
    worst
}

fn per_area(normal: f64) -> Stiffness {
    let shear = 0.0;
    Stiffness::PerArea { normal, shear }
}

/// Checks the energy over a thousand impacts of corners, edges and faces, from soft to stiff contacts.
#[test]
fn a_thousand_impacts_keep_the_energy() {
    for stiffness in [1e8_f64, 1e9] {
        let time_step = 0.1 * (2600.0 * 0.03 / (stiffness * 0.24)).sqrt();
        assert!(
            drift(
                BlockContactModel::Pressure,
                per_area(stiffness),
                time_step,
                1000
            ) < 1e-5
        );
    }
}

/// Checks that the published form, which has no potential, does not conserve energy.
#[test]
fn points_of_contact_do_not_keep_it() {
    let per_contact = Stiffness::PerContact {
        normal: 1e8,
        shear: 0.0,
    };
    let point = BlockContactModel::Point { rounding: 2e-3 };
    assert!(drift(point, per_contact, 8e-5, 200) > 1e-2);
}
