//! Changes of a case that a restart allows or refuses, each with its reason.
//!
//! `solver schema` contains the list as `x-restart`: the whole list on the case itself, and its entries on the fields
//! concerned.

use base::error::{Problem, Severity};
use serde_json::{Map, Value, json};

/// Field, or all fields below it, that a restart may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Changeable {
    /// Path as in messages; `[*]` is any item of a list. The path includes everything below it.
    pub path: &'static str,
    /// Consequence of a change.
    pub effect: &'static str,
}

const fn changeable(path: &'static str, effect: &'static str) -> Changeable {
    Changeable { path, effect }
}

/// Fields that a restart may change.
pub const CHANGEABLE: [Changeable; 50] = [
    changeable("title", "changes a name only"),
    changeable("description", "changes a text only"),
    changeable(
        "time.end",
        "a later end extends the run, even a finished one",
    ),
    changeable("time.neighbour_skin", "affects the cost only"),
    changeable("domain.split", "affects the cost only"),
    changeable("domain.slab_bounds", "affects the cost only"),
    changeable(
        "output",
        "takes effect from the checkpoint on; averages whose first sample comes after the checkpoint start \
         again, all others keep `from` and `sample_every`",
    ),
    changeable("probes", "from the checkpoint on"),
    changeable("checkpoint", "from the checkpoint on"),
    changeable("guards", "from the checkpoint on"),
    changeable(
        "analysis.erosion_law.end_at_eroded_fraction",
        "changes when the run ends",
    ),
    changeable(
        "analysis.element_test",
        "evaluates the records of the whole run at its end",
    ),
    changeable(
        "walls",
        "walls may be added, removed, and change their velocity, its table and servo; a wall that remains keeps \
         its shape, material and times",
    ),
    changeable(
        "bodies[*].motion.driven.history",
        "takes effect at once; times count from the start of the run",
    ),
    changeable(
        "box_walls",
        "walls on faces of the domain may be added and removed",
    ),
    changeable(
        "regions",
        "regions may be added, removed and changed; a region that keeps its name keeps its counts, and a rate that \
         changes counts from the restart",
    ),
    changeable(
        "fluid.darcy.backward_erosion",
        "computed at the end of the run, from its last seepage",
    ),
    changeable("gravity", "takes effect at once"),
    changeable(
        "fluid.lattice_boltzmann.body_force",
        "takes effect at once; phases count from the start of the run",
    ),
    changeable("fluid.lattice_boltzmann.device", "affects the cost only"),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].name",
        "changes a name only",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.velocity.profile",
        "takes effect at once",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.velocity.ramp_time",
        "counts from the first step of the fluid",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.velocity.turbulence",
        "takes effect at once",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.pressure.value",
        "takes effect at once, unless a ramp is in progress",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.pressure.ramp",
        "counts from the first step of the fluid",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.pressure.history",
        "counts from the first step of the fluid",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.moving_wall.velocity",
        "takes effect at once",
    ),
    changeable(
        "fluid.lattice_boltzmann.boundaries[*].condition.convective_outflow.velocity",
        "takes effect at once",
    ),
    changeable("fluid.darcy.boundaries[*].name", "changes a name only"),
    changeable(
        "fluid.darcy.boundaries[*].condition.pressure.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.boundaries[*].condition.head.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.boundaries[*].condition.flux.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.boundaries[*].condition.rain.rate",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.boundaries[*].condition.discharge.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.boundaries[*].condition.evaporation.rate",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].name",
        "changes a name only",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].condition.pressure.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].condition.head.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].condition.flux.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].condition.rain.rate",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.terrain.conditions[*].condition.evaporation.rate",
        "takes effect at the next coupling",
    ),
    changeable("fluid.darcy.drains[*].name", "changes a name only"),
    changeable(
        "fluid.darcy.drains[*].condition.pressure.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.drains[*].condition.head.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.drains[*].condition.flux.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.drains[*].condition.discharge.value",
        "takes effect at the next coupling",
    ),
    changeable(
        "fluid.darcy.tolerance",
        "applies to the pressure solver from the checkpoint on",
    ),
    changeable(
        "fluid.darcy.max_iterations",
        "applies to the pressure solver from the checkpoint on",
    ),
    changeable("accuracy", "has no effect: the choices at the start remain"),
];

