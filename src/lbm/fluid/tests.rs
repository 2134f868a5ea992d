use super::*;
use crate::boundary::convective_outflow::Carried;
use crate::boundary::{Ramp, Rule, convective_outflow, free_slip, pressure, velocity};
use crate::collision::{bgk, cumulant, mrt, suga, trt};
use crate::gpu::program::Program;
use crate::links::Rigid;
use crate::saturation::{CoveringBody, DEEP, SolidOperator, Weighting};
use crate::turbulence::smagorinsky::Smagorinsky;
use crate::turbulence::wale::Wale;

mod below_surface;
mod single;

const EVERYWHERE: [[f64; 2]; 3] = [[f64::NEG_INFINITY, f64::INFINITY]; 3];

fn setup(set: VelocitySet, operator: Operator, tau: f64, cells: [usize; 3]) -> Setup {
    Setup {
        periodic: [true, false, true],
        ..Setup::new(Models::new(set, operator), tau, cells)
    }
}

fn serial(axis: usize, setup: Setup) -> Fluid<f64> {
    let axes = [
        decomposition::SplitAxis::X,
        decomposition::SplitAxis::Y,
        decomposition::SplitAxis::Z,
    ];
    let domain = Domain::serial(axes[axis], setup.cells[axis], setup.periodic[axis]);
    Fluid::new(setup, &domain).unwrap()
}

fn profile(fluid: &Fluid<f64>, cells: usize) -> Vec<f64> {
    (0..cells)
        .map(|y| {
            fluid
                .state(fluid.populations().cell([1, y.cast_signed(), 0]))
                .1[0]
        })
        .collect()
}

/// Checks plane Poiseuille flow, which is exact with Λ = 3/16 at any resolution and relaxation time.
#[test]
fn poiseuille_by_body_force_is_exact_with_the_magic_parameter() {
    for (set, nz) in [
        (VelocitySet::D2Q9, 1),
        (VelocitySet::D3Q19, 3),
        (VelocitySet::D3Q27, 3),
    ] {
        for tau in [0.6, 1.1, 2.0] {
            let n = 7;
            let mut s = setup(
                set,
                Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 }),
                tau,
                [3, n, nz],
            );
            let g = 1e-6;
            s.force = Force::Constant([g, 0.0, 0.0]);
            let mut fluid = serial(0, s);
            for _ in 0..6000 {
                fluid.advance();
            }
            let nu = (tau - 0.5) / 3.0;
            for (y, u) in profile(&fluid, n).into_iter().enumerate() {
                let y = y as f64 + 0.5;
                let exact = g / (2.0 * nu) * y * (n as f64 - y);
                assert!(
                    (u - exact).abs() < 1e-11 * exact.max(1e-7) / 1e-7,
                    "{set:?} {tau} {u} {exact}"
                );
            }
        }
    }
}

/// Checks Couette flow, which is exact for any relaxation time.
#[test]
fn couette_is_exact() {
    let n = 8;
    let mut s = setup(
        VelocitySet::D2Q9,
        Operator::Bgk(bgk::BgkParameters {}),
        0.8,
        [3, n, 1],
    );
    s.patches.push(Patch {
        name: "lid".into(),
        axis: 1,
        upper: true,
        range: EVERYWHERE,
        rule: Box::new(velocity::VelocityLinks::uniform([0.01, 0.0, 0.0])),
    });
    let mut fluid = serial(1, s);
    for _ in 0..5000 {
        fluid.advance();
    }
    for (y, u) in profile(&fluid, n).into_iter().enumerate() {
        assert!((u - 0.01 * (y as f64 + 0.5) / n as f64).abs() < 1e-12);
    }
    // The wall receives mu U / H per cell (mass density one), along the flow.
    let drag = crate::quanta::from_quanta(fluid.fluxes()[1].force[0]) / 3.0;
    let exact = -0.1 * 0.01 / n as f64;
    let names: Vec<_> = fluid.boundaries().names().map(str::to_owned).collect();
    let lid = names.iter().position(|n| n == "lid").unwrap();
    let floor = names.iter().position(|n| n == "y_min").unwrap();
    let on = |k: usize| crate::quanta::from_quanta(fluid.fluxes()[k].force[0]) / 3.0;
    assert!(
        (on(lid) - exact).abs() < 1e-14 && (on(floor) + exact).abs() < 1e-14,
        "{drag}"
    );
}

