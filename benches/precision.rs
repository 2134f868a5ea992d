//! Change of velocities by populations in f32 and by collisions in f32, compared with f64, as a table on the terminal.
//!
//! `cargo bench --bench precision -- [cells]`: flows of up to this number of cells between walls, 64 by default.
//! `roundings` is the change by collisions in f32 divided by 2^-24 and by the smaller one of the number of steps and
//! H²/(pi² nu), in which the viscosity takes the momentum away between walls that are H cells apart
//! (`src/plan/scene/rounding.rs`).

#![allow(clippy::print_stdout, reason = "a benchmark reports on the terminal")]

use decomposition::{Domain, SplitAxis};
use solver::lbm::boundary::{Patch, velocity};
use solver::lbm::collision::{Operator, bgk, mrt, trt};
use solver::lbm::error::FluidError;
use solver::lbm::fluid::{Fluid, Force, Models, Setup};
use solver::lbm::lanes::Stored;
use solver::lbm::lattice::VelocitySet;
use solver::number::whole;
use std::f64::consts::PI;

const EVERYWHERE: [[f64; 2]; 3] = [[f64::NEG_INFINITY, f64::INFINITY]; 3];

/// Largest rounding error of a number in f32, relative to the number.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// Kinds of flow, with `true` if walls bound the water.
const FLOWS: [(&str, bool); 7] = [
    ("poiseuille", true),
    ("couette", true),
    ("womersley", true),
    ("cavity", true),
    ("duct", true),
    ("shear wave", false),
    ("taylor-green", false),
];

/// Flow on a lattice.
#[derive(Clone, Copy)]
struct Flow {
    kind: &'static str,
    walls: bool,
    set: VelocitySet,
    operator: Operator,
    relaxation_time: f64,
    cells: usize,
    speed: f64,
}

impl Flow {
    fn viscosity(&self) -> f64 {
        (self.relaxation_time - 0.5) / 3.0
    }

    /// Returns the number of steps in which the viscosity dissipates the momentum.
    fn decay(&self) -> f64 {
        let length = if self.walls { PI } else { 2.0 * PI };
        (self.cells as f64 / length).powi(2) / self.viscosity()
    }

    /// Returns the number of steps, an even one.
    fn steps(&self) -> usize {
        let times = if self.walls { 3.0 } else { 1.0 };
        2 * whole(0.5 * times * self.decay())
    }

    fn setup<S: Stored>(&self, single: bool) -> Setup<S> {
        let (n, speed) = (self.cells, self.speed);
        let three = self.set != VelocitySet::D2Q9;
        let thin = if three { 4 } else { 1 };
        let pull = 8.0 * self.viscosity() * speed / (n as f64).powi(2);
        let pulled = [pull, 0.0, 0.0];
        let (cells, periodic) = match self.kind {
            "cavity" => ([n, n, if three { n } else { 1 }], [false, false, !three]),
            "duct" => ([4, n, n], [true, false, false]),
            "taylor-green" => ([n, n, thin], [true; 3]),
            "shear wave" => ([4, n, thin], [true; 3]),
            _ => ([4, n, thin], [true, false, true]),
        };
        let force = match self.kind {
            "poiseuille" | "duct" => Force::Constant(pulled),
            "womersley" => Force::Oscillating {
                mean: [0.0; 3],
                amplitude: pulled,
                period: (n as f64).powi(2) / self.viscosity() / 20.0,
                phase: 0.0,
            },
            _ => Force::None,
        };
        let lid = matches!(self.kind, "couette" | "cavity").then(|| Patch {
            name: "lid".into(),
            axis: 1,
            upper: true,
            range: EVERYWHERE,
            rule: Box::new(velocity::VelocityLinks::uniform([speed, 0.0, 0.0])) as _,
        });
        Setup {
            force,
            periodic,
            patches: lid.into_iter().collect(),
            single,
            ..Setup::new(
                Models::new(self.set, self.operator),
                self.relaxation_time,
                cells,
            )
        }
    }

