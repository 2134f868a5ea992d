mod graded;

use super::*;
use crate::enclosure::Enclosure;
use crate::resistance::kozeny_carman;
use base::number::real;
use base::random::SplitMix;

const WATER: Liquid = Liquid {
    density: 1000.0,
    viscosity: 1e-3,
};

fn settings(tolerance: f64) -> PressureSettings {
    PressureSettings {
        equations: Equations::Corrected,
        gravity: [0.0; 3],
        tolerance,
        iterations: 200,
    }
}

fn grid(cells: [usize; 3], spacing: [f64; 3]) -> SeepageGrid {
    SeepageGrid {
        cells,
        origin: [0.0; 3],
        spacing,
        dimension: if cells[2] == 1 { 2 } else { 3 },
        ..SeepageGrid::default()
    }
}

fn patch(grid: &SeepageGrid, axis: usize, upper: bool, condition: Condition) -> PressurePatch {
    PressurePatch {
        axis,
        upper,
        from: [0; 3],
        to: grid.cells,
        condition,
        inside: false,
    }
}

fn between(grid: &SeepageGrid, axis: usize, low: Condition, high: Condition) -> Vec<PressurePatch> {
    vec![patch(grid, axis, false, low), patch(grid, axis, true, high)]
}

fn solver(
    grid: &SeepageGrid,
    enclosure: &Enclosure,
    patches: Vec<PressurePatch>,
    settings: PressureSettings,
) -> Result<Pressure, SeepageError> {
    let open = Openness::measure(grid, enclosure);
    Pressure::new(&open, patches, WATER, settings, &Communicator::serial())
}

fn conductivities(permeability: &[f64]) -> Vec<f64> {
    permeability.iter().map(|k| k / WATER.viscosity).collect()
}

/// Returns stationary grains.
pub(in crate::pressure) fn still(conductivity: &[f64]) -> Medium<'_> {
    Medium {
        conductivity,
        carried: None,
        source: None,
    }
}

/// Returns a grid of a plane with equal cells.
pub(in crate::pressure) fn plane(cells: [usize; 2], size: [f64; 2]) -> SeepageGrid {
    SeepageGrid {
        cells: [cells[0], cells[1], 1],
        origin: [0.0; 3],
        spacing: [size[0] / real(cells[0]), size[1] / real(cells[1]), 1.0],
        dimension: 2,
        ..SeepageGrid::default()
    }
}

/// Returns a patch for each face of the boundary of a plane, with the condition at the middle of the face.
pub(in crate::pressure) fn around(
    grid: &SeepageGrid,
    condition: impl Fn(usize, bool, [f64; 2]) -> Condition,
) -> Vec<PressurePatch> {
    let mut all = Vec::new();
    for axis in 0..2 {
        for upper in [false, true] {
            for n in 0..grid.cells[1 - axis] {
                let mut from = [0; 3];
                from[1 - axis] = n;
                from[axis] = if upper { grid.cells[axis] - 1 } else { 0 };
                let mut middle = grid.centre(from);
                middle[axis] += if upper { 0.5 } else { -0.5 } * grid.width(axis, from);
                all.push(PressurePatch {
                    axis,
                    upper,
                    from,
                    to: from.map(|k| k + 1),
                    condition: condition(axis, upper, [middle[0], middle[1]]),
                    inside: false,
                });
            }
        }
    }
    all
}

#[test]
fn flux_of_a_column_along_every_axis() {
    for axis in 0..3 {
        let mut cells = [4, 3, 5];
        cells[axis] = 17;
        let grid = grid(cells, [0.01, 0.012, 0.008]);
        let patches = between(
            &grid,
            axis,
            Condition::Pressure { value: 1000.0 },
            Condition::Pressure { value: 0.0 },
        );
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-13)).unwrap();
        let k = kozeny_carman(0.4, 1e-3);
        let report = solver
            .solve(still(&conductivities(&vec![k; grid.count()])))
            .unwrap();
        let height = real(cells[axis]) * grid.spacing[axis];
        let q = k * 1000.0 / (WATER.viscosity * height);
        for cell in 0..grid.count() {
            let flux = solver.flux(cell);
            assert!(
                (flux[axis] / q - 1.0).abs() < 1e-10,
                "{:e}",
                flux[axis] / q - 1.0
            );
            let depth = (real(grid.cell(cell)[axis]) + 0.5) / real(cells[axis]);
            assert!((solver.pressure(cell) - 1000.0 * (1.0 - depth)).abs() < 1e-7);
        }
        assert!((report.inflow / report.outflow - 1.0).abs() < 1e-10);
    }
}