/// Checks that for any axis of the rows a band of planes has the states of its cells in the order [z][y]\[x\].
#[test]
fn bands_of_planes_have_the_states_of_their_cells() {
    for (axis, cells, along) in [
        (0, [5, 3, 9], 2),
        (0, [5, 9, 3], 1),
        (1, [3, 5, 9], 2),
        (2, [3, 9, 5], 1),
    ] {
        let mut s = setup(
            VelocitySet::D3Q19,
            Operator::Bgk(bgk::BgkParameters {}),
            0.7,
            cells,
        );
        s.force = Force::Constant([1e-5, 2e-5, -1e-5]);
        let mut fluid = serial(axis, s);
        for _ in 0..3 {
            fluid.advance();
        }
        assert_eq!(fluid.populations().order()[2], along, "{cells:?}");
        let [nx, ny, nz] = cells;
        let planes = 1..nz - 1;
        let number = nx * ny * planes.len();
        let (mut density, mut velocity) = (vec![0.0; number], vec![[0.0; 3]; number]);
        fluid.band_states(
            planes.clone(),
            &mut density,
            &mut velocity,
            &mut Default::default(),
        );
        let mut n = 0;
        for z in planes {
            for y in 0..ny {
                for x in 0..nx {
                    let cell = fluid.populations().interior_cell([x, y, z]);
                    assert_eq!((density[n], velocity[n]), fluid.state(cell), "{cells:?}");
                    n += 1;
                }
            }
        }
    }
}

/// Checks that a force against a wall gives the hydrostatic pressure up to the first cell, with every operator.
#[test]
fn hydrostatic_pressure_reaches_the_walls() {
    let n = 8;
    for operator in [
        Operator::Bgk(bgk::BgkParameters {}),
        Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 }),
        Operator::Mrt(mrt::MrtParameters::default()),
        Operator::Cumulant(cumulant::CumulantParameters::default()),
    ] {
        let mut s = setup(VelocitySet::D3Q27, operator, 0.8, [2, n, 2]);
        let g = 1e-5;
        s.force = Force::Constant([2e-6, -g, 0.0]);
        let mut fluid = serial(0, s);
        for _ in 0..3000 {
            fluid.advance();
        }
        // Rows have the state of their cells, the half of the force included.
        let fast = fluid.populations().order()[2];
        let length = fluid.populations().cells()[fast];
        let mut row = Default::default();
        for (_, first) in fluid.populations().rows() {
            fluid.row_states(first, length, &mut row);
            for k in 0..length {
                let (drho, [u, v, w]) = fluid.state(first + k);
                assert_eq!([0, 1, 2, 3].map(|n| row[n][k]), [drho, u, v, w]);
            }
        }
        for y in 0..n {
            let cell = fluid.populations().cell([0, y.cast_signed(), 0]);
            let (drho, u) = fluid.state(cell);
            let exact = 3.0 * g * (0.5 * n as f64 - (y as f64 + 0.5));
            assert!(
                (drho - exact).abs() < 1e-3 * 3.0 * g && u[1].abs() < 1e-9,
                "{operator:?} {y} {drho} {exact} {u:?}"
            );
        }
    }
}

/// Computes gradients: next to walls the derivative of a parabola is exact, next to open faces that of a straight line.
#[test]
fn the_gradient_beside_faces() {
    let (cells, nu) = ([4, 8, 3], 0.1);
    let mut s = setup(
        VelocitySet::D3Q27,
        Operator::Mrt(mrt::MrtParameters::default()),
        0.5 + 3.0 * nu,
        cells,
    );
    s.models.turbulence = Some(EddyViscosity::Smagorinsky(Smagorinsky { constant: 0.17 }));
    s.patches.push(Patch {
        name: "lid".into(),
        axis: 1,
        upper: true,
        range: EVERYWHERE,
        rule: Box::new(velocity::VelocityLinks::uniform([0.02, 0.0, 0.0])),
    });
    let mut fluid = serial(0, s);
    // 0 at the floor, 0.02 at the lid.
    let slope = |y: f64| 0.02 / 8.0 + 1e-4 * (8.0 - 2.0 * y);
    let profile = |y: f64| 0.02 * y / 8.0 + 1e-4 * y * (8.0 - y);
    fluid.initialise(&|p: [f64; 3]| (0.0, [profile(p[1]), 0.0, 0.0]));
    for y in 0..8 {
        let cell = fluid.populations().cell([1, y, 1]);
        let exact = 0.17 * 0.17 * slope(y as f64 + 0.5).abs();
        let found = fluid.eddy_viscosity(cell);
        assert!((found - exact).abs() < 1e-8, "{y} {found} {exact}");
    }
}

