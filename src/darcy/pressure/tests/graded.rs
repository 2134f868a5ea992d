//! Cells of different widths against exact solutions and against equal cells.

use super::*;
use crate::pressure::unsaturated::Soil;
use crate::retention::Retention;
use crate::retention::gardner::Gardner;
use crate::retention::van_genuchten::VanGenuchten;
use crate::{InitialWater, TransientSettings};
use std::sync::Arc;

const G: f64 = 9.81;

/// Returns faces of cells whose widths grow by a factor to the middle of `length` and fall again.
fn faces(length: f64, cells: usize, ratio: f64) -> Arc<[f64]> {
    let widths: Vec<f64> = (0..cells)
        .map(|n| ratio.powf(real(n.min(cells - 1 - n))))
        .collect();
    let sum: f64 = widths.iter().sum();
    let mut at = 0.0;
    let inner = widths.iter().map(|width| {
        at += width * length / sum;
        at
    });
    let mut all: Vec<f64> = std::iter::once(0.0).chain(inner).collect();
    all[cells] = length;
    Arc::from(all)
}

/// Returns a plane grid of graded cells.
fn plane(cells: [usize; 2], size: [f64; 2], ratios: [f64; 2]) -> SeepageGrid {
    let of_axis = |a: usize| Some(faces(size[a], cells[a], ratios[a]));
    grid([1; 3], [1.0; 3]).with_faces([of_axis(0), of_axis(1), None])
}

/// Checks that a linear field is exact to rounding: pressures, fluxes, gradients, discharges; with a dip and without.
#[test]
fn a_linear_field_is_exact() {
    let grid = plane([14, 9], [3.0, 2.0], [1.6, 0.7]);
    let (gx, gy) = (2.0, -1.3);
    for (ratio, shear) in [([1.0, 1.0], 0.0), ([2.0, 0.5], 0.0), ([2.0, 0.5], 0.6)] {
        let [kx, ky] = ratio;
        let kxy = shear;
        let (qx, qy) = (-(kx * gx + kxy * gy), -(kxy * gx + ky * gy));
        let patches = around(&grid, |axis, upper, [x, y]| {
            if axis == 1 && upper {
                Condition::Flux { value: -qy }
            } else {
                Condition::Pressure {
                    value: 5.0 + gx * x + gy * y,
                }
            }
        });
        let open = Openness::measure(&grid, &Enclosure::Everything);
        let serial = Communicator::serial();
        let mut solver = Pressure::new(&open, patches, WATER, settings(1e-14), &serial).unwrap();
        if shear > 0.0 {
            solver = solver.with_shear(&vec![shear; grid.count()]);
        }
        solver.set_directions(&vec![[kx, ky, 1.0]; grid.count()]);
        solver.solve(still(&vec![1.0; grid.count()])).unwrap();
        let mut worst = 0.0_f64;
        for cell in 0..grid.count() {
            let [x, y, _] = grid.centre(grid.cell(cell));
            worst = worst.max((solver.pressure(cell) - (5.0 + gx * x + gy * y)).abs());
            let flux = solver.flux(cell);
            worst = worst.max((flux[0] - qx).abs()).max((flux[1] - qy).abs());
            let gradient = solver.inner_gradient(cell);
            worst = worst
                .max((gradient[0] - gx).abs())
                .max((gradient[1] - gy).abs());
        }
        let through = solver.flow_through_section(0, 5, &[0..14, 0..9, 0..1]);
        worst = worst.max((through.discharge / (2.0 * qx) - 1.0).abs());
        assert!((through.area - 2.0).abs() < 1e-12);
        println!("{ratio:?} {shear}: {worst:e}");
        assert!(worst < 1e-12, "{worst:e}");
    }
}

/// Checks that graded faces of equal cells give the flow of equal cells, in saturated and in unsaturated ground that
/// stores water.
#[test]
fn equal_widths_are_equal_cells() {
    let uniform = grid([12, 10, 1], [0.05, 0.1, 1.0]);
    let graded = plane([12, 10], [0.6, 1.0], [1.0, 1.0]);
    let run = |grid: &SeepageGrid, transient: bool| {
        let conditions = [
            Condition::Head { value: 0.2 },
            Condition::Head { value: 0.9 },
        ];
        let patches = between(grid, 0, conditions[0], conditions[1]);
        let settings = PressureSettings {
            gravity: [0.0, -G, 0.0],
            ..settings(1e-12)
        };
        let mut solver = solver(grid, &Enclosure::Everything, patches, settings).unwrap();
        if transient {
            let retention = Retention::VanGenuchten(VanGenuchten {
                alpha: 3.35,
                n: 2.0,
                saturated_content: 0.368,
                residual_content: 0.102,
                exponent: 0.5,
            });
            let volume: Vec<f64> = (0..grid.count())
                .map(|n| grid.volume(grid.cell(n)))
                .collect();
            let flow = TransientSettings {
                initial: InitialWater::PressureHead(-1.0),
                specific_storage: 0.0,
                content_error: 2e-3,
                interval: 600.0,
            };
            solver = solver
                .with_soil(Soil { retention })
                .with_transient(flow, &volume);
        }
        let k = vec![1e-5 / (1000.0 * G); grid.count()];
        solver.solve(still(&k)).unwrap();
        let pressures: Vec<f64> = (0..grid.count())
            .map(|cell| solver.pressure(cell))
            .collect();
        pressures
    };
    for transient in [false, true] {
        let (one, other) = (run(&uniform, transient), run(&graded, transient));
        let size = one.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
        for (a, b) in one.iter().zip(&other) {
            assert!((a - b).abs() < 1e-9 * size, "{transient}: {a} {b}");
        }
    }
}

