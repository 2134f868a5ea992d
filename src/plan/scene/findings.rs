//! Collection of the findings of a case, each with the value as written in the case.

use base::error::{Finding, Problem, Remedy, Report, Severity};
pub use base::error::{at_least, at_most, number};
use case::set::lookup;
use case::text::{MAX_PROBLEMS, brief};
use case::{Case, check};
use serde_json::Value;
use std::cell::OnceCell;

/// The path of the lattice fluid in a case.
pub(crate) const LATTICE_PATH: &str = "fluid.lattice_boltzmann";

/// Sections of a case on which neither its plan nor other sections depend.
const OUTPUT_SECTIONS: [&str; 5] = ["output", "probes", "checkpoint", "analysis", "title"];

/// Returns `true` if a path is that of a section or of a field below it.
fn within(path: &str, section: &str) -> bool {
    let below = path.strip_prefix(section);
    below.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Findings of a severity that are counted but not listed.
#[derive(Debug)]
struct Unlisted {
    severity: Severity,
    /// Index of their line in the problems.
    line: usize,
    count: usize,
}

/// Findings so far.
#[derive(Debug)]
pub(crate) struct Findings<'a> {
    case: &'a Case,
    /// Case as a tree, built for the first finding: a case without findings needs no tree, however many grains it
    /// lists.
    tree: OnceCell<Value>,
    /// Problems in the order found.
    pub(crate) problems: Vec<Problem>,
    unlisted: Vec<Unlisted>,
    /// Paths of fields that the schema refuses.
    wrong: Vec<String>,
    /// Indices of findings that are valid only if the fields of some sections have no errors, with the names of these
    /// sections.
    dependent: Vec<(usize, &'static [&'static str])>,
    /// Paths of vectors with a wrong number of components.
    wrong_vectors: Vec<String>,
    /// `true` if a wrong field prevents the automatic choices, so that none were made.
    pub(crate) stopped: bool,
}

impl<'a> Findings<'a> {
    pub(crate) fn new(case: &'a Case) -> Self {
        Self::with_wrong(case, &[])
    }

    /// Returns an empty collection for a case; `wrong` are the paths of fields that the schema refuses.
    pub(crate) fn with_wrong(case: &'a Case, wrong: &[String]) -> Self {
        Self {
            case,
            tree: OnceCell::new(),
            problems: Vec::new(),
            unlisted: Vec::new(),
            wrong: wrong.to_vec(),
            dependent: Vec::new(),
            wrong_vectors: Vec::new(),
            stopped: false,
        }
    }

