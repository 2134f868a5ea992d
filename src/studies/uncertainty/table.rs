//! The result of an estimate as a table for the terminal, as CSV and as JSON.

use super::answers::{Answer, Answers};
use super::convergence::{Behaviour, Estimate, Limit, Series};
use super::settings::Setting;
use crate::sweep::table::machine;
use base::units::LatticeUnits;
use serde::Serialize;
use serde_json::{Value, json};

/// Drift above which an answer has not settled.
const MIN_UNSETTLED_DRIFT: f64 = 1e-3;
/// Maximum difference, relative to the scale of an answer, that is attributed to rounding, for populations in f64
/// and f32.
const ROUNDING: [f64; 2] = [1e-9, 1e-5];
/// Rounding in lattice units for f64 and f32, applied to pressure, force and other quantities.
const LATTICE_ROUNDING: [f64; 2] = [1e-12, 1e-6];
/// Fraction of the magnitude of a vector below which a component counts as zero.
const ZERO: f64 = 1e-9;

/// Rounding errors of the answers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Units of the lattice, if there is one.
    pub units: Option<LatticeUnits>,
    /// `true` if populations are stored in f32.
    pub single: bool,
    /// Relative change of velocities by collisions in f32; 0 for collisions in f64.
    pub collisions: f64,
}

impl Noise {
    /// Returns the absolute rounding error of a quantity by its unit.
    fn of_unit(self, unit: &str) -> f64 {
        let scale = self.units.map_or(0.0, |units| match unit {
            "Pa" => units.pressure_scale(),
            "N" | "N/m" => units.force_scale(),
            "N m" | "N m/m" => units.torque_to_si(1.0),
            "m/s" => units.velocity_scale(),
            "m2/s" => units.velocity_scale() * units.spacing,
            "m3/s" => units.velocity_scale() * units.spacing.powi(2),
            "rad/s" => 1.0 / units.time_step,
            _ => 0.0,
        });
        scale * LATTICE_ROUNDING[usize::from(self.single)]
    }

    /// Returns `true` if values are zero within rounding.
    fn is_zero(self, mut values: impl Iterator<Item = f64>, answer: &Answer) -> bool {
        let limit = (ZERO * answer.scale).max(self.of_unit(&answer.unit));
        values.all(|value| value.abs() <= limit)
    }

    /// Returns the maximum difference that is attributed to rounding.
    fn rounding(self, answer: &Answer) -> f64 {
        let relative = ROUNDING[usize::from(self.single)].max(self.collisions);
        (relative * answer.scale).max(self.of_unit(&answer.unit))
    }
}

/// Data of a grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridData {
    /// Folder of its run.
    pub folder: String,
    /// Spacing \[m\].
    pub spacing: f64,
    /// Spacing divided by that of the case.
    pub ratio: f64,
    /// Processor time of its run \[s\].
    pub core_seconds: f64,
    /// Reason for missing answers; none if there are answers.
    pub failure: Option<String>,
    /// Answers of its run; none if it failed.
    #[serde(skip)]
    pub answers: Option<Answers>,
}

/// Row of the table: an answer with its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnswerRow {
    /// Name of the answer.
    pub answer: String,
    /// Unit of the answer.
    pub unit: String,
    /// Value in the run of the case.
    pub value: f64,
    /// Values on all grids, from fine to coarse.
    pub values: Vec<f64>,
    /// Estimate from the grids.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// Drift: change in time between the last two tenths of the run.
    pub drift: Option<f64>,
    /// `true` if the answer has settled; none if the drift was not measured.
    pub settled: Option<bool>,
    #[serde(skip)]
    scale: f64,
}

/// Changes of the answers under another value of a setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Name of the setting.
    pub setting: String,
    /// Description of the change: old value to new value.
    pub change: String,
    /// Folder of the run.
    pub folder: String,
    /// Folder of the run that the changes are relative to.
    pub comparison: String,
    /// Reason for missing changes; empty if there are changes.
    pub missing: String,
    /// Changes of the answers.
    pub changes: Vec<AnswerChange>,
}

/// Change of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnswerChange {
    /// Name of the answer.
    pub answer: String,
    /// Value under the setting of the case.
    pub before: f64,
    /// Value under the next more accurate setting.
    pub after: f64,
    /// Difference divided by the scale of the answer.
    pub relative: f64,
}

