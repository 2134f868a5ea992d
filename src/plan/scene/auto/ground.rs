//! Errors promised for seepage without grains, and the spacing that keeps a requested error.
//!
//! A row of `measured_ground.csv` is an answer of a scene on one grid, with its error against an exact solution or
//! much finer cells. Its number of cells is counted across the shortest length that the cells must resolve
//! ([`lengths`]): height and length of the ground, stretches between the edges of heads, the depth of a wall and the
//! ground below it, layers, the capillary length, the length over which water moves in the run. Its error is the
//! largest at this number of cells and at every larger one of the scene.
//!
//! The rows of a kind of ground and an answer give a bound by the method of [`bound`](super::bound), under which 97.5
//! % of them lie, with the margin 1 + 5/k for k problems. The plan promises the bound for each answer that the case
//! asks for, and none for ground that no row covers. Errors are those of cells and steps in time: material values,
//! hysteresis and closed ends are not among them.
//!
//! | answer | error relative to |
//! |---|---|
//! | discharge, volume of water, exit gradient | the value itself |
//! | head | the range of imposed and initial heads, at least the height of ground with suction |
//! | phreatic line | the height of the ground |
//! | uplift, thrust and moment | the pressure of the range of heads over the base or depth, times the lever |
//! | front: where the pressure head along a line is half of that at the start | the height of the ground |

mod lengths;

use super::answers::{self, ESTIMATE, Kind, PromisedAnswer, line_of_length};
use super::bound::{Bound, Point};
use super::spacing::{SEEPAGE_CELLS, Spacing, fits_one, whole_cells};
use super::{Subject, measured, requested_accuracy};
use crate::scene::Scene;
use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::{Findings, number};
use crate::scene::observe::ProbeAt;
use crate::scene::seepage::Seepage;
use crate::scene::structures::Structure;
use base::number::{real, whole};
use case::Case;
use case::darcy::InitialState;
pub use lengths::{Ground, GroundLength};
use lengths::{INFILTRATION, MIN_LAYER, WITHIN_CELLS};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

const TABLE: &str = include_str!("measured_ground.csv");
const TABLE_GRADED: &str = include_str!("measured_graded.csv");
/// Divisor of N w²: the errors of the cells at the edges and of those farther away are then about equal at a value of
/// 1.
const WIDENING: f64 = 4.0;
/// Smallest measured error of the fit: below it lie rounding and the references.
const MIN_ERROR: f64 = 1e-5;
/// Largest bound that the plan promises. Next to a front, heads have no smaller bound, because they change there by
/// their whole range.
const MAX_ERROR: f64 = 0.3;
/// Measured error of an answer on one grid.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    /// Kind of ground.
    ground: String,
    /// Kind of answer.
    answer: String,
    /// Scene with its parameters.
    problem: String,
    /// Cells across the shortest length.
    cells: f64,
    /// Widening of the cells.
    #[serde(default)]
    widening: f64,
    /// Largest error on this grid and finer ones.
    error: f64,
}

/// Returns all rows.
fn rows() -> &'static [Row] {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| {
        let mut rows = measured::read(TABLE);
        rows.extend(measured::read(TABLE_GRADED));
        rows
    });
    &ROWS
}

/// Returns the second feature of a bound, which stands in the place of its Reynolds number.
fn growth(cells: f64, widening: f64) -> f64 {
    cells * widening * widening / WIDENING
}

fn bound_of(rows: &[&'static Row]) -> Option<Bound> {
    let points: Vec<Point> = (rows.iter())
        .map(|row| Point {
            cells: row.cells,
            reynolds: growth(row.cells, row.widening),
            error: row.error.max(MIN_ERROR),
        })
        .collect();
    answers::bound_of(
        &points,
        rows.iter().map(|row| row.problem.as_str()).collect(),
    )
}

/// Returns the rows by kind of ground and kind of answer.
fn groups() -> BTreeMap<Kind, Vec<&'static Row>> {
    answers::groups(rows(), |row| (&row.ground, &row.answer))
}

/// Returns the bound of an answer in a kind of ground; none if it was not measured.
fn bound(ground: &str, answer: &str) -> Option<&'static Bound> {
    static BOUNDS: LazyLock<BTreeMap<Kind, Bound>> = LazyLock::new(|| {
        let found = groups()
            .into_iter()
            .filter_map(|(key, rows)| Some((key, bound_of(&rows)?)));
        found.collect()
    });
    let found = BOUNDS
        .iter()
        .find(|((g, a), _)| *g == ground && *a == answer);
    found.map(|(_, bound)| bound)
}

