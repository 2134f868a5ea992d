//! Speed of the present machine, measured before a run: for the fluid of a plan, for grains in contact,
//! and for the disk.

use base::error::Error;
use base::number::real;
use base::random::Stream;
use case::fluid::Precision;
use decomposition::{Domain, SplitAxis};
use dem::contact::Scaled;
use dem::contact::linear::{self, Linear};
use dem::{
    Body, Components, Dem, DemSettings, GrainDomain, Law, Motion, PairTable, Particles, Volume,
    alone,
};
use lbm::fluid::{Fluid, Force, Setup};
use lbm::lanes::Stored;
use nalgebra::Vector3;
use plan::Plan;
use plan::estimate::Machine;
use plan::scene::flow::Flow;
use std::io::Write;
use std::sync::Barrier;
use std::time::{Duration, Instant};

/// Maximum number of populations in the measurement: more than caches hold, so that memory limits the
/// speed for a large lattice as in the run.
const POPULATIONS: usize = 16_000_000;
/// Duration of the measurement. The fastest of its passes counts, because other work only slows passes.
const TIME: Duration = Duration::from_millis(150);

/// Number of files written in the measurement.
const FILES: usize = 10;
/// Number of spheres in the measurement of grains.
const SPHERES: usize = 1000;
/// Steps between two readings of the clock.
const BATCH: u64 = 10;
/// Processor time of a step of one of these spheres on the reference machine \[s\].
const SPHERE: f64 = 6.35e-8;

/// Returns the speed of one core of this machine for a plan, or that of the reference machine if
/// nothing can be measured.
#[must_use]
pub fn machine(plan: &Plan) -> Machine {
    // Only this thread works, as in a run; if the process has a pool already, the rate is that of its
    // threads.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global();
    let fluid = fluid(plan, 1);
    let reference = Machine::default();
    Machine {
        fluid,
        grains: sphere().map_or(reference.grains, |now| SPHERE / now),
        file_seconds: file().unwrap_or(reference.file_seconds),
    }
}

/// Returns the time to write and synchronise a small file \[s\]: the minimum of several.
fn file() -> std::io::Result<f64> {
    let folder = tempfile::tempdir()?;
    let mut fastest = f64::INFINITY;
    for n in 0..FILES {
        let begin = Instant::now();
        let mut file = std::fs::File::create(folder.path().join(n.to_string()))?;
        file.write_all(&[0; 4096])?;
        file.sync_all()?;
        fastest = fastest.min(begin.elapsed().as_secs_f64());
    }
    Ok(fastest)
}

/// Returns the processor time of this thread \[s\]; the wall time would include other work of the
/// machine.
fn processor_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(time).map_or(0.0, |time| time.as_secs_f64())
}

/// Returns the processor time of a step of a sphere in contact with its neighbours \[s\].
fn sphere() -> Result<f64, Error> {
    let (mut dem, mut particles) = spheres(SPHERES, true)?;
    dem.advance_many(&mut particles, &alone(), BATCH)?;
    let begin = Instant::now();
    let mut fastest = f64::INFINITY;
    while begin.elapsed() < TIME {
        let batch = processor_time();
        dem.advance_many(&mut particles, &alone(), BATCH)?;
        fastest = fastest.min(processor_time() - batch);
    }
    Ok(fastest / (real(BATCH) * real(particles.owned())))
}

/// Returns spheres of 2 mm with linear springs and friction on a cubic lattice in a periodic box: in contact if
/// `packed`, otherwise apart and falling. The bench `dem` measures the same.
///
/// # Errors
///
/// If the engine of the grains cannot be made.
pub fn spheres(count: usize, packed: bool) -> Result<(Dem<Volume>, Particles<Volume>), Error> {
    let side = real(count).cbrt().ceil();
    let (spacing, jitter) = if packed {
        (1.985e-3, 2e-3)
    } else {
        (3e-3, 0.1)
    };
    let parameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(1e5),
        stiffness_ratio: 2.0 / 7.0,
        friction: 0.5,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.0,
        attraction: false,
    };
    let law = Law::Linear(Linear {
        parameters: PairTable::uniform(1, parameters),
    });
    let length = side * spacing;
    let mut region =
        GrainDomain::<Volume>::closed(Vector3::zeros(), Vector3::repeat(length), spacing);
    region.periodic = [true; 3];
    let mut particles = Particles::<Volume>::new();
    for n in 0..count {
        let id = n as u64;
        let mut draw = Stream::new(1, id, 0);
        let mut motion = Motion::<Volume>::default();
        let n = real(n);
        let cell = [
            n % side,
            (n / side).floor() % side,
            (n / side / side).floor(),
        ];
        for (axis, cell) in cell.into_iter().enumerate() {
            let place = (cell + 0.5 + jitter * (draw.uniform() - 0.5)) * spacing;
            motion.position.set(axis, place);
            motion.velocity.set(axis, 0.02 * (draw.uniform() - 0.5));
        }
        particles.insert(Body::uniform::<Volume>(id, 1e-3, 2600.0, 0), motion);
    }
    let mut settings = DemSettings::new(region, 1e-6, if packed { 1e-4 } else { 5e-4 });
    if !packed {
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    }
    Ok((Dem::new(law, settings, Vec::new())?, particles))
}

