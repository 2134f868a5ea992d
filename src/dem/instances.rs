//! The generic code that this package compiles, so that no package above compiles it again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled in a
//! package below is taken from there. The functions of these lists are such functions (`#[inline(never)]`), and they
//! are the doors to the kernels of grains and contacts: what they call is compiled here with them.

use crate::{Dem, Particles, PlaneSpace, Space, Volume};

/// The address of a function: it has to be compiled.
type Address = *const ();

/// Lists the grains of a space.
fn grains<Sp: Space>() -> Vec<Address> {
    vec![
        Dem::<Sp>::new as Address,
        Particles::<Sp>::insert as Address,
        Particles::<Sp>::table as Address,
        Particles::<Sp>::from_table as Address,
        Particles::<Sp>::refresh_ghosts as Address,
    ]
}

/// Lists all of them, for both spaces.
#[must_use]
pub fn all() -> Vec<Address> {
    [grains::<PlaneSpace>(), grains::<Volume>()].concat()
}