    /// Marks the last finding as valid only if the fields of some sections have no errors.
    pub(crate) fn depends(&mut self, sections: &'static [&'static str]) {
        if let Some(last) = self.problems.len().checked_sub(1) {
            self.dependent.push((last, sections));
        }
    }

    /// Returns the paths of all fields with errors.
    fn errors(&self) -> impl Iterator<Item = &str> {
        let errors = self
            .problems
            .iter()
            .filter(|p| p.severity == Severity::Error);
        let wrong = self.wrong.iter().map(String::as_str);
        wrong.chain(errors.map(|p| p.path.as_str()))
    }

    /// Returns `true` if a field of one of the sections has an error.
    pub(crate) fn wrong_in(&self, sections: &[&str]) -> bool {
        self.errors()
            .any(|path| sections.iter().any(|section| within(path, section)))
    }

    /// Returns `true` if a field on which the plan depends has an error.
    pub(crate) fn stop_plan(&self) -> bool {
        self.errors()
            .any(|path| !OUTPUT_SECTIONS.iter().any(|section| within(path, section)))
    }

    /// Keeps only the findings about vectors with a wrong number of components, each once, if there are any: places and
    /// directions of the case cannot be compared before they are corrected.
    fn keep_wrong_vectors(&mut self) {
        let mut left = std::mem::take(&mut self.wrong_vectors);
        if left.is_empty() {
            return;
        }
        self.dependent.clear();
        let unlisted: Vec<usize> = self.unlisted.drain(..).map(|rest| rest.line).collect();
        let mut line = 0;
        self.problems.retain(|problem| {
            let at = left.iter().position(|path| *path == problem.path);
            let first = at.filter(|_| problem.severity == Severity::Error);
            first.map(|at| left.swap_remove(at));
            line += 1;
            let more = unlisted.contains(&(line - 1)) && problem.severity == Severity::Error;
            first.is_some() || more && !left.is_empty()
        });
    }

    /// Drops findings that follow from others: those that depend on a section with an error, those about a field that
    /// contains, or is contained in, a field reported earlier, and all others if a vector has too few or too many
    /// components.
    pub(crate) fn drop_consequences(&mut self) {
        self.keep_wrong_vectors();
        let dependent = std::mem::take(&mut self.dependent);
        let sections = |n: usize| {
            let found = dependent.iter().find(|(at, _)| *at == n);
            found.map(|(_, sections)| *sections)
        };
        let mut causes = self.wrong.clone();
        for (n, problem) in self.problems.iter().enumerate() {
            if problem.severity == Severity::Error && sections(n).is_none() {
                causes.push(problem.path.clone());
            }
        }
        let mut before = self.wrong.clone();
        let mut kept = Vec::new();
        for (n, problem) in std::mem::take(&mut self.problems).into_iter().enumerate() {
            let on = sections(n).unwrap_or_default();
            let follows = causes
                .iter()
                .any(|path| on.iter().any(|section| within(path, section)));
            let part = before.iter().any(|path| {
                *path != problem.path
                    && (within(path, &problem.path) || within(&problem.path, path))
            });
            let line = self.unlisted.iter_mut().find(|rest| rest.line == n);
            if (follows || part) && line.is_none() {
                continue;
            }
            if let Some(line) = line {
                line.line = kept.len();
            }
            if let Some(sections) = sections(n) {
                self.dependent.push((kept.len(), sections));
            }
            if problem.severity == Severity::Error {
                before.push(problem.path.clone());
            }
            kept.push(problem);
        }
        self.problems = kept;
    }

    /// Adds an error: the case is refused.
    pub(crate) fn error(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Error);
    }

    /// Adds a warning: the case runs, possibly with less accuracy.
    pub(crate) fn warn(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Warning);
    }

    /// Adds a finding of instability: the case runs, but similar runs have failed.
    pub(crate) fn unstable(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Unstable);
    }

    /// Adds a finding of a model.
    pub(crate) fn add(&mut self, finding: Finding) {
        self.push(
            &finding.path,
            finding.reason,
            finding.remedy,
            finding.severity,
        );
    }

    fn push(&mut self, path: &str, reason: String, remedy: Remedy, severity: Severity) {
        // A list of a million grains may be wrong a million times; beyond a maximum, errors are only counted.
        let alike = self.problems.iter().filter(|p| p.severity == severity);
        if alike.count() >= MAX_PROBLEMS {
            self.only_count(severity);
            return;
        }
        let tree = self
            .tree
            .get_or_init(|| serde_json::to_value(self.case).unwrap_or(Value::Null));
        let value = match lookup(tree, path) {
            None | Some(Value::Null) => "missing".to_string(),
            Some(value) => brief(value),
        };
        self.problems.push(Problem {
            path: path.into(),
            value,
            reason,
            remedy,
            severity,
        });
    }

    /// Increases the number in the line that counts the findings not listed.
    fn only_count(&mut self, severity: Severity) {
        let known = self
            .unlisted
            .iter_mut()
            .find(|rest| rest.severity == severity);
        let unlisted = match known {
            Some(rest) => rest,
            None => {
                self.problems.push(Problem {
                    path: "the case".into(),
                    value: String::new(),
                    reason: format!("only the first {MAX_PROBLEMS} of this severity are listed"),
                    remedy: "correct those first".into(),
                    severity,
                });
                self.unlisted.push(Unlisted {
                    severity,
                    line: self.problems.len() - 1,
                    count: 0,
                });
                let last = self.unlisted.len() - 1;
                &mut self.unlisted[last]
            }
        };
        unlisted.count += 1;
        self.problems[unlisted.line].value = format!("{} more", unlisted.count);
    }

    /// Returns `true` if a finding is about a field, or about a field that contains it or is contained in it.
    pub(crate) fn concerns(&self, path: &str) -> bool {
        let near = |p: &Problem| within(&p.path, path) || within(path, &p.path);
        self.problems.iter().any(near)
    }

    /// Returns `true` if the case is refused.
    pub(crate) fn refused(&self) -> bool {
        refused(&self.problems)
    }
}

impl Report for Findings<'_> {
    fn error(&mut self, path: &str, reason: String, remedy: Remedy) {
        self.push(path, reason, remedy, Severity::Error);
    }

    fn wrong_components(&mut self, path: &str, reason: String, remedy: Remedy) {
        if !self.wrong_vectors.iter().any(|known| known == path) {
            // Of very many only the number is of interest.
            if self.wrong_vectors.len() <= MAX_PROBLEMS {
                self.wrong_vectors.push(path.to_owned());
            }
            self.push(path, reason, remedy, Severity::Error);
        }
    }

    fn unknown_material(&mut self, path: &str, name: &str, known: &[&str]) {
        let remedy = match check::nearest(name, known) {
            Some(near) => Remedy::from(format!("did you mean `{near}`? Or add it to `materials`"))
                .set(path, near),
            None => "add it to `materials`".into(),
        };
        self.push(
            path,
            format!("there is no material `{name}`"),
            remedy,
            Severity::Error,
        );
    }
}

