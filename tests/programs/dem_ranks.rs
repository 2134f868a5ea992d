//! A hash of the grains after some thousand steps, one line for each scene of `mpirun -n N dem_ranks AXIS
//! SCENE...`.
//!
//! Scenes: colliding discs, a periodic box, breaking bonds, a disc wider than a slab, and falling blocks.
//! `tests/dem_ranks.rs` compares the hashes of several numbers of ranks and split directions.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the hash is what the program is for"
)]

use std::process::ExitCode;

use decomposition::{Communicator, Domain, Slabs, SplitAxis, StateHash, World, field_key};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use solver::dem::contact::Scaled;
use solver::dem::contact::blocks::BlockLaw;
use solver::dem::contact::cohesive_frictional::{self, CohesiveFrictional};
use solver::dem::contact::linear;
use solver::dem::polyhedron::{self, BlockContactModel, Polyhedron, Stiffness};
use solver::dem::state::{NamedColumns, Values};
use solver::dem::{
    Body, Dem, DemSettings, GrainDomain, Law, Motion, PairTable, Particles, PlaneSpace, Space,
    Volume, Wall,
};
use solver::error::Error;
use solver::random::Stream;

type Grains = Vec<(Body, Motion<PlaneSpace>)>;

fn scene(name: &str) -> Result<(Dem<PlaneSpace>, Grains), Error> {
    let mut region =
        GrainDomain::<PlaneSpace>::closed(Vector2::zeros(), Vector2::new(0.04, 0.03), 1e-3);
    region.periodic[0] = name == "periodic";
    let mut settings = DemSettings::new(region, 2e-6, 3e-4);
    settings.gravity = Vector2::new(2.0, -9.81);
    settings.ghost_margin = 1e-3;
    let walls = Wall::of_box(
        region.lower,
        region.upper,
        [!region.periodic[0], true, false],
        0,
    );
    let parameters = cohesive_frictional::CohesiveFrictionalParameters {
        linear: linear::LinearParameters {
            normal_stiffness: Scaled::Absolute(5e5),
            stiffness_ratio: 0.4,
            friction: 20.0_f64.to_radians().tan(),
            normal_damping_ratio: 0.05,
            shear_damping_ratio: 0.05,
            attraction: false,
        },
        cohesion: Scaled::Absolute(if name == "bonded" { 0.5 } else { 0.0 }),
    };
    let law = Law::CohesiveFrictional(CohesiveFrictional {
        parameters: PairTable::uniform(1, parameters),
    });
    let hole = if name == "giant" { 0.0082 } else { 0.0 };
    let mut grains = Vec::new();
    for n in 0..14 * 19_u32 {
        let mut draw = Stream::new(5, u64::from(n), 0);
        let position = Vector2::new(
            0.0011 + 0.002 * f64::from(n % 19),
            0.0011 + 0.00199 * f64::from(n / 19),
        );
        if (position - Vector2::new(0.02, 0.014)).norm() < hole + 0.0011 {
            continue;
        }
        let id = u64::from(n) * 131 % 997;
        let radius = 0.00099 + 3e-5 * draw.uniform();
        let velocity = Vector2::new(draw.uniform() - 0.3, draw.uniform() - 0.5) * 2.0;
        let spin = 100.0 * (draw.uniform() - 0.5);
        grains.push((
            Body::uniform::<PlaneSpace>(id, radius, 2600.0, 0),
            Motion {
                position,
                velocity,
                spin,
            },
        ));
    }
    if name == "giant" {
        let position = Vector2::new(0.02, 0.014);
        let motion = Motion {
            position,
            ..Motion::default()
        };
        grains.push((Body::uniform::<PlaneSpace>(5000, 0.008, 2600.0, 0), motion));
    }
    Ok((Dem::new(law, settings, walls)?, grains))
}

