//! Speed of the fluid on a GPU and the fraction of the copy bandwidth of its memory, measured in the same run; and
//! whether a thousand steps leave the bits that the processor leaves.
//!
//! `cargo bench --bench gpu -- [cells] [words]`: a cube of that many cells along an edge (default: 320); only the rows
//! whose name, with the storage behind, has all of the words. `--speed` leaves out the bits.

#![allow(clippy::print_stdout, reason = "a benchmark reports on the terminal")]

use decomposition::{Domain, SplitAxis};
use solver::lbm::boundary::{Patch, Ramp, velocity};
use solver::lbm::collision::{Operator, bgk, mrt, trt};
use solver::lbm::error::FluidError;
use solver::lbm::fluid::{Fluid, Force, Models, Setup, kernel_exists_on_gpu};
use solver::lbm::gpu::{Device, copy_bandwidth};
use solver::lbm::lanes::Stored;
use solver::lbm::lattice::VelocitySet;
use std::time::Instant;

/// Velocity set with an operator.
struct Row {
    name: &'static str,
    set: VelocitySet,
    operator: Operator,
    forced: bool,
}

impl Row {
    fn models(&self) -> Models {
        Models::new(self.set, self.operator)
    }
}

/// Returns a box with a lid that starts to slide, periodic along the given axes.
fn setup<S: Stored>(row: &Row, cells: [usize; 3], periodic: [bool; 3], device: Device) -> Setup<S> {
    let flat = row.set.dimension() == 2;
    let axis = if flat { 1 } else { 2 };
    let ramp = Ramp {
        start: 0.0,
        end: 1.0,
        steps: 100.0,
    };
    let lid = velocity::VelocityLinks::new(Box::new(|_| [0.05, 0.0, 0.0]), ramp);
    Setup {
        force: if row.forced {
            Force::Oscillating {
                mean: [1e-6, 0.0, 0.0],
                amplitude: [0.0, 1e-6, 0.0],
                period: 37.0,
                phase: 0.2,
            }
        } else {
            Force::None
        },
        periodic: [periodic[0], periodic[1] && !flat, flat || periodic[2]],
        patches: vec![Patch {
            name: "lid".into(),
            axis,
            upper: true,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule: Box::new(lid),
        }],
        device,
        ..Setup::new(
            row.models(),
            0.6,
            if flat { [cells[0], cells[1], 1] } else { cells },
        )
    }
}

fn fluid<S: Stored>(
    row: &Row,
    cells: [usize; 3],
    periodic: [bool; 3],
    device: Device,
) -> Result<Fluid<S>, FluidError> {
    let setup = setup(row, cells, periodic, device);
    let domain = Domain::serial(SplitAxis::X, setup.cells[0], setup.periodic[0]);
    let mut fluid = Fluid::new(setup, &domain)?;
    let numbers = fluid.populations_mut().numbers_mut();
    for (n, number) in (0_u32..).zip(numbers) {
        *number = S::from_f64(f64::from(n.wrapping_mul(2_654_435_761)) * 1e-13 - 2e-4);
    }
    Ok(fluid)
}

/// Compares the bits in the cells of the processor and the GPU after a thousand steps.
fn same<S: Stored>(row: &Row, periodic: [bool; 3]) -> Result<bool, FluidError> {
    let cells = [70, 50, 45];
    let end = |device| {
        let mut fluid = fluid::<S>(row, cells, periodic, device)?;
        // Passes of either kind come first in a stretch.
        for steps in [1, 499, 500] {
            fluid.advance_many(steps)?;
        }
        fluid.fetch()?;
        let populations = fluid.populations();
        let of_cell = |cell| (0..row.set.count()).map(move |i| populations.incoming(cell, i));
        let places = populations.interior().flat_map(|(_, cell)| of_cell(cell));
        let numbers = populations.numbers();
        Ok::<_, FluidError>(
            places
                .map(|place| numbers[place].to_f64().to_bits())
                .collect::<Vec<u64>>(),
        )
    };
    let (processor, gpu) = (end(Device::Cpu)?, end(Device::Gpu)?);
    let moves = processor
        .iter()
        .any(|&bits| f64::from_bits(bits).abs() > 1e-3);
    Ok(moves && processor == gpu)
}

