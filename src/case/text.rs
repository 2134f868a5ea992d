//! Parsing of JSON text into a tree, at a bounded cost. Duplicate keys are refused, because either value might be
//! intended. Objects with more keys than [`MAX_KEYS`] and texts with more values than [`MAX_VALUES`] are refused.
//! Brackets nest at most 127 deep.

mod plain;

use base::error::{Problem, Severity};
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::cell::{Cell, RefCell};

/// Accepts in a [`Visitor`] the values that hold no others.
macro_rules! plain_values {
    () => {
        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
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
    };
}
use plain_values;

/// Maximum number of keys of one object.
pub const MAX_KEYS: usize = 10_000;
/// Maximum number of values of a text, including each value of lists and objects.
pub const MAX_VALUES: usize = 20_000_000;
/// Maximum number of problems listed for one text; further ones are only counted.
pub const MAX_PROBLEMS: usize = 50;

/// Returns the message about problems that are not listed.
#[must_use]
pub fn unlisted(more: usize) -> Option<Problem> {
    (more > 0).then(|| {
        Problem::error(
            "the text",
            format!("{more} more problems"),
            format!("only the first {MAX_PROBLEMS} are listed"),
            "correct those first",
        )
    })
}

/// Returns the tree, as far as the text is valid, and the problems of the text.
#[must_use]
pub fn parse(text: &str) -> (Option<Value>, Vec<Problem>) {
    let text = text.trim_start_matches('\u{feff}');
    // A text without problems needs no paths, whose construction would take most of the time.
    if let Some(tree) = plain::parse(text) {
        return (Some(tree), Vec::new());
    }
    let problems = RefCell::new(Vec::new());
    let (values, more) = (Cell::new(0), Cell::new(0));
    let node = Node {
        path: String::new(),
        problems: &problems,
        values: &values,
        more: &more,
    };
    let mut reader = serde_json::Deserializer::from_str(text);
    let tree = node.deserialize(&mut reader).and_then(|tree| {
        reader.end()?;
        Ok(tree)
    });
    let mut problems = problems.into_inner();
    problems.extend(unlisted(more.get()));
    match tree {
        Ok(tree) => (Some(tree), problems),
        Err(error) => {
            let place = format!("line {} column {}", error.line(), error.column());
            problems.push(match not_finite(text, error.line(), error.column()) {
                Some((word, key)) => Problem::error(
                    place,
                    word,
                    format!("the value of `{key}` is not a number: JSON has no {word}"),
                    "write a finite number",
                ),
                None => Problem::error(
                    place,
                    "not JSON",
                    format!("the text is not valid JSON ({error})"),
                    "correct the text at this position",
                ),
            });
            (None, problems)
        }
    }
}

/// Returns the word at a position of a text and the key before it, if the word is `NaN` or `Infinity`, as programs
/// write numbers that are not finite.
fn not_finite(text: &str, line: usize, column: usize) -> Option<(&'static str, &str)> {
    let start: usize = text
        .split_inclusive('\n')
        .take(line.checked_sub(1)?)
        .map(str::len)
        .sum();
    let at = start + column.checked_sub(1)?;
    let (before, rest) = (text.get(..at)?, text.get(at..)?);
    let word = ["NaN", "Infinity"]
        .into_iter()
        .find(|word| rest.starts_with(word))?;
    // The key of the value, or of the list of numbers that it is in.
    let list = |c: char| c.is_ascii_digit() || c.is_whitespace() || "[],+-.eE".contains(c);
    let key = before.trim_end_matches(list).strip_suffix(':')?.trim_end();
    let key = key.strip_suffix('"')?;
    Some((word, &key[key.rfind('"')? + 1..]))
}

/// Beginning of the message about an object whose last keys were not read.
const TOO_MANY: &str = "an object has too many keys, and only the first of them are read:";

/// Returns `true` if an object of the text was only partly read.
#[must_use]
pub(crate) fn cut_short(problems: &[Problem]) -> bool {
    problems.iter().any(|p| p.reason.starts_with(TOO_MANY))
}

struct Node<'a> {
    path: String,
    problems: &'a RefCell<Vec<Problem>>,
    /// Number of values read so far.
    values: &'a Cell<usize>,
    /// Number of problems beyond those listed.
    more: &'a Cell<usize>,
}

