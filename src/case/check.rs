//! Validation of a case tree against the schema of [`Case`](super::Case). One pass reports every unknown, missing,
//! mistyped or out-of-range field. Ranges are stated with the fields.

pub mod absent;
mod controls;
mod nearest;
mod template;

pub use nearest::nearest;

use super::text::{MAX_PROBLEMS, brief, join, unlisted};
use base::error::{Problem, Remedy, Severity};
use base::number::{floor_i64, real};
use controls::control_characters;
use nearest::{choose, clipped, nearest_remedy, nearest_word};
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, SchemaGenerator};
use serde::de::{Deserialize, Deserializer, Error};
use serde_json::{Map, Value};
use std::sync::OnceLock;
use template::Template;

/// Names in earlier versions of the case, with the names that replace them. An old name is refused wherever the new
/// one is a valid field.
const RENAMED: [(&str, &str); 5] = [
    ("mach", "lattice_velocity"),
    ("max_mach", "max_lattice_velocity"),
    ("mass", "rock_mass"),
    ("part", "fraction"),
    ("rain", "deposition"),
];

/// Maximum magnitude of any quantity of a case, in SI units.
const LARGEST: f64 = 1e30;

/// Minimum of any quantity that must be above 0, in SI units.
const SMALLEST: f64 = 1e-30;

/// Returns the schema as generated from the structs.
pub(crate) fn bare_schema() -> Value {
    schema_of::<super::Case>()
}

/// Returns the schema of any text that is read as a tree.
pub fn schema_of<T: JsonSchema>() -> Value {
    let mut schema = SchemaGenerator::new(SchemaSettings::draft2020_12())
        .into_root_schema_for::<T>()
        .to_value();
    unescape(&mut schema);
    schema
}

/// Removes the backslashes of units in brackets from the descriptions, which are comments: there `\[m\]` is no link.
fn unescape(part: &mut Value) {
    match part {
        Value::Object(fields) => {
            if let Some(Value::String(text)) = fields.get_mut("description") {
                *text = text.replace(r"\[", "[").replace(r"\]", "]");
            }
            fields.values_mut().for_each(unescape);
        }
        Value::Array(parts) => parts.iter_mut().for_each(unescape),
        _ => {}
    }
}

/// Findings of a walk over a tree.
pub(crate) struct Checked {
    /// The first [`MAX_PROBLEMS`] problems, and the number of further ones.
    pub(crate) problems: Vec<Problem>,
    /// `true` if a list does not have the expected number of values, so that its values cannot be interpreted
    /// together.
    pub(crate) wrong_shape: bool,
}

/// Returns all problems in the tree of a case; removes unknown fields, so that the remaining ones can be checked
/// further.
pub(crate) fn against_schema(tree: &mut Value) -> Checked {
    static ROOT: OnceLock<Value> = OnceLock::new();
    walk(ROOT.get_or_init(bare_schema), tree)
}

/// Returns all problems of a tree with respect to a schema.
pub fn problems_against(root: &Value, tree: &mut Value) -> Vec<Problem> {
    walk(root, tree).problems
}

fn walk(root: &Value, tree: &mut Value) -> Checked {
    let mut walk = Walk {
        root,
        problems: Vec::new(),
        more: 0,
        wrong_shape: false,
    };
    walk.node(tree, root, "");
    let mut problems = walk.problems;
    let controls = control_characters(tree);
    let room = MAX_PROBLEMS.saturating_sub(problems.len());
    let more = walk.more + controls.len().saturating_sub(room);
    problems.extend(controls.into_iter().take(room));
    problems.extend(unlisted(more));
    Checked {
        problems,
        wrong_shape: walk.wrong_shape,
    }
}

/// Minimum length of a list whose values are first compared with a template of their schema.
const MIN_FOR_TEMPLATE: usize = 16;

/// Keywords by which a schema restricts a value; without any of them every value is valid.
const RESTRICTING_KEYWORDS: [&str; 4] = ["type", "const", "enum", "properties"];