    /// Returns the velocities of a plane of cells at the end.
    fn velocities<S: Stored>(&self, single: bool) -> Result<Vec<f64>, FluidError> {
        let setup = self.setup::<S>(single);
        let [nx, ny, nz] = setup.cells;
        let domain = Domain::serial(SplitAxis::X, nx, setup.periodic[0]);
        let mut fluid = Fluid::new(setup, &domain)?;
        let (k, u) = (2.0 * PI / self.cells as f64, self.speed);
        match self.kind {
            "shear wave" => {
                fluid.initialise(&|p: [f64; 3]| (0.0, [u * (k * p[1]).sin(), 0.0, 0.0]));
            }
            "taylor-green" => fluid.initialise(&|p: [f64; 3]| {
                let [x, y] = [k * p[0], k * p[1]];
                let drho = -0.75 * u * u * ((2.0 * x).cos() + (2.0 * y).cos());
                (drho, [-u * x.cos() * y.sin(), u * x.sin() * y.cos(), 0.0])
            }),
            _ => {}
        }
        for _ in 0..self.steps() / 2 {
            fluid.advance_two();
        }
        let cells = (0..nx).flat_map(|x| (0..ny).map(move |y| [x, y, nz / 2]));
        let states = cells.map(|at| fluid.state(fluid.populations().interior_cell(at)).1);
        Ok(states.flatten().collect())
    }

    /// Prints the row of the flow.
    fn report(&self, operator: &str) -> Result<(), FluidError> {
        let exact = self.velocities::<f64>(false)?;
        let top = exact.iter().fold(0.0, |top: f64, u| top.max(u.abs()));
        let change = |found: &[f64]| {
            let changes = found.iter().zip(&exact).map(|(a, b)| (a - b).abs());
            changes.fold(0.0, f64::max) / top
        };
        let stored = change(&self.velocities::<f32>(false)?);
        let single = change(&self.velocities::<f32>(true)?);
        let most = self.decay().min(self.steps() as f64);
        println!(
            "{},{operator},{},{},{},{stored:.2e},{single:.2e},{:.2}",
            self.kind,
            self.cells,
            self.relaxation_time,
            self.speed,
            single / UNIT / most
        );
        Ok(())
    }
}

fn main() -> Result<(), FluidError> {
    let most = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(64);
    if rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .is_err()
    {
        println!("# the thread pool was set before");
    }
    let trt = Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 });
    let bgk = Operator::Bgk(bgk::BgkParameters {});
    let suga = mrt::MrtParameters::default();
    let second_order = mrt::MrtParameters {
        higher: Some(1.0),
        ..suga
    };
    let operators = [
        ("D2Q9 TRT", VelocitySet::D2Q9, trt),
        ("D2Q9 BGK", VelocitySet::D2Q9, bgk),
        ("D3Q19 TRT", VelocitySet::D3Q19, trt),
        ("D3Q27 TRT", VelocitySet::D3Q27, trt),
        ("D3Q27 MRT", VelocitySet::D3Q27, Operator::Mrt(suga)),
        (
            "D3Q27 MRT higher 1",
            VelocitySet::D3Q27,
            Operator::Mrt(second_order),
        ),
    ];
    println!(
        "flow,operator,cells,tau,speed,change of f32 storage,change of f32 arithmetic,roundings"
    );
    for (kind, walls) in FLOWS {
        for (name, set, operator) in operators {
            if kind == "duct" && set == VelocitySet::D2Q9 {
                continue;
            }
            for (cells, speed) in [(16, 0.05), (32, 0.05), (32, 0.002), (64, 0.05), (128, 0.05)] {
                for relaxation_time in [0.55, 0.8, 1.5] {
                    // Three dimensions have many cells, and small viscosities many steps.
                    let broad = set != VelocitySet::D2Q9 && matches!(kind, "cavity" | "duct");
                    let long = relaxation_time < 0.8 && cells > 32;
                    if cells > most || long || broad && cells > 32 {
                        continue;
                    }
                    let flow = Flow {
                        kind,
                        walls,
                        set,
                        operator,
                        relaxation_time,
                        cells,
                        speed,
                    };
                    flow.report(name)?;
                }
            }
        }
    }
    Ok(())
}
