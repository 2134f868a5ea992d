//! Films down a plane against the exact solution, and films of less than one cell on floors, slopes and ceilings.

use super::{Outside, Tank, mass, step};
use crate::fluid::Fluid;
use std::f64::consts::{PI, TAU};

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

/// Returns the heights of the columns of water along y, by x and z.
fn columns(fluid: &Fluid<f64>) -> Vec<f64> {
    let [nx, ny, nz] = fluid.populations().cells();
    let surface = fluid.surface().unwrap();
    let height = |x: usize, z: usize| -> f64 {
        let cells = (0..ny).map(|y| fluid.populations().interior_cell([x, y, z]));
        cells.map(|cell| surface.fill(cell)).sum()
    };
    (0..nx * nz).map(|n| height(n % nx, n / nx)).collect()
}

/// Returns the part of a cell below a surface `height` above y = 0, from 16 points along x and along z.
fn below([x, y, z]: [usize; 3], height: impl Fn(f64, f64) -> f64) -> f64 {
    let at = |n: usize, k: usize| n as f64 + (k as f64 + 0.5) / 16.0;
    let part = |k: usize| (height(at(x, k % 16), at(z, k / 16)) - y as f64).clamp(0.0, 1.0);
    (0..256).map(part).sum::<f64>() / 256.0
}

/// Returns the largest change of the height of a column in 3000 steps, and checks the mass.
fn largest_change(fluid: &mut Fluid<f64>) -> f64 {
    let (start, before) = (columns(fluid), mass(fluid));
    let mut largest = 0.0_f64;
    for _ in 0..30 {
        step(fluid, 100);
        for (now, start) in columns(fluid).iter().zip(&start) {
            largest = largest.max((now - start).abs());
        }
    }
    let kept = mass(fluid) + fluid.surface().unwrap().lost_mass();
    assert!((kept / before - 1.0).abs() < 1e-12, "{kept} of {before}");
    largest
}

/// Checks that water at rest with a thin edge on a plane inclined to gravity stays there. Its edge has no liquid
/// cell: with the pressure of the gas in it, or if it emptied, it would slide down and the water would swing.
#[test]
fn a_wedge_of_water_at_rest_stays_on_its_plane() {
    let tan = |degrees: f64| degrees.to_radians().tan();
    for (cells, slopes) in [
        ([60, 12, 1], [tan(10.0), 0.0]),
        ([40, 10, 16], [tan(10.0), tan(5.0)]),
    ] {
        for slips in [true, false] {
            let mut tank = Tank::new(cells);
            tank.tau = 0.53;
            tank.gravity = 1e-5;
            tank.slope = slopes.map(|slope| -1e-5 * slope);
            tank.slip_at = vec![(0, false), (2, false), (2, true)];
            if cells[2] == 1 {
                tank.slip_at.truncate(1);
            }
            if slips {
                tank.slip_at.push((1, false));
            }
            let end = cells[0] as f64 - 13.0;
            let height = |x: f64, z: f64| (end - x) * slopes[0] - z * slopes[1];
            // Water of less than a fifth of a cell without liquid next to it is given to the cells around it.
            let level = |at| below(at, height);
            let mut fluid = tank.fill(|at| {
                if level(at) < 0.2 && at[1] == 0 {
                    0.0
                } else {
                    level(at)
                }
            });
            let largest = largest_change(&mut fluid);
            println!("{cells:?}, {slips}: {largest}");
            assert!(largest < 0.1, "{cells:?}, {slips}: {largest}");
        }
    }
}

/// Speed of a long wave in a film over (g h)^½. Links to the gas next to the neighbours carry a sixth of the discharge
/// along a film, and their mass is not exchanged (Körner et al. 2005, equation 4).
const SPEED: f64 = 0.912_870_929_175_276_9;

/// Returns the first harmonic of the height of a film of a mean thickness over that at the start, at phases k (g h)^½ t
/// up to 2 π, for a film on a floor or below a ceiling with slip.
fn harmonic(thickness: f64, hangs: bool) -> Vec<[f64; 2]> {
    let k = TAU / 40.0;
    let mut tank = Tank::new([40, 6, 1]);
    tank.tau = 0.505;
    tank.gravity = 1e-4;
    tank.periodic[0] = true;
    tank.slip_at = vec![(1, hangs)];
    let height = |x: f64, _: f64| thickness + 0.03 * (k * x).cos();
    let mut fluid = tank.fill(|[x, y, z]| below([x, if hangs { 5 - y } else { y }, z], height));
    let rate = k * (tank.gravity * thickness).sqrt();
    let harmonic = |fluid: &Fluid<f64>| {
        let heights = columns(fluid).into_iter().enumerate();
        let parts = heights.map(|(x, height)| height * (k * (x as f64 + 0.5)).cos());
        parts.sum::<f64>()
    };
    let (first, before) = (harmonic(&fluid), mass(&fluid));
    let mut all = vec![[0.0, 1.0]];
    for n in 1..=100 {
        step(&mut fluid, 60);
        all.push([rate * 60.0 * f64::from(n), harmonic(&fluid) / first]);
    }
    let kept = mass(&fluid) + fluid.surface().unwrap().lost_mass();
    assert!((kept / before - 1.0).abs() < 1e-12, "{kept} of {before}");
    all
}

