//! Solid fractions of cells at a surface: what each method costs and how far it is from the truth.
//!
//! Bodies at places that no cell favours: error of ε as root mean square over the cells at the surface, error of the
//! volume, time of a cell. `cargo bench --bench solid_fraction`, on an idle core.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "a box of 41 cells"
)]
#![expect(
    clippy::unwrap_used,
    reason = "a bench stops where its bodies are wrong"
)]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Rotation3, Vector3};
use solver::coupling::solid_fraction::{
    BallInCells, BallTable, BlockTable, Form, FractionMethod, PolyhedronSurface, RowAxes, Scratch,
};
use solver::dem::polyhedron::Polyhedron;

const CENTRE: [f64; 3] = [20.37, 20.14, 20.71];
const CELLS: [usize; 3] = [41; 3];

fn all() -> impl Iterator<Item = [f64; 3]> {
    let edge = |a: usize| 0..CELLS[a];
    edge(2).flat_map(move |z| {
        edge(1).flat_map(move |y| edge(0).map(move |x| [x as f64, y as f64, z as f64]))
    })
}

/// Returns the time per cell in the fastest of five rounds, each of `rounds` calls \[ns\].
fn per_cell(cells: usize, mut work: impl FnMut() -> f64) -> f64 {
    (0..5).fold(f64::INFINITY, |best, _| {
        let start = Instant::now();
        black_box(work());
        best.min(start.elapsed().as_secs_f64() / cells as f64 * 1e9)
    })
}

fn show(name: &str, form: &Form, volume: f64) {
    let mut scratch = Scratch::default();
    let truth: Vec<f64> = all()
        .map(|cell| form.fraction(FractionMethod::Exact, cell, &mut scratch))
        .collect();
    let surface: Vec<([f64; 3], f64)> = all()
        .zip(truth.iter().copied())
        .filter(|(_, fraction)| *fraction > 0.0 && *fraction < 1.0)
        .collect();
    let count = surface.len();
    for (label, method) in [
        ("exact", FractionMethod::Exact),
        ("samples 2", FractionMethod::Samples(2)),
        ("samples 3", FractionMethod::Samples(3)),
        ("samples 5", FractionMethod::Samples(5)),
        ("samples 10", FractionMethod::Samples(10)),
        ("linear", FractionMethod::Linear),
    ] {
        let squares: f64 = surface
            .iter()
            .map(|&(cell, truth)| (form.fraction(method, cell, &mut scratch) - truth).powi(2))
            .sum();
        let sum: f64 = all()
            .map(|cell| form.fraction(method, cell, &mut scratch))
            .sum();
        let time = per_cell(surface.len(), || {
            surface
                .iter()
                .map(|&(cell, _)| form.fraction(method, cell, &mut scratch))
                .sum()
        });
        line(
            name,
            label,
            surface.len(),
            (squares / surface.len() as f64).sqrt(),
            sum / volume - 1.0,
            time,
        );
    }
    // All cells of the box of the body, as the program takes them.
    let (centre, radius) = form.bounds();
    let lower = centre.map(|x| (x - radius).floor() as i32);
    let cells: [usize; 3] =
        std::array::from_fn(|a| ((centre[a] + radius).floor() as i32 + 1 - lower[a]) as usize);
    let at_once = |time: f64| {
        let volume = truth.iter().sum::<f64>() / volume - 1.0;
        line(name, "exact, all at once", count, 0.0, volume, time);
    };
    match *form {
        Form::Ball { centre, radius } => {
            let mut table = BallTable::default();
            at_once(per_cell(count, || {
                table.fill(&BallInCells {
                    centre,
                    radius,
                    lower,
                    cells,
                    order: [0, 1, 2],
                });
                let mut sum = 0.0;
                for layer in 0..cells[0] {
                    table.layer(layer);
                    for row in 0..cells[1] {
                        sum += table.row(row, 0, cells[2]).iter().sum::<f64>();
                    }
                }
                sum
            }));
        }
        Form::Block { surface, .. } => {
            let mut table = BlockTable::default();
            let axes = RowAxes {
                lattice: [0, 1, 2],
                sums: [0, 1, 2],
            };
            at_once(per_cell(count, || {
                table.fill(surface, lower, cells, axes);
                let mut sum = 0.0;
                for layer in 0..cells[0] {
                    table.layer(surface, layer);
                    for row in 0..cells[1] {
                        sum += table.row(row, 0, cells[2]).iter().sum::<f64>();
                    }
                }
                sum
            }));
        }
        Form::Disc { .. } => {}
    }
}

fn line(name: &str, label: &str, cells: usize, rms: f64, volume: f64, time: f64) {
    println!(
        "{name:34} {label:20} {cells:6} {rms:12.1e} {:12.1e} {time:10.0}",
        volume.abs()
    );
}

fn main() {
    println!(
        "{:34} {:20} {:>6} {:>12} {:>12} {:>10}",
        "body", "method", "cells", "error, rms", "of volume", "ns a cell"
    );
    for radius in [4.0, 8.0, 16.0] {
        let volume = 4.0 / 3.0 * std::f64::consts::PI * f64::powi(radius, 3);
        show(
            &format!("ball, radius {radius}"),
            &Form::Ball {
                centre: CENTRE,
                radius,
            },
            volume,
        );
    }
    for edges in [[5.0, 6.0, 7.0], [10.0, 12.0, 14.0]] {
        let shape = Polyhedron::cuboid(Vector3::from(edges)).unwrap();
        block(&format!("cuboid {edges:?}"), &shape);
    }
    // A rounded rock: points of a spiral on a sphere.
    let points: Vec<Vector3<f64>> = (0..40)
        .map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 40.0;
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(k)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            8.0 * Vector3::new(r * cos, r * sin, z)
        })
        .collect();
    let rock = Polyhedron::from_vertices(&points).unwrap().shape;
    block(
        &format!("rock of {} faces, radius 8", rock.half_spaces().len()),
        &rock,
    );
}

fn block(name: &str, shape: &Polyhedron) {
    let turn = Rotation3::new(Vector3::new(0.3, 0.5, 0.7));
    let mut surface = PolyhedronSurface::default();
    surface.set_pose(shape, turn.matrix(), CENTRE, 1.0);
    let form = Form::Block {
        surface: &surface,
        centre: CENTRE,
        radius: shape.radius(),
    };
    show(name, &form, shape.volume());
}
