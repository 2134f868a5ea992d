//! Ranks, slabs, halos, messages between ranks and exact sums: arrays and MPI, no physics.
//!
//! ```text
//!            rank 0        rank 1     rank 2 (empty)   rank 3
//!        |0 1 2 3 4 5 6|7 8 9 10 11|              |12 13 14 15|     planes along one axis
//!               upper ->|<- lower                  |                 neighbours skip empty slabs
//!        ^------------------------ periodic -------------------^     and may wrap around
//! ```
//!
//! The crate guarantees:
//!
//! - **One owner.** A plane, and all that a caller places in it, belongs to exactly one rank. Integers decide:
//!   [`Slabs::owner_of_plane`]. Slabs may be unequal or empty.
//! - **The same bits on any number of ranks and threads.** [`ExactSum`] and [`Fixed`] add without
//!   rounding; their results do not depend on the order. [`StateHash`] compares whole states.
//! - **No deadlock on errors.** Ranks agree on errors before any of them leaves
//!   ([`Communicator::agree`]). A panic ends the whole job with exit code 101 ([`World::start`]).
//!   Every exchange posts its receives before its sends.
//! - **No allocation in the step.** [`HaloExchange`] and [`FixedExchange`] own their buffers and their persistent
//!   requests. In a step the caller fills buffers, starts the exchange, computes, finishes the exchange and reads
//!   buffers.
//! - **No MPI for one rank.** [`Communicator::serial`] and [`Domain::serial`] accept the same calls and
//!   do not start MPI. [`on_threads`] runs several ranks as threads, for tests.
//!
//! ```
//! use decomposition::{Domain, HaloBytes, HaloExchange, SplitAxis};
//!
//! let domain = Domain::serial(SplitAxis::X, 8, true);              // or Domain::new(world.communicator(), slabs)
//! let mut halo = HaloExchange::new(&domain, 0, HaloBytes::symmetric(2 * size_of::<f64>()))?;
//! let (lower, upper) = halo.send_buffers_mut::<f64>();
//! if let Some(lower) = lower { lower.copy_from_slice(&[1.0, 2.0]); } // my first plane
//! if let Some(upper) = upper { upper.copy_from_slice(&[3.0, 4.0]); } // my last plane
//! halo.start();
//! // ... compute the planes that need no neighbour ...
//! halo.finish();
//! let (from_lower, from_upper) = halo.received::<f64>();
//! assert_eq!(from_lower, Some([3.0, 4.0].as_slice()));
//! assert_eq!(from_upper, Some([1.0, 2.0].as_slice()));
//! # Ok::<(), decomposition::Disagreement>(())
//! ```
//!
//! A [`Communicator`], and every type that contains one, is neither `Send` nor `Sync`: only one thread of a rank
//! may call MPI, and the compiler enforces it. Pass `&Slabs` to worker threads, not `&Domain`.

mod comm;
mod exact_sum;
mod exchange;
mod halo;
mod persistent;
mod post;
mod slab;
mod state_hash;
mod threads;
mod waiting;

pub use comm::{Communicator, Disagreement, RawCommunicator, StartError, World, mpi_library};
pub use exact_sum::{ExactSum, Fixed, quantise};
pub use exchange::{FixedExchange, exchange};
pub use halo::{HaloBytes, HaloExchange};
pub use persistent::PatternError;
pub use slab::{Domain, SlabError, Slabs, SplitAxis};
pub use state_hash::{StateHash, field_key};
pub use threads::on_threads;
pub use waiting::{Traffic, Waited, traffic, waited};
