//! Speed of the grains: particle-steps and contacts per second of one rank.
//!
//! Peers on one core of another machine (million particle-steps/s): LAMMPS 5.3-5.9, LIGGGHTS 4.1-7.3 for packed
//! spheres; for a fair ratio run them on the same machine. `cargo bench --bench dem`, with RAYON_NUM_THREADS=1 for one
//! core.
//!
//! Words after `--` choose scenes: `discs`, `packed spheres`, `falling spheres`, `scaling` (P-12), or the path of a
//! state, a CSV file with the columns x, y, z, r in m (P-7): a name with `box` is a box of 0.2 m, periodic in x and y,
//! with a floor; one with `cloud` falls into the V of the fissure, any other rests in it. `--as-written` keeps the
//! order of the file instead of numbering grains along a curve through space as the preparation does.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Vector2, Vector3};
use solver::dem::contact::Scaled;
use solver::dem::contact::cohesive_frictional::{self, CohesiveFrictional};
use solver::dem::contact::linear::{self, Linear};
use solver::dem::{
    Body, Dem, DemSettings, FacetSurface, GrainDomain, Law, Motion, PairTable, Particles,
    PlaneSpace, Space, Volume, Wall, alone,
};
use solver::error::Error;
use solver::preparation::growth::{Packing, PackingSettings, Sizes, Stop};
use solver::preparation::numbering::curve_order;
use solver::preparation::supervision::Supervision;
use solver::random::Stream;
use solver::simulation::calibration;

const PAPER: cohesive_frictional::CohesiveFrictionalParameters =
    cohesive_frictional::CohesiveFrictionalParameters {
        linear: linear::LinearParameters {
            normal_stiffness: Scaled::PerDiameter(150e6),
            stiffness_ratio: 0.4,
            // The tangent of 20 degrees.
            friction: 0.363_970_234_266_202_36,
            normal_damping_ratio: 0.0,
            shear_damping_ratio: 0.0,
            attraction: false,
        },
        cohesion: Scaled::PerDiameter(0.506),
    };

fn report<S: Space>(
    name: &str,
    dem: &mut Dem<S>,
    particles: &mut Particles<S>,
    steps: u64,
) -> Result<(), Error> {
    dem.advance_many(particles, &alone(), steps / 5)?;
    let (mut best, mut cpu) = (f64::INFINITY, f64::INFINITY);
    let before = dem.statistics(particles);
    // The best of many short pieces: what the machine does when nothing else disturbs it. The mean, with all rebuilds
    // of lists, is what other codes report of themselves.
    let (pieces, steps) = (20, steps / 4);
    let whole = Instant::now();
    for _ in 0..pieces {
        let (start, began) = (Instant::now(), on_processor());
        dem.advance_many(particles, &alone(), steps)?;
        best = best.min(start.elapsed().as_secs_f64());
        cpu = cpu.min(on_processor() - began);
    }
    let mean = whole.elapsed().as_secs_f64() / f64::from(pieces);
    let now = dem.statistics(particles);
    let (grains, steps) = (now.owned as f64, steps as f64);
    println!(
        "{name:34} {:8.2} M particle-steps/s (mean {:.2}, {:.2} by processor time) {:8.2} M contacts/s {:9.1} us/step \
         {:7} grains {:7} contacts {:7} tested {:6} rebuilds",
        grains * steps / best / 1e6,
        grains * steps / mean / 1e6,
        grains * steps / cpu / 1e6,
        now.contacts as f64 * steps / best / 1e6,
        best / steps * 1e6,
        now.owned,
        now.contacts,
        now.active,
        now.rebuilds - before.rebuilds
    );
    Ok(())
}

/// Returns about 2,000 discs of the piping paper.
fn discs() -> PackingSettings<PlaneSpace> {
    PackingSettings {
        lower: Vector2::zeros(),
        upper: Vector2::new(10.5e-3, 7.2e-3),
        periodic: [false; 3],
        sizes: Sizes::Uniform {
            smallest: 1.5e-4,
            largest: 2.5e-4,
        },
        solid_fraction: 0.83,
        stop: Stop::Overlap(1e-6),
        seed: 1,
        density: 2650.0,
        stiffness_per_diameter: 150e6,
        friction: 0.0,
        overlap: 1e-6,
        unbalanced: 1e-2,
        limit: 5_000_000,
    }
}

fn bonded(packing: &Packing<PlaneSpace>) -> Result<(), Error> {
    let how = discs();
    let law = Law::CohesiveFrictional(CohesiveFrictional {
        parameters: PairTable::uniform(1, PAPER),
    });
    let mut particles = Particles::<PlaneSpace>::new();
    for (id, grain) in (0..).zip(&packing.grains) {
        let body = Body::uniform::<PlaneSpace>(id, grain.radius, 2650.0, 0);
        particles.insert(
            body,
            Motion {
                position: grain.position,
                ..Motion::default()
            },
        );
    }
    let limit = law.critical_time_step::<PlaneSpace>(&particles.body, 1);
    let region = GrainDomain::closed(how.lower, how.upper, 1e-4);
    let settings = DemSettings::new(region, 0.2 * limit, 2e-5);
    let walls = Wall::of_box(how.lower, how.upper, [true, true, false], 0);
    let mut dem = Dem::new(law, settings, walls)?;
    dem.bond_existing_contacts(&mut particles, &alone())?;
    // Something to carry, so that the bed is not quite still.
    particles.allocate_fluid_loads();
    for k in 0..particles.owned() {
        particles.fluid[k].force = Vector2::new(2e-7, 0.0);
    }
    report("bonded discs (piping)", &mut dem, &mut particles, 4000)
}

