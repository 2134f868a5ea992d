//! The generic code that this package compiles, so that no package above compiles it again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled in a
//! package below is taken from there. The functions of these lists are such functions (`#[inline(never)]`), and they
//! are the doors to the kernels of fluids: what they call is compiled here with them.

use crate::fluid::Fluid;
use crate::lanes::Stored;
use crate::populations::Populations;

/// The address of a function: it has to be compiled.
type Address = *const ();

/// Lists a lattice of a storage.
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

/// Lists all of them, for both storages.
#[must_use]
pub fn all() -> Vec<Address> {
    [lattice::<f64>(), lattice::<f32>()].concat()
}
