#![doc = include_str!("ARCHITECTURE.md")]

pub use base::{
    allocator, environment, error, family, geometry, number, provenance, random, thread_pool, units,
};
pub use output::checkpoint;
pub use plan::scene;
pub use studies::{critical_gradient, section, sweep, threshold, uncertainty};
pub use {
    ::analysis, ::case, ::cli, ::coupling, ::darcy, ::dem, ::figures, ::joints, ::lbm, ::output,
    ::plan, ::preparation, ::simulation, ::structure,
};
