//! Saturated ground that drains, in time steps from far below the time of drainage to far above it.

use super::transient::{closes, transient};
use super::*;
use crate::{ConditionHistory, InitialWater};
use base::history::TimeTable;

/// Hydraulic conductivity \[m/s\].
const HYDRAULIC: f64 = 1e-4;
const SATURATED: f64 = 0.43;
const RESIDUAL: f64 = 0.045;

fn soil(alpha: f64, n: f64) -> VanGenuchten {
    VanGenuchten {
        alpha,
        n,
        saturated_content: SATURATED,
        residual_content: RESIDUAL,
        exponent: 0.5,
    }
}

/// Returns the content of a soil under a suction \[m\], as printed by van Genuchten (1980).
fn content(law: &VanGenuchten, suction: f64) -> f64 {
    let m = 1.0 - 1.0 / law.n;
    let reduced = (law.alpha * suction.max(0.0)).powf(law.n);
    RESIDUAL + (SATURATED - RESIDUAL) * (1.0 + reduced).powf(-m)
}

/// Returns ground whose gravity is inclined to the axes by an angle in the plane of x and y \[degrees\], with
/// stationary water below a head of 1 m at the start.
fn ground(
    grid: &SeepageGrid,
    patches: Vec<PressurePatch>,
    (law, angle): (VanGenuchten, f64),
    interval: f64,
) -> Pressure {
    let open = Openness::measure(grid, &Enclosure::Everything);
    let (sine, cosine) = f64::to_radians(angle).sin_cos();
    let settings = PressureSettings {
        gravity: [G * sine, -G * cosine, 0.0],
        ..settings()
    };
    let volume = vec![grid.volume([0; 3]); grid.count()];
    Pressure::without_outlets(&open, patches, WATER, settings, &Communicator::serial())
        .unwrap()
        .with_soil(Soil {
            retention: Retention::VanGenuchten(law),
        })
        .with_transient(transient(InitialWater::Head(1.0), interval), &volume)
}

/// Returns a condition on a whole face.
fn face(grid: &SeepageGrid, axis: usize, upper: bool, condition: Condition) -> PressurePatch {
    PressurePatch {
        axis,
        upper,
        from: [0; 3],
        to: grid.cells,
        condition,
        inside: false,
    }
}

const AIR: Condition = Condition::SeepageFace { level: None };

/// Checks the start of drainage from a column between air below and air that enters above: the water flows under a
/// unit gradient and leaves the uppermost cell. Its suction `s` lowers the discharge by at most `s/z` of the unit
/// gradient, `z` the height of its centre, and by its permeability; it follows from the water that left.
#[test]
fn a_column_begins_to_drain_under_a_unit_gradient() {
    for rows in [10, 50] {
        let grid = plane([1, rows], [0.01, 1.0]);
        let height = 1.0 / real(rows);
        for (alpha, n) in [
            (3.35, 1.5),
            (3.35, 2.0),
            (14.5, 2.68),
            (1.0, 4.0),
            (5.0, 8.0),
        ] {
            let law = soil(alpha, n);
            for interval in [1e-4, 1e-2, 1.0] {
                let patches = vec![face(&grid, 1, false, AIR)];
                let mut solver = ground(&grid, patches, (law, 0.0), interval);
                let conductivity = conductivity(&grid, HYDRAULIC);
                for _ in 0..3 {
                    solver.solve(still(&conductivity)).unwrap();
                }
                let balance = solver.water_balance().unwrap();
                let found = balance.left / 0.01 / (3.0 * interval * HYDRAULIC);
                let kept = 1.0 - 3.0 * interval * HYDRAULIC / height / (SATURATED - RESIDUAL);
                let reduced = kept.powf(-n / (n - 1.0)) - 1.0;
                let suction = reduced.powf(1.0 / n) / alpha;
                let permeability = Retention::VanGenuchten(law)
                    .model()
                    .state(-suction)
                    .log_permeability
                    .exp();
                let least = permeability * (1.0 - suction / (1.0 - 0.5 * height));
                println!("{rows} {alpha} {n} {interval}: {least} {found}");
                assert!((least..1.0 + 1e-6).contains(&found), "{least} {found}");
            }
        }
    }
}