/// Results of an estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UncertaintyTable {
    /// Scaling of the time step with the spacing, and its consequence.
    pub scaling: String,
    /// Formal order of the method.
    pub formal_order: f64,
    /// Consequence of the number of grids with answers; empty if all have answers.
    pub conclusion: String,
    /// Grids, from fine to coarse.
    pub grids: Vec<GridData>,
    /// Answers with their uncertainties.
    pub answers: Vec<AnswerRow>,
    /// Sensitivities to settings that are independent of the cells.
    pub settings: Vec<Sensitivity>,
    /// Version of the program.
    pub version: String,
}

/// Returns the consequence of the number of grids with answers, if not all have answers.
#[must_use]
pub fn conclusion(grids: &[GridData]) -> String {
    let Some((grid, why)) = grids.iter().find_map(|g| Some((g, g.failure.as_ref()?))) else {
        return String::new();
    };
    let number = grids.iter().filter(|grid| grid.answers.is_some()).count();
    let of = grids.len();
    match number {
        0 | 1 => format!(
            "no estimate exists: {number} of {of} grids gave results, and an estimate requires two; {}: {why}",
            grid.folder
        ),
        2 => format!(
            "the estimate uses two grids, because {number} of {of} gave results; the order is not measured, and \
             the factor of safety is 3"
        ),
        _ => format!("{number} of {of} grids gave results, and the estimate uses these"),
    }
}

/// Returns what is known of an answer in the limit of small cells: the scheme of a seepage is stable, but gradients and
/// velocities have no limit at edges.
fn limit(seepage: bool, answer: &str) -> Limit {
    let local = ["gradient", "velocity", "reynolds", "fastest", "overshoot"];
    if !seepage {
        Limit::Unknown
    } else if local.iter().any(|part| answer.contains(part)) {
        Limit::Stable
    } else {
        Limit::Exists
    }
}

/// Returns the rows of the answers; `at` is the index of the case's grid. `seepage` is `true` for the own cells of a
/// seepage.
#[must_use]
pub fn rows(
    grids: &[GridData],
    at: usize,
    formal: f64,
    seepage: bool,
    noise: Noise,
) -> Vec<AnswerRow> {
    let Some(own) = grids.get(at).and_then(|grid| grid.answers.as_ref()) else {
        return Vec::new();
    };
    let row = |(name, answer): (&String, &Answer)| {
        let known = grids.iter().enumerate().filter_map(|(n, grid)| {
            let value = grid.answers.as_ref()?.get(name)?.value;
            Some((n, (grid.spacing, value)))
        });
        let (places, values): (Vec<usize>, Vec<(f64, f64)>) = known.unzip();
        let same = |v: &(f64, f64)| v.1.to_bits() == answer.value.to_bits();
        // Values with the same bits on all grids are given, not computed; values that are zero by symmetry are
        // rounding.
        let given = values.len() > 1 && values.iter().all(same);
        let zero = noise.is_zero(values.iter().map(|v| v.1), answer);
        if given || zero {
            return None;
        }
        let series = Series {
            at: places.iter().position(|place| *place == at)?,
            formal,
            rounding: noise.rounding(answer),
            limit: limit(seepage, name),
            values,
        };
        Some(AnswerRow {
            answer: name.clone(),
            unit: answer.unit.clone(),
            value: answer.value,
            values: series.values.iter().map(|v| v.1).collect(),
            estimate: series.estimate(),
            drift: answer.drift,
            settled: answer.drift.map(|drift| drift <= MIN_UNSETTLED_DRIFT),
            scale: answer.scale,
        })
    };
    own.iter().filter_map(row).collect()
}

/// Returns the changes of the answers under a setting.
#[must_use]
pub fn sensitivity(
    setting: &Setting,
    [folder, comparison]: [&str; 2],
    [before, after]: [Option<&Answers>; 2],
    missing: &str,
    noise: Noise,
) -> Sensitivity {
    let mut changes = Vec::new();
    for (before, after) in before.into_iter().zip(after) {
        for (name, old) in before {
            let Some(new) = after.get(name) else { continue };
            let zero = noise.is_zero([old.value, new.value].into_iter(), old);
            let relative = (new.value - old.value) / old.scale.max(f64::MIN_POSITIVE);
            if !zero && relative.is_finite() {
                changes.push(AnswerChange {
                    answer: name.clone(),
                    before: old.value,
                    after: new.value,
                    relative,
                });
            }
        }
    }
    changes.sort_by(|a, b| b.relative.abs().total_cmp(&a.relative.abs()));
    Sensitivity {
        setting: setting.name.to_owned(),
        change: setting.change.clone(),
        folder: folder.to_owned(),
        comparison: comparison.to_owned(),
        missing: missing.to_owned(),
        changes,
    }
}

