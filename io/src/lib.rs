//! HDF5, XDMF, series, atomic files and manifests: names and bytes, no physics, no MPI calls.
//!
//! | question | file |
//! |---|---|
//! | who writes together, and how do they agree? | [`group`] |
//! | how does a small file appear whole or not at all? | [`atomic`] |
//! | how do many ranks fill one HDF5 file? | [`hdf`] |
//! | how is a lattice written? | [`image`] |
//! | how are grains, contacts and blocks written? | [`mesh`] |
//! | how does ParaView find the steps? | [`series`] |
//! | how is the whole state kept and found again? | [`checkpoint`] |
//! | how is a table read and written as text? | [`csv`] |
//! | how are numbers over time kept? | [`table`] |
//! | how does a restart know its tables again? | [`marks`] |
//! | how are files read back? | [`fields`] |
//! | how is a file read that others wrote? | [`plain`] |
//!
//! Two promises hold everywhere. A file whose name does not end in `.part` is complete: it was written under
//! another name, closed, flushed to the disk and renamed. And every function that takes a [`Group`] returns the same
//! `Ok` or the same error on every rank, so that no rank waits for one that has left.

#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::print_stdout,
        clippy::print_stderr,
        reason = "a test fails by panicking and prints what it measures"
    )
)]

pub mod atomic;
pub mod checkpoint;
pub mod csv;
pub mod data;
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
pub mod table;
mod xdmf;

pub use checkpoint::{Array, Found, Reader, newest};
pub use data::{Column, Data, Element, Kind};
pub use error::{Error, Result};
pub use group::{Alone, Group};
pub use hdf::Mode;
pub use image::Image;
pub use mesh::{Cells, Mesh};
pub use moment::Moment;
pub use series::Series;
pub use table::Table;
