//! Free slip: populations are mirrored at the face, half-way beyond the last cell.
//!
//! The population entering x along j is the one that left the cell x - t along i, where i is j with the components
//! normal to the crossed faces reversed and t the component of c_i along them. No momentum parallel to the face is
//! exchanged.

use super::links::{Counted, Mirror, MirrorRun};
use super::{
    BoundaryKind, BoundaryModel, Crossing, Giver, Place, Rule, RuleStep, Strength, SurfaceKind,
};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::error::Error;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// A symmetry plane: no flow through it and no friction. Bodies and structures that touch or intersect the plane
/// continue as their mirror images beyond it; their load is that on the part inside the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct FreeSlip {}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Symmetry,
    strength: Strength::Symmetry,
};

impl BoundaryModel for FreeSlip {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::<FreeSlipLinks>::default())
    }
}

/// Populations that a patch mirrors.
#[derive(Debug, Default)]
pub struct FreeSlipLinks {
    runs: Vec<MirrorRun>,
    /// Index of the last run of each incoming direction: the only run that may continue.
    last: HashMap<u8, usize>,
    /// Prefix sums of the runs, computed at the first step.
    counted: Option<Counted>,
}

impl<S: Stored> Rule<S> for FreeSlipLinks {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        let mirror = Mirror::new(crossing);
        let last = self.last.get(&mirror.enters);
        let run = last.and_then(|&run| self.runs.get_mut(run));
        match run.and_then(|run| Some((run.with(&mirror)?, run))) {
            Some((longer, run)) => *run = longer,
            None => {
                self.last.insert(mirror.enters, self.runs.len());
                self.runs.push(MirrorRun::single(mirror));
            }
        }
        Giver::Rule
    }

    fn walls_stand_alone(&self) -> bool {
        self.runs.is_empty()
    }

    fn apply(&mut self, populations: &mut Populations<S>, _: &RuleStep) {
        let parity = populations.parity();
        let runs = &self.runs;
        let counted = self
            .counted
            .get_or_insert_with(|| Counted::new(runs.iter().map(MirrorRun::count)));
        counted.each(0..runs.len(), populations, |run, some, numbers| {
            let row = runs[run].row(some, parity);
            // SAFETY: both ends lie in the slab; no position is both source and target, and each target is written
            // once.
            unsafe { row.give(0.0, numbers) };
        });
    }

    fn mirrors(&self) -> &[MirrorRun] {
        &self.runs
    }
}
