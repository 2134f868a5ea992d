//! Errors of this crate: values that can be sent to the other ranks.
//!
//! HDF5 formats its errors lazily, from handles that are gone once MPI is shut down. They are therefore turned into
//! text where they arise.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Error of a file, in words that can be sent to every rank.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("cannot {action} {path}: {reason}")]
    Io {
        /// Action that failed, as a verb.
        action: String,
        /// The file or folder.
        path: String,
        /// The system's words.
        reason: String,
    },
    /// HDF5 refused to open or read a file.
    #[error("{path}: {reason}")]
    Hdf {
        /// The file.
        path: String,
        /// HDF5's words.
        reason: String,
    },
    /// A write failed halfway inside HDF5. The file is left open under its `.part` name: closing it could wait for ever
    /// on the rank that failed, and shutting HDF5 down over it crashes. The caller reports this and calls `MPI_Abort`.
    #[error("{path} is half written: {reason}")]
    Broken {
        /// The file.
        path: String,
        /// The first failing rank's words.
        reason: String,
    },
    /// The disk is too small for what is to be written; nothing was written.
    #[error("{path}: {needed} bytes needed, {free} bytes free")]
    Space {
        /// Bytes to be written.
        needed: u64,
        /// Bytes free for this user.
        free: u64,
        /// The folder.
        path: String,
    },
    /// The caller's arrays do not fit together.
    #[error("{what}: {reason}")]
    Invalid {
        /// The array or name.
        what: String,
        /// Reason of the failure.
        reason: String,
    },
    /// A file is there but is not what was written.
    #[error("{path} is damaged: {reason}")]
    Corrupt {
        /// The file.
        path: String,
        /// Reason why it does not fit.
        reason: String,
    },
    /// A folder holds no checkpoint that verifies.
    #[error("{path} holds no usable checkpoint{reason}")]
    NoCheckpoint {
        /// The folder.
        path: String,
        /// Faults of each one, or empty.
        reason: String,
    },
}

impl Error {
    /// Returns `true` if leaving quietly could hang the other ranks or crash HDF5: call `MPI_Abort`.
    #[must_use]
    pub fn must_abort(&self) -> bool {
        matches!(self, Self::Broken { .. })
    }

    pub(crate) fn io(action: &str, path: &Path, error: &std::io::Error) -> Self {
        Self::Io {
            action: action.to_owned(),
            path: path.display().to_string(),
            reason: error.to_string(),
        }
    }

    pub(crate) fn hdf(path: &Path, action: &str, error: &hdf5::Error) -> Self {
        Self::Hdf {
            path: path.display().to_string(),
            reason: {
                let reason = error.to_string();
                let advice = if reason.contains("lock file") {
                    "; if the file system has no locks, set HDF5_USE_FILE_LOCKING=FALSE"
                } else {
                    ""
                };
                format!("cannot {action}: {reason}{advice}")
            },
        }
    }

    pub(crate) fn invalid(what: &str, reason: impl Into<String>) -> Self {
        Self::Invalid {
            what: what.to_owned(),
            reason: reason.into(),
        }
    }

    pub(crate) fn corrupt(path: &Path, reason: impl Into<String>) -> Self {
        Self::Corrupt {
            path: path.display().to_string(),
            reason: reason.into(),
        }
    }

    /// Returns the error as part of a write that cannot be undone.
    pub(crate) fn broken(self, path: &Path) -> Self {
        let reason = match self {
            Self::Io { action, reason, .. } => format!("cannot {action} it: {reason}"),
            Self::Hdf { reason, .. } | Self::Broken { reason, .. } => reason,
            other => other.to_string(),
        };
        Self::Broken {
            path: path.display().to_string(),
            reason,
        }
    }

    /// Returns the error with the rank that it arose on.
    pub(crate) fn on_rank(mut self, rank: usize) -> Self {
        match &mut self {
            Self::Io { reason, .. }
            | Self::Hdf { reason, .. }
            | Self::Broken { reason, .. }
            | Self::Invalid { reason, .. }
            | Self::Corrupt { reason, .. } => *reason = format!("{reason} (rank {rank})"),
            Self::Space { .. } | Self::NoCheckpoint { .. } => {}
        }
        self
    }
}