#[test]
fn layers_in_series_tell_the_two_balances_apart() {
    // Two layers of equal height: n 0.4 and 0.35, d 1 mm.
    let grid = grid([2, 3, 20], [0.01; 3]);
    let (n1, n2) = (0.4, 0.35);
    let (k1, k2) = (kozeny_carman(n1, 1e-3), kozeny_carman(n2, 1e-3));
    let layer = |cell: usize| grid.cell(cell)[2] < 10;
    let eps: Vec<f64> = (0..grid.count())
        .map(|c| if layer(c) { n1 } else { n2 })
        .collect();
    let k: Vec<f64> = (0..grid.count())
        .map(|c| if layer(c) { k1 } else { k2 })
        .collect();
    let interface = |equations| {
        let patches = between(
            &grid,
            2,
            Condition::Pressure { value: 1000.0 },
            Condition::Pressure { value: 0.0 },
        );
        let settings = PressureSettings {
            equations,
            ..settings(1e-13)
        };
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings).unwrap();
        let paper = equations == Equations::Paper;
        let pores = eps.iter().map(|eps| if paper { *eps } else { 1.0 });
        let all = conductivities(&k);
        let all: Vec<f64> = all.iter().zip(pores).map(|(k, eps)| k / eps).collect();
        solver.solve(still(&all)).unwrap();
        let at = grid.index([1, 1, 9]);
        let above = solver.gradient(at)[2];
        (solver.pressure(at) + above * 0.005, solver.flux(at)[2])
    };
    // Resistances of the layers in series: H/k each.
    let expected = |a: f64, b: f64| 1000.0 * (1.0 - (1.0 / a) / (1.0 / a + 1.0 / b));
    let (corrected, q) = interface(Equations::Corrected);
    let (paper, _) = interface(Equations::Paper);
    assert!((corrected - expected(k1, k2)).abs() < 1e-7);
    assert!((paper - expected(k1 / n1, k2 / n2)).abs() < 1e-7);
    assert!((corrected - paper).abs() > 10.0);
    let series = 1000.0 / (WATER.viscosity * 0.1 * (1.0 / k1 + 1.0 / k2));
    assert!((q / series - 1.0).abs() < 1e-10);
}

#[test]
fn the_tabulated_column() {
    let table = include_str!("../../../tests/reference/two_layer_column.csv");
    let line = table.lines().nth(2).unwrap();
    let row: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
    let [n1, d1, h1, n2, d2, h2, drop, flux, interface, _] = row[..] else {
        panic!("ten columns");
    };
    let grid = grid([2, 2, 20], [0.01, 0.01, (h1 + h2) / 20.0]);
    let patches = between(
        &grid,
        2,
        Condition::Pressure { value: drop },
        Condition::Pressure { value: 0.0 },
    );
    let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-13)).unwrap();
    let lower = |c: usize| grid.cell(c)[2] < 10;
    let k: Vec<f64> = (0..grid.count())
        .map(|c| {
            if lower(c) {
                kozeny_carman(n1, d1)
            } else {
                kozeny_carman(n2, d2)
            }
        })
        .collect();
    solver.solve(still(&conductivities(&k))).unwrap();
    let (a, b) = (grid.index([0, 0, 9]), grid.index([0, 0, 10]));
    assert!((0.5 * (solver.pressure(a) + solver.pressure(b)) - interface).abs() < 1e-6);
    assert!((solver.flux(a)[2] / flux - 1.0).abs() < 1e-8);
}

#[test]
fn water_at_rest_is_at_rest() {
    let grid = grid([4, 5, 6], [0.01; 3]);
    let patches = vec![patch(&grid, 2, true, Condition::Pressure { value: 0.0 })];
    let settings = PressureSettings {
        gravity: [0.0, 0.0, -9.81],
        ..settings(1e-12)
    };
    let mut solver = solver(&grid, &Enclosure::Everything, patches, settings).unwrap();
    let mut draws = SplitMix::new(1);
    let k: Vec<f64> = (0..grid.count())
        .map(|_| 1e-9 * (0.1 + draws.uniform()))
        .collect();
    solver.solve(still(&conductivities(&k))).unwrap();
    for cell in 0..grid.count() {
        let depth = 0.06 - grid.centre(grid.cell(cell))[2];
        assert!((solver.pressure(cell) - 9810.0 * depth).abs() < 1e-9);
        assert!(solver.flux(cell).iter().all(|q| q.abs() < 1e-15));
    }
}

