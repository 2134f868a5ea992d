//! The rule of a patch in lattice units: it collects its links at the start and sets the entering populations
//! after every pass.

use super::kind::BoundaryKind;
use super::links::{Crossing, FaceLink, MirrorRun};
use super::sound::Sums;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::surface::Outside;

/// Part of the program that sets the population entering through a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Giver {
    /// Half-way bounce-back minus this term times the factor of the rule ([`super::wall`]).
    Wall {
        /// Term 6 w_i c_i·u at full speed.
        term: f64,
    },
    /// Rule of the patch, which has stored the link.
    Rule,
}

/// Step at which a rule acts, with the force.
#[derive(Clone, Copy, Debug)]
pub struct RuleStep {
    /// Number of the step.
    pub step: f64,
    /// Half the body force, F/2.
    pub half_force: [f64; 3],
}

/// Rule of one patch. It is called once per step and patch; the loops over its links are compiled for each rule.
pub trait Rule<S: Stored>: Send + Sync {
    /// Returns the kind of the boundary.
    fn kind(&self) -> BoundaryKind;

    /// Adds a link through the patch. The links of a cell follow each other.
    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver;

    /// Returns the velocity imposed at a point of the face \[cells per step\], before the factor of the step; the
    /// point is in cells. `None` if no velocity is imposed.
    fn velocity(&self, _position: [f64; 3]) -> Option<[f64; 3]> {
        None
    }

    /// Returns the fraction of a cell's face with this centre on which the velocity is imposed: less than 1 if the
    /// patch ends within the cell.
    fn part(&self, _centre: [f64; 3]) -> f64 {
        1.0
    }

    /// Returns the state outside an opening of water with a free surface; `None` for other boundaries.
    fn outside(&self) -> Option<Outside> {
        None
    }

    /// Returns the factor of the imposed velocity at a step.
    fn factor(&self, _step: f64) -> f64 {
        0.0
    }

    /// Adds the term 6 w_i c_n u_n of the velocity normal to the patch, of a link through an edge that another patch
    /// takes, to the discharge.
    fn add_beside(&mut self, _term: f64) {}

    /// Returns the discharge of this rank's links at a factor of one, in quanta; 0 without a stated discharge.
    fn given(&self) -> i128 {
        0
    }

    /// Scales the velocities to the stated discharge, given the discharge of the links of all ranks.
    fn balance(&mut self, _given: i128) {}

    /// Returns the last step at which the ramp still changes a value.
    fn ramp_end(&self) -> f64 {
        0.0
    }

    /// Returns `true` if the wall links may be applied as soon as the cells next to them have collided; `false` if
    /// the rule reads populations that the walls set, or ghosts next to them.
    fn walls_stand_alone(&self) -> bool {
        true
    }

    /// Returns `true` if the rule only consists of wall links.
    fn is_wall(&self) -> bool {
        false
    }

    /// Stores the data that the rule needs, before a pass.
    fn remember(&mut self, _populations: &Populations<S>, _half_force: [f64; 3]) {}

    /// Receives the solid fraction of cells before the rule acts, by their positions within an array and their indices
    /// in the domain; the larger one counts of several.
    fn cover(&mut self, _fraction: &dyn Fn(usize, [usize; 3]) -> f64) {}

    /// Forgets the solid fractions of all cells.
    fn uncover(&mut self) {}

    /// Returns `true` if the rule needs sums over all ranks before it acts; equal on every rank and at every step.
    fn sums(&self) -> bool {
        false
    }

    /// Returns the sums of this rank, for rules that need sums.
    fn measure(&self, _populations: &Populations<S>, _moment: &RuleStep) -> Sums {
        Sums::default()
    }

    /// Receives the sums of all ranks.
    fn receive_sums(&mut self, _sums: Sums, _moment: &RuleStep) {}

    /// Returns the value that the rule keeps between steps; `None` if there is none.
    fn memory(&self) -> Option<f64> {
        None
    }

    /// Restores the value that the rule keeps between steps.
    fn recall(&mut self, _memory: Option<f64>) {}

    /// Sets the populations that enter through the links of the rule, before the walls are applied.
    fn apply(&mut self, _populations: &mut Populations<S>, _moment: &RuleStep) {}

    /// Changes populations that the walls have set.
    fn apply_over_walls(&mut self, _populations: &mut Populations<S>, _moment: &RuleStep) {}

    /// Returns the links of the rule that are not mirrors.
    fn links(&self) -> &[FaceLink] {
        &[]
    }

    /// Returns the populations that the rule mirrors.
    fn mirrors(&self) -> &[MirrorRun] {
        &[]
    }
}
