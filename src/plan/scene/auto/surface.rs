//! Errors promised for water with a free surface.
//!
//! A row of `measured_surface.csv` is an answer of a plane scene on one grid, with its error against theory or against
//! the limit of finer cells. Its number of cells is that across the shortest length that the cells must resolve
//! ([`SurfaceFlow`]), its Reynolds number that of a cell, U h/ν, and its shape the dimensionless number of the flow
//! that matters besides: steepness, height over depth, Froude number, duration, head over opening. Its error is the
//! largest at this number of cells and at every larger one of the scene. `jobs/automatic/surface/promises.py` makes
//! the rows, and judges the promises in random scenes of which no row was made.
//!
//! The rows of a flow and an answer give a bound by the method of [`bound`](super::bound), under which 97.5 % of them
//! lie, with the margin 1 + 5/k for k problems. The plan promises the bound for each probe with such an answer. It
//! promises nothing, and says why, for a flow, an operator, an answer, a cell Reynolds number or a shape outside the
//! rows.
//!
//! | flow | shape | answers |
//! |---|---|---|
//! | standing wave | amplitude times wave number | frequency; amplitude after a period, relative to that at the start |
//! | solitary wave | height over depth | time of the crest at a gauge; its height, relative to that at the start |
//! | film | Froude number U/(g d)^½ | discharge |
//! | dam over a dry or wet bed | duration over (H/g)^½ | arrival at a dry gauge; depth at the end, relative to H |
//! | sluice gate | head over opening | discharge |

mod kinds;

use super::answers::{self, ESTIMATE, Kind, PromisedAnswer, line_of_length};
use super::bound::{Bound, Point};
use super::{Subject, measured};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::observe::ProbeAt;
use kinds::Flow;
pub use kinds::{SurfaceFlow, SurfaceLength};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

const TABLE: &str = include_str!("measured_surface.csv");
/// Smallest measured error of the fit: below it lie rounding, samples and references.
const LEAST_ERROR: f64 = 1e-4;
/// Largest bound that is a promise.
const MOST_ERROR: f64 = 0.5;
/// Measured error of an answer on one grid.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    /// Kind of flow with its operator.
    flow: String,
    /// Kind of answer.
    answer: String,
    /// Scene with its number.
    problem: String,
    /// Cells across the shortest length.
    cells: f64,
    /// Cell Reynolds number.
    reynolds: f64,
    /// Dimensionless number of the flow.
    shape: f64,
    /// Largest error on this grid and finer ones.
    error: f64,
}

/// Bound of the error of an answer with the range of shapes of its rows.
struct Measured {
    bound: Bound,
    shapes: [f64; 2],
}

impl Measured {
    /// Returns the bound of the error of a flow, or the reason why no row covers it.
    fn error(&self, flow: &SurfaceFlow) -> Result<f64, String> {
        let (cells, reynolds) = (flow.cells(), flow.cell_reynolds);
        let [least, most] = self.shapes;
        let shape = flow.shape;
        let slack = 1e-6;
        if shape < least * (1.0 - slack) || shape > most * (1.0 + slack) {
            return Err(format!(
                "the {} is {}, outside the measured {} to {}",
                flow.shape_name,
                number(shape),
                number(least),
                number(most)
            ));
        }
        let few = cells < self.bound.cells[0] * (1.0 - 1e-9);
        let error = self.bound.error(cells, reynolds).ok_or_else(|| {
            if few {
                let length = flow.lengths.first().map_or("", |length| length.what);
                format!(
                    "{} cells across the {length} are fewer than the {} of any measured row",
                    number(cells),
                    number(self.bound.cells[0])
                )
            } else {
                format!(
                    "the cell Reynolds number is {}, above {}, the largest that was measured",
                    number(reynolds),
                    number(self.bound.largest_reynolds())
                )
            }
        })?;
        if error > MOST_ERROR {
            return Err(format!(
                "the bound of the measured rows is {} %",
                number(100.0 * error)
            ));
        }
        Ok(error)
    }
}

/// Returns all rows.
fn rows() -> &'static [Row] {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| measured::read(TABLE));
    &ROWS
}

/// Returns the bound of the rows of an answer; none for too few problems.
fn measured(rows: &[&'static Row]) -> Option<Measured> {
    let points: Vec<Point> = (rows.iter())
        .map(|row| Point {
            cells: row.cells,
            reynolds: row.reynolds,
            error: row.error.max(LEAST_ERROR),
        })
        .collect();
    let problems = rows.iter().map(|row| row.problem.as_str()).collect();
    let bound = answers::bound_of(&points, problems)?;
    let shapes = rows.iter().map(|row| row.shape);
    let shapes = [
        shapes.clone().fold(f64::INFINITY, f64::min),
        shapes.fold(0.0, f64::max),
    ];
    Some(Measured { bound, shapes })
}

/// Returns the rows by flow and answer.
fn groups() -> BTreeMap<Kind, Vec<&'static Row>> {
    answers::groups(rows(), |row| (&row.flow, &row.answer))
}

/// Returns the measured errors of an answer of a flow; none if it was not measured.
fn known(flow: &str, answer: &str) -> Option<&'static Measured> {
    static BOUNDS: LazyLock<BTreeMap<Kind, Measured>> = LazyLock::new(|| {
        let found = groups()
            .into_iter()
            .filter_map(|(key, rows)| Some((key, measured(&rows)?)));
        found.collect()
    });
    let found = BOUNDS.iter().find(|((f, a), _)| *f == flow && *a == answer);
    found.map(|(_, measured)| measured)
}

