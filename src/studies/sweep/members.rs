//! The members of a study: every combination of the variations or a sample of them, and the listed members, each with
//! its case checked and planned.

use super::latin_hypercube::{Sample, choice};
use super::problems::{problem, unknown};
use super::study::{FoundReference, MAX_MEMBERS, Reference, Refused, Study, Variation, label};
use analysis::expression;
use base::error::{Problem, Severity, Verdict};
use case::text::MAX_PROBLEMS;
use case::{Document, annotation, set, text};
use plan::Plan;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Maximum number of fields of one member set by formulas: each of them is searched for in all the others.
const MAX_FORMULAS: usize = 100;
/// Field that allows a member beyond the limits to run.
const LIMITS: &str = "guards.limits";

/// Member of a study.
#[derive(Clone, Debug)]
pub struct Member {
    /// Name of the member and of its folder.
    pub name: String,
    /// Value of each varied field, in the order of the variations; none if a listed member does not have the field.
    pub labels: Vec<Option<String>>,
    /// Case as a JSON tree.
    pub case: Value,
    /// Verdict of the plan on the case.
    pub verdict: Verdict,
    /// Findings of the plan.
    pub problems: Vec<Problem>,
    /// Case to run; none if the case cannot be run.
    pub prepared: Option<Prepared>,
}

/// Case that can be run.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// Case as text.
    pub text: String,
    /// Hash of the text.
    pub hash: String,
    /// Planned time on one core \[s\].
    pub seconds: f64,
    /// Planned memory of all ranks \[bytes\].
    pub memory: f64,
}

impl Member {
    /// Returns a number of the member's case by path.
    #[must_use]
    pub fn number(&self, path: &str) -> Option<f64> {
        set::lookup(&self.case, path).and_then(Value::as_f64)
    }

    /// Returns the member's value of a varied field as a number.
    #[must_use]
    pub fn value(&self, varied: usize) -> Option<f64> {
        self.labels.get(varied)?.as_ref()?.parse().ok()
    }
}

/// Name, labels and settings of a member before its case is made.
struct Draft {
    name: String,
    labels: Vec<Option<String>>,
    set: Vec<(String, Value)>,
}

/// Returns all members with their cases; relative paths in the study start at `study_folder`.
///
/// # Errors
/// If the study or a member is invalid, with all problems.
pub fn members(study: &Study, study_folder: &Path) -> Result<Vec<Member>, Vec<Problem>> {
    let (base, directory) = base(study, study_folder)?;
    let drafts = drafts(study)?;
    let mut found = names(&drafts, study);
    let mut members = Vec::new();
    // A finding that applies to many members is printed once, with the first of them and its value.
    let mut said: BTreeMap<(String, String), (usize, usize)> = BTreeMap::new();
    for draft in drafts {
        if found.len() >= MAX_PROBLEMS {
            break;
        }
        let (member, problems) = make(study, &base, &directory, draft);
        for mut problem in problems {
            let key = (problem.path.clone(), problem.reason.clone());
            let (at, count) = said.entry(key).or_insert((found.len(), 0));
            *count += 1;
            if *count == 1 {
                problem.path = format!("member {}: {}", member.name, problem.path);
                found.push(problem);
            } else if let Some(first) = found.get_mut(*at) {
                let others = format!(" (as in {} more members)", *count - 1);
                let reason = first.reason.split(" (as in ").next().unwrap_or_default();
                first.reason = format!("{reason}{others}");
            }
        }
        members.push(member);
    }
    if found.is_empty() {
        Ok(members)
    } else {
        Err(found)
    }
}

/// Returns the tree of the base case and the folder from which its paths start.
fn base(study: &Study, study_folder: &Path) -> Result<(Value, PathBuf), Vec<Problem>> {
    let one =
        |value: &str, reason: String, remedy: &str| vec![problem("case", value, reason, remedy)];
    let (mut tree, directory) = match &study.case {
        Value::String(path) => {
            let file = study_folder.join(path);
            let text = io::plain::text(&file, io::plain::LONGEST_CASE).map_err(|e| {
                one(
                    path,
                    format!("the case cannot be used: {e}"),
                    "write a path from the folder of the study",
                )
            })?;
            let (tree, problems) = text::parse(&text);
            let tree = tree.filter(|_| problems.is_empty()).ok_or(problems)?;
            (tree, file.parent().unwrap_or(Path::new("")).to_path_buf())
        }
        tree @ Value::Object(_) => (tree.clone(), study_folder.to_path_buf()),
        other => {
            let reason = "a case is an object, or the path of a file".into();
            return Err(one(&other.to_string(), reason, "write one of them"));
        }
    };
    annotation::strip(&mut tree);
    Ok((tree, directory))
}