fn swirl(p: [f64; 3]) -> (f64, [f64; 3]) {
    let (x, y) = (p[0] * 0.7, p[1] * 0.9);
    (
        1e-3 * (x + y).sin(),
        [0.02 * y.sin(), 0.03 * (x - y).cos(), 0.01 * x.sin()],
    )
}

fn every_face(periodic: [bool; 3], set: VelocitySet, cells: [usize; 3]) -> Setup {
    let mut s = setup(
        set,
        Operator::Trt(trt::TrtParameters { magic: 0.25 }),
        0.7,
        cells,
    );
    s.periodic = periodic;
    s.force = Force::Constant([1e-5, -2e-5, 0.0]);
    let patch = |axis, upper, rule: Box<dyn Rule<f64>>| Patch {
        name: format!("{axis}{upper}"),
        axis,
        upper,
        range: EVERYWHERE,
        rule,
    };
    let pressure = Ramp {
        start: 0.0,
        end: 1e-3,
        steps: 5.0,
    };
    let lid = |p: [f64; 3]| [0.0, 0.01 * p[0] / 9.0, 0.0];
    s.patches = vec![
        patch(
            0,
            false,
            Box::new(pressure::PressureLinks::new(0, pressure)),
        ),
        patch(
            0,
            true,
            Box::new(convective_outflow::ConvectiveOutflowLinks::new(
                (0, true),
                Carried::Whole,
            )),
        ),
        patch(1, true, Box::<free_slip::FreeSlipLinks>::default()),
        patch(
            2,
            true,
            Box::new(velocity::VelocityLinks::new(
                Box::new(lid),
                Ramp::constant(1.0),
            )),
        ),
        patch(2, false, Box::<free_slip::FreeSlipLinks>::default()),
    ];
    s
}

fn bits(fluid: &Fluid<f64>, cells: [usize; 3]) -> Vec<u64> {
    let mut all = Vec::new();
    for x in 0..cells[0] {
        for y in 0..cells[1] {
            for z in 0..cells[2] {
                let cell = fluid.populations().cell([x, y, z].map(usize::cast_signed));
                for i in 0..fluid.populations().velocities().q() {
                    let g = fluid.populations().numbers()[fluid.populations().incoming(cell, i)];
                    all.push(g.to_bits());
                }
            }
        }
    }
    all
}

#[test]
fn the_split_axis_does_not_change_a_bit() {
    for (set, cells, axes) in [
        (VelocitySet::D2Q9, [9, 7, 1], 2),
        (VelocitySet::D3Q19, [9, 7, 5], 3),
        (VelocitySet::D3Q27, [9, 7, 5], 3),
    ] {
        for periodic in [[false; 3], [false, true, true], [true, true, false]] {
            let mut results = Vec::new();
            for axis in 0..axes {
                let mut s = every_face(periodic, set, cells);
                if set == VelocitySet::D3Q27 {
                    s.models.collision = Operator::Mrt(mrt::MrtParameters::default());
                    s.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
                }
                let mut fluid = serial(axis, s);
                fluid.initialise(&swirl);
                for _ in 0..11 {
                    fluid.advance();
                }
                results.push(bits(&fluid, cells));
            }
            for other in &results[1..] {
                let first = results[0].iter().zip(other).position(|(a, b)| a != b);
                assert_eq!(first, None, "{set:?} {periodic:?}");
            }
            assert!(results[0].iter().all(|&b| f64::from_bits(b).is_finite()));
        }
    }
}

