//! Surface tension against the pressure of Laplace, the frequencies of drops and capillary waves, and menisci.

use super::waves::viscous;
use super::{Tank, bits, mass, step};
use crate::fluid::Fluid;
use crate::surface::SurfaceTension;
use crate::surface::kind::LIQUID;
use base::vector::norm;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Contact angles of 90 degrees at all walls.
const UPRIGHT: [[f64; 2]; 3] = [[FRAC_PI_2; 2]; 3];

/// Returns the water of a tank with a surface tension.
fn stretched(
    tank: &Tank,
    level: impl Fn([usize; 3]) -> f64 + Sync,
    (tension, contact_angles): (f64, [[f64; 2]; 3]),
) -> Fluid<f64> {
    let mut fluid = tank.fill(level);
    let settings = SurfaceTension {
        tension,
        contact_angles,
    };
    fluid.add_surface_tension(settings, &tank.domain()).unwrap();
    fluid
}

/// Returns the part of a cell inside a body given by its distance function, from small cubes cut by planes.
fn part(at: [usize; 3], flat: bool, distance: impl Fn([f64; 3]) -> f64) -> f64 {
    let n = 8;
    let deep = if flat { 1 } else { n };
    let mut sum = 0.0;
    for x in 0..n {
        for y in 0..n {
            for z in 0..deep {
                let by = [x, y, z].map(|k| (f64::from(k) + 0.5) / f64::from(n));
                let at = std::array::from_fn(|a| at[a] as f64 + by[a]);
                sum += (0.5 - distance(at) * f64::from(n)).clamp(0.0, 1.0);
            }
        }
    }
    sum / f64::from(n * n * deep)
}

/// Returns the mean of the excess density and the largest speed of the water well inside a ball.
fn inside(fluid: &Fluid<f64>, centre: [f64; 3], radius: f64) -> [f64; 2] {
    let (mut sum, mut count, mut most) = (0.0, 0.0, 0.0_f64);
    let surface = fluid.surface().unwrap();
    for (at, cell) in fluid.populations().interior() {
        if !surface.is_wet(cell) {
            continue;
        }
        let (density, u) = fluid.populations().moments(cell);
        let speed = norm(u);
        if surface.kinds()[cell] == LIQUID {
            most = most.max(speed);
        }
        let away = (0..3).map(|a| (at[a] as f64 + 0.5 - centre[a]).powi(2));
        let away = if fluid.populations().cells()[2] == 1 {
            away.take(2).sum::<f64>()
        } else {
            away.sum::<f64>()
        };
        if away.sqrt() < 0.5 * radius {
            sum += density;
            count += 1.0;
        }
    }
    [sum / count, most]
}

/// A drop in a box without gravity, off the centre of a cell.
fn drop(radius: f64, dimension: usize, tension: f64) -> ([f64; 3], Fluid<f64>) {
    let size = base::number::whole((2.5 * radius).ceil()) + 4;
    let cells = [size, size, if dimension == 3 { size } else { 1 }];
    let mut tank = Tank::new(cells);
    tank.gravity = 0.0;
    tank.tau = 0.8;
    tank.periodic = [true, true, true];
    let half = 0.5 * size as f64;
    let centre = [
        half + 0.13,
        half + 0.29,
        if dimension == 3 { half - 0.21 } else { 0.5 },
    ];
    let flat = dimension == 2;
    let fluid = stretched(
        &tank,
        |at| {
            part(at, flat, |p| {
                let away = (0..dimension).map(|a| (p[a] - centre[a]).powi(2));
                away.sum::<f64>().sqrt() - radius
            })
        },
        (tension, UPRIGHT),
    );
    (centre, fluid)
}

