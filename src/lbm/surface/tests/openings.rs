//! Openings of water with a free surface.

use super::super::kind::{GAS, LIQUID};
use super::super::opening::Outside;
use super::{Tank, at_face, bits, dam, mass, step};
use crate::fluid::Fluid;
use crate::quanta::from_quanta;
use base::history::TimeTable;

fn constant(value: f64) -> TimeTable {
    TimeTable::new(None, value)
}

/// Returns the masses that have entered and left through all openings.
fn passed(fluid: &Fluid<f64>) -> [f64; 2] {
    let passed = fluid.surface().unwrap().passed();
    passed.fold([0.0; 2], |[entered, left], (_, passed)| {
        [
            entered + from_quanta(passed.entered),
            left + from_quanta(passed.left),
        ]
    })
}

/// Asserts that the gain of mass equals the entered mass minus the mass that left or was lost.
fn closes(fluid: &Fluid<f64>, before: f64) {
    let [entered, left] = passed(fluid);
    let kept = mass(fluid) + fluid.surface().unwrap().lost_mass() - entered + left;
    let size = before + entered;
    assert!(
        ((kept - before) / size).abs() < 1e-12,
        "{kept} of {before}, {entered} entered"
    );
}

/// Returns the mean height of the water in some columns of a tank in two dimensions.
fn height(fluid: &Fluid<f64>, columns: std::ops::Range<usize>) -> f64 {
    let populations = fluid.populations();
    let surface = fluid.surface().unwrap();
    let cells = populations.interior();
    let some = cells.filter(|(at, _)| columns.contains(&at[0]));
    some.map(|(_, cell)| surface.fill(cell)).sum::<f64>() / columns.len() as f64
}

fn channel() -> Tank {
    let mut tank = Tank::new([60, 24, 1]);
    tank.tau = 0.55;
    tank.slip_at = vec![(1, false)];
    tank
}

/// Checks that stationary water between two levels remains stationary for any position of the level in its cell.
#[test]
fn water_between_equal_levels_stays_at_rest() {
    for level in [8.0, 8.25, 8.5, 8.9] {
        let mut tank = channel();
        tank.tau = 0.6;
        tank.open_at = vec![
            (0, false, at_face(constant(level))),
            (0, true, at_face(constant(level))),
        ];
        let mut fluid = tank.fill(|[_, y, _]| (level - y as f64).clamp(0.0, 1.0));
        let before = mass(&fluid);
        step(&mut fluid, 3000);
        closes(&fluid, before);
        let found = height(&fluid, 0..60);
        assert!((found - level).abs() < 2e-3, "{found} for {level}");
        for (at, cell) in fluid.populations().interior() {
            let (_, u) = fluid.state(cell);
            if fluid.surface().unwrap().is_wet(cell) && at[1] < 8 {
                assert!(u[0].abs() + u[1].abs() < 2e-6, "{level} {at:?}: {u:?}");
            }
        }
    }
}

/// Checks that the water level in a closed end follows the table of the level outside, upwards and downwards.
#[test]
fn water_follows_a_level_in_time() {
    let mut tank = channel();
    tank.cells[0] = 20;
    let table = [[0.0, 8.3], [12000.0, 14.6], [18000.0, 14.6], [30000.0, 6.2]];
    let levels = TimeTable::new(Some(&table), 0.0);
    tank.open_at = vec![(0, true, at_face(levels.clone()))];
    let mut fluid = tank.fill(|[_, y, _]| (8.3 - y as f64).clamp(0.0, 1.0));
    let before = mass(&fluid);
    // The tank sloshes with a wave four times as long as itself; at a rate of change r its mean is late by up to r
    // L/c.
    let speed = (1e-4_f64 * 6.2).sqrt();
    let lag = 7e-4 * 20.0 / speed;
    for n in 1..=30 {
        step(&mut fluid, 1000);
        closes(&fluid, before);
        let found = height(&fluid, 0..20);
        let wanted = levels.value(1000.0 * f64::from(n));
        assert!((found - wanted).abs() < 0.1 + lag, "{found} for {wanted}");
    }
    step(&mut fluid, 2000);
    let period = 4.0 * 20.0 / speed;
    let parts = 32;
    let mut mean = 0.0;
    for _ in 0..parts {
        step(&mut fluid, base::number::whole(period / f64::from(parts)));
        mean += height(&fluid, 0..20) / f64::from(parts);
    }
    assert!((mean - 6.2).abs() < 0.1, "{mean}");
}

