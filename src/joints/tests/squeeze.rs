//! Squeeze films: plates that approach each other, against the solutions of Reynolds' equation.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::flow::{Drive, JointFlow};
use crate::network::Network;
use crate::polygon::LinearField;
use dem::polyhedron::{PlacedPolyhedron, Polyhedron};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::PI;

/// Speed of the upper plate, downwards [m/s].
const SPEED: f64 = 1e-3;
/// Mean distance of the plates \[m\].
const GAP: f64 = 1e-3;

/// Plates that approach each other.
struct Approach<F> {
    fronts: Fronts<F>,
    slope: Vector2<f64>,
    speed: f64,
}

impl<F: Fn(&Vector3<f64>, f64) -> Option<f64>> Drive for Approach<F> {
    fn pressure(&self, open: usize, time: f64) -> Option<f64> {
        self.fronts.pressure(open, time)
    }

    fn gap(&self, _joint: usize, time: f64) -> Option<LinearField> {
        Some(LinearField {
            constant: GAP - self.speed * time,
            slope: self.slope,
        })
    }
}

/// Returns the force on a plate \[N\] over `mu V/h³`, with the distance at the end.
fn force(
    solids: &[PlacedPolyhedron],
    cell: f64,
    slope: Vector2<f64>,
    front: impl Fn(&Vector3<f64>, f64) -> Option<f64>,
) -> f64 {
    let network = Network::new(&rocks(solids), &settings(cell));
    assert_eq!(network.joints.len(), 1);
    let drive = Approach {
        fronts: Fronts::new(&network, front),
        slope,
        speed: SPEED,
    };
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    let step = 1e-5;
    let mut time = 0.0;
    for _ in 0..4 {
        let before = flow.stored();
        let report = flow.advance(&drive, time, step).unwrap();
        time += step;
        let imbalance = flow.stored() - before - report.entered;
        assert!(imbalance.abs() < 1e-12 * flow.stored());
    }
    let cells = flow.network().cells.iter().zip(flow.pressures());
    let total: f64 = cells.map(|(cell, pressure)| cell.area * pressure).sum();
    total / (1e-3 * SPEED / (GAP - SPEED * time).powi(3))
}

/// Two plates of these sides \[m\].
fn plates(length: f64, width: f64) -> Vec<PlacedPolyhedron> {
    boxes(&[
        [[0.0, 0.0, 0.0], [length, width, 0.1]],
        [[0.0, 0.0, 0.1 + GAP], [length, width, 0.2]],
    ])
}

#[test]
fn a_square_plate_and_rectangles_have_their_coefficients() {
    // Force over mu V L B³/h³ for L/B = 1, 2, 5 (double series of Reynolds' equation).
    for (ratio, exact) in [(1.0, 0.42173), (2.0, 0.68605), (5.0, 0.87395)] {
        let (length, width): (f64, f64) = (0.1 * ratio, 0.1);
        let found = force(
            &plates(length, width),
            0.1 / 24.0,
            Vector2::zeros(),
            |_, _| Some(0.0),
        );
        let found = found / (length * width.powi(3));
        println!("L/B {ratio}: {found:.5}, exact {exact}");
        assert!((found / exact - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_disc_has_the_force_of_stefan() {
    // A prism of 60 sides with the area of the disc.
    let sides = 60;
    let (radius, angle) = (0.1_f64, 2.0 * PI / f64::from(sides));
    let outer = radius * (angle / angle.sin()).sqrt();
    let prism = |low: f64, high: f64| {
        let corners = (0..sides).flat_map(|k| {
            let (sin, cos) = (angle * f64::from(k)).sin_cos();
            [low, high].map(|z| Vector3::new(outer * cos, outer * sin, z))
        });
        Polyhedron::from_vertices(&corners.collect::<Vec<_>>()).unwrap()
    };
    let solids = [prism(0.0, 0.1), prism(0.1 + GAP, 0.2)];
    let found = force(&solids, 0.1 / 14.0, Vector2::zeros(), |_, _| Some(0.0));
    let exact = 1.5 * PI * radius.powi(4);
    println!("disc: {:.5} of the force of Stefan", found / exact);
    assert!((found / exact - 1.0).abs() < 0.01);
}

#[test]
fn an_inclined_strip_has_the_force_of_reynolds() {
    // Force over mu V L³/h³ per width: 3/4 ((2/e³) ln((1+e)/(1-e)) - 4/e²).
    for tilt in [0.2_f64, 0.4, 0.6, 0.8] {
        let exact =
            0.75 * (2.0 / tilt.powi(3) * ((1.0 + tilt) / (1.0 - tilt)).ln() - 4.0 / (tilt * tilt));
        let length: f64 = 0.2;
        let slope = Vector2::new(2.0 * tilt * GAP / length, 0.0);
        let solids = plates(length, 0.05);
        // Only the ends along x are open.
        let found = force(&solids, 0.05, slope, |at, _| {
            (at.x < 1e-9 || at.x > length - 1e-9).then_some(0.0)
        });
        let fine = force(&solids, length / 64.0, slope, |at, _| {
            (at.x < 1e-9 || at.x > length - 1e-9).then_some(0.0)
        });
        let scale = length.powi(3) * 0.05;
        println!(
            "e {tilt}: {:.5} of four cells, {:.5} of sixty-four, exact {exact:.5}",
            found / scale,
            fine / scale
        );
        assert!((fine / scale / exact - 1.0).abs() < 0.01);
    }
}
