//! The reference as Markdown: one file per page.

use super::{FRONT_PAGE, File, Page, Parameter, facts, pages, parts, referenced_parameter};
use std::fmt::Write;

/// Returns all files of the reference.
#[must_use]
pub fn files() -> Vec<File> {
    let pages = pages();
    pages
        .iter()
        .map(|page| File {
            name: format!("{}.md", page.name),
            text: text(&pages, page),
        })
        .collect()
}

fn text(pages: &[Page], page: &Page) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = if page.name == FRONT_PAGE {
        write!(
            out,
            "# Reference of a case\n\n{}\n\n",
            super::html::INTRODUCTION
        )
    } else {
        write!(out, "# {}\n\n[Contents]({FRONT_PAGE}.md)\n\n", page.name)
    };
    if page.name == FRONT_PAGE {
        for other in pages.iter().filter(|other| other.name != FRONT_PAGE) {
            let about = other.parameters.first().map_or("", |p| &p.meaning);
            let about = linked(pages, &other.name, about);
            let _ = writeln!(out, "- [`{0}`]({0}.md): {about}", other.name);
        }
        out.push('\n');
    }
    if let Some(example) = &page.example {
        let json = serde_json::to_string_pretty(&example.value).unwrap_or_default();
        let _ = write!(
            out,
            "{}:\n\n```json\n{json}\n```\n\n",
            example.case.map_or("Defaults".to_owned(), |case| format!(
                "From `solver example {case}`"
            ))
        );
    }
    for parameter in &page.parameters {
        one(pages, parameter, &mut out);
    }
    out
}

fn one(pages: &[Page], parameter: &Parameter, out: &mut String) {
    let _ = write!(
        out,
        "<a id=\"{}\"></a>\n\n## `{}`\n\n{}\n\n",
        parameter.anchor(),
        parameter.path,
        linked(pages, &parameter.path, &parameter.meaning)
    );
    for (word, about) in &parameter.words {
        let _ = writeln!(
            out,
            "- `\"{word}\"`: {}",
            linked(pages, &parameter.path, about)
        );
    }
    if !parameter.words.is_empty() {
        out.push('\n');
    }
    let _ = write!(out, "| | |\n|---|---|\n");
    for (name, value) in facts(parameter) {
        let _ = writeln!(out, "| {name} | {} |", value.replace('|', "\\|"));
    }
    if let Some(example) = parameter.example_text() {
        let _ = writeln!(out, "| Example | `{example}` |");
    }
    out.push('\n');
}

/// Returns a description in which the names of parameters are links.
fn linked(pages: &[Page], from: &str, text: &str) -> String {
    parts(text)
        .map(
            |(name, part)| match referenced_parameter(pages, from, part) {
                Some((page, hit)) if name => {
                    format!("[`{part}`]({}.md#{})", page.name, hit.anchor())
                }
                _ if name => format!("`{part}`"),
                _ => part
                    .replace('<', "&lt;")
                    .replace('|', "&#124;")
                    .replace('*', "\\*"),
            },
        )
        .collect()
}
