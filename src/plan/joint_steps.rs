//! Several steps of a lattice in a step of the water in joints below it.
//!
//! The joints make a step of `n` steps of the lattice. Their discharge returns `n` steps after the pressures that drive
//! it, on average. The accuracy limits `n`: a pressure wave of the lattice, whose speed is `h/(√3 dt)`, passes the
//! longest joint, of length `L`, in `√3 L/h` steps. Pulses that last as long as this have about the same pressure at
//! both ends of a joint; shorter ones are averaged over the step.
//!
//! **Stability.** A step of the joints pays the lattice for its water with a delay, in which waves of the lattice may
//! gain energy. Joints between two pools with relaxation times of up to 0.503 grew with two steps down to 0.06 cells
//! wide, with three at 0.12 cells, and with 4 to 16 at four cells. At 0.53 none grew with up to 16 steps, the most that
//! a case may state, from half a cell to four cells. The plan reports relaxation times below that as unstable; no bound
//! by the friction of the joints was found.
//!
//! Blocks that can move allow one step only. They would make the same step as the joints, and a block that has left
//! its joints would be driven by loads of the lattice that are constant over `n` of its steps: a block of 3.3 cells
//! that was moved in a closed box was thrown sideways with two steps, and not with one.

use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use base::error::Remedy;
use base::number::whole;

/// Path of the number of steps.
const PATH: &str = "fluid.lattice_boltzmann.joints.lattice_steps";

/// Smallest relaxation time at which no joint grew.
const RELAXATION: f64 = 0.53;

/// Reports several steps of the lattice in a step of the joints at a relaxation time at which some grew.
fn check_relaxation(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = &scene.flow else { return };
    if flow.relaxation_time < RELAXATION - 1e-9 {
        findings.unstable(
            PATH,
            format!(
                "the relaxation time of {} damps waves of the lattice too little: in several of its steps in a step \
                 of the joints they may grow below {RELAXATION}",
                number(flow.relaxation_time)
            ),
            Remedy::from("use 1".to_owned()).set(PATH, 1),
        );
    }
}

/// Compares the step of the joints with the time of a pressure wave along the longest joint.
pub(super) fn check(scene: &Scene, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let Some(joints) = &scene.joints else { return };
    if joints.lattice_steps <= 1 || joints.longest <= 0.0 {
        return;
    }
    check_relaxation(scene, findings);
    let steps = f64::from(joints.lattice_steps);
    let allowed = 3.0_f64.sqrt() * joints.longest / scene.grid.spacing;
    let name = "lattice steps of the joints / steps of a wave along the longest";
    margins.push(margin(name, steps, allowed, PATH));
    if steps > allowed {
        let most = whole(allowed).max(1);
        findings.warn(
            PATH,
            format!(
                "a pressure wave of the lattice passes the longest joint, of {} m, in {} steps: shorter pulses are \
                 averaged over a step of the joints",
                number(joints.longest),
                number(allowed)
            ),
            Remedy::from(format!("use at most {most}")).set(PATH, most),
        );
    }
}