/// Returns the reason and remedy for an unknown name.
fn not_known(kind: &str, name: &str, known: &[&str]) -> (String, String) {
    let clipped = clipped(name);
    if let Some((feature, field)) = absent::elsewhere(name) {
        return (
            format!("there is no {kind} `{clipped}` here: {feature} is set in another field"),
            format!("use `{field}`"),
        );
    }
    match absent::feature(name) {
        Some(absent) => (
            format!(
                "there is no {kind} `{clipped}`: this program does not compute {}",
                absent.feature
            ),
            absent.alternative.into(),
        ),
        None => (
            format!("there is no {kind} `{clipped}` here"),
            nearest_remedy(name, known),
        ),
    }
}

/// Returns the reason and remedy for an unknown word of a choice; of the allowed words, those in `plain` are valid
/// without parameters.
fn unknown_word(path: &str, text: &str, allowed: &[&str], plain: &[&str]) -> (String, Remedy) {
    if absent::feature(text).is_some() || absent::elsewhere(text).is_some() {
        let (reason, remedy) = not_known("choice", text, allowed);
        return (reason, remedy.into());
    }
    let remedy = nearest_word(path, text, allowed, plain);
    ("this choice does not exist here".into(), remedy)
}

struct Walk<'a> {
    root: &'a Value,
    problems: Vec<Problem>,
    /// Number of problems beyond those listed.
    more: usize,
    wrong_shape: bool,
}

impl<'a> Walk<'a> {
    /// Counts a further problem and returns `true` if the list is full. Must be called before the texts of the problem
    /// are built.
    fn only_counted(&mut self) -> bool {
        let full = self.problems.len() >= MAX_PROBLEMS;
        self.more += usize::from(full);
        full
    }

    fn report(&mut self, path: &str, value: &Value, reason: String, remedy: impl Into<Remedy>) {
        if self.only_counted() {
            return;
        }
        let path = if path.is_empty() { "the case" } else { path };
        self.problems.push(Problem {
            path: path.into(),
            value: brief(value),
            reason,
            remedy: remedy.into(),
            severity: Severity::Error,
        });
    }

