mod drains;
mod drawdown;
mod rain;
mod transient;

use super::*;
use crate::enclosure::Enclosure;
use crate::pressure::tests::{plane, still};
use crate::pressure::{Equations, Liquid, PressurePatch, PressureSettings};
use crate::retention::gardner::Gardner;
use crate::retention::saturated_only::SaturatedOnly;
use crate::retention::van_genuchten::VanGenuchten;
use crate::{Openness, SeepageGrid};
use base::number::real;
use decomposition::Communicator;

const WATER: Liquid = Liquid {
    density: 1000.0,
    viscosity: 1e-3,
};
const G: f64 = 9.81;

fn settings() -> PressureSettings {
    PressureSettings {
        equations: Equations::Corrected,
        gravity: [0.0, -G, 0.0],
        tolerance: 1e-9,
        iterations: 200,
    }
}

/// Returns the condition on a part of a face of a plane grid, between two heights or coordinates.
fn patch(
    grid: &SeepageGrid,
    axis: usize,
    upper: bool,
    ends: [f64; 2],
    condition: Condition,
) -> PressurePatch {
    let across = 1 - axis;
    let (mut from, mut to) = ([0; 3], grid.cells);
    let place = |x: f64| base::number::whole((x / grid.spacing[across]).round());
    (from[across], to[across]) = (place(ends[0]), place(ends[1]));
    PressurePatch {
        axis,
        upper,
        from,
        to,
        condition,
        inside: false,
    }
}

fn solver(grid: &SeepageGrid, patches: Vec<PressurePatch>, retention: Retention) -> Pressure {
    let open = Openness::measure(grid, &Enclosure::Everything);
    let serial = Communicator::serial();
    Pressure::new(&open, patches, WATER, settings(), &serial)
        .unwrap()
        .with_soil(Soil { retention })
}

/// Conductivity [m2/(Pa s)] of a hydraulic conductivity \[m/s\].
fn conductivity(grid: &SeepageGrid, hydraulic: f64) -> Vec<f64> {
    vec![hydraulic / (WATER.density * G); grid.count()]
}

/// Solves for a dam of this height above impervious ground between two water levels, with a hydraulic conductivity of 1
/// m/s; returns its discharge and the height at which the phreatic surface leaves it.
fn dam(
    cells: [usize; 2],
    length: f64,
    levels: [f64; 2],
    retention: Retention,
) -> (SolutionReport, f64) {
    let grid = plane(cells, [length, levels[0]]);
    let downstream = Condition::SeepageFace {
        level: Some(levels[1]),
    };
    let upstream = Condition::Head { value: levels[0] };
    let ends = [0.0, levels[0]];
    let patches = vec![
        patch(&grid, 0, false, ends, upstream),
        patch(&grid, 0, true, ends, downstream),
    ];
    let mut solver = solver(&grid, patches, retention);
    let report = solver.solve(still(&conductivity(&grid, 1.0))).unwrap();
    // Pressure head of the last cells: 0 where water leaves.
    let last = |row: usize| {
        let cell = grid.index([cells[0] - 1, row, 0]);
        solver.pressure(cell) / (WATER.density * G)
    };
    let row = (0..cells[1]).rev().find(|row| last(*row) > 0.0).unwrap();
    let height = |row: usize| (real(row) + 0.5) * grid.spacing[1];
    let exit = if row + 1 < cells[1] {
        let (below, above) = (last(row), last(row + 1));
        height(row) + grid.spacing[1] * below / (below - above)
    } else {
        levels[0]
    };
    (report, exit)
}