/// Checks that walls of inner planes are applied during the pass, and those next to the part of another thread after
/// it: with one thread per plane all of them.
#[test]
fn walls_may_be_given_early_or_late() {
    for (set, cells) in [
        (VelocitySet::D2Q9, [9, 11, 1]),
        (VelocitySet::D3Q27, [9, 11, 13]),
    ] {
        let run = |threads: usize| {
            let mut s = setup(set, Operator::Bgk(bgk::BgkParameters {}), 0.6, cells);
            s.periodic = [false; 3];
            s.patches = vec![Patch {
                name: "lid".into(),
                axis: 0,
                upper: true,
                range: EVERYWHERE,
                rule: Box::new(velocity::VelocityLinks::new(
                    Box::new(|p| [0.0, 0.01 * p[1], 0.0]),
                    Ramp {
                        start: 0.0,
                        end: 1.0,
                        steps: 20.0,
                    },
                )),
            }];
            let mut fluid = serial(1, s);
            fluid.threads = threads;
            fluid.initialise(&swirl);
            for _ in 0..11 {
                fluid.advance();
            }
            bits(&fluid, cells)
        };
        let late = run(9);
        assert!(late.iter().any(|&b| f64::from_bits(b).abs() > 1e-3));
        for threads in 1..5 {
            assert!(run(threads) == late, "{set:?}, {threads} threads");
        }
    }
}

/// Checks every kind of face with more links than one thread takes, and an eddy viscosity.
#[test]
fn threads_do_not_show() {
    const CELLS: [usize; 3] = [26, 40, 44];
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let patch = |axis, upper, rule| Patch {
                name: format!("{axis} {upper}"),
                axis,
                upper,
                range: EVERYWHERE,
                rule,
            };
            let inlet = velocity::VelocityLinks::new(
                Box::new(|p| [0.02 + 0.0002 * p[1], 0.001, 0.0]),
                Ramp {
                    start: 0.5,
                    end: 1.0,
                    steps: 5.0,
                },
            );
            let mut s = setup(
                VelocitySet::D3Q27,
                Operator::Bgk(bgk::BgkParameters {}),
                0.6,
                CELLS,
            );
            s.periodic = [false; 3];
            s.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
            s.patches = vec![
                patch(0, false, Box::new(inlet)),
                patch(
                    0,
                    true,
                    Box::new(pressure::PressureLinks::new(0, Ramp::constant(0.001))),
                ),
                patch(1, false, Box::<free_slip::FreeSlipLinks>::default()),
                patch(
                    1,
                    true,
                    Box::new(convective_outflow::ConvectiveOutflowLinks::new(
                        (1, true),
                        Carried::Whole,
                    )),
                ),
                patch(
                    2,
                    true,
                    Box::new(convective_outflow::ConvectiveOutflowLinks::new(
                        (2, true),
                        Carried::Local,
                    )),
                ),
            ];
            let mut fluid = serial(0, s);
            assert_eq!(fluid.threads, threads);
            fluid.initialise(&swirl);
            for _ in 0..8 {
                fluid.advance();
            }
            bits(&fluid, CELLS)
        })
    };
    let one = run(1);
    assert!(one.iter().any(|&b| f64::from_bits(b).abs() > 1e-3));
    for threads in [2, 3] {
        assert!(run(threads) == one, "{threads} threads");
    }
}

/// Returns a moving lid with a ramp over stationary walls, periodic along the given axes, and a force that changes.
fn lid_and_force(set: VelocitySet, cells: [usize; 3], periodic: [bool; 3]) -> Setup {
    let mut s = setup(set, Operator::Bgk(bgk::BgkParameters {}), 0.6, cells);
    s.periodic = periodic;
    s.force = Force::Oscillating {
        mean: [1e-5, 0.0, 0.0],
        amplitude: [0.0, 2e-5, 0.0],
        period: 7.0,
        phase: 0.3,
    };
    let lid = velocity::VelocityLinks::new(
        Box::new(|p| [0.02 + 0.001 * p[0], 0.0, 0.004]),
        Ramp {
            start: 0.0,
            end: 1.0,
            steps: 20.0,
        },
    );
    // Where both meet, the velocities of both act on one link.
    let inlet = velocity::VelocityLinks::uniform([0.003, 0.0, 0.0]);
    s.patches = [(0, "inlet", inlet), (1, "lid", lid)]
        .map(|(axis, name, rule)| Patch {
            name: name.into(),
            axis,
            upper: axis == 1,
            range: EVERYWHERE,
            rule: Box::new(rule) as Box<dyn Rule<f64>>,
        })
        .into();
    s
}

