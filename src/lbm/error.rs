//! Reasons why a fluid cannot be made or continued.

use base::error::Error;
use cudarc::driver::DriverError;
use decomposition::Disagreement;
use std::io;

/// Reason why a fluid cannot be made or continued.
#[derive(Debug, thiserror::Error)]
pub enum FluidError {
    /// Memory that the operating system does not give.
    #[error("the memory for a lattice of {bytes} bytes is not available: {error}")]
    Memory {
        /// Number of bytes.
        bytes: usize,
        /// Reason.
        error: io::Error,
    },
    /// Slab with more numbers than an index can count, by its cells along each axis.
    #[error("a slab of {0:?} cells needs more than 2^32 numbers; use more ranks")]
    TooLarge([usize; 3]),
    /// Slabs of two neighbours that do not fit each other.
    #[error(transparent)]
    Slabs(#[from] Disagreement),
    /// Collision in f32 that the fluid does not have.
    #[error("this fluid has no collision in f32")]
    NoSingle,
    /// Free surface that cannot be made.
    #[error("{0}")]
    Surface(String),
    /// Machine without the driver of a GPU.
    #[error("there is no CUDA driver (libcuda.so.1) on this machine")]
    NoDriver,
    /// Feature that a GPU does not run.
    #[error("a GPU does not run {0} yet")]
    NotOnGpu(String),
    /// Lattice that does not fit the memory of a GPU.
    #[error("the lattice needs {needed:.1} GB and {name} has {free:.1} GB free")]
    GpuMemory {
        /// Name of the GPU.
        name: String,
        /// Memory that the lattice needs \[GB\].
        needed: f64,
        /// Free memory \[GB\].
        free: f64,
    },
    /// Error that a GPU reports.
    #[error("the GPU reports: {0}")]
    Gpu(#[from] DriverError),
}

impl From<FluidError> for Error {
    fn from(error: FluidError) -> Self {
        Self::Internal(error.to_string())
    }
}
