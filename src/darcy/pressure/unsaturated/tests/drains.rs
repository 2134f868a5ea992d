//! Drains, wells, evaporation and sharp fronts against closed solutions.

use super::transient::{advancing, closes, column, suction, transient};
use super::*;
use crate::{DrainCells, InitialWater, TransientSettings};

/// Checks a dam with a horizontal drain at its base after J. S. Kozeny (1931): with the focus at the start of the drain
/// the head is the real part of sqrt(2 q z/k), the phreatic line y^2 = 2 q x/k + (q/k)^2 and the drain of length q/(2
/// k). The head upstream is that of the solution; the surface of a tenth of a cell adds its water.
#[test]
fn the_parabola_of_a_horizontal_drain() {
    let y0 = 0.25;
    let (left, right) = (-0.25, 1.5);
    let spacing = 0.0125;
    let cells = [140, 80];
    let grid = SeepageGrid {
        cells: [cells[0], cells[1], 1],
        origin: [left, 0.0, 0.0],
        spacing: [spacing, spacing, 1.0],
        dimension: 2,
        ..SeepageGrid::default()
    };
    let head = |x: f64, y: f64| (y0 * (x.hypot(y) + x)).sqrt();
    let top = (2.0 * y0 * right + y0 * y0).sqrt();
    let mut patches = vec![PressurePatch {
        axis: 1,
        upper: false,
        from: [0; 3],
        to: [20, 1, 1],
        condition: Condition::SeepageFace { level: None },
        inside: false,
    }];
    for row in 0..cells[1] {
        let y = (real(row) + 0.5) * spacing;
        if y < top {
            patches.push(PressurePatch {
                axis: 0,
                upper: true,
                from: [cells[0] - 1, row, 0],
                to: [cells[0], row + 1, 1],
                condition: Condition::Head {
                    value: head(right, y),
                },
                inside: false,
            });
        }
    }
    let soil = Retention::SaturatedOnly(SaturatedOnly {
        thickness: Some(0.1 * spacing),
    });
    let mut solver = solver(&grid, patches, soil);
    let conductivity = conductivity(&grid, 1.0);
    let report = solver.solve(still(&conductivity)).unwrap();
    println!("{} {}", report.outflow, report.outflow / y0 - 1.0);
    assert!((report.outflow / y0 - 1.0).abs() < 0.01, "{report:?}");
    for x in [0.25, 0.5, 0.75, 1.0, 1.25] {
        let exact = (2.0 * y0 * x + y0 * y0).sqrt();
        let found = table(&solver, x);
        println!("{x}: {found} {exact} {}", found / exact - 1.0);
        assert!((found / exact - 1.0).abs() < 0.01, "{x}: {found} {exact}");
    }
}

/// Height of zero pressure at a coordinate, between the columns of cells on both sides.
fn table(solver: &Pressure, x: f64) -> f64 {
    let grid = solver.grid();
    let height = |column: usize| {
        let head = |row: usize| solver.pressure(grid.index([column, row, 0])) / (1000.0 * G);
        let dry = (0..grid.cells[1]).find(|&row| head(row) < 0.0).unwrap();
        let (below, above) = (head(dry - 1), head(dry));
        (real(dry) - 0.5 + below / (below - above)) * grid.spacing[1]
    };
    let place = (x - grid.origin[0]) / grid.spacing[0] - 0.5;
    let first = base::number::whole(place.floor());
    let part = place - place.floor();
    (1.0 - part) * height(first) + part * height(first + 1)
}

/// Checks a well that pumps from a wide aquifer, in plan view: its drawdown is Q/(4 pi T) W(u), u = r^2 S/(4 T t),
/// after C. V. Theis (Trans. AGU 16 (1935) 519). All ground remains saturated, so that gravity along y has no effect.
#[test]
fn the_drawdown_of_a_well() {
    let (n, spacing) = (120, 4.0);
    let grid = plane([n, n], [spacing * real(n); 2]);
    let level = Condition::Head { value: 1000.0 };
    let ends = [0.0, spacing * real(n)];
    let well = PressurePatch {
        condition: Condition::Discharge { value: -0.25e-3 },
        inside: true,
        ..patch(&grid, 0, false, ends, level)
    };
    let patches = vec![
        patch(&grid, 0, true, ends, level),
        patch(&grid, 1, true, ends, level),
        well,
    ];
    let cells = DrainCells {
        from: [0; 3],
        to: [1; 3],
        stays: true,
        only: None,
    };
    let open = Openness::measure(&grid, &Enclosure::Everything).with_drains(&[cells]);
    let volume: Vec<f64> = (0..grid.count()).map(|cell| open.volume(cell)).collect();
    let soil = Retention::Gardner(Gardner {
        alpha: 1.0,
        saturated_content: 0.3,
        residual_content: 0.1,
    });
    let chosen = TransientSettings {
        specific_storage: 1e-4,
        content_error: 1e-3,
        ..transient(InitialWater::Head(1000.0), 250.0)
    };
    let mut solver = Pressure::new(&open, patches, WATER, settings(), &Communicator::serial())
        .unwrap()
        .with_soil(Soil { retention: soil })
        .with_transient(chosen, &volume);
    // T = 1e-4 m2/s and S = 1e-4.
    let conductivity = conductivity(&grid, 1e-4);
    for n in 1..=4 {
        solver.solve(still(&conductivity)).unwrap();
        closes(&solver);
        let time = 250.0 * f64::from(n);
        for cell in [4, 7, 12, 18] {
            let [x, y, _] = grid.centre([cell, cell / 2, 0]);
            let u = (x * x + y * y) / (4.0 * time);
            let exact = 1e-3 / (4.0 * std::f64::consts::PI * 1e-4) * well_function(u);
            let head = solver.head(solver.reduced(grid.index([cell, cell / 2, 0])));
            let found = 1000.0 - head;
            println!("{time} {u}: {found} {exact} {}", found / exact - 1.0);
            if u < 2.0 {
                assert!(
                    (found / exact - 1.0).abs() < 0.01,
                    "{time} {u}: {found} {exact}"
                );
            }
        }
    }
}