/// Checks layers of any thickness in series, along each axis.
#[test]
fn layers_in_series_are_exact() {
    for axis in 0..3 {
        let widths = Arc::from([0.0, 0.1, 0.4, 0.5, 1.3, 1.7]);
        let mut graded = [None, None, None];
        graded[axis] = Some(widths);
        let grid = grid([4; 3], [0.25; 3]).with_faces(graded);
        let k: Vec<f64> = (0..grid.count())
            .map(|cell| [1.0, 20.0, 3.0, 0.2, 7.0][grid.cell(cell)[axis]])
            .collect();
        let (low, high) = (
            Condition::Pressure { value: 3.0 },
            Condition::Pressure { value: 0.0 },
        );
        let patches = between(&grid, axis, low, high);
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-13)).unwrap();
        let report = solver.solve(still(&k)).unwrap();
        let resistance = 0.1 / 1.0 + 0.3 / 20.0 + 0.1 / 3.0 + 0.8 / 0.2 + 0.4 / 7.0;
        let exact = 3.0 / resistance;
        assert!((report.inflow / exact - 1.0).abs() < 1e-11, "{axis}");
        for cell in 0..grid.count() {
            assert!((solver.flux(cell)[axis] / exact - 1.0).abs() < 1e-11);
            let gradient = solver.reduced_gradient(cell)[axis];
            assert!((gradient * k[cell] / exact + 1.0).abs() < 1e-11);
        }
        // Pressure on the face between the first two layers.
        let face = solver.face_reduced(axis, std::array::from_fn(|a| usize::from(a == axis)));
        assert!((face - (3.0 - 0.1 * exact)).abs() < 1e-11);
    }
}

/// Checks a column of Gardner's soil under rain: the flux between centres is exact in cells of any height.
#[test]
fn a_column_under_rain_is_exact() {
    let grid = grid([1, 1, 1], [1.0; 3]).with_faces([None, Some(faces(1.0, 15, 1.4)), None]);
    let rain = 1e-6;
    let patches = vec![
        patch(&grid, 1, false, Condition::Pressure { value: 0.0 }),
        patch(&grid, 1, true, Condition::Rain { rate: rain }),
    ];
    let retention = Retention::Gardner(Gardner {
        alpha: 5.0,
        saturated_content: 0.4,
        residual_content: 0.1,
    });
    let settings = PressureSettings {
        gravity: [0.0, -G, 0.0],
        ..settings(1e-12)
    };
    let solver = solver(&grid, &Enclosure::Everything, patches, settings).unwrap();
    let mut solver = solver.with_soil(Soil { retention });
    let report = solver
        .solve(still(&vec![1e-5 / (1000.0 * G); grid.count()]))
        .unwrap();
    assert!((report.outflow / rain - 1.0).abs() < 1e-9);
    for cell in 0..grid.count() {
        let height = grid.centre(grid.cell(cell))[1];
        let exact = (0.1 + 0.9 * (-5.0 * height).exp()).ln() / 5.0;
        let found = solver.pressure(cell) / (1000.0 * G);
        assert!((found - exact).abs() < 1e-8, "{height}: {found} {exact}");
    }
}

/// Prints and bounds the iterations on grids whose widths differ by up to 1:1000, along one axis and along both.
#[test]
fn iterations_hardly_grow_with_the_stretch() {
    for (cells, ratios) in [
        ([96, 64], [1.0, 1.0]),
        ([96, 64], [1.1, 1.0]),
        ([96, 64], [1.1, 1.16]),
        ([96, 64], [0.9, 1.16]),
        ([96, 64], [0.86, 0.8]),
        ([40, 64], [1.5, 1.0]),
        ([192, 128], [1.049, 1.075]),
    ] {
        let grid = plane(cells, [6.0, 4.0], ratios);
        let stretch = |a: usize| {
            let widths = (0..cells[a]).map(|n| grid.axis(a).width(n));
            widths.fold(0.0, f64::max) / grid.spacing[a]
        };
        let patches = around(&grid, |axis, upper, [x, _]| {
            if axis == 1 && upper {
                Condition::Pressure {
                    value: if x < 3.0 { 1.0 } else { 0.0 },
                }
            } else {
                Condition::NoFlow {}
            }
        });
        let mut solver = solver(&grid, &Enclosure::Everything, patches, settings(1e-10)).unwrap();
        let report = solver.solve(still(&vec![1.0; grid.count()])).unwrap();
        println!(
            "{cells:?} stretch {:.0} {:.0}: {} iterations",
            stretch(0),
            stretch(1),
            report.iterations
        );
        assert!(
            report.iterations <= 40,
            "{cells:?} {ratios:?}: {}",
            report.iterations
        );
    }
}
