//! Limit of the time step by the terms of the fluid step ([`crate::scene::terms`]), whose files have the theory.

use super::margin::{Margin, margin, slower_clock};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::speed::speeds;
use crate::scene::terms;

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
    let Some(limit) = terms::step_limit(&scene.terms, speed) else {
        return;
    };
    let found = margin(limit.margin, flow.time_step, limit.stable, &limit.path);
    let excess = &limit.excess;
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
                "{} {} {} in a time step of {} s: {}",
                excess.subject,
                number(2.0 * found.used),
                excess.object,
                number(flow.time_step),
                excess.consequence
            ),
            slower(
                limit.stable,
                format!(
                    "use a time step of at most {} s; {}",
                    number(PROPOSED_FRACTION * limit.stable),
                    excess.instead
                ),
            ),
        );
    } else if flow.models.turbulence.is_some() && flow.time_step > limit.with_eddies {
        findings.warn(
            &format!("{PATH}.{}", flow.fixed_by),
            format!(
                "the eddy viscosity uses velocities with an error of up to {} % {}",
                number(100.0 * found.used),
                excess.surface
            ),
            slower(
                limit.with_eddies,
                format!(
                    "use a time step of at most {} s",
                    number(PROPOSED_FRACTION * limit.with_eddies)
                ),
            ),
        );
    }
    margins.push(found);
}
