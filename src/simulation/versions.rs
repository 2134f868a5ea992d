//! What the program was built from and runs on: for `--version`, `summary.json` and the provenance of files.

use crate::lbm::lanes::Level;
use decomposition::{Communicator, mpi_library};
use serde_json::{Value, json};

/// Profile, level of optimisation and target of the build.
const PROFILE: &str = env!("SOLVER_PROFILE");

/// A line for each library and property of this program; MPI need not run.
#[must_use]
pub fn report() -> String {
    [
        ("MPI", mpi_library()),
        ("HDF5", io::hdf::version()),
        ("features", io::hdf::features().join(", ")),
        (
            "lanes",
            format!("{} (vectors of this processor)", Level::best().name()),
        ),
        ("profile", PROFILE.to_owned()),
    ]
    .map(|(name, text)| format!("{name:<9} {text}"))
    .join("\n")
}

/// The same for files.
pub(super) fn versions(communicator: &Communicator) -> Value {
    json!({
        "solver": env!("CARGO_PKG_VERSION"),
        "commit": env!("SOLVER_COMMIT"),
        "lanes": Level::best().name(),
        "mpi": communicator.mpi_version(),
        "hdf5": io::hdf::version(),
        "profile": PROFILE,
    })
}