fn drafts(study: &Study) -> Result<Vec<Draft>, Vec<Problem>> {
    if study.sample.is_none() {
        let variations = study.vary.0.iter();
        let mut counts = variations.map(|(_, variation)| variation.labels().len());
        let all = counts.try_fold(1_usize, usize::checked_mul);
        if all.is_none_or(|all| all > MAX_MEMBERS) {
            let reason = format!("more than {MAX_MEMBERS} combinations");
            let remedy = "vary fewer fields or values";
            return Err(vec![problem("vary", "too many", reason, remedy)]);
        }
    }
    if study.members.len() > MAX_MEMBERS {
        let value = format!("{} members", study.members.len());
        let reason = format!("more than {MAX_MEMBERS} members are listed");
        return Err(vec![problem(
            "members",
            &value,
            reason,
            "list fewer, or vary a field",
        )]);
    }
    let mut grid = varied(study);
    grid.extend(study.members.iter().map(|listed| Draft {
        name: file_name(&listed.name),
        labels: vec![None; study.vary.0.len()],
        set: listed.set.clone().into_iter().collect(),
    }));
    Ok(grid)
}

/// Returns the members of the variations: all combinations, or the draws of the sample with the combinations of the
/// variations that are crossed with them.
fn varied(study: &Study) -> Vec<Draft> {
    let draft = |name: String| Draft {
        name,
        labels: Vec::new(),
        set: Vec::new(),
    };
    let sample = study.sample.as_ref().map(|sample| {
        let Sample::LatinHypercube(sample) = sample;
        sample
    });
    // Each member with the number of its draw.
    let mut grid: Vec<(usize, Draft)> = match sample {
        None if study.vary.0.is_empty() => Vec::new(),
        None => vec![(0, draft(String::new()))],
        Some(sample) => {
            let digits = sample.members.to_string().len();
            (0..sample.members as usize)
                .map(|n| (n, draft(format!("draw-{:0digits$}", n + 1))))
                .collect()
        }
    };
    for (place, (field, variation)) in study.vary.0.iter().enumerate() {
        if let Some(sample) = sample.filter(|sample| sample.draws(field)) {
            let places = sample.places(place);
            for (n, draft) in &mut grid {
                let (label, set) = variation.value_at(field, places[*n]);
                draft.labels.push(Some(label));
                draft.set.extend(set);
            }
            continue;
        }
        let short = file_name(short_name(field, study));
        let labels = variation.labels();
        grid = grid
            .iter()
            .flat_map(|(number, draft)| {
                labels.iter().enumerate().map(|(n, label)| {
                    let mut set = draft.set.clone();
                    set.extend(variation.set(field, n));
                    let between = if draft.name.is_empty() { "" } else { "_" };
                    let name = format!("{}{between}{short}={}", draft.name, file_name(label));
                    let mut labels = draft.labels.clone();
                    labels.push(Some(label.clone()));
                    (*number, Draft { name, labels, set })
                })
            })
            .collect();
    }
    grid.into_iter().map(|(_, draft)| draft).collect()
}

impl Variation {
    /// Returns the fields set by value number `n`; none for a range.
    fn set(&self, field: &str, n: usize) -> Vec<(String, Value)> {
        match self {
            Self::Values(values) => {
                let value = values.get(n);
                value
                    .map(|value| (field.to_owned(), value.clone()))
                    .into_iter()
                    .collect()
            }
            Self::Choices(choices) => {
                let fields = choices.0.get(n).map(|(_, fields)| fields.clone());
                fields.unwrap_or_default().into_iter().collect()
            }
            Self::Range(_) => Vec::new(),
        }
    }