/// Checks sudden and gradual drawdown of level ground and of ground under oblique gravity, in plane and in space, to
/// the state at rest: the pressure head is the height of the level above a cell, and the water that left is the
/// difference of the contents. The first intervals are a millionth of the last ones.
#[test]
fn ground_drains_to_rest_below_a_level_that_falls() {
    for (cells, angle) in [([8, 8, 1], 0.0), ([8, 8, 1], 30.0), ([5, 5, 5], 17.0)] {
        let grid = SeepageGrid {
            cells,
            spacing: [1.0 / real(cells[0]); 3],
            dimension: if cells[2] == 1 { 2 } else { 3 },
            ..SeepageGrid::default()
        };
        let (sine, cosine) = f64::to_radians(angle).sin_cos();
        // Above the lower end of the face with the river.
        let level = 0.3 - sine;
        for (law, gradual) in [
            (soil(3.35, 2.0), false),
            (soil(2.0, 2.68), true),
            (soil(1.0, 4.0), false),
        ] {
            let river = face(&grid, 0, true, Condition::SeepageFace { level: Some(1.0) });
            let fall = if gradual {
                vec![[0.0, 1.0], [2e-2, 0.9], [1e6, level]]
            } else {
                vec![[0.0, 1.0], [0.0, level]]
            };
            let made = |interval: f64| {
                let values = TimeTable::new(Some(&fall), 1.0);
                let history = ConditionHistory { patch: 0, values };
                ground(&grid, vec![river], (law, angle), interval).with_histories(vec![history])
            };
            let conductivity = conductivity(&grid, HYDRAULIC);
            let mut short = made(1e-2);
            for _ in 0..4 {
                short.solve(still(&conductivity)).unwrap();
            }
            let mut solver = made(1e6);
            let pressure: Vec<f64> = short.saved().collect();
            let water: Vec<f64> = short.saved_water().collect();
            solver.restore(&pressure).unwrap();
            solver.restore_water(&water).unwrap();
            for _ in 0..6 {
                solver.solve(still(&conductivity)).unwrap();
                closes(&solver);
            }
            let mut left = 0.0;
            for cell in 0..grid.count() {
                let centre = grid.centre(grid.cell(cell));
                let elevation = cosine * centre[1] - sine * centre[0];
                let found = solver.pressure(cell) / (WATER.density * G);
                assert!(
                    (found - (level - elevation)).abs() < 1e-3,
                    "{found} {level} {elevation}"
                );
                let water = |level: f64| content(&law, elevation - level);
                left += grid.volume([0; 3]) * (water(1.0) - water(level));
            }
            let balance = solver.water_balance().unwrap();
            let found = balance.left - balance.entered;
            println!("{cells:?} {angle} {law:?}: {found} {left}");
            assert!((found / left - 1.0).abs() < 1e-6, "{found} {left}");
        }
    }
}

/// Checks the water that leaves a column in a minute, in intervals from a millisecond to a minute.
#[test]
fn the_length_of_the_intervals_does_not_change_the_water_that_leaves() {
    let grid = plane([1, 20], [0.01, 1.0]);
    for (alpha, n) in [(3.35, 2.0), (14.5, 2.68), (2.0, 4.0)] {
        let left = |interval: f64, intervals: u32| {
            let patches = vec![face(&grid, 1, false, AIR)];
            let mut solver = ground(&grid, patches, (soil(alpha, n), 0.0), interval);
            let conductivity = conductivity(&grid, HYDRAULIC);
            for _ in 0..intervals {
                solver.solve(still(&conductivity)).unwrap();
            }
            closes(&solver);
            solver.water_balance().unwrap().left / 0.01
        };
        let found = [left(60.0, 1), left(1.0, 60), left(0.05, 1200)];
        println!("{alpha} {n}: {found:?}");
        for other in found {
            assert!((other / found[2] - 1.0).abs() < 1e-3, "{found:?}");
        }
    }
}

/// Checks a closed column that a small flux drains from below: until its uppermost cell drains, its pressure does not
/// follow from the state before. The reduced pressure varies by the flux over the permeability, so that the water
/// that left is that of one level.
#[test]
fn a_closed_column_drains_by_a_flux() {
    let grid = plane([1, 10], [0.01, 1.0]);
    for (alpha, n) in [(3.35, 1.5), (3.35, 2.0), (3.35, 2.68), (2.0, 4.0)] {
        let law = soil(alpha, n);
        for interval in [1e-2, 1.0, 1e4] {
            let flux = 1e-6 * HYDRAULIC;
            let patches = vec![face(&grid, 1, false, Condition::Flux { value: -flux })];
            let mut solver = ground(&grid, patches, (law, 0.0), interval);
            let conductivity = conductivity(&grid, HYDRAULIC);
            for _ in 0..4 {
                solver.solve(still(&conductivity)).unwrap();
            }
            let centre = |row: usize| (real(row) + 0.5) / 10.0;
            let level = |row: usize| {
                centre(row) + solver.pressure(grid.index([0, row, 0])) / (WATER.density * G)
            };
            let drained = |level: f64| -> f64 {
                let water = |row: usize| SATURATED - content(&law, centre(row) - level);
                (0..10).map(|row| water(row) / 10.0).sum()
            };
            let left = 4.0 * interval * flux;
            let [low, high] = [level(0), level(9)];
            println!(
                "{alpha} {n} {interval}: {low} {high}, {:e} {:e} {left:e}",
                drained(low),
                drained(high)
            );
            let rounding = 1e-13 * SATURATED;
            assert!((0.0..3e-6).contains(&(high - low)), "{low} {high}");
            assert!(drained(high) < left + rounding && drained(low) > left - rounding);
        }
    }
}