/// Checks the stream between a level in a reservoir and a level 0.5 cells lower at the face downstream, without
/// friction: its depth and velocity head of 0.5 cells have the sum of the level in the reservoir, behind a hump of
/// half a cell in the first three columns.
#[test]
fn a_stream_from_a_reservoir_has_the_head_of_its_level() {
    let mut tank = channel();
    tank.tau = 0.52;
    let reservoir = Outside::Level {
        levels: constant(9.0),
        in_reservoir: true,
    };
    tank.open_at = vec![(0, false, reservoir), (0, true, at_face(constant(8.5)))];
    let mut fluid = tank.fill(|[_, y, _]| (8.5 - y as f64).clamp(0.0, 1.0));
    let before = mass(&fluid);
    step(&mut fluid, 48_000);
    let earlier = passed(&fluid)[0];
    step(&mut fluid, 2_000);
    closes(&fluid, before);
    let discharge = (passed(&fluid)[0] - earlier) / 2_000.0;
    for columns in [25..35, 50..60] {
        let depth = height(&fluid, columns.clone());
        let head = depth + (discharge / depth).powi(2) / (2.0 * tank.gravity);
        println!("{columns:?}: depth {depth}, head {head}");
        assert!((head - 9.0).abs() < 0.05, "{columns:?}: {head}");
        assert!((depth - 8.5).abs() < 0.05, "{columns:?}: {depth}");
    }
}

/// Checks that a discharge enters exactly within rounding, into water and onto a dry bed, and flows to the level
/// downstream.
#[test]
fn a_discharge_enters_and_leaves() {
    for (start, end) in [(9.0, at_face(constant(9.0))), (0.0, Outside::Air)] {
        let mut tank = channel();
        tank.open_at = vec![
            (0, false, Outside::Discharge(constant(0.12))),
            (0, true, end.clone()),
        ];
        let mut fluid = tank.fill(|[_, y, _]| (start - y as f64).clamp(0.0, 1.0));
        let before = mass(&fluid);
        // Over a time of a wave four times as long as the tank nothing is stored.
        let period = 4.0 * 60.0 / (9.0 * tank.gravity).sqrt();
        step(&mut fluid, 2 * base::number::whole(period));
        closes(&fluid, before);
        let earlier = passed(&fluid);
        step(&mut fluid, base::number::whole(period));
        closes(&fluid, before);
        let later = passed(&fluid);
        let [inflow, outflow] = [0, 1].map(|n| (later[n] - earlier[n]) / period.floor());
        println!("start {start}: in {inflow}, out {outflow}");
        assert!((inflow / 0.12 - 1.0).abs() < 1e-9, "{inflow}");
        let lost = (inflow - outflow) / inflow;
        assert!(lost.abs() < 0.03, "in {inflow}, out {outflow}");
        for (_, cell) in fluid.populations().interior() {
            let cells = &fluid.surface().unwrap().cells;
            if cells.kind[cell] == LIQUID {
                assert_eq!(cells.count_neighbours(cell, |kind| kind == GAS), 0);
            }
        }
    }
}

