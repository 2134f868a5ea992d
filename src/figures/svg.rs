//! The writer of SVG for plots and pictures. It escapes every text.
//!
//! Labels of plots may contain `_{sub}` and `^{super}` ([`Svg::label`]). Programs that convert SVG lose shifts within a
//! text, or the anchor of the text. Scripts are therefore characters of Unicode where each has one. Others, as the
//! subscripts b, c and d, are texts of their own, whose places depend on the widths of the letters between them: a
//! label should have one of these.

use base::number::real;
use std::fmt::{Arguments, Display, Write as _};

/// Position \[pixels\], x to the right and y down.
pub(crate) type Point = [f64; 2];

/// SVG that is being written.
#[derive(Default)]
pub(crate) struct Svg {
    text: String,
}

impl Svg {
    /// Begins a file of a size with a white ground; `attributes` hold for all elements.
    pub(crate) fn file([width, height]: [impl Display; 2], attributes: &str) -> Self {
        let mut svg = Self::default();
        svg.put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" {attributes}>\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>"
        ));
        svg
    }

    /// Returns the text of a file begun by [`Self::file`].
    pub(crate) fn end(mut self) -> String {
        self.put(format_args!("</svg>"));
        self.text
    }

    /// Returns the elements written.
    pub(crate) fn elements(self) -> String {
        self.text
    }

    /// Writes an element.
    pub(crate) fn put(&mut self, element: Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{element}");
    }

    /// Writes elements that are already SVG.
    pub(crate) fn add(&mut self, elements: &str) {
        self.text.push_str(elements);
    }

    /// Writes a path as a line; nothing if it is empty.
    pub(crate) fn line(&mut self, path: &str, colour: &str, width: f64, more: &str) {
        if !path.is_empty() {
            self.put(format_args!(
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{more}/>"
            ));
        }
    }

    /// Writes a text without scripts: see [`text_element`].
    pub(crate) fn words(&mut self, place: [impl Display; 2], more: &str, words: &str) {
        self.put(format_args!("{}", text_element(place, more, words)));
    }

    /// Writes a text that may have scripts.
    pub(crate) fn label(&mut self, label: Label<'_>) {
        let parts = parts(label.text);
        let width = |part: &Part| label.size * part.width();
        let length: f64 = parts.iter().map(width).sum();
        let mut along = match label.anchor {
            "middle" => -0.5 * length,
            "end" => -length,
            _ => 0.0,
        };
        for (n, part) in parts.iter().enumerate() {
            // Programs drop spaces at the beginning of a text.
            let words = part.text.trim_start();
            along += SPACE * label.size * real(part.text.len() - words.len());
            // The first of several parts ends where the second begins, whatever the widths of its letters are.
            let (offset, anchor) = match n {
                0 if parts.len() == 1 => (0.0, label.anchor),
                0 => (along + width(part), "end"),
                _ => (along, "start"),
            };
            along += width(part);
            let ([x, y], down) = (label.place, part.down * label.size);
            let place = if label.upwards {
                [x + down, y - offset]
            } else {
                [x + offset, y + down]
            };
            let [x, y] = place.map(|at| format!("{at:.2}"));
            let size = part.size * label.size;
            let mut more = format!(" font-size=\"{size:.1}\" text-anchor=\"{anchor}\"");
            if label.bold {
                more += " font-weight=\"bold\"";
            }
            if label.upwards {
                more += &format!(" transform=\"rotate(-90 {x} {y})\"");
            }
            self.words([x, y], &more, words);
        }
    }
}

/// Text that may have scripts.
#[derive(Clone, Copy)]
pub(crate) struct Label<'a> {
    pub(crate) text: &'a str,
    pub(crate) place: Point,
    /// Part of the text at its place: start, middle or end.
    pub(crate) anchor: &'static str,
    /// Size of the font in pixels.
    pub(crate) size: f64,
    pub(crate) bold: bool,
    /// `true` if the text runs upwards.
    pub(crate) upwards: bool,
}

/// Part of a label; lengths are relative to the size of its font.
struct Part {
    text: String,
    size: f64,
    down: f64,
}

impl Part {
    fn new(text: &str) -> Self {
        Self {
            text: text.to_owned(),
            size: 1.0,
            down: 0.0,
        }
    }

    fn width(&self) -> f64 {
        WIDTH * self.size * real(self.text.trim_start().chars().count())
    }
}