    /// Returns the label and fields of the value at a position from 0 to 1.
    fn value_at(&self, field: &str, place: f64) -> (String, Vec<(String, Value)>) {
        if let Self::Range(range) = self {
            let value = Value::from(range.quantile(place));
            return (label(&value), vec![(field.to_owned(), value)]);
        }
        let labels = self.labels();
        let n = choice(place, labels.len());
        (
            labels.get(n).cloned().unwrap_or_default(),
            self.set(field, n),
        )
    }
}

/// Returns the last word of a path, or the whole path where two varied fields share that word.
fn short_name<'a>(field: &'a str, study: &Study) -> &'a str {
    let last = |path: &'a str| path.rsplit('.').next().unwrap_or(path);
    let same = study
        .vary
        .0
        .iter()
        .filter(|(other, _)| other.rsplit('.').next() == Some(last(field)));
    if same.count() > 1 { field } else { last(field) }
}

/// Returns a text as part of a folder's name, with each run of characters special to a shell replaced by one `-`.
fn file_name(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-' | '+' | '=') {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('-') {
            name.push('-');
        }
    }
    name.trim_end_matches('-').to_owned()
}

/// Returns problems for names that are empty, duplicate, or referred to without being defined.
fn names(drafts: &[Draft], study: &Study) -> Vec<Problem> {
    let mut found = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for draft in drafts {
        if draft.name.trim_matches('.').is_empty() || seen.contains(&draft.name.as_str()) {
            let reason = "every member needs a unique name with letters or digits".into();
            let remedy = "use other names, or remove a duplicate value";
            found.push(problem(
                "members",
                &format!("{:?}", draft.name),
                reason,
                remedy,
            ));
        }
        seen.push(&draft.name);
        if found.len() >= MAX_PROBLEMS {
            return found;
        }
    }
    for (output, reference) in &study.reference {
        if let Reference::Found(FoundReference::Member(name)) = reference
            && !seen.contains(&name.as_str())
        {
            found.push(unknown(
                &format!("reference.{output}.member"),
                name,
                "member",
                &seen,
            ));
        }
    }
    found
}

/// Returns a member, and the problems that prevent the study from running.
fn make(study: &Study, base: &Value, directory: &Path, draft: Draft) -> (Member, Vec<Problem>) {
    let mut case = base.clone();
    let common = study
        .set
        .iter()
        .map(|(path, value)| (path.clone(), value.clone()));
    let mut found = set_fields(&mut case, common.chain(draft.set));
    let mut labels = draft.labels;
    for (known, (field, variation)) in labels.iter_mut().zip(&study.vary.0) {
        // The name of named choices is not a field, although it may resemble one.
        if known.is_none() && !matches!(variation, Variation::Choices(_)) {
            *known = set::lookup(&case, field).map(label);
        }
    }
    let plan =
        |case: &Value| Document::read(&case.to_string(), &[], directory).and_then(Plan::prepare);
    let mut planned = plan(&case);
    let problems = match &planned {
        Ok(plan) => plan.warnings.clone(),
        Err(problems) => problems.clone(),
    };
    let verdict = Verdict::from_findings(&problems);
    let allowed = study.refused == Refused::Run;
    if verdict == Verdict::Refused && allowed {
        found.extend(set_fields(
            &mut case,
            [(LIMITS.to_owned(), "warn".into())].into_iter(),
        ));
        planned = plan(&case);
    }
    if let Ok(plan) = &planned {
        found.extend(super::outputs::check(study, &case, &plan.scene));
    }
    let planned = planned.ok().filter(|_| allowed || verdict.runs(false));
    if planned.is_none() && study.refused == Refused::Stop {
        let heavy = problems.iter().filter(|p| p.severity != Severity::Warning);
        found.extend(heavy.cloned());
    }
    let prepared = planned.map(|plan| Prepared {
        text: plan.case_text,
        hash: plan.case_hash,
        seconds: plan.estimate.seconds_on_one_core,
        memory: plan.estimate.memory_bytes,
    });
    let member = Member {
        name: draft.name,
        labels,
        case,
        verdict,
        problems,
        prepared,
    };
    (member, found)
}