impl Node<'_> {
    fn below(&self, path: String) -> Node<'_> {
        Node {
            path,
            problems: self.problems,
            values: self.values,
            more: self.more,
        }
    }

    fn report(&self, problem: impl FnOnce() -> Problem) {
        let mut problems = self.problems.borrow_mut();
        if problems.len() < MAX_PROBLEMS {
            problems.push(problem());
        } else {
            self.more.set(self.more.get() + 1);
        }
    }
}

impl<'de> DeserializeSeed<'de> for Node<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        self.values.set(self.values.get() + 1);
        if self.values.get() > MAX_VALUES {
            return Err(Error::custom(format!("more than {MAX_VALUES} values")));
        }
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Node<'_> {
    type Value = Value;

    plain_values!();

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(value) =
            access.next_element_seed(self.below(format!("{}[{}]", self.path, list.len())))?
        {
            list.push(value);
        }
        Ok(list.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while map.len() < MAX_KEYS {
            let Some(key) = access.next_key::<String>()? else {
                return Ok(map.into());
            };
            let path = join(&self.path, &key);
            let value = access.next_value_seed(self.below(path.clone()))?;
            if map.contains_key(&key) {
                self.report(|| Problem {
                    path,
                    value: brief(&value),
                    reason: "this key is written twice".into(),
                    remedy: "keep one of the two".into(),
                    severity: Severity::Error,
                });
            }
            map.insert(key, value);
        }
        let mut more = 0_usize;
        while access.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {
            more += 1;
        }
        if more > 0 {
            self.report(|| Problem {
                path: if self.path.is_empty() {
                    "the case".into()
                } else {
                    self.path.clone()
                },
                value: format!("{{{} keys}}", map.len() + more),
                reason: format!("{TOO_MANY} {MAX_KEYS}"),
                remedy: "remove the keys that are not meant".into(),
                severity: Severity::Error,
            });
        }
        Ok(map.into())
    }
}

/// Returns the path of a field of the object at `path`.
#[must_use]
pub fn join(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_string()
    } else {
        format!("{path}.{key}")
    }
}

/// Returns a value as text short enough for a sentence.
#[must_use]
pub fn brief(value: &Value) -> String {
    let mut head = Head(Vec::new());
    // The end of a long text is not written, which is not a failure.
    let _ = serde_json::to_writer(&mut head, value);
    let text = String::from_utf8_lossy(&head.0);
    if text.chars().count() <= 60 {
        return text.into_owned();
    }
    let mut short: String = text.chars().take(57).collect();
    short.push_str("...");
    short
}

/// Writer that accepts the first bytes of a text and refuses the others.
struct Head(Vec<u8>);

impl Head {
    /// Maximum number of bytes that are kept: enough for 61 characters.
    const MAX_BYTES: usize = 256;
}

impl std::io::Write for Head {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let room = Self::MAX_BYTES - self.0.len();
        if room == 0 {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        let taken = &bytes[..bytes.len().min(room)];
        self.0.extend_from_slice(taken);
        Ok(taken.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
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
    fn a_byte_order_mark_is_no_part_of_the_text() {
        let (tree, problems) = parse("\u{feff}{\"a\": 1}");
        assert_eq!((tree.unwrap()["a"].as_u64(), problems), (Some(1), vec![]));
        assert_eq!(parse("\u{feff}{\"a\": 1, \"a\": 2}").1[0].path, "a");
    }

    #[test]
    fn text_that_is_not_json_names_the_line() {
        let (tree, problems) = parse("{\n \"a\": 1,\n}");
        assert!(tree.is_none());
        assert!(problems[0].path.starts_with("line 3"), "{problems:?}");
        assert!(parse("{} {}").0.is_none(), "text after the end");
    }

    #[test]
    fn numbers_that_are_not_finite_are_named_with_their_key() {
        for (text, word, key) in [
            ("{\"a\": {\"end\": NaN}}", "NaN", "end"),
            (
                "{\"a\": 1,\n \"size\": [1.0, -Infinity]}",
                "Infinity",
                "size",
            ),
            ("{\"list\": [[0, 1e-3],\n [2, NaN]]}", "NaN", "list"),
        ] {
            let (_, problems) = parse(text);
            let found = problems[0].to_string();
            assert!(found.contains(&format!("`{key}`")), "{found}");
            assert!(
                found.contains(word) && found.starts_with("line "),
                "{found}"
            );
        }
        // A word elsewhere is not a value.
        assert!(!parse("NaN").1[0].to_string().contains("has no"));
    }
}
