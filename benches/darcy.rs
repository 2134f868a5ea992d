//! Speed of the seepage solver: seconds to assemble, solve and differentiate from a cold start, compared with FiPy
//! (P-9).
//!
//! `cargo bench --bench darcy -- [CELLS] [tolerance] [repeats]`, CELLS as `6x20x6` (the fissure paper's 720, the
//! default) or `60x200x60` (720,000); with RAYON_NUM_THREADS=1 for one core. The box, porosity, permeability, boundary
//! and equations of `benches/peers/fipy_darcy.py`; as there the grid and the fields are made before the clock starts,
//! and each repeat starts from a solver that knows no pressure. The flow and the mean pressure show that both solve the
//! same problem.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]

use std::f64::consts::TAU;
use std::time::Instant;

use decomposition::Communicator;
use solver::darcy::resistance::kozeny_carman;
use solver::darcy::{
    Condition, Enclosure, Equations, Liquid, Medium, Openness, Pressure, PressurePatch,
    PressureSettings, SeepageError, SeepageGrid,
};

/// Dynamic viscosity \[Pa s\].
const VISCOSITY: f64 = 0.1;
const SIZE: [f64; 3] = [0.06, 0.2, 0.06];

/// Returns the cells along an axis whose centre is nearer than `half` to `middle`: first, one past the last.
fn window(grid: &SeepageGrid, axis: usize, middle: f64, half: f64) -> (usize, usize) {
    let near = |k: &usize| {
        let centre = (*k as f64 + 0.5) * grid.spacing[axis];
        (centre - middle).abs() < half * (1.0 - 1e-9)
    };
    let cells: Vec<usize> = (0..grid.cells[axis]).filter(near).collect();
    match (cells.first(), cells.last()) {
        (Some(&first), Some(&last)) => (first, last + 1),
        _ => (0, 0),
    }
}

fn patches(grid: &SeepageGrid) -> Vec<PressurePatch> {
    let mut all = vec![PressurePatch {
        axis: 2,
        upper: true,
        from: [0; 3],
        to: grid.cells,
        condition: Condition::Pressure { value: 1000.0 },
        inside: false,
    }];
    let x = window(grid, 0, 0.03, 0.01);
    for middle in [0.05, 0.15] {
        let y = window(grid, 1, middle, 0.02);
        all.push(PressurePatch {
            axis: 2,
            upper: false,
            from: [x.0, y.0, 0],
            to: [x.1, y.1, grid.cells[2]],
            condition: Condition::Pressure { value: 0.0 },
            inside: false,
        });
    }
    all
}

#[global_allocator]
static ALLOCATOR: solver::allocator::Allocator = solver::allocator::Allocator;

fn main() -> Result<(), SeepageError> {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let mut cells = [6, 20, 6];
    let mut numbers = Vec::new();
    for word in &words {
        let edges: Vec<usize> = word.split('x').map_while(|n| n.parse().ok()).collect();
        if let [nx, ny, nz] = edges[..] {
            cells = [nx, ny, nz];
        } else if let Ok(number) = word.parse::<f64>() {
            numbers.push(number);
        } else {
            println!("darcy: {word} is neither cells like 6x20x6 nor a number");
            return Ok(());
        }
    }
    let tolerance = numbers.first().copied().unwrap_or(1e-8);
    let repeats = numbers.get(1).copied().unwrap_or(5.0);
    let grid = SeepageGrid {
        cells,
        origin: [0.0; 3],
        spacing: std::array::from_fn(|a| SIZE[a] / cells[a] as f64),
        dimension: 3,
        ..SeepageGrid::default()
    };
    let mut conductivity = Vec::with_capacity(grid.count());
    for index in 0..grid.count() {
        let [x, y, z] = grid.centre(grid.cell(index));
        let wave = (TAU * x / SIZE[0]).sin() * (TAU * y / SIZE[1]).cos();
        let n = 0.4 + 0.05 * wave + 0.05 * (z / SIZE[2] - 0.5);
        conductivity.push(kozeny_carman(n, 1.9e-3) / (VISCOSITY * n));
    }
    let openness = Openness::measure(&grid, &Enclosure::Everything);
    let settings = PressureSettings {
        equations: Equations::Paper,
        gravity: [0.0; 3],
        tolerance,
        iterations: 500,
    };
    let liquid = Liquid {
        density: 1000.0,
        viscosity: VISCOSITY,
    };
    let mut gradient = vec![[0.0; 3]; grid.count()];
    let mut took = Vec::new();
    let mut last = None;
    let mut repeat = 0.0;
    // The first is not counted.
    while repeat <= repeats {
        let communicator = Communicator::serial();
        let mut pressure =
            Pressure::new(&openness, patches(&grid), liquid, settings, &communicator)?;
        let begin = Instant::now();
        let report = pressure.solve(Medium {
            conductivity: &conductivity,
            carried: None,
            source: None,
        })?;
        for (cell, gradient) in gradient.iter_mut().enumerate() {
            *gradient = pressure.gradient(cell);
        }
        if repeat > 0.0 {
            took.push(begin.elapsed().as_secs_f64());
        }
        repeat += 1.0;
        let mean = (0..grid.count()).map(|c| pressure.pressure(c)).sum::<f64>();
        last = Some((report, mean / grid.count() as f64));
    }
    took.sort_by(f64::total_cmp);
    if let (Some((report, mean)), Some(least), Some(most)) = (last, took.first(), took.last()) {
        println!(
            "{} cells: {:.6e} s ({least:.6e} to {most:.6e}), {} iterations, residual {:.1e}, flow {:.12e} m3/s, mean \
             pressure {mean:.6} Pa, largest gradient {:.3e} Pa/m",
            grid.count(),
            took[took.len() / 2],
            report.iterations,
            report.residual,
            report.outflow,
            gradient
                .iter()
                .flatten()
                .fold(0.0_f64, |m, g| m.max(g.abs()))
        );
    }
    Ok(())
}
