//! Generic code compiled by this package, so that no dependent package compiles it again.
//!
//! A generic function is compiled in each package that uses it. A function that is never inlined and was compiled
//! in a dependency is reused. The functions of these lists are such functions (`#[inline(never)]`) and entry points
//! to the kernels of fluids, so that the functions that they call are compiled here as well.

use crate::fluid::Fluid;
use crate::lanes::Stored;
use crate::populations::Populations;

/// Address of a function, which forces its compilation.
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

/// Returns the addresses for both storages.
#[must_use]
pub fn all() -> Vec<Address> {
    [lattice::<f64>(), lattice::<f32>()].concat()
}