/// Checks the discharge k (h1^2 - h2^2)/(2 L) of A. Dupuit, exact after I. A. Charny, and the exit of the phreatic
/// surface after the integrals of P. Ya. Polubarinova-Kochina (Theory of Ground Water Movement, 1962, chapter VII). The
/// height of the exit is of first order in the cells.
#[test]
fn discharge_and_seepage_face_of_a_rectangular_dam() {
    for (length, levels, exit) in [
        (0.5, [1.0, 0.0], 0.63176),
        (1.0, [1.0, 0.0], 0.36824),
        (0.5, [1.0, 0.5], 0.66238),
    ] {
        let on = |rows: usize| {
            let soil = SaturatedOnly {
                thickness: Some(0.1 / real(rows)),
            };
            dam(
                [rows / 2, rows],
                length,
                levels,
                Retention::SaturatedOnly(soil),
            )
        };
        let ((_, coarse), (report, fine)) = (on(80), on(160));
        let exact = (levels[0] * levels[0] - levels[1] * levels[1]) / (2.0 * length);
        println!("{length} {levels:?}: {report:?} {exact}, exit {coarse} {fine} {exit}");
        assert!(
            (report.outflow / exact - 1.0).abs() < 1e-3,
            "{report:?} {exact}"
        );
        assert!(
            (report.inflow / report.outflow - 1.0).abs() < 1e-6,
            "{report:?}"
        );
        let found = 2.0 * fine - coarse;
        assert!((found / exit - 1.0).abs() < 0.01, "{found} {exit}");
    }
}

/// Checks the dam of T. P. Clement, W. R. Wise, F. J. Molz and M. Wen (J. Hydrol. 181 (1996) 189) with its capillary
/// zone: 10 m between levels of 10 m and 2 m, discharge 6.076e-5 m2/s at 1.1574e-5 m/s, exit between 4.8 m and 5.0 m in
/// three programs.
#[test]
fn a_dam_with_a_capillary_zone() {
    let soil = Retention::VanGenuchten(VanGenuchten {
        alpha: 0.64,
        n: 4.65,
        saturated_content: 0.4,
        residual_content: 0.0,
        exponent: 0.5,
    });
    let (report, exit) = dam([40, 40], 10.0, [10.0, 2.0], soil);
    let discharge = 1.1574e-5 * report.outflow;
    println!("{report:?} {discharge:e} {exit}");
    assert!((discharge / 6.076e-5 - 1.0).abs() < 5e-3, "{discharge:e}");
    assert!((4.75..5.05).contains(&exit), "{exit}");
}

/// Checks that below the water table the pressures do not depend on the soil: they are those of saturated ground.
#[test]
fn saturated_ground_is_as_without_a_soil() {
    let grid = plane([12, 9], [1.2, 0.9]);
    let ends = [0.0, 0.9];
    let patches = vec![
        patch(&grid, 0, false, ends, Condition::Head { value: 2.0 }),
        patch(&grid, 0, true, ends, Condition::Head { value: 1.5 }),
    ];
    let soil = Retention::Gardner(Gardner {
        alpha: 3.0,
        saturated_content: 0.4,
        residual_content: 0.0,
    });
    let mut with = solver(&grid, patches.clone(), soil);
    let open = Openness::measure(&grid, &Enclosure::Everything);
    let mut without =
        Pressure::new(&open, patches, WATER, settings(), &Communicator::serial()).unwrap();
    let k = conductivity(&grid, 1e-4);
    with.solve(still(&k)).unwrap();
    without.solve(still(&k)).unwrap();
    for cell in 0..grid.count() {
        assert!((with.pressure(cell) - without.pressure(cell)).abs() < 1e-4);
        assert!((with.flux(cell)[0] / without.flux(cell)[0] - 1.0).abs() < 1e-7);
    }
}