/// Reasons why the other fields may not change, by the first matching beginning of the path.
const FIXED_FIELDS: [(&str, &str); 12] = [
    (
        "domain",
        "the saved state belongs to the cells of this domain",
    ),
    (
        "materials",
        "the saved bodies and contacts have these materials",
    ),
    ("contact", "the saved contacts hold forces of this law"),
    ("grains", "the grains are in the checkpoint"),
    ("blocks", "the blocks are in the checkpoint"),
    (
        "bodies",
        "the bodies are in the checkpoint with their motion",
    ),
    (
        "coupling",
        "the saved loads and covered cells belong to this coupling",
    ),
    (
        "fluid.lattice_boltzmann.boundaries",
        "a face keeps its kind of condition; its drive may change",
    ),
    (
        "fluid.darcy.boundaries",
        "a face keeps its kind of condition; its drive may change",
    ),
    ("fluid", "the saved state of the fluid is scaled with it"),
    ("time", "the saved step number counts steps of this length"),
    ("analysis", "its records start with the run"),
];

/// Difference of two trees.
struct Difference<'a> {
    path: String,
    old: &'a Value,
    new: &'a Value,
}

/// Finds the differences of two trees. Lists of different lengths differ as a whole; numbers
/// are compared by value.
fn differences<'a>(old: &'a Value, new: &'a Value, path: &str, found: &mut Vec<Difference<'a>>) {
    static NOTHING: Value = Value::Null;
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            for key in keys {
                let inner = super::text::join(path, key);
                let of = |map: &'a Map<String, Value>| map.get(key).unwrap_or(&NOTHING);
                differences(of(a), of(b), &inner, found);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (n, (a, b)) in a.iter().zip(b).enumerate() {
                differences(a, b, &format!("{path}[{n}]"), found);
            }
        }
        (Value::Number(a), Value::Number(b)) if a.as_f64() == b.as_f64() => {}
        _ if old == new => {}
        _ => found.push(Difference {
            path: path.to_owned(),
            old,
            new,
        }),
    }
}

/// Returns `true` if a path is equal to this pattern or below it.
fn matches_pattern(pattern: &str, path: &str) -> bool {
    let mut rest = path;
    for (n, part) in pattern.split("[*]").enumerate() {
        if n > 0 {
            let Some((index, after)) = rest.strip_prefix('[').and_then(|r| r.split_once(']'))
            else {
                return false;
            };
            if index.parse::<usize>().is_err() {
                return false;
            }
            rest = after;
        }
        let Some(after) = rest.strip_prefix(part) else {
            return false;
        };
        rest = after;
    }
    rest.is_empty() || rest.starts_with('.') || rest.starts_with('[')
}

/// Compares two cases, serialised with all their defaults: returns the changed paths that are allowed, and a
/// problem for each change that is not.
#[must_use]
pub fn compare(old: &Value, new: &Value) -> (Vec<String>, Vec<Problem>) {
    let mut found = Vec::new();
    differences(old, new, "", &mut found);
    let (mut changed, mut refused) = (Vec::new(), Vec::new());
    for Difference { path, old, new } in found {
        if let Some(reason) = refusal_of(&path, new) {
            refused.push(problem(path, old, new, reason));
        } else if CHANGEABLE
            .iter()
            .any(|one| matches_pattern(one.path, &path))
        {
            changed.push(path);
        } else {
            let kept = FIXED_FIELDS
                .iter()
                .find(|(pattern, _)| matches_pattern(pattern, &path));
            let reason = kept.map_or("the saved state depends on it", |(_, reason)| *reason);
            refused.push(problem(path, old, new, reason));
        }
    }
    (changed, refused)
}

/// Returns why a change within a changeable field is not possible with the saved state; none if it is.
fn refusal_of(path: &str, new: &Value) -> Option<&'static str> {
    let asked = |inner: &str| new.pointer(inner).is_some_and(|v| *v == Value::Bool(true));
    let displacement = path == "output.grains.displacement" && *new == Value::Bool(true)
        || path == "output.grains" && asked("/displacement");
    if displacement {
        return Some("the run did not store the initial positions of its grains");
    }
    let table = path.starts_with("bodies[") && path.ends_with(".driven.history");
    (table && new.is_null()).then_some(
        "without its table the body would keep the velocity of its last step; write a table with one row",
    )
}

fn problem(path: String, old: &Value, new: &Value, reason: &str) -> Problem {
    let brief = super::text::brief;
    Problem {
        path,
        value: format!("{} (was {})", brief(new), brief(old)),
        reason: format!("a restart may not change this: {reason}"),
        remedy: "undo the change, or start a new run with it in another folder; `solver reference` lists the \
                 fields that may change".into(),
        severity: Severity::Error,
    }
}

/// Adds the list to a schema: as a whole under `x-restart` of the root, and each effect at its field.
#[must_use]
pub fn mark(mut schema: Value) -> Value {
    let list: Vec<Value> = CHANGEABLE
        .iter()
        .map(|one| json!({"path": one.path, "effect": one.effect}))
        .collect();
    for one in CHANGEABLE {
        if let Some(pointer) = locate(&schema, one.path)
            && let Some(Value::Object(field)) = schema.pointer_mut(&pointer)
        {
            field.insert(
                "x-restart".into(),
                format!("may change: {}", one.effect).into(),
            );
        }
    }
    if let Value::Object(root) = &mut schema {
        root.insert("x-restart".into(), list.into());
    }
    schema
}

