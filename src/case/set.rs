//! `--set path=value`: changes any field of a case from the command line.
//!
//! A path is written as in messages: `probes[0].every`. The value is JSON; any other text is taken as a string. Missing
//! objects on the path are created. An index one past the end of a list appends. The value null removes a field.

use super::text::brief;
use base::error::Problem;
use serde_json::{Map, Value};

/// Step of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

/// Applies one assignment; returns its path.
///
/// # Errors
/// If the assignment cannot be parsed or the path leads through a value without fields; the problem names the path.
pub fn apply(tree: &mut Value, assignment: &str) -> Result<String, Box<Problem>> {
    let problem = |path: &str, value: &str, reason: &str, remedy: &str| {
        Box::new(Problem::error(path, value, reason, remedy))
    };
    let Some((path, text)) = assignment.split_once('=') else {
        return Err(problem(
            assignment,
            "missing",
            "--set needs path=value",
            "write for example --set time.end=2",
        ));
    };
    let path = path.trim();
    let Some(steps) = parse(path) else {
        return Err(problem(
            path,
            text,
            "this is not a path of a field",
            "write for example fluid.lattice_boltzmann.density or probes[0].every",
        ));
    };
    let value = serde_json::from_str(text).unwrap_or_else(|_| text.into());
    if let (Value::Null, Some((Step::Key(key), above))) = (&value, steps.split_last()) {
        match find(tree, above) {
            Some(Value::Object(map)) => {
                map.remove(key);
                return Ok(path.to_string());
            }
            // A field of an object that does not exist is not there either.
            None | Some(Value::Null) => return Ok(path.to_string()),
            Some(_) => {}
        }
    }
    let mut node = tree;
    for step in &steps {
        node = match step {
            Step::Key(key) => {
                if node.is_null() {
                    *node = Map::new().into();
                }
                match node {
                    Value::Object(map) => map.entry(key.clone()).or_insert(Value::Null),
                    other => {
                        let reason = format!("there is no field `{key}` in {}", brief(other));
                        return Err(problem(path, text, &reason, "set the field above it"));
                    }
                }
            }
            Step::Index(index) => {
                if node.is_null() {
                    *node = Value::Array(Vec::new());
                }
                let Value::Array(list) = node else {
                    let reason = format!("{} is not a list", brief(node));
                    return Err(problem(path, text, &reason, "omit the index"));
                };
                let length = list.len();
                if *index > length {
                    let reason = format!("index {index} is past the end of a list of {length}");
                    let remedy = match length {
                        0 => "use 0, which adds an entry".to_owned(),
                        _ => format!("use 0 to {}, or {length} to add an entry", length - 1),
                    };
                    return Err(problem(path, text, &reason, &remedy));
                }
                if *index == length {
                    list.push(Value::Null);
                }
                &mut list[*index]
            }
        };
    }
    *node = value;
    Ok(path.to_string())
}

/// Returns the value at the end of the steps.
fn find<'t>(tree: &'t mut Value, steps: &[Step]) -> Option<&'t mut Value> {
    steps.iter().try_fold(tree, |node, step| match step {
        Step::Key(key) => node.get_mut(key),
        Step::Index(index) => node.get_mut(*index),
    })
}

/// Returns `true` if `known` is `path` or below it.
#[must_use]
pub fn covers(path: &str, known: &str) -> bool {
    known
        .strip_prefix(path)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.') || rest.starts_with('['))
}

/// Maximum number of steps of a path, which limits the depth of a tree.
const MAX_STEPS: usize = 64;

fn parse(path: &str) -> Option<Vec<Step>> {
    if path.matches(['.', '[']).count() >= MAX_STEPS {
        return None;
    }
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (key, mut rest) = part.split_at(part.find('[').unwrap_or(part.len()));
        if key.is_empty() {
            return None;
        }
        steps.push(Step::Key(key.to_string()));
        while !rest.is_empty() {
            let (index, after) = rest.strip_prefix('[')?.split_once(']')?;
            steps.push(Step::Index(index.trim().parse().ok()?));
            rest = after;
        }
    }
    Some(steps)
}

/// Returns the value at a path written as in messages.
#[must_use]
pub fn lookup<'a>(tree: &'a Value, path: &str) -> Option<&'a Value> {
    parse(path)?.iter().try_fold(tree, |node, step| match step {
        Step::Key(key) => node.get(key),
        Step::Index(index) => node.get(index),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn paths_reach_fields_and_list_items_and_make_objects() {
        let mut tree = json!({"a": {"b": [1, 2]}, "s": 1});
        apply(&mut tree, "a.b[1]=7.5").unwrap();
        apply(&mut tree, "a.b[2]=text").unwrap();
        apply(&mut tree, "x.y={\"z\": true}").unwrap();
        assert_eq!(tree["a"]["b"], json!([1, 7.5, "text"]));
        for gone in ["x=null", "a.c=null", "no.such.field=null"] {
            apply(&mut tree, gone).unwrap();
        }
        assert_eq!(tree, json!({"a": {"b": [1, 7.5, "text"]}, "s": 1}));
        apply(&mut tree, "x.y={\"z\": true}").unwrap();
        assert_eq!(lookup(&tree, "x.y.z"), Some(&json!(true)));
        for bad in [
            "a.b[9]=1", "s.t=1", "a[0]=1", "nothing", "=3", "a..b=1", "a.b[x]=1",
        ] {
            assert!(apply(&mut tree, bad).is_err(), "{bad}");
        }
        let deep = format!("deep{}=1", "[0]".repeat(40_000));
        assert!(apply(&mut tree, &deep).is_err());
    }
}