#[test]
fn heads_rain_and_fluxes_agree_with_pressures() {
    let grid = grid([3, 3, 10], [0.01; 3]);
    let gravity = [0.0, 0.0, -9.81];
    let k = vec![1e-10; grid.count()];
    let run = |top: Condition| {
        let patches = between(&grid, 2, Condition::Head { value: 0.0 }, top);
        let settings = PressureSettings {
            gravity,
            ..settings(1e-13)
        };
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings).unwrap();
        let report = solver.solve(still(&conductivities(&k))).unwrap();
        (solver.flux(grid.index([1, 1, 5]))[2], report, solver)
    };
    // Head 0.1 m above the outlet's over 0.1 m: gradient 1, so that the pressure is 0 throughout.
    let conductivity = 1e-10 * 1000.0 * 9.81 / WATER.viscosity;
    let (q, report, solver) = run(Condition::Head { value: 0.1 });
    assert!((q / -conductivity - 1.0).abs() < 1e-10);
    assert!((0..grid.count()).all(|c| solver.pressure(c).abs() < 1e-6));
    assert!((report.inflow / (conductivity * 9e-4) - 1.0).abs() < 1e-10);
    let (q, ..) = run(Condition::Pressure { value: 0.0 });
    assert!((q / -conductivity - 1.0).abs() < 1e-10);
    for condition in [
        Condition::Rain { rate: 2e-4 },
        Condition::Flux { value: 2e-4 },
    ] {
        let (q, report, solver) = run(condition);
        assert!((q / -2e-4 - 1.0).abs() < 1e-9);
        assert!((report.outflow / (2e-4 * 9e-4) - 1.0).abs() < 1e-10);
        let inflows = solver.patch_inflows();
        assert!(
            (inflows[1] / 1.8e-7 - 1.0).abs() < 1e-10 && (inflows[0] / -1.8e-7 - 1.0).abs() < 1e-9
        );
    }
    // Rain does not fall on a wall.
    let walls = vec![
        patch(&grid, 2, false, Condition::Head { value: 0.0 }),
        patch(&grid, 0, false, Condition::Rain { rate: 1.0 }),
    ];
    let settings = PressureSettings {
        gravity,
        ..settings(1e-12)
    };
    let open = Openness::measure(&grid, &Enclosure::Everything);
    let mut solver = Pressure::new(&open, walls, WATER, settings, &Communicator::serial()).unwrap();
    let report = solver.solve(still(&conductivities(&k))).unwrap();
    assert!(report.inflow <= 0.0);
}

#[test]
fn a_source_leaves_through_the_outlet() {
    let grid = grid([6, 5, 1], [0.01, 0.01, 1.0]);
    let patches = vec![patch(&grid, 0, true, Condition::Pressure { value: 0.0 })];
    let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-13)).unwrap();
    let n = grid.count();
    let report = solver
        .solve(Medium {
            source: Some(&vec![0.01; n]),
            ..still(&conductivities(&vec![1e-9; n]))
        })
        .unwrap();
    assert!((report.outflow / (0.01 * 30.0 * 1e-4) - 1.0).abs() < 1e-10);
}

/// Solves the same equations by dense elimination, assembled separately cell by cell.
fn dense(grid: &SeepageGrid, k: &[f64], low: f64, high: f64) -> Vec<f64> {
    let n = grid.count();
    let mut a = vec![vec![0.0; n + 1]; n];
    for i in 0..n {
        let cell = grid.cell(i);
        for axis in 0..grid.dimension {
            for up in [false, true] {
                let scale = grid.area(axis, [0; 3]) / grid.spacing[axis] / WATER.viscosity;
                let edge = if up { grid.cells[axis] - 1 } else { 0 };
                if cell[axis] == edge {
                    if axis == 0 {
                        let t = 2.0 * k[i] * scale;
                        a[i][i] += t;
                        a[i][n] += t * if up { high } else { low };
                    }
                } else {
                    let mut other = cell;
                    other[axis] = if up { cell[axis] + 1 } else { cell[axis] - 1 };
                    let j = grid.index(other);
                    let t = scale * 2.0 / (1.0 / k[i] + 1.0 / k[j]);
                    a[i][i] += t;
                    a[i][j] -= t;
                }
            }
        }
    }
    for i in 0..n {
        let pivot = a[i].clone();
        for row in a.iter_mut().skip(i + 1) {
            let f = row[i] / pivot[i];
            for (x, p) in row.iter_mut().zip(&pivot).skip(i) {
                *x -= f * p;
            }
        }
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|j| a[i][j] * x[j]).sum();
        x[i] = (a[i][n] - sum) / a[i][i];
    }
    x
}