/// Covers cells between the parts of threads, at the ends of the slab and next to whole blocks of rows, and rows
/// with an incomplete last vector, which extends beyond their end.
#[test]
fn two_steps_in_one_sweep_are_two_steps() {
    let mut swept = 0;
    let wale = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    for (set, cells, turbulence) in [
        (VelocitySet::D2Q9, [13, 37, 1], None),
        (VelocitySet::D2Q9, [40, 19, 1], None),
        (VelocitySet::D3Q19, [11, 12, 29], None),
        (VelocitySet::D3Q27, [21, 19, 18], None),
        (VelocitySet::D3Q27, [8, 30, 17], None),
        (VelocitySet::D3Q19, [11, 38, 27], wale),
        (VelocitySet::D3Q27, [21, 19, 18], wale),
        (VelocitySet::D3Q27, [1, 37, 22], wale),
    ] {
        for periodic in [[false; 3], [true, false, false], [false, false, true]] {
            for split in 0..set.velocities().dimension {
                let run = |threads: usize, at_once: bool| {
                    let mut setup = lid_and_force(set, cells, periodic);
                    setup.models.turbulence = turbulence;
                    let mut fluid = serial(split, setup);
                    fluid.threads = threads;
                    fluid.initialise(&swirl);
                    let sweeps = fluid.may_advance_two();
                    for _ in 0..6 {
                        if at_once {
                            fluid.advance_two();
                        } else {
                            fluid.advance();
                            fluid.advance();
                        }
                    }
                    assert_eq!(fluid.steps(), 12);
                    let eddies = fluid.populations.interior().map(|(_, cell)| {
                        // The ghosts too, by the gradient.
                        fluid.eddy_viscosity(cell).to_bits()
                    });
                    let mut all = bits(&fluid, cells);
                    all.extend(eddies);
                    (sweeps, all)
                };
                let (_, steps) = run(1, false);
                assert!(steps.iter().any(|&b| f64::from_bits(b).abs() > 1e-3));
                for threads in 1..4 {
                    let (sweeps, at_once) = run(threads, true);
                    let first = steps.iter().zip(&at_once).position(|(a, b)| a != b);
                    assert_eq!(
                        first, None,
                        "{set:?} {cells:?} {periodic:?} {split} {threads}"
                    );
                    swept += usize::from(sweeps && cells[split] >= 8 * threads + 2);
                }
            }
        }
    }
    assert!(swept > 80, "{swept}");
}

/// Advances the fluid as a GPU does, on the host, with the functions of the kernels.
fn step_as_gpu(fluid: &mut Fluid<f64>) {
    let program = Program::new(&fluid.populations, &fluid.boundaries, fluid.periodic());
    let before = fluid.populations.parity();
    let force = fluid.force.force_at(fluid.step as f64);
    let numbers = fluid.populations.base();
    if let Some(cover) = &mut fluid.cover {
        cover.set_force(force, fluid.extent.periodic);
    }
    let view = fluid
        .cover
        .as_mut()
        .map_or(CoverView::NONE, CoverView::from_cover);
    // SAFETY: the slab of the program, and no other thread accesses it.
    unsafe {
        fluid
            .pass
            .pass_as_gpu(numbers, (&program, before), &view, force);
    }
    fluid.step += 1;
    for list in &program.after(before).copies {
        for copies in list.iter().rev() {
            let factor = fluid
                .boundaries
                .velocity_factor(copies.factor as usize, fluid.step as f64);
            for n in (0..copies.count()).rev() {
                // SAFETY: as above.
                unsafe { copies.copy(n, factor, numbers) };
            }
        }
    }
    fluid.populations.flip();
}

