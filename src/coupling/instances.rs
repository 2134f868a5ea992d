//! The generic code that this package compiles, so that no package above compiles it again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled in a
//! package below is taken from there. The functions of these lists are such functions (`#[inline(never)]`), and they
//! are the doors to the kernels of couplings: what they call is compiled here with them.

use crate::Flow;
use crate::bounce_back::BounceBack;
use crate::partially_saturated::PartiallySaturated;
use crate::seepage::Seepage;
use crate::water::Water;
use dem::{PlaneSpace, Space, Volume};
use lbm::lanes::Stored;

/// The address of a function: it has to be compiled.
type Address = *const ();

/// Lists the seepage through grains of a space.
fn seepage<Sp: Space>() -> Vec<Address> {
    vec![
        Seepage::<Sp>::new as Address,
        Seepage::<Sp>::restore as Address,
    ]
}

/// Lists water of a storage with grains of a space.
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

/// Lists all of them, for both spaces and both storages.
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
