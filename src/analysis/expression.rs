//! Arithmetic expressions of `study.json` and `expected.json`: `8*y*(1e-3 - y)/(2*rho*nu)`.
//!
//! An expression contains numbers, names, `+ - * / ^`, brackets and the functions below. `^` is right-associative and
//! binds more strongly than a sign. Angles are in radians. A condition is a number: `x > 1` is 1 or 0. A name may be a
//! path of a case: `bodies[0].shape.disc.radius`. An expression has at most 10,000 bytes; brackets, signs and powers
//! nest at most 100 deep.

/// Maximum length of a formula in bytes.
pub const LONGEST: usize = 10_000;
/// Maximum nesting of brackets, signs and powers.
pub const DEEPEST: usize = 100;

/// Reason why an expression cannot be evaluated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{excerpt}: {fault}")]
pub struct ExpressionError {
    /// Beginning of the expression, in quotes.
    pub excerpt: String,
    /// Fault of the expression.
    pub fault: ExpressionFault,
}

/// Fault of an expression. Texts are excerpts in quotes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExpressionFault {
    /// Too many bytes.
    #[error("the formula has {0} bytes; at most {LONGEST} are allowed")]
    Long(usize),
    /// Nesting that is too deep, before this text.
    #[error("brackets, signs and powers nest more than {DEEPEST} deep before {0}")]
    Deep(String),
    /// Bracket that is not closed before this text.
    #[error("a bracket is not closed before {0}")]
    OpenBracket(String),
    /// Number or name that is missing before this text.
    #[error("a number or a name is missing before {0}")]
    Missing(String),
    /// Text that is not a number.
    #[error("{0} is not a number")]
    NotANumber(String),
    /// Name without a value.
    #[error("there is no value with the name {0}")]
    NoValue(String),
    /// Name of a function that does not exist with these arguments.
    #[error("there is no function {0} with these arguments")]
    NoFunction(String),
    /// Text after the end of the expression.
    #[error("unexpected {0}")]
    Unexpected(String),
}

/// Value of a part of an expression.
type Parsed = Result<f64, ExpressionFault>;

/// Returns the value of an expression; `lookup` gives the values of names.
///
/// # Errors
/// If the expression cannot be evaluated; the message contains the expression.
pub fn evaluate(text: &str, lookup: &dyn Fn(&str) -> Option<f64>) -> Result<f64, ExpressionError> {
    let error = |fault: ExpressionFault| ExpressionError {
        excerpt: excerpt(text),
        fault,
    };
    if text.len() > LONGEST {
        return Err(error(ExpressionFault::Long(text.len())));
    }
    let mut reader = Reader {
        remaining: text.trim_start(),
        lookup,
        depth: 0,
    };
    let value = reader.comparison().map_err(error)?;
    if reader.remaining.is_empty() {
        Ok(value)
    } else {
        Err(error(ExpressionFault::Unexpected(excerpt(
            reader.remaining,
        ))))
    }
}

/// Returns the beginning of a formula, in quotes.
#[must_use]
pub fn excerpt(text: &str) -> String {
    if text.len() <= 200 {
        return format!("{text:?}");
    }
    format!("{:?}...", text.chars().take(60).collect::<String>())
}

struct Reader<'a> {
    remaining: &'a str,
    lookup: &'a dyn Fn(&str) -> Option<f64>,
    /// Number of signs, powers and brackets that enclose the current position.
    depth: usize,
}