impl AnswerRow {
    /// Returns the uncertainty divided by the value.
    #[must_use]
    pub fn relative(&self) -> Option<f64> {
        let relative = self.estimate.uncertainty? / self.value.abs();
        Some(relative).filter(|r| r.is_finite())
    }

    /// Returns the causes of a half width above a fifth of the value, the strongest first; `None` for a narrower
    /// interval.
    #[must_use]
    pub fn why_wide(&self) -> Option<String> {
        self.relative().filter(|half| *half > WIDE_INTERVAL)?;
        let mut causes: Vec<String> = Vec::new();
        if self.value.abs() < SMALL_VALUE * self.scale {
            causes.push(format!(
                "the value is only {} of {:.3e}, the scale of its quantity: it is a small difference of large \
                 terms",
                percent(Some(self.value.abs() / self.scale)),
                self.scale
            ));
        }
        if self.settled == Some(false) {
            causes.push(format!(
                "the value still changes by {} in a tenth of the run: run longer",
                percent(self.drift.map(f64::abs))
            ));
        }
        causes.push(match self.estimate.behaviour {
            Behaviour::TwoGrids => {
                "two grids show no order, so that the factor is 3 at first order: a third grid narrows the \
                 interval"
                    .to_owned()
            }
            Behaviour::Slow | Behaviour::Scattered => {
                "the cells are too coarse for a value whose edges lie anywhere in a cell: use finer cells"
                    .to_owned()
            }
            Behaviour::Oscillating => {
                "the value rises and falls from grid to grid: the coarser grids do not resolve gaps or edges"
                    .to_owned()
            }
            Behaviour::Monotone => format!(
                "the order {} is below the formal one: the cells are too coarse for this value",
                self.estimate
                    .observed_order
                    .map_or_else(String::new, |p| format!("{p:.2}"))
            ),
            Behaviour::Fast => {
                "its order is above that of the method, so that the factor is 3".to_owned()
            }
            _ => {
                "the value differs this much from grid to grid: the cells are too coarse for it".to_owned()
            }
        });
        Some(causes.join("; "))
    }

    /// Returns a description of the drift of an answer.
    #[must_use]
    pub fn rest(&self) -> String {
        match (self.settled, self.drift) {
            (Some(true), _) => "settled".into(),
            (_, Some(drift)) => format!("not settled, drift {:.2} %", 100.0 * drift),
            _ => "drift not measured (too few samples)".into(),
        }
    }
}

/// Returns a number with five digits, or a dash.
fn five_digits(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |x| format!("{x:.5e}"))
}

fn percent(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |x| format!("{:.2} %", 100.0 * x))
}

/// Returns the answers that the terminal shows: of a line of probes, the one with the largest uncertainty relative
/// to the scale of the line.
fn shown_answers(rows: &[AnswerRow]) -> Vec<(&AnswerRow, usize)> {
    let mut shown: Vec<(&AnswerRow, usize)> = Vec::new();
    let family = |row: &AnswerRow| {
        row.answer
            .split_once(", point ")
            .map(|(stem, _)| stem.to_owned())
    };
    let size = |row: &AnswerRow| {
        row.estimate
            .uncertainty
            .map_or(f64::INFINITY, |u| u / row.scale)
    };
    for row in rows {
        let own = family(row);
        let same = shown
            .iter_mut()
            .find(|(other, _)| own.is_some() && family(other) == own);
        match same {
            Some((worst, number)) => {
                *number += 1;
                if size(row) > size(worst) {
                    *worst = row;
                }
            }
            None => shown.push((row, 1)),
        }
    }
    shown
}

impl UncertaintyTable {
    /// Returns the number of grids with answers.
    #[must_use]
    pub fn usable(&self) -> usize {
        self.grids.iter().filter(|g| g.answers.is_some()).count()
    }

