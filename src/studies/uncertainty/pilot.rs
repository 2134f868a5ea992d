//! A pilot: a run of the case on coarse cells, which measures speed and pressure of the water where formulas do
//! not apply.
//!
//! Speeds and pressures of flow between structures, in turbulence and between openings of several kinds are not known
//! before a run to better than a factor of two. The pilot runs the case on the coarsest cells of an estimate that can
//! run, at most [`MAX_COST`] of its cost. The case with these numbers is written next to it; the automatic choices
//! then take them in place of their estimates, on any number of ranks and after a restart.

use super::grids::{self, Scaling};
use super::{member, outcome};
use crate::sweep::members::Member;
use crate::sweep::runner::Runner;
use crate::sweep::study::Run;
use crate::sweep::{LineReport, enough_cores};
use base::error::{Error, Problem, Severity};
use case::fluid::Pilot;
use plan::Plan;
use plan::scene::findings::number;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Maximum cost of a pilot divided by that of its case.
pub const MAX_COST: f64 = 0.1;
/// Name of the run and of its folder.
const NAME: &str = "pilot";

/// Runs a pilot in `output`; returns its result and the case that contains it. `None` if the case costs so little that
/// no coarser cells cost much less.
///
/// # Errors
/// If no coarser cells can run, and the failure of the run, [`Error::Case`].
pub fn command(
    plan: &Plan,
    output: &Path,
    run: &Run,
    report: LineReport<'_>,
) -> Result<Option<(Pilot, Value)>, Error> {
    enough_cores(run)?;
    if plan.scene.flow.is_none() {
        return Err(Error::Case(vec![Problem::error(
            "fluid.lattice_boltzmann",
            "missing",
            "a pilot measures water on a lattice, and this case has none",
            "run the case itself, without --pilot",
        )]));
    }
    let Some((chosen, ratio)) = coarse(plan)? else {
        return Ok(None);
    };
    let planned = chosen.prepared.as_ref().map_or(0.0, |p| p.seconds);
    report(&format!(
        "a pilot on cells {ratio:.2} times as large; planned cost about {planned:.1} core-seconds, {:.1} % of \
         the run, in {}",
        100.0 * planned / plan.estimate.seconds_on_one_core,
        output.display()
    ));
    let runner = Runner::new(run, true, output, None, report)?;
    runner.run(std::slice::from_ref(&chosen))?;
    if let Err(reason) = outcome(plan, &chosen, output) {
        return Err(Error::Numerical(format!(
            "the pilot failed ({reason}), because its cells are too coarse for this flow; the plan keeps its own \
             estimates"
        )));
    }
    let found = read(plan, &chosen, output)?;
    let mut case: Value = serde_json::from_str(&plan.case_text).map_err(wrong)?;
    case["fluid"]["lattice_boltzmann"]["pilot"] = serde_json::to_value(&found).map_err(wrong)?;
    Ok(Some((found, case)))
}

fn wrong(e: serde_json::Error) -> Error {
    Error::Internal(format!("the case of a pilot: {e}"))
}

/// Returns the case on the coarsest cells that can run, and their spacing divided by that of the case; `None` if they
/// cost too much of the run.
fn coarse(plan: &Plan) -> Result<Option<(Member, f64)>, Error> {
    let stated = grids::with_choices_stated(plan)?;
    let ratios = grids::ratios(&plan.scene, false);
    let most = MAX_COST * plan.estimate.seconds_on_one_core;
    let (mut problems, mut costly) = (Vec::new(), false);
    let coarser = || ratios.iter().rev().filter(|ratio| **ratio > 1.0);
    // A case that is unstable by the estimates may run: the pilot exists because they are rough.
    for (unstable, ratio) in [false, true]
        .into_iter()
        .flat_map(|u| coarser().map(move |r| (u, *r)))
    {
        for rule in [Scaling::Acoustic, Scaling::Diffusive] {
            let case = grids::on_cells(&stated, plan, ratio, rule);
            let found = member(NAME.into(), case, plan.estimate.machine, unstable);
            match &found.prepared {
                Some(prepared) if prepared.seconds <= most => return Ok(Some((found, ratio))),
                Some(_) => costly = true,
                None => problems.extend(found.problems),
            }
        }
    }
    problems.retain(|problem| problem.severity != Severity::Warning);
    problems.truncate(1);
    if costly || problems.is_empty() {
        return Ok(None);
    }
    Err(Error::Case(problems))
}

/// Returns the largest speed and pressure of a pilot that has ended.
fn read(plan: &Plan, pilot: &Member, output: &Path) -> Result<Pilot, Error> {
    let path = output.join(&pilot.name).join("summary.json");
    let fail = |what: &str| Error::Io(format!("{}: {what}", path.display()));
    let text = fs::read_to_string(&path).map_err(|e| fail(&e.to_string()))?;
    let summary: Value = serde_json::from_str(&text).map_err(|e| fail(&e.to_string()))?;
    let value = |name: &str| {
        summary[name]
            .as_f64()
            .ok_or_else(|| fail(&format!("no {name}")))
    };
    let spacing = pilot.case["domain"]["spacing"].as_f64();
    let spacing = spacing.ok_or_else(|| Error::Internal("the pilot has no spacing".into()))?;
    let sound = spacing / (3.0_f64.sqrt() * value("time")? / value("steps")?);
    let density = plan.scene.flow.as_ref().map_or(0.0, |flow| flow.density);
    Ok(Pilot {
        speed: value("lattice_velocity")? * 3.0_f64.sqrt() * sound,
        pressure: value("compression")? * density * sound * sound,
        of: plan::hash_without_pilot(&plan.case_text)
            .ok_or_else(|| Error::Internal("the case is not JSON".into()))?,
    })
}

/// Returns a description of the result of a pilot.
#[must_use]
pub fn description(pilot: &Pilot) -> String {
    format!(
        "the water reached {} m/s and {} Pa",
        number(pilot.speed),
        number(pilot.pressure)
    )
}

/// Writes the case with the result of its pilot.
///
/// # Errors
/// If the file cannot be written, [`Error::Io`].
pub fn write(case: &Value, path: &Path) -> Result<(), Error> {
    io::atomic::write_json(path, case).map_err(|e| Error::Io(format!("{}: {e}", path.display())))
}
