//! Water in the joints between blocks of rock: a network of thin water layers with their own pressures.
//!
//! A joint is the space between two faces that are nearly parallel and closer than a stated limit. It is thinner than a
//! cell of any lattice, so that its water is described by pressures and discharges in its plane (lubrication).
//!
//! | file | content |
//! |---|---|
//! | `polygon` | convex polygons in a plane |
//! | `pairs` | joints: pairs of faces, their overlap and their aperture |
//! | `cells` | division of a joint into cells |
//! | `edges` | edges where joints meet, and edges that are open |
//! | `network` | nodes and links |
//! | `cover` | space of the joints on the lattice of another fluid |
//! | `takeover` | joints that open so far that a lattice takes over their water |
//! | `friction` | laminar and turbulent friction |
//! | `slot` | inertia with frequency-dependent friction |
//! | `water` | density of water with air, vapour pressure |
//! | `ldl`, `panels`, `order` | direct solution of sparse symmetric systems, their panels, order of large ones |
//! | `flow` | pressures and discharges, steady and in time (`step`); solution (`newton`), new networks (`renewal`) |
//! | `history` | pressure at a mouth as a function of time |
//! | `motion` | motion of blocks together with the pressures |
//! | `loads` | force and moment on the blocks |
//!
//! Every rank stores the whole network and does the same operations in the same order, so that the bits depend
//! neither on the number of ranks nor on that of threads. Threads share the links of large networks.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod cells;
pub mod cover;
pub mod edges;
pub mod flow;
pub mod friction;
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are texts of the schema, with units in brackets: [m]"
)]
pub mod history;
mod ldl;
pub mod loads;
pub mod motion;
pub mod network;
mod order;
pub mod pairs;
mod panels;
pub mod polygon;
mod sets;
pub mod slot;
pub mod takeover;
pub mod water;

pub use flow::JointFlow;
pub use network::Network;

#[cfg(test)]
mod tests;