/// Checks the speed of a long wave in a film of less than one cell: with the pressure of the gas there would be none.
#[test]
fn a_wave_in_a_film_has_the_speed_of_shallow_water() {
    for thickness in [0.5, 0.7, 0.9] {
        let heights = harmonic(thickness, false);
        let crossings: Vec<f64> = heights
            .windows(2)
            .filter(|pair| pair[0][1] * pair[1][1] < 0.0)
            .map(|pair| {
                let [[t, a], [u, b]] = [pair[0], pair[1]];
                t + (u - t) * a / (a - b)
            })
            .collect();
        assert!(crossings.len() >= 2, "{crossings:?}");
        // Half of a period lies between two of them.
        let speed = PI / (crossings[1] - crossings[0]);
        println!("{thickness}: {speed} of (g h)^½");
        assert!((speed / SPEED - 1.0).abs() < 0.03, "{thickness}: {speed}");
    }
}

/// Checks that a film of less than one cell below a ceiling is not held there: its waves grow like cosh(k (g h)^½ t),
/// the instability of water above air (G. I. Taylor, Proc. R. Soc. A 201 (1950) 192).
#[test]
fn a_film_below_a_ceiling_breaks_away() {
    for thickness in [0.5, 0.7, 0.9] {
        // Until the thickest part reaches a whole cell.
        let all = harmonic(thickness, true).into_iter();
        let all: Vec<_> = all
            .take_while(|[_, growth]| growth * 0.03 < 1.0 - thickness && *growth < 4.0)
            .collect();
        println!("{thickness}: {:?}", all[all.len() - 1]);
        assert!(all[all.len() - 1][1] > 2.0);
        for [time, growth] in all {
            let exact = (SPEED * time).cosh();
            let error = growth / exact - 1.0;
            assert!(
                error.abs() < 0.05,
                "{thickness}, {time}: {growth} for {exact}"
            );
        }
    }
}

/// Checks that films of few cells have the discharge of Nusselt to the second order in their number.
#[test]
fn films_of_few_cells_run_down_a_plane() {
    for thickness in [1.0, 1.5, 2.0, 3.0] {
        let [discharge, _] = errors(thickness, [4, 8, 1], 0.0, SLOW);
        println!("{thickness}: {discharge}");
        assert!(discharge.abs() * thickness * thickness < 0.25);
    }
}

/// Checks that films of less than one cell have the discharge of Nusselt: without the friction of the wall on the film
/// that fills only a part of its cell, films of 0.7 and 0.5 cells have 2.4 and 4.1 times as much.
#[test]
fn films_of_less_than_one_cell_run_down_a_plane() {
    for (cells, across) in [([4, 6, 1], 0.0), ([4, 6, 4], 0.0), ([4, 6, 4], 1.0)] {
        for thickness in [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
            for tau in [0.53, 0.8] {
                let [discharge, _] = errors(thickness, cells, across, [tau, 0.01]);
                println!("{cells:?}, {across}, {thickness}, {tau}: {discharge}");
                assert!(discharge.abs() < 0.15);
            }
        }
    }
}

/// Checks that a drop of one cell remains on a floor, but not on one that is open.
#[test]
fn a_drop_of_one_cell_remains_on_a_floor() {
    for open in [false, true] {
        let mut tank = Tank::new([12, 6, 1]);
        if open {
            tank.open_at = vec![(1, false, Outside::Air)];
        }
        let level = |at: [usize; 3]| if at == [6, 0, 0] { 0.9 } else { 0.0 };
        let mut fluid = tank.fill(level);
        let before = mass(&fluid);
        step(&mut fluid, 300);
        let lost = fluid.surface().unwrap().lost_mass();
        let kept = mass(&fluid);
        println!("{open}: {kept}, lost {lost}");
        if open {
            assert!(kept < 0.1, "{kept}");
        } else {
            assert!(
                (kept - before).abs() < 1e-12 && lost == 0.0,
                "{kept}, {lost}"
            );
        }
    }
}