/// Returns boxes of many proportions above a block wider than a slab, restricted to boxes for which `mine` is `true`.
fn blocks(mine: impl Fn(u64) -> bool) -> Result<(Dem<Volume>, Particles<Volume>), Error> {
    let upper = Vector3::new(0.24, 0.24, 0.4);
    let region = GrainDomain::<Volume>::closed(Vector3::zeros(), upper, 0.01);
    let mut settings = DemSettings::new(region, 1e-4, 4e-3);
    settings.gravity = Vector3::new(1.0, 0.0, -9.81);
    let law = polyhedron::BlockPairLaw {
        stiffness: Stiffness::PerArea {
            normal: 1e8,
            shear: 5e7,
        },
        friction: 0.5,
        normal_damping_ratio: 0.1,
        shear_damping_ratio: 0.1,
    };
    let law = Law::Blocks(BlockLaw {
        parameters: PairTable::uniform(1, law),
        model: BlockContactModel::Patch,
        mass_damping: 0.0,
    });
    let walls = Wall::of_box(region.lower, region.upper, [true; 3], 0);
    let dem = Dem::new(law, settings, walls)?;
    let cuboid = |edges: Vector3<f64>| {
        Polyhedron::cuboid(edges).map_err(|error| Error::Internal(error.to_string()))
    };
    let mut shapes = vec![cuboid(Vector3::repeat(0.1))?];
    for n in 0..5 {
        let mut draw = Stream::new(6, n, 0);
        shapes.push(cuboid(Vector3::from_fn(|_, _| {
            0.016 + 0.022 * draw.uniform()
        }))?);
    }
    let mut particles = Particles::new();
    particles.set_shapes(shapes.clone().into())?;
    for n in 0..=48_u32 {
        let mut draw = Stream::new(7, u64::from(n), 0);
        let mut random = || Vector3::from_fn(|_, _| draw.uniform() - 0.5);
        let (shape, position) = if n == 48 {
            (0, Vector3::new(0.12, 0.12, 0.09))
        } else {
            let place = Vector3::new(
                0.03 + 0.06 * f64::from(n % 4),
                0.03 + 0.06 * f64::from(n / 4 % 4),
                0.2 + 0.05 * f64::from(n / 16),
            );
            (1 + n % 5, place)
        };
        let motion = Motion {
            position,
            velocity: random() - Vector3::z() * 2.0,
            spin: random() * 20.0,
        };
        let turn = UnitQuaternion::from_scaled_axis(random() * 6.0);
        let id = u64::from(n) * 131 % 997;
        if mine(id) {
            let body = Body::of_block(id, &shapes[shape as usize], 2600.0, 0);
            particles.add_block(body, motion, shape, turn)?;
        }
    }
    Ok((dem, particles))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the two halves of 128 bits"
)]
fn halves(value: u128) -> [u64; 2] {
    [value as u64, (value >> 64) as u64]
}

/// Adds the rows of a table to the hash; the first `keys` columns identify a row.
fn add(hash: &mut StateHash, name: &str, table: &NamedColumns, keys: usize) {
    let whole = |column: usize, row: usize| match &table.columns[column].1 {
        Values::Whole(values) => values[row],
        Values::Real(values) => values[row].to_bits(),
    };
    for (column, (label, _)) in table.columns.iter().enumerate() {
        let field = field_key(&format!("{name}.{label}"));
        for row in 0..table.rows() {
            let mut key = StateHash::new();
            for k in 0..keys {
                key.add(0, k as u64, whole(k, row));
            }
            let [low, high] = halves(key.value());
            hash.add(field, low ^ high, whole(column, row));
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let world = World::start()?;
    let communicator = world.communicator();
    let mut words = std::env::args().skip(1);
    let axis = if words.next().as_deref() == Some("y") {
        SplitAxis::Y
    } else {
        SplitAxis::X
    };
    for name in words {
        simulate(&communicator, axis, &name)?;
    }
    Ok(())
}

fn simulate(
    communicator: &Communicator,
    axis: SplitAxis,
    name: &str,
) -> Result<(), Box<dyn std::error::Error>> {
    let planes = match (name, axis) {
        ("blocks", _) => 24,
        (_, SplitAxis::X) => 40,
        _ => 30,
    };
    let slabs = Slabs::even(
        axis,
        planes,
        communicator.size(),
        axis == SplitAxis::X && name == "periodic",
    );
    let domain = Domain::new(communicator.clone(), slabs)?;
    let (rank, size) = (communicator.rank() as u64, communicator.size() as u64);
    if name == "blocks" {
        let (dem, particles) = blocks(|id| id % size == rank)?;
        return step_and_print(communicator, &domain, dem, particles);
    }
    let (dem, grains) = scene(name)?;
    let mut particles = Particles::new();
    // Grains are distributed cyclically over the ranks; the first lists send them to their owners.
    for (k, (body, motion)) in grains.into_iter().enumerate() {
        if k % communicator.size() == communicator.rank() {
            particles.insert(body, motion);
        }
    }
    step_and_print(communicator, &domain, dem, particles)
}

fn step_and_print<S: Space>(
    communicator: &Communicator,
    domain: &Domain,
    mut dem: Dem<S>,
    mut particles: Particles<S>,
) -> Result<(), Box<dyn std::error::Error>> {
    let bonds = dem.bond_existing_contacts(&mut particles, domain)?;
    let bonds = communicator.all_reduce_sum_u64(bonds);
    for _ in 0..40 {
        dem.advance_many(&mut particles, domain, 50)?;
    }
    let mut hash = StateHash::new();
    add(&mut hash, "grains", &particles.table(), 1);
    let contacts = dem.contacts();
    add(&mut hash, "contacts", &contacts.grains, 4);
    add(&mut hash, "walls", &contacts.walls, 2);
    let hash = hash.all_reduce(communicator);
    let count = |n: usize| communicator.all_reduce_sum_u64(n as u64);
    let [held, at_walls] = [count(contacts.grains.rows()), count(contacts.walls.rows())];
    let breaks = count(dem.take_breaks().len());
    if communicator.rank() == 0 {
        println!(
            "{} contacts {held} walls {at_walls} bonds {bonds} breaks {breaks}",
            hash.hex()
        );
    }
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