/// Spheres in a periodic box, packed or falling.
fn spheres(count: usize, packed: bool) -> Result<(), Error> {
    let (mut dem, mut particles) = calibration::spheres(count, packed)?;
    let name = format!(
        "{} spheres, {}",
        count,
        if packed { "packed" } else { "falling" }
    );
    report(&name, &mut dem, &mut particles, 200)
}

/// Returns the processor time of this thread (s), which excludes other work on the machine.
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

/// Returns the resident memory of this process (bytes).
fn resident() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm")
        .ok()
        .and_then(|text| text.split_whitespace().nth(1)?.parse::<f64>().ok());
    pages.unwrap_or(0.0) * 4096.0
}

fn springs(stiffness: f64, gamma: f64, mass: f64, ratio: f64) -> Law {
    Law::Linear(Linear {
        parameters: PairTable::uniform(
            1,
            linear::LinearParameters {
                normal_stiffness: Scaled::Absolute(stiffness),
                stiffness_ratio: ratio,
                friction: 0.5,
                normal_damping_ratio: 0.5 * gamma * (mass / stiffness).sqrt(),
                shear_damping_ratio: 0.0,
                attraction: false,
            },
        ),
    })
}

/// Returns the V-shaped fissure as triangles that share vertices, and planes at its ends.
fn fissure() -> Result<Vec<Wall<Volume>>, Error> {
    let half = |z: f64| 0.004 + 0.42 * (z - 0.01);
    let mut vertices = Vec::new();
    for y in [-0.05, 0.25] {
        for (x, z) in [
            (-half(0.12), 0.12),
            (-0.004, 0.01),
            (0.004, 0.01),
            (half(0.12), 0.12),
        ] {
            vertices.push(Vector3::new(x, y, z));
        }
    }
    let facets: Vec<Vec<u32>> = (0..3)
        .flat_map(|k| [vec![k, k + 1, k + 5], vec![k, k + 5, k + 4]])
        .collect();
    Ok(vec![
        Wall::new(Vector3::zeros(), Vector3::y(), 0),
        Wall::new(Vector3::new(0.0, 0.2, 0.0), -Vector3::y(), 0),
        Wall::of_surface(Arc::new(FacetSurface::new(vertices, &facets)?), 0),
    ])
}

/// Writes a state of the peers in the format in which they run it.
fn state(path: &str, as_written: bool) -> Result<(), Error> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::Io(format!("{path}: {e}")))?;
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for line in text.lines().skip(1) {
        let mut numbers = line.split(',').map_while(|word| word.parse().ok());
        let mut row = [0.0; 4];
        for (to, from) in row.iter_mut().zip(&mut numbers) {
            *to = from;
        }
        rows.push(row);
    }
    if !as_written {
        let places: Vec<Vector3<f64>> = rows
            .iter()
            .map(|row| Vector3::new(row[0], row[1], row[2]))
            .collect();
        rows = curve_order::<Volume>(&places)
            .iter()
            .map(|&k| rows[k])
            .collect();
    }
    let boxed = path.contains("box");
    let cloud = path.contains("cloud");
    let (stiffness, time_step, gamma, skin) = match (boxed, cloud) {
        (true, _) => (1e3, 1e-5, 8e3, 1.5e-4),
        (false, false) => (1e3, 3e-6, 1e4, 1e-4),
        (false, true) => (1e6, 2e-7, 3.2e5, 3e-4),
    };
    let (mut region, walls) = if boxed {
        let walls = vec![Wall::new(Vector3::zeros(), Vector3::z(), 0)];
        (
            GrainDomain::closed(Vector3::zeros(), Vector3::new(0.2, 0.2, 0.06), 0.002),
            walls,
        )
    } else {
        let lower = Vector3::new(-0.06, -0.01, 0.0);
        (
            GrainDomain::closed(lower, Vector3::new(0.06, 0.21, 0.13), 0.01),
            fissure()?,
        )
    };
    region.periodic = [boxed, boxed, false];
    let mut settings = DemSettings::new(region, time_step, skin);
    settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    let before = resident();
    let mut particles = Particles::<Volume>::new();
    let mut mass: f64 = 0.0;
    for (id, row) in (0..).zip(&rows) {
        let body = Body::uniform::<Volume>(id, row[3], 2600.0, 0);
        mass = if id == 0 {
            body.mass
        } else {
            mass.min(body.mass)
        };
        let motion = Motion {
            position: Vector3::new(row[0], row[1], row[2]),
            velocity: Vector3::new(0.0, 0.0, if cloud { -0.5 } else { 0.0 }),
            spin: Vector3::zeros(),
        };
        particles.insert(body, motion);
    }
    let mut dem = Dem::new(springs(stiffness, gamma, 0.5 * mass, 1.0), settings, walls)?;
    let name = path.rsplit('/').next().unwrap_or(path);
    report(name, &mut dem, &mut particles, 80)?;
    println!(
        "{:34} {:8.0} bytes per grain",
        "",
        (resident() - before) / particles.owned() as f64
    );
    Ok(())
}

