//! Checks of arguments before a file is read, with a suggestion for each error.

use base::error::Error;
use case::check::nearest;
use std::ffi::OsStr;
use std::path::Path;

/// Maximum number of threads per rank; larger numbers are input errors, because no machine has as many cores for
/// one rank.
pub(super) const MAX_THREADS: u16 = 1024;

/// Checks that a first word that is not a command can be a case: an existing file, or a possible file name.
///
/// # Errors
/// If it is neither, [`Error::Usage`].
pub(super) fn command_or_file(word: &OsStr, commands: &[&str]) -> Result<(), Error> {
    let text = word.to_string_lossy();
    // For a path, the reader reports the error.
    if text.starts_with('-') || text.contains(['.', '/']) || Path::new(word).exists() {
        return Ok(());
    }
    let meant = match nearest(&text, commands) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`solver --help` lists the commands".into(),
    };
    Err(Error::Usage(format!(
        "there is no command or file `{text}`; {meant}"
    )))
}

/// Returns the number of cores available to this process.
pub(super) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Parses the number of threads of a rank.
pub(super) fn threads(text: &str) -> Result<u16, String> {
    match text.parse() {
        Ok(threads) if (1..=MAX_THREADS).contains(&threads) => Ok(threads),
        _ => Err(format!(
            "a rank can have 1 to {MAX_THREADS} threads, preferably no more than the {} core(s) that it may use \
             here",
            cores()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_that_is_nothing_is_refused_with_what_was_meant() {
        let commands = ["run", "restart", "validate"];
        let refused = |word: &str| command_or_file(word.as_ref(), &commands).unwrap_err();
        let error = refused("restrat");
        assert_eq!(error.exit_code(), 2);
        assert_eq!(
            error.to_string(),
            "there is no command or file `restrat`; did you mean `restart`?"
        );
        assert!(refused("frobnicate").to_string().contains("`frobnicate`"));
        for file in ["case.json", "a/b", "case.jsn", "--output", "."] {
            assert!(command_or_file(file.as_ref(), &commands).is_ok(), "{file}");
        }
    }

    #[test]
    fn threads_are_bounded() {
        assert_eq!(threads("1"), Ok(1));
        assert_eq!(threads("1024"), Ok(1024));
        for bad in ["0", "1025", "65535", "65536", "-1", "two"] {
            assert!(threads(bad).unwrap_err().contains("1 to 1024"), "{bad}");
        }
    }
}
