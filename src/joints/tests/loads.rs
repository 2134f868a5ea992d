//! Force and moment on the blocks of a joint between two known pressures, against integrals of the exact pressure.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::flow::JointFlow;
use crate::loads::{RockLoad, add_wide_loads, loads};
use crate::network::{Network, NetworkSettings, UnderLattice};
use dem::polyhedron::{PlacedPolyhedron, Polyhedron};
use nalgebra::{UnitQuaternion, Vector3};

/// Pressures at both ends \[Pa\], and extent of the joint along the flow and across \[m\].
const PRESSURES: [f64; 2] = [30.0, 10.0];
const ENDS: [f64; 2] = [0.05, 0.2];
const WIDTH: f64 = 0.1;

/// Rotation of a scene about the origin.
fn turn() -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 0.7))
}

/// Returns the steady flow between blocks that are turned as a whole, between the pressures at both ends.
fn flow(
    solids: &mut [PlacedPolyhedron],
    turn: UnitQuaternion<f64>,
    settings: &NetworkSettings,
) -> JointFlow {
    for solid in solids.iter_mut() {
        solid.position = turn * solid.position;
        solid.orientation = turn * solid.orientation;
    }
    let network = Network::new(&rocks(solids), settings);
    assert_eq!(network.joints.len(), 1);
    let drive = Fronts::new(&network, |at, _| {
        let x = (turn.inverse() * at).x;
        match ENDS.map(|end| (x - end).abs() < 2e-4) {
            [true, _] => Some(PRESSURES[0]),
            [_, true] => Some(PRESSURES[1]),
            _ => None,
        }
    });
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    flow
}

/// Returns force and moment of a pressure `p(x)` on the face `z(x)` of a block, with the normal `-n` of its force: the
/// integral over the face by the midpoint rule on a fine division.
fn integral(
    pressure: impl Fn(f64) -> f64,
    face: impl Fn(f64) -> f64,
    up: f64,
    centroid: Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let count = 20_000;
    let step = (ENDS[1] - ENDS[0]) / f64::from(count);
    let mut sums = [Vector3::zeros(); 2];
    for k in 0..count {
        let x = ENDS[0] + (f64::from(k) + 0.5) * step;
        let slope = (face(x + step) - face(x - step)) / (2.0 * step);
        let force = Vector3::new(-slope, 0.0, 1.0) * (up * pressure(x) * step * WIDTH);
        sums[0] += force;
        sums[1] += (Vector3::new(x, 0.5 * WIDTH, face(x)) - centroid).cross(&force);
    }
    sums
}

/// Returns the largest relative difference of a load, turned back, from an exact force and moment.
fn difference(load: &RockLoad, turn: UnitQuaternion<f64>, exact: &[Vector3<f64>; 2]) -> [f64; 2] {
    let found = [load.force, load.moment].map(|vector| turn.inverse() * vector);
    [0, 1].map(|k| (found[k] - exact[k]).norm() / exact[k].norm())
}

#[test]
fn a_joint_beside_the_centroids_has_the_moment_of_a_linear_pressure() {
    // The upper block overhangs on one side, the lower one on the other.
    for turn in [UnitQuaternion::identity(), turn()] {
        let mut errors = Vec::new();
        for cell in [0.0075, 0.00375] {
            let mut solids = boxes(&[
                [[0.0, 0.0, 0.0], [0.2, WIDTH, 0.1]],
                [[0.05, 0.0, 0.11], [0.4, WIDTH, 0.3]],
            ]);
            let plain = solids.iter().map(|solid| solid.position);
            let plain: Vec<_> = plain.collect();
            let flow = flow(&mut solids, turn, &settings(cell));
            let centroids: Vec<_> = solids.iter().map(|solid| solid.position).collect();
            let found = loads(flow.network(), flow.pressures(), &centroids);
            let slope = (PRESSURES[1] - PRESSURES[0]) / (ENDS[1] - ENDS[0]);
            let pressure = |x: f64| PRESSURES[0] + slope * (x - ENDS[0]);
            for (k, (up, height)) in [(-1.0, 0.1), (1.0, 0.11)].into_iter().enumerate() {
                let exact = integral(pressure, |_| height, up, plain[k]);
                let [force, moment] = difference(&found[k], turn, &exact);
                println!("cells of {cell} m, block {k}: force {force:e}, moment {moment:e}");
                assert!(force < 1e-9);
                // The pressure is constant in a cell: each loses its slope times h³/12.
                let part = slope.abs() * (ENDS[1] - ENDS[0]) * WIDTH * cell * cell / 12.0;
                let bound = part / exact[1].norm();
                assert!((moment / bound - 1.0).abs() < 1e-3, "{moment:e} {bound:e}");
                errors.push(moment);
            }
        }
        assert!(errors[2] < 0.26 * errors[0]);
    }
}