/// Computes the errors promised for the answers of a scene, with cells that the case states or leaves free.
pub(super) fn promise(
    scene: &mut Scene,
    case: &Case,
    target: Option<f64>,
    findings: &mut Findings,
) {
    let ground = match Ground::new(scene, case) {
        Ok(ground) => ground,
        Err(reason) => {
            scene.chosen.note(
                Subject::Accuracy,
                format!("nothing is promised: {reason}; {ESTIMATE}"),
            );
            return;
        }
    };
    let Some(seepage) = &scene.seepage else {
        return;
    };
    let cells = ground.cells();
    let mut answers = asked(scene, seepage, &ground);
    for answer in &mut answers {
        let found = bound(&ground.kind, answer.kind);
        answer.error = found
            .and_then(|bound| bound.error(cells, growth(cells, ground.widening)))
            .filter(|error| *error <= MAX_ERROR);
    }
    scene.chosen.details = details(&ground, &answers);
    let text = summary(&ground, &answers);
    scene.chosen.note(Subject::Accuracy, text);
    let (largest, all) = answers::largest(&answers);
    scene.chosen.promised = largest.filter(|_| all);
    if let (Some(target), Some(largest), Some(length)) = (target, largest, ground.lengths.first())
        && largest > target * (1.0 + 1e-9)
    {
        let what = &length.what;
        findings.warn(
            "accuracy",
            format!(
                "an error of {} % is requested, but with {} cells across the {what} of {} m the plan promises {} %",
                number(100.0 * target),
                number(cells),
                number(length.size),
                number(100.0 * largest)
            ),
            "use smaller cells, or request a lower accuracy",
        );
    }
    scene.chosen.ground = Some(ground);
    scene.chosen.answers = answers;
}

/// Returns the sentence of the plan about the promised errors.
fn summary(ground: &Ground, answers: &[PromisedAnswer]) -> String {
    let Some(length) = ground.lengths.first() else {
        return format!("nothing is promised: the ground has no extent; {ESTIMATE}");
    };
    let widening = match ground.widening {
        widening if widening > 0.0 => format!(
            ", and cells that widen by {} of their distance from edges",
            number(widening)
        ),
        _ => String::new(),
    };
    let across = format!(
        "{} cells across the {} of {} m, the shortest length ({}){widening}",
        number(length.cells),
        length.what,
        number(length.size),
        ground.kind
    );
    answers::summary(answers, &across).unwrap_or_else(|| {
        format!("nothing is promised: no measured row covers {across}; {ESTIMATE}")
    })
}

/// Returns a line for each answer and each length.
fn details(ground: &Ground, answers: &[PromisedAnswer]) -> Vec<String> {
    let of_answer = |answer: &PromisedAnswer| {
        let name = &answer.answer;
        let Some(error) = answer.error else {
            return format!(
                "{name}: no measured row gives this {} a bound of at most {} %",
                answer.kind,
                number(100.0 * MAX_ERROR)
            );
        };
        let rows = bound(&ground.kind, answer.kind).map_or(0, |bound| bound.rows);
        answer.sentence(error, rows)
    };
    let of_length = |length: &GroundLength| line_of_length(&length.what, length.size, length.cells);
    let lines = answers.iter().map(of_answer);
    lines.chain(ground.lengths.iter().map(of_length)).collect()
}

