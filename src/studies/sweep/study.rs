//! A study as written: a base case, variations, outputs and references.

use super::latin_hypercube::{Range, Sample};
use super::problems::{problem, unknown};
use analysis::expression;
use analysis::measure::{Measure, Norm, Take};
use base::error::{Problem, Severity};
use case::{check, text};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, MapAccess, Visitor};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::PathBuf;

/// Maximum number of members; more are a slip.
pub(super) const MAX_MEMBERS: usize = 10_000;

/// A parameter study: members of one base case, with error and cost of each.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Title of tables and pictures: one line without control characters.
    #[serde(default)]
    pub title: String,
    /// Description of the study.
    #[serde(default)]
    pub description: String,
    /// Base case: the path of a case file, relative to the study, or the case itself.
    pub case: Value,
    /// Fields of every member by path, as in `--set`. A text that begins with `=` is a formula of other numbers of the
    /// case, evaluated last: `"=domain.spacing/2"`.
    #[serde(default)]
    pub set: BTreeMap<String, Value>,
    /// Variations; every combination is a member. A variation is a field of the case with a list of values, or a name
    /// with named choices that set several fields each, or a field with a range of numbers for `sample`. The first
    /// variation colours the picture.
    #[serde(default)]
    pub vary: Ordered<Variation>,
    /// Draws members from the variations instead of all combinations.
    #[serde(default)]
    pub sample: Option<Sample>,
    /// Members in addition to the combinations.
    #[serde(default)]
    pub members: Vec<Listed>,
    /// Outputs read from the files of each member.
    pub outputs: Ordered<Output>,
    /// References of the outputs. Outputs without a reference are only listed.
    #[serde(default)]
    pub reference: BTreeMap<String, Reference>,
    /// Condition on outputs and numbers of the case, such as `energy < 10*first`. A member that violates it counts as
    /// failed.
    #[serde(default)]
    pub sound: Option<String>,
    /// Output whose error the picture and the Pareto set use. Default: the largest of all errors.
    #[serde(default)]
    pub error: Option<String>,
    /// Variation over which the outputs are averaged, such as the seed of a packing. `ensemble.csv` then has the mean,
    /// the scatter and the 95 % interval of the mean of every output over the members that differ in nothing else.
    #[serde(default)]
    pub ensemble: Option<String>,
    /// Measure of the cost, besides memory.
    #[serde(default)]
    pub cost: Cost,
    /// Treatment of members with the verdict `refused` or `unstable`.
    #[serde(default)]
    pub refused: Refused,
    /// Two variations, along x and y, of a map that compares the outcome of the members with their plans.
    #[serde(default)]
    pub map: Option<[String; 2]>,
    /// Execution of the members.
    #[serde(default)]
    pub run: Run,
}

/// Values of a variation.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Variation {
    /// Values of the field.
    Values(Vec<Value>),
    /// A range of numbers of the field, for `sample`.
    Range(Range),
    /// Fields of the case for each named choice.
    Choices(Ordered<BTreeMap<String, Value>>),
}

/// A single member.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Listed {
    /// Name of the member and of its folder.
    pub name: String,
    /// Fields of the member, as in `set`.
    #[serde(default)]
    pub set: BTreeMap<String, Value>,
}

/// An output of a member: a number or a profile from a `file`, from the `summary`, or from a formula.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Formula of earlier outputs and of numbers of the case by path.
    #[serde(default)]
    pub is: Option<String>,
    /// Formula of a coordinate: the output is then the profile of `of` over it at the last time.
    #[serde(default)]
    pub over: Option<String>,
    /// Norm that compares profiles.
    #[serde(default)]
    pub norm: Norm,
    /// Source of the output.
    #[serde(flatten)]
    pub measure: Measure,
}

/// Reference of an output. The error is relative, or absolute if the reference is 0.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Reference {
    /// A number.
    Number(f64),
    /// Formula of numbers of the case by path.
    Formula(String),
    /// Reference read from a table or from another member.
    Found(FoundReference),
}

/// A reference that is read.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FoundReference {
    /// CSV file in the folder of the study with the columns coordinate and value, for profiles.
    Table(PathBuf),
    /// The member with this name.
    Member(String),
    /// The member with the smallest value of this field among members that are otherwise equal.
    Finest(String),
}

/// Measure of the cost of a member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Cost {
    /// Wall time of the steps times ranks and threads.
    #[default]
    CoreSeconds,
    /// Processor time of the whole run, including its start; suited to shared machines.
    ProcessorTime,
}