/// Returns `true` if any of the problems refuses the case.
#[must_use]
pub fn refused(problems: &[Problem]) -> bool {
    problems.iter().any(|p| p.severity == Severity::Error)
}

/// Returns the multiple of a spacing for a number of cells, without digits of round-off.
pub(crate) fn length_of(cells: f64, spacing: f64) -> f64 {
    format!("{:.12e}", cells * spacing)
        .parse()
        .unwrap_or(cells * spacing)
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use case::examples::EXAMPLES;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the paths of all errors of a case.
    fn errors(case: &Value) -> Vec<String> {
        let read = Document::read(&case.to_string(), &[], Path::new("")).and_then(Plan::prepare);
        let found = read.map_or_else(|problems| problems, |plan| plan.warnings);
        found.into_iter().map(|problem| problem.path).collect()
    }

    /// Checks that a gravity with two numbers in 3-D, or three in 2-D, gives one finding in every example, whatever
    /// depends on gravity, and that so does the position of a block.
    #[test]
    fn a_vector_of_the_wrong_length_gives_one_finding() {
        let mut seen = 0;
        for example in EXAMPLES {
            let mut case: Value = serde_json::from_str(example.text).unwrap();
            let Some(gravity) = case["gravity"].as_array().cloned() else {
                continue;
            };
            case["gravity"] = match &gravity[..] {
                [x, y] => json!([x, y, 0]),
                [x, _, z] => json!([x, z]),
                other => panic!("{other:?}"),
            };
            assert_eq!(errors(&case), ["gravity"], "{}", example.name);
            seen += 1;
        }
        assert!(seen > 10, "{seen}");
        let text = case::examples::find("joint-pulse").unwrap().text;
        let mut case: Value = serde_json::from_str(text).unwrap();
        let position = case.pointer_mut("/blocks/initial/list/1/position").unwrap();
        *position = json!([0.1, 0.1]);
        assert_eq!(errors(&case), ["blocks.initial.list[1].position"]);
    }

    /// Checks that a patch outside of the domain, a face that 2-D does not have, the unknown material of two walls and
    /// a mesh that is missing give one finding each: the water of another opening needs no outlet.
    #[test]
    fn what_depends_on_a_wrong_field_is_not_a_second_finding() {
        let position = [0.006, 0.005, 0.005];
        let case = |size: &[f64], shape: Value, outlet: Value, material: &str| {
            json!({
                "domain": {"size": size, "spacing": 0.0005},
                "materials": {"steel": {"density": 7800}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "boundaries": [
                        {"name": "in", "face": "x_min", "condition": {"velocity": {
                            "profile": {"parabolic": {"peak": 0.01}}, "ramp_time": 0.1}}},
                        outlet]}},
                "bodies": [{"name": "rod", "shape": shape, "position": position[..size.len()],
                            "motion": {"fixed": {}}, "material": "steel"}],
                "box_walls": ["y_min", "y_max"], "box_wall_material": material,
                "time": {"end": 0.5}
            })
        };
        let (plane, space) = ([0.02, 0.01], [0.02, 0.01, 0.01]);
        let outlet = |face: &str, from: f64, to: f64| {
            json!({"name": "out", "face": face, "condition": {"pressure": {"value": 0}},
                   "patch": {"from": [0.0, from], "to": [0.02, to]}})
        };
        let open = json!({"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}});
        let disc = json!({"disc": {"radius": 0.0015}});
        let mesh = json!({"mesh": {"path": "missing.stl"}});
        let patch = "fluid.lattice_boltzmann.boundaries[1].patch";
        let face = "fluid.lattice_boltzmann.boundaries[1].face";
        for (case, path) in [
            (
                case(&plane, disc.clone(), outlet("x_max", 0.5, 0.9), "steel"),
                patch,
            ),
            (
                case(
                    &plane,
                    disc.clone(),
                    outlet("x_max", 0.0051, 0.0052),
                    "steel",
                ),
                patch,
            ),
            (
                case(&plane, disc.clone(), outlet("x_max", 0.008, 0.004), "steel"),
                patch,
            ),
            (
                case(&plane, disc.clone(), outlet("z_max", 0.002, 0.004), "steel"),
                face,
            ),
            (
                case(&plane, disc, open.clone(), "gold"),
                "box_wall_material",
            ),
            (
                case(&space, mesh, open, "steel"),
                "bodies[0].shape.mesh.path",
            ),
        ] {
            assert_eq!(errors(&case), [path], "{case}");
        }
    }
}
