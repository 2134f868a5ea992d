//! A search for a threshold as written: base case, searched field, outputs and criterion.

use crate::section::{Section, Tolerance};
use crate::sweep::problems::problem;
use crate::sweep::study::{
    Cost, Ordered, Output, Refused, Run, Study, Variation, check_condition, read_document,
};
use base::error::Problem;
use case::check;
use case::check::optional_whole;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A search for the value of a field at which a criterion changes: runs of one case that differ in this field and in
/// those that depend on it.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThresholdStudy {
    /// Title: one line without control characters.
    #[serde(default)]
    pub title: String,
    /// Description of the search.
    #[serde(default)]
    pub description: String,
    /// Base case: the path of a case file, relative to the study, or the case itself.
    pub case: Value,
    /// Fields of every member by path, as in `--set`. A text that begins with `=` is a formula of other numbers of the
    /// case, evaluated last; it makes fields depend on the searched one: `"=500*(gravity[0]/9)^2"`.
    #[serde(default)]
    pub set: BTreeMap<String, Value>,
    /// The searched field and its interval.
    pub search: SearchedField,
    /// Outputs read from the files of each member, for the criterion.
    #[serde(default)]
    pub outputs: Ordered<Output>,
    /// Condition on outputs and numbers of the case, such as `moved > 0.001`. The search finds where it changes.
    pub criterion: String,
    /// Treatment of members with the verdict `refused` or `unstable`. A member that is listed but not run has no
    /// verdict on the criterion.
    #[serde(default)]
    pub refused: Refused,
    /// Execution of the members.
    #[serde(default)]
    pub run: Run,
}

/// A field and the interval in which its threshold is searched.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchedField {
    /// Path of a number of the case, in whose unit the interval is.
    pub field: String,
    /// Lower end of the interval.
    pub from: f64,
    /// Upper end of the interval.
    pub to: f64,
    /// Width of the interval at which the search ends. A relative width needs an interval without 0.
    pub tolerance: Tolerance,
    /// Number of parts into which each round divides the interval: its members, one fewer, are independent of each
    /// other. The result depends on it and not on `run.at_once`. Default: one more than `run.at_once`.
    #[serde(default, deserialize_with = "optional_whole")]
    #[schemars(range(min = 2, max = 1025))]
    pub parts: Option<u32>,
}

/// Returns the JSON schema of a search.
#[must_use]
pub fn schema() -> Value {
    check::schema_of::<ThresholdStudy>()
}

impl ThresholdStudy {
    /// Reads the text of a search.
    ///
    /// # Errors
    /// If the text is invalid, with all problems that can be found without its case.
    pub fn read(text: &str) -> Result<Self, Vec<Problem>> {
        let study: Self = read_document(text, &schema(), "threshold")?;
        let problems = study.problems();
        if problems.is_empty() {
            Ok(study)
        } else {
            Err(problems)
        }
    }

    /// Returns the interval.
    #[must_use]
    pub fn section(&self) -> Section {
        let search = &self.search;
        Section {
            from: search.from,
            to: search.to,
            tolerance: search.tolerance,
            parts: search.parts.unwrap_or(self.run.at_once + 1),
        }
    }

    /// Returns the sweep whose members have these values of the searched field.
    #[must_use]
    pub fn with_values(&self, values: &[f64]) -> Study {
        // As text, so that a whole number suits a field of integers.
        let written = |value: &f64| serde_json::from_str(&value.to_string()).unwrap_or_default();
        let values = values.iter().map(written).collect();
        Study {
            title: self.title.clone(),
            description: String::new(),
            case: self.case.clone(),
            set: self.set.clone(),
            vary: Ordered(vec![(self.search.field.clone(), Variation::Values(values))]),
            sample: None,
            ensemble: None,
            members: Vec::new(),
            outputs: self.outputs.clone(),
            reference: BTreeMap::new(),
            sound: None,
            error: None,
            cost: Cost::default(),
            refused: self.refused,
            map: None,
            run: self.run.clone(),
        }
    }

    fn problems(&self) -> Vec<Problem> {
        let mut found = self.with_values(&[self.search.from]).problems();
        let SearchedField {
            ref field,
            from,
            to,
            tolerance,
            parts,
        } = self.search;
        if from >= to {
            let reason = format!("the interval ends at {to}, which is not above its beginning");
            let remedy = "write the smaller number as `from`";
            found.push(problem("search.from", &from.to_string(), reason, remedy));
        }
        if !(to - from).is_finite() {
            let reason = "the width of the interval is not a finite number".into();
            let remedy = "use a narrower interval";
            found.push(problem("search.to", &to.to_string(), reason, remedy));
        }
        if matches!(tolerance, Tolerance::Relative(_)) && from <= 0.0 && to >= 0.0 {
            let reason = format!(
                "the interval from {from} to {to} contains 0, where a relative width is not defined"
            );
            let remedy = "write {\"absolute\": ..} in the unit of the field";
            found.push(problem("search.tolerance", "relative", reason, remedy));
        }
        if let Some(parts) = parts
            && self.run.at_once > 2.max(parts - 1)
        {
            let reason = format!("a round of {parts} parts has {} members", parts - 1);
            let remedy = format!("use at most {}, or more search.parts", 2.max(parts - 1));
            let value = self.run.at_once.to_string();
            found.push(problem("run.at_once", &value, reason, &remedy));
        }
        if self.set.contains_key(field) {
            let reason = "the search sets this field, so that it cannot have another value".into();
            let remedy = "leave it out of `set`";
            found.push(problem(&format!("set.{field}"), "searched", reason, remedy));
        }
        for (name, output) in &self.outputs.0 {
            if output.over.is_some() {
                let reason = "a criterion compares numbers, and this output is a profile".into();
                let remedy = "remove `over`, and reduce the rows with `take`";
                found.push(problem(
                    &format!("outputs.{name}.over"),
                    "a profile",
                    reason,
                    remedy,
                ));
            }
        }
        check_condition("criterion", &self.criterion, &mut found);
        found
    }
}
