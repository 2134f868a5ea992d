//! Speed of the fluid alone: million lattice updates per second (MLUPS) and the fraction of the copy bandwidth
//! measured in the same run (P-1).
//!
//! `cargo bench --bench lbm -- [cells] [steps] [row]`: all rows, or the one of this name, such as `"D2Q9 BGK f64"`,
//! without the measurement of the bandwidth.

#![allow(clippy::print_stdout, reason = "a benchmark reports on the terminal")]

use decomposition::{Domain, SplitAxis};
use solver::lbm::boundary::{Patch, velocity};
use solver::lbm::collision::{Operator, bgk, cumulant, mrt, trt};
use solver::lbm::error::FluidError;
use solver::lbm::fluid::{Fluid, Force, Models, Setup};
use solver::lbm::lanes::Stored;
use solver::lbm::lattice::VelocitySet;
use solver::lbm::turbulence::EddyViscosity;
use solver::lbm::turbulence::wale::Wale;
use std::time::Instant;

const EVERYWHERE: [[f64; 2]; 3] = [[f64::NEG_INFINITY, f64::INFINITY]; 3];

fn lid<S: Stored>(axis: usize) -> Patch<S> {
    Patch {
        name: "lid".into(),
        axis,
        upper: true,
        range: EVERYWHERE,
        rule: Box::new(velocity::VelocityLinks::uniform([0.05, 0.0, 0.0])),
    }
}

fn measure<S: Stored>(
    set: VelocitySet,
    operator: Operator,
    force: Force,
    cells: [usize; 3],
    steps: usize,
) -> f64 {
    let mut fluid = match fluid::<S>(Models::new(set, operator), force, cells, false) {
        Ok(fluid) => fluid,
        Err(message) => {
            println!("{message}");
            return 0.0;
        }
    };
    fastest(&mut fluid, steps)
}

/// Returns the fluid of a closed box under a lid; `single` is `true` for collisions in f32.
fn fluid<S: Stored>(
    models: Models,
    force: Force,
    cells: [usize; 3],
    single: bool,
) -> Result<Fluid<S>, FluidError> {
    let setup = Setup {
        force,
        patches: vec![lid(if cells[2] == 1 { 1 } else { 2 })],
        single,
        ..Setup::new(models, 0.8, cells)
    };
    Fluid::new(setup, &Domain::serial(SplitAxis::X, cells[0], false))
}

/// Returns the time of a number of steps, two at a time \[s\].
fn seconds<S: Stored>(fluid: &mut Fluid<S>, steps: usize) -> f64 {
    let start = Instant::now();
    for _ in 0..steps / 2 {
        fluid.advance_two();
    }
    start.elapsed().as_secs_f64()
}

/// Returns the million updates per second of the fastest of three measurements.
fn fastest<S: Stored>(fluid: &mut Fluid<S>, steps: usize) -> f64 {
    seconds(fluid, 2);
    let cells = fluid.domain_cells().iter().product::<usize>();
    let best = (0..3)
        .map(|_| seconds(fluid, steps))
        .fold(f64::INFINITY, f64::min);
    (cells * (steps / 2 * 2)) as f64 / best / 1e6
}

/// Number of turns in which the three precisions of a row run.
const TURNS: usize = 9;

/// Runs the three precisions in turn and prints the medians of the ratios of their speeds.
fn precisions(
    name: &str,
    set: VelocitySet,
    operator: Operator,
    cells: [usize; 3],
    steps: usize,
) -> Result<(), FluidError> {
    let models = Models::new(set, operator);
    let mut double = fluid::<f64>(models, Force::None, cells, false)?;
    let mut stored = fluid::<f32>(models, Force::None, cells, false)?;
    let mut single = fluid::<f32>(models, Force::None, cells, true)?;
    let mut turns = Vec::new();
    for turn in 0..=TURNS {
        let times = [
            seconds(&mut double, steps),
            seconds(&mut stored, steps),
            seconds(&mut single, steps),
        ];
        // The first turn touches the memory.
        if turn > 0 {
            turns.push(times);
        }
    }
    let median = |k: usize| {
        let mut ratios: Vec<f64> = turns.iter().map(|times| times[k] / times[2]).collect();
        ratios.sort_by(f64::total_cmp);
        ratios[ratios.len() / 2]
    };
    let [to_f64, to_stored] = [0, 1].map(median);
    println!("{name:34} collisions in f32: {to_stored:.2} of f32 storage, {to_f64:.2} of f64");
    Ok(())
}

/// Returns the rate of `a ← a · s` over a large array [bytes/s], the upper bound for an in-place kernel.
fn update_in_place() -> f64 {
    let mut a = vec![1.0_f64; 64 << 20];
    (0..4)
        .map(|_| {
            let start = Instant::now();
            for x in &mut a {
                *x *= 1.000_001;
            }
            (a.len() * 16) as f64 / start.elapsed().as_secs_f64()
        })
        .fold(0.0, f64::max)
}

