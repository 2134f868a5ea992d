//! Instances of generic code that this package compiles, so that no dependent package compiles them again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled
//! in a dependency is taken from there. The functions in these lists are of this kind (`#[inline(never)]`); they
//! are the entry points to the kernels of grains and contacts, and the functions that they call are compiled here
//! with them.

use crate::{Dem, Particles, PlaneSpace, Space, Volume};

/// Address of a function, which forces its compilation.
type Address = *const ();

/// Returns the addresses for the grains of a space.
fn grains<Sp: Space>() -> Vec<Address> {
    vec![
        Dem::<Sp>::new as Address,
        Particles::<Sp>::insert as Address,
        Particles::<Sp>::table as Address,
        Particles::<Sp>::from_table as Address,
        Particles::<Sp>::refresh_ghosts as Address,
    ]
}

/// Returns all addresses, for both spaces.
#[must_use]
pub fn all() -> Vec<Address> {
    [grains::<PlaneSpace>(), grains::<Volume>()].concat()
}
