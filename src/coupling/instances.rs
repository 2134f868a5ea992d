//! Instances of generic code that this package compiles, so that no dependent package compiles them again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled
//! in a dependency is taken from there. The functions in these lists are of this kind (`#[inline(never)]`); they
//! are the entry points to the kernels of couplings, and the functions that they call are compiled here with them.

use crate::Flow;
use crate::bounce_back::BounceBack;
use crate::partially_saturated::PartiallySaturated;
use crate::seepage::Seepage;
use crate::water::Water;
use dem::{PlaneSpace, Space, Volume};
use lbm::lanes::Stored;

/// Address of a function, which forces its compilation.
type Address = *const ();

/// Returns the addresses for seepage through grains of a space.
fn seepage<Sp: Space>() -> Vec<Address> {
    vec![
        Seepage::<Sp>::new as Address,
        Seepage::<Sp>::restore as Address,
    ]
}

/// Returns the addresses for water of a storage type with grains of a space.
fn water<Sp: Space, S: Stored>() -> Vec<Address> {
    vec![
        BounceBack::<Sp, S>::new as Address,
        BounceBack::<Sp, S>::with_structures as Address,
        PartiallySaturated::<Sp, S>::new as Address,
        PartiallySaturated::<Sp, S>::with_structures as Address,
        Water::<Sp, S>::lattice as Address,
        Water::<Sp, S>::lattice_mut as Address,
        Water::<Sp, S>::seepage as Address,
        Water::<Sp, S>::seepage_mut as Address,
        <Water<Sp, S> as Flow<Sp>>::advance as Address,
        <Water<Sp, S> as Flow<Sp>>::update_bodies as Address,
    ]
}

/// Returns all addresses, for both spaces and both storage types.
#[must_use]
pub fn all() -> Vec<Address> {
    [
        seepage::<PlaneSpace>(),
        seepage::<Volume>(),
        water::<PlaneSpace, f64>(),
        water::<PlaneSpace, f32>(),
        water::<Volume, f64>(),
        water::<Volume, f32>(),
    ]
    .concat()
}
