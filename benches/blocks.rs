//! Speed of the contacts of blocks: pairs per second of one thread, and a pile in the engine.
//!
//! `cargo bench --bench blocks`; words after `--` choose `pairs` or `pile`, with RAYON_NUM_THREADS=1 for one core.
//!
//! `pile [BLOCKS] [STEPS] [FILE]` (P-8): 1,000 random convex blocks of 4 cm with about 14 faces fall into a box of 0.3
//! m; after 6,000 steps of 1e-4 s (or STEPS) the contacts per second of processor time are those of the median of three
//! runs of 300 steps with all rebuilds of lists. Contacts that touch count, those with walls too, as the peer counts
//! them. FILE gets the vertices of each block of the settled pile in space (m), as JSON: `benches/peers/yade_blocks.py`
//! starts from them.
//!
//! `pairs`: each row is a shape and a model; each column what the pair remembers:
//!
//! - *cold*: nothing, as at first sight;
//! - *warm*: the last basis and point, the second block moved by a millionth of its size, as in a run;
//! - *apart*: a gap of 1 % and the axis that separated them, as most listed pairs are;
//! - *apart, cold*: the same gap without the axis.
//!
//! Contacts are shallow, 1e-4 of the size, in random orientations (boxes also face on face). The figure is the best of
//! ten rounds over 256 pairs.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use solver::dem::contact::blocks::BlockLaw;
use solver::dem::polyhedron::{
    self, BlockContactModel, BlockHistory, HalfSpace, Narrow, Placed, Polyhedron, ShapeError,
    Stiffness,
};
use solver::dem::{
    Body, Dem, DemSettings, GrainDomain, Law, Motion, PairTable, Particles, Volume, Wall, alone,
};
use solver::error::Error;
use solver::random::Stream;

/// Number of pairs of each kind.
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

fn random_rotation(draw: &mut Stream) -> Matrix3<f64> {
    let turn = direction(draw) * (6.0 * draw.uniform());
    UnitQuaternion::from_scaled_axis(turn)
        .to_rotation_matrix()
        .into_inner()
}

fn cuboid(draw: &mut Stream) -> Result<Polyhedron, ShapeError> {
    Polyhedron::cuboid(Vector3::from_fn(|_, _| 0.5 + 0.5 * draw.uniform()))
}