    /// Returns the lines for the terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut lines = self.grid_lines();
        lines.push(String::new());
        lines.extend(self.answer_lines());
        let mut used: Vec<Behaviour> = Vec::new();
        for row in &self.answers {
            if !used.contains(&row.estimate.behaviour) {
                used.push(row.estimate.behaviour);
            }
        }
        if !used.is_empty() {
            lines.push(String::new());
        }
        lines.extend(used.iter().map(|b| format!("{}: {}", b.name(), b.method())));
        lines.extend(self.wide_lines());
        if !self.settings.is_empty() {
            lines.push(String::new());
            lines.push("sensitivity to model settings, not part of the uncertainty".into());
            lines.extend(self.setting_lines());
        }
        lines.join("\n")
    }

    /// Returns a line for each wide interval among the answers that the terminal shows.
    fn wide_lines(&self) -> impl Iterator<Item = String> + '_ {
        shown_answers(&self.answers)
            .into_iter()
            .filter_map(|(row, _)| {
                let why = row.why_wide()?;
                Some(format!("wide interval of {}: {why}", row.answer))
            })
    }

    /// Returns lines on the grids and the conclusion.
    fn grid_lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.grids.len() > 1 {
            lines.push(format!("scaling: {}", self.scaling));
            lines.push(format!("formal order: {}", self.formal_order));
        }
        for grid in &self.grids {
            let failed = grid
                .failure
                .as_ref()
                .map_or_else(String::new, |why| format!(", no results: {why}"));
            lines.push(format!(
                "grid {}: {:.4e} m, {:.3} of the case, {:.1} core-s{failed}",
                grid.folder, grid.spacing, grid.ratio, grid.core_seconds
            ));
        }
        if !self.conclusion.is_empty() {
            lines.push(self.conclusion.clone());
        }
        lines
    }

    /// Returns the answers as aligned lines.
    fn answer_lines(&self) -> Vec<String> {
        let head = [
            "answer",
            "value",
            "uncertainty",
            "",
            "extrapolated",
            "order",
            "series",
            "in time",
        ];
        let mut cells = vec![head.map(str::to_owned)];
        for (row, number) in shown_answers(&self.answers) {
            let estimate = &row.estimate;
            let others = if number > 1 {
                format!(" (worst of {number})")
            } else {
                String::new()
            };
            let unit = if row.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", row.unit)
            };
            cells.push([
                format!("{}{others}", row.answer),
                format!("{}{unit}", five_digits(Some(row.value))),
                match estimate.uncertainty {
                    Some(_) => five_digits(estimate.uncertainty),
                    None => "not promised".to_owned(),
                },
                percent(row.relative()),
                five_digits(estimate.extrapolated),
                estimate
                    .observed_order
                    .map_or_else(|| "-".to_owned(), |p| format!("{p:.2}")),
                estimate.behaviour.name().to_owned(),
                row.rest(),
            ]);
        }
        aligned(&cells)
    }

    /// Returns the sensitivities to settings as aligned lines.
    fn setting_lines(&self) -> Vec<String> {
        let head = ["setting", "change", "answer", "before", "after", "relative"];
        let mut cells = vec![head.map(str::to_owned)];
        for setting in &self.settings {
            let row = |answer: &str, [a, b, c]: [String; 3]| {
                let (name, change) = (setting.setting.clone(), setting.change.clone());
                [name, change, answer.to_owned(), a, b, c]
            };
            let seen: Vec<&AnswerChange> = setting
                .changes
                .iter()
                .filter(|change| change.relative.abs() >= MIN_CHANGE)
                .collect();
            if seen.is_empty() {
                let none = format!("no change of {}", percent(Some(MIN_CHANGE)));
                let text = if setting.missing.is_empty() {
                    &none
                } else {
                    &setting.missing
                };
                cells.push(row(text, Default::default()));
            }
            for change in seen.iter().take(MAX_CHANGES) {
                let numbers = [
                    five_digits(Some(change.before)),
                    five_digits(Some(change.after)),
                    percent(Some(change.relative)),
                ];
                cells.push(row(&change.answer, numbers));
            }
            if seen.len() > MAX_CHANGES {
                let more = format!("{} more in estimate.csv", seen.len() - MAX_CHANGES);
                cells.push(row(&more, Default::default()));
            }
        }
        aligned(&cells)
    }

    /// Returns all rows as CSV.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = format!("# {}, {}\n# {}\n", self.version, machine(), self.scaling);
        for grid in &self.grids {
            let failed = grid.failure.as_ref().map_or_else(String::new, |why| {
                format!(", no results: {}", why.replace(['\n', '\r'], " "))
            });
            text += &format!(
                "# {}: {:e} m, ratio {}, {:.2} core-s{failed}\n",
                grid.folder, grid.spacing, grid.ratio, grid.core_seconds
            );
        }
        if !self.conclusion.is_empty() {
            text += &format!("# {}\n", self.conclusion.replace(['\n', '\r'], " "));
        }
        let head = [
            "kind",
            "answer",
            "unit",
            "value",
            "uncertainty",
            "relative",
            "extrapolated",
            "observed order",
            "order used",
            "factor",
            "series",
            "drift",
            "in time",
            "values from fine to coarse",
        ];
        io::csv::push_line(&mut text, head);
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
        for row in &self.answers {
            let estimate = &row.estimate;
            let values: Vec<String> = row.values.iter().map(|v| format!("{v:e}")).collect();
            io::csv::push_line(
                &mut text,
                [
                    "cells".to_owned(),
                    row.answer.clone(),
                    row.unit.clone(),
                    number(Some(row.value)),
                    number(estimate.uncertainty),
                    number(row.relative()),
                    number(estimate.extrapolated),
                    number(estimate.observed_order),
                    number(estimate.order),
                    number(estimate.factor),
                    estimate.behaviour.name().to_owned(),
                    number(row.drift),
                    row.rest(),
                    values.join(" "),
                ],
            );
        }
        for setting in &self.settings {
            for change in &setting.changes {
                let mut cells = vec![String::new(); head.len()];
                cells[0] = format!("{} {}", setting.setting, setting.change);
                cells[1].clone_from(&change.answer);
                cells[3] = number(Some(change.before));
                cells[5] = number(Some(change.relative));
                cells[13] = format!("{:e} {:e}", change.before, change.after);
                io::csv::push_line(&mut text, cells);
            }
        }
        text
    }

    /// Returns the block of `summary.json`: as the table, with the reason of each method.
    #[must_use]
    pub fn json(&self) -> Value {
        let mut tree = json!(self);
        if let Some(rows) = tree["answers"].as_array_mut() {
            for (row, known) in rows.iter_mut().zip(&self.answers) {
                row["method"] = known.estimate.behaviour.method().into();
                row["relative"] = known.relative().into();
                row["in_time"] = known.rest().into();
                row["why_wide"] = known.why_wide().into();
            }
        }
        tree
    }
}

