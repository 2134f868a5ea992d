//! Limit of the time step by the resistance of porous zones ([`lbm::term::porous`]).

use super::margin::{Margin, margin, slower_clock};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::porous;
use crate::scene::speed::speeds;

/// Fraction of the limit that a remedy proposes.
const PROPOSED_FRACTION: f64 = 0.9;

/// Adds the margin, and findings if the limit is exceeded.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let speed = speeds(scene, flow)
        .iter()
        .map(|speed| speed.value)
        .fold(0.0, f64::max);
    let Some(limit) = porous::step_limit(&scene.porous_zones, speed) else {
        return;
    };
    let path = format!("{}.resistance", limit.zone.path);
    let found = margin(
        "time step for the resistance of a porous zone",
        flow.time_step,
        limit.stable,
        &path,
    );
    let slower = |longest: f64, text: String| {
        slower_clock(
            flow,
            scene.grid.spacing,
            PROPOSED_FRACTION * longest / flow.time_step,
            text,
        )
    };
    if found.used > 1.0 {
        findings.error(
            &format!("{PATH}.{}", flow.fixed_by),
            format!(
                "the resistance of the zone `{}` removes {} times the momentum of its water in a time step of {} \
                 s: above 2 the velocity oscillates from step to step",
                limit.zone.name,
                number(2.0 * found.used),
                number(flow.time_step)
            ),
            slower(
                limit.stable,
                format!(
                    "use a time step of at most {} s; for slow flow through soil use `fluid.darcy`",
                    number(PROPOSED_FRACTION * limit.stable)
                ),
            ),
        );
    } else if flow.turbulence.is_some() && flow.time_step > limit.with_eddies {
        findings.warn(
            &format!("{PATH}.{}", flow.fixed_by),
            format!(
                "the eddy viscosity uses velocities with an error of up to {} % at the surface of the zone `{}`",
                number(100.0 * found.used),
                limit.zone.name
            ),
            slower(
                limit.with_eddies,
                format!("use a time step of at most {} s", number(PROPOSED_FRACTION * limit.with_eddies)),
            ),
        );
    }
    margins.push(found);
}