#[test]
fn agrees_with_elimination() {
    for (cells, spacing) in [
        ([7, 6, 5], [0.01, 0.012, 0.008]),
        ([16, 13, 1], [0.01, 0.011, 1.0]),
        ([9, 6, 5], [0.01, 0.05, 0.01]),
    ] {
        let grid = grid(cells, spacing);
        let mut draws = SplitMix::new(4);
        // Four orders of magnitude from cell to cell.
        let k: Vec<f64> = (0..grid.count())
            .map(|_| 10.0_f64.powf(-12.0 + 4.0 * draws.uniform()))
            .collect();
        let patches = between(
            &grid,
            0,
            Condition::Pressure { value: 700.0 },
            Condition::Pressure { value: -50.0 },
        );
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-12)).unwrap();
        let report = solver.solve(still(&conductivities(&k))).unwrap();
        let exact = dense(&grid, &k, 700.0, -50.0);
        for (cell, p) in exact.iter().enumerate() {
            assert!(
                (solver.pressure(cell) - p).abs() < 1e-7,
                "{cell} {p} {report:?}"
            );
        }
        assert!((report.inflow / report.outflow - 1.0).abs() < 1e-9);
        assert!(report.iterations < 65, "{report:?}");
        // From the solution there is nothing left to do.
        let again = solver.solve(still(&conductivities(&k))).unwrap();
        assert!(again.iterations <= 1, "{again:?}");
    }
}

/// Checks layers of gravel in clay, whose water leaves through the clay alone: the discharge is that of
/// elimination, and proportional to the permeability of the clay once the gravel has no resistance.
#[test]
fn permeable_layers_in_tight_ground_agree_with_elimination() {
    let grid = grid([18, 11, 1], [2.0, 2.0, 1.0]);
    let patches = || {
        between(
            &grid,
            0,
            Condition::Pressure { value: 5e4 },
            Condition::Pressure { value: 0.0 },
        )
    };
    let mut discharges = Vec::new();
    for clay in [1e-12, 1e-14, 1e-16, 1e-18] {
        let soil = |index: usize| {
            let [x, y, _] = grid.cell(index);
            match (x, y) {
                (3..6 | 10..15, 2..9) => 3e-8,
                (10..16, 0..2) => 3e-10,
                _ => clay,
            }
        };
        let k: Vec<f64> = (0..grid.count()).map(soil).collect();
        let mut solver = solver(&grid, &Enclosure::Everything, patches(), settings(1e-8)).unwrap();
        let report = solver.solve(still(&conductivities(&k))).unwrap();
        let exact = dense(&grid, &k, 5e4, 0.0);
        let through = |cell: usize| 2.0 * k[cell] / WATER.viscosity * (5e4 - exact[cell]);
        let first = (0..grid.count()).filter(|cell| grid.cell(*cell)[0] == 0);
        let discharge: f64 = first.map(through).sum();
        assert!(
            (report.inflow / discharge - 1.0).abs() < 1e-4,
            "{clay}: {report:?} {discharge}"
        );
        assert!((report.inflow / report.outflow - 1.0).abs() < 1e-4);
        discharges.push(report.inflow / clay);
    }
    assert!(
        (discharges[3] / discharges[2] - 1.0).abs() < 1e-4,
        "{discharges:?}"
    );
}

#[test]
fn iterations_hardly_grow_with_the_grid() {
    let mut counts = Vec::new();
    for n in [8, 16, 32, 64] {
        let grid = grid([n; 3], [1.0 / real(n); 3]);
        let patches = between(
            &grid,
            0,
            Condition::Pressure { value: 1.0 },
            Condition::Pressure { value: 0.0 },
        );
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-10)).unwrap();
        let mut draws = SplitMix::new(9);
        let k: Vec<f64> = (0..grid.count())
            .map(|_| kozeny_carman(0.3 + 0.4 * draws.uniform(), 1e-3))
            .collect();
        counts.push(solver.solve(still(&conductivities(&k))).unwrap().iterations);
    }
    println!("iterations {counts:?}");
    assert!(counts[3] <= 2 * counts[0] && counts[3] < 40, "{counts:?}");
}