fn main() {
    let numbers: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let n = numbers.first().copied().unwrap_or(2400);
    let steps = numbers.get(1).copied().unwrap_or(20);
    if rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .is_err()
    {
        println!("the thread pool was set before");
    }
    let only = std::env::args().skip(1).find(|a| a.starts_with('D'));
    let bandwidth = if only.is_some() {
        f64::NAN
    } else {
        update_in_place()
    };
    println!("update in place {:.1} GB/s", bandwidth / 1e9);
    let trt = Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 });
    let force = Force::Constant([1e-6, 0.0, 0.0]);
    let show = |name: &str, measure: &dyn Fn() -> f64, bytes: f64| {
        if only.as_ref().is_some_and(|row| row != name) {
            return;
        }
        let mlups = measure();
        println!(
            "{name:34} {mlups:8.1} MLUPS  {:.2} of in-place bandwidth",
            mlups * 1e6 * bytes / bandwidth
        );
    };
    let square = [n, n, 1];
    show(
        "D2Q9 BGK f64",
        &|| {
            measure::<f64>(
                VelocitySet::D2Q9,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                square,
                steps,
            )
        },
        144.0,
    );
    show(
        "D2Q9 TRT f64",
        &|| measure::<f64>(VelocitySet::D2Q9, trt, Force::None, square, steps),
        144.0,
    );
    show(
        "D2Q9 BGK + force f64",
        &|| {
            measure::<f64>(
                VelocitySet::D2Q9,
                Operator::Bgk(bgk::BgkParameters {}),
                force,
                square,
                steps,
            )
        },
        144.0,
    );
    show(
        "D2Q9 BGK f32",
        &|| {
            measure::<f32>(
                VelocitySet::D2Q9,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                square,
                steps,
            )
        },
        72.0,
    );
    let small = [840, 400, 1];
    show(
        "D2Q9 BGK f64 840 x 400",
        &|| {
            measure::<f64>(
                VelocitySet::D2Q9,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                small,
                200,
            )
        },
        144.0,
    );
    let m = (n / 12).max(16);
    let cube = [m, m, m];
    show(
        "D3Q19 BGK f64",
        &|| {
            measure::<f64>(
                VelocitySet::D3Q19,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                cube,
                steps / 2,
            )
        },
        304.0,
    );
    show(
        "D3Q27 BGK f64",
        &|| {
            measure::<f64>(
                VelocitySet::D3Q27,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                cube,
                steps / 2,
            )
        },
        432.0,
    );
    show(
        "D3Q27 TRT f64",
        &|| measure::<f64>(VelocitySet::D3Q27, trt, Force::None, cube, steps / 2),
        432.0,
    );
    show(
        "D3Q27 BGK f32",
        &|| {
            measure::<f32>(
                VelocitySet::D3Q27,
                Operator::Bgk(bgk::BgkParameters {}),
                Force::None,
                cube,
                steps / 2,
            )
        },
        216.0,
    );
    let mrt = Operator::Mrt(mrt::MrtParameters::default());
    let with_wale = Models {
        turbulence: Some(EddyViscosity::Wale(Wale { constant: 0.5 })),
        ..Models::new(VelocitySet::D3Q27, mrt)
    };
    show(
        "D3Q27 MRT f64",
        &|| measure::<f64>(VelocitySet::D3Q27, mrt, Force::None, cube, steps / 2),
        432.0,
    );
    show(
        "D3Q27 MRT + WALE + force f64",
        &|| {
            let fluid = fluid::<f64>(with_wale, force, cube, false);
            fluid.map_or(0.0, |mut fluid| fastest(&mut fluid, steps / 2))
        },
        468.0,
    );
    show(
        "D3Q27 cumulant f64",
        &|| {
            measure::<f64>(
                VelocitySet::D3Q27,
                Operator::Cumulant(cumulant::CumulantParameters::default()),
                Force::None,
                cube,
                steps / 2,
            )
        },
        432.0,
    );
    show(
        "D3Q27 MRT f32",
        &|| measure::<f32>(VelocitySet::D3Q27, mrt, Force::None, cube, steps / 2),
        216.0,
    );
    if only.is_some() {
        return;
    }
    let second_order = Operator::Mrt(mrt::MrtParameters {
        higher: Some(1.0),
        ..mrt::MrtParameters::default()
    });
    let bgk = Operator::Bgk(bgk::BgkParameters {});
    for (name, set, operator, cells) in [
        ("D2Q9 BGK", VelocitySet::D2Q9, bgk, square),
        ("D2Q9 TRT", VelocitySet::D2Q9, trt, square),
        ("D3Q19 TRT", VelocitySet::D3Q19, trt, cube),
        ("D3Q27 TRT", VelocitySet::D3Q27, trt, cube),
        ("D3Q27 MRT", VelocitySet::D3Q27, mrt, cube),
        (
            "D3Q27 MRT, higher 1",
            VelocitySet::D3Q27,
            second_order,
            cube,
        ),
    ] {
        if let Err(message) = precisions(name, set, operator, cells, steps / 2) {
            println!("{message}");
        }
    }
}