/// Checks GPU steps with any axes, with corners across two periodic axes, and for every operator with kernels.
#[test]
fn a_gpu_makes_the_same_steps() {
    let mrt = |higher| {
        Operator::Mrt(mrt::MrtParameters {
            higher,
            ..mrt::MrtParameters::default()
        })
    };
    let operators = [
        Operator::Bgk(bgk::BgkParameters {}),
        Operator::Trt(trt::TrtParameters { magic: 0.1875 }),
        mrt(None),
        mrt(Some(1.0)),
    ];
    let mut count = 0;
    for (set, cells) in [
        (VelocitySet::D2Q9, [13, 9, 1]),
        (VelocitySet::D3Q19, [7, 6, 9]),
        (VelocitySet::D3Q27, [6, 8, 5]),
        (VelocitySet::D3Q27, [1, 8, 11]),
    ] {
        for (operator, forced) in operators.iter().flat_map(|o| [(o, false), (o, true)]) {
            if operator.model().only_on().is_some_and(|only| only != set) {
                continue;
            }
            for axes in 0..8 {
                let periodic = [0, 1, 2].map(|a| axes >> a & 1 == 1);
                for split in 0..set.velocities().dimension {
                    let start = || {
                        let mut setup = lid_and_force(set, cells, periodic);
                        setup.models.collision = *operator;
                        if !forced {
                            setup.force = Force::None;
                        }
                        let mut fluid = serial(split, setup);
                        fluid.initialise(&swirl);
                        fluid
                    };
                    let (mut one, mut other) = (start(), start());
                    assert!(one.pass.kernel_on_gpu().is_some());
                    for _ in 0..5 {
                        one.advance();
                        step_as_gpu(&mut other);
                        let same = bits(&one, cells) == bits(&other, cells);
                        assert!(
                            same,
                            "{set:?} {operator:?} {periodic:?} {split} {}",
                            one.step
                        );
                    }
                    count += 1;
                }
            }
        }
    }
    assert_eq!(count, 8 * (4 * 2 + 4 * 3 + 8 * 3 * 2));
}

/// Checks cells that solids cover in part, in whole, deep inside, and several at a time, in contact and moving: the
/// same populations, and the same forces on the bodies.
#[test]
fn a_gpu_makes_the_same_steps_with_solids() {
    let mut touched = 0;
    for (set, cells) in [
        (VelocitySet::D2Q9, [13, 9, 1]),
        (VelocitySet::D3Q19, [8, 7, 9]),
        (VelocitySet::D3Q27, [6, 9, 8]),
    ] {
        let trt = Operator::Trt(trt::TrtParameters { magic: 0.1875 });
        for operator in [trt, Operator::Mrt(mrt::MrtParameters::default())] {
            if operator.model().only_on().is_some_and(|only| only != set) {
                continue;
            }
            for &solid in SolidOperator::ALL {
                if solid.model().needs_two_rates() && operator != trt {
                    continue;
                }
                let start = || {
                    let mut setup = lid_and_force(set, cells, [true, false, false]);
                    setup.models.collision = operator;
                    setup.saturation = Some(SaturationMethod {
                        operator: solid,
                        weighting: Weighting::Viscous,
                    });
                    let mut fluid = serial(0, setup);
                    fluid.initialise(&swirl);
                    put_solids(&mut fluid);
                    fluid
                };
                let (mut one, mut other) = (start(), start());
                assert!(one.pass.kernel_on_gpu().is_some());
                for _ in 0..4 {
                    one.advance();
                    step_as_gpu(&mut other);
                    assert!(
                        bits(&one, cells) == bits(&other, cells),
                        "{set:?} {solid:?}"
                    );
                    let loads = [&mut one, &mut other].map(|fluid| {
                        let mut loads = [[0_i128; 6]; 3];
                        let cover = fluid.cover.as_mut().unwrap();
                        // Each worker has sums of its own.
                        cover.collect(|slot, load| {
                            for a in 0..6 {
                                loads[slot as usize][a] += load[a];
                            }
                        });
                        loads
                    });
                    assert_eq!(loads[0], loads[1], "{set:?} {solid:?}");
                    touched += loads[0].iter().flatten().filter(|&&part| part != 0).count();
                }
            }
        }
    }
    assert!(touched > 300, "{touched}");
}

