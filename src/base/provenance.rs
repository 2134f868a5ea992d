//! Version, commit and profile of the build, for `--version`, summaries and checkpoints.
//!
//! The entry point declares commit and profile, so that a commit does not rebuild the library. Without a declaration
//! (tests of the library) they are `unknown`.

use std::sync::OnceLock;

/// Version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

static BUILD: OnceLock<[&str; 2]> = OnceLock::new();

/// Declares commit and profile of the build. Only the first declaration counts.
pub fn declare(commit: &'static str, profile: &'static str) {
    let _ = BUILD.set([commit, profile]);
}

/// Returns `git describe` of the sources, with `-dirty` if they were changed.
#[must_use]
pub fn commit() -> &'static str {
    BUILD.get().map_or("unknown", |[commit, _]| commit)
}

/// Returns the profile, level of optimisation and target of the build.
#[must_use]
pub fn profile() -> &'static str {
    BUILD.get().map_or("unknown", |[_, profile]| profile)
}
