//! Templates of schemas for lists of many values: a check without paths and messages.

use super::SMALLEST;
use serde_json::Value;

/// Condition under which a value is valid without a detailed check.
pub(super) enum Template<'a> {
    /// Undecided: only the walk over the schema can decide.
    Unknown,
    /// Absent, or valid for the other template. The walk reports null.
    Optional(Box<Template<'a>>),
    Number {
        whole: bool,
        minimum: Option<f64>,
        above: Option<f64>,
        maximum: Option<f64>,
        below: Option<f64>,
    },
    /// Any text.
    Text,
    Boolean,
    List {
        minimum: usize,
        maximum: usize,
        items: Box<Template<'a>>,
    },
    Fields {
        known: Vec<(&'a str, Template<'a>)>,
        required: Vec<&'a str>,
    },
}

/// Maximum nesting depth of schemas: recursive schemas have no template.
const DEEPEST: usize = 8;

impl<'a> Template<'a> {
    /// Returns the template of `schema`, whose references are resolved in `root`.
    pub(super) fn from_schema(root: &'a Value, schema: &'a Value) -> Self {
        Self::within(root, schema, 0)
    }

    fn within(root: &'a Value, schema: &'a Value, depth: usize) -> Self {
        if depth > DEEPEST {
            return Self::Unknown;
        }
        let within = |schema| Self::within(root, schema, depth + 1);
        if let Some(name) = schema.get("$ref") {
            let name = name.as_str().and_then(|r| r.strip_prefix("#/$defs/"));
            let target = name.and_then(|name| root.get("$defs")?.get(name));
            return target.map_or(Self::Unknown, within);
        }
        if let Some(Value::Array(options)) = schema.get("anyOf") {
            return match options.as_slice() {
                [option, null] if null.get("type").is_some_and(|t| t == "null") => {
                    Self::Optional(Box::new(within(option)))
                }
                _ => Self::Unknown,
            };
        }
        if ["oneOf", "const", "enum"]
            .iter()
            .any(|word| schema.get(word).is_some())
        {
            return Self::Unknown;
        }
        match schema.get("type") {
            Some(Value::String(name)) => Self::typed(name, schema, within),
            Some(Value::Array(names)) => match names.as_slice() {
                [Value::String(name), Value::String(null)] if null == "null" => {
                    Self::Optional(Box::new(Self::typed(name, schema, within)))
                }
                _ => Self::Unknown,
            },
            _ => Self::Unknown,
        }
    }

    fn typed(name: &str, schema: &'a Value, within: impl Fn(&'a Value) -> Self) -> Self {
        let bound = |key| schema.get(key).and_then(Value::as_f64);
        let number = |key, otherwise| {
            let found = schema.get(key).and_then(Value::as_u64);
            found.map_or(otherwise, |n| usize::try_from(n).unwrap_or(usize::MAX))
        };
        match name {
            "number" | "integer" => {
                let format = schema.get("format").and_then(Value::as_str);
                let natural = (format == Some("uint32")).then_some(f64::from(u32::MAX));
                Self::Number {
                    whole: name == "integer",
                    minimum: bound("minimum"),
                    above: bound("exclusiveMinimum"),
                    maximum: bound("maximum").or(natural),
                    below: bound("exclusiveMaximum"),
                }
            }
            "string" => Self::Text,
            "boolean" => Self::Boolean,
            "array" => Self::List {
                minimum: number("minItems", 0),
                maximum: number("maxItems", usize::MAX),
                items: Box::new(schema.get("items").map_or(Self::Unknown, within)),
            },
            "object" => {
                let fields = schema.get("properties").and_then(Value::as_object);
                let required = schema.get("required").and_then(Value::as_array);
                let fields = fields.into_iter().flatten();
                Self::Fields {
                    known: fields
                        .map(|(key, child)| (key.as_str(), within(child)))
                        .collect(),
                    required: required
                        .into_iter()
                        .flatten()
                        .filter_map(Value::as_str)
                        .collect(),
                }
            }
            _ => Self::Unknown,
        }
    }

    /// Returns `true` if the walk would report nothing; `largest` bounds the magnitude of every number, and
    /// [`SMALLEST`] is the minimum of numbers that must be above 0.
    pub(super) fn accepts(&self, value: &Value, largest: f64) -> bool {
        match (self, value) {
            (Self::Optional(_), Value::Null) => false,
            (Self::Text, Value::String(_)) | (Self::Boolean, Value::Bool(_)) => true,
            (Self::Optional(inner), value) => inner.accepts(value, largest),
            (
                Self::Number {
                    whole,
                    minimum,
                    above,
                    maximum,
                    below,
                },
                Value::Number(n),
            ) => {
                (!whole || n.is_i64() || n.is_u64())
                    && n.as_f64().is_some_and(|number| {
                        number.abs() <= largest
                            && minimum.is_none_or(|b| number >= b)
                            && above.is_none_or(|b| number > b && number - b >= SMALLEST)
                            && maximum.is_none_or(|b| number <= b)
                            && below.is_none_or(|b| number < b)
                    })
            }
            (
                Self::List {
                    minimum,
                    maximum,
                    items,
                },
                Value::Array(list),
            ) => {
                (*minimum..=*maximum).contains(&list.len())
                    && list.iter().all(|value| items.accepts(value, largest))
            }
            (Self::Fields { known, required }, Value::Object(map)) => {
                let field = |key: &String| known.iter().find(|(name, _)| name == key);
                required.iter().all(|key| map.contains_key(*key))
                    && map.iter().all(|(key, value)| {
                        field(key).is_some_and(|(_, t)| t.accepts(value, largest))
                    })
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LARGEST, bare_schema, problems_against};
    use super::*;
    use serde_json::json;

    /// Checks that the walk reports nothing for a value that fits, and that almost all valid grains fit.
    #[test]
    fn what_fits_is_what_the_walk_lets_pass() {
        let root = bare_schema();
        let grain = &root["$defs"]["Grain"];
        assert!(grain.is_object());
        let mut one = grain.clone();
        one["$defs"] = root["$defs"].clone();
        let template = Template::from_schema(&root, grain);
        for (value, fits) in [
            (json!({"position": [1, 2.5], "radius": 1e-3}), true),
            (
                json!({"position": [1, 2.5, 0], "radius": 1e-3, "material": "glass"}),
                true,
            ),
            (
                json!({"position": [1, 2.5], "radius": 1e-3, "velocity": [0, 1]}),
                true,
            ),
            (
                json!({"position": [1, 2.5], "radius": 1e-3, "material": null}),
                false,
            ),
            (json!({"position": [1, 2.5], "radius": 0}), false),
            (json!({"position": [1, 2.5], "radius": "a"}), false),
            (json!({"position": [1], "radius": 1}), false),
            (json!({"position": [1, 2, 3, 4], "radius": 1}), false),
            (json!({"position": [1, 1e31], "radius": 1}), false),
            (json!({"position": [1, 2]}), false),
            (json!({"position": [1, 2], "radius": 1, "colour": 3}), false),
            (json!([1, 2]), false),
        ] {
            let walked = problems_against(&one, &mut value.clone()).is_empty();
            assert_eq!(template.accepts(&value, LARGEST), fits, "{value}");
            assert_eq!(walked, fits, "{value}");
        }
    }
}
