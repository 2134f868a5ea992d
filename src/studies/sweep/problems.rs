//! Problems of a study.

use base::error::Problem;
use case::check;

/// Returns the problem of an unknown name.
pub(crate) fn unknown(path: &str, name: &str, kind: &str, known: &[&str]) -> Problem {
    let remedy = match check::nearest(name, known) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "remove it".into(),
        None => format!("use one of: {}", known.join(", ")),
    };
    problem(
        path,
        &format!("{name:?}"),
        format!("there is no {kind} with this name"),
        &remedy,
    )
}

/// Returns a problem that ends the study.
pub(crate) fn problem(path: &str, value: &str, reason: String, remedy: &str) -> Problem {
    Problem::error(path, value, reason, remedy)
}