/// Maximum number of changes of one setting that the terminal shows, the largest first.
const MAX_CHANGES: usize = 6;

/// Minimum change shown in the terminal; smaller ones are in the files only.
const MIN_CHANGE: f64 = 1e-4;

/// Half width divided by the value above which an interval counts as wide.
const WIDE_INTERVAL: f64 = 0.2;

/// Value divided by its scale below which rounding and staircase errors of larger terms dominate its relative
/// width.
const SMALL_VALUE: f64 = 0.1;

/// Returns the rows with columns of equal width.
fn aligned<const N: usize>(rows: &[[String; N]]) -> Vec<String> {
    let width: [usize; N] = std::array::from_fn(|n| {
        let cells = rows.iter().map(|row| row[n].chars().count());
        cells.max().unwrap_or(0)
    });
    let line = |row: &[String; N]| {
        let cells = row
            .iter()
            .zip(width)
            .map(|(cell, width)| format!("{cell:width$}"));
        let line: Vec<String> = cells.collect();
        line.join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(ratio: f64, values: &[(&str, f64, f64)]) -> GridData {
        let answer = |(name, value, drift): &(&str, f64, f64)| {
            let answer = Answer {
                unit: "N".into(),
                value: *value,
                scale: 1.0,
                drift: Some(*drift),
            };
            ((*name).to_owned(), answer)
        };
        GridData {
            folder: format!("grid-{ratio}"),
            spacing: 0.1 * ratio,
            ratio,
            core_seconds: 1.0,
            failure: None,
            answers: Some(values.iter().map(answer).collect()),
        }
    }

    fn table() -> UncertaintyTable {
        let of = |h: f64| {
            [
                ("drag", 1.0 + 0.1 * h * h, 0.0),
                ("given", 7.0, 0.0),
                ("lift", 1e-17 * h, 0.0),
                ("line: u, point 1", 2.0 + h.ln(), 0.034),
                ("line: u, point 2", 2.0 + 0.01 * h * h, 0.0),
            ]
        };
        let grids = [1.0, 2.0, 4.0].map(|h| grid(h, &of(h)));
        let setting = Setting {
            name: "contact stiffness",
            folder: "stiffness",
            change: "x 4".into(),
            case: Value::Null,
        };
        let answers = [&grids[1].answers, &grids[0].answers].map(Option::as_ref);
        UncertaintyTable {
            scaling: "diffusive".into(),
            formal_order: 2.0,
            conclusion: String::new(),
            answers: rows(&grids, 0, 2.0, false, Noise::default()),
            settings: vec![sensitivity(
                &setting,
                ["4-stiffness", "2"],
                answers,
                "",
                Noise::default(),
            )],
            grids: grids.into(),
            version: "solver".into(),
        }
    }

    #[test]
    fn given_values_and_zeros_are_no_answers_and_drift_is_reported() {
        let table = table();
        let names: Vec<&str> = table.answers.iter().map(|r| r.answer.as_str()).collect();
        assert_eq!(names, ["drag", "line: u, point 1", "line: u, point 2"]);
        let drag = &table.answers[0];
        approx::assert_relative_eq!(
            drag.estimate.extrapolated.unwrap(),
            1.0,
            max_relative = 1e-9
        );
        let text = table.text();
        assert!(text.contains("line: u, point 1 (worst of 2)"), "{text}");
        assert!(
            text.contains("not promised") && text.contains("diverging: no uncertainty is given"),
            "{text}"
        );
        assert!(text.contains("not settled, drift 3.40 %"), "{text}");
        assert!(text.contains("contact stiffness  x 4"), "{text}");
    }

    #[test]
    fn a_wide_interval_names_its_causes() {
        let of = |h: f64| {
            [
                ("coarse", 1.0 + 0.5 * h, 0.03),
                ("fine", 1.0 + 0.01 * h * h, 0.0),
                ("small", 0.01 * h, 0.0),
            ]
        };
        let grids = [1.0, 2.0].map(|h| grid(h, &of(h)));
        let rows = rows(&grids, 0, 2.0, false, Noise::default());
        let why: Vec<_> = rows
            .iter()
            .map(|row| row.why_wide().unwrap_or_default())
            .collect();
        assert!(
            why[0].starts_with("the value still changes by 3.00 %")
                && why[0].contains("a third grid"),
            "{}",
            why[0]
        );
        assert_eq!(why[1], "");
        assert!(
            why[2].starts_with("the value is only 1.00 % of"),
            "{}",
            why[2]
        );
    }

    #[test]
    fn grids_without_answers_are_reported_with_their_reason() {
        let mut table = table();
        assert_eq!(conclusion(&table.grids), "");
        for (place, expected) in [
            (2, "the estimate uses two grids"),
            (1, "no estimate exists"),
        ] {
            table.grids[place].answers = None;
            table.grids[place].failure = Some("numerical refusal: too\nfast".into());
            table.conclusion = conclusion(&table.grids);
            assert!(
                table.conclusion.starts_with(expected),
                "{}",
                table.conclusion
            );
        }
        assert!(table.conclusion.contains("too\nfast"));
        let text = table.text();
        assert!(text.contains("no results: numerical refusal"), "{text}");
        let csv = table.csv();
        assert!(
            csv.contains("# grid-4: ") && csv.contains("too fast"),
            "{csv}"
        );
        assert!(table.json()["grids"][1]["failure"].is_string());
    }

    #[test]
    fn csv_and_json_hold_all_rows() {
        let table = table();
        let csv = table.csv();
        let reader = io::csv::Reader::new(&csv);
        assert!(reader.is_some());
        assert!(csv.contains("cells,\"line: u, point 2\",N,"), "{csv}");
        let block = table.json();
        assert_eq!(block["answers"][0]["behaviour"], "asymptotic");
        assert!(
            block["answers"][0]["method"]
                .as_str()
                .unwrap()
                .contains("F = 1.25")
        );
        assert_eq!(block["answers"][1]["settled"], false);
        assert_eq!(
            block["settings"][0]["changes"][0]["answer"],
            "line: u, point 1"
        );
    }
}