/// Mean width of a letter relative to the size of its font.
const WIDTH: f64 = 0.57;
/// Width of a space relative to the size of its font.
const SPACE: f64 = 0.32;
const SUBSCRIPTS: [&str; 2] = [
    "0123456789+-=()aehijklmnoprstuvx",
    "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ",
];
const SUPERSCRIPTS: [&str; 2] = ["0123456789+-=()ni\u{2212}", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱ⁻"];

/// Returns the parts of a label. Scripts that Unicode has belong to the text around them; an open bracket is text.
fn parts(label: &str) -> Vec<Part> {
    let (mut parts, mut text, mut rest) = (Vec::new(), String::new(), label);
    while let Some(at) = rest.find("_{").into_iter().chain(rest.find("^{")).min() {
        let (before, script) = rest.split_at(at);
        let Some(end) = script.find('}') else { break };
        let ([from, to], down) = if script.starts_with('_') {
            (SUBSCRIPTS, 0.27)
        } else {
            (SUPERSCRIPTS, -0.38)
        };
        let one = |c| from.chars().zip(to.chars()).find(|(f, _)| *f == c);
        let inner = &script[2..end];
        let characters = inner.chars().map(|c| Some(one(c)?.1));
        text += before;
        if let Some(characters) = characters.collect::<Option<String>>() {
            text += &characters;
        } else {
            parts.push(Part::new(&std::mem::take(&mut text)));
            parts.push(Part {
                size: 0.77,
                down,
                ..Part::new(inner)
            });
        }
        rest = &script[end + 1..];
    }
    text += rest;
    if !text.is_empty() || parts.is_empty() {
        parts.push(Part::new(&text));
    }
    parts
}

/// Returns the width of a label relative to the size of its font, approximately.
pub(crate) fn width_of(label: &str) -> f64 {
    parts(label).iter().map(Part::width).sum()
}

/// Returns a text without scripts; `more` has further attributes, each with a space before it.
pub(crate) fn text_element([x, y]: [impl Display; 2], more: &str, words: &str) -> String {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    format!("<text x=\"{x}\" y=\"{y}\"{more}>{words}</text>")
}

/// Adds a straight line to a path.
pub(crate) fn add_segment(path: &mut String, [[x, y], [u, v]]: [Point; 2]) {
    // Writing to a string cannot fail.
    let _ = write!(path, "M{x:.1} {y:.1}L{u:.1} {v:.1}");
}

/// Returns points as an attribute of a polygon or a polyline.
pub(crate) fn points(points: impl Iterator<Item = Point>) -> String {
    let points = points.map(|[x, y]| format!("{x:.1},{y:.1}"));
    points.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the texts that a label becomes, with their attributes.
    fn texts(text: &str, anchor: &'static str, upwards: bool) -> Vec<String> {
        let mut svg = Svg::default();
        svg.label(Label {
            text,
            place: [50.0, 60.0],
            anchor,
            size: 10.0,
            bold: false,
            upwards,
        });
        svg.elements().lines().map(str::to_owned).collect()
    }

    fn number(text: &str, name: &str) -> f64 {
        let begin = text.split(&format!(" {name}=\"")).nth(1).unwrap();
        begin.split('"').next().unwrap().parse().unwrap()
    }

    #[test]
    fn scripts_are_characters_where_unicode_has_them() {
        let one = |text: &str| {
            let texts = texts(text, "middle", false);
            assert_eq!(texts.len(), 1, "{texts:?}");
            assert!(
                texts[0].starts_with("<text x=\"50.00\" y=\"60.00\""),
                "{texts:?}"
            );
            let begin = texts[0].find('>').unwrap() + 1;
            texts[0][begin..].replace("</text>", "")
        };
        assert_eq!(one("τ_{h} (10^{\u{2212}3} Pa)"), "τₕ (10⁻³ Pa)");
        assert_eq!(
            one("M_{e} / M_{0} < m^{3} & open_{"),
            "Mₑ / M₀ &lt; m³ &amp; open_{"
        );
        assert_eq!(one(""), "");
    }

    #[test]
    fn a_script_that_unicode_lacks_is_a_text_of_its_own_without_shifts_within_it() {
        for (anchor, upwards) in [("start", false), ("middle", true), ("end", false)] {
            let texts = texts("k_{d} (s/m)", anchor, upwards);
            assert_eq!(texts.len(), 3, "{texts:?}");
            assert!(!texts.concat().contains("tspan") && !texts.concat().contains("dy="));
            assert!(
                texts[0].contains("\"end\"") && texts[0].contains(">k<"),
                "{texts:?}"
            );
            assert!(texts[2].contains(">(s/m)<"), "{texts:?}");
            assert!(
                texts[1].contains("\"start\"") && texts[1].contains(">d<"),
                "{texts:?}"
            );
            let [x, y] =
                ["x", "y"].map(|name| texts.iter().map(|t| number(t, name)).collect::<Vec<_>>());
            // The first ends where the second begins; the script is lower, or to the right of a text that runs upwards.
            let (along, down) = if upwards {
                (y.iter().map(|y| -y).collect(), x)
            } else {
                (x, y)
            };
            let along: Vec<f64> = along;
            assert!(
                (along[0] - along[1]).abs() < 1e-9 && along[2] > along[1],
                "{texts:?}"
            );
            assert!(
                down[1] > down[0] && (down[2] - down[0]).abs() < 1e-9,
                "{texts:?}"
            );
            assert!(number(&texts[1], "font-size") < number(&texts[0], "font-size"));
        }
    }
}
