//! Balance of the momentum of water with a free surface.

use super::super::opening::Outside;
use super::{Tank, at_face, step};
use crate::lattice::VelocitySet;
use crate::quanta::from_quanta;
use base::history::TimeTable;
use std::f64::consts::PI;

/// Returns the largest error of the balance of the steps of a wave in a tank, over the weight of the water.
fn error(tank: &Tank, steps: usize) -> f64 {
    let length = tank.cells[0] as f64;
    let level = 0.5 * tank.cells[1] as f64;
    let mut fluid = tank.fill(move |[x, y, z]| {
        let wave = (PI * (x as f64 + 0.5) / length).cos();
        let across = 0.3 * (0.9 * z as f64).sin();
        (level + 1.5 * wave + across - y as f64).clamp(0.0, 1.0)
    });
    let force = [tank.slope[0], -tank.gravity, tank.slope[1]];
    let mut largest = 0.0_f64;
    for _ in 0..steps {
        fluid.balance_surface(true);
        step(&mut fluid, 1);
        let balance = fluid.surface().unwrap().balanced().unwrap();
        let open = from_quanta(balance.open);
        for (a, force) in force.into_iter().enumerate() {
            let gone = from_quanta(balance.change[a] + balance.left[a]);
            largest = largest.max((gone - open * force).abs() / (open * tank.gravity));
        }
    }
    largest
}

/// Checks that the momentum that the body force gives to the water remains in it or leaves through the faces: with
/// planes of symmetry on any faces, whose links the carried cells change, next to walls, openings and periodic faces.
#[test]
fn the_momentum_of_each_step_is_closed_between_any_faces() {
    let faces = [(0, false), (2, false), (0, true), (2, true), (1, false)];
    let level = |height: f64| at_face(TimeTable::new(None, height));
    for (set, cells) in [
        (VelocitySet::D2Q9, [24, 14, 1]),
        (VelocitySet::D3Q19, [14, 12, 6]),
        (VelocitySet::D3Q27, [14, 12, 6]),
    ] {
        let flat = cells[2] == 1;
        for first in 0..faces.len() {
            for last in first..faces.len() {
                let mut tank = Tank::new(cells);
                tank.models.lattice = set;
                tank.tau = 0.53;
                tank.split = last % 3;
                let slips = faces[first..=last].iter();
                tank.slip_at = slips.copied().filter(|face| !flat || face.0 != 2).collect();
                if !tank.slip_at.iter().any(|face| face.0 == 0) {
                    tank.open_at = vec![(0, false, level(5.5)), (0, true, Outside::Air)];
                }
                tank.periodic[2] = flat || !tank.slip_at.iter().any(|face| face.0 == 2);
                if flat {
                    tank.split %= 2;
                }
                let found = error(&tank, 30);
                println!("{set:?} {:?}: {found:e}", tank.slip_at);
                assert!(found < 1e-11, "{set:?} {:?}: {found}", tank.slip_at);
            }
        }
    }
}