/// Checks that the pressure in a resting drop is that of Laplace, and that its spurious currents are slow. Each drop is
/// a test of its own: they take most of the time of this package.
fn has_the_pressure_of_laplace(dimension: usize, radius: f64) {
    let tension = 2e-3;
    let (centre, mut fluid) = drop(radius, dimension, tension);
    let before = mass(&fluid);
    let steps = base::number::whole(40.0 * radius * radius);
    step(&mut fluid, steps.min(6000));
    let exact = 3.0 * tension * (dimension as f64 - 1.0) / radius;
    let (mut mean, mut most) = (0.0, 0.0_f64);
    for _ in 0..200 {
        step(&mut fluid, 1);
        let [density, speed] = inside(&fluid, centre, radius);
        mean += density / 200.0;
        most = most.max(speed);
    }
    let error = mean / exact - 1.0;
    println!(
        "{dimension}-D, R = {radius}: error {error:.2e}, speed {:.2e} of the capillary speed σ/μ",
        most * 0.1 / tension
    );
    assert!((mass(&fluid) / before - 1.0).abs() < 1e-12);
    // 2 % and a tenth of the capillary speed on 5 cells; the second order in the plane, the first in space.
    let order = if dimension == 2 { 2 } else { 1 };
    let finer = (5.0 / radius).powi(order);
    assert!(error.abs() < 0.02 * finer, "{error}");
    assert!(most * 0.1 / tension < 0.1 * finer, "{most}");
}

#[test]
fn a_drop_of_5_cells_in_the_plane_has_the_pressure_of_laplace() {
    has_the_pressure_of_laplace(2, 5.0);
}

#[test]
fn a_drop_of_10_cells_in_the_plane_has_the_pressure_of_laplace() {
    has_the_pressure_of_laplace(2, 10.0);
}

#[test]
fn a_drop_of_20_cells_in_the_plane_has_the_pressure_of_laplace() {
    has_the_pressure_of_laplace(2, 20.0);
}

#[test]
fn a_drop_of_5_cells_in_space_has_the_pressure_of_laplace() {
    has_the_pressure_of_laplace(3, 5.0);
}

#[test]
fn a_drop_of_8_cells_in_space_has_the_pressure_of_laplace() {
    has_the_pressure_of_laplace(3, 8.0);
}

/// Returns the times at which a signal passes through zero.
fn crossings(signal: &[f64]) -> Vec<f64> {
    let pairs = signal.windows(2).enumerate();
    pairs
        .filter(|(_, pair)| pair[0] * pair[1] <= 0.0 && pair[0] != pair[1])
        .map(|(n, pair)| n as f64 + pair[0] / (pair[0] - pair[1]))
        .collect()
}

/// Checks that a drop that is stretched along an axis oscillates with the frequency of Lamb in the plane,
/// ω² = n (n² - 1) σ/(ρ R³), with n = 2.
#[test]
fn a_drop_oscillates_with_the_frequency_of_lamb() {
    for radius in [8.0_f64, 16.0] {
        let tension = 1e-2;
        let size = base::number::whole(2.6 * radius) + 4;
        let mut tank = Tank::new([size, size, 1]);
        tank.gravity = 0.0;
        tank.tau = 0.5 + 0.012 * (radius / 10.0).sqrt();
        tank.periodic = [true; 3];
        let half = 0.5 * size as f64;
        let mut fluid = stretched(
            &tank,
            |at| {
                part(at, true, |p| {
                    let [x, y] = [p[0] - half, p[1] - half];
                    let angle = y.atan2(x);
                    x.hypot(y) - radius * (1.0 + 0.05 * (2.0 * angle).cos())
                })
            },
            (tension, UPRIGHT),
        );
        let exact = (6.0 * tension / radius.powi(3)).sqrt();
        let steps = base::number::whole(3.2 * TAU / exact);
        let mut signal = Vec::new();
        for _ in 0..steps {
            step(&mut fluid, 1);
            let surface = fluid.surface().unwrap();
            let cells = fluid.populations().interior();
            let moments = cells.map(|(at, cell)| {
                let [x, y] = [at[0], at[1]].map(|k| k as f64 + 0.5 - half);
                surface.fill(cell) * (x * x - y * y)
            });
            signal.push(moments.sum::<f64>());
        }
        let zeros = crossings(&signal);
        let found = PI * (zeros.len() as f64 - 1.0) / (zeros[zeros.len() - 1] - zeros[0]);
        println!(
            "R = {radius}: {} crossings, {:.4} of Lamb",
            zeros.len(),
            found / exact
        );
        assert!(zeros.len() >= 6, "{zeros:?}");
        assert!((found / exact - 1.0).abs() < 0.02, "{}", found / exact);
    }
}

