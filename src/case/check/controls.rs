//! Control characters in the texts of a case.

use crate::text::{brief, join};
use base::error::{Problem, Severity, controls};
use serde_json::Value;

/// Reports texts with characters that control a terminal, or end a line where a file or script expects a single
/// one: titles, names, paths, keys. They are refused here, once, so that no output has to escape them. A
/// description may have several lines.
pub(super) fn control_characters(tree: &Value) -> Vec<Problem> {
    let mut found = Vec::new();
    find_controls(tree, &Place::Case, false, &mut found);
    found
}

/// Path of a value, converted to text only for a problem: lists may have a hundred thousand values.
enum Place<'a> {
    Case,
    Key(&'a Place<'a>, &'a str),
    Index(&'a Place<'a>, usize),
}

impl Place<'_> {
    fn path(&self) -> String {
        match self {
            Self::Case => String::new(),
            Self::Key(above, key) => join(&above.path(), key),
            Self::Index(above, index) => format!("{}[{index}]", above.path()),
        }
    }
}

fn find_controls(value: &Value, place: &Place<'_>, lines: bool, found: &mut Vec<Problem>) {
    let check = |text: &str, place: &Place<'_>, lines: bool, found: &mut Vec<Problem>| {
        let stays = |c| lines && matches!(c, '\n' | '\r' | '\t');
        if let Some(c) = text.chars().find(|&c| controls(c) && !stays(c)) {
            found.push(Problem {
                path: place.path(),
                value: brief(&text.into()),
                reason: format!(
                    "the text contains the control character U+{:04X}",
                    u32::from(c)
                ),
                remedy: "write the text in one line, without control characters".into(),
                severity: Severity::Error,
            });
        }
    };
    match value {
        Value::String(text) => check(text, place, lines, found),
        Value::Array(list) => {
            for (n, child) in list.iter().enumerate() {
                find_controls(child, &Place::Index(place, n), lines, found);
            }
        }
        Value::Object(map) => {
            for (key, child) in map {
                let here = Place::Key(place, key);
                check(key, &here, false, found);
                find_controls(child, &here, key == "description", found);
            }
        }
        _ => {}
    }
}