#[test]
fn a_pocket_without_outlet_is_named() {
    let grid = grid([6, 4, 4], [0.01; 3]);
    let only_flux = vec![patch(&grid, 0, false, Condition::Flux { value: 1e-3 })];
    let error = solver(&grid, &Enclosure::Everything, only_flux, settings(1e-8)).err();
    assert!(
        matches!(error, Some(SeepageError::Pocket { cells: 96, .. })),
        "{error:?}"
    );
    // A ledge that cuts the grid in two: the outlet is on the other side.
    let patches = vec![patch(&grid, 0, false, Condition::Pressure { value: 0.0 })];
    let mut open = Openness::measure(&grid, &Enclosure::Everything);
    for z in 0..4 {
        for y in 0..4 {
            let face = open.face(0, [4, y, z]);
            open.faces[0][face] = 0.0;
        }
    }
    let error = Pressure::new(
        &open,
        patches,
        WATER,
        settings(1e-8),
        &Communicator::serial(),
    )
    .err();
    let Some(SeepageError::Pocket { cells, at }) = error else {
        panic!("{error:?}");
    };
    assert_eq!(cells, 32);
    assert!((at[0] - 0.045).abs() < 1e-12);
    let nothing = Enclosure::HalfSpaces(vec![([1.0, 0.0, 0.0], -1.0)]);
    assert_eq!(
        solver(&grid, &nothing, Vec::new(), settings(1e-8)).err(),
        Some(SeepageError::NoOpenCell)
    );
}

#[test]
fn a_wedge_passes_what_enters() {
    // Between planes that close towards the outlet at the bottom, cut through cells.
    let grid = grid([12, 4, 12], [0.005, 0.01, 0.005]);
    let s = 1.0 / (1.0_f64 + 0.35 * 0.35).sqrt();
    let walls = Enclosure::HalfSpaces(vec![
        ([-s, 0.0, -0.35 * s], -0.026 * s),
        ([s, 0.0, -0.35 * s], 0.034 * s),
    ]);
    let patches = between(
        &grid,
        2,
        Condition::Pressure { value: 0.0 },
        Condition::Pressure { value: 500.0 },
    );
    let mut solver = solver(&grid, &walls, patches, settings(1e-12)).unwrap();
    let n = grid.count();
    let report = solver
        .solve(still(&conductivities(&vec![1e-10; n])))
        .unwrap();
    assert!(report.inflow > 0.0);
    assert!(
        (report.inflow / report.outflow - 1.0).abs() < 1e-9,
        "{report:?}"
    );
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let grid = grid([4, 4, 4], [0.01; 3]);
    let patches = || {
        between(
            &grid,
            0,
            Condition::Pressure { value: 1.0 },
            Condition::Pressure { value: 0.0 },
        )
    };
    let mut one = solver(&grid, &Enclosure::Everything, patches(), settings(1e-8)).unwrap();
    let mut k = vec![1e-9; 64];
    k[7] = f64::NAN;
    assert!(matches!(
        one.solve(still(&conductivities(&k))),
        Err(SeepageError::NotFinite(_))
    ));
    k[7] = 1e-9;
    let source = [f64::INFINITY; 64];
    assert!(matches!(
        one.solve(Medium {
            source: Some(&source),
            ..still(&conductivities(&k))
        }),
        Err(SeepageError::NotFinite(_))
    ));
    let tight = PressureSettings {
        iterations: 1,
        ..settings(1e-15)
    };
    let mut two = solver(&grid, &Enclosure::Everything, patches(), tight).unwrap();
    let mut draws = SplitMix::new(2);
    k.iter_mut().for_each(|k| *k *= 0.01 + draws.uniform());
    assert!(matches!(
        two.solve(still(&conductivities(&k))),
        Err(SeepageError::NotConverged { .. })
    ));
}