/// Treatment of members that the plan refuses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Refused {
    /// The study stops before any run.
    #[default]
    Stop,
    /// The member is listed but not run.
    Record,
    /// The member runs: an unstable one with `--allow-unstable`, a refused one if only limits of the method are
    /// exceeded (`guards.limits` of the case).
    Run,
}

/// Execution of the members.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Run {
    /// MPI ranks per member.
    #[serde(deserialize_with = "check::whole")]
    #[schemars(range(min = 1, max = 100_000))]
    pub ranks: u32,
    /// Threads per rank.
    #[serde(deserialize_with = "check::whole")]
    #[schemars(range(min = 1, max = 1024))]
    pub threads: u32,
    /// Members that run at the same time. Together they may not need more cores than the machine has.
    #[serde(deserialize_with = "check::whole")]
    #[schemars(range(min = 1, max = 1024))]
    pub at_once: u32,
    /// Wall-clock time after which a member is aborted \[s\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_limit: Option<f64>,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            ranks: 1,
            threads: 1,
            at_once: 1,
            time_limit: None,
        }
    }
}

/// An object whose keys keep the order in which they are written.
#[derive(Clone, Debug, PartialEq)]
pub struct Ordered<T>(pub Vec<(String, T)>);

impl<T> Default for Ordered<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Ordered<T> {
    /// Returns the index and value of a key.
    #[must_use]
    pub fn find(&self, key: &str) -> Option<(usize, &T)> {
        let mut all = self.0.iter().enumerate();
        all.find_map(|(n, (name, value))| (name == key).then_some((n, value)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ordered<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Pairs<T> {
            type Value = Ordered<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Ordered<T>, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Ordered(pairs))
            }
        }
        deserializer.deserialize_map(Pairs(PhantomData))
    }
}

impl<T: JsonSchema> JsonSchema for Ordered<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Ordered_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        BTreeMap::<String, T>::json_schema(generator)
    }
}

/// Returns the JSON schema of a study.
#[must_use]
pub fn schema() -> Value {
    check::schema_of::<Study>()
}

/// Reads the text of a document with a schema, which `solver schema NAME` prints.
///
/// # Errors
/// If the text is not JSON or contradicts the schema, with all problems.
pub(crate) fn read_document<T: DeserializeOwned>(
    text: &str,
    schema: &Value,
    name: &str,
) -> Result<T, Vec<Problem>> {
    let (tree, mut problems) = text::parse(text);
    if let Some(mut tree) = tree {
        problems.extend(check::problems_against(schema, &mut tree));
    }
    if !problems.is_empty() {
        for problem in &mut problems {
            if problem.path == "the case" {
                problem.path = "the study".into();
            }
            // The study is read from its text, which must have no field that is null.
            problem.severity = Severity::Error;
        }
        return Err(problems);
    }
    // From the text and not from the tree, which does not keep the order of keys.
    let mut reader = serde_json::Deserializer::from_str(text);
    serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let reason = error.inner().to_string();
        let remedy = format!("compare with `solver schema {name}`");
        vec![problem(
            &error.path().to_string(),
            "not readable",
            reason,
            &remedy,
        )]
    })
}

impl Study {
    /// Reads the text of a study.
    ///
    /// # Errors
    /// If the study is invalid, with all problems that can be found without its case.
    pub fn read(text: &str) -> Result<Self, Vec<Problem>> {
        let study: Self = read_document(text, &schema(), "study")?;
        let problems = study.problems();
        if problems.is_empty() {
            Ok(study)
        } else {
            Err(problems)
        }
    }

