//! Terms of the fluid step of a resolved flow ([`lbm::term`]): all that a scene, a plan and a run need of them.
//!
//! A new term is a file below this module with a type that implements [`FlowTerm`] and has a function `build`, a line
//! of the list, and a line in [`resolve`].

use super::findings::Findings;
use super::flow::Flow;
use super::grid::Grid;
use base::error::Remedy;
use base::family::family;
use case::Case;
use lbm::lanes::Stored;
use lbm::term::TermBuilder;
use serde::Serialize;

family! {
    /// Term of the fluid step of a resolved flow.
    #[derive(Clone, Debug, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum SceneTerm: dyn FlowTerm {
        porous: PorousZones(PorousZones),
    }
}

impl SceneTerm {
    /// Returns the function that makes the term for a slab.
    #[must_use]
    pub fn build<S: Stored>(&self, grid: &Grid, flow: &Flow) -> TermBuilder<S> {
        each!(self, term => term.build(grid, flow))
    }
}

/// Returns the terms of a case.
pub(crate) fn resolve(
    case: &Case,
    grid: &Grid,
    has_surface: bool,
    findings: &mut Findings,
) -> Vec<SceneTerm> {
    let terms = [porous::zones(case, grid, findings).map(SceneTerm::PorousZones)];
    let terms: Vec<SceneTerm> = terms.into_iter().flatten().collect();
    for term in terms.iter().map(SceneTerm::model) {
        if has_surface && !term.works_with_surface() {
            findings.error(
                term.path(),
                format!(
                    "{} in water with a free surface are not verified yet",
                    term.name()
                ),
                Remedy::take_out(
                    format!(
                        "remove the {}, or replace the free surface by a face with free_slip (a rigid lid)",
                        term.short_name()
                    ),
                    term.path(),
                ),
            );
        }
    }
    terms
}

/// Term as a plan sees it. The defaults are the cautious answers.
pub trait FlowTerm {
    /// Returns the name in messages, in the plural: "porous zones in water with a free surface are not verified".
    fn name(&self) -> &'static str;

    /// Returns the name in remedies, in the plural: "remove the zones".
    fn short_name(&self) -> &'static str {
        self.name()
    }

    /// Returns the JSON path of the field of the case.
    fn path(&self) -> &'static str;

    /// Returns the lines of the plan: name, model and reason.
    fn describe(&self) -> Vec<[String; 3]>;

    /// Returns the subject of a plan's sentence "no error was measured for ..."; none if the errors are known.
    fn unmeasured(&self) -> Option<String> {
        Some(self.name().to_owned())
    }

    /// Returns `true` if the term is verified with a free surface.
    fn works_with_surface(&self) -> bool {
        false
    }

    /// Returns `true` if GPU kernels support the term, as [`lbm::term::Term::runs_on_gpu`].
    fn runs_on_gpu(&self) -> bool {
        false
    }

    /// Returns `true` if the term works with collisions in f32.
    fn runs_in_single(&self) -> bool {
        false
    }

    /// Returns an upper bound of the speed [m/s] that a pressure drop over the density [m²/s²] along an axis drives
    /// against the term; infinite if the term does not bound it.
    fn fastest(&self, grid: &Grid, axis: usize, drop: f64) -> f64 {
        let _ = (grid, axis, drop);
        f64::INFINITY
    }

    /// Returns the pressure losses of a discharge along an axis.
    fn losses(&self, grid: &Grid, axis: usize, discharge: f64) -> Vec<TermLoss> {
        let _ = (grid, axis, discharge);
        Vec::new()
    }

    /// Returns the number of cells on which the term acts in each step, in addition to the pass over the lattice.
    fn cells(&self, grid: &Grid) -> f64 {
        let _ = grid;
        0.0
    }

    /// Returns the limit of the time step at a speed [m/s]; none without a limit.
    fn step_limit(&self, speed: f64) -> Option<TermStepLimit> {
        let _ = speed;
        None
    }
}

/// Pressure loss of a term.
#[derive(Clone, Debug, PartialEq)]
pub struct TermLoss {
    /// Name of the cause.
    pub what: &'static str,
    /// JSON path of the field that determines it.
    pub path: String,
    /// Pressure over the density [m²/s²].
    pub loss: f64,
}

/// Limit of the time step by a term.
#[derive(Clone, Debug, PartialEq)]
pub struct TermStepLimit {
    /// Requirement that the limit satisfies.
    pub requirement: String,
    /// Name of the margin of the plan.
    pub margin: &'static str,
    /// JSON path of the field that determines the limit.
    pub path: String,
    /// Longest time step \[s\] that is stable.
    pub stable: f64,
    /// Longest time step \[s\] for accurate velocities in an eddy-viscosity model.
    pub with_eddies: f64,
    /// Subject of the finding above `stable`: "the resistance of the zone `a` removes ... times the momentum of its
    /// water".
    pub excess: TermExcess,
}

/// Texts of the findings about a time step that is too long for a term.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TermExcess {
    /// Text before the ratio of the effect of a step to its scale.
    pub subject: String,
    /// Text between this ratio and the time step.
    pub object: String,
    /// Text after the time step.
    pub consequence: String,
    /// Further remedy.
    pub instead: String,
    /// Place at which the eddy viscosity uses inaccurate velocities.
    pub surface: String,
}

/// Returns the smallest of the bounds of [`FlowTerm::fastest`].
pub(crate) fn fastest(terms: &[SceneTerm], grid: &Grid, axis: usize, drop: f64) -> f64 {
    let bounds = terms.iter();
    let bounds = bounds.map(|term| term.model().fastest(grid, axis, drop));
    bounds.fold(f64::INFINITY, f64::min)
}

/// Returns the limit of the shortest time step of all terms at a speed [m/s].
pub(crate) fn step_limit(terms: &[SceneTerm], speed: f64) -> Option<TermStepLimit> {
    let limits = terms.iter();
    let limits = limits.filter_map(|term| term.model().step_limit(speed));
    limits.min_by(|a, b| a.stable.total_cmp(&b.stable))
}
