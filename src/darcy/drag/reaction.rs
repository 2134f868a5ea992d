//! Drag implied by a resistance law: its reaction on the grains. It closes the balance of momentum with every
//! resistance.
//!
//! ```text
//! f = V mu eps U/[K (1 - eps)]        sum over the grains of a cell at rest: eps mu q V_cell/K = -eps grad phi V_cell
//! ```
//!
//! The sum is the momentum that the water of the cell loses by Darcy's law: the forces on stationary grains balance
//! the imposed pressures and the weight of the water. Each grain of a cell carries a fraction proportional to its
//! volume.
//!
//! `eps` is the unlimited porosity, while `K` may use a limited one. In a cell with a solid fraction of one or more
//! the drag is zero. In a cell with a porosity above the maximum of the permeability law, a grain carries the drag of
//! a bed at this maximum. Without this rule the few grains at a surface would carry the resistance of the whole
//! cell, which has the permeability at the maximum.

use super::{BedConditions, DragFormula, GrainSize};

/// Drag law of the reaction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reaction;

impl DragFormula for Reaction {
    fn summary() -> &'static str {
        "The reaction of the resistance: the forces on the grains balance the loss of pressure."
    }

    fn description(&self) -> String {
        "reaction of the resistance".into()
    }

    fn balances(&self) -> bool {
        true
    }

    fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, _: f64) -> f64 {
        let porosity = (1.0 - bed.solid).max(0.0);
        let solid = bed.solid.max(1.0 - bed.porosity);
        grain.volume * bed.viscosity * porosity / (bed.permeability * solid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drag::testing::{bed, gradient};

    #[test]
    fn the_consistent_drag_has_the_loss_of_darcy() {
        let bed = bed(0.37, 0.1);
        let loss = gradient(&Reaction, &bed, 1e-3, 2e-4);
        assert!((loss / (0.1 * 2e-4 / bed.permeability) - 1.0).abs() < 1e-12);
    }
}
