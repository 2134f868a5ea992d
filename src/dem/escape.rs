//! A grain that left the box through an open face, as a text that can be parsed again.
//!
//! Ranks agree on errors as texts. The module that knows the case parses the text and adds a remedy.

use std::fmt;

/// Grain that left the domain, and the face through which it left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Escape {
    /// Id of the grain.
    pub grain: u64,
    /// Axis normal to the face: 0, 1 or 2.
    pub axis: usize,
    /// `true` for the face at the upper end of the axis.
    pub upper: bool,
}

const OUTSIDE: &str = " is more than one domain length outside the domain, beyond ";
const AXES: [&str; 3] = ["x", "y", "z"];
const ENDS: [(&str, bool); 2] = [("min", false), ("max", true)];

impl fmt::Display for Escape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = AXES.get(self.axis).unwrap_or(&"?");
        let end = if self.upper { "max" } else { "min" };
        write!(f, "grain {}{OUTSIDE}{axis}_{end}", self.grain)
    }
}

impl Escape {
    /// Returns the escape that a message reports, if any.
    #[must_use]
    pub fn in_text(text: &str) -> Option<Self> {
        let (before, after) = text.split_once(OUTSIDE)?;
        let grain = before.rsplit(' ').next()?.parse().ok()?;
        let axis = AXES.iter().position(|axis| after.starts_with(axis))?;
        let end = after.get(2..5)?;
        let upper = ENDS.iter().find(|(name, _)| *name == end)?.1;
        Some(Self { grain, axis, upper })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_escape_is_read_back_from_its_sentence() {
        for axis in 0..3 {
            for upper in [false, true] {
                let escape = Escape {
                    grain: 17,
                    axis,
                    upper,
                };
                let text = format!("rank 1: numerical failure: {escape}: position (1, 2) m");
                assert_eq!(Escape::in_text(&text), Some(escape), "{text}");
            }
        }
        assert_eq!(Escape::in_text("grain 3 is lost: position"), None);
    }
}
