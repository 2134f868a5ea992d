//! Printable texts: without control characters, and with numbers of four significant digits.

use std::borrow::Cow;

/// Returns `true` if a character controls a terminal: C0, DEL and C1, including line breaks and tabs.
#[must_use]
pub fn controls(c: char) -> bool {
    c.is_control()
}

/// Returns a text of unknown origin as one line; control characters are escaped as in JSON: `\u001b`.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// Escapes a text like [`printable`], but keeps line breaks and tabs, for texts of several lines composed by the
/// program.
#[must_use]
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t'))
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.chars().any(|c| controls(c) && !stays(c)) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if controls(c) && !stays(c) {
            safe.push_str(&format!("\\u{:04x}", u32::from(c)));
        } else {
            safe.push(c);
        }
    }
    Cow::Owned(safe)
}

/// Returns a number as text with four significant digits.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = [1e3, 1e2, 1e1, 1e0, 1e-1, 1e-2]
        .iter()
        .filter(|bound| size < **bound)
        .count();
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// Returns the largest number of four significant digits that is not above a value.
#[must_use]
pub fn at_most(value: f64) -> f64 {
    four_digits(value, f64::floor).unwrap_or(value)
}

/// Returns the smallest number of four significant digits that is not below a value.
#[must_use]
pub fn at_least(value: f64) -> f64 {
    four_digits(value, f64::ceil).unwrap_or(value)
}

fn four_digits(value: f64, whole: fn(f64) -> f64) -> Option<f64> {
    let text = format!("{:e}", value);
    let (digits, exponent) = text.split_once('e')?;
    let digits = whole(digits.parse::<f64>().ok()? * 1e3);
    format!("{digits}e{}", exponent.parse::<i32>().ok()? - 3)
        .parse()
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_not_obeyed() {
        assert_eq!(
            printable("a\u{1b}[2Jb\nc\u{7f}\u{9b}"),
            r"a\u001b[2Jb\u000ac\u007f\u009b"
        );
        assert_eq!(printable_lines("a\n\tb\r"), "a\n\tb\\u000d");
        assert!(matches!(printable("Größe 3 µm"), Cow::Borrowed(_)));
    }

    #[test]
    fn numbers_keep_four_digits() {
        let pairs = [
            (0.0, "0"),
            (0.00125, "0.00125"),
            (0.25, "0.25"),
            (1.0 / 3.0, "0.3333"),
            (-12.3456, "-12.35"),
            (2500.0, "2500"),
            (1e-5, "1.000e-5"),
            (3.0e7, "3.000e7"),
        ];
        for (value, text) in pairs {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn bounds_are_rounded_to_the_side_that_holds() {
        for value in [0.123_456, 9.999_96, 1e-7 / 3.0, 123_456.7, 2.5, 1e-300] {
            let (low, high) = (at_most(value), at_least(value));
            assert!(low <= value && value <= high, "{low} {value} {high}");
            assert!(high - low <= 1.1e-3 * value);
        }
        assert_eq!((at_most(0.123_456), at_least(0.123_456)), (0.1234, 0.1235));
        assert_eq!((at_most(2.5), at_least(2.5)), (2.5, 2.5));
    }
}