#[test]
fn faces_that_are_not_parallel_have_the_moment_at_their_own_points() {
    // The upper face rises from 4 to 12 mm above the lower one, 0.05 on a length of 0.15.
    fn gap(x: f64) -> f64 {
        0.004 + (x - ENDS[0]) * 0.008 / (ENDS[1] - ENDS[0])
    }
    let lower = boxes(&[[[0.0, 0.0, 0.0], [ENDS[1], WIDTH, 0.1]]]).remove(0);
    let at = |x: f64, z: f64| [0.0, WIDTH].map(|y| Vector3::new(x, y, z));
    let corners = [
        at(ENDS[0], 0.1 + gap(ENDS[0])),
        at(0.4, 0.1 + gap(0.4)),
        at(ENDS[0], 0.3),
        at(0.4, 0.3),
    ];
    let upper = Polyhedron::from_vertices(&corners.concat()).unwrap();
    for turn in [UnitQuaternion::identity(), turn()] {
        let mut solids = [lower.clone(), upper.clone()];
        let plain = [solids[0].position, solids[1].position];
        let flow = flow(&mut solids, turn, &settings(0.0015));
        let centroids = [solids[0].position, solids[1].position];
        let found = loads(flow.network(), flow.pressures(), &centroids);
        let exact = wedge(&flow, turn.inverse(), [|_| 0.1, |x| 0.1 + gap(x)], plain);
        for k in 0..2 {
            let [force, moment] = difference(&found[k], turn, &exact[k]);
            println!("block {k}: force {force:e}, moment {moment:e}");
            // A hundred cells, of the second order: 1/12 of 1e-4 of the slope and the bend of the pressure.
            assert!(force < 2e-4 && moment < 2e-4);
        }
    }
}

/// Returns force and moment on both blocks of a joint whose faces have the heights `z(x)`: the integral of the pressure
/// of a constant discharge, which falls with the integral of 1/h³ along the plane of the joint, over the faces.
fn wedge(
    flow: &JointFlow,
    back: UnitQuaternion<f64>,
    faces: [fn(f64) -> f64; 2],
    centroids: [Vector3<f64>; 2],
) -> [[Vector3<f64>; 2]; 2] {
    let joint = &flow.network().joints[0];
    let corners = joint.overlap.corners().iter();
    let corners: Vec<_> = corners.map(|(at, _)| back * joint.point(at)).collect();
    let normal = back * joint.normal;
    let end = |sign: f64| {
        let at = corners
            .iter()
            .max_by(|a, b| (sign * a.x).total_cmp(&(sign * b.x)));
        Vector3::new(at.unwrap().x, 0.5 * WIDTH, at.unwrap().z)
    };
    let ends = [end(-1.0), end(1.0)];
    // Points of both faces on the normal of the plane: the faces are planes.
    let points = |part: f64| {
        let at = ends[0] + (ends[1] - ends[0]) * part;
        faces.map(|face| {
            let above = |t: f64| (at + normal * t).z - face((at + normal * t).x);
            at - normal * (above(0.0) / (above(1.0) - above(0.0)))
        })
    };
    let inverse = |part: f64| {
        let [low, high] = points(part);
        (high - low).norm().powi(-2)
    };
    let count = 20_000;
    let mut sums = [[Vector3::zeros(); 2]; 2];
    for k in 0..count {
        let [begin, end] = [k, k + 1].map(|k| f64::from(k) / f64::from(count));
        let part = 0.5 * (begin + end);
        let fall = (inverse(0.0) - inverse(part)) / (inverse(0.0) - inverse(1.0));
        let pressure = PRESSURES[0] + fall * (PRESSURES[1] - PRESSURES[0]);
        for side in 0..2 {
            let along = points(end)[side] - points(begin)[side];
            // Along x, times y, is up: the lower block is pressed down.
            let up = if side == 0 { -1.0 } else { 1.0 };
            let force = along.cross(&Vector3::y()) * (up * pressure * WIDTH);
            sums[side][0] += force;
            sums[side][1] += (points(part)[side] - centroids[side]).cross(&force);
        }
    }
    sums
}

#[test]
fn the_loads_of_a_wide_joint_balance_the_momentum_of_its_water() {
    // Force and moment on the water: both faces, and the pressures on both ends of the joint.
    let mut solids = boxes(&[
        [[0.0, 0.0, 0.0], [0.2, WIDTH, 0.1]],
        [[0.05, 0.0, 0.11], [0.4, WIDTH, 0.3]],
    ]);
    let settings = NetworkSettings {
        under: Some(UnderLattice {
            wide: 0.002,
            takeover: 0.015,
        }),
        ..settings(0.00375)
    };
    let flow = flow(&mut solids, turn(), &settings);
    // Moments about one point, the origin of the scene.
    let origin = vec![Vector3::zeros(); 2];
    let mut found = loads(flow.network(), flow.pressures(), &origin);
    add_wide_loads(&flow, None, |_| None, &origin, &mut found);
    let back = turn().inverse();
    let [force, moment] = [
        back * (found[0].force + found[1].force),
        back * (found[0].moment + found[1].moment),
    ];
    let section = 0.01 * WIDTH;
    let exact = (PRESSURES[0] - PRESSURES[1]) * section;
    println!("force {force:?}, exact {exact} N; moment {moment:?}");
    assert!((force - Vector3::new(exact, 0.0, 0.0)).norm() < 1e-9 * exact);
    let point = Vector3::new(0.0, 0.5 * WIDTH, 0.105);
    let arm = point.cross(&Vector3::new(exact, 0.0, 0.0));
    assert!((moment - arm).norm() < 1e-9 * arm.norm());
}