/// Checks frequency and damping of waves under gravity and tension: ω² = (g k + σ k³/ρ) tanh(k h) in water without
/// viscosity.
#[test]
fn waves_have_the_frequency_of_gravity_and_tension() {
    for (gravity, tension) in [(0.0, 4e-3), (1e-5, 2e-3)] {
        for length in [20_usize, 40] {
            let k = TAU / length as f64;
            let (depth, amplitude) = (0.5 * length as f64 + 0.3, 0.01 * length as f64);
            let mut tank = Tank::new([length, base::number::whole(depth) + 5, 1]);
            tank.gravity = gravity;
            tank.tau = 0.51;
            tank.periodic[0] = true;
            tank.slip_at = vec![(1, false)];
            let height = move |x: usize| depth + amplitude * (k * (x as f64 + 0.5)).cos();
            let mut fluid = stretched(
                &tank,
                |[x, y, _]| (height(x) - y as f64).clamp(0.0, 1.0),
                (tension, UPRIGHT),
            );
            let pull = (gravity * k + tension * k.powi(3)) * (k * depth).tanh();
            let [exact, damping] = viscous(k, (tank.tau - 0.5) / 3.0, depth, pull);
            let steps = base::number::whole(3.2 * TAU / exact);
            let mut signal = Vec::new();
            for _ in 0..steps {
                step(&mut fluid, 1);
                let surface = fluid.surface().unwrap();
                let cells = fluid.populations().interior();
                let parts =
                    cells.map(|(at, cell)| surface.fill(cell) * (k * (at[0] as f64 + 0.5)).cos());
                signal.push(parts.sum::<f64>());
            }
            let zeros = crossings(&signal);
            let found = PI * (zeros.len() as f64 - 1.0) / (zeros[zeros.len() - 1] - zeros[0]);
            let peak = |from: usize, to: usize| {
                let part = &signal[from..to];
                part.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
            };
            let at = |n: usize| base::number::whole(zeros[n]);
            let fell = (peak(at(0), at(1)) / peak(at(4), at(5))).ln() / (zeros[4] - zeros[0]);
            println!(
                "g {gravity}, {length} cells: frequency {:.4}, damping {:.3} of the theory",
                found / exact,
                fell / damping
            );
            assert!(zeros.len() >= 6, "{zeros:?}");
            // 3 % on 20 cells, first order.
            let tolerance = 0.03 * 20.0 / length as f64;
            assert!((found / exact - 1.0).abs() < tolerance, "{}", found / exact);
        }
    }
}

/// Checks the height of a meniscus at a wall, 2 l sin((90° - θ)/2) with the capillary length l = (σ/(ρ g))^½ (G. K.
/// Batchelor, An introduction to fluid dynamics, section 1.9).
#[test]
fn a_meniscus_has_its_height() {
    for (degrees, length) in [(30.0_f64, 5.0), (30.0, 10.0), (120.0, 10.0), (150.0, 10.0)] {
        let tension = 4e-3;
        let gravity = tension / (length * length);
        let mut tank = Tank::new([60, 48, 1]);
        tank.gravity = gravity;
        tank.tau = 0.8;
        tank.slip_at = vec![(0, true), (1, false)];
        let angle = degrees.to_radians();
        let mut angles = UPRIGHT;
        angles[0][0] = angle;
        let level = 24.3;
        let mut fluid = stretched(
            &tank,
            |[_, y, _]| (level - y as f64).clamp(0.0, 1.0),
            (tension, angles),
        );
        step(&mut fluid, 10_000);
        let surface = fluid.surface().unwrap();
        let height = |x: usize| {
            let column =
                (0..48).map(|y| surface.fill(fluid.populations().interior_cell([x, y, 0])));
            column.sum::<f64>()
        };
        // At the wall the height is that of the first column, half a cell away, and the slope at the wall.
        let exact = 2.0 * length * ((FRAC_PI_2 - angle) / 2.0).sin();
        let profile: Vec<f64> = [0, 1, 2, 5, 10, 20, 59].map(height).to_vec();
        // Static profile: x(h) from the wall; the mean over the first column is compared.
        let far = height(59);
        let reference = mean_height(exact, length, 1.0);
        let found = height(0) - far;
        println!(
            "{degrees}, {length} cells: first column {found:.3} of {reference:.3} (wall {exact:.3}); {profile:?}"
        );
        // First order at the wall: within half of a cell, or a tenth of it on the smallest slopes.
        assert!((found - reference).abs() < 0.7, "{found} of {reference}");
    }
}

