//! The rule of a patch in lattice units: it collects its links at the start and gives what enters through them after
//! every pass.

use super::kind::BoundaryKind;
use super::links::{Crossing, FaceLink, MirrorRun};
use super::sound::Sums;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::surface::Outside;

/// Source of the population that enters through a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Giver {
    /// Half-way bounce-back less this term times the factor of the rule ([`super::wall`]).
    Wall {
        /// 6 w_i c_i·u at full speed.
        term: f64,
    },
    /// The rule, which has kept the link.
    Rule,
}

/// Step and time at which a rule acts.
#[derive(Clone, Copy, Debug)]
pub struct RuleStep {
    /// The step.
    pub step: f64,
    /// F/2 of the body force.
    pub half_force: [f64; 3],
}

/// The rule of one patch. The calls for a step are made once for the patch; the loops over its links are compiled for
/// each rule.
pub trait Rule<S: Stored>: Send + Sync {
    /// Returns the kind of the boundary.
    fn kind(&self) -> BoundaryKind;

    /// Takes a link through the patch. The links of a cell come one after another.
    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver;

    /// Returns the velocity imposed at a point of the face \[cells per step\], before the factor of the step; the point
    /// is in cells. None where no velocity is imposed.
    fn velocity(&self, _position: [f64; 3]) -> Option<[f64; 3]> {
        None
    }

    /// Returns the part of a cell's face, of this centre, on which the velocity is imposed: less than 1 where the patch
    /// ends within a cell.
    fn part(&self, _centre: [f64; 3]) -> f64 {
        1.0
    }

    /// Returns what is outside an opening of water with a free surface; none where no such water passes.
    fn outside(&self) -> Option<Outside> {
        None
    }

    /// Returns the factor of the imposed velocity at a step.
    fn factor(&self, _step: f64) -> f64 {
        0.0
    }

    /// Returns what the links of this rank let in at a factor of one, in quanta; 0 where no discharge is stated.
    fn given(&self) -> i128 {
        0
    }

    /// Takes what the links of all ranks let in, and lets the stated discharge in from now on.
    fn balance(&mut self, _given: i128) {}

    /// Returns the last step in which a value still changes by its ramp.
    fn ramp_end(&self) -> f64 {
        0.0
    }

    /// Returns `true` if the links at walls may be given as soon as the cells next to them have collided; not if the
    /// rule reads populations that the walls give, or ghosts next to them.
    fn walls_stand_alone(&self) -> bool {
        true
    }

    /// Returns `true` if the rule only gives its links to the walls.
    fn is_wall(&self) -> bool {
        false
    }

    /// Stores the data of the state that the rule needs, before a pass.
    fn remember(&mut self, _populations: &Populations<S>, _half_force: [f64; 3]) {}

    /// Returns `true` if the rule needs sums over all ranks before it acts; equal on every rank and at every step.
    fn sums(&self) -> bool {
        false
    }

    /// Returns the sums of this rank, where it needs any.
    fn measure(&self, _populations: &Populations<S>, _moment: &RuleStep) -> Sums {
        Sums::default()
    }

    /// Takes the sums of all ranks.
    fn hear(&mut self, _sums: Sums, _moment: &RuleStep) {}

    /// Returns the value that the rule keeps from step to step; none if it keeps nothing, or nothing yet.
    fn memory(&self) -> Option<f64> {
        None
    }

    /// Sets what the rule remembers.
    fn recall(&mut self, _memory: Option<f64>) {}

    /// Gives the links that the rule keeps what enters, before the walls are given theirs.
    fn apply(&mut self, _populations: &mut Populations<S>, _moment: &RuleStep) {}

    /// Changes what the walls have been given.
    fn apply_over_walls(&mut self, _populations: &mut Populations<S>, _moment: &RuleStep) {}

    /// Returns the links that the rule keeps and that are no mirrors.
    fn links(&self) -> &[FaceLink] {
        &[]
    }

    /// Returns the populations that the rule mirrors.
    fn mirrors(&self) -> &[MirrorRun] {
        &[]
    }
}