/// Measures the cost per grain of lists and of steps against the number of grains and the ratio of sizes (P-12).
fn scaling() -> Result<(), Error> {
    for (count, ratio) in [
        (1_000_u64, 1.0),
        (10_000, 1.0),
        (100_000, 1.0),
        (1_000_000, 1.0),
        (10_000, 100.0),
        (100_000, 100.0),
        (1_000_000, 100.0),
    ] {
        // The same solid fraction for all: sizes log-uniform down from the largest, whose share of the box is bounded.
        let mut bodies = Vec::new();
        let mut filled = 0.0;
        for id in 0..count {
            let draw = Stream::new(7, id, 0).uniform();
            let radius = 1e-3
                * if ratio > 1.0 {
                    // Density of numbers as r^-3, between 1 and `ratio`.
                    (1.0 - draw * (1.0 - f64::powf(ratio, -2.0))).powf(-0.5)
                } else {
                    1.0
                };
            let body = Body::uniform::<Volume>(id, radius, 2600.0, 0);
            filled += Volume::measure(radius);
            bodies.push(body);
        }
        let length = (filled / 0.3_f64).cbrt();
        let mut region = GrainDomain::<Volume>::closed(
            Vector3::zeros(),
            Vector3::repeat(length),
            length / 100.0,
        );
        // Closed for the wide range: the largest would make ghosts of all grains near a periodic face.
        region.periodic = [ratio < 2.0; 3];
        let places: Vec<Vector3<f64>> = (0..count)
            .map(|id| {
                let mut draw = Stream::new(8, id, 0);
                Vector3::from_fn(|_, _| length * draw.uniform())
            })
            .collect();
        let mut particles = Particles::<Volume>::new();
        for (id, k) in (0..).zip(curve_order::<Volume>(&places)) {
            let motion = Motion {
                position: places[k],
                ..Motion::default()
            };
            particles.insert(Body { id, ..bodies[k] }, motion);
        }
        // Soft enough that the overlaps of the random places do nothing in a few steps.
        let settings = DemSettings::new(region, 1e-9, 1e-4);
        let mut dem = Dem::new(springs(1e-3, 0.0, 1.0, 1.0), settings, Vec::new())?;
        dem.prepare(&mut particles, &alone())?;
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            particles.set_radius(0, particles.body[0].radius);
            let start = on_processor();
            dem.prepare(&mut particles, &alone())?;
            best = best.min(on_processor() - start);
        }
        // As long for a few grains as for many.
        let steps = (400_000 / count).clamp(4, 200);
        let mut step = f64::INFINITY;
        for _ in 0..5 {
            let start = on_processor();
            dem.advance_many(&mut particles, &alone(), steps)?;
            step = step.min((on_processor() - start) / steps as f64);
        }
        let now = dem.statistics(&particles);
        let grains = count as f64;
        println!(
            "{count:8} spheres, sizes 1:{ratio:<4} lists {:7.1} ns/grain {:7.1} ns/pair, step {:7.1} ns/grain, {:5.2} \
             pairs and {:5.2} contacts per grain, {} ghosts",
            best / grains * 1e9,
            best / now.listed as f64 * 1e9,
            step / grains * 1e9,
            now.listed as f64 / grains,
            now.contacts as f64 / grains,
            now.ghosts
        );
    }
    Ok(())
}

#[global_allocator]
static ALLOCATOR: solver::allocator::Allocator = solver::allocator::Allocator;

fn main() -> Result<(), Error> {
    // Cargo adds `--bench` itself.
    let as_written = std::env::args().any(|word| word == "--as-written");
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    for path in words.iter().filter(|word| word.ends_with(".csv")) {
        state(path, as_written)?;
    }
    let words: Vec<String> = words
        .into_iter()
        .filter(|word| !word.ends_with(".csv"))
        .collect();
    if words.is_empty() && std::env::args().any(|word| word.ends_with(".csv")) {
        return Ok(());
    }
    let wanted =
        |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    if wanted("discs") {
        let start = Instant::now();
        let packing = discs().pack(&Supervision::without_requests())?;
        println!(
            "packing {:?} in {:.1} s",
            packing.report,
            start.elapsed().as_secs_f64()
        );
        bonded(&packing)?;
    }
    if wanted("packed spheres") {
        spheres(100_000, true)?;
    }
    if wanted("falling spheres") {
        spheres(100_000, false)?;
    }
    if wanted("scaling") {
        scaling()?;
    }
    Ok(())
}
