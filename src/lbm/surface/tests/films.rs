//! Films down a plane against the exact solution.

use super::{Tank, step};
use crate::fluid::Fluid;

/// Returns the error of the discharge and the largest error of the velocity of a film of a thickness in cells, both
/// over the exact mean velocity u = g_x h²/(3 ν) (W. Nusselt, Z. VDI 60 (1916) 541), after a time of several h²/ν.
/// `flow` contains the relaxation time and the product of mean velocity and thickness.
fn errors(thickness: f64, cells: [usize; 3], across: f64, flow: [f64; 2]) -> [f64; 2] {
    let mut tank = Tank::new(cells);
    tank.tau = flow[0];
    let viscosity = (tank.tau - 0.5) / 3.0;
    let mean = flow[1] / thickness;
    let pull = 3.0 * viscosity * mean / (thickness * thickness);
    let angle = f64::atan2(across, 1.0);
    tank.slope = [pull * angle.cos(), pull * angle.sin()];
    if cells[2] == 1 {
        tank.slope = [pull, 0.0];
    }
    tank.gravity = 2.0 * pull;
    tank.periodic = [true, false, true];
    let mut fluid = tank.fill(|[_, y, _]| (thickness - y as f64).clamp(0.0, 1.0));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count"
    )]
    step(
        &mut fluid,
        (4.0 * thickness * thickness / viscosity) as usize,
    );
    let speed = |fluid: &Fluid<f64>, y: usize| {
        let (_, u) = fluid.state(fluid.populations().interior_cell([1, y, 0]));
        if cells[2] == 1 {
            u[0]
        } else {
            u[0] * angle.cos() + u[2] * angle.sin()
        }
    };
    let exact = |y: f64| 3.0 * mean * (y / thickness - 0.5 * (y / thickness).powi(2));
    let (mut through, mut largest) = (0.0, 0.0_f64);
    for y in 0..cells[1] {
        let cell = fluid.populations().interior_cell([1, y, 0]);
        let fill = fluid.surface().unwrap().fill(cell);
        through += fill * speed(&fluid, y);
        let middle = y as f64 + 0.5;
        if middle < thickness {
            largest = largest.max((speed(&fluid, y) - exact(middle)).abs() / mean);
        }
    }
    [through / (mean * thickness) - 1.0, largest]
}

/// Flow of a film at a low Reynolds number, which is the same on every grid.
const SLOW: [f64; 2] = [0.8, 0.01];

/// Checks a fast film at a low viscosity (cell Reynolds number 6), for any position of the surface in its cell: a
/// surface that adds momentum to the water would accelerate it.
#[test]
fn a_fast_film_has_the_discharge_of_its_weight() {
    for thickness in [10.0, 10.1, 10.4, 10.6, 10.9] {
        let [discharge, velocity] = errors(thickness, [2, 14, 1], 0.0, [0.53, 0.62]);
        println!("{thickness}: {discharge} {velocity}");
        assert!(discharge.abs() < 0.01 && velocity < 0.02);
    }
}

/// Checks a film along an axis of the lattice, which is exact to the order of the scheme: the error decreases with the
/// square of the cell size, for any position of the surface in its cell.
#[test]
fn a_film_down_a_plane_converges_in_the_second_order() {
    for offset in [0.0, 0.3, 0.5, 0.8] {
        let coarse = errors(8.0 + offset, [4, 12, 1], 0.0, SLOW);
        let fine = errors(16.0 + 2.0 * offset, [4, 20, 1], 0.0, SLOW);
        println!("{offset}: {coarse:?} {fine:?}");
        for (coarse, fine) in coarse.into_iter().zip(fine) {
            assert!(fine.abs() < 0.01, "{fine}");
            assert!(fine.abs() < 0.4 * coarse.abs() + 1e-4, "{coarse} {fine}");
        }
    }
}

/// Checks that in three dimensions a film flows along the plane at any angle to the lattice.
#[test]
fn a_film_in_three_dimensions_runs_at_any_angle() {
    for across in [0.0, 0.4, 1.0] {
        let [discharge, velocity] = errors(8.3, [4, 12, 4], across, SLOW);
        println!("{across}: {discharge} {velocity}");
        assert!(discharge.abs() < 0.02 && velocity < 0.03);
    }
}