/// Checks that stationary water is hydrostatic to rounding above and below its table, and does not flow.
#[test]
fn water_at_rest_stays_at_rest() {
    let grid = plane([4, 20], [0.4, 2.0]);
    let table = Condition::SeepageFace { level: Some(0.7) };
    let patches = vec![patch(&grid, 0, false, [0.0, 2.0], table)];
    let soil = Retention::VanGenuchten(VanGenuchten {
        alpha: 3.35,
        n: 2.0,
        saturated_content: 0.368,
        residual_content: 0.102,
        exponent: 0.5,
    });
    let mut solver = solver(&grid, patches, soil);
    let report = solver.solve(still(&conductivity(&grid, 1e-4))).unwrap();
    println!("{report:?}");
    for cell in 0..grid.count() {
        let head = 0.7 - grid.centre(grid.cell(cell))[1];
        let found = solver.pressure(cell) / (WATER.density * G);
        assert!((found - head).abs() < 1e-6, "{found} {head}");
    }
    assert!(report.outflow < 1e-12);
}

/// Checks that water in gravel between tight layers, a million times less permeable, stays at rest up to
/// a seepage face.
#[test]
fn water_in_gravel_between_tight_layers_stays_at_rest() {
    let grid = plane([7, 14], [0.7, 1.4]);
    let table = Condition::SeepageFace { level: Some(0.213) };
    let patches = vec![patch(&grid, 0, false, [0.0, 1.4], table)];
    let soil = Retention::Gardner(Gardner {
        alpha: 5.5,
        saturated_content: 0.4,
        residual_content: 0.05,
    });
    let mut solver = solver(&grid, patches, soil);
    let mut conductivity = conductivity(&grid, 4e-11);
    for (cell, known) in conductivity.iter_mut().enumerate() {
        if (5..9).contains(&grid.cell(cell)[1]) {
            *known *= 1e6;
        }
    }
    let report = solver.solve(still(&conductivity)).unwrap();
    for cell in 0..grid.count() {
        let head = 0.213 - grid.centre(grid.cell(cell))[1];
        let found = solver.pressure(cell) / (WATER.density * G);
        assert!((found - head).abs() < 1e-6, "{found} {head}");
    }
    assert!(report.outflow < 1e-16, "{report:?}");
}

/// Checks rain R on Gardner's soil above a water table: e^(alpha psi) = R/K + (1 - R/K) e^(-alpha z), at the centres of
/// cells of any height.
#[test]
fn rain_on_an_exponential_soil() {
    for rows in [5, 20, 80] {
        let grid = plane([1, rows], [0.1, 2.0]);
        let table = Condition::Head { value: 0.0 };
        let rain = Condition::Rain { rate: 0.1e-5 };
        let patches = vec![
            patch(&grid, 1, false, [0.0, 0.1], table),
            patch(&grid, 1, true, [0.0, 0.1], rain),
        ];
        let soil = Retention::Gardner(Gardner {
            alpha: 5.0,
            saturated_content: 0.4,
            residual_content: 0.1,
        });
        let mut solver = solver(&grid, patches, soil);
        let report = solver.solve(still(&conductivity(&grid, 1e-5))).unwrap();
        assert!((report.outflow / 1e-7 - 1.0).abs() < 1e-7, "{report:?}");
        for cell in 0..grid.count() {
            let z = grid.centre(grid.cell(cell))[1];
            let exact = (0.1 + 0.9 * (-5.0 * z).exp()).ln() / 5.0;
            let found = solver.pressure(cell) / (WATER.density * G);
            assert!((found - exact).abs() < 1e-7, "{rows} {z}: {found} {exact}");
        }
    }
}

/// Checks water that rises from a water table 1 m below to a stated flux at the surface: at most K/(e^(alpha L) - 1),
/// at infinite suction. A larger one has no solution, and an error names it.
#[test]
fn a_flux_that_the_ground_cannot_yield_is_an_error() {
    let rise = |flux: f64| {
        let grid = plane([1, 50], [0.1, 1.0]);
        let table = Condition::Head { value: 0.0 };
        let patches = vec![
            patch(&grid, 1, false, [0.0, 0.1], table),
            patch(&grid, 1, true, [0.0, 0.1], Condition::Flux { value: -flux }),
        ];
        let soil = Retention::Gardner(Gardner {
            alpha: 5.0,
            saturated_content: 0.4,
            residual_content: 0.1,
        });
        let mut solver = solver(&grid, patches, soil);
        solver.solve(still(&conductivity(&grid, 1e-5)))
    };
    let most = 1e-5 / (5.0_f64.exp() - 1.0);
    assert!(rise(0.9 * most).is_ok());
    for more in [1.5, 15.0] {
        let found = rise(more * most);
        assert!(
            matches!(
                found,
                Err(SeepageError::DryGround { .. } | SeepageError::Unsaturated { .. })
            ),
            "{found:?}"
        );
    }
}

