//! The reference as HTML: one self-contained file per page, with a sidebar, in light and dark.

use super::{FRONT_PAGE, File, Page, Parameter, facts, pages, parts, referenced_parameter};
use std::fmt::Write;

/// Introduction on the front page.
pub const INTRODUCTION: &str = "A case is one JSON file in SI units. Every parameter is listed by its path, as \
    messages and `--set` write \
it; `[]` stands for any item of a list and `NAME` for any name. In place of any value, an object \
`{\"value\": 0.2, \"source\": \"assumed\", \"note\": \"reason\"}` may state its source. Unknown fields are refused.";

const STYLE: &str = include_str!("style.css");

/// Returns all files of the reference.
#[must_use]
pub fn files() -> Vec<File> {
    let pages = pages();
    pages
        .iter()
        .map(|page| File {
            name: format!("{}.html", page.name),
            text: text(&pages, page),
        })
        .collect()
}

fn title(page: &Page) -> &str {
    if page.name == FRONT_PAGE {
        "Reference of a case"
    } else {
        &page.name
    }
}

fn text(pages: &[Page], page: &Page) -> String {
    let mut body = String::new();
    if page.name == FRONT_PAGE {
        let _ = write!(body, "<p>{}</p>\n<dl>\n", linked(pages, "", INTRODUCTION));
        for other in pages.iter().filter(|other| other.name != FRONT_PAGE) {
            let about = other.parameters.first().map_or("", |p| &p.meaning);
            let _ = writeln!(
                body,
                "<dt><a href=\"{0}.html\"><code>{0}</code></a></dt><dd>{1}</dd>",
                other.name,
                linked(pages, &other.name, about)
            );
        }
        body += "</dl>\n";
    }
    if let Some(example) = &page.example {
        let json = serde_json::to_string_pretty(&example.value).unwrap_or_default();
        let _ = write!(
            body,
            "<details><summary>{}</summary>\n<pre>{}</pre>\n</details>\n",
            example.case.map_or("Defaults".to_owned(), |case| format!(
                "Example: <code>solver example {case}</code>"
            )),
            escaped(&json)
        );
    }
    for parameter in &page.parameters {
        one(pages, parameter, &mut body);
    }
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} - solver</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<nav>\n{sidebar}</nav>\n\
         <main>\n<h1>{title}</h1>\n{body}</main>\n</body>\n</html>\n",
        title = escaped(title(page)),
        sidebar = sidebar(pages, page),
    )
}

/// Returns links to all pages and, below the present one, to its parameters.
fn sidebar(pages: &[Page], present: &Page) -> String {
    let mut out = String::from("<ul>\n");
    for page in pages {
        let here = page.name == present.name;
        let class = if here { " class=\"here\"" } else { "" };
        let _ = writeln!(
            out,
            "<li><a href=\"{}.html\"{class}>{}</a></li>",
            page.name,
            escaped(title(page))
        );
        if here {
            out += "<li><ul>\n";
            for parameter in &page.parameters {
                let depth = parameter.path.matches('.').count().min(5);
                let _ = writeln!(
                    out,
                    "<li class=\"d{depth}\"><a href=\"#{}\">{}</a></li>",
                    parameter.anchor(),
                    escaped(parameter.key())
                );
            }
            out += "</ul></li>\n";
        }
    }
    out + "</ul>\n"
}

fn one(pages: &[Page], parameter: &Parameter, out: &mut String) {
    let anchor = parameter.anchor();
    let _ = write!(
        out,
        "<section id=\"{anchor}\">\n<h2><a href=\"#{anchor}\"><code>{}</code></a></h2>\n<p>{}</p>\n",
        escaped(&parameter.path),
        linked(pages, &parameter.path, &parameter.meaning)
    );
    if !parameter.words.is_empty() {
        *out += "<dl>\n";
        for (word, about) in &parameter.words {
            let about = linked(pages, &parameter.path, about);
            let _ = writeln!(
                out,
                "<dt><code>\"{}\"</code></dt><dd>{about}</dd>",
                escaped(word)
            );
        }
        *out += "</dl>\n";
    }
    *out += "<table>\n";
    for (name, value) in facts(parameter) {
        let _ = writeln!(out, "<tr><th>{name}</th><td>{}</td></tr>", escaped(&value));
    }
    if let Some(example) = parameter.example_text() {
        let _ = writeln!(
            out,
            "<tr><th>Example</th><td><code>{}</code></td></tr>",
            escaped(&example)
        );
    }
    *out += "</table>\n</section>\n";
}

/// Returns a description in which the names of parameters are links.
fn linked(pages: &[Page], from: &str, text: &str) -> String {
    parts(text)
        .map(
            |(name, part)| match referenced_parameter(pages, from, part) {
                Some((page, hit)) if name => format!(
                    "<a href=\"{}.html#{}\"><code>{}</code></a>",
                    page.name,
                    hit.anchor(),
                    escaped(part)
                ),
                _ if name => format!("<code>{}</code>", escaped(part)),
                _ => escaped(part),
            },
        )
        .collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
