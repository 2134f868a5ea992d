//! The drag that closes the balance of momentum with the permeability.
//!
//! ```text
//! f = V mu eps U/[K (1 - eps)]        sum over the grains of a cell at rest: eps mu q V_cell/K = -eps grad phi V_cell
//! ```
//!
//! which is what the water of the cell loses by Darcy's law: with this law the forces on grains at rest add up to what the
//! pressures and the weight of the water push with. Each grain of a cell bears by its volume. `eps` is the porosity as it is,
//! while `K` may rest on one within limits; a cell overfull of grains has no water to drag. In a cell emptier than the cap of
//! the porosity, whose resistance is still that of the cap, a grain bears what it would bear in a bed of the cap: else
//! the few grains at a surface, or a sliver of one, would bear the resistance of the whole cell.

use super::{Bed, Grain};

/// Force over superficial velocity \[kg/s\].
#[must_use]
pub fn coefficient(bed: &Bed, grain: &Grain) -> f64 {
    let porosity = (1.0 - bed.solid).max(0.0);
    let solid = bed.solid.max(1.0 - bed.porosity);
    grain.volume * bed.viscosity * porosity / (bed.permeability * solid)
}