/// Checks rain above the hydraulic conductivity: the column takes up as much as it drains under its own weight, and the
/// rest runs off.
#[test]
fn rain_that_the_soil_does_not_take_runs_off() {
    let grid = plane([1, 20], [0.1, 2.0]);
    let soil = Retention::Gardner(Gardner {
        alpha: 5.0,
        saturated_content: 0.4,
        residual_content: 0.1,
    });
    let run = |rate: f64| {
        let patches = vec![
            patch(&grid, 1, false, [0.0, 0.1], Condition::Head { value: 0.0 }),
            patch(&grid, 1, true, [0.0, 0.1], Condition::Rain { rate }),
        ];
        let mut solver = solver(&grid, patches, soil);
        solver
            .solve(still(&conductivity(&grid, 1e-5)))
            .unwrap()
            .inflow
            / 0.1
    };
    // Saturated with a surface without pressure: a unit gradient.
    assert!((run(3e-5) / 1e-5 - 1.0).abs() < 1e-7);
    assert!((run(0.9e-5) / 0.9e-5 - 1.0).abs() < 1e-7);
}

/// Checks rain through two layers of exponential soils: in each, e^(alpha psi) = R/K + C e^(-alpha z), with one
/// pressure at the boundary between them. Stationary water across it remains stationary.
#[test]
fn rain_through_layers_has_one_pressure_at_their_boundary() {
    let gardner = |alpha: f64| {
        Retention::Gardner(Gardner {
            alpha,
            saturated_content: 0.4,
            residual_content: 0.1,
        })
    };
    let exact = |rain: f64, z: f64| {
        let lower = |z: f64| (rain + (1.0 - rain) * (-5.0 * z).exp()).ln() / 5.0;
        let middle = (2.0 * lower(1.0)).exp();
        if z < 1.0 {
            lower(z)
        } else {
            (rain + (middle - rain) * (-2.0 * (z - 1.0)).exp()).ln() / 2.0
        }
    };
    let largest_error = |rows: usize, rain: f64| {
        let grid = plane([1, rows], [0.1, 2.0]);
        let table = Condition::Head { value: 0.0 };
        let rate = 1e-5 * rain;
        let patches = vec![
            patch(&grid, 1, false, [0.0, 0.1], table),
            patch(&grid, 1, true, [0.0, 0.1], Condition::Rain { rate }),
        ];
        let upper: Vec<u8> = (0..rows).map(|row| u8::from(2 * row >= rows)).collect();
        let mut solver = solver(&grid, patches, gardner(5.0)).with_layers(&[gardner(2.0)], &upper);
        let report = solver.solve(still(&conductivity(&grid, 1e-5))).unwrap();
        assert!((report.outflow - rate * 0.1).abs() < 1e-13, "{report:?}");
        let error = |cell: usize| {
            let found = solver.pressure(cell) / (WATER.density * G);
            (found - exact(rain, grid.centre(grid.cell(cell))[1])).abs()
        };
        (0..rows).map(error).fold(0.0, f64::max)
    };
    assert!(largest_error(40, 0.0) < 1e-7);
    let (coarse, fine) = (largest_error(40, 0.1), largest_error(160, 0.1));
    println!("{coarse} {fine}");
    assert!(fine < 0.01 && fine < 0.3 * coarse, "{coarse} {fine}");
}
