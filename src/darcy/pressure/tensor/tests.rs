//! Dipping ground against exact solutions.

use super::super::tests::{around, plane, still};
use super::super::{Equations, Liquid, Medium, PressurePatch, PressureSettings};
use super::*;
use crate::enclosure::Enclosure;
use crate::{Openness, SeepageGrid};
use decomposition::Communicator;

const WATER: Liquid = Liquid {
    density: 1000.0,
    viscosity: 1e-3,
};

/// Kxx, Kyy and Kxy of K1 = 1 along and K2 = 0.1 across beds at an angle.
fn tensor(degrees: f64) -> [f64; 3] {
    let (s, c) = degrees.to_radians().sin_cos();
    [c * c + 0.1 * s * s, s * s + 0.1 * c * c, 0.9 * s * c]
}

fn value(p: f64) -> Condition {
    Condition::Pressure { value: p }
}

/// Returns a solver for tensors of the cells, and their conductivity.
fn solver(
    grid: &SeepageGrid,
    patches: Vec<PressurePatch>,
    of: impl Fn([f64; 2]) -> [f64; 3],
) -> (Pressure, Vec<f64>) {
    let settings = PressureSettings {
        equations: Equations::Corrected,
        gravity: [0.0; 3],
        tolerance: 1e-12,
        iterations: 400,
    };
    let open = Openness::measure(grid, &Enclosure::Everything);
    let (mut mean, mut ratios, mut shear) = (Vec::new(), Vec::new(), Vec::new());
    for cell in 0..grid.count() {
        let [x, y, _] = grid.centre(grid.cell(cell));
        let [kx, ky, kxy] = of([x, y]);
        let k = (kx * ky).sqrt();
        mean.push(k);
        ratios.push([kx / k, ky / k, 1.0]);
        shear.push(kxy / k);
    }
    let serial = Communicator::serial();
    let mut solver = Pressure::new(&open, patches, WATER, settings, &serial)
        .unwrap()
        .with_shear(&shear);
    solver.set_directions(&ratios);
    (solver, mean)
}

/// Checks that uniform flow at any angle is exact, with pressures or with fluxes on a face: pressures, fluxes,
/// gradients, and discharges through the boundary.
#[test]
fn uniform_flow_is_exact() {
    let grid = plane([12, 7], [3.0, 2.0]);
    let (gx, gy) = (2.0, -1.3);
    for degrees in [15.0, 45.0, -60.0] {
        let [kx, ky, kxy] = tensor(degrees);
        let (qx, qy) = (-(kx * gx + kxy * gy), -(kxy * gx + ky * gy));
        for fluxes in [false, true] {
            let patches = around(&grid, |axis, upper, [x, y]| {
                if fluxes && axis == 1 && upper {
                    Condition::Flux { value: -qy }
                } else {
                    value(5.0 + gx * x + gy * y)
                }
            });
            let (mut solver, k) = solver(&grid, patches, |_| [kx, ky, kxy]);
            solver.solve(still(&k)).unwrap();
            for cell in 0..grid.count() {
                let [x, y, _] = grid.centre(grid.cell(cell));
                let exact = 5.0 + gx * x + gy * y;
                assert!(
                    (solver.pressure(cell) - exact).abs() < 1e-9,
                    "{degrees} {cell}"
                );
                let flux = solver.flux(cell);
                assert!(
                    (flux[0] - qx).abs() + (flux[1] - qy).abs() < 1e-9,
                    "{flux:?} {qx} {qy}"
                );
                let gradient = solver.inner_gradient(cell);
                assert!((gradient[0] - gx).abs() + (gradient[1] - gy).abs() < 1e-8);
            }
            for (axis, q, length) in [(0, qx, 2.0), (1, qy, 3.0)] {
                for plane in [0, 3, grid.cells[axis]] {
                    let through = solver.flow_through_section(axis, plane, &[0..12, 0..7, 0..1]);
                    assert!(
                        (through.discharge - q * length).abs() < 1e-9,
                        "{degrees} {plane}"
                    );
                }
            }
        }
    }
}

