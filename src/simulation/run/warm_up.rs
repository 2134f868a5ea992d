//! Warm-up: the fluid flows around stationary grains until it is steady.

use super::super::Present;
use super::super::guards::Guards;
use super::outside::Outside;
use base::error::Error;
use case::time::WarmUp;
use coupling::lattice::LatticeFlow;
use coupling::water::Water;
use decomposition::Communicator;
use dem::space::Space;
use output::checkpoint::{self, RunState, SavedNumber};
use preparation::supervision::{Request, Requests};
use serde_json::{Value, json};

/// Steps between two checks of the steadiness of the fluid.
const CHECK_EVERY: u64 = 100;

/// Progress of a warm-up.
pub(super) struct Reached {
    /// Number of steps taken.
    pub(super) steps: u64,
    /// Velocities at the last check, three numbers per cell, \[z\]\[y\]\[x\]; none before the first check.
    pub(super) velocities: Option<Vec<f64>>,
}

/// Lets the fluid flow around stationary grains from `reached` until it is steady, and returns the total number of
/// steps. `attributes` are stored in checkpoints that are requested during the warm-up. Collective.
///
/// # Errors
/// If the fluid fails or a checkpoint cannot be written, and after a request to stop.
pub(super) fn warm_up<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    guards: &mut Guards,
    reached: Reached,
    mut attributes: Value,
    outside: &mut Outside,
) -> Result<u64, Error> {
    let (plan, domain) = (&now.plan, &now.domain);
    let Some(flow) = now.flow.as_mut().and_then(Water::lattice_mut) else {
        return Ok(0);
    };
    let Some(WarmUp::FluidOnly {
        relative_change, ..
    }) = plan.scene.time.warm_up
    else {
        return Ok(0);
    };
    let mut look = SteadyCheck::new(flow, reached.velocities);
    let mut step = reached.steps;
    let mut ask_at = step + outside.steps();
    while step < plan.clock.warm_up_steps {
        flow.advance(&mut now.particles, domain)?;
        step += 1;
        guards.check_warm_up(step, flow, &now.particles, plan, domain)?;
        if step.is_multiple_of(CHECK_EVERY) {
            flow.fetch()?;
            look.compare(flow, domain.communicator());
            if look.change < relative_change {
                break;
            }
        }
        if step >= ask_at {
            let request = outside.ask(domain.communicator());
            ask_at = step + outside.steps();
            if request != Request::None {
                flow.fetch()?;
                attributes["preparation"] = json!({ "warm_up": step });
                attributes["guards"] = json!(guards.state());
                let state = RunState::<Sp, S> {
                    fluid: Some(flow.fluid()),
                    averages: None,
                    seepage: Vec::new(),
                    particles: &now.particles,
                    dem: now.dem.as_ref(),
                    earlier: Some(&look.velocities),
                };
                outside.keep(&state, &attributes, request)?;
            }
        }
    }
    flow.fetch()?;
    outside
        .progress
        .note(&line(step, look.change, relative_change));
    Ok(step)
}

/// Velocities at the last check, and their relative change since the check before.
struct SteadyCheck {
    /// Cell indices in the order of the velocities.
    cells: Vec<usize>,
    velocities: Vec<f64>,
    change: f64,
}

impl SteadyCheck {
    fn new<Sp: Space, S: SavedNumber>(
        flow: &dyn LatticeFlow<Sp, S>,
        velocities: Option<Vec<f64>>,
    ) -> Self {
        let cells = checkpoint::cells_in_order(flow.fluid());
        Self {
            velocities: velocities.unwrap_or_else(|| vec![0.0; 3 * cells.len()]),
            cells,
            change: f64::INFINITY,
        }
    }

    /// Compares the velocities with those of the last check and stores them. Collective.
    fn compare<Sp: Space, S: SavedNumber>(
        &mut self,
        flow: &dyn LatticeFlow<Sp, S>,
        communicator: &Communicator,
    ) {
        let (mut moved, mut size) = (0.0_f64, 0.0_f64);
        for (&cell, old) in self.cells.iter().zip(self.velocities.chunks_exact_mut(3)) {
            let (_, u) = flow.fluid().state(cell);
            for a in 0..3 {
                moved = moved.max((u[a] - old[a]).abs());
                size = size.max(u[a].abs());
            }
            old.copy_from_slice(&u);
        }
        self.change = communicator.all_reduce_max_f64(moved)
            / communicator.all_reduce_max_f64(size).max(1e-300);
    }
}

/// Returns the message at the end of a warm-up.
fn line(steps: u64, change: f64, limit: f64) -> String {
    let short = if change < limit {
        String::new()
    } else {
        format!(
            "; warning: the flow is not steady: time.warm_up requires {limit:.1e}, but allows no more steps"
        )
    };
    format!(
        "fluid warmed up for {steps} steps: relative change of the velocity {change:.1e} in {CHECK_EVERY} steps{short}"
    )
}
