//! Speed of the contacts of blocks: pairs per second of one thread.
//!
//! `cargo bench --bench blocks`. Each row is a shape and a model; each column what the pair remembers:
//!
//! - *cold*: nothing, as at first sight;
//! - *warm*: the last basis and point, the second block moved by a millionth of its size, as in a run;
//! - *apart*: a gap of 1 % and the axis that separated them, as most listed pairs are;
//! - *apart, cold*: the same gap without the axis.
//!
//! Contacts are shallow, 1e-4 of the size, in random attitudes (boxes also face on face). The figure is the best of ten rounds
//! over 256 pairs.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use solver::dem::polyhedron::{Memory, Model, Narrow, Placed, Polyhedron, ShapeError};
use solver::random::Stream;

/// How many pairs of each kind.
const PAIRS: u64 = 256;

struct Pair {
    shapes: [Polyhedron; 2],
    rotations: [Matrix3<f64>; 2],
    touching: Vector3<f64>,
    apart: Vector3<f64>,
}

fn direction(draw: &mut Stream) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| 2.0 * draw.uniform() - 1.0);
        if (0.01..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

fn attitude(draw: &mut Stream) -> Matrix3<f64> {
    let turn = direction(draw) * (6.0 * draw.uniform());
    UnitQuaternion::from_scaled_axis(turn)
        .to_rotation_matrix()
        .into_inner()
}

fn cuboid(draw: &mut Stream) -> Result<Polyhedron, ShapeError> {
    Polyhedron::cuboid(Vector3::from_fn(|_, _| 0.5 + 0.5 * draw.uniform()))
}

/// Twelve points on a sphere: twenty triangles.
fn twenty(draw: &mut Stream) -> Result<Polyhedron, ShapeError> {
    let points: Vec<Vector3<f64>> = (0..12).map(|_| direction(draw) * 0.6).collect();
    Ok(Polyhedron::from_vertices(&points)?.shape)
}

/// Brings two blocks together along a direction until they touch by 1e-4, and apart by 1e-2.
fn approach(shapes: [Polyhedron; 2], rotations: [Matrix3<f64>; 2], along: &Vector3<f64>) -> Pair {
    let mut narrow = Narrow::default();
    let (mut inside, mut outside) = (0.0, shapes[0].radius() + shapes[1].radius());
    for _ in 0..50 {
        let middle = 0.5 * (inside + outside);
        let [one, two] = [0, 1].map(|k| Placed {
            shape: &shapes[k],
            rotation: rotations[k],
        });
        let at = along * middle;
        match narrow.blocks(&one, &two, &at, &Model::Patch, &mut Memory::default()) {
            Some(_) => inside = middle,
            None => outside = middle,
        }
    }
    Pair {
        shapes,
        rotations,
        touching: along * (inside - 1e-4),
        apart: along * (inside + 1e-2),
    }
}

/// Pairs per second over all pairs, the best of ten rounds, and how many touch.
fn rate(pairs: &[Pair], mut look: impl FnMut(usize, &Pair, u32) -> bool) -> (f64, usize) {
    let (mut best, mut touching) = (f64::INFINITY, 0);
    for round in 0..10 {
        let start = Instant::now();
        touching = pairs
            .iter()
            .enumerate()
            .filter(|(k, pair)| look(*k, pair, round))
            .count();
        best = best.min(start.elapsed().as_secs_f64());
    }
    (pairs.len() as f64 / best, touching)
}

fn row(name: &str, pairs: &[Pair], model: &Model) {
    let mut narrow = Narrow::default();
    let mut memories = vec![Memory::default(); pairs.len()];
    let mut see = |pair: &Pair, at: &Vector3<f64>, memory: &mut Memory| {
        let [one, two] = [0, 1].map(|k| Placed {
            shape: &pair.shapes[k],
            rotation: pair.rotations[k],
        });
        black_box(narrow.blocks(&one, &two, black_box(at), model, memory)).is_some()
    };
    let (cold, touching) = rate(pairs, |_, pair, _| {
        see(pair, &pair.touching, &mut Memory::default())
    });
    let (warm, _) = rate(pairs, |k, pair, round| {
        let at = pair.touching * (1.0 - 1e-6 * f64::from(round % 2));
        see(pair, &at, &mut memories[k])
    });
    let (fresh, _) = rate(pairs, |_, pair, _| {
        see(pair, &pair.apart, &mut Memory::default())
    });
    let mut memories = vec![Memory::default(); pairs.len()];
    let (apart, _) = rate(pairs, |k, pair, _| see(pair, &pair.apart, &mut memories[k]));
    println!(
        "{name:32} {:8.3} {:8.3} {:8.3} {:12.3} M pairs/s, {touching} of {} touch",
        cold / 1e6,
        warm / 1e6,
        apart / 1e6,
        fresh / 1e6,
        pairs.len()
    );
}

fn main() -> Result<(), ShapeError> {
    println!(
        "{:32} {:>8} {:>8} {:>8} {:>12}",
        "", "cold", "warm", "apart", "apart, cold"
    );
    let (mut faces, mut boxes, mut hulls) = (Vec::new(), Vec::new(), Vec::new());
    for id in 0..PAIRS {
        let mut draw = Stream::new(31, id, 0);
        let turn = attitude(&mut draw);
        let two = [cuboid(&mut draw)?, cuboid(&mut draw)?];
        faces.push(approach(
            two.clone(),
            [turn; 2],
            &turn.column(0).into_owned(),
        ));
        let turns = [attitude(&mut draw), attitude(&mut draw)];
        boxes.push(approach(two, turns, &direction(&mut draw)));
        let two = [twenty(&mut draw)?, twenty(&mut draw)?];
        hulls.push(approach(two, turns, &direction(&mut draw)));
    }
    let published = Model::Point { rounding: 1e-3 };
    for (name, pairs) in [
        ("boxes face on face", &faces),
        ("boxes any way", &boxes),
        ("20 faces any way", &hulls),
    ] {
        row(&format!("{name}, patch"), pairs, &Model::Patch);
        row(&format!("{name}, point"), pairs, &published);
    }
    Ok(())
}
