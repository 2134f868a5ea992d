//! Values with a note of their source.
//!
//! Every value may be replaced by `{"value": 0.2, "source": "assumed", "note": "the paper is silent"}`. `source` is
//! `assumed`, `paper` or any text. [`strip`] replaces the object by the value and returns the sources in a table.

use super::text::join;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Source of a value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Source {
    /// `assumed`, `paper`, or any text.
    pub source: String,
    /// Reason or exact reference; may be empty.
    pub note: String,
}

impl Source {
    /// Returns a source without a note.
    #[must_use]
    pub fn without_note(source: &str) -> Self {
        Self {
            source: source.into(),
            note: String::new(),
        }
    }
}

/// Replaces every annotated value by the bare value; returns their sources, by path.
pub fn strip(tree: &mut Value) -> BTreeMap<String, Source> {
    let mut sources = BTreeMap::new();
    if has_annotation(tree) {
        walk(tree, "", &mut sources);
    }
    sources
}

/// Returns `true` if any part of the tree may be annotated; paths are built only in that case.
fn has_annotation(node: &Value) -> bool {
    match node {
        Value::Object(map) => {
            let keys = ["value", "source", "note"];
            let beside = keys.iter().filter(|key| map.contains_key(**key)).count();
            (beside > 1 && map.contains_key("value")) || map.values().any(has_annotation)
        }
        Value::Array(list) => list.iter().any(has_annotation),
        _ => false,
    }
}

fn walk(node: &mut Value, path: &str, sources: &mut BTreeMap<String, Source>) {
    if let Value::Object(map) = node
        && let Some((value, source)) = split(map)
    {
        sources.insert(path.to_string(), source);
        *node = value;
    }
    match node {
        Value::Object(map) => {
            for (key, child) in map {
                walk(child, &join(path, key), sources);
            }
        }
        Value::Array(list) => {
            for (index, child) in list.iter_mut().enumerate() {
                if has_annotation(child) {
                    walk(child, &format!("{path}[{index}]"), sources);
                }
            }
        }
        _ => {}
    }
}

/// Splits an object that has only `value`, `source` and `note` into the value and its source; none for other
/// objects.
fn split(map: &Map<String, Value>) -> Option<(Value, Source)> {
    let text = |key| match map.get(key) {
        None => Some(String::new()),
        Some(Value::String(text)) => Some(text.clone()),
        Some(_) => None,
    };
    let known = map
        .keys()
        .all(|key| matches!(key.as_str(), "value" | "source" | "note"));
    if !known || map.len() < 2 {
        return None;
    }
    let value = map.get("value")?.clone();
    let (source, note) = (text("source")?, text("note")?);
    Some((value, Source { source, note }))
}

/// Returns a schema in which every property may also be annotated.
pub(crate) fn allow(mut schema: Value) -> Value {
    allow_in(&mut schema);
    schema
}

fn allow_in(node: &mut Value) {
    match node {
        Value::Object(map) => {
            for (key, child) in map.iter_mut() {
                allow_in(child);
                if key == "properties"
                    && let Value::Object(properties) = child
                {
                    for property in properties.values_mut() {
                        let bare = property.take();
                        *property = annotated(bare);
                    }
                }
            }
        }
        Value::Array(list) => list.iter_mut().for_each(allow_in),
        _ => {}
    }
}

fn annotated(mut bare: Value) -> Value {
    let mut outer = Map::new();
    if let Value::Object(map) = &mut bare {
        for key in ["description", "default"] {
            if let Some(value) = map.remove(key) {
                outer.insert(key.into(), value);
            }
        }
    }
    outer.insert(
        "anyOf".into(),
        json!([bare.clone(), {
            "type": "object",
            "properties": {
                "value": bare,
                "source": {"type": "string", "description": "`assumed`, `paper`, or any text"},
                "note": {"type": "string"},
            },
            "required": ["value"],
            "additionalProperties": false,
        }]),
    );
    outer.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn annotated_values_become_bare_and_their_sources_stay() {
        let mut tree = json!({
            "a": {"value": 2.0, "source": "assumed", "note": "n"},
            "b": [{"value": [1, 2], "source": "paper"}],
            "pressure": {"value": 1.0, "ramp": {"duration": 1.0}},
            "only": {"value": 1.0},
        });
        let sources = strip(&mut tree);
        assert_eq!(tree["a"], 2.0);
        assert_eq!(tree["b"][0], json!([1, 2]));
        assert_eq!(tree["pressure"]["value"], 1.0);
        assert_eq!(tree["only"]["value"], 1.0);
        assert_eq!(sources.len(), 2);
        assert_eq!(sources["a"].note, "n");
        assert_eq!(sources["b[0]"].source, "paper");
    }
}