/// Checks the Darcy example of the manual of PFC: a box of 0.10 x 0.20 x 0.10 m, 1e-5 m3/s through the whole face y =
/// 0, an outlet of 0.02 x 0.02 m at y = 0.2 m held at zero pressure, grains of 5 mm, no gravity. The result is compared
/// with over-relaxation of the same balances, and with the exact mean gradient.
#[test]
fn a_box_with_a_small_outlet() {
    const FLOW: f64 = 1e-5;
    const OUTLET: std::ops::Range<usize> = 4..6;
    let grid = grid([10, 20, 10], [0.01; 3]);
    let outlet = PressurePatch {
        axis: 1,
        upper: true,
        from: [OUTLET.start, 0, OUTLET.start],
        to: [OUTLET.end, 20, OUTLET.end],
        condition: Condition::Pressure { value: 0.0 },
        inside: false,
    };
    let inlet = Condition::Flux {
        value: FLOW / (0.1 * 0.1),
    };
    let patches = vec![patch(&grid, 1, false, inlet), outlet];
    let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-12)).unwrap();
    let k = kozeny_carman(0.4, 5e-3);
    let n = grid.count();
    let report = solver.solve(still(&conductivities(&vec![k; n]))).unwrap();
    assert!((report.inflow / FLOW - 1.0).abs() < 1e-9, "{report:?}");
    assert!((report.outflow / FLOW - 1.0).abs() < 1e-9, "{report:?}");

    // The same flow passes every section: the mean pressure falls as in a column.
    let mean = |layer: usize| {
        let cells = (0..n).filter(|i| grid.cell(*i)[1] == layer);
        cells.map(|i| solver.pressure(i)).sum::<f64>() / 100.0
    };
    let gradient = WATER.viscosity * FLOW / (0.1 * 0.1) / k;
    for layer in 0..19 {
        let fall = (mean(layer) - mean(layer + 1)) / 0.01;
        assert!(
            (fall / gradient - 1.0).abs() < 1e-7,
            "{layer}: {fall} {gradient}"
        );
    }

    // Conductance of a face over that of all faces, 1; half a cell to the outlet, 2.
    let source = WATER.viscosity * FLOW / 100.0 / (k * 0.01);
    let mut p = vec![0.0_f64; n];
    for _ in 0..4000 {
        let mut most = 0.0_f64;
        for i in 0..n {
            let cell = grid.cell(i);
            let (mut sum, mut weight) = (0.0, 0.0);
            for axis in 0..3 {
                for up in [false, true] {
                    let mut other = cell;
                    if up && cell[axis] + 1 < grid.cells[axis] {
                        other[axis] += 1;
                    } else if !up && cell[axis] > 0 {
                        other[axis] -= 1;
                    } else {
                        continue;
                    }
                    sum += p[grid.index(other)];
                    weight += 1.0;
                }
            }
            if cell[1] == 0 {
                sum += source;
            } else if cell[1] == 19 && OUTLET.contains(&cell[0]) && OUTLET.contains(&cell[2]) {
                weight += 2.0;
            }
            let change = 1.9 * (sum / weight - p[i]);
            p[i] += change;
            most = most.max(change.abs());
        }
        if most < 1e-12 * source {
            break;
        }
    }
    let highest = p.iter().copied().fold(0.0, f64::max);
    for (i, p) in p.iter().enumerate() {
        assert!(
            (solver.pressure(i) - p).abs() < 1e-7 * highest,
            "{i}: {p} of {highest}"
        );
    }
    // The way to the small outlet costs more than the length of the box.
    let column = gradient * 0.2;
    assert!(mean(0) > 1.3 * column, "{} {column}", mean(0));
}

/// Checks open water that is up to 10⁸ times as permeable as the soil, above the soil and in a pocket within it: the
/// discharge is that of the soil.
#[test]
fn free_water_beside_soil() {
    const SOIL: f64 = 1e-11;
    let grid = grid([24, 1, 40], [0.0125, 1.0, 0.0125]);
    let water = |cell: usize| {
        let [x, _, z] = grid.cell(cell);
        z >= 30 || ((8..14).contains(&x) && (10..16).contains(&z))
    };
    let permeability = |ratio: f64| -> Vec<f64> {
        let of = |cell| if water(cell) { ratio * SOIL } else { SOIL };
        (0..grid.count()).map(of).collect()
    };
    let flow = |ratio: f64| {
        let patches = between(
            &grid,
            2,
            Condition::Pressure { value: 0.0 },
            Condition::Pressure { value: 1e4 },
        );
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-8)).unwrap();
        let report = solver
            .solve(still(&conductivities(&permeability(ratio))))
            .unwrap();
        assert!(
            (report.inflow / report.outflow - 1.0).abs() < 1e-4,
            "{ratio:e} {report:?}"
        );
        println!("{ratio:e} {report:?}");
        report.outflow
    };
    let flows = [1e3, 1e5, 1e7, 1e8].map(flow);
    println!("{flows:?}");
    for (n, next) in flows.windows(2).enumerate() {
        // The resistance of the water falls with the ratio.
        let change = (next[1] / next[0] - 1.0).abs();
        assert!(
            change < 3.0 * 10.0_f64.powi(-3 - 2 * i32::try_from(n).unwrap()).max(1e-8),
            "{n}: {change}"
        );
    }
}