/// Returns the results that a scene requests, without errors.
fn asked(scene: &Scene, seepage: &Seepage, ground: &Ground) -> Vec<PromisedAnswer> {
    let mut answers = Vec::new();
    let mut add = |answer: String, kind: &'static str, scale: Option<f64>| {
        answers.push(PromisedAnswer::new(answer, kind, scale));
    };
    let (up, across) = (ground.up, 1 - ground.up);
    let height = seepage.axis(up).length(0, seepage.cells[up]);
    let weight = seepage.written.density * scene.gravity[up].abs();
    // A front enters ground that starts under one suction; heads change there by all of their range.
    let transient = (seepage.written.unsaturated.as_ref()).and_then(|s| s.transient.as_ref());
    let dry = ground.kind == INFILTRATION
        && transient.is_some_and(|t| matches!(t.initial, InitialState::PressureHead(_)));
    let head = if dry { "head near a front" } else { "head" };
    for probe in &scene.probes {
        let name = &probe.name;
        match &probe.at {
            ProbeAt::Section { .. } | ProbeAt::Crossing { .. } => {
                add(format!("{name}: discharge"), "discharge", None);
            }
            ProbeAt::Point(_) => add(format!("{name}: head"), head, Some(ground.drop)),
            ProbeAt::Line { .. } => {
                add(format!("{name}: head"), head, Some(ground.drop));
                if dry {
                    add(format!("{name}: front"), "front", Some(height));
                }
            }
            ProbeAt::WaterTable(_) => {
                let axis = ["x", "y"][up];
                add(format!("{name}: {axis}"), "phreatic line", Some(height));
            }
            ProbeAt::WaterBalance => {
                add(format!("{name}: water_in"), "water", None);
                add(format!("{name}: water_out"), "water", None);
            }
            ProbeAt::Uplift {
                axis, part, about, ..
            } if *axis == up => {
                let [low, high] = ends_of(seepage, part.as_ref(), across);
                let width = high - low;
                let force = weight * ground.drop * width;
                let lever = (low - about[across])
                    .abs()
                    .max((high - about[across]).abs());
                add(format!("{name}: force"), "uplift", Some(force));
                let scale = force * lever.max(width);
                add(format!("{name}: torque_z"), "moment", Some(scale));
            }
            ProbeAt::Structure { index, about, .. } => {
                let of_water = scene.structures.iter().filter(|s| s.stops.water());
                let parts = of_water.zip(ground.parts.iter());
                let Some((structure, [width, depth])) = parts.into_iter().nth(*index) else {
                    continue;
                };
                let push = |size: f64| weight * ground.drop * size;
                let size = width.max(*depth);
                let [along, upright] = [across, up].map(|a| ["x", "y"][a]);
                add(
                    format!("{name}: fluid_force_{upright}"),
                    "uplift on a structure",
                    Some(push(*width)),
                );
                if *depth > 0.0 {
                    let kind = "thrust on a structure";
                    add(
                        format!("{name}: fluid_force_{along}"),
                        kind,
                        Some(push(*depth)),
                    );
                }
                add(
                    format!("{name}: fluid_torque_z"),
                    "moment on a structure",
                    Some(push(size) * lever(structure, *about).max(size)),
                );
            }
            ProbeAt::Uplift { .. } => add(format!("{name}: force"), "thrust on a plane", None),
            ProbeAt::Heave(_) => add(format!("{name}: factor_of_safety"), "heave", None),
            _ => {}
        }
    }
    if seepage.is_transient() {
        add("seepage.water_in".into(), "water", None);
        add("seepage.water_out".into(), "water", None);
    } else {
        add("seepage.outflow".into(), "discharge", None);
    }
    for name in bounded_exits(scene, seepage, ground) {
        add(
            format!("seepage.exit_gradients.{name}.gradient"),
            "exit gradient",
            None,
        );
    }
    answers
}

/// Returns the largest distance of a corner of a structure from a point along an axis \[m\]; 0 for an infinite
/// structure.
fn lever(structure: &Structure, about: [f64; 3]) -> f64 {
    let corners = structure.solid.solid().extent();
    let along = |a: usize| {
        let [low, high] = [0, 1].map(|k| (corners[k][a] - about[a]).abs());
        low.max(high)
    };
    Some(along(0).max(along(1)))
        .filter(|lever| lever.is_finite())
        .unwrap_or(0.0)
}

/// Returns the ends of a part of a plane along an axis, within the grid \[m\].
fn ends_of(seepage: &Seepage, part: Option<&AlignedBox>, axis: usize) -> [f64; 2] {
    let (low, high) = (seepage.origin[axis], seepage.axis(axis).end());
    part.map_or([low, high], |part| {
        [part.from[axis].max(low), part.to[axis].min(high)]
    })
}

