//! The generic code that this package compiles, so that no package above compiles it again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled in a
//! package below is taken from there. The functions of these lists are such functions (`#[inline(never)]`), and they
//! are the doors to the kernels of fluids, contacts and couplings: what they call is compiled here with them. A change
//! of a case, a plan or an output then compiles no kernel.

use crate::coupling::Flow;
use crate::coupling::bounce_back::BounceBack;
use crate::coupling::partially_saturated::PartiallySaturated;
use crate::coupling::seepage::Seepage;
use crate::coupling::water::Water;
use crate::dem::{Dem, Particles, Plane, Space, Volume};
use crate::lbm::fluid::Fluid;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::Populations;

/// The address of a function: it has to be compiled.
type Address = *const ();

/// Returns grains of a space.
fn grains<Sp: Space>() -> Vec<Address> {
    vec![
        Dem::<Sp>::new as Address,
        Particles::<Sp>::insert as Address,
        Particles::<Sp>::table as Address,
        Particles::<Sp>::from_table as Address,
        Particles::<Sp>::refresh_ghosts as Address,
        Seepage::<Sp>::new as Address,
        Seepage::<Sp>::restore as Address,
    ]
}

/// Returns a lattice of a storage.
fn lattice<S: Stored>() -> Vec<Address> {
    vec![
        Fluid::<S>::new as Address,
        Fluid::<S>::initialise as Address,
        Fluid::<S>::advance as Address,
        Fluid::<S>::spread_velocities as Address,
        Populations::<S>::row_moments as Address,
        Populations::<S>::row_extremes as Address,
    ]
}

/// Returns water of a storage with grains of a space.
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

/// Returns all of them, for both spaces and both storages.
#[must_use]
pub fn all() -> Vec<Address> {
    [
        grains::<Plane>(),
        grains::<Volume>(),
        lattice::<f64>(),
        lattice::<f32>(),
        water::<Plane, f64>(),
        water::<Plane, f32>(),
        water::<Volume, f64>(),
        water::<Volume, f32>(),
    ]
    .concat()
}