/// Returns the lattice updates per second, median of several stretches of steps.
fn speed<S: Stored>(row: &Row, edge: usize) -> Result<f64, FluidError> {
    let cells = if row.set.dimension() == 2 {
        [edge * 18, edge * 18, 1]
    } else {
        [edge; 3]
    };
    let mut fluid = fluid::<S>(row, cells, [false; 3], Device::Gpu)?;
    fluid.advance_many(10)?;
    let steps = 50;
    let mut seconds = Vec::new();
    for _ in 0..5 {
        let begun = Instant::now();
        fluid.advance_many(steps)?;
        seconds.push(begun.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    Ok((cells.iter().product::<usize>() as u64 * steps) as f64 / seconds[2])
}

/// Options of the command line.
struct Wanted {
    edge: usize,
    words: Vec<String>,
    bits: bool,
}

impl Wanted {
    fn of_command_line() -> Self {
        let (numbers, words): (Vec<String>, _) = std::env::args()
            .skip(1)
            .partition(|argument| argument.parse::<usize>().is_ok());
        let (flags, words): (Vec<String>, _) =
            words.into_iter().partition(|word| word.starts_with("--"));
        Self {
            edge: numbers.iter().find_map(|n| n.parse().ok()).unwrap_or(320),
            words,
            bits: !flags.iter().any(|flag| flag == "--speed"),
        }
    }
}

fn report<S: Stored>(row: &Row, wanted: &Wanted, bandwidth: f64) -> Result<(), FluidError> {
    let name = format!("{} {}", row.name, S::NAME);
    if !wanted.words.iter().all(|word| name.contains(word)) {
        return Ok(());
    }
    if !kernel_exists_on_gpu(row.models(), S::NAME, [row.forced, false]) {
        println!("{name:30} no kernel");
        return Ok(());
    }
    let edge = wanted.edge;
    let equal = !wanted.bits
        || same::<S>(row, [false; 3])?
            && same::<S>(row, [true, true, false])?
            && same::<S>(row, [true, false, false])?;
    let rate = speed::<S>(row, edge)?;
    let bytes = (2 * row.set.count() * size_of::<S>()) as f64;
    println!(
        "{name:30} {:9.0} MLUPS  {:.3} of the copy bandwidth  bits {}",
        rate / 1e6,
        rate * bytes / bandwidth,
        match (wanted.bits, equal) {
            (false, _) => "not looked at",
            (true, true) => "equal",
            (true, false) => "DIFFER",
        }
    );
    Ok(())
}

fn main() -> Result<(), FluidError> {
    let wanted = Wanted::of_command_line();
    let edge = wanted.edge;
    let (name, bandwidth) = copy_bandwidth(4 << 30)?;
    println!(
        "{name}: copy {:.0} GB/s, cubes of {edge} cells, squares of {}",
        bandwidth / 1e9,
        edge * 18
    );
    let bgk = Operator::Bgk(bgk::BgkParameters {});
    let trt = Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 });
    let suga = Operator::Mrt(mrt::MrtParameters::default());
    let second_order = Operator::Mrt(mrt::MrtParameters {
        higher: Some(1.0),
        ..mrt::MrtParameters::default()
    });
    let row = |name, set, operator, forced| Row {
        name,
        set,
        operator,
        forced,
    };
    for row in [
        row("D3Q27 TRT", VelocitySet::D3Q27, trt, false),
        row("D3Q27 TRT, force", VelocitySet::D3Q27, trt, true),
        row(
            "D3Q27 MRT, rates 1",
            VelocitySet::D3Q27,
            second_order,
            false,
        ),
        row("D3Q27 MRT", VelocitySet::D3Q27, suga, false),
        row("D3Q27 MRT, force", VelocitySet::D3Q27, suga, true),
        row(
            "D3Q27 MRT, rates 1, force",
            VelocitySet::D3Q27,
            second_order,
            true,
        ),
        row("D3Q27 BGK", VelocitySet::D3Q27, bgk, false),
        row("D3Q27 BGK, force", VelocitySet::D3Q27, bgk, true),
        row("D3Q19 TRT", VelocitySet::D3Q19, trt, false),
        row("D3Q19 TRT, force", VelocitySet::D3Q19, trt, true),
        row("D3Q19 BGK", VelocitySet::D3Q19, bgk, false),
        row("D2Q9 BGK", VelocitySet::D2Q9, bgk, false),
    ] {
        report::<f64>(&row, &wanted, bandwidth)?;
        report::<f32>(&row, &wanted, bandwidth)?;
    }
    Ok(())
}
