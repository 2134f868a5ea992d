//! Limits of the method, and the margin of a case to each.

use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::{Flow, PATH};
use base::error::Remedy;
use serde::Serialize;

/// Usual upper bound of the lattice velocity, stated as "typically lower than" by Sibille, Lominé and Marot (2012).
pub const USUAL_LATTICE_VELOCITY: f64 = 0.1;

/// Limit, and the value of the case for it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// Name of the limit.
    pub limit: String,
    /// Value of the case.
    pub value: f64,
    /// Largest or smallest allowed value.
    pub allowed: f64,
    /// Used fraction of the limit; above 1 the limit is exceeded.
    pub used: f64,
    /// JSON path of the field that determines the value.
    pub path: String,
}

pub(super) fn margin(limit: &str, value: f64, allowed: f64, path: &str) -> Margin {
    Margin {
        limit: limit.into(),
        value,
        allowed,
        used: value / allowed,
        path: path.into(),
    }
}

/// Used fraction above which a limit counts as exceeded; values written with few digits may lie slightly beyond it.
const EXCEEDED: f64 = 1.0 + 1e-5;

/// Reports every exceeded limit that no check has reported at its field: no line of the margins exceeds its limit
/// without a finding. The findings of a refused case are those of the checks, because some limits have their finding at
/// the field that determines the time step.
pub(super) fn report_exceeded(margins: &[Margin], findings: &mut Findings) {
    if findings.refused() {
        return;
    }
    for margin in margins.iter().filter(|margin| margin.used > EXCEEDED) {
        if findings.concerns(&margin.path) {
            continue;
        }
        findings.warn(
            &margin.path,
            format!(
                "`{}` is {}, and its limit is {}: beyond it the method is not known to hold",
                margin.limit,
                number(margin.value),
                number(margin.allowed)
            ),
            "change this field until `solver plan` shows at most 100 % of the limit",
        );
    }
}

/// Smallest relaxation time that is proposed: below it stability depends on the operator and the walls, not on the
/// time step.
const MIN_PROPOSED: f64 = 0.505;

/// Proposes the fraction `part` of the time step through the field that determines it, if the resulting relaxation
/// time is stable.
pub(super) fn slower_clock(flow: &Flow, h: f64, part: f64, text: String) -> Remedy {
    let dt = at_most(part * flow.time_step);
    let above = 3.0 * flow.kinematic_viscosity * part * flow.time_step / (h * h);
    let remedy = Remedy::from(text);
    if part >= 1.0 || 0.5 + above < MIN_PROPOSED {
        return remedy;
    }
    match flow.fixed_by {
        "relaxation_time" => remedy.set(format!("{PATH}.relaxation_time"), 0.5 + at_most(above)),
        "time_step" | "accuracy" => remedy.set(format!("{PATH}.time_step"), dt),
        _ => remedy,
    }
}

#[cfg(test)]
mod tests {
    use super::{margin, report_exceeded};
    use crate::scene::findings::Findings;
    use base::error::Severity;
    use case::{Case, Document};
    use std::path::Path;

    fn case() -> Case {
        let text = case::examples::find("poiseuille").unwrap().text;
        Document::read(text, &[], Path::new(".")).unwrap().case
    }

    #[test]
    fn a_limit_is_exceeded_with_a_finding_at_its_field() {
        let case = case();
        let mut findings = Findings::new(&case);
        let held = margin("a limit that holds", 0.2, 0.2, "time.end");
        let fails = margin("film", 0.2492, 0.2, "fluid.lattice_boltzmann.density");
        report_exceeded(&[held, fails.clone()], &mut findings);
        assert_eq!(findings.problems.len(), 1);
        let found = &findings.problems[0];
        assert_eq!(found.path, fails.path);
        assert_eq!(found.severity, Severity::Warning);
        assert!(
            found
                .reason
                .contains("`film` is 0.2492, and its limit is 0.2")
        );
        // A limit with a finding of its own gets no second one.
        report_exceeded(&[fails.clone(), fails], &mut findings);
        assert_eq!(findings.problems.len(), 1);
    }
}
