//! Joints under a lattice: the space they occupy, friction on their faces, and the water that a lattice takes over.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::cover::covers;
use crate::flow::JointFlow;
use crate::loads::{RockLoad, add_wide_loads};
use crate::motion::Mover;
use crate::network::{Network, NetworkSettings, UnderLattice};
use nalgebra::{Matrix3, Vector3};

const GAP: f64 = 0.01;
const SIDES: [f64; 2] = [0.2, 0.1];

/// Returns settings under a lattice that takes over joints of 15 mm.
fn under(cell: f64) -> NetworkSettings {
    NetworkSettings {
        under: Some(UnderLattice {
            wide: 0.002,
            takeover: 0.015,
        }),
        ..settings(cell)
    }
}

#[test]
fn a_cover_has_the_corners_between_joints_and_ends_at_open_edges() {
    // A block in a pit, with joints at its bottom and at two of its sides.
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [0.3, 0.1, 0.1]],
        [[0.0, 0.0, 0.1], [0.09, 0.1, 0.2]],
        [[0.1, 0.0, 0.11], [0.2, 0.1, 0.2]],
        [[0.21, 0.0, 0.1], [0.3, 0.1, 0.2]],
    ]);
    let network = Network::new(&rocks(&solids), &under(0.02));
    let covers = covers(&network);
    let within = |point: [f64; 3], margin: f64| {
        let point = Vector3::from(point);
        covers.iter().any(|cover| cover.contains(&point, margin))
    };
    for inside in [
        [0.15, 0.05, 0.101],
        [0.095, 0.05, 0.15],
        [0.095, 0.05, 0.199],
        // Corners below the joints at the sides.
        [0.091, 0.05, 0.101],
        [0.209, 0.05, 0.101],
    ] {
        assert!(within(inside, 0.0), "{inside:?}");
    }
    for outside in [
        [0.095, 0.05, 0.2001],
        [0.15, 0.05, 0.099],
        [0.08, 0.05, 0.15],
    ] {
        assert!(!within(outside, 0.0), "{outside:?}");
    }
    // A margin widens a joint, but not beyond its mouth.
    assert!(within([0.0895, 0.05, 0.15], 0.001));
    assert!(!within([0.095, 0.05, 0.2001], 0.001));
    for cover in &covers {
        let [low, high] = cover.bounds();
        assert!(low.x <= high.x && low.z < 0.2 && high.z > 0.1);
    }
}

/// Returns the steady flow under a plate between two pressures \[Pa\], as the network of a lattice.
fn plate(pressures: [f64; 2]) -> (JointFlow, Vec<dem::polyhedron::PlacedPolyhedron>) {
    let [length, width] = SIDES;
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [length, width, 0.1]],
        [[0.0, 0.0, 0.1 + GAP], [length, width, 0.2]],
    ]);
    let network = Network::new(&rocks(&solids), &under(0.02));
    let drive = Fronts::new(&network, |at, _| {
        if at.x < 1e-9 {
            Some(pressures[0])
        } else if at.x > length - 1e-9 {
            Some(pressures[1])
        } else {
            None
        }
    });
    let mover = Mover::new(1, 1.0, Matrix3::identity(), solids[1].position);
    let mut flow = JointFlow::with_movers(network, water(), vec![mover]);
    flow.solve_steady(&drive, 0.0).unwrap();
    (flow, solids)
}