    /// Returns the schema to which a `$ref` refers, or the schema itself.
    fn resolve(&self, schema: &'a Value) -> &'a Value {
        let mut schema = schema;
        while let Some(name) = schema
            .get("$ref")
            .and_then(Value::as_str)
            .and_then(|r| r.strip_prefix("#/$defs/"))
        {
            match self.root.get("$defs").and_then(|defs| defs.get(name)) {
                Some(target) => schema = target,
                None => break,
            }
        }
        schema
    }

    fn node(&mut self, value: &mut Value, schema: &'a Value, path: &str) {
        let schema = self.resolve(schema);
        if let Some(options) = schema.get("oneOf").and_then(Value::as_array) {
            return self.tagged(value, options, path);
        }
        if let Some(options) = schema.get("anyOf").and_then(Value::as_array) {
            return self.any_of(value, options, path);
        }
        if !RESTRICTING_KEYWORDS
            .iter()
            .any(|word| schema.get(word).is_some())
        {
            return;
        }
        if wants_whole(schema) && self.whole_number(value, path) {
            return;
        }
        if !self.has_type(value, schema) {
            let wanted = expected_values(schema);
            // Whole numbers on both sides of a fraction.
            let near = value
                .as_f64()
                .filter(|_| wants_whole(schema))
                .map_or_else(String::new, |x| {
                    format!(", such as {} or {}", x.floor(), x.ceil())
                });
            return self.report(
                path,
                value,
                format!("this is {}, but {wanted} is needed", kind(value)),
                format!("write {wanted}{near}{}", summary_in_brackets(schema)),
            );
        }
        match value {
            Value::Object(map) => self.object(map, schema, path),
            Value::Array(list) => self.array(list, schema, path),
            Value::Number(_) => self.range(value, schema, path),
            Value::String(text) => {
                let choices = allowed_words(schema);
                if !choices.is_empty() && !choices.contains(&text.as_str()) {
                    let (reason, remedy) = unknown_word(path, text, &choices, &choices);
                    self.report(path, value, reason, remedy);
                }
            }
            _ => {}
        }
    }

    fn has_type(&self, value: &Value, schema: &Value) -> bool {
        let matches = |t: &Value| match t.as_str() {
            Some("object") => value.is_object(),
            Some("array") => value.is_array(),
            Some("number") => value.is_number(),
            Some("integer") => value.is_i64() || value.is_u64(),
            Some("string") => value.is_string(),
            Some("boolean") => value.is_boolean(),
            Some("null") => value.is_null(),
            _ => true,
        };
        match schema.get("type") {
            None => schema.get("const").is_none_or(|c| c == value),
            Some(Value::Array(types)) => types.iter().any(matches),
            Some(single) => matches(single),
        }
    }

    /// Replaces a number such as 40.0 or 4e1 by the whole number that it is. Reports one that f64 does not hold
    /// exactly, and returns `true` for it.
    fn whole_number(&mut self, value: &mut Value, path: &str) -> bool {
        if !value.is_f64() {
            let beyond = magnitude(value).is_some_and(|number| number > LARGEST_WHOLE);
            if beyond {
                self.too_large(value, path);
            }
            return beyond;
        }
        let Some(number) = value.as_f64().filter(|x| x.fract() == 0.0) else {
            return false;
        };
        match whole_value(number) {
            Some(whole) => *value = whole,
            None => self.too_large(value, path),
        }
        value.is_f64()
    }

    /// Reports a whole number beyond [`LARGEST_WHOLE`].
    fn too_large(&mut self, value: &Value, path: &str) {
        self.report(
            path,
            value,
            "this number is too large for a whole number".into(),
            format!("write a whole number of at most {LARGEST_WHOLE} in magnitude"),
        );
    }

    /// Reports a field that is null. An optional one counts as left out.
    fn null_field(&mut self, path: &str, schema: &Value, required: bool) {
        if self.only_counted() {
            return;
        }
        let help = summary_in_brackets(schema);
        self.problems.push(if required {
            Problem::error(
                path,
                "null",
                "this field is null, but it is required",
                format!("give it a value{help}"),
            )
        } else {
            Problem {
                path: path.into(),
                value: "null".into(),
                reason: "this field is null, which counts as left out".into(),
                // Without a proposal: a null is what the field already has.
                remedy: format!("leave it out, or give it a value{help}").into(),
                severity: Severity::Warning,
            }
        });
    }

    fn object(&mut self, map: &mut Map<String, Value>, schema: &'a Value, path: &str) {
        let empty = Map::new();
        let required = schema.get("required").and_then(Value::as_array);
        let required = required.into_iter().flatten().filter_map(Value::as_str);
        let properties = schema.get("properties").and_then(Value::as_object);
        let known: Vec<&str> = properties
            .unwrap_or(&empty)
            .keys()
            .map(String::as_str)
            .collect();
        self.rename(map, &known, path);
        let open = (schema.get("additionalProperties"))
            .filter(|s| s.is_object() || s.as_bool() == Some(true));
        let (mut unknown, mut null) = (Vec::new(), Vec::new());
        for (key, child) in map.iter_mut() {
            let child_path = join(path, &clipped(key));
            if let Some(child_schema) = properties.and_then(|p| p.get(key)) {
                if child.is_null() {
                    let needed = required.clone().any(|name| name == key);
                    self.null_field(&child_path, child_schema, needed);
                    null.push(key.clone());
                    continue;
                }
                self.node(child, child_schema, &child_path);
            } else if let Some(child_schema) = open {
                self.node(child, child_schema, &child_path);
            } else {
                unknown.push(key.clone());
                if self.problems.len() >= MAX_PROBLEMS {
                    self.more += 1;
                    continue;
                }
                let (reason, remedy) = not_known("field", key, &known);
                self.report(&child_path, child, reason, remedy);
            }
        }
        for key in unknown.iter().chain(&null) {
            map.remove(key);
        }
        for key in required {
            let absent = !map.contains_key(key) && !null.iter().any(|name| name == key);
            if absent && !self.only_counted() {
                let property = properties.and_then(|p| p.get(key));
                let help = property.map(summary_in_brackets).unwrap_or_default();
                self.problems.push(Problem::error(
                    join(path, key),
                    "missing",
                    "this field is required",
                    format!("add `{key}`{help}"),
                ));
            }
        }
    }

    /// Reports fields and choices under an old name, and continues as if the new one had been written, so that one
    /// mistake gives one problem.
    fn rename(&mut self, map: &mut Map<String, Value>, known: &[&str], path: &str) {
        for (old, new) in RENAMED {
            if known.contains(&old) || !known.contains(&new) {
                continue;
            }
            let Some(value) = map.remove(old) else {
                continue;
            };
            let (from, to) = (join(path, old), join(path, new));
            let remedy = Remedy::take_out(format!("write `{new}`"), &from).set(to, value.clone());
            let reason = format!("`{old}` is now named `{new}`");
            self.report(&from, &value, reason, remedy);
            map.entry(new).or_insert(value);
        }
    }

    fn array(&mut self, list: &mut [Value], schema: &'a Value, path: &str) {
        let bound = |key| schema.get(key).and_then(Value::as_u64);
        let count = list.len() as u64;
        let (least, most) = (bound("minItems"), bound("maxItems"));
        if least.is_some_and(|least| count < least) || most.is_some_and(|most| count > most) {
            self.wrong_shape = true;
            let allowed = match (least, most) {
                (Some(a), Some(b)) if a == b => format!("{a} values are needed"),
                (Some(a), Some(b)) => format!("{a} to {b} values are needed"),
                (Some(a), None) => format!("at least {a} values are needed"),
                (_, b) => format!("at most {} values are allowed", b.unwrap_or_default()),
            };
            let value = Value::Array(list.to_vec());
            self.report(
                path,
                &value,
                format!("this list has {count} values, but {allowed}"),
                "correct the list",
            );
        }
        if let Some(items) = schema.get("items").filter(|s| s.is_object()) {
            let template =
                (list.len() >= MIN_FOR_TEMPLATE).then(|| Template::from_schema(self.root, items));
            for (index, child) in list.iter_mut().enumerate() {
                if !template.as_ref().is_some_and(|t| t.accepts(child, LARGEST)) {
                    self.node(child, items, &format!("{path}[{index}]"));
                }
            }
        }
    }

    fn range(&mut self, value: &Value, schema: &Value, path: &str) {
        let Some(number) = value.as_f64() else {
            return;
        };
        let bound = |key| schema.get(key).and_then(Value::as_f64);
        let (least, above) = (bound("minimum"), bound("exclusiveMinimum"));
        let most = match schema.get("format").and_then(Value::as_str) {
            Some("uint32") => Some(bound("maximum").unwrap_or(f64::from(u32::MAX))),
            _ => bound("maximum"),
        };
        let below = bound("exclusiveMaximum");
        let good = number.abs() <= LARGEST
            && least.is_none_or(|b| number >= b)
            && above.is_none_or(|b| number > b && number - b >= SMALLEST)
            && most.is_none_or(|b| number <= b)
            && below.is_none_or(|b| number < b);
        if good {
            return;
        }
        let lower = match (least, above) {
            (_, Some(b)) if number > b => Some(format!("above {b}, at least {SMALLEST:e}")),
            (_, Some(b)) => Some(format!("above {b}")),
            (Some(b), None) => Some(format!("at least {b}")),
            _ => None,
        };
        let upper = match (most, below) {
            (_, Some(b)) => Some(format!("below {b}")),
            (Some(b), None) => Some(format!("at most {b}")),
            _ => Some(format!("at most {LARGEST:e} in magnitude")),
        };
        let allowed: Vec<String> = [lower, upper].into_iter().flatten().collect();
        let allowed = allowed.join(" and ");
        let mut remedy = Remedy::from(format!(
            "write a number {allowed}{}",
            summary_in_brackets(schema)
        ));
        // Nearest value of a range whose bound is included.
        let bound = match (least, most) {
            (Some(least), _) if number < least => Some("minimum"),
            (_, Some(most)) if number > most => Some("maximum"),
            _ => None,
        };
        if let Some(nearest) = bound.and_then(|key| schema.get(key)) {
            remedy = remedy.set(path, nearest.clone());
        }
        self.report(
            path,
            value,
            format!("out of range; the value must be {allowed}"),
            remedy,
        );
    }

    /// Checks an externally tagged enum: a word, or an object with one key that names the choice.
    fn tagged(&mut self, value: &mut Value, options: &'a [Value], path: &str) {
        let mut names: Vec<&str> = Vec::new();
        let mut plain: Vec<&str> = Vec::new();
        for option in options {
            plain.extend(allowed_words(option));
            names.extend(
                option
                    .get("properties")
                    .and_then(Value::as_object)
                    .into_iter()
                    .flat_map(|p| p.keys().map(String::as_str)),
            );
        }
        let all: Vec<&str> = plain.iter().chain(&names).copied().collect();
        match value {
            Value::String(text) if plain.contains(&text.as_str()) => {}
            Value::String(text) if names.contains(&text.as_str()) => {
                let remedy = format!("write {{\"{text}\": {{..}}}}");
                let reason = "this choice is an object with its parameters".into();
                self.report(path, value, reason, remedy);
            }
            Value::String(text) => {
                let (reason, remedy) = unknown_word(path, text, &all, &plain);
                self.report(path, value, reason, remedy);
            }
            Value::Object(map) if map.len() == 1 && !names.is_empty() => {
                self.rename(map, &all, path);
                let Some((tag, child)) = map.iter_mut().next() else {
                    return;
                };
                let child_path = join(path, tag);
                let schema = options
                    .iter()
                    .find_map(|option| option.get("properties").and_then(|p| p.get(tag)));
                if let Some(schema) = schema {
                    self.node(child, schema, &child_path);
                } else if let Some(word) = plain.iter().find(|word| **word == tag) {
                    let remedy = Remedy::from(format!("write \"{word}\"")).set(path, *word);
                    let reason = "this choice is a word without parameters".into();
                    self.report(path, value, reason, remedy);
                } else {
                    let (reason, remedy) = not_known("choice", tag, &all);
                    self.report(&child_path, child, reason, remedy);
                }
            }
            Value::Object(map) if !names.is_empty() => {
                let reason = format!(
                    "this has {} keys; exactly one choice is required",
                    map.len()
                );
                self.report(path, value, reason, choose(&names));
            }
            _ => {
                let reason = format!("this is {}, but one of the choices is needed", kind(value));
                self.report(path, value, reason, choose(&all));
            }
        }
    }

    /// Checks optional values and untagged enums: problems are reported for the option with the type of the value.
    fn any_of(&mut self, value: &mut Value, options: &'a [Value], path: &str) {
        // An optional value is checked in place: a copy for a trial could be one of a million grains.
        if let [option, null] = options
            && null.get("type").is_some_and(|t| t == "null")
        {
            if !value.is_null() {
                self.node(value, option, path);
            }
            return;
        }
        let mut best: Option<(bool, Walk)> = None;
        for option in options {
            let resolved = self.resolve(option);
            if resolved.get("type").is_some_and(|t| t == "null") && !value.is_null() {
                continue;
            }
            let mut attempt = Walk {
                root: self.root,
                problems: Vec::new(),
                more: 0,
                wrong_shape: false,
            };
            let mut copy = value.clone();
            attempt.node(&mut copy, option, path);
            let refuses = |problem: &Problem| problem.severity == Severity::Error;
            if !attempt.problems.iter().any(refuses) {
                self.problems.extend(attempt.problems);
                self.more += attempt.more;
                *value = copy;
                return;
            }
            let own = (resolved.get("oneOf").is_some() && value.is_object())
                || (resolved.get("type").is_some() && self.has_type(value, resolved))
                || (!allowed_words(resolved).is_empty() && value.is_string());
            let null = resolved.get("type").is_some_and(|t| t == "null");
            let better = match &best {
                None => !null,
                Some((best_own, _)) => own && !*best_own && !null,
            };
            if better {
                best = Some((own, attempt));
                *value = copy;
            }
        }
        if let Some((_, attempt)) = best {
            self.problems.extend(attempt.problems);
            self.more += attempt.more + self.problems.len().saturating_sub(MAX_PROBLEMS);
            self.problems.truncate(MAX_PROBLEMS);
            self.wrong_shape |= attempt.wrong_shape;
        }
    }
}

/// Returns the words that a schema of strings allows; empty if any text is allowed.
fn allowed_words(schema: &Value) -> Vec<&str> {
    let listed = schema.get("enum").and_then(Value::as_array);
    let single = schema.get("const");
    let options = schema.get("oneOf").and_then(Value::as_array);
    listed
        .into_iter()
        .flatten()
        .chain(single)
        .filter_map(Value::as_str)
        .chain(
            options
                .into_iter()
                .flatten()
                .filter_map(|o| o.get("const").and_then(Value::as_str)),
        )
        .collect()
}

/// Returns `true` if a schema allows whole numbers and no others.
fn wants_whole(schema: &Value) -> bool {
    match schema.get("type") {
        Some(Value::Array(types)) => {
            types.iter().any(|t| t == "integer") && !types.iter().any(|t| t == "number")
        }
        single => single.is_some_and(|t| t == "integer"),
    }
}

/// Largest whole number up to which f64 holds each one: 2^53.
const LARGEST_WHOLE: u64 = 1 << 53;

/// Returns the magnitude of a whole number that is written without a point or an exponent; `None` for other values.
fn magnitude(value: &Value) -> Option<u64> {
    value
        .as_u64()
        .or_else(|| value.as_i64().map(i64::unsigned_abs))
}

/// Returns a number without a fraction as a whole number of JSON; `None` beyond [`LARGEST_WHOLE`].
fn whole_value(number: f64) -> Option<Value> {
    // 2^53 itself is the nearest number of 2^53 + 1 as well.
    (number.abs() < real(LARGEST_WHOLE)).then(|| floor_i64(number).into())
}

/// Reads a whole number of a document that is not read from its checked tree; it may have a point or an exponent.
///
/// # Errors
/// If the value is not a whole number of the type.
pub fn whole<'de, D: Deserializer<'de>, T: TryFrom<u64>>(reader: D) -> Result<T, D::Error> {
    let value = Value::deserialize(reader)?;
    let number = value
        .as_u64()
        .or_else(|| whole_value(value.as_f64()?)?.as_u64());
    let number = number.filter(|&number| number <= LARGEST_WHOLE);
    let number = number.and_then(|number| T::try_from(number).ok());
    number.ok_or_else(|| {
        D::Error::custom(format!(
            "{value} is not a whole number in the allowed range"
        ))
    })
}

/// Reads an optional field like [`whole`].
///
/// # Errors
/// If [`whole`] fails.
pub fn optional_whole<'de, D, T>(reader: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: TryFrom<u64>,
{
    whole(reader).map(Some)
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(n) if n.as_f64().is_some_and(|x| x.fract() != 0.0) => {
            "a number with a fraction"
        }
        Value::Number(_) => "a whole number",
        Value::String(_) => "text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

fn expected_values(schema: &Value) -> String {
    let name = |t: &Value| match t.as_str() {
        Some("object") => "an object {..}",
        Some("array") => "a list [..]",
        Some("number") => "a number",
        Some("integer") => "a whole number",
        Some("string") => "text",
        Some("boolean") => "true or false",
        _ => "nothing",
    };
    match schema.get("type") {
        Some(Value::Array(types)) => types
            .iter()
            .find(|t| *t != "null")
            .map(name)
            .unwrap_or("nothing")
            .into(),
        Some(single) => name(single).into(),
        None => schema
            .get("const")
            .map_or_else(|| "another value".into(), Value::to_string),
    }
}

/// Returns the first sentence of the documentation of a field, in brackets.
fn summary_in_brackets(schema: &Value) -> String {
    let text = schema
        .get("description")
        .and_then(Value::as_str)
        .unwrap_or_default()
        .replace('\n', " ");
    // A full stop within a number or a formula does not end a sentence.
    let first = text.split(". ").next().unwrap_or_default();
    let first = first.split(';').next().unwrap_or_default();
    let first = first.trim_end_matches('.');
    if first.is_empty() {
        String::new()
    } else {
        format!(" ({first})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that a whole number may be written with a point or an exponent, in a field, in an optional field and in a
    /// long list, and that a fraction and a number that is not exact are refused.
    #[test]
    fn a_whole_number_may_have_a_point_or_an_exponent() {
        let integer = |more: Value| {
            let mut schema =
                serde_json::json!({"type": "integer", "format": "uint32", "minimum": 0});
            schema
                .as_object_mut()
                .unwrap()
                .extend(more.as_object().unwrap().clone());
            schema
        };
        let root = serde_json::json!({"type": "object", "properties": {
            "n": integer(serde_json::json!({})),
            "optional": integer(serde_json::json!({"type": ["integer", "null"]})),
            "list": {"type": "array", "items": integer(serde_json::json!({}))},
            "choice": {"anyOf": [{"type": "string"}, integer(serde_json::json!({}))]},
        }});
        let written = [
            r#"{"n": 40.0}"#,
            r#"{"n": 4e1, "optional": 3.0}"#,
            r#"{"choice": 2.0}"#,
            r#"{"list": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16.0]}"#,
        ];
        let meant = [
            r#"{"n":40}"#,
            r#"{"n":40,"optional":3}"#,
            r#"{"choice":2}"#,
            r#"{"list":[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16]}"#,
        ];
        for (written, meant) in written.iter().zip(meant) {
            let mut tree: Value = serde_json::from_str(written).unwrap();
            let problems = problems_against(&root, &mut tree);
            assert!(problems.is_empty(), "{written}: {problems:?}");
            assert_eq!(tree.to_string(), meant);
        }
        for (text, reason, remedy) in [
            (
                r#"{"n": 40.5}"#,
                "a number with a fraction",
                "such as 40 or 41",
            ),
            (r#"{"n": 1e20}"#, "too large", "at most 9007199254740992"),
            (
                r#"{"n": 18446744073709551615}"#,
                "too large",
                "at most 9007199254740992",
            ),
            (
                r#"{"n": 9007199254740993}"#,
                "too large",
                "at most 9007199254740992",
            ),
            (r#"{"n": -3.0}"#, "out of range", "at least 0"),
        ] {
            let mut tree: Value = serde_json::from_str(text).unwrap();
            let problems = problems_against(&root, &mut tree);
            assert_eq!(problems.len(), 1, "{text}: {problems:?}");
            let told = problems[0].to_string();
            assert!(told.contains(reason) && told.contains(remedy), "{told}");
        }
    }

    /// Checks that every field that is null gets one finding with the same beginning: a warning where the field may be
    /// left out, whether its default is none or a value, and an error where it is required.
    #[test]
    fn a_field_that_is_null_gets_one_finding() {
        let text = crate::examples::find("deposition").unwrap().text;
        for (path, severity) in [
            ("/contact", Severity::Warning),
            ("/title", Severity::Warning),
            ("/probes", Severity::Warning),
            ("/time", Severity::Error),
            ("/time/end", Severity::Error),
        ] {
            let mut tree: Value = serde_json::from_str(text).unwrap();
            let field = path.rsplit('/').next().unwrap();
            let parent = tree
                .pointer_mut(&path[..path.len() - field.len() - 1])
                .unwrap();
            parent
                .as_object_mut()
                .unwrap()
                .insert(field.into(), Value::Null);
            let problems = against_schema(&mut tree).problems;
            assert_eq!(problems.len(), 1, "{path}: {problems:?}");
            assert_eq!(problems[0].severity, severity, "{path}");
            assert!(
                problems[0].reason.starts_with("this field is null, "),
                "{path}"
            );
            assert!(problems[0].remedy.proposal().is_empty(), "{path}");
            assert!(tree.pointer(path).is_none(), "{path}");
        }
    }

    #[test]
    fn an_old_name_is_refused_and_the_new_one_named() {
        let text = crate::examples::find("cavity").unwrap().text;
        let mut tree: Value = serde_json::from_str(text).unwrap();
        let lattice = &mut tree["fluid"]["lattice_boltzmann"];
        lattice["mach"] = lattice["lattice_velocity"].take();
        lattice.as_object_mut().unwrap().remove("lattice_velocity");
        let problems = against_schema(&mut tree).problems;
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(problems[0].path, "fluid.lattice_boltzmann.mach");
        assert_eq!(problems[0].reason, "`mach` is now named `lattice_velocity`");
        assert_eq!(problems[0].remedy.proposal().len(), 2);

        let mut tree: Value =
            serde_json::from_str(crate::examples::find("deposition").unwrap().text).unwrap();
        let initial = tree["grains"]["initial"].as_object_mut().unwrap();
        let written = initial.remove("deposition").unwrap();
        initial.insert("rain".into(), written);
        let problems = against_schema(&mut tree).problems;
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(problems[0].reason, "`rain` is now named `deposition`");

        for (_, new) in RENAMED {
            assert!(
                bare_schema().to_string().contains(&format!("\"{new}\"")),
                "{new} is a name of the case"
            );
        }
    }
}