/// Returns twelve points on a sphere: twenty triangles.
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
        match narrow.blocks(
            &one,
            &two,
            &at,
            &BlockContactModel::Patch,
            &mut BlockHistory::default(),
        ) {
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

fn row(name: &str, pairs: &[Pair], model: &BlockContactModel) {
    let mut narrow = Narrow::default();
    let mut memories = vec![BlockHistory::default(); pairs.len()];
    let mut see = |pair: &Pair, at: &Vector3<f64>, memory: &mut BlockHistory| {
        let [one, two] = [0, 1].map(|k| Placed {
            shape: &pair.shapes[k],
            rotation: pair.rotations[k],
        });
        black_box(narrow.blocks(&one, &two, black_box(at), model, memory)).is_some()
    };
    let (cold, touching) = rate(pairs, |_, pair, _| {
        see(pair, &pair.touching, &mut BlockHistory::default())
    });
    let (warm, _) = rate(pairs, |k, pair, round| {
        let at = pair.touching * (1.0 - 1e-6 * f64::from(round % 2));
        see(pair, &at, &mut memories[k])
    });
    let (fresh, _) = rate(pairs, |_, pair, _| {
        see(pair, &pair.apart, &mut BlockHistory::default())
    });
    let mut memories = vec![BlockHistory::default(); pairs.len()];
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

/// Width of the box (m); the next constant is the size of a block in it.
const BOX: f64 = 0.30;
const SIZE: f64 = 0.04;

/// Returns a polyhedron of fourteen planes round a point, scaled to a box of 1.05 sizes.
fn random_block(seed: u64) -> Result<Polyhedron, ShapeError> {
    let mut draw = Stream::new(8, seed, 0);
    loop {
        let planes: Vec<HalfSpace> = (0..14)
            .map(|_| HalfSpace {
                normal: direction(&mut draw),
                offset: 1.0 + 0.3 * draw.uniform(),
            })
            .collect();
        // Open, or a splinter.
        let Ok(solid) = Polyhedron::from_half_spaces(&planes) else {
            continue;
        };
        let shape = &solid.shape;
        let extent = |axis: usize| {
            let along = shape
                .vertices()
                .iter()
                .map(|v| (solid.orientation * v)[axis]);
            let (low, high) = along.fold((0.0_f64, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
            1.05 * SIZE / (high - low)
        };
        let scale = Vector3::new(extent(0), extent(1), extent(2));
        if scale.max() > 2.0 * scale.min() {
            continue;
        }
        let points: Vec<Vector3<f64>> = shape
            .vertices()
            .iter()
            .map(|v| (solid.orientation * v).component_mul(&scale))
            .collect();
        return Ok(Polyhedron::from_vertices(&points)?.shape);
    }
}

fn pile(count: u32, settle: u64, file: Option<&str>) -> Result<(), Error> {
    let shapes: Vec<Polyhedron> = (0..u64::from(count))
        .map(random_block)
        .collect::<Result<_, _>>()
        .map_err(|error| Error::Internal(error.to_string()))?;
    let faces = shapes.iter().map(|s| s.half_spaces().len()).sum::<usize>();
    // Force over volume of overlap as in the peer's Young modulus of 1e8 (Pa/m here), Poisson 0.2.
    let law = polyhedron::BlockPairLaw {
        stiffness: Stiffness::PerArea {
            normal: 1e8,
            shear: 2e7,
        },
        friction: 0.5,
        normal_damping_ratio: 0.0,
        shear_damping_ratio: 0.0,
    };
    let law = Law::Blocks(BlockLaw {
        parameters: PairTable::uniform(1, law),
        model: BlockContactModel::Pressure,
        mass_damping: 0.0,
    });
    let upper = Vector3::new(BOX, BOX, 0.1 * f64::from(count.div_ceil(36)));
    let region = GrainDomain::<Volume>::closed(Vector3::zeros(), upper, SIZE);
    let mut settings = DemSettings::new(region, 1e-4, 0.002);
    settings.gravity = Vector3::z() * -9.81;
    settings.local_damping = 0.4;
    let mut walls = Wall::of_box(region.lower, upper, [true, true, false], 0);
    walls.push(Wall::new(Vector3::zeros(), Vector3::z(), 0));
    let mut dem = Dem::new(law, settings, walls)?;
    let mut particles = Particles::new();
    particles.set_shapes(shapes.clone().into())?;
    for (n, shape) in (0..).zip(&shapes) {
        let mut draw = Stream::new(9, u64::from(n), 0);
        let cell = |k: u32| (f64::from(k % 6) + 0.5) * BOX / 6.0;
        let motion = Motion {
            position: Vector3::new(
                cell(n),
                cell(n / 6),
                SIZE * (0.65 + 1.25 * f64::from(n / 36)),
            ),
            ..Motion::default()
        };
        let tilt = direction(&mut draw) * (0.34 * draw.uniform() - 0.17);
        let turn = UnitQuaternion::from_scaled_axis(tilt);
        particles.add_block(
            Body::of_block(u64::from(n), shape, 2600.0, 0),
            motion,
            n,
            turn,
        )?;
    }
    dem.advance_many(&mut particles, &alone(), settle)?;
    if let Some(file) = file {
        save(&particles, file)?;
    }
    let before = dem.statistics(&particles);
    let (mut seconds, start) = ([0.0; 3], Instant::now());
    for time in &mut seconds {
        let began = on_processor();
        dem.advance_many(&mut particles, &alone(), 300)?;
        *time = on_processor() - began;
    }
    let elapsed = start.elapsed().as_secs_f64();
    seconds.sort_by(f64::total_cmp);
    let now = dem.statistics(&particles);
    let energy: f64 = (0..particles.owned())
        .map(|k| particles.kinetic_energy(k))
        .sum();
    println!(
        "pile: {:.0} contacts/s, {:.1} us/step ({:.1} by the clock), {count} blocks of {:.1} faces, {} contacts, \
         {:.0} tested a step of {} listed, {} rebuilds, {energy:.2e} J, overlap {:.1e}",
        now.contacts as f64 * 300.0 / seconds[1],
        seconds[1] / 300.0 * 1e6,
        elapsed / 900.0 * 1e6,
        faces as f64 / f64::from(count),
        now.contacts,
        (now.tested - before.tested) as f64 / 900.0,
        now.listed,
        now.rebuilds - before.rebuilds,
        now.largest_overlap,
    );
    Ok(())
}

/// Writes the vertices of each block in its present position (m).
fn save(particles: &Particles<Volume>, file: &str) -> Result<(), Error> {
    let blocks: Vec<Vec<[f64; 3]>> = (0..particles.owned())
        .filter_map(|k| {
            let (shape, state) = particles.polyhedron(k)?;
            let at = |v: &Vector3<f64>| (particles.location(k) + state.orientation * v).into();
            Some(shape.vertices().iter().map(at).collect())
        })
        .collect();
    let text = serde_json::to_string(&blocks).map_err(|e| Error::Internal(e.to_string()))?;
    std::fs::write(file, text).map_err(|e| Error::Internal(format!("{file}: {e}")))
}

/// Returns the processor time of this thread (s).
fn on_processor() -> f64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` is a valid place for the answer.
    let status = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
    if status == 0 {
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    } else {
        0.0
    }
}

#[global_allocator]
static ALLOCATOR: solver::allocator::Allocator = solver::allocator::Allocator;

fn main() -> Result<(), Error> {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|w| !w.starts_with("--"))
        .collect();
    let chosen = |word: &str| words.is_empty() || words[0] == word;
    let number =
        |k: usize, default: u32| words.get(k).and_then(|w| w.parse().ok()).unwrap_or(default);
    if chosen("pairs") {
        pairs().map_err(|error| Error::Internal(error.to_string()))?;
    }
    if chosen("pile") {
        pile(
            number(1, 1000),
            u64::from(number(2, 6000)),
            words.get(3).map(String::as_str),
        )?;
    }
    Ok(())
}

fn pairs() -> Result<(), ShapeError> {
    println!(
        "{:32} {:>8} {:>8} {:>8} {:>12}",
        "", "cold", "warm", "apart", "apart, cold"
    );
    let (mut faces, mut boxes, mut hulls) = (Vec::new(), Vec::new(), Vec::new());
    for id in 0..PAIRS {
        let mut draw = Stream::new(31, id, 0);
        let turn = random_rotation(&mut draw);
        let two = [cuboid(&mut draw)?, cuboid(&mut draw)?];
        faces.push(approach(
            two.clone(),
            [turn; 2],
            &turn.column(0).into_owned(),
        ));
        let turns = [random_rotation(&mut draw), random_rotation(&mut draw)];
        boxes.push(approach(two, turns, &direction(&mut draw)));
        let two = [twenty(&mut draw)?, twenty(&mut draw)?];
        hulls.push(approach(two, turns, &direction(&mut draw)));
    }
    let published = BlockContactModel::Point { rounding: 1e-3 };
    for (name, pairs) in [
        ("boxes face on face", &faces),
        ("boxes any way", &boxes),
        ("20 faces any way", &hulls),
    ] {
        row(
            &format!("{name}, pressure"),
            pairs,
            &BlockContactModel::Pressure,
        );
        row(&format!("{name}, patch"), pairs, &BlockContactModel::Patch);
        row(&format!("{name}, point"), pairs, &published);
    }
    Ok(())
}