/// Returns the names of the patches whose exit gradient is finite: each of their ends is an end of the ground or a
/// wall that reaches the face. At any other end of a head the gradient grows without bound as cells become finer.
fn bounded_exits<'a>(scene: &Scene, seepage: &'a Seepage, ground: &Ground) -> Vec<&'a str> {
    let (up, along) = (ground.up, 1 - ground.up);
    if seepage.written.unsaturated.is_some() {
        return Vec::new();
    }
    let head = |patch: &crate::scene::seepage::SeepagePatch| match patch.condition {
        darcy::Condition::Head { value } => Some(value),
        _ => None,
    };
    let highest = seepage
        .patches
        .iter()
        .filter_map(head)
        .fold(f64::NEG_INFINITY, f64::max);
    let of_written = seepage.patches.iter().zip(&seepage.written.boundaries);
    let found = of_written.filter(|(patch, written)| {
        let leaves = head(patch).is_some_and(|head| head < highest);
        let Some(extent) = written
            .patch
            .as_ref()
            .filter(|_| leaves && patch.face.axis() == up)
        else {
            return false;
        };
        let low = seepage.origin[along];
        let high = seepage.axis(along).end();
        let near = 0.51 * seepage.spacing[along];
        let level = if patch.face.is_max() {
            seepage.axis(up).end()
        } else {
            seepage.origin[up]
        };
        let ends = [extent.from.to_array()[along], extent.to.to_array()[along]];
        ends.into_iter().all(|end| {
            let outside = end <= low || end >= high;
            let walled = scene
                .structures
                .iter()
                .filter(|s| s.stops.water())
                .any(|structure| {
                    structure.solid.extents().any(|[from, to]| {
                        let reaches = from[up] < level - seepage.spacing[up] && to[up] > level
                            || !patch.face.is_max()
                                && to[up] > level + seepage.spacing[up]
                                && from[up] < level;
                        reaches && from[along] - near <= end && end <= to[along] + near
                    })
                });
            outside || walled
        })
    });
    found.map(|(patch, _)| patch.name.as_str()).collect()
}

/// Returns the spacing for which the plan promises the requested error of a seepage, if it differs from that of the
/// scene.
pub(crate) fn promised_spacing(case: &Case, scene: &Scene) -> Option<Spacing> {
    let target = requested_accuracy(case)?.target();
    // Findings about the sizes were already reported for the first cells.
    let found = spacing(case, scene, target, &mut Findings::new(case))?;
    let changes = (found.value / scene.grid.spacing - 1.0).abs() > 1e-9;
    changes.then_some(found)
}

/// Returns the spacing with which a scene keeps a requested error, if the case states no cells and rows cover its
/// answers. `scene` is the case on other cells. Edges of conditions lie on faces of cells if a spacing allows it.
pub(super) fn spacing(
    case: &Case,
    scene: &Scene,
    target: f64,
    findings: &mut Findings,
) -> Option<Spacing> {
    let seepage = scene.seepage.as_ref()?;
    let free = case.domain.spacing.is_none() && seepage.written.grid.is_none();
    if !free || scene.has_solids() {
        return None;
    }
    let ground = Ground::new(scene, case).ok()?;
    let length = ground.lengths.first()?;
    let base = ground.kind.trim_end_matches(WITHIN_CELLS).to_owned();
    let answers = asked(scene, seepage, &ground);
    // Length of the shortest length over one cell, in isotropic ground.
    let isotropic = length.cells * scene.grid.spacing * ground.stretch;
    // Layers may be thin, but not thinner than any measured one.
    let layers = ground.lengths.iter().filter(|length| !length.counts);
    let most = layers
        .map(|layer| layer.cells * scene.grid.spacing / MIN_LAYER)
        .fold(f64::INFINITY, f64::min);
    let wanted = |kind: &str| {
        let bounds = answers.iter().filter_map(|answer| bound(kind, answer.kind));
        let cells = bounds
            .map(|bound| bound.cells_for(target, 0.0))
            .reduce(f64::max)?;
        Some(((isotropic / (cells * ground.stretch)).min(most), cells))
    };
    let sizes = &case.domain.size.0;
    let coarsest = (sizes.iter().product::<f64>() / SEEPAGE_CELLS).sqrt();
    let shortest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let reason = |cells: f64| {
        format!(
            "at least {} cells across the {} of {} m, for an error of {} %",
            number(cells),
            length.what,
            number(length.size),
            number(100.0 * target)
        )
    };
    if let Some((h, cells)) = wanted(&base) {
        let h = h.max(coarsest);
        let least = (shortest / h - 1e-9).ceil().max(MIN_CELLS);
        let spacings = (0..=whole(least)).map(|more| shortest / (least + real(more)));
        let mut fitting = spacings.filter(|h| sizes.iter().all(|size| fits_one(*size, *h)));
        if let Some(h) = fitting.find(|h| ground.is_aligned([*h, *h])) {
            return Some(Spacing::chosen(h, reason(cells)));
        }
    }
    let (h, cells) = wanted(&format!("{base}{WITHIN_CELLS}"))?;
    let h = h.max(coarsest).min(shortest / MIN_CELLS);
    whole_cells(case, h, reason(cells), findings)
}

/// Minimum number of cells along the shortest edge; the plan warns of fewer.
const MIN_CELLS: f64 = 5.0;

#[cfg(test)]
mod tests;