/// Returns the JSON pointer of the schema of the field at a path.
fn locate(root: &Value, path: &str) -> Option<String> {
    let mut at = String::new();
    for part in path.split('.') {
        let (key, item) = match part.strip_suffix("[*]") {
            Some(key) => (key, true),
            None => (part, false),
        };
        at = property(root, &at, key)?;
        if item {
            at = format!("{}/items", resolve_pointer(root, &at)?);
        }
    }
    Some(at)
}

/// Returns the JSON pointer of the schema after resolving `$ref`, optional fields and annotated values.
fn resolve_pointer(root: &Value, at: &str) -> Option<String> {
    let node = root.pointer(at)?;
    if let Some(name) = node.get("$ref").and_then(Value::as_str) {
        return resolve_pointer(root, name.strip_prefix('#')?);
    }
    if let Some(options) = node.get("anyOf").and_then(Value::as_array) {
        let useful = |option: &Value| {
            let reference = option.get("$ref").and_then(Value::as_str);
            option.get("type") != Some(&json!("null"))
                && reference.is_none_or(|name| !name.ends_with("Annotated"))
        };
        let n = options.iter().position(useful)?;
        return resolve_pointer(root, &format!("{at}/anyOf/{n}"));
    }
    Some(at.to_owned())
}

/// Returns the property of this name of an object, or of one of its variants.
fn property(root: &Value, at: &str, key: &str) -> Option<String> {
    let at = resolve_pointer(root, at)?;
    let direct = format!("{at}/properties/{key}");
    if root.pointer(&direct).is_some() {
        return Some(direct);
    }
    let options = root.pointer(&at)?.get("oneOf")?.as_array()?.len();
    (0..options).find_map(|n| property(root, &format!("{at}/oneOf/{n}"), key))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Document, examples};
    use std::path::Path;

    fn case(name: &str, set: &[&str]) -> Value {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let text = examples::find(name).unwrap().text;
        let document = Document::read(text, &set, Path::new("")).unwrap();
        serde_json::to_value(&document.case).unwrap()
    }

    #[test]
    fn what_may_change_does_and_the_rest_is_refused_by_name() {
        let warm_up = "time.warm_up={\"fluid_only\": {\"relative_change\": 1e-6, \"at_most\": 1}}";
        let longer = [warm_up, "time.warm_up.fluid_only.at_most=1e3"];
        let (changed, refused) = compare(&case("piping", &[warm_up]), &case("piping", &longer));
        assert!(changed.is_empty());
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert_eq!(refused[0].path, "time.warm_up.fluid_only.at_most");
        let old = case("piping", &[]);
        let drive = "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value";
        let set = [
            format!("{drive}=3"),
            "time.end=9".into(),
            "output={}".into(),
        ];
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let (mut changed, refused) = compare(&old, &case("piping", &set));
        assert!(refused.is_empty(), "{refused:?}");
        changed.retain(|path| !path.starts_with("output"));
        assert_eq!(changed, [drive, "time.end"]);
        let kind = "fluid.lattice_boltzmann.boundaries[0].condition={\"outflow\": {}}";
        let (_, refused) = compare(&old, &case("piping", &[kind, "domain.spacing=1e-5"]));
        let paths: Vec<&str> = refused.iter().map(|p| p.path.as_str()).collect();
        assert!(paths.contains(&"domain.spacing"), "{paths:?}");
        assert!(
            paths.iter().any(|p| p.contains("boundaries[0].condition")),
            "{paths:?}"
        );
    }

    #[test]
    fn the_same_numbers_written_otherwise_do_not_differ() {
        let (changed, refused) = compare(&json!({"a": 1, "b": null}), &json!({"a": 1.0}));
        assert!(changed.is_empty() && refused.is_empty());
        assert!(
            matches_pattern("a.b[*].c", "a.b[12].c[0].d") && !matches_pattern("a.b[*].c", "a.b.c")
        );
        assert!(!matches_pattern("time.end", "time.ending"));
    }

    #[test]
    fn every_field_of_the_list_is_marked_in_the_schema() {
        let schema = crate::schema();
        assert_eq!(
            schema["x-restart"].as_array().unwrap().len(),
            CHANGEABLE.len()
        );
        for one in CHANGEABLE {
            let at = locate(&schema, one.path).unwrap_or_else(|| panic!("no field {}", one.path));
            assert!(
                schema.pointer(&at).unwrap()["x-restart"].is_string(),
                "{at}"
            );
        }
    }
}
