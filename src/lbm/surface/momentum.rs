//! Momentum of the water of a step with a free surface, for its balance with walls, structures and bodies.
//!
//! The balance runs from before the pass to the moment at which the surface acts. By then the water has taken the body
//! force, has bounced at walls, structures and bodies, and has sent populations to the gas. What the surface then gives
//! back follows from the pressure of the gas, and cells that change their kind gain or lose momentum by rule: neither
//! is an exchange with walls or bodies. The same is true of the links of carried cells ([`super::carried`]). Those that
//! lead through a plane of symmetry change the populations that the plane has mirrored, so that the momentum through
//! the faces is measured on both sides of this change, like that of the water.

use super::SlabSurface;
use super::kind::{GAS, is_wet};
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::quanta;
use crate::saturation::Cover;

/// Momentum of a step on one rank, in quanta.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepMomentum {
    /// Change of the momentum of the water, with what it sent to the gas.
    pub change: [i128; 3],
    /// Momentum that left through the faces.
    pub left: [i128; 3],
    /// Part of the loads on bodies that is weight of water in their place, and no exchange with it.
    pub weight: [i128; 3],
    /// Number of cells in which the body force acts, in quanta of a cell.
    pub open: i128,
}

/// Function that returns the momentum that left through the faces, of the cells that satisfy a condition, in quanta.
pub(crate) type Left<'a, S> = &'a dyn Fn(&Populations<S>, &dyn Fn(usize) -> bool) -> [i128; 3];

impl SlabSurface {
    /// Starts or leaves out the balance of the next step.
    pub(crate) fn balance(&mut self, wanted: bool) {
        self.balance = wanted.then(StepMomentum::default);
    }

    /// Returns the balance of the last step, if it was requested.
    #[must_use]
    pub fn balanced(&self) -> Option<&StepMomentum> {
        self.balance.as_ref()
    }

    /// Adds the momentum of the water, and that which left through the faces, times a sign.
    pub(super) fn add_state<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        left: Left<'_, S>,
        sign: i128,
    ) {
        self.add_momentum(populations, sign);
        let Some(balance) = &mut self.balance else {
            return;
        };
        let kinds = &self.cells.kind;
        let left = left(populations, &|cell| is_wet(kinds[cell]));
        for (sum, left) in balance.left.iter_mut().zip(left) {
            *sum += sign * left;
        }
    }

    /// Adds the momentum of the water, times a sign, to the change.
    fn add_momentum<S: Stored>(&mut self, populations: &Populations<S>, sign: i128) {
        let Some(balance) = &mut self.balance else {
            return;
        };
        for (_, cell) in populations.interior() {
            if is_wet(self.cells.kind[cell]) {
                let (_, momentum) = populations.moments(cell);
                for (sum, m) in balance.change.iter_mut().zip(momentum) {
                    *sum += sign * i128::from(quanta(m));
                }
            }
        }
    }

    /// Begins the balance before a pass.
    pub(crate) fn begin_balance<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        cover: Option<&Cover>,
    ) {
        self.add_momentum(populations, -1);
        let Some(balance) = &mut self.balance else {
            return;
        };
        for (_, cell) in populations.interior() {
            if is_wet(self.cells.kind[cell]) {
                let held = cover.map_or(0, |cover| i128::from(cover.weight(cell)));
                balance.open += i128::from(quanta(1.0)) - held;
            }
        }
    }

    /// Ends the balance before the surface acts.
    pub(crate) fn end_balance<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        left: Left<'_, S>,
    ) {
        self.add_state(populations, left, 1);
        let weight = self.bodies.as_ref().map(|bodies| bodies.weight());
        let Some(balance) = &mut self.balance else {
            return;
        };
        balance.weight = weight.unwrap_or_default();
        let velocities = populations.velocities();
        let (numbers, parity) = (populations.numbers(), populations.parity());
        for &cell in self.planes.iter().flat_map(|plane| &plane.surface) {
            let cell = cell as usize;
            for i in super::directions(velocities) {
                // What a plane of symmetry reflects counts as momentum through its face.
                let beyond = self.cells.neighbour(cell, i);
                if self.cells.kind_along(cell, i) != GAS
                    || self.ghosts.around().reflects(populations, beyond)
                {
                    continue;
                }
                let link = populations.link(cell, i);
                let [sent, came] = [link.out(parity), link.incoming(parity)]
                    .map(|position| i128::from(quanta(numbers[position].to_f64())));
                for (sum, c) in balance.change.iter_mut().zip(velocities.c[i]) {
                    *sum += i128::from(c) * (sent + came);
                }
            }
        }
    }
}