/// Returns the exponential integral of the first kind, by its series.
fn well_function(u: f64) -> f64 {
    let mut term = -1.0;
    let mut sum = -0.577_215_664_901_532_9 - u.ln();
    for n in 1..60 {
        term *= -u / f64::from(n);
        sum += term / f64::from(n);
    }
    sum
}

#[test]
fn the_well_function_is_the_tabled_one() {
    for (u, exact) in [
        (1e-3, 6.33154),
        (0.01, 4.03793),
        (0.1, 1.82292),
        (1.0, 0.219384),
        (2.0, 0.0489005),
    ] {
        assert!((well_function(u) / exact - 1.0).abs() < 1e-5, "{u}");
    }
}

/// Checks two drains of different heads in an impermeable box: the discharge of one enters the other, as between the
/// plates of a capacitor; a sheet is the end of the ground on both of its sides.
#[test]
fn a_sheet_and_a_box_of_stated_heads() {
    let grid = plane([40, 8], [4.0, 0.8]);
    let drain = |condition| PressurePatch {
        axis: 0,
        upper: false,
        from: [0; 3],
        to: [0; 3],
        condition,
        inside: true,
    };
    // The sheet at x = 1, the box from x = 3 to x = 3.2, both as high as the ground.
    let cells = [
        DrainCells {
            from: [10, 0, 0],
            to: [10, 8, 1],
            stays: false,
            only: None,
        },
        DrainCells {
            from: [30, 0, 0],
            to: [32, 8, 1],
            stays: false,
            only: None,
        },
    ];
    let open = Openness::measure(&grid, &Enclosure::Everything).with_drains(&cells);
    let patches = vec![
        drain(Condition::Head { value: 3.0 }),
        drain(Condition::Head { value: 2.0 }),
    ];
    let mut solver =
        Pressure::new(&open, patches, WATER, settings(), &Communicator::serial()).unwrap();
    let conductivity = conductivity(&grid, 1e-3);
    let report = solver.solve(still(&conductivity)).unwrap();
    let exact = 1e-3 * 0.8 / 2.0;
    assert!((report.inflow / exact - 1.0).abs() < 1e-8, "{report:?}");
    let inflows = solver.patch_inflows();
    assert!((inflows[0] / exact - 1.0).abs() < 1e-8 && (inflows[1] / exact + 1.0).abs() < 1e-8);
    let head = |x: usize| solver.head(solver.reduced(grid.index([x, 3, 0])));
    assert!((head(4) - 3.0).abs() < 1e-9 && (head(36) - 2.0).abs() < 1e-9);
    assert!((head(20) - (3.0 - 1.05 / 2.0)).abs() < 1e-8);
    let through = solver.flow_through_section(0, 20, &[0..40, 0..8, 0..1]);
    assert!((through.discharge / exact - 1.0).abs() < 1e-8);
    let stream = solver.stream_function();
    assert!((stream[8 * 41 + 20] / exact - 1.0).abs() < 1e-8);
}

