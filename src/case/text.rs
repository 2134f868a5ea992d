//! JSON text to a tree. A key written twice is refused: the reader cannot know which of the two was meant.

mod plain;

use crate::error::{Problem, Severity};
use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::cell::RefCell;
use std::fmt;

/// The tree, as far as there is one, and what is wrong with the text.
#[must_use]
pub fn parse(text: &str) -> (Option<Value>, Vec<Problem>) {
    // A text with which nothing is wrong needs no paths, which cost more than all else.
    if let Some(tree) = plain::parse(text) {
        return (Some(tree), Vec::new());
    }
    let problems = RefCell::new(Vec::new());
    let node = Node {
        path: String::new(),
        problems: &problems,
    };
    let mut reader = serde_json::Deserializer::from_str(text);
    let tree = node.deserialize(&mut reader).and_then(|tree| {
        reader.end()?;
        Ok(tree)
    });
    let mut problems = problems.into_inner();
    match tree {
        Ok(tree) => (Some(tree), problems),
        Err(error) => {
            problems.push(Problem {
                path: format!("line {} column {}", error.line(), error.column()),
                value: "not JSON".into(),
                reason: format!("the text is not valid JSON ({error})"),
                remedy: "correct the text there".into(),
                severity: Severity::Error,
            });
            (None, problems)
        }
    }
}

struct Node<'a> {
    path: String,
    problems: &'a RefCell<Vec<Problem>>,
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(value) = access.next_element_seed(Node {
            path: format!("{}[{}]", self.path, list.len()),
            problems: self.problems,
        })? {
            list.push(value);
        }
        Ok(list.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = access.next_key::<String>()? {
            let path = join(&self.path, &key);
            let value = access.next_value_seed(Node {
                path: path.clone(),
                problems: self.problems,
            })?;
            if map.contains_key(&key) {
                self.problems.borrow_mut().push(Problem {
                    path,
                    value: brief(&value),
                    reason: "this key is written twice".into(),
                    remedy: "keep one of the two".into(),
                    severity: Severity::Error,
                });
            }
            map.insert(key, value);
        }
        Ok(map.into())
    }
}

/// The path of a field of the object at `path`.
#[must_use]
pub fn join(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_string()
    } else {
        format!("{path}.{key}")
    }
}

/// A value as text short enough for a sentence.
#[must_use]
pub fn brief(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 60 {
        return text;
    }
    let mut short: String = text.chars().take(57).collect();
    short.push_str("...");
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_key_is_found_at_any_depth() {
        let (tree, problems) = parse(r#"{"a": [{"b": 1, "b": 2}], "c": 3}"#);
        assert!(tree.is_some());
        assert_eq!(problems.len(), 1);
        assert_eq!(problems[0].path, "a[0].b");
    }

    #[test]
    fn text_that_is_not_json_names_the_line() {
        let (tree, problems) = parse("{\n \"a\": 1,\n}");
        assert!(tree.is_none());
        assert!(problems[0].path.starts_with("line 3"), "{problems:?}");
        assert!(parse("{} {}").0.is_none(), "text after the end");
    }
}
