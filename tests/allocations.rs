//! The step allocates nothing in the steady state, as counted by the allocator of this binary.
//!
//! Only events may allocate: renewed lists (counted by the engine; a bounded number of times each), grains that
//! leave, bonds that break, outputs. The eroding case is run without its outputs; every step without such an event
//! must not allocate.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking"
)]

use nalgebra::{UnitQuaternion, Vector3};
use solver::case::Document;
use solver::dem::contact::blocks::BlockLaw;
use solver::dem::polyhedron::{self, BlockContactModel, Polyhedron, Stiffness};
use solver::dem::{
    Body, Dem, DemSettings, GrainDomain, Law, Motion, PairTable, Particles, PlaneSpace, Volume,
    Wall, alone,
};
use solver::plan::Plan;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

/// System allocator with a counter.
struct Counting;

static CALLS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: promised by the caller.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: promised by the caller.
        unsafe { System.dealloc(block, layout) }
    }
    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: promised by the caller.
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the plan of loose and bonded discs in a stream, with few cells and grains.
fn plan() -> Plan {
    let text = solver::case::examples::find("piping").unwrap().text;
    let mut grains = Vec::new();
    for row in 0..5 {
        for column in 0..8 {
            let x = 6e-4 + 2.001e-4 * f64::from(column) + if row % 2 == 1 { 1e-4 } else { 0.0 };
            let y = 1e-4 + 1.8e-4 * f64::from(row);
            grains.push(format!(r#"{{"position": [{x}, {y}], "radius": 1e-4}}"#));
        }
    }
    let set = [
        "domain.size=[0.003, 0.0016]".to_owned(),
        "domain.spacing=2e-5".into(),
        "contact.cohesive_frictional.local_damping=0".into(),
        "contact.cohesive_frictional.normal_damping_ratio=0.2".into(),
        "time.solid_time_step_safety=0.1".into(),
        format!("grains.initial={{\"list\": [{}]}}", grains.join(",")),
        "grains.cut=[]".into(),
        "grains.bond_at_start=false".into(),
        "box_walls=[\"x_min\", \"x_max\", \"y_min\", \"y_max\"]".into(),
        "grains.save=null".into(),
        "regions[0].box={\"from\": [0.0029, 0], \"to\": [0.003, 0.0016]}".into(),
        "gravity=[0, -9.81]".into(),
        "probes=[]".into(),
        "output={}".into(),
        "analysis.erosion_law.hole={\"from\": [0.0004, 0.001], \"to\": [0.0026, 0.0014]}".into(),
        "analysis.erosion_law.every=10".into(),
        "time.warm_up=null".into(),
        "time.end=10".into(),
        // The bed rests on the water in its pores until this has drained, which raises its density by a third.
        "guards.max_compression=1".into(),
        "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value=1".into(),
        // Loosened grains compress the water between them.
        "guards.max_compression=1".into(),
    ];
    Document::read(text, &set, std::path::Path::new(""))
        .and_then(Plan::prepare)
        .unwrap()
}

/// Returns a layer of boxes on a floor, some of which lean on a sphere.
fn blocks() -> (Dem<Volume>, Particles<Volume>) {
    let shape = Polyhedron::cuboid(Vector3::new(0.1, 0.08, 0.05)).unwrap();
    let law = polyhedron::BlockPairLaw {
        stiffness: Stiffness::PerArea {
            normal: 1e8,
            shear: 5e7,
        },
        friction: 0.5,
        normal_damping_ratio: 0.2,
        shear_damping_ratio: 0.2,
    };
    let law = Law::Blocks(BlockLaw {
        parameters: PairTable::uniform(1, law),
        model: BlockContactModel::Patch,
        mass_damping: 1.0,
    });
    let region = GrainDomain::closed(Vector3::zeros(), Vector3::repeat(1.0), 0.1);
    let mut settings = DemSettings::new(region, 1e-4, 0.01);
    settings.gravity = Vector3::new(0.5, 0.0, -9.81);
    let walls = Wall::of_box(region.lower, region.upper, [true; 3], 0);
    let mut particles = Particles::new();
    particles.set_shapes([shape.clone()].into()).unwrap();
    for n in 0..27_u32 {
        let position = Vector3::new(
            0.2 + 0.11 * f64::from(n % 3),
            0.2 + 0.1 * f64::from(n / 3 % 3),
            0.05 + 0.07 * f64::from(n / 9),
        );
        let motion = Motion {
            position,
            ..Motion::default()
        };
        if n % 5 == 2 {
            particles.insert(
                Body::uniform::<Volume>(u64::from(n), 0.04, 2600.0, 0),
                motion,
            );
        } else {
            let body = Body::of_block(u64::from(n), &shape, 2600.0, 0);
            let turn = UnitQuaternion::from_euler_angles(0.1 * f64::from(n), 0.2, 0.0);
            particles.add_block(body, motion, 0, turn).unwrap();
        }
    }
    (Dem::new(law, settings, walls).unwrap(), particles)
}

fn steps_of_blocks_allocate_nothing() {
    let (mut dem, mut particles) = blocks();
    let domain = alone();
    // Lists reach their final sizes while the boxes settle.
    dem.advance_many(&mut particles, &domain, 6000).unwrap();
    let (mut quiet, mut contacts) = (0, 0);
    for _ in 0..1000 {
        let before = dem.statistics(&particles);
        let calls = CALLS.load(Ordering::Relaxed);
        dem.advance(&mut particles, &domain).unwrap();
        let calls = CALLS.load(Ordering::Relaxed) - calls;
        let now = dem.statistics(&particles);
        if now.rebuilds == before.rebuilds {
            assert_eq!(calls, 0);
            quiet += 1;
            contacts += now.contacts;
        }
    }
    assert!(quiet > 900 && contacts > 10 * quiet, "{quiet} {contacts}");
}

#[test]
fn a_step_without_an_event_allocates_nothing() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut simulation =
        solver::simulation::run::ready::<PlaneSpace, f64>(plan(), folder.path()).unwrap();
    let state = |simulation: &solver::simulation::Simulation<PlaneSpace, f64>| {
        let view = simulation.view();
        let now = view.dem.unwrap().statistics(view.particles);
        (now.rebuilds, now.bonds, now.owned)
    };
    // Buffers reach their final sizes.
    for _ in 0..300 {
        simulation.step().unwrap();
    }
    let start = simulation.view().particles.motion[0].position;
    let (mut quiet, mut eventful, mut most) = (0, 0, 0);
    for _ in 0..1500 {
        let before = state(&simulation);
        let calls = CALLS.load(Ordering::Relaxed);
        simulation.step().unwrap();
        let calls = CALLS.load(Ordering::Relaxed) - calls;
        if state(&simulation) == before {
            assert_eq!(calls, 0, "in step {}", simulation.view().step);
            quiet += 1;
        } else {
            eventful += 1;
            most = most.max(calls);
        }
    }
    // Grains have moved, lists were renewed, and most steps allocated nothing.
    let moved = simulation.view().particles.motion[0].position - start;
    println!(
        "{quiet} quiet steps, {eventful} with events of at most {most} allocations; moved {moved:?}"
    );
    assert!(quiet > 1000, "{quiet} quiet steps");
    assert!(eventful > 0);
    assert!(most <= 100, "{most} allocations in one step");
    steps_of_blocks_allocate_nothing();
    // The counter works.
    let calls = CALLS.load(Ordering::Relaxed);
    drop(std::hint::black_box(Vec::<u8>::with_capacity(10)));
    assert_eq!(CALLS.load(Ordering::Relaxed), calls + 1);
}