#[test]
fn friction_on_both_faces_is_half_of_the_lost_pressure() {
    let (flow, solids) = plate([30.0, 10.0]);
    let centroids: Vec<_> = solids.iter().map(|solid| solid.position).collect();
    let mut loads = vec![RockLoad::default(); 2];
    add_wide_loads(&flow, None, |_| None, &centroids, &mut loads);
    let exact = 0.5 * (30.0 - 10.0) * GAP * SIDES[1];
    for (load, side) in loads.iter().zip([-1.0, 1.0]) {
        assert!((load.force.x / exact - 1.0).abs() < 1e-10, "{load:?}");
        assert!(load.force.yz().norm() < 1e-12 * exact);
        // The force acts on the face.
        let arm = if side < 0.0 {
            0.1 - solids[0].position.z
        } else {
            0.1 + GAP - solids[1].position.z
        };
        assert!((load.moment.y - arm * load.force.x).abs() < 1e-10 * exact);
    }
    // A strip of a sixth of a cell of 4 mm at each mouth.
    let mut with_strips = vec![RockLoad::default(); 2];
    let front = |piece: usize| {
        let x = flow.network().open[piece].middle.x;
        (!(1e-9..=SIDES[0] - 1e-9).contains(&x)).then_some(if x < 1e-9 { 30.0 } else { 10.0 })
    };
    add_wide_loads(&flow, None, front, &centroids, &mut with_strips);
    let strips = 0.004 / 6.0 * (30.0 + 10.0) * SIDES[1];
    assert!((with_strips[0].force.z / strips - 1.0).abs() < 1e-10);
    assert!((with_strips[1].force.z / strips + 1.0).abs() < 1e-10);
}

#[test]
fn a_lattice_takes_over_the_pressure_the_discharge_and_the_load_of_a_joint() {
    let (mut flow, mut solids) = plate([30.0, 10.0]);
    let discharge: f64 = 0.5 * flow.outflows().iter().map(|q| q.abs()).sum::<f64>();
    // Below the limit the network stays.
    solids[1].position.z += 0.004;
    let renewal = flow.renew(&rocks(&solids));
    assert!(renewal.taken.is_empty() && flow.network().joints.len() == 1);
    let (mut flow, mut solids) = plate([30.0, 10.0]);
    let rise = 0.0051;
    solids[1].position.z += rise;
    // No water has entered since the plate moved.
    let before = flow.stored();
    let renewal = flow.renew(&rocks(&solids));
    assert!(flow.network().joints.is_empty());
    let [joint] = &renewal.taken[..] else {
        panic!("{} joints", renewal.taken.len())
    };
    println!("{:e} m3 of {before:e} m3", joint.water);
    assert!((renewal.exchanged / before - 1.0).abs() < 1e-12);
    assert!(renewal.water.abs() < 1e-12 * before && joint.water == renewal.exchanged);
    // Without the strips that the lattice loads.
    let exact = 20.0 * SIDES[0] * SIDES[1] - 0.004 / 6.0 * (30.0 + 10.0) * SIDES[1];
    assert!((joint.loads[1].force.z / exact - 1.0).abs() < 1e-10);
    assert!((joint.loads[0].force.z / exact + 1.0).abs() < 1e-10);
    // Pressure along the joint, and the profile of the velocity across it.
    let mut mean = 0.0;
    for step in 0..100 {
        let part = (f64::from(step) + 0.5) / 100.0;
        let (pressure, _) = joint.state(&Vector3::new(0.2 * part, 0.03, 0.107));
        assert!((pressure - (30.0 - 20.0 * part)).abs() < 1e-8, "{pressure}");
        let height = 0.1 + (GAP + rise) * part;
        let (_, velocity) = joint.state(&Vector3::new(0.07, 0.03, height));
        assert!(velocity.yz().norm() < 1e-12);
        mean += velocity.x / 100.0;
    }
    let expected = discharge / ((GAP + rise) * SIDES[1]);
    println!("mean velocity {mean:e} m/s, {expected:e} m/s");
    assert!((mean / expected - 1.0).abs() < 1e-3);
    // The joint returns only when it is narrower by a quarter.
    solids[1].position.z -= 0.003;
    assert!(flow.renew(&rocks(&solids)).taken.is_empty());
    assert!(flow.network().joints.is_empty());
    solids[1].position.z -= 0.002;
    let renewal = flow.renew(&rocks(&solids));
    assert_eq!(flow.network().joints.len(), 1);
    assert!(renewal.water.abs() < 1e-15 && renewal.exchanged < 0.0);
}
