//! The warm-up: the fluid flows around grains at rest until it is steady.

use super::super::guards::Guards;
use super::super::watch::Watch;
use crate::case::time::WarmUp;
use crate::checkpoint::{self, Saved};
use crate::coupling::lattice::LatticeFlow;
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::error::Error;
use crate::plan::Plan;
use crate::preparation::supervision::{Request, Requests};
use decomposition::Domain;

/// Steps between two looks at whether the fluid is steady.
const LOOK_EVERY: u64 = 100;

/// The fluid flows round grains that stand still until it is steady: steps taken, and a line to print. It goes on from `reached`,
/// the steps taken and the velocities at the last look (three numbers a cell, \[z\]\[y\]\[x\]), and hands the same to `keep` where the
/// outside asks for it. Collective.
pub(super) fn warm_up<Sp: Space, S: Saved>(
    plan: &Plan,
    flow: &mut dyn LatticeFlow<Sp, S>,
    particles: &mut Particles<Sp>,
    domain: &Domain,
    (watch, guards): (&mut Watch, &mut Guards),
    reached: (u64, Option<Vec<f64>>),
    mut keep: impl FnMut(
        u64,
        &[f64],
        &dyn LatticeFlow<Sp, S>,
        &Particles<Sp>,
        (&mut Watch, &Guards),
        Request,
    ) -> Result<(), Error>,
) -> Result<(u64, String), Error> {
    let Some(WarmUp::FluidOnly {
        relative_change, ..
    }) = plan.scene.time.warm_up
    else {
        return Ok((0, String::new()));
    };
    let communicator = domain.communicator();
    let cells = checkpoint::cells_in_order(flow.fluid());
    let (mut step, before) = reached;
    let mut before = before.unwrap_or_else(|| vec![0.0; 3 * cells.len()]);
    let mut change = f64::INFINITY;
    let mut ask_at = step + watch.steps();
    while step < plan.clock.warm_up_steps {
        flow.advance(particles, domain)?;
        step += 1;
        guards.check_warm_up(step, flow, particles, plan, domain)?;
        if step % LOOK_EVERY == 0 {
            flow.fetch()?;
            let (mut moved, mut size) = (0.0_f64, 0.0_f64);
            for (&cell, old) in cells.iter().zip(before.chunks_exact_mut(3)) {
                let (_, u) = flow.fluid().state(cell);
                for a in 0..3 {
                    moved = moved.max((u[a] - old[a]).abs());
                    size = size.max(u[a].abs());
                }
                old.copy_from_slice(&u);
            }
            change = communicator.all_reduce_max_f64(moved)
                / communicator.all_reduce_max_f64(size).max(1e-300);
            if change < relative_change {
                break;
            }
        }
        if step >= ask_at {
            let request = watch.ask(communicator);
            ask_at = step + watch.steps();
            if request != Request::None {
                flow.fetch()?;
                keep(step, &before, flow, particles, (watch, guards), request)?;
            }
        }
    }
    flow.fetch()?;
    let short = if change < relative_change {
        String::new()
    } else {
        format!(
            "; warning: not steady, time.warm_up asks for {relative_change:.1e} and allows no more steps"
        )
    };
    Ok((
        step,
        format!(
            "fluid warmed up for {step} steps: relative change of the velocity {change:.1e} in {LOOK_EVERY} steps{short}"
        ),
    ))
}
