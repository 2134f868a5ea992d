//! Answers with promised errors, for scenes whose measured rows have a kind of scene and a kind of answer: ground
//! ([`ground`](super::ground)) and free surfaces ([`surface`](super::surface)).
//!
//! The rows of a kind of scene and an answer give a bound by the method of [`bound`](super::bound).

use super::bound::{Bound, Point};
use crate::scene::findings::number;
use serde::Serialize;
use std::collections::BTreeMap;

/// Fraction of the rows below a bound, and the margin m of its factor 1 + m/k for k problems. The errors of the rows
/// of one problem are correlated, so that both are larger than those of lattices.
const FRACTION: f64 = 0.975;
const MARGIN: f64 = 5.0;
/// Minimum number of problems of a bound.
const MIN_PROBLEMS: usize = 4;

/// Proposal where nothing is promised.
pub(super) const ESTIMATE: &str =
    "`solver estimate` runs the case on other cells and gives an interval for each answer";

/// Kind of scene and kind of answer.
pub(super) type Kind = (&'static str, &'static str);

/// Error promised for an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PromisedAnswer {
    /// Name of the answer, as `solver estimate` prints it.
    pub answer: String,
    /// Kind of the answer, as in the table of measured errors.
    pub kind: &'static str,
    /// Bound of the error at a confidence of 95 % \[1\]; none if no row covers the answer.
    pub error: Option<f64>,
    /// Value to which the error is relative, in the unit of the answer; none for the answer itself.
    pub scale: Option<f64>,
}

impl PromisedAnswer {
    /// Returns an answer without an error.
    pub(super) fn new(answer: String, kind: &'static str, scale: Option<f64>) -> Self {
        Self {
            answer,
            kind,
            error: None,
            scale,
        }
    }

    /// Returns the sentence of a bound of the error, which covers a number of measured rows.
    pub(super) fn sentence(&self, error: f64, rows: usize) -> String {
        let percent = number(100.0 * error);
        let within = match self.scale {
            Some(scale) => format!(
                "{} ({percent} % of {})",
                number(error * scale),
                number(scale)
            ),
            None => format!("{percent} %"),
        };
        let name = &self.answer;
        format!("{name}: within {within}, the 95 % confidence bound of {rows} measured rows")
    }
}

/// Returns the line of a length \[m\] and the cells across it.
pub(super) fn line_of_length(what: &str, size: f64, cells: f64) -> String {
    format!("{what}, {} m, {} cells", number(size), number(cells))
}

/// Returns the rows by kind.
pub(super) fn groups<R>(
    rows: &'static [R],
    kind: impl Fn(&'static R) -> Kind,
) -> BTreeMap<Kind, Vec<&'static R>> {
    let mut groups: BTreeMap<_, Vec<&'static R>> = BTreeMap::new();
    for row in rows {
        groups.entry(kind(row)).or_default().push(row);
    }
    groups
}

/// Returns the bound of measured points with the problem of each; none for too few problems.
pub(super) fn bound_of(points: &[Point], problems: Vec<&'static str>) -> Option<Bound> {
    let bound =
        (!points.is_empty()).then(|| Bound::of_points(points, problems, [FRACTION, MARGIN]))?;
    (bound.problems.len() >= MIN_PROBLEMS).then_some(bound)
}

/// Returns the largest promised error, and `true` if every answer has one.
pub(super) fn largest(answers: &[PromisedAnswer]) -> (Option<f64>, bool) {
    let largest = answers.iter().filter_map(|a| a.error).reduce(f64::max);
    (largest, answers.iter().all(|answer| answer.error.is_some()))
}

/// Returns the sentence about the promised errors with these cells; none if there are none.
pub(super) fn summary(answers: &[PromisedAnswer], cells: &str) -> Option<String> {
    let promised = answers.iter().filter_map(|a| Some((a.kind, a.error?)));
    let of_kinds: BTreeMap<&str, f64> = promised.collect();
    let parts: Vec<String> = of_kinds
        .iter()
        .map(|(kind, error)| format!("{kind} {} %", number(100.0 * error)))
        .collect();
    let rest = match answers.iter().filter(|a| a.error.is_none()).count() {
        0 => String::new(),
        missing => format!("; nothing for {missing} answers, which `solver plan --details` lists"),
    };
    (!parts.is_empty()).then(|| {
        format!(
            "{} at a confidence of 95 %, with {cells}{rest}",
            parts.join(", ")
        )
    })
}