/// Checks two tensors on both sides of a plane: the head is linear on each side, with one gradient along the plane and
/// one flux through it.
#[test]
fn two_beds_with_a_plane_between_are_exact() {
    let grid = plane([10, 9], [2.0, 1.8]);
    let ([ax, ay, axy], [bx, by, bxy]) = (tensor(30.0), [0.02, 0.05, -0.01]);
    let (g, along) = (1.5, 0.7);
    let beyond = (ax * g + axy * along - bxy * along) / bx;
    let exact = |x: f64, y: f64| {
        along * y
            + if x < 1.0 {
                g * x
            } else {
                g + beyond * (x - 1.0)
            }
    };
    let patches = around(&grid, |_, _, [x, y]| value(exact(x, y)));
    let media = |[x, _]: [f64; 2]| {
        if x < 1.0 {
            [ax, ay, axy]
        } else {
            [bx, by, bxy]
        }
    };
    let (mut solver, k) = solver(&grid, patches, media);
    solver.solve(still(&k)).unwrap();
    for cell in 0..grid.count() {
        let [x, y, _] = grid.centre(grid.cell(cell));
        assert!(
            (solver.pressure(cell) - exact(x, y)).abs() < 1e-8,
            "{x} {y}"
        );
    }
}

/// Checks that between impermeable walls, far from the ends, the flux is K1 K2/Kyy times the gradient along the walls.
#[test]
fn walls_turn_the_flow() {
    let grid = plane([240, 20], [12.0, 1.0]);
    for degrees in [15.0, 45.0, 60.0] {
        let [kx, ky, kxy] = tensor(degrees);
        let ends = around(&grid, |axis, upper, _| match (axis, upper) {
            (0, false) => value(12.0),
            (0, true) => value(0.0),
            _ => Condition::NoFlow {},
        });
        let (mut solver, k) = solver(&grid, ends, |_| [kx, ky, kxy]);
        solver.solve(still(&k)).unwrap();
        let row = |x: usize| solver.pressure(grid.index([x, 9, 0]));
        let gradient = (row(105) - row(135)) / 1.5;
        let discharge = solver
            .flow_through_section(0, 120, &[0..240, 0..20, 0..1])
            .discharge;
        let exact = 0.1 / ky;
        assert!(
            (discharge / gradient / exact - 1.0).abs() < 1e-4,
            "{degrees}: {} {exact}",
            discharge / gradient
        );
    }
}

/// Checks the second order of convergence for a smooth head with a source.
#[test]
fn a_smooth_head_converges_with_the_second_order() {
    let [kx, ky, kxy] = tensor(35.0);
    let error = |n: usize| {
        let grid = plane([n, n], [1.0, 1.0]);
        let exact = |x: f64, y: f64| (2.0 * x + 0.3).sin() * (1.5 * y).exp();
        let source: Vec<f64> = (0..grid.count())
            .map(|cell| {
                let [x, y, _] = grid.centre(grid.cell(cell));
                let (s, c) = (2.0 * x + 0.3).sin_cos();
                let e = (1.5 * y).exp();
                -(kx * -4.0 * s * e + 2.0 * kxy * 3.0 * c * e + ky * 2.25 * s * e)
            })
            .collect();
        let patches = around(&grid, |_, _, [x, y]| value(exact(x, y)));
        let (mut solver, k) = solver(&grid, patches, |_| [kx, ky, kxy]);
        let medium = Medium {
            source: Some(&source),
            ..still(&k)
        };
        solver.solve(medium).unwrap();
        let differences = (0..grid.count()).map(|cell| {
            let [x, y, _] = grid.centre(grid.cell(cell));
            (solver.pressure(cell) - exact(x, y)).abs()
        });
        differences.fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(16), error(32));
    println!("{coarse} {fine} {}", coarse / fine);
    assert!(coarse / fine > 3.5, "{coarse} {fine}");
}

/// Checks that without a cross term the scheme is the two-point scheme.
#[test]
fn level_beds_are_those_of_two_points() {
    let grid = plane([6, 5], [1.0, 1.0]);
    let patches = || around(&grid, |_, _, [x, y]| value(x * x - 2.0 * y));
    let media = |[x, y]: [f64; 2]| [1.0 + x, 0.2 + y, 0.0];
    let (mut with, k) = solver(&grid, patches(), media);
    let (mut without, _) = solver(&grid, patches(), media);
    without.tensor = None;
    with.solve(still(&k)).unwrap();
    without.solve(still(&k)).unwrap();
    for cell in 0..grid.count() {
        assert_eq!(
            with.pressure(cell).to_bits(),
            without.pressure(cell).to_bits()
        );
    }
    assert!(with.overshoot().unwrap() < 1e-9 && without.overshoot().is_none());
}
