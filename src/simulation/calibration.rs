//! Speed of the fluid on the machine at hand, measured before a run.

use crate::case::fluid::Precision;
use crate::lbm::fluid::{Fluid, Force, Setup};
use crate::lbm::lanes::Stored;
use crate::number::real;
use crate::plan::Plan;
use crate::scene::flow::Flow;
use decomposition::{Axis, Domain};
use std::time::{Duration, Instant};

/// Cells of the measurement, at most: enough for the memory to count, few enough to be allocated at once.
const CELLS: usize = 250_000;
/// Time of the measurement. The fastest of its passes counts, because other work only slows them.
const TIME: Duration = Duration::from_millis(150);

/// Million lattice updates per second of one core with the operator, the eddies and the storage of a plan, in a closed box without solids;
/// none without a lattice, or where the memory for the measurement is refused.
#[must_use]
pub fn mlups(plan: &Plan) -> Option<f64> {
    let flow = plan.scene.flow.as_ref()?;
    match flow.storage {
        Precision::F64 => measure::<f64>(plan, flow),
        Precision::F32 => measure::<f32>(plan, flow),
    }
}

fn measure<S: Stored>(plan: &Plan, flow: &Flow) -> Option<f64> {
    let mut cells = plan.scene.grid.cells;
    while cells.iter().product::<usize>() > CELLS {
        let longest = (0..3).max_by_key(|a| cells[*a]).unwrap_or(0);
        cells[longest] = cells[longest].div_ceil(2);
    }
    let forced = plan.scene.gravity.iter().any(|g| *g != 0.0);
    let setup = Setup {
        set: flow.lattice,
        operator: flow.collision,
        turbulence: flow.turbulence,
        relaxation_time: flow.relaxation_time,
        force: if forced {
            Force::Constant([1e-9, 0.0, 0.0])
        } else {
            Force::None
        },
        cells,
        periodic: [false, false, plan.scene.grid.dimension == 2],
        patches: Vec::new(),
        saturation: None,
    };
    let axis = [Axis::X, Axis::Y, Axis::Z][plan.scene.grid.split_axis.min(2)];
    let domain = Domain::serial(axis, cells[plan.scene.grid.split_axis], false);
    let mut fluid = Fluid::<S>::new(setup, &domain).ok()?;
    // This thread alone, as in a run; where the process has a pool already, the rate is that of its threads.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global();
    let fastest = fastest_pass(&mut fluid);
    Some(1e-6 * real(cells.iter().product::<usize>()) / fastest)
}

/// Time \[s\] of the fastest pass.
fn fastest_pass<S: Stored>(fluid: &mut Fluid<S>) -> f64 {
    // Both parities of the pass, and the first access to the memory.
    fluid.advance();
    fluid.advance();
    let begin = Instant::now();
    let mut fastest = f64::INFINITY;
    while begin.elapsed() < TIME {
        let pass = Instant::now();
        fluid.advance();
        fluid.advance();
        fastest = fastest.min(0.5 * pass.elapsed().as_secs_f64());
    }
    fastest
}