/// Checks that a drop of 5 cells comes to rest at the largest tension that the plan allows, up to the cell Laplace
/// number σ/ν² below which it warns.
#[test]
fn a_small_drop_bears_the_largest_tension() {
    for tau in [0.55, 0.8] {
        let (radius, tension) = (5.0, 0.02);
        let mut tank = Tank::new([20, 20, 1]);
        tank.gravity = 0.0;
        tank.tau = tau;
        tank.periodic = [true; 3];
        let mut fluid = stretched(
            &tank,
            |at| {
                part(at, true, |p| {
                    (p[0] - 10.1).hypot((p[1] - 9.8) * 1.2) - radius
                })
            },
            (tension, UPRIGHT),
        );
        let before = mass(&fluid);
        step(&mut fluid, 4000);
        let surface = fluid.surface().unwrap();
        assert!((mass(&fluid) / before - 1.0).abs() < 1e-12);
        let mut sums = [0.0; 3];
        for (at, cell) in fluid.populations().interior() {
            let fill = surface.fill(cell);
            let parts = [1.0, at[0] as f64 + 0.5, at[1] as f64 + 0.5];
            for (sum, part) in sums.iter_mut().zip(parts) {
                *sum += fill * part;
            }
        }
        let centre = [sums[1] / sums[0], sums[2] / sums[0]];
        let [_, speed] = inside(&fluid, [10.0, 10.0, 0.5], radius);
        println!("tau {tau}: centre {centre:?}, speed {speed:.1e}");
        let moved = (centre[0] - 10.1).hypot(centre[1] - 9.8);
        assert!(moved < 1.0, "{centre:?}");
        assert!(speed < 0.02, "{speed}");
    }
}

/// Returns the mean height of the static meniscus over a width from the wall, for its height at the wall.
fn mean_height(wall: f64, length: f64, width: f64) -> f64 {
    // dh/dx = -tan(ψ) with sin(ψ/2) = h/(2 l).
    let n = 20_000;
    let (mut h, mut sum) = (wall, 0.0);
    let dx = width / f64::from(n);
    for _ in 0..n {
        let slope = |h: f64| -(2.0 * (h / (2.0 * length)).asin()).tan();
        let middle = h + 0.5 * dx * slope(h);
        sum += middle * dx;
        h += dx * slope(middle);
    }
    sum / width
}

#[test]
fn tension_keeps_bits_and_mass() {
    for cells in [[30, 18, 1], [16, 13, 5]] {
        let dimension = if cells[2] == 1 { 2 } else { 3 };
        let states: Vec<_> = (0..dimension)
            .map(|split| {
                let mut tank = Tank::new(cells);
                tank.split = split;
                tank.slip_at = vec![(0, true), (2, false)];
                let mut angles = UPRIGHT;
                angles[0][0] = 1.0;
                angles[1] = [0.7, 0.7];
                let mut fluid = stretched(&tank, super::dam(9, 11), (3e-3, angles));
                let before = mass(&fluid);
                step(&mut fluid, 301);
                let after = mass(&fluid) + fluid.surface().unwrap().lost_mass();
                assert!((after / before - 1.0).abs() < 1e-12);
                bits(&fluid)
            })
            .collect();
        assert!(states.iter().all(|state| *state == states[0]));
    }
}