/// Returns the formula to evaluate next: one that uses no field that is still to be set, or the first formula if they
/// form a cycle.
fn next_formula(formulas: &[(String, String)]) -> Option<usize> {
    let waits = |(own, formula): &(String, String)| {
        let others = formulas.iter().filter(|(path, _)| path != own);
        others.into_iter().any(|(path, _)| formula.contains(path))
    };
    let free = formulas.iter().position(|formula| !waits(formula));
    free.or_else(|| (!formulas.is_empty()).then_some(0))
}

/// Sets fields of a case. Formulas are evaluated after everything else, because they may use any number, also one
/// that another formula sets.
fn set_fields(case: &mut Value, fields: impl Iterator<Item = (String, Value)>) -> Vec<Problem> {
    let mut found = Vec::new();
    let mut formulas = Vec::new();
    for (path, value) in fields {
        match &value {
            Value::String(text) if text.starts_with('=') => {
                formulas.push((path, text[1..].to_owned()));
            }
            _ => found.extend(
                set::apply(case, &format!("{path}={value}"))
                    .err()
                    .map(|p| *p),
            ),
        }
    }
    if formulas.len() > MAX_FORMULAS {
        let value = format!("{} formulas", formulas.len());
        let reason = format!("at most {MAX_FORMULAS} fields of a member are set by formulas");
        found.push(problem("set", &value, reason, "write numbers instead"));
        return found;
    }
    while let Some(next) = next_formula(&formulas) {
        let (path, formula) = formulas.remove(next);
        let known = |name: &str| set::lookup(case, name).and_then(Value::as_f64);
        match expression::evaluate(&formula, &known) {
            Ok(number) => {
                let text = format!("{path}={number}");
                found.extend(set::apply(case, &text).err().map(|p| *p));
            }
            Err(error) => {
                let remedy = "refer to numbers of the case by their path, such as domain.spacing";
                found.push(problem(
                    &path,
                    &expression::excerpt(&format!("={formula}")),
                    error.to_string(),
                    remedy,
                ));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::examples;
    use serde_json::json;

    fn study(change: impl Fn(&mut Value)) -> Result<Vec<Member>, Vec<Problem>> {
        let mut tree: Value = serde_json::from_str(examples::STUDY.text).unwrap();
        change(&mut tree);
        let study = Study::read(&tree.to_string())?;
        members(&study, Path::new(""))
    }

    #[test]
    fn a_formula_may_name_what_another_formula_sets() {
        let mut case = json!({"a": 1, "b": 2, "c": 3});
        let fields = [("a", "=b*10"), ("b", "=c+1"), ("c", "=7")];
        let fields = fields.map(|(path, value)| (path.to_owned(), json!(value)));
        assert_eq!(set_fields(&mut case, fields.into_iter()).len(), 0);
        assert_eq!(case, json!({"a": 80, "b": 8, "c": 7}));
    }

    #[test]
    fn every_combination_is_a_member_with_a_readable_name() {
        let study = Study::read(examples::STUDY.text).unwrap();
        let members = members(&study, Path::new("")).unwrap();
        assert_eq!(members.len(), 2 * 3 * 3);
        let last = &members[17];
        assert_eq!(last.name, "operator=trt_spacing=2.5e-5_relaxation_time=1.5");
        assert_eq!(last.number("domain.spacing"), Some(2.5e-5));
        // Formulas use the values of the variations.
        assert_eq!(last.number("probes[0].at.plane.position"), Some(1.25e-5));
        assert_eq!(last.value(1), Some(2.5e-5));
        assert_eq!(last.value(0), None);
        assert!(members.iter().all(|m| m.verdict == Verdict::Valid));
        let hashes: std::collections::BTreeSet<_> = members
            .iter()
            .map(|m| m.prepared.as_ref().unwrap().hash.clone())
            .collect();
        assert_eq!(hashes.len(), members.len());
    }

    #[test]
    fn listed_members_stand_beside_the_grid() {
        let members = study(|tree| {
            tree["members"] = json!([{"name": "by hand", "set": {"time.end": 2}}]);
        })
        .unwrap();
        let last = members.last().unwrap();
        assert_eq!((members.len(), last.name.as_str()), (19, "by-hand"));
        // The tree has its keys in alphabetical order.
        assert_eq!(last.labels[0].as_deref(), Some("1e-4"));
        assert_eq!(last.labels[2], None);
    }

    #[test]
    fn all_problems_are_reported_at_once() {
        let problems = study(|tree| {
            tree["vary"] = json!({
                "domain.spcing": [1e-4],
                "fluid.lattice_boltzmann.relaxation_time": ["half", 0.8],
            });
            tree["set"]["fluid.lattice_boltzmann.density"] = json!("=nothing*2");
        })
        .unwrap_err();
        let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
        let text = text.join("\n");
        for part in [
            "domain.spcing",
            "did you mean `spacing`",
            "relaxation_time = \"half\"",
            "there is no value with the name \"nothing\"",
            "as in 1 more members",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }

    #[test]
    fn one_slip_of_many_values_is_one_problem() {
        let problems = study(|tree| tree["vary"] = json!({"time.nosuch": [1, 2, 3]})).unwrap_err();
        assert_eq!(problems.len(), 1, "{problems:#?}");
        assert!(problems[0].reason.contains("as in 2 more members"));
    }

    #[test]
    fn a_variation_without_values_is_refused() {
        for (values, sound) in [
            (json!([]), "1 < 2"),
            (json!({}), "1 < 2"),
            (json!([1e-3]), "2"),
        ] {
            let problems = study(|tree| {
                tree["vary"]["time.end"] = values.clone();
                tree["sound"] = json!(sound);
            })
            .unwrap_err();
            let wanted = if sound == "2" {
                "sound"
            } else {
                "vary.time.end"
            };
            assert_eq!(problems.len(), 1, "{problems:#?}");
            assert_eq!(problems[0].path, wanted, "{problems:#?}");
        }
    }

    #[test]
    fn names_in_the_study_must_stand_for_something() {
        let problems = study(|tree| {
            tree["reference"] = json!({
                "mean_velocit": 1, "mean_velocity": {"finest": "domain.spacng"}
            });
            tree["error"] = json!("drag");
            tree["map"] = json!(["operator", "domain.spacing"]);
            tree["outputs"]["bad"] = json!({"is": "1 +", "file": "x.csv"});
        })
        .unwrap_err();
        let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
        let expected = [
            "outputs.bad",
            "outputs.bad.of",
            "outputs.bad.is",
            "reference.mean_velocit",
            "reference.mean_velocity",
            "error",
            "map[0]",
        ];
        assert_eq!(paths, expected);
    }

    #[test]
    fn fields_that_a_study_does_not_have_are_refused() {
        let problems = study(|tree| {
            tree["outputs"]["mean_velocity"]["fil"] = json!("x");
            tree["run"] = json!({"rank": 2, "threads": 0});
            tree["outputs"]["other"] = json!({"file": "x.csv", "of": "u", "take": "lst"});
        })
        .unwrap_err();
        let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
        for path in [
            "outputs.mean_velocity.fil",
            "outputs.other.take",
            "run.rank",
            "run.threads",
        ] {
            assert!(paths.contains(&path), "{path} is not in {paths:?}");
        }
    }

    #[test]
    fn a_refused_member_stops_the_study_or_is_recorded_or_runs() {
        let refused = |word: &str| {
            study(|tree| {
                tree["vary"] = json!({"fluid.lattice_boltzmann.body_force.constant[0]": [1, 1e4]});
                tree["refused"] = json!(word);
            })
        };
        let problems = refused("stop").unwrap_err();
        assert!(
            problems[0].to_string().contains("lattice velocity"),
            "{problems:?}"
        );
        let recorded = refused("record").unwrap();
        assert_eq!(recorded[0].verdict, Verdict::Valid);
        assert_eq!(recorded[1].verdict, Verdict::Refused);
        assert!(recorded[0].prepared.is_some() && recorded[1].prepared.is_none());
        let run = refused("run").unwrap();
        assert_eq!(run[1].verdict, Verdict::Refused);
        assert!(
            run[1]
                .prepared
                .as_ref()
                .unwrap()
                .text
                .contains("\"limits\":\"warn\"")
        );
        assert_eq!(run[0].prepared, recorded[0].prepared);
    }
}
