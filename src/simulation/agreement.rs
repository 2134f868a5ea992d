//! Errors that keep their kind when they are shared with all ranks.

use base::error::Error;
use decomposition::Communicator;

/// Does work on the first rank and returns its outcome on all ranks: the value on the first rank and
/// `T::default()` on the others, or an error of the same kind and text on all. Collective.
///
/// # Errors
/// If the work fails; the error is returned on every rank.
pub fn on_first<T: Default>(
    communicator: &Communicator,
    work: impl FnOnce() -> Result<T, Error>,
) -> Result<T, Error> {
    let mine = if communicator.rank() == 0 {
        work()
    } else {
        Ok(T::default())
    };
    agree(communicator, mine)
}

/// Returns a common outcome on all ranks: each rank's own value if no rank failed; otherwise its own
/// error, or that of the lowest rank that failed. Collective.
///
/// # Errors
/// If any rank failed.
pub(super) fn agree<T>(communicator: &Communicator, mine: Result<T, Error>) -> Result<T, Error> {
    let text = match &mine {
        Ok(_) => Ok(()),
        Err(error) => Err(encode(error)),
    };
    match communicator.agree(text) {
        Ok(()) => mine,
        Err(disagreement) => match mine {
            Err(own) => Err(own),
            Ok(_) => Err(decode(&disagreement.message)),
        },
    }
}

fn encode(error: &Error) -> String {
    let words = match error {
        Error::Case(problems) => {
            let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
            lines.join("\n")
        }
        Error::Usage(text)
        | Error::Numerical(text)
        | Error::Io(text)
        | Error::Internal(text)
        | Error::Stopped(text) => text.clone(),
    };
    format!("{} {words}", error.exit_code())
}

fn decode(message: &str) -> Error {
    let (code, words) = message.split_once(' ').unwrap_or(("", message));
    let words = words.to_owned();
    match code {
        "2" => Error::Usage(words),
        // The rank that found the problems lists them.
        "3" => Error::Case(Vec::new()),
        "4" => Error::Numerical(words),
        "5" => Error::Io(words),
        "75" => Error::Stopped(words),
        _ => Error::Internal(words),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_keep_kind_and_words_on_their_way() {
        let text = || "a b\nc".to_owned();
        for error in [
            Error::Usage(text()),
            Error::Numerical(text()),
            Error::Io(text()),
            Error::Internal(text()),
            Error::Stopped(text()),
        ] {
            let back = decode(&encode(&error));
            assert_eq!(back.to_string(), error.to_string());
            assert_eq!(back.exit_code(), error.exit_code());
        }
        let back = decode(&encode(&Error::Case(Vec::new())));
        assert_eq!(back.exit_code(), 3);
    }
}
