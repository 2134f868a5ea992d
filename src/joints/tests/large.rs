//! A rock mass with ten thousand joints.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::flow::JointFlow;
use crate::motion::Mover;
use crate::network::Network;
use nalgebra::Matrix3;
use std::time::Instant;

/// Returns the corners of bricks in a grid of `n` cubed, with gaps \[m\] between them.
fn bricks(n: usize, size: f64, gap: f64) -> Vec<[[f64; 3]; 2]> {
    let at = |k: usize| f64::from(u32::try_from(k).unwrap()) * size;
    let mut corners = Vec::new();
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                let low = [at(x), at(y), at(z)];
                corners.push([low, low.map(|c| c + size - gap)]);
            }
        }
    }
    corners
}

#[test]
fn ten_thousand_joints_conduct_like_their_vertical_ones_side_by_side() {
    let (n, size, gap) = (15, 0.3, 1e-3);
    let start = Instant::now();
    let solids = boxes(&bricks(n, size, gap));
    let network = Network::new(&rocks(&solids), &settings(0.31));
    let counts = (network.joints.len(), network.nodes());
    println!("{counts:?} joints and nodes after {:?}", start.elapsed());
    assert_eq!(counts.0, 3 * n * n * (n - 1));
    let top = size * 15.0 - gap;
    let drive = Fronts::new(&network, move |at, _| match at.z {
        z if z < 1e-6 => Some(1000.0),
        z if z > top - 1e-6 => Some(0.0),
        _ => None,
    });
    let mut flow = JointFlow::new(network, water());
    println!("analysed after {:?}", start.elapsed());
    flow.solve_steady(&drive, 0.0).unwrap();
    println!("settled after {:?}", start.elapsed());
    flow.advance(&drive, 0.0, 1e-3).unwrap();
    println!("a step made after {:?}", start.elapsed());
    let outflows = flow.outflows();
    let pieces = flow.network().open.iter().zip(&outflows);
    let left = pieces.filter(|(piece, _)| piece.middle.z > top - 1e-6);
    let found: f64 = left.map(|(_, outflow)| outflow).sum();
    // Vertical joints of a row of bricks, one after the other; junctions between the rows are points.
    let width = 2.0 * 15.0 * 14.0 * (size - gap);
    let length = 15.0 * (size - gap);
    let exact = 1000.0 * width * gap.powi(3) / (12.0 * 1e-3 * length);
    println!("discharge {found:e}, exact {exact:e}");
    assert!((found / exact - 1.0).abs() < 1e-9);
}

#[test]
fn a_bed_of_a_thousand_blocks_keeps_its_factors_over_steps() {
    let (n, size, gap, mass) = (10_usize, 0.1, 2e-4, 2.65);
    let solids = boxes(&bricks(n, size, gap));
    let network = Network::new(&rocks(&solids), &settings(0.11));
    let inside = |k: &usize| {
        let [x, y, z] = [k % n, k / n % n, k / n / n];
        [x, y].iter().all(|at| (1..n - 1).contains(at)) && z > 0
    };
    let movers = (0..n * n * n).filter(inside).map(|k| {
        let inertia = Matrix3::identity() * (mass * size * size / 6.0);
        Mover::new(k, mass, inertia, solids[k].position)
    });
    let movers: Vec<Mover> = movers.collect();
    let top = size * 10.0 - gap;
    let drive = Fronts::new(&network, move |at, time| {
        (at.z > top - 1e-6).then(|| 2000.0 * (1.0 - (400.0 * time).cos()))
    });
    println!(
        "{} nodes, {} blocks that move",
        network.nodes(),
        movers.len()
    );
    let mut settings = water();
    settings.inertia = true;
    let mut flow = JointFlow::with_movers(network, settings, movers);
    flow.solve_steady(&drive, 0.0).unwrap();
    let (steps, step) = (40_u32, 5e-5);
    let (mut factorisations, mut iterations) = (0, 0);
    let (mut entered, before) = (0.0, flow.stored());
    let start = Instant::now();
    for k in 0..steps {
        let report = flow.advance(&drive, step * f64::from(k), step).unwrap();
        factorisations += report.factorisations;
        iterations += report.newton;
        entered += report.entered;
    }
    let error = (flow.stored() - before - entered) / before;
    println!(
        "{steps} steps: {factorisations} factorisations, {iterations} iterations, {:?}; mass error {error:e}",
        start.elapsed()
    );
    assert!(factorisations <= 4, "{factorisations}");
    assert!(error.abs() < 1e-12);
}