/// Adds three bodies: cells by their index in part, in whole and deep inside, every fifth cell with two of the bodies.
fn put_solids(fluid: &mut Fluid<f64>) {
    let places: Vec<_> = fluid.populations.interior().collect();
    let cover = fluid.cover.as_mut().unwrap();
    cover.make_room(3);
    for slot in 0..3_u32 {
        let x = f64::from(slot);
        let motion = Rigid {
            position: [3.2 + x, 4.1, 3.7],
            velocity: [0.01 * x, -0.004, 0.002],
            spin: [0.001, -0.002, 0.003 * x],
            radius: 3.0,
        };
        let solid = CoveringBody {
            name: (u64::from(slot), [0; 3]).into(),
            motion,
            ..CoveringBody::default()
        };
        cover.set(slot, solid);
    }
    for (n, (_, position)) in (0_u32..).zip(places) {
        let mixed = n.wrapping_mul(2_654_435_761) >> 16;
        let fraction = match mixed % 7 {
            0..=2 => 0.0,
            3 => 1.0,
            4 => DEEP,
            _ => (mixed % 97) as f32 / 97.0,
        };
        cover.cover(position, mixed % 3, fraction);
        if mixed % 5 == 0 && fraction < 1.0 {
            cover.cover(position, (mixed + 1) % 3, (1.0 - fraction) * 0.5);
        }
    }
}

/// Refuses cases without a kernel, and terms in addition to the operator that act on cells.
#[test]
fn a_gpu_refuses_what_it_does_not_run() {
    let cells = [12, 12, 12];
    let plain = || lid_and_force(VelocitySet::D3Q27, cells, [false; 3]);
    let reason = |mut setup: Setup| {
        setup.device = Device::Gpu;
        let domain = Domain::serial(decomposition::SplitAxis::X, cells[0], false);
        let refused = Fluid::new(setup, &domain).err();
        refused.map_or(String::new(), |error| error.to_string())
    };
    let mut eddies = plain();
    eddies.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    assert!(reason(eddies).contains("eddy viscosity"));
    let open = every_face([false; 3], VelocitySet::D3Q27, cells);
    assert!(reason(open).contains("openings"));
    let mut cumulants = plain();
    cumulants.models.collision = Operator::Cumulant(cumulant::CumulantParameters::default());
    assert!(reason(cumulants).contains("collision operator"));
    // A kernel that has never been run on a GPU.
    let mut other = lid_and_force(VelocitySet::D3Q19, cells, [false; 3]);
    other.saturation = Some(SaturationMethod {
        operator: SolidOperator::Superposition,
        weighting: Weighting::Viscous,
    });
    assert!(reason(other).contains("velocity set"));
    let trt = Operator::Trt(trt::TrtParameters { magic: 0.1875 });
    let exists = |set, forced, covered| {
        kernel_exists_on_gpu(Models::new(set, trt), "f64", [forced, covered])
    };
    let bgk = Operator::Bgk(bgk::BgkParameters {});
    let flat =
        |stored| kernel_exists_on_gpu(Models::new(VelocitySet::D2Q9, bgk), stored, [false; 2]);
    assert!(flat("f64") && !flat("f32"));
    assert!(exists(VelocitySet::D3Q19, true, false) && !exists(VelocitySet::D3Q19, true, true));
    assert!(exists(VelocitySet::D3Q27, true, true));
    let mut auto = plain();
    auto.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    auto.device = Device::Auto;
    assert_eq!(serial(0, auto).at_once(), 2);
}

/// Checks that an opening or a body is applied between the two steps.
#[test]
fn two_steps_are_single_ones_where_more_than_walls_acts() {
    let cells = [24, 20, 1];
    let walls = || lid_and_force(VelocitySet::D2Q9, cells, [false; 3]);
    assert!(serial(0, walls()).may_advance_two());
    let mut fluid = serial(0, walls());
    fluid.advance();
    assert!(!fluid.may_advance_two(), "between an even and an odd pass");
    let mut closed = serial(0, walls());
    closed.close(std::iter::empty());
    assert!(!closed.may_advance_two());
    let open = every_face([false; 3], VelocitySet::D2Q9, cells);
    assert!(!serial(0, open).may_advance_two());
    let mut covered = walls();
    covered.saturation = Some(SaturationMethod {
        operator: SolidOperator::BounceBackAboutSolid,
        weighting: Weighting::Viscous,
    });
    assert!(!serial(0, covered).may_advance_two());
    let mut eddies = lid_and_force(VelocitySet::D3Q27, [12, 12, 12], [false; 3]);
    eddies.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    assert!(serial(0, eddies).may_advance_two());
}