    /// Returns the problems of names without a target and of formulas that cannot be read.
    pub(crate) fn problems(&self) -> Vec<Problem> {
        let mut found = Vec::new();
        if self.vary.0.is_empty() && self.members.is_empty() {
            let reason = "the study has no member".into();
            found.push(problem(
                "vary",
                "missing",
                reason,
                "vary a field, or list members",
            ));
        }
        if self.sample.is_none() {
            for (name, variation) in &self.vary.0 {
                if !matches!(variation, Variation::Range(_)) && variation.labels().is_empty() {
                    let reason =
                        "the variation has no value, so that the study has no member".into();
                    let remedy = "add values, or remove the field";
                    found.push(problem(&format!("vary.{name}"), "empty", reason, remedy));
                }
            }
        }
        of_the_sample(self, &mut found);
        for (name, output) in &self.outputs.0 {
            output.problems(&format!("outputs.{name}"), &mut found);
        }
        let outputs: Vec<&str> = self
            .outputs
            .0
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        for (name, reference) in &self.reference {
            let path = format!("reference.{name}");
            let Some((_, output)) = self.outputs.find(name) else {
                found.push(unknown(&path, name, "output", &outputs));
                continue;
            };
            self.reference_problems(&path, reference, output.over.is_some(), &mut found);
        }
        if let Some(formula) = &self.sound {
            check_condition("sound", formula, &mut found);
        }
        if let Some(name) = &self.error
            && !self.reference.contains_key(name)
        {
            let known: Vec<&str> = self.reference.keys().map(String::as_str).collect();
            found.push(unknown("error", name, "output with a reference", &known));
        }
        let varied: Vec<&str> = self.vary.0.iter().map(|(name, _)| name.as_str()).collect();
        for (n, name) in self.map.iter().flatten().enumerate() {
            let path = format!("map[{n}]");
            match self.vary.find(name) {
                None => found.push(unknown(&path, name, "varied field", &varied)),
                Some((_, variation)) if !variation.is_numeric() => {
                    let reason = "the values along an axis of the map must be numbers".into();
                    let remedy =
                        "use a field that takes numbers, or choices that are named by numbers";
                    found.push(problem(&path, name, reason, remedy));
                }
                Some(_) => {}
            }
        }
        self.ensemble_problems(&varied, &mut found);
        found
    }

    fn ensemble_problems(&self, varied: &[&str], found: &mut Vec<Problem>) {
        let Some(name) = &self.ensemble else { return };
        let Some((_, variation)) = self.vary.find(name) else {
            found.push(unknown("ensemble", name, "varied field", varied));
            return;
        };
        let drawn = |Sample::LatinHypercube(sample): &Sample| sample.draws(name);
        if self.sample.as_ref().is_some_and(drawn) {
            let reason = "its values are drawn together with the others, so that no two members differ in it alone";
            let remedy = "give it a list of values and add it to `sample.latin_hypercube.crossed`";
            found.push(problem(
                "ensemble",
                &format!("{name:?}"),
                reason.into(),
                remedy,
            ));
        } else if variation.labels().len() == 1 {
            let reason =
                "the variation has a single value, and a single member has no scatter".into();
            let remedy = "give the variation several values, or leave `ensemble` out";
            found.push(problem("ensemble", &format!("{name:?}"), reason, remedy));
        }
    }

    fn reference_problems(
        &self,
        path: &str,
        reference: &Reference,
        profile: bool,
        found: &mut Vec<Problem>,
    ) {
        let of_profiles = !matches!(reference, Reference::Number(_) | Reference::Formula(_));
        let of_numbers = !matches!(reference, Reference::Found(FoundReference::Table(_)));
        if profile && !of_profiles {
            let reason =
                "the output is a profile, which requires a table or a member as reference".into();
            let remedy = "write {\"table\": ..}, {\"member\": ..} or {\"finest\": ..}";
            found.push(problem(path, "a number", reason, remedy));
        } else if !profile && !of_numbers {
            let reason = "the output is a number, which cannot be compared with a table".into();
            found.push(problem(
                path,
                "a table",
                reason,
                "give the output `over`, or a number here",
            ));
        }
        match reference {
            Reference::Formula(formula) => check_formula(path, formula, found),
            Reference::Found(FoundReference::Finest(name)) => {
                let varied = self.vary.find(name);
                if !varied.is_some_and(|(_, variation)| variation.is_numeric()) {
                    let names = self.vary.0.iter().filter(|(_, v)| v.is_numeric());
                    let known: Vec<&str> = names.map(|(name, _)| name.as_str()).collect();
                    found.push(unknown(path, name, "varied field with numbers", &known));
                }
            }
            _ => {}
        }
    }
}

impl Variation {
    /// Returns the labels of the values or choices, in order; none for a range, whose values are drawn.
    pub(crate) fn labels(&self) -> Vec<String> {
        match self {
            Self::Range(_) => Vec::new(),
            Self::Values(values) => values.iter().map(label).collect(),
            Self::Choices(choices) => choices.0.iter().map(|(name, _)| name.clone()).collect(),
        }
    }

    /// Returns `true` if all labels are numbers.
    pub(crate) fn is_numeric(&self) -> bool {
        self.labels()
            .iter()
            .all(|label| label.parse::<f64>().is_ok())
    }
}