/// Computes the errors promised for the answers of a scene with a free surface. `target` is the requested error; none
/// if the case requests none.
pub(super) fn promise(scene: &mut Scene, target: Option<f64>, findings: &mut Findings) {
    let flow = match kinds::find(scene) {
        Ok(flow) => flow,
        Err(reason) => {
            say_nothing(scene, target, &reason, findings);
            return;
        }
    };
    let mut reasons = BTreeMap::new();
    let mut answers = asked(scene, &flow);
    for answer in &mut answers {
        let found = known(&flow.kind, answer.kind);
        let error = found.map_or_else(
            || {
                Err(format!(
                    "no error was measured for this answer of a {}",
                    flow.kind
                ))
            },
            |found| found.error(&flow),
        );
        match error {
            Ok(error) => answer.error = Some(error),
            Err(reason) => {
                reasons.insert(answer.answer.clone(), reason);
            }
        }
    }
    scene.chosen.details = details(&flow, &answers, &reasons);
    let (largest, all) = answers::largest(&answers);
    scene.chosen.promised = largest.filter(|_| all);
    let Some(largest) = largest else {
        let first = reasons.into_values().next();
        let reason = first
            .unwrap_or_else(|| format!("the case has no probe of an answer of a {}", flow.kind));
        scene.chosen.answers = answers;
        scene.chosen.water = Some(flow);
        say_nothing(scene, target, &reason, findings);
        return;
    };
    let text = answers::summary(&answers, &across(&flow));
    scene
        .chosen
        .note(Subject::Accuracy, text.unwrap_or_default());
    if let Some(target) = target.filter(|target| largest > target * (1.0 + 1e-9)) {
        findings.warn(
            "accuracy",
            format!(
                "an error of {} % is requested, but with {} the plan promises {} %",
                number(100.0 * target),
                across(&flow),
                number(100.0 * largest)
            ),
            "use a smaller spacing, or request a lower accuracy",
        );
    }
    scene.chosen.water = Some(flow);
    scene.chosen.answers = answers;
}

/// Records that nothing is promised, with the reason; a case that requests an accuracy has a warning.
fn say_nothing(scene: &mut Scene, target: Option<f64>, reason: &str, findings: &mut Findings) {
    scene.chosen.details.push(reason.to_owned());
    scene.chosen.note(
        Subject::Accuracy,
        format!("nothing is promised: {reason}; {ESTIMATE}"),
    );
    if target.is_some() {
        findings.warn(
            "accuracy",
            format!("the plan promises no error: {reason}"),
            "measure the error with `solver estimate`, which runs the case on several grids",
        );
    }
}

/// Returns the cells across the shortest length, as text.
fn across(flow: &SurfaceFlow) -> String {
    flow.lengths.first().map_or_else(String::new, |length| {
        format!(
            "{} cells across the {} of {} m ({})",
            number(length.cells),
            length.what,
            number(length.size),
            flow.kind
        )
    })
}

/// Returns a line for each answer, each length, and the numbers of the flow.
fn details(
    flow: &SurfaceFlow,
    answers: &[PromisedAnswer],
    reasons: &BTreeMap<String, String>,
) -> Vec<String> {
    let of_answer = |answer: &PromisedAnswer| {
        let name = &answer.answer;
        let Some(error) = answer.error else {
            let reason = reasons.get(name).map_or("", String::as_str);
            return format!("{name}: nothing is promised: {reason}");
        };
        let rows = known(&flow.kind, answer.kind).map_or(0, |found| found.bound.rows);
        answer.sentence(error, rows)
    };
    let of_length = |length: &SurfaceLength| line_of_length(length.what, length.size, length.cells);
    let numbers = format!(
        "{}: cell Reynolds number {}, {} {}",
        flow.kind,
        number(flow.cell_reynolds),
        flow.shape_name,
        number(flow.shape)
    );
    let lines = answers.iter().map(of_answer);
    lines
        .chain(flow.lengths.iter().map(of_length))
        .chain([numbers])
        .collect()
}

/// Returns the answers that the probes of a scene ask for, without errors. Every other probe is an answer of which
/// nothing is known.
fn asked(scene: &Scene, flow: &SurfaceFlow) -> Vec<PromisedAnswer> {
    let mut answers = Vec::new();
    let mut add = |answer: String, kind: &'static str, scale: Option<f64>| {
        answers.push(PromisedAnswer::new(answer, kind, scale));
    };
    for probe in &scene.probes {
        let name = &probe.name;
        let scale = Some(flow.scale);
        match (&probe.at, flow.flow) {
            (ProbeAt::Gauge(_), Flow::StandingWave) => {
                add(format!("{name}: frequency"), "frequency", None);
                let kind = "amplitude after a period";
                add(format!("{name}: {kind}"), kind, scale);
            }
            (ProbeAt::Gauge(cell), Flow::SolitaryWave) => {
                let kinds = if kinds::is_beside_an_end(scene, *cell) {
                    ["time of the run-up", "height of the run-up"]
                } else {
                    ["time of the crest", "height of the crest"]
                };
                add(format!("{name}: {}", kinds[0]), kinds[0], None);
                add(format!("{name}: {}", kinds[1]), kinds[1], scale);
            }
            (ProbeAt::Gauge(cell), Flow::DryDam | Flow::WetDam) => {
                if flow.flow == Flow::DryDam && kinds::is_dry(scene, *cell) {
                    add(format!("{name}: time of arrival"), "time of arrival", None);
                }
                add(
                    format!("{name}: depth at the end"),
                    "depth at the end",
                    scale,
                );
            }
            (ProbeAt::Plane { .. }, Flow::Film | Flow::Sluice) => {
                add(format!("{name}: discharge"), "discharge", None);
            }
            (at, _) => {
                let what = kinds::quantity(at);
                add(format!("{name}: {what}"), what, None);
            }
        }
    }
    answers
}

#[cfg(test)]
mod tests;