/// Returns the speed of a lattice that is cut into `cores` parts and passed by one core each at the
/// same time, divided by the speed of the whole lattice on one core: cores share the memory bandwidth,
/// and smaller parts fit the caches. `cores` is limited to the cores of the machine. 1 without a
/// lattice.
#[must_use]
pub fn crowded(plan: &Plan, cores: usize) -> f64 {
    let busy = cores.min(std::thread::available_parallelism().map_or(1, usize::from));
    let Some(flow) = plan.scene.flow.as_ref().filter(|_| cores > 1) else {
        return 1.0;
    };
    let start = Barrier::new(busy);
    let rate = || {
        // A pool of one thread keeps the passes of a part on its core.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .ok()?;
        pool.install(|| match flow.storage {
            Precision::F64 => measure::<f64>(plan, flow, cores, Some(&start)),
            Precision::F32 => measure::<f32>(plan, flow, cores, Some(&start)),
        })
    };
    let rates: Vec<Option<f64>> = std::thread::scope(|scope| {
        let parts: Vec<_> = (0..busy).map(|_| scope.spawn(rate)).collect();
        let joined = parts.into_iter().map(|part| part.join().ok().flatten());
        joined.collect()
    });
    let slowest = rates
        .iter()
        .flatten()
        .copied()
        .fold(f64::INFINITY, f64::min);
    if slowest.is_finite() && plan.estimate.mlups > 0.0 {
        slowest / plan.estimate.mlups
    } else {
        1.0
    }
}

/// Returns the speed of the threads of this process in one of `parts` of the lattice, divided by that
/// of one core in the plan. The measurement has the operator, the eddy viscosity and the storage of the
/// plan, in a closed box without solids. 1 without a lattice, or if its memory cannot be allocated.
#[must_use]
pub fn fluid(plan: &Plan, parts: usize) -> f64 {
    let rate = plan
        .scene
        .flow
        .as_ref()
        .and_then(|flow| match flow.storage {
            Precision::F64 => measure::<f64>(plan, flow, parts, None),
            Precision::F32 => measure::<f32>(plan, flow, parts, None),
        });
    rate.map_or(1.0, |now| now / plan.estimate.mlups)
}

/// Returns the rate of one of `parts` of the lattice: with a barrier that of the mean pass after it,
/// otherwise that of the fastest pass.
fn measure<S: Stored>(
    plan: &Plan,
    flow: &Flow,
    parts: usize,
    together: Option<&Barrier>,
) -> Option<f64> {
    let fluid = part::<S>(plan, flow, parts);
    if let Some(start) = together {
        // Every part must reach the barrier, even if its memory could not be allocated.
        start.wait();
    }
    let (mut fluid, cells) = fluid?;
    let seconds = if together.is_some() {
        mean_pass(&mut fluid)
    } else {
        fastest_pass(&mut fluid)
    };
    Some(1e-6 * real(cells) / seconds)
}

/// Returns one of `parts` of the lattice of a plan, and its number of cells.
fn part<S: Stored>(plan: &Plan, flow: &Flow, parts: usize) -> Option<(Fluid<S>, usize)> {
    let mut cells = plan.scene.grid.cells;
    let split = plan.scene.grid.split_axis.min(2);
    cells[split] = cells[split].div_ceil(parts);
    while cells.iter().product::<usize>() * flow.models.lattice.count() > POPULATIONS {
        let longest = (0..3).max_by_key(|a| cells[*a]).unwrap_or(0);
        cells[longest] = cells[longest].div_ceil(2);
    }
    let forced = plan.scene.gravity.iter().any(|g| *g != 0.0);
    let setup = Setup {
        force: if forced {
            Force::Constant([1e-9, 0.0, 0.0])
        } else {
            Force::None
        },
        periodic: [false, false, plan.scene.grid.dimension == 2],
        single: flow.arithmetic == Precision::F32,
        ..Setup::new(flow.models, flow.relaxation_time, cells)
    };
    let axis = [SplitAxis::X, SplitAxis::Y, SplitAxis::Z][plan.scene.grid.split_axis.min(2)];
    let domain = Domain::serial(axis, cells[plan.scene.grid.split_axis], false);
    let fluid = Fluid::<S>::new(setup, &domain).ok()?;
    Some((fluid, cells.iter().product()))
}

/// Returns the mean processor time of a pass \[s\].
fn mean_pass<S: Stored>(fluid: &mut Fluid<S>) -> f64 {
    fluid.advance();
    fluid.advance();
    let (begin, used) = (Instant::now(), processor_time());
    let mut passes = 0_usize;
    while begin.elapsed() < TIME {
        fluid.advance();
        fluid.advance();
        passes += 2;
    }
    (processor_time() - used) / real(passes)
}

/// Returns the processor time of the fastest pass \[s\].
fn fastest_pass<S: Stored>(fluid: &mut Fluid<S>) -> f64 {
    // Warms up: both parities of the pass, and the first access to the memory.
    fluid.advance();
    fluid.advance();
    let begin = Instant::now();
    let mut fastest = f64::INFINITY;
    while begin.elapsed() < TIME {
        let pass = processor_time();
        fluid.advance();
        fluid.advance();
        fastest = fastest.min(0.5 * (processor_time() - pass));
    }
    fastest
}
