//! Check of the outputs of a study against the tables that its members will write, before the first member runs.

use super::study::{Output, Study};
use analysis::expression::evaluate;
use analysis::measure::Take;
use base::error::Problem;
use case::set;
use output::probe_columns;
use plan::scene::Scene;
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeSet;

/// Returns the problems of the outputs of a member, given its case and scene.
pub(super) fn check(study: &Study, case: &Value, scene: &Scene) -> Vec<Problem> {
    let mut found = Vec::new();
    let mut named: BTreeSet<&str> = BTreeSet::new();
    for (name, output) in &study.outputs.0 {
        let known = |word: &str| {
            named.contains(word) || set::lookup(case, word).is_some_and(Value::is_number)
        };
        found.extend(of_output(name, output, scene, &known));
        named.insert(name);
    }
    found
}

fn of_output(
    name: &str,
    output: &Output,
    scene: &Scene,
    known: &dyn Fn(&str) -> bool,
) -> Vec<Problem> {
    let path = |field: &str| format!("outputs.{name}.{field}");
    if let Some(formula) = &output.is {
        return unknown(&path("is"), formula, &[], known)
            .into_iter()
            .collect();
    }
    let measure = &output.measure;
    let Some(file) = measure.file.as_ref().filter(|_| measure.summary.is_none()) else {
        return Vec::new();
    };
    // The columns of these tables are not checked.
    if simulation::TABLES.contains(&file.as_str()) {
        return Vec::new();
    }
    let probe = file
        .strip_prefix("probe_")
        .and_then(|rest| rest.strip_suffix(".csv"));
    let probe = scene.probes.iter().find(|p| Some(p.name.as_str()) == probe);
    let Some(probe) = probe else {
        let tables: Vec<String> = scene
            .probes
            .iter()
            .map(|probe| format!("probe_{}.csv", probe.name))
            .collect();
        return vec![Problem::error(
            path("file"),
            format!("{file:?}"),
            "no run of this study writes this table",
            if tables.is_empty() {
                "add a probe to `probes` of the case".to_owned()
            } else {
                format!("tables of its probes: {}", tables.join(", "))
            },
        )];
    };
    let columns = probe_columns(scene, &probe.at);
    let formulas = [
        ("of", measure.of.as_ref()),
        ("where", measure.rows.as_ref()),
        ("over", output.over.as_ref()),
        ("take", of_take(&measure.take)),
    ];
    let formulas = formulas
        .into_iter()
        .filter_map(|(field, formula)| Some((field, formula?)));
    formulas
        .filter_map(|(field, formula)| unknown(&path(field), formula, &columns, known))
        .collect()
}

/// Returns the formula of the columns in a reduction.
fn of_take(take: &Take) -> Option<&String> {
    match take {
        Take::Cosine(formula)
        | Take::Sine(formula)
        | Take::LargestError(formula)
        | Take::MeanError(formula)
        | Take::TableError { at: formula, .. } => Some(formula),
        _ => None,
    }
}

/// Returns the problem of a formula that cannot be read, or that uses a name that is neither a column nor another
/// known number.
pub(crate) fn unknown(
    path: &str,
    formula: &str,
    columns: &[&str],
    known: &dyn Fn(&str) -> bool,
) -> Option<Problem> {
    let strange: RefCell<Option<String>> = RefCell::new(None);
    let value = evaluate(formula, &|word| {
        if columns.contains(&word) || known(word) {
            return Some(1.0);
        }
        strange.borrow_mut().get_or_insert_with(|| word.to_owned());
        None
    });
    let error = value.err()?;
    let remedy = match (strange.into_inner(), columns) {
        (None, _) => "correct the formula".to_owned(),
        (Some(_), []) => {
            "refer to earlier outputs by name, or to numbers of the case by path".to_owned()
        }
        (Some(word), columns) => {
            let near = case::check::nearest(&word, columns);
            let near = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            format!("{near}Columns: {}", columns.join(", "))
        }
    };
    Some(Problem::error(
        path,
        format!("{formula:?}"),
        error.to_string(),
        remedy,
    ))
}

#[cfg(test)]
mod tests {
    use super::super::members::members;
    use super::*;
    use serde_json::json;
    use std::path::Path;

    fn problems(outputs: &Value) -> Vec<Problem> {
        let case = case::examples::find("poiseuille").unwrap().text;
        let study = json!({
            "case": serde_json::from_str::<Value>(case).unwrap(),
            "vary": {"time.end": [0.1, 0.2]},
            "outputs": outputs,
        });
        let study = Study::read(&study.to_string()).unwrap();
        members(&study, Path::new("")).err().unwrap_or_default()
    }

    #[test]
    fn wrong_columns_and_tables_are_found_before_a_member_runs() {
        let good = json!({
            "a": {"file": "probe_profile.csv", "of": "velocity_x", "where": "x > 0"},
            "ratio": {"is": "a/fluid.lattice_boltzmann.kinematic_viscosity"},
            "steps": {"summary": "steps"}
        });
        assert_eq!(problems(&good), []);
        for (field, value, path, remedy) in [
            ("of", "velocity", "outputs.a.of", "velocity_x"),
            ("where", "z_ > 0", "outputs.a.where", "Columns: step, time"),
            (
                "file",
                "probe_prfile.csv",
                "outputs.a.file",
                "probe_profile.csv",
            ),
        ] {
            let mut wrong = good.clone();
            wrong["a"][field] = value.into();
            let found = problems(&wrong);
            assert_eq!(found.len(), 1, "{found:#?}");
            assert!(
                found[0].path.ends_with(path) && found[0].remedy.contains(remedy),
                "{found:#?}"
            );
        }
        let mut wrong = good;
        wrong["ratio"]["is"] = "w/2".into();
        assert!(problems(&wrong)[0].path.ends_with("outputs.ratio.is"));
    }
}
