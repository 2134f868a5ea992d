//! Reference of a case: path, type, unit, default, range, meaning and example of every parameter.
//!
//! All texts come from the schema and all values from the example cases, so that the reference agrees with the program.
//! Each page describes one section of the case. [`markdown`] and [`html`] render the pages.

pub mod html;
pub mod markdown;

use super::text::join;
use super::{annotation, check, examples, restart};
use serde_json::Value;
use std::collections::BTreeMap;

/// Name of the front page, which has the fields without a page of their own.
pub const FRONT_PAGE: &str = "index";

/// Placeholder for a key that the user chooses, as in `materials.NAME.density`.
const ANY_KEY: &str = "NAME";

/// Maximum length of the example of a single parameter [characters]; a longer one is only in the example of its
/// page.
const LONGEST_EXAMPLE: usize = 100;

/// File of the reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Name of the file.
    pub name: String,
    /// Text of the file.
    pub text: String,
}

/// Page of the reference: one section of the case.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// Name of the section, or [`FRONT_PAGE`].
    pub name: String,
    /// Parameters in the order of the page.
    pub parameters: Vec<Parameter>,
    /// Example of the section.
    pub example: Option<Example>,
}

/// Example of a section.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Name of the example case that contains it; none if no case does and the defaults are shown.
    pub case: Option<&'static str>,
    /// The section as the only member of an object, without annotations.
    pub value: Value,
}

/// Field, or variant of a choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Path as in messages and `--set`; `[]` stands for any item of a list, `NAME` for any name.
    pub path: String,
    /// Meaning, as the schema describes it.
    pub meaning: String,
    /// Type in words.
    pub kind: String,
    /// Unit; `1` for numbers without dimension.
    pub unit: Option<String>,
    /// `true` if the field must be given when its section is given.
    pub required: bool,
    /// Default value, as JSON.
    pub default: Option<Value>,
    /// Allowed range.
    pub range: Option<String>,
    /// Allowed words, with their meanings.
    pub words: Vec<(String, String)>,
    /// Effect of a change at a restart, where a change is allowed.
    pub restart: Option<String>,
    /// Example value.
    pub example: Option<Value>,
    /// JSON pointer of the schema of the value.
    pub pointer: String,
}

impl Parameter {
    /// Returns the last part of the path: the key in the JSON text.
    #[must_use]
    pub fn key(&self) -> &str {
        let last = self.path.rsplit('.').next().unwrap_or(&self.path);
        last.trim_end_matches("[]")
    }

    /// Returns the name of the anchor on the page.
    #[must_use]
    pub fn anchor(&self) -> String {
        self.path.replace("[]", "").replace('.', "-")
    }

    /// Returns the example as a member of a JSON object.
    #[must_use]
    pub fn example_text(&self) -> Option<String> {
        let value = self.example.as_ref()?;
        Some(format!("\"{}\": {value}", self.key()))
    }
}

