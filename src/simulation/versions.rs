//! Versions of the program, its libraries and the processor, for `--version`, `summary.json` and the provenance of
//! files.

use base::provenance;
use decomposition::{Communicator, mpi_library};
use lbm::lanes::Level;
use serde_json::{Value, json};

/// Returns a line for each library and property of this program. Does not need MPI.
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
        ("profile", provenance::profile().to_owned()),
    ]
    .map(|(name, text)| format!("{name:<9} {text}"))
    .join("\n")
}

/// Returns the versions of program and libraries, for files.
pub(super) fn versions(communicator: &Communicator) -> Value {
    json!({
        "solver": provenance::VERSION,
        "commit": provenance::commit(),
        "lanes": Level::best().name(),
        "mpi": communicator.mpi_version(),
        "hdf5": io::hdf::version(),
        "profile": provenance::profile(),
    })
}
