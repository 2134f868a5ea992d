//! Remedies of unstable findings, judged as the case itself.
//!
//! The values that a finding proposes answer this finding; the case with them may have another one. Each proposal is
//! therefore applied and the case planned again. Where another finding remains, its proposal is added, and where that
//! leads to no stable case, the remedy proposes no values and names what remains.

use crate::Plan;
use base::error::{Assignment, Problem, Remedy, Severity};
use case::Document;
use std::path::Path;

/// Maximum number of findings in a row whose proposals are put together.
const ROUNDS: usize = 4;

/// Replaces the remedies of unstable findings that propose values by those that make the case stable. `canonical` is
/// the case as text with the folder of its files.
pub(super) fn judge(canonical: (&str, &Path), like: Option<&Plan>, findings: &mut [Problem]) {
    for problem in findings {
        if problem.severity == Severity::Unstable && !problem.remedy.proposal().is_empty() {
            problem.remedy = judged(canonical, like, &problem.remedy);
        }
    }
}

/// Returns the remedy with values that make the case stable, or without values and with what remains.
fn judged(canonical: (&str, &Path), like: Option<&Plan>, remedy: &Remedy) -> Remedy {
    let mut values = remedy.proposal().to_vec();
    let mut included = Vec::new();
    for _ in 0..ROUNDS {
        let left = remaining(canonical, like, &values);
        let Some(first) = left.first() else {
            if included.is_empty() {
                return remedy.clone();
            }
            let text = format!(
                "{}; the values include those that {} would need then",
                &**remedy,
                included.join(", ")
            );
            let whole = Remedy::from(text);
            let set = |all: Remedy, one: Assignment| all.set(one.path, one.value);
            return values.into_iter().fold(whole, set);
        };
        let next = left.iter().find(|p| adds(&values, p.remedy.proposal()));
        let Some(next) = next else {
            return Remedy::from(format!(
                "{}; this is not enough for `{}`: {}",
                &**remedy, first.path, &*first.remedy
            ));
        };
        included.push(format!("`{}`", next.path));
        values.extend(next.remedy.proposal().iter().cloned());
    }
    Remedy::from(format!(
        "{}; this is not enough for {}",
        &**remedy,
        included.join(", ")
    ))
}

/// Returns `true` if a proposal sets fields, and none that is set already.
fn adds(values: &[Assignment], proposal: &[Assignment]) -> bool {
    let is_set = |one: &Assignment| values.iter().any(|value| value.path == one.path);
    !proposal.is_empty() && !proposal.iter().any(is_set)
}

/// Returns the errors and unstable findings of the case with these values.
fn remaining(
    (text, directory): (&str, &Path),
    like: Option<&Plan>,
    values: &[Assignment],
) -> Vec<Problem> {
    let set: Vec<String> = values
        .iter()
        .map(|one| format!("{}={}", one.path, one.value))
        .collect();
    let found = match Document::read(text, &set, directory) {
        Ok(document) => Plan::judged_from(document, like).1,
        Err(problems) => problems,
    };
    let counts = |p: &Problem| p.severity != Severity::Warning;
    found.into_iter().filter(counts).collect()
}