impl Reader<'_> {
    fn skip_symbol(&mut self, symbol: char) -> bool {
        let Some(remaining) = self.remaining.strip_prefix(symbol) else {
            return false;
        };
        self.remaining = remaining.trim_start();
        true
    }

    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        if self.skip_symbol('>') {
            return Ok(f64::from(u8::from(left > self.sum()?)));
        }
        if self.skip_symbol('<') {
            return Ok(f64::from(u8::from(left < self.sum()?)));
        }
        Ok(left)
    }

    fn sum(&mut self) -> Parsed {
        let mut value = self.product()?;
        loop {
            if self.skip_symbol('+') {
                value += self.product()?;
            } else if self.skip_symbol('-') {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Parsed {
        let mut value = self.signed()?;
        loop {
            if self.skip_symbol('*') {
                value *= self.signed()?;
            } else if self.skip_symbol('/') {
                value /= self.signed()?;
            } else {
                return Ok(value);
            }
        }
    }

    /// Parses a number with its sign. Every recursion of the parser passes through this function.
    fn signed(&mut self) -> Parsed {
        if self.depth > DEEPEST {
            return Err(ExpressionFault::Deep(excerpt(self.remaining)));
        }
        self.depth += 1;
        let value = self.unbounded();
        self.depth -= 1;
        value
    }

    fn unbounded(&mut self) -> Parsed {
        if self.skip_symbol('-') {
            return Ok(-self.signed()?);
        }
        let base = self.atom()?;
        if self.skip_symbol('^') {
            return Ok(base.powf(self.signed()?));
        }
        Ok(base)
    }

    fn atom(&mut self) -> Parsed {
        if self.skip_symbol('(') {
            let value = self.comparison()?;
            return if self.skip_symbol(')') {
                Ok(value)
            } else {
                Err(ExpressionFault::OpenBracket(excerpt(self.remaining)))
            };
        }
        let length = self.word_length();
        if length == 0 {
            return Err(ExpressionFault::Missing(excerpt(self.remaining)));
        }
        let (word, remaining) = self.remaining.split_at(length);
        self.remaining = remaining.trim_start();
        if word.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return word
                .parse()
                .map_err(|_| ExpressionFault::NotANumber(excerpt(word)));
        }
        if self.skip_symbol('(') {
            let argument = self.comparison()?;
            let mut second = None;
            if self.skip_symbol(',') {
                second = Some(self.comparison()?);
            }
            if !self.skip_symbol(')') {
                return Err(ExpressionFault::OpenBracket(excerpt(self.remaining)));
            }
            return function(word, argument, second);
        }
        match word {
            "pi" => Ok(std::f64::consts::PI),
            _ => (self.lookup)(word).ok_or_else(|| ExpressionFault::NoValue(excerpt(word))),
        }
    }

    /// Returns the bytes of the number or name at the front; an exponent may have a sign.
    fn word_length(&self) -> usize {
        let bytes = self.remaining.as_bytes();
        let number = bytes
            .first()
            .is_some_and(|b| b.is_ascii_digit() || *b == b'.');
        let mut length = 0;
        while let Some(&byte) = bytes.get(length) {
            let exponent = number
                && matches!(byte, b'+' | b'-')
                && matches!(bytes.get(length.wrapping_sub(1)), Some(b'e' | b'E'));
            let index = !number && matches!(byte, b'[' | b']');
            if !(byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_') || exponent || index) {
                break;
            }
            length += 1;
        }
        length
    }
}

fn function(name: &str, x: f64, second: Option<f64>) -> Parsed {
    Ok(match (name, second) {
        ("sin", None) => x.sin(),
        ("cos", None) => x.cos(),
        ("tan", None) => x.tan(),
        ("asin", None) => x.asin(),
        ("acos", None) => x.acos(),
        ("exp", None) => x.exp(),
        ("ln", None) => x.ln(),
        ("sqrt", None) => x.sqrt(),
        ("abs", None) => x.abs(),
        ("atan2", Some(y)) => x.atan2(y),
        ("min", Some(y)) => x.min(y),
        ("max", Some(y)) => x.max(y),
        _ => {
            return Err(ExpressionFault::NoFunction(format!("{name:?}")));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_are_read_as_written() {
        let value = |text: &str| {
            evaluate(text, &|name| {
                matches!(name, "x_1" | "bodies[0].radius").then_some(3.0)
            })
        };
        for (text, expected) in [
            ("1 + 2*3 - 4/2", 5.0),
            ("-2^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("(1e-3 + 2.5E+1)*0 + x_1", 3.0),
            ("2*bodies[0].radius", 6.0),
            ("sqrt(x_1*12) - abs(-6)", 0.0),
            ("atan2(1, 1)*4 - pi", 0.0),
            ("(x_1 > 2) + (x_1 < 2)", 1.0),
        ] {
            approx::assert_abs_diff_eq!(value(text).unwrap(), expected, epsilon = 1e-12);
        }
        for bad in [
            "",
            "1 +",
            "(1",
            "y",
            "1 2",
            "sin(1, 2)",
            "min(1)",
            "1e",
            "3..2",
            "[0]",
        ] {
            assert!(value(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn long_and_deep_formulas_are_refused_with_a_sentence() {
        let value = |text: &str| evaluate(text, &|_| Some(1.0));
        let nested = |n: usize| format!("{}1{}", "(".repeat(n), ")".repeat(n));
        assert_eq!(value(&nested(100)), Ok(1.0));
        assert_eq!(value(&format!("1{}", " + 1".repeat(2000))), Ok(2001.0));
        for (bad, says) in [
            (nested(101), "nest more than 100 deep"),
            (nested(40_000), "the formula has 80001 bytes"),
            (format!("{}1", "-".repeat(5000)), "nest more than 100 deep"),
            (format!("1{}", "^1".repeat(4000)), "nest more than 100 deep"),
            (format!("{}1", "sqrt(".repeat(1500)), "nest more than"),
            ("-".repeat(100_000), "the formula has 100000 bytes"),
        ] {
            let error = value(&bad).unwrap_err().to_string();
            assert!(error.contains(says) && error.len() < 300, "{error}");
        }
    }
}
