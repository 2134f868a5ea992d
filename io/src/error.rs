//! Errors of this crate: values that can be sent to the other ranks.
//!
//! HDF5 formats its errors lazily, from handles that are gone once MPI is shut down. They are therefore turned into
//! text where they arise.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Error of a file, with texts that can be sent to every rank.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Error {
    /// The operating system refused an operation.
    #[error("cannot {action} {path}: {reason}")]
    Io {
        /// Failed action, as a verb.
        action: String,
        /// File or folder.
        path: String,
        /// Message of the system.
        reason: String,
    },
    /// HDF5 refused to open or read a file.
    #[error("{path}: {reason}")]
    Hdf {
        /// Path of the file.
        path: String,
        /// Message of HDF5.
        reason: String,
    },
    /// A write failed halfway inside HDF5. The file is left open under its `.part` name: closing it could wait
    /// forever on the rank that failed, and HDF5 crashes at its shutdown with this file open. The caller reports
    /// the error and calls `MPI_Abort`.
    #[error("{path} is half written: {reason}")]
    Broken {
        /// Path of the file.
        path: String,
        /// Message of the first failing rank.
        reason: String,
    },
    /// There is not enough disk space; nothing was written.
    #[error("{path}: {needed} bytes needed, {free} bytes free")]
    Space {
        /// Number of bytes to write.
        needed: u64,
        /// Number of bytes available to this user.
        free: u64,
        /// Path of the folder.
        path: String,
    },
    /// The caller's arrays do not match.
    #[error("{what}: {reason}")]
    Invalid {
        /// Name of the array, or another name.
        what: String,
        /// Reason of the failure.
        reason: String,
    },
    /// An existing file differs from the written one.
    #[error("{path} is damaged: {reason}")]
    Corrupt {
        /// Path of the file.
        path: String,
        /// Description of the difference.
        reason: String,
    },
    /// A folder contains no checkpoint that can be verified.
    #[error("{path} holds no usable checkpoint{reason}")]
    NoCheckpoint {
        /// Path of the folder.
        path: String,
        /// Fault of each checkpoint; empty if there is none.
        reason: String,
    },
}

impl Error {
    /// Returns `true` if an ordinary exit could hang the other ranks or crash HDF5, so that `MPI_Abort` is
    /// necessary.
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

    /// Returns the error for a write that cannot be undone.
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

    /// Returns the error with the rank on which it arose.
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
