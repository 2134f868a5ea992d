//! HDF5, XDMF, series of outputs, atomic files and manifests: names and bytes, without physics or MPI calls.
//!
//! | task | module |
//! |---|---|
//! | ranks that write together, and their agreement | [`group`] |
//! | small files that appear complete or not at all | [`atomic`] |
//! | one HDF5 file, written by several ranks | [`hdf`] |
//! | output of a lattice | [`image`] |
//! | output of grains, contacts and blocks | [`mesh`] |
//! | the index from which ParaView reads the steps | [`series`] |
//! | checkpoints of the whole state, written and read | [`checkpoint`] |
//! | tables as text | [`csv`] |
//! | tables that users write: names, units, separators | [`sheet`] |
//! | polylines of drawings | [`dxf`] |
//! | numbers as functions of time | [`table`] |
//! | tables as recorded in a checkpoint, for restarts | [`marks`] |
//! | contents and columns of the HDF5 files of outputs, read by each rank separately | [`fields`] |
//! | reading files of unknown origin | [`plain`] |
//!
//! The crate guarantees:
//!
//! - **Complete files.** A file whose name does not end in `.part` is complete: it was written under
//!   another name, closed, flushed to the disk and renamed.
//! - **Agreement.** Every function with a [`Group`] returns the same `Ok` or the same error on every rank. No rank
//!   waits for one that has left.
//!
//! A checkpoint by one process without MPI, written and read back:
//!
//! ```
//! use io::{Alone, Array, Mode, Reader, checkpoint, newest};
//!
//! let folder = tempfile::tempdir()?;
//! let radii = [0.5, 0.25, 0.125];
//! let arrays = [Array {
//!     name: "grains_radius",
//!     shape: vec![3],
//!     start: vec![0],
//!     count: vec![3],
//!     data: radii.as_slice().into(),
//! }];
//! let attributes = serde_json::json!({ "case": "three grains" });
//! checkpoint::write(folder.path(), 100, 0.5, &arrays, &attributes, &Alone, Mode::Gather, 2)?;
//!
//! let reader = Reader::open(&newest(folder.path(), &Alone)?)?;
//! assert_eq!(reader.attributes()["case"], "three grains");
//! assert_eq!(reader.read_all::<f64>("grains_radius")?, radii);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod atomic;
pub mod checkpoint;
pub mod csv;
pub mod data;
pub mod dxf;
pub mod error;
pub mod fields;
pub mod group;
pub mod hdf;
pub mod image;
pub mod marks;
pub mod mesh;
mod moment;
pub mod plain;
pub mod series;
pub mod sheet;
pub mod table;
mod xdmf;

pub use checkpoint::{Array, Found, Reader, newest};
pub use data::{Column, Data, Element, FunctionSource, Kind, NumberSource, Numbers};
pub use error::{Error, Result};
pub use group::{Alone, Group};
pub use hdf::Mode;
pub use image::Image;
pub use mesh::{Cells, MeshData};
pub use moment::OutputTime;
pub use series::Series;
pub use table::CsvTable;