#[test]
fn every_width_of_lanes_gives_the_same_bits() {
    for set in [VelocitySet::D2Q9, VelocitySet::D3Q27] {
        for operator in [
            Operator::Bgk(bgk::BgkParameters {}),
            Operator::Trt(trt::TrtParameters { magic: 0.25 }),
            Operator::Mrt(mrt::MrtParameters::default()),
            Operator::Suga(suga::SugaParameters::default()),
            Operator::Cumulant(cumulant::CumulantParameters::default()),
        ] {
            let only_27 = operator.model().only_on().is_some();
            if set == VelocitySet::D2Q9 && only_27 {
                continue;
            }
            let cells = [9, 13, if set == VelocitySet::D2Q9 { 1 } else { 6 }];
            let mut results = Vec::new();
            for level in [Level::Scalar, Level::best()] {
                let mut s = every_face([false, true, true], set, cells);
                s.models.collision = operator;
                if operator != Operator::Bgk(bgk::BgkParameters {}) {
                    s.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
                }
                let pass = Choice::from_setup(&s, level).step();
                let mut fluid = serial(0, s);
                fluid.pass = pass;
                fluid.initialise(&swirl);
                for _ in 0..9 {
                    fluid.advance();
                }
                results.push(bits(&fluid, cells));
            }
            assert!(results[0] == results[1], "{set:?} {operator:?}");
        }
    }
}

/// Checks that the mass changes by the flux through the faces, and the momentum by this flux and the body force.
#[test]
fn fluxes_close_the_balance_of_mass_and_momentum() {
    for set in [VelocitySet::D2Q9, VelocitySet::D3Q27] {
        let cells = [9, 7, if set == VelocitySet::D2Q9 { 1 } else { 5 }];
        let mut fluid = serial(0, every_face([false; 3], set, cells));
        fluid.initialise(&swirl);
        let totals = |fluid: &Fluid<f64>| {
            let mut sum = [0.0; 4];
            for (_, cell) in fluid.populations().interior() {
                let (drho, m) = fluid.populations().moments(cell);
                sum[0] += drho;
                for a in 0..3 {
                    sum[a + 1] += m[a];
                }
            }
            sum
        };
        for _ in 0..8 {
            let before = totals(&fluid);
            fluid.advance();
            let after = totals(&fluid);
            let count = (cells[0] * cells[1] * cells[2]) as f64;
            let mut expected = before;
            for (a, f) in [1e-5, -2e-5, 0.0].into_iter().enumerate() {
                expected[a + 1] += f * count;
            }
            for flux in fluid.fluxes() {
                expected[0] -= crate::quanta::from_quanta(flux.mass);
                for a in 0..3 {
                    expected[a + 1] -= crate::quanta::from_quanta(flux.force[a]);
                }
            }
            for k in 0..4 {
                assert!(
                    (after[k] - expected[k]).abs() < 1e-13,
                    "{k} {after:?} {expected:?}"
                );
            }
        }
    }
}

/// Checks that two steps of a few cells keep the mass with every operator. The test is short enough for an
/// interpreter that checks every access to the memory.
#[test]
fn a_few_steps_of_a_few_cells_keep_the_mass() {
    for (set, depth) in [(VelocitySet::D2Q9, 1), (VelocitySet::D3Q27, 2)] {
        for operator in [
            Operator::Bgk(bgk::BgkParameters {}),
            Operator::Trt(trt::TrtParameters { magic: 0.25 }),
            Operator::Mrt(mrt::MrtParameters::default()),
            Operator::Suga(suga::SugaParameters::default()),
            Operator::Cumulant(cumulant::CumulantParameters::default()),
        ] {
            if set == VelocitySet::D2Q9 && operator.model().only_on().is_some() {
                continue;
            }
            let mut fluid = serial(0, setup(set, operator, 0.6, [4, 3, depth]));
            fluid.initialise(&swirl);
            let mass = |fluid: &Fluid<f64>| {
                let populations = fluid.populations();
                let cells = populations.interior();
                cells
                    .map(|(_, cell)| populations.moments(cell).0)
                    .sum::<f64>()
            };
            let before = mass(&fluid);
            for _ in 0..2 {
                fluid.advance();
            }
            let after = mass(&fluid);
            assert!(
                (after - before).abs() < 1e-15,
                "{set:?} {operator:?}: {before} {after}"
            );
        }
    }
}