/// Checks that a jet from a nozzle into air has the discharge of its velocity, widens by less than a cell, half a
/// cell at each rim, and is slower accordingly; then it falls like a projectile. Its surface carries waves, so that
/// thickness and height are means over a time.
#[test]
fn a_jet_enters_a_dry_box() {
    let mut tank = Tank::new([60, 50, 1]);
    tank.tau = 0.52;
    tank.gravity = 1e-4;
    tank.streams = vec![((0, false), [36.0, 44.0], [0.05, 0.0, 0.0])];
    tank.open_at = vec![(0, true, Outside::Air), (1, false, Outside::Air)];
    let mut fluid = tank.fill(|_| 0.0);
    step(&mut fluid, 1300);
    let columns = [10, 20, 30];
    let mut means = [[0.0; 2]; 3];
    let samples = 12;
    for _ in 0..samples {
        step(&mut fluid, 100);
        let surface = fluid.surface().unwrap();
        for (mean, x) in means.iter_mut().zip(columns) {
            let levels =
                (0..50).map(|y| surface.fill(fluid.populations().interior_cell([x, y, 0])));
            let levels: Vec<f64> = levels.collect();
            let sum: f64 = levels.iter().sum();
            let heights = levels.iter().enumerate();
            let first: f64 = heights.map(|(y, level)| level * (y as f64 + 0.5)).sum();
            mean[0] += sum / f64::from(samples);
            mean[1] += first / sum / f64::from(samples);
        }
    }
    closes(&fluid, 0.0);
    let [entered, _] = passed(&fluid);
    // The faces are dry in the first step, and the links at the rim lead to cells that are at first too empty to
    // stay.
    let steps = entered / (8.0 * 0.05);
    assert!((2490.0..2500.0).contains(&steps), "{steps}");
    let mut widening = 0.0;
    for ([width, height], x) in means.into_iter().zip(columns) {
        widening += (width - 8.0) / 3.0;
        let time = (x as f64 + 0.5) / (0.05 * 8.0 / width);
        let exact = 40.0 - 0.5 * tank.gravity * time * time;
        assert!((height - exact).abs() < 1.0, "{x}: {height} for {exact}");
    }
    assert!((0.0..1.0).contains(&widening), "{widening}");
}

/// Checks that a stream next to symmetry planes has the discharge of its velocity: water also passes the links through
/// the edges.
#[test]
fn a_stream_next_to_symmetry_planes_has_its_discharge() {
    for cells in [[30, 16, 1], [24, 16, 4]] {
        let mut tank = Tank::new(cells);
        tank.slip_at = vec![(1, false)];
        if cells[2] > 1 {
            tank.slip_at.extend([(2, false), (2, true)]);
        }
        tank.streams = vec![((0, false), [0.0, 8.0], [0.03, 0.0, 0.0])];
        tank.open_at = vec![(0, true, Outside::Air)];
        let mut fluid = tank.fill(|[_, y, _]| f64::from(u8::from(y < 8)));
        let before = mass(&fluid);
        step(&mut fluid, 300);
        closes(&fluid, before);
        let [entered, _] = passed(&fluid);
        let found = entered / (8.0 * cells[2] as f64 * 300.0 * 0.03);
        assert!((found - 1.0).abs() < 5e-3, "{found}");
    }
}

/// Checks that the bits depend neither on the axis of the slabs nor on the threads.
#[test]
fn openings_have_the_same_bits_along_any_axis_of_slabs() {
    let states: Vec<_> = (0..3)
        .map(|split| {
            let mut tank = Tank::new([26, 16, 7]);
            tank.tau = 0.52;
            tank.split = split;
            tank.slip_at = vec![(2, false)];
            tank.open_at = vec![
                (0, true, at_face(constant(6.3))),
                (0, false, Outside::Discharge(constant(0.9))),
                (1, false, Outside::Air),
            ];
            tank.streams = vec![((2, true), [9.0, 13.0], [0.0, 0.0, -0.02])];
            let mut fluid = tank.fill(dam(9, 11));
            step(&mut fluid, 301);
            bits(&fluid)
        })
        .collect();
    for other in &states[1..] {
        assert!(*other == states[0]);
    }
}