/// Returns the pages of the reference: the front page first, then one page for each section.
#[must_use]
pub fn pages() -> Vec<Page> {
    let root = restart::mark(check::bare_schema());
    let mut reader = Reader {
        root: &root,
        found: Vec::new(),
    };
    reader.children("", "");
    let mut parameters = reader.found;
    let known: Vec<String> = parameters.iter().map(|p| p.path.clone()).collect();
    let cases: Vec<(&'static str, Value)> = examples::EXAMPLES
        .iter()
        .filter_map(|example| {
            let mut tree = serde_json::from_str(example.text).ok()?;
            annotation::strip(&mut tree);
            Some((example.name, tree))
        })
        .collect();
    let mut seen = BTreeMap::new();
    for (_, tree) in &cases {
        collect(tree, "", &known, &mut seen);
    }
    for parameter in &mut parameters {
        parameter.example = seen
            .remove(&parameter.path)
            .filter(|value| value.to_string().len() <= LONGEST_EXAMPLE)
            .or_else(|| parameter.default.clone().and_then(without_null))
            .or_else(|| Some(parameter.words.first()?.0.clone().into()));
    }
    let mut pages = vec![Page {
        name: FRONT_PAGE.into(),
        parameters: Vec::new(),
        example: None,
    }];
    for section in parameters.chunk_by(|a, b| section_of(&a.path) == section_of(&b.path)) {
        // A section of one line gets no page.
        let name = match section {
            [only] => {
                pages[0].parameters.push(only.clone());
                continue;
            }
            [first, ..] => section_of(&first.path),
            [] => continue,
        };
        pages.push(Page {
            name: name.to_owned(),
            parameters: section.to_vec(),
            example: instructive(&cases, name).or_else(|| defaults(&section[0])),
        });
    }
    pages
}

/// Returns the first part of a path.
fn section_of(path: &str) -> &str {
    path.split(['.', '[']).next().unwrap_or(path)
}

/// Maximum length of the example of a section on a page, as compact JSON [characters].
const LONGEST_SECTION: usize = 900;

/// Returns the section from the case that uses it most, if it fits on a page; otherwise the shortest.
fn instructive(cases: &[(&'static str, Value)], section: &str) -> Option<Example> {
    cases
        .iter()
        .filter_map(|(case, tree)| Some((*case, tree.get(section)?)))
        .filter(|(_, value)| value.to_string().len() > 2)
        .max_by_key(|(_, value)| {
            let length = value.to_string().len();
            let fits = length <= LONGEST_SECTION;
            (fits, if fits { length } else { usize::MAX - length })
        })
        .map(|(case, value)| Example {
            case: Some(case),
            value: serde_json::json!({ section: value }),
        })
}

/// Returns a default without the fields that are none by default; none for a default of none.
fn without_null(mut value: Value) -> Option<Value> {
    if let Value::Object(map) = &mut value {
        map.retain(|_, value| !value.is_null());
    }
    (!value.is_null()).then_some(value)
}

/// Returns the section with its defaults.
fn defaults(section: &Parameter) -> Option<Example> {
    let value = section.default.clone().and_then(without_null)?;
    value.as_object()?;
    Some(Example {
        case: None,
        value: serde_json::json!({ section.key(): value }),
    })
}

/// Collects the first value of every known path.
fn collect(value: &Value, path: &str, known: &[String], seen: &mut BTreeMap<String, Value>) {
    if !path.is_empty() {
        seen.entry(path.to_owned()).or_insert_with(|| value.clone());
    }
    match value {
        Value::Object(map) => {
            let named = join(path, ANY_KEY);
            for (key, child) in map {
                let below = if known.contains(&named) {
                    named.clone()
                } else {
                    join(path, key)
                };
                collect(child, &below, known, seen);
            }
        }
        Value::Array(list) => {
            for child in list {
                collect(child, &format!("{path}[]"), known, seen);
            }
        }
        _ => {}
    }
}

/// Walk over the schema that lists the parameters. Positions in the schema are JSON pointers.
struct Reader<'a> {
    root: &'a Value,
    found: Vec<Parameter>,
}

impl<'a> Reader<'a> {
    fn node(&self, pointer: &str) -> &'a Value {
        self.root.pointer(pointer).unwrap_or(&Value::Null)
    }

    /// Returns the alternative schemas of a value: references resolved, `null` excluded.
    fn alternatives(&self, pointer: &str) -> Vec<String> {
        let node = self.node(pointer);
        if let Some(target) = node.get("$ref").and_then(Value::as_str) {
            return self.alternatives(target.trim_start_matches('#'));
        }
        match node.get("anyOf").and_then(Value::as_array) {
            Some(options) => (0..options.len())
                .flat_map(|n| self.alternatives(&format!("{pointer}/anyOf/{n}")))
                .collect(),
            None if node.is_null() || node.get("type").is_some_and(|t| t == "null") => Vec::new(),
            None => vec![pointer.to_owned()],
        }
    }

    /// Lists a field or variant and everything below it.
    fn parameter(&mut self, path: String, pointer: &str, about: Option<&str>, required: bool) {
        let node = self.node(pointer);
        let alternatives = self.alternatives(pointer);
        let described = |pointer: &str| self.node(pointer).get("description")?.as_str();
        let mut meaning = Vec::from_iter(about.or_else(|| described(pointer)));
        for one in &alternatives {
            let items = format!("{one}/items");
            let inner = (self.alternatives(&items).into_iter()).filter(|at| !at.starts_with(one));
            meaning.extend(
                // The comment of an alternative that is written inline does not describe the field.
                std::iter::once(one.clone())
                    .filter(|at| !at.starts_with(pointer))
                    .chain(inner)
                    .filter_map(|at| described(&at))
                    .filter(|text| !meaning.contains(text))
                    .collect::<Vec<_>>(),
            );
        }
        let meaning: Vec<String> = meaning.iter().map(|text| text.replace('\n', " ")).collect();
        let meaning = meaning.join(" ");
        let parameter = Parameter {
            kind: self.kind(&alternatives),
            unit: unit(&meaning).map(str::to_owned),
            required,
            default: node.get("default").cloned(),
            range: alternatives.iter().find_map(|one| range(self.node(one))),
            words: alternatives
                .iter()
                .flat_map(|one| self.words(one))
                .collect(),
            restart: node
                .get("x-restart")
                .and_then(Value::as_str)
                .map(|text| text.trim_start_matches("may change: ").to_owned()),
            example: None,
            pointer: pointer.to_owned(),
            meaning,
            path: path.clone(),
        };
        self.found.push(parameter);
        for one in alternatives {
            self.children(&path, &one);
        }
    }

    /// Lists the parameters below a resolved schema: required fields first.
    fn children(&mut self, path: &str, pointer: &str) {
        let node = self.node(pointer);
        if let Some(properties) = node.get("properties").and_then(Value::as_object) {
            let required = |key: &str| {
                let list = node.get("required").and_then(Value::as_array);
                list.is_some_and(|list| list.iter().any(|name| name == key))
            };
            let mut keys: Vec<&String> = properties.keys().collect();
            keys.sort_by_key(|key| !required(key));
            for key in keys {
                let below = format!("{pointer}/properties/{key}");
                self.parameter(join(path, key), &below, None, required(key));
            }
        }
        if node
            .get("additionalProperties")
            .is_some_and(Value::is_object)
        {
            let below = format!("{pointer}/additionalProperties");
            self.parameter(join(path, ANY_KEY), &below, None, false);
        }
        if node.get("items").is_some_and(Value::is_object) {
            for item in self.alternatives(&format!("{pointer}/items")) {
                self.children(&format!("{path}[]"), &item);
            }
        }
        let options = node.get("oneOf").and_then(Value::as_array);
        for (n, option) in options.into_iter().flatten().enumerate() {
            let about = option.get("description").and_then(Value::as_str);
            for key in option
                .get("properties")
                .and_then(Value::as_object)
                .into_iter()
                .flat_map(|map| map.keys())
            {
                let below = format!("{pointer}/oneOf/{n}/properties/{key}");
                self.parameter(join(path, key), &below, about, false);
            }
        }
    }

    /// Returns the words that a schema allows, with their meanings.
    fn words(&self, pointer: &str) -> Vec<(String, String)> {
        let node = self.node(pointer);
        let word = |option: &Value| {
            let text = option.get("const")?.as_str()?;
            let about = option.get("description").and_then(Value::as_str);
            Some((
                text.to_owned(),
                about.unwrap_or_default().replace('\n', " "),
            ))
        };
        let listed = node.get("oneOf").and_then(Value::as_array);
        let items = (self.alternatives(&format!("{pointer}/items")).into_iter())
            .flat_map(|item| self.words(&item));
        std::iter::once(node)
            .chain(listed.into_iter().flatten())
            .filter_map(word)
            .chain(items)
            .collect()
    }

    fn kind(&self, alternatives: &[String]) -> String {
        let mut kinds: Vec<String> = Vec::new();
        for one in alternatives {
            let kind = self.kind_of(self.node(one), one);
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        kinds.join(" or ")
    }

    fn kind_of(&self, node: &Value, pointer: &str) -> String {
        if let Some(options) = node.get("oneOf").and_then(Value::as_array) {
            let words = options.iter().any(|o| o.get("const").is_some());
            let objects = options.iter().any(|o| o.get("properties").is_some());
            return match (words, objects) {
                (true, true) => "one word or an object with one choice",
                (false, true) => "object with one choice",
                _ => "one word",
            }
            .into();
        }
        if node.get("const").is_some() {
            return "one word".into();
        }
        let types = node.get("type");
        let single = match types {
            Some(Value::Array(list)) => list.iter().find(|t| *t != "null"),
            other => other,
        };
        match single.and_then(Value::as_str) {
            Some("array") => {
                let item = self.kind(&self.alternatives(&format!("{pointer}/items")));
                let bound = |key| node.get(key).and_then(Value::as_u64);
                match (bound("minItems"), bound("maxItems")) {
                    (Some(a), Some(b)) if a == b => format!("list of {a}: {item}"),
                    (Some(a), Some(b)) => format!("list of {a} to {b}: {item}"),
                    _ => format!("list: {item}"),
                }
            }
            Some("integer") => "whole number".into(),
            Some("string") => "text".into(),
            Some("boolean") => "true or false".into(),
            Some(other) => other.into(),
            None => "value".into(),
        }
    }
}

/// Returns the unit in a description: the content of the first brackets that contain one.
fn unit(meaning: &str) -> Option<&str> {
    let in_brackets = meaning.match_indices('[').find_map(|(at, _)| {
        let rest = &meaning[at + 1..];
        let inner = &rest[..rest.find(']')?];
        let plain = |c: char| c.is_alphanumeric() || " /%°".contains(c);
        (!inner.is_empty() && inner.chars().all(plain)).then_some(inner)
    });
    in_brackets.or_else(|| meaning.contains("without unit").then_some("1"))
}

/// Returns the range that a schema allows for a number.
fn range(node: &Value) -> Option<String> {
    let bound = |key, words: &str| Some(format!("{words} {}", node.get(key)?.as_f64()?));
    let lower = bound("exclusiveMinimum", "above").or_else(|| bound("minimum", "at least"));
    let upper = bound("exclusiveMaximum", "below").or_else(|| bound("maximum", "at most"));
    let both: Vec<String> = lower.into_iter().chain(upper).collect();
    (!both.is_empty()).then(|| both.join(", "))
}

/// Returns the parameter to which a name in a description refers: a parameter of the same object, otherwise of an
/// object that contains it, otherwise the only one of that name.
fn referenced_parameter<'a>(
    pages: &'a [Page],
    from: &str,
    name: &str,
) -> Option<(&'a Page, &'a Parameter)> {
    let find = |path: &str| {
        pages.iter().find_map(|page| {
            let hit = page.parameters.iter().find(|p| p.path == path)?;
            Some((page, hit))
        })
    };
    let mut above = Some(from);
    while let Some(path) = above {
        let parent = path.rsplit_once('.').map(|(parent, _)| parent);
        if let Some(hit) = find(&join(parent.unwrap_or_default(), name)) {
            return (hit.1.path != from).then_some(hit);
        }
        above = parent;
    }
    let ending = format!(".{name}");
    let mut all = pages.iter().flat_map(|page| {
        let hits = page.parameters.iter().filter(|p| p.path.ends_with(&ending));
        hits.map(move |hit| (page, hit))
    });
    let only = all.next()?;
    (all.next().is_none() && only.1.path != from).then_some(only)
}

/// Splits a description into text and names in backticks.
fn parts(text: &str) -> impl Iterator<Item = (bool, &str)> {
    text.split('`')
        .enumerate()
        .map(|(n, part)| (n % 2 == 1, part))
}

/// Returns facts about a parameter in the order of the page, without the meaning.
fn facts(parameter: &Parameter) -> Vec<(&'static str, String)> {
    let mut facts = vec![("Type", parameter.kind.clone())];
    let mut add = |name, value: Option<String>| facts.extend(value.map(|value| (name, value)));
    add("Unit", parameter.unit.clone());
    add("Range", parameter.range.clone());
    add("Required", parameter.required.then(|| "yes".into()));
    let default = parameter.default.as_ref().filter(|d| !d.is_null());
    let brief = default.map(Value::to_string);
    add("Default", brief.filter(|d| d.len() <= LONGEST_EXAMPLE));
    add("At a restart", parameter.restart.clone());
    facts
}

#[cfg(test)]
mod tests;
