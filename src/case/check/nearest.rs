//! Search for the known name nearest to an unknown one, and the remedies that propose it.

use base::error::Remedy;
use std::borrow::Cow;

/// Returns a remedy that lists the available names.
pub(super) fn choose(names: &[&str]) -> String {
    format!("use one of: {}", names.join(", "))
}

/// Returns the remedy for an unknown name.
pub(super) fn nearest_remedy(name: &str, known: &[&str]) -> String {
    match nearest(name, known) {
        _ if known.is_empty() => "remove it: this object has no fields".into(),
        Some(close) => format!("did you mean `{close}`? Allowed here: {}", known.join(", ")),
        None => format!("remove it, or {}", choose(known)),
    }
}

/// Returns a remedy like [`nearest_remedy`] for a word of a choice; the word is proposed if it is valid without
/// parameters.
pub(super) fn nearest_word(path: &str, name: &str, known: &[&str], plain: &[&str]) -> Remedy {
    let remedy = Remedy::from(nearest_remedy(name, known));
    match nearest(name, known) {
        Some(close) if plain.contains(&close) => remedy.set(path, close),
        _ => remedy,
    }
}

/// Maximum length of a name in a case [bytes].
const LONGEST_NAME: usize = 200;

/// Returns a name shortened for a sentence.
pub(super) fn clipped(name: &str) -> Cow<'_, str> {
    if name.len() <= LONGEST_NAME {
        return name.into();
    }
    let begin: String = name.chars().take(60).collect();
    format!("{begin}...").into()
}

/// Returns the known name with the smallest edit distance, if it is close enough.
#[must_use]
pub fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    known
        .iter()
        .map(|candidate| (strsim::levenshtein(name, candidate), *candidate))
        .min()
        .filter(|(d, candidate)| *d <= candidate.len().max(name.len()) / 2)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_by_edit_distance() {
        assert_eq!(
            nearest("viscosty", &["density", "viscosity"]),
            Some("viscosity")
        );
        assert_eq!(nearest("qqqqqq", &["density", "viscosity"]), None);
        // Three of five letters differ, which is too many.
        assert_eq!(nearest("speed", &["head", "velocity"]), None);
    }
}