/// Returns a value in a table: a text without its quotes, else JSON.
pub(crate) fn label(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        // As it would be written by hand: 2.5e-5, not 0.000025.
        Value::Number(number) => match number.as_f64() {
            Some(x) if x != 0.0 && !(1e-3..1e6).contains(&x.abs()) => format!("{x:e}"),
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

impl Output {
    fn problems(&self, path: &str, found: &mut Vec<Problem>) {
        let Measure {
            summary,
            file,
            of,
            rows,
            take,
        } = &self.measure;
        let ways = [&self.is, summary, file].into_iter().flatten().count();
        if ways != 1 {
            let reason = format!(
                "exactly one of `is`, `summary` and `file` must give the number, but {ways} of them are present"
            );
            found.push(problem(path, "ambiguous", reason, "keep one of them"));
        }
        if file.is_some() && of.is_none() && *take != Take::Count {
            let reason = "the formula of the rows is missing".into();
            found.push(problem(
                &format!("{path}.of"),
                "missing",
                reason,
                "add a formula of the columns",
            ));
        }
        if self.over.is_some() && file.is_none() {
            let reason = "a profile is read from a file".into();
            found.push(problem(
                &format!("{path}.over"),
                "without file",
                reason,
                "add `file`",
            ));
        }
        let formulas = [
            ("is", &self.is),
            ("of", of),
            ("where", rows),
            ("over", &self.over),
        ];
        for (field, formula) in formulas {
            if let Some(formula) = formula {
                check_formula(&format!("{path}.{field}"), formula, found);
            }
        }
    }
}

/// Adds a problem if a formula cannot be read whatever names are defined.
pub(crate) fn check_formula(path: &str, formula: &str, found: &mut Vec<Problem>) {
    if let Err(error) = expression::evaluate(formula, &|_| Some(1.0)) {
        let remedy = "write numbers, names, + - * / ^ and brackets";
        let reason = error.to_string();
        found.push(problem(path, &expression::excerpt(formula), reason, remedy));
    }
}

/// Adds a problem if a formula cannot be read, or compares nothing: a number is almost never exactly 0, so that it
/// would count as true.
pub(crate) fn check_condition(path: &str, formula: &str, found: &mut Vec<Problem>) {
    let before = found.len();
    check_formula(path, formula, found);
    if found.len() == before && !formula.contains(['<', '>']) {
        let reason =
            "a condition needs a comparison: a number alone counts as true whenever it is above 0"
                .into();
        let remedy = "write for example speed > 1e-3";
        found.push(problem(path, &expression::excerpt(formula), reason, remedy));
    }
}

/// Adds the problems of the sample of a study and of the ranges that it uses.
fn of_the_sample(study: &Study, found: &mut Vec<Problem>) {
    for (name, variation) in &study.vary.0 {
        let Variation::Range(range) = variation else {
            continue;
        };
        let path = format!("vary.{name}");
        range.problems(&path, found);
        let crossed = |Sample::LatinHypercube(drawn): &Sample| !drawn.draws(name);
        if study.sample.as_ref().is_none_or(crossed) {
            let reason = "a range has no values of its own: they are drawn".into();
            let remedy = "add `sample` and remove the range from `crossed`, or write a list";
            found.push(problem(&path, "a range", reason, remedy));
        }
    }
    let Some(Sample::LatinHypercube(drawn)) = &study.sample else {
        return;
    };
    let names: Vec<&str> = study.vary.0.iter().map(|(name, _)| name.as_str()).collect();
    for (n, name) in drawn.crossed.iter().enumerate() {
        if !names.contains(&name.as_str()) {
            let path = format!("sample.latin_hypercube.crossed[{n}]");
            found.push(unknown(&path, name, "varied field", &names));
        }
    }
    for (name, variation) in &study.vary.0 {
        if !matches!(variation, Variation::Range(_)) && variation.labels().is_empty() {
            let reason = "there is no value to draw".into();
            let remedy = "add values, or remove the field";
            found.push(problem(&format!("vary.{name}"), "empty", reason, remedy));
        }
    }
    if !names.iter().any(|name| drawn.draws(name)) {
        let reason = "no variation is drawn".into();
        let remedy = "add a variation that is not in `crossed`, or remove `sample`";
        found.push(problem("sample", "empty", reason, remedy));
    }
    let crossed = study.vary.0.iter().filter(|(name, _)| !drawn.draws(name));
    let mut counts = crossed.map(|(_, variation)| variation.labels().len().max(1));
    let all = counts.try_fold(drawn.members as usize, usize::checked_mul);
    if all.is_none_or(|all| all > MAX_MEMBERS) {
        let reason = format!("more than {MAX_MEMBERS} members");
        found.push(problem("sample", "too many", reason, "draw or cross fewer"));
    }
    if study.map.is_some() {
        let reason = "a map compares all combinations of two variations".into();
        let remedy = "remove `map`, or remove `sample`";
        found.push(problem("map", "with a sample", reason, remedy));
    }
}
