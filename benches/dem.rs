//! Speed of the grains: particle-steps and contacts per second of one rank.
//!
//! Peers on one core of another machine (million particle-steps/s): LAMMPS 5.3-5.9, LIGGGHTS 4.1-7.3 for packed spheres; for a
//! fair ratio run them beside this. `cargo bench --bench dem`, with RAYON_NUM_THREADS=1 for one core.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]

use std::time::Instant;

use nalgebra::{Vector2, Vector3};
use solver::dem::contact::cohesive_frictional::{self, CohesiveFrictional};
use solver::dem::contact::linear::{self, Linear};
use solver::dem::{
    Alone, Body, Components, Dem, Law, Motion, PairTable, Particles, Plane, Region, Settings,
    Space, Volume, Wall,
};
use solver::error::Error;
use solver::random::Stream;
use solver::scene::packing::{Packing, Preparation, Sizes, Stop};

const PAPER: cohesive_frictional::Parameters = cohesive_frictional::Parameters {
    normal_stiffness: 150e6,
    stiffness_per_diameter: true,
    stiffness_ratio: 0.4,
    friction_angle: 20.0,
    cohesion: 0.506,
    cohesion_per_diameter: true,
    normal_damping: 0.0,
    shear_damping: 0.0,
};

fn report<S: Space>(
    name: &str,
    dem: &mut Dem<S>,
    particles: &mut Particles<S>,
    steps: u64,
) -> Result<(), Error> {
    dem.advance_many(particles, &Alone, steps / 5)?;
    let mut best = f64::INFINITY;
    let before = dem.statistics(particles);
    // The best of many short pieces: what the machine does when nothing else disturbs it.
    let (pieces, steps) = (20, steps / 4);
    for _ in 0..pieces {
        let start = Instant::now();
        dem.advance_many(particles, &Alone, steps)?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    let now = dem.statistics(particles);
    let (grains, steps) = (now.owned as f64, steps as f64);
    println!(
        "{name:34} {:8.2} M particle-steps/s {:8.2} M contacts/s {:9.1} us/step {:7} grains {:7} contacts {:7} tested {:6} rebuilds",
        grains * steps / best / 1e6,
        now.contacts as f64 * steps / best / 1e6,
        best / steps * 1e6,
        now.owned,
        now.contacts,
        now.active,
        now.rebuilds - before.rebuilds
    );
    Ok(())
}

/// About 2,000 discs of the piping paper.
fn discs() -> Preparation<Plane> {
    Preparation {
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

fn bonded(packing: &Packing<Plane>) -> Result<(), Error> {
    let how = discs();
    let law = Law::CohesiveFrictional(CohesiveFrictional {
        parameters: PairTable::uniform(1, PAPER),
    });
    let mut particles = Particles::<Plane>::new();
    for (id, grain) in (0..).zip(&packing.grains) {
        let body = Body::uniform::<Plane>(id, grain.radius, 2650.0, 0);
        particles.insert(
            body,
            Motion {
                position: grain.position,
                ..Motion::default()
            },
        );
    }
    let limit = law.critical_time_step::<Plane>(&particles.body, 1);
    let region = Region::closed(how.lower, how.upper, 1e-4);
    let settings = Settings::new(region, 0.2 * limit, 2e-5);
    let walls = Wall::of_box(how.lower, how.upper, [true, true, false], 0);
    let mut dem = Dem::new(law, settings, walls)?;
    dem.bond_existing_contacts(&mut particles, &Alone)?;
    // Something to carry, so that the bed is not quite still.
    for k in 0..particles.owned() {
        particles.fluid[k].force = Vector2::new(2e-7, 0.0);
    }
    report("bonded discs (piping)", &mut dem, &mut particles, 4000)
}

/// Spheres in a periodic box, packed or falling.
fn spheres(count: usize, packed: bool) -> Result<(), Error> {
    let side = (count as f64).cbrt().ceil();
    let (spacing, jitter) = if packed {
        (1.985e-3, 2e-3)
    } else {
        (3e-3, 0.1)
    };
    let parameters = linear::Parameters {
        normal_stiffness: 1e5,
        stiffness_per_diameter: false,
        stiffness_ratio: 2.0 / 7.0,
        friction: 0.5,
        normal_damping: 0.3,
        shear_damping: 0.0,
        attraction: false,
    };
    let law = Law::Linear(Linear {
        parameters: PairTable::uniform(1, parameters),
    });
    let length = side * spacing;
    let mut region = Region::<Volume>::closed(
        Vector3::zeros(),
        Vector3::new(length, length, length),
        spacing,
    );
    region.periodic = [true; 3];
    let mut particles = Particles::<Volume>::new();
    for n in 0..count {
        let mut draw = Stream::new(1, n as u64, 0);
        let mut motion = Motion::<Volume>::default();
        let cell = [
            n as f64 % side,
            (n as f64 / side).floor() % side,
            (n as f64 / side / side).floor(),
        ];
        for (axis, cell) in cell.into_iter().enumerate() {
            motion.position.set(
                axis,
                (cell + 0.5 + jitter * (draw.uniform() - 0.5)) * spacing,
            );
            motion.velocity.set(axis, 0.02 * (draw.uniform() - 0.5));
        }
        particles.insert(Body::uniform::<Volume>(n as u64, 1e-3, 2600.0, 0), motion);
    }
    let mut settings = Settings::new(region, 1e-6, if packed { 1e-4 } else { 5e-4 });
    if !packed {
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    }
    let mut dem = Dem::new(law, settings, Vec::new())?;
    let name = format!(
        "{} spheres, {}",
        count,
        if packed { "packed" } else { "falling" }
    );
    report(&name, &mut dem, &mut particles, 200)
}

fn main() -> Result<(), Error> {
    // Words after `--` choose scenes; cargo adds `--bench` itself.
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let wanted =
        |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    if wanted("discs") {
        let start = Instant::now();
        let packing = discs().pack()?;
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
    Ok(())
}