/// Checks evaporation from a water table at a depth L through an exponential soil: with a suction S at the surface the
/// rate is K (e^(-alpha L) - e^(-alpha S))/(1 - e^(-alpha L)), at most K/(e^(alpha L) - 1) (W. R. Gardner, Soil Sci. 85
/// (1958) 228); a smaller potential rate is reached.
#[test]
fn evaporation_is_limited_by_the_suction() {
    let grid = plane([1, 200], [0.01, 1.0]);
    let hourly = 0.01 / 3600.0;
    let soil = Retention::Gardner(Gardner {
        alpha: 5.0,
        saturated_content: 0.4,
        residual_content: 0.1,
    });
    let rate = |suction: f64, wanted: f64| {
        let sky = Condition::Evaporation {
            rate: wanted * hourly,
            suction,
        };
        let patches = column(&grid, [Condition::Head { value: 0.0 }, sky]);
        let mut solver = solver(&grid, patches, soil);
        let report = solver.solve(still(&conductivity(&grid, hourly))).unwrap();
        report.outflow / 0.01 / hourly
    };
    for suction in [1.2_f64, 2.0, 10.0] {
        let exact = ((-5.0_f64).exp() - (-5.0 * suction).exp()) / (1.0 - (-5.0_f64).exp());
        let found = rate(suction, 1.0);
        println!("{suction}: {found} {exact} {}", found / exact - 1.0);
        assert!(
            (found / exact - 1.0).abs() < 0.005,
            "{suction}: {found} {exact}"
        );
    }
    let most = 1.0 / (5.0_f64.exp() - 1.0);
    assert!((rate(100.0, 1.0) / most - 1.0).abs() < 0.005);
    // Less than the soil delivers.
    assert!((rate(10.0, 0.003) / 0.003 - 1.0).abs() < 1e-6);
}

/// Checks the infiltration of ponded water with a sharp front after W. H. Green and G. A. Ampt (J. Agric. Sci. 4 (1911)
/// 1): K t = F - P ln(1 + F/P), P the suction at the front times the deficit. The suction of a soil that drains in a
/// narrow range of suctions is the integral of its relative permeability (S. P. Neuman, Water Resour. Res. 12 (1976)
/// 564).
#[test]
fn a_sharp_front_infiltrates_as_green_and_ampt_say() {
    let grid = plane([1, 400], [0.01, 1.0]);
    let patches = column(&grid, [suction(-1.0), suction(0.0)]);
    let soil = Retention::VanGenuchten(VanGenuchten {
        alpha: 4.0,
        n: 16.0,
        saturated_content: 0.4,
        residual_content: 0.1,
        exponent: 0.5,
    });
    let law = soil.model();
    let steps = 20_000_usize;
    let front: f64 = (0..steps)
        .map(|k| {
            let head = -(real(k) + 0.5) / real(steps);
            law.state(head).log_permeability.exp() / real(steps)
        })
        .sum();
    let deficit = law.state(0.0).content - law.state(-1.0).content;
    let stored = front * deficit;
    let settings = transient(InitialWater::PressureHead(-1.0), 1000.0);
    let mut solver = advancing(&grid, patches, soil, settings);
    let conductivity = conductivity(&grid, 1e-5);
    for n in 1..=4 {
        solver.solve(still(&conductivity)).unwrap();
        closes(&solver);
        let target = 1e-5 * 1000.0 * f64::from(n);
        let mut exact = target;
        for _ in 0..200 {
            exact = target + stored * (1.0 + exact / stored).ln();
        }
        let balance = solver.water_balance().unwrap();
        let found = (balance.entered - balance.left) / 0.01;
        println!("{n}: {found} {exact} {}", found / exact - 1.0);
        assert!((found / exact - 1.0).abs() < 0.02, "{n}: {found} {exact}");
    }
}

/// Checks a well that takes more water than dry ground can deliver: the run ends with an error that names the well, not
/// with ever shorter steps.
#[test]
fn a_well_that_runs_dry_is_a_named_failure() {
    let grid = plane([12, 21], [1.2, 2.1]);
    let sides = [0.0, 2.1];
    let level = |level| Condition::SeepageFace { level: Some(level) };
    let well = PressurePatch {
        condition: Condition::Discharge { value: -3.58e-7 },
        inside: true,
        ..patch(&grid, 0, false, sides, level(0.0))
    };
    let patches = vec![
        patch(&grid, 0, false, sides, level(1.0)),
        patch(&grid, 0, true, sides, level(0.9492)),
        well,
    ];
    let cells = DrainCells {
        from: [5, 9, 0],
        to: [7, 11, 1],
        stays: true,
        only: None,
    };
    let open = Openness::measure(&grid, &Enclosure::Everything).with_drains(&[cells]);
    let volume: Vec<f64> = (0..grid.count()).map(|cell| open.volume(cell)).collect();
    let soil = Retention::VanGenuchten(VanGenuchten {
        alpha: 6.22,
        n: 3.71,
        saturated_content: 0.4,
        residual_content: 0.05,
        exponent: 0.5,
    });
    let mut solver = Pressure::new(&open, patches, WATER, settings(), &Communicator::serial())
        .unwrap()
        .with_soil(Soil { retention: soil })
        .with_transient(
            transient(InitialWater::PressureHead(-1.5141), 60.0),
            &volume,
        );
    let conductivity = conductivity(&grid, 6.4e-5);
    let ends = (0..10).find_map(|_| solver.solve(still(&conductivity)).err());
    assert!(
        matches!(ends, Some(SeepageError::UnsteadyFlow { .. })),
        "{ends:?}"
    );
}
