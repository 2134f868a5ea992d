//! Times of the samples of probes, if their intervals are not whole numbers of steps.
//!
//! Sample k lies at the step nearest to k times the interval ([`super::interval`]): the distances of samples differ by
//! a step, and a spectrum or a derivative computed from them as if they were even is wrong by that.

use super::Clock;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;

/// Difference of the distances of samples, relative to the interval, above which the plan warns.
const UNEVEN: f64 = 1e-3;
/// Number of samples that are compared.
const SAMPLES: u64 = 1000;

/// Returns the shortest and the longest distance \[s\] of samples at an interval \[s\] until the end of a run.
fn distances(clock: &Clock, every: f64) -> [f64; 2] {
    let interval = clock.every(every);
    let within = |event: &u64| interval.step(*event) <= clock.steps;
    let steps: Vec<u64> = (0..=SAMPLES)
        .take_while(within)
        .map(|n| interval.step(n))
        .collect();
    let apart = steps
        .windows(2)
        .map(|pair| clock.time_step * base::number::real(pair[1] - pair[0]));
    apart.fold([f64::INFINITY, 0.0], |[low, high], d| {
        [low.min(d), high.max(d)]
    })
}

/// Warns of probes whose samples are uneven with an automatic time step.
pub(super) fn check(scene: &Scene, clock: &Clock, findings: &mut Findings) {
    let stated = |flow: &Flow| flow.fixed_by != "accuracy";
    if scene
        .flow
        .as_ref()
        .map_or(scene.time.solid_time_step.is_some(), stated)
    {
        return;
    }
    for (n, probe) in scene.probes.iter().enumerate() {
        let [shortest, longest] = distances(clock, probe.every);
        if longest - shortest <= UNEVEN * probe.every || !probe.every.is_finite() {
            continue;
        }
        findings.warn(
            &format!("probes[{n}].every"),
            format!(
                "the samples of the probe `{}` every {} s lie at the nearest steps of {} s, between {} and {} s apart: \
                 no automatic time step divides the intervals of all samples",
                probe.name,
                number(probe.every),
                number(clock.time_step),
                number(shortest),
                number(longest)
            ),
            "choose intervals that are multiples of one time, of several steps, or use the times in the table of the \
             probe",
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use crate::interval::Interval;
    use case::Document;
    use serde_json::json;
    use std::path::Path;

    /// Checks three probes whose intervals have a common divisor, around that divisor of the step wanted: either the
    /// step divides all of them, or a warning names every probe that it does not divide, with the distances of
    /// its samples.
    #[test]
    fn samples_of_three_probes_are_even_or_named() {
        let plan = |every: [f64; 3]| {
            let probe = |n: usize| {
                json!({"name": format!("p{n}"), "every": every[n],
                    "at": {"point": {"position": [0.01, 0.005]}}})
            };
            let case = json!({
                "domain": {"size": [0.02, 0.01], "periodic": ["x"]},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-5, "body_force": {"constant": [1, 0]}
                }},
                "time": {"end": 2},
                "probes": [probe(0), probe(1), probe(2)]
            });
            let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            Plan::prepare(document).unwrap()
        };
        let longest = plan([2.0; 3]).clock.time_step;
        let (mut even, mut named) = (0, 0);
        // The divisor is a tenth of the first interval.
        let divisors = [
            (0.3, false),
            (0.5, false),
            (0.76, true),
            (0.9, true),
            (1.1, false),
            (1.7, true),
            (3.4, true),
        ];
        for (divisor, fits) in divisors {
            let unit = divisor * longest;
            let every = [10.0 * unit, 15.0 * unit, 7.0 * unit];
            let plan = plan(every);
            let step = plan.clock.time_step;
            assert!(
                step <= longest * 1.01 && step > 0.7 * longest,
                "{step} {longest}"
            );
            for (n, every) in every.into_iter().enumerate() {
                let is_even = (every / step - (every / step).round()).abs() < 1e-6;
                let path = format!("probes[{n}].every");
                let warning = plan.warnings.iter().find(|w| w.path == path);
                assert_eq!(
                    warning.is_none(),
                    is_even,
                    "{divisor} {n}: {:#?}",
                    plan.warnings
                );
                even += usize::from(is_even);
                let Some(warning) = warning else { continue };
                named += 1;
                let interval = Interval::new(every, step);
                let apart = |k: u64| interval.step(k + 1) - interval.step(k);
                let within = |k: &u64| interval.step(k + 1) <= plan.clock.steps;
                let steps: Vec<u64> = (0..).take_while(within).map(apart).collect();
                let (low, high) = (steps.iter().min().unwrap(), steps.iter().max().unwrap());
                let text =
                    |steps: &u64| crate::scene::findings::number(step * base::number::real(*steps));
                let said = format!("between {} and {} s apart", text(low), text(high));
                assert!(
                    warning.reason.contains(&said) && warning.reason.contains(&format!("`p{n}`")),
                    "{warning} {said}"
                );
            }
            // A step of 3/4 of the one wanted or more that divides all intervals is taken.
            assert_eq!(fits, plan.warnings.is_empty(), "{divisor}");
        }
        assert!(even > 9 && named > 1, "{even} {named}");
    }
}
