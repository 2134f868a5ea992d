//! Automatic choices for fields that a case leaves out, from its values and its accuracy: spacing, time step, operator,
//! eddy viscosity, storage precision, coupling, contact law. Values that a case states are never changed.
//!
//! 1. The coupling, from the shapes ([`solids`]).
//! 2. The spacing, from the features that the flow must resolve ([`features`]) and the measured errors ([`measured`]),
//!    so that every edge of the domain is a whole number of cells ([`spacing`]).
//! 3. The time step and the operator, from the velocities of the resolved scene ([`step`]). A fast flow may require
//!    finer cells; the scene is then resolved once more.
//! 4. The stiffness of contacts, from the speed of impacts ([`solids`]). In seepage, stiffness and coupling interval
//!    follow from the load on the bed ([`seepage`]), and the error of the law of resistance from resolved flow
//!    ([`resistance`]).
//!
//! Spacing, time step and related fields are chosen only if a case names an `accuracy` or leaves out spacing or time
//! step.

mod bound;
pub mod density;
pub(crate) mod features;
pub(crate) mod gaps;
pub mod measured;
mod moving;
pub(crate) mod promise;
mod resistance;
mod sections;
mod seepage;
pub(crate) mod solids;
pub mod sound;
pub(crate) mod spacing;
pub(crate) mod step;
mod ways;

use super::Scene;
use super::findings::Findings;
use base::error::Remedy;
use case::Case;
use case::accuracy::Accuracy;
use case::contact::Contact;
use case::coupling::Coupling;
use lbm::boundary::Condition;
use lbm::boundary::pressure::Held;
use serde::Serialize;
use serde_json::json;
use spacing::Spacing;
use std::borrow::Cow;

/// Choices made for a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chosen {
    /// The requested accuracy; none if no choice depends on it.
    pub accuracy: Option<Accuracy>,
    /// Bound of the relative error of forces and flows at a confidence of 95 %; none if the case lies outside what
    /// was measured. Of a body that crosses cells it is that of the mean force over some cells: in the single steps the
    /// force swings as nodes are covered and laid bare.
    pub promised: Option<f64>,
    /// The features that the promise was made from, each with its cells and its bound, and what it does not cover.
    pub details: Vec<String>,
    /// Every choice with its reason.
    pub reasons: Vec<Reason>,
    /// The contact law, where it was chosen.
    pub law: Option<Contact>,
    /// Limits of the time step, if it was chosen.
    pub limits: Vec<Limit>,
    /// The edges of the domain \[m\], where they were rounded up to whole cells of the chosen spacing.
    pub size: Option<Vec<f64>>,
}

/// A choice and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// Name of the choice: `spacing`, `time step`, `collision` and so on.
    pub what: &'static str,
    /// Why.
    pub text: String,
}

/// A bound of the time step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Requirement that it keeps.
    pub what: String,
    /// The longest time step that does \[s\].
    pub time_step: f64,
}

impl Chosen {
    /// Returns why something was chosen; none if it was not.
    #[must_use]
    pub fn why(&self, what: &str) -> Option<&str> {
        let found = self.reasons.iter().find(|reason| reason.what == what);
        found.map(|reason| reason.text.as_str())
    }

    /// Returns a remedy that states a spacing which divides the edges of the scene, and these edges where they were
    /// rounded.
    pub(crate) fn state_spacing(&self, remedy: Remedy, spacing: f64) -> Remedy {
        let remedy = remedy.set("domain.spacing", spacing);
        match &self.size {
            Some(size) => remedy.set("domain.size", json!(size)),
            None => remedy,
        }
    }

    pub(crate) fn note(&mut self, what: &'static str, text: impl Into<String>) {
        let text = text.into();
        self.reasons.push(Reason { what, text });
    }
}

/// Returns the accuracy of the automatic choices; none if the case states all values and no accuracy.
pub(crate) fn asked(case: &Case) -> Option<Accuracy> {
    let lbm = features::lattice(case);
    let no_step = lbm.is_some_and(|lbm| {
        lbm.relaxation_time.is_none()
            && lbm.time_step.is_none()
            && lbm.reference_velocity.is_none()
            && lbm.lattice_velocity.is_none()
    });
    let chosen = case.domain.spacing.is_none() || no_step;
    case.accuracy.or(chosen.then(Accuracy::default))
}

/// Returns the coupling of a case, stated or chosen; none without solids in water on a lattice.
pub(crate) fn coupling_of(case: &Case) -> Option<Coupling> {
    let solid = super::has_solids(case) && features::lattice(case).is_some();
    let chosen = || solid.then(|| solids::coupling(case).0);
    case.coupling.clone().or_else(chosen)
}

/// Returns the case with its spacing, whole cells along every edge of its domain, and its coupling.
pub(crate) fn filled<'a>(case: &'a Case, spacing: &Spacing, chosen: &mut Chosen) -> Cow<'a, Case> {
    let mut filled = Cow::Borrowed(case);
    if case.domain.spacing.is_none() {
        filled.to_mut().domain.spacing = Some(spacing.value);
        if let Some(size) = &spacing.rounded {
            filled.to_mut().domain.size.0.clone_from(size);
            chosen.size = Some(size.clone());
        }
    }
    if case.coupling.is_none()
        && let Some(coupling) = coupling_of(case)
    {
        chosen.note("coupling", solids::coupling(case).1);
        filled.to_mut().coupling = Some(coupling);
    }
    filled
}

/// Copies the resolved choices of the scene being continued; end time, outputs and drives do not change them.
pub(crate) fn keep(scene: &mut Scene, written: &Case, like: &Scene) {
    if let (Some(flow), Some(chosen)) = (&mut scene.flow, &like.flow) {
        flow.time_step = chosen.time_step;
        flow.relaxation_time = chosen.relaxation_time;
        flow.turbulence = chosen.turbulence;
        flow.collision = chosen.collision;
        flow.lattice = chosen.lattice;
        flow.storage = chosen.storage;
    }
    hold_means_in_eddies(scene);
    if let (Some(seepage), Some(chosen)) = (&mut scene.seepage, &like.seepage) {
        seepage.coupling_time = chosen.coupling_time;
    }
    if written.contact.is_none() {
        scene.contact.clone_from(&like.contact);
    }
    scene.chosen = like.chosen.clone();
    scene.density_causes.clone_from(&like.density_causes);
}

/// Holds imposed pressures on the mean where eddies are modelled and the case does not say where they hold: in each
/// cell they do not let eddies out.
fn hold_means_in_eddies(scene: &mut Scene) {
    let Some(flow) = scene.flow.as_mut().filter(|flow| flow.turbulence.is_some()) else {
        return;
    };
    for patch in flow.faces.iter_mut().flatten() {
        if let Condition::Pressure(pressure) = &mut patch.condition
            && pressure.gradient.is_none()
        {
            pressure.held.get_or_insert(Held::Mean);
        }
    }
}

/// Solids that touch from wall to wall let nothing through.
fn blocked(case: &Case, ways: &[(usize, gaps::Gap)], findings: &mut Findings) {
    for (axis, gap) in ways.iter().filter(|(_, gap)| gap.width <= 0.0) {
        let axis = ["x", "y", "z"][*axis];
        let path = if case.bodies.is_empty() {
            "grains"
        } else {
            "bodies"
        };
        findings.warn(
            path,
            format!(
                "no water passes along {axis}: the solids touch across the domain, and even at the widest place there \
                 is no {}",
                gap.what
            ),
            "move the solids apart, or make them smaller",
        );
    }
}

/// Chooses what depends on the scene as made, from the case as filled and as written.
pub(crate) fn settle(scene: &mut Scene, case: &Case, written: &Case, findings: &mut Findings) {
    let lattice = features::lattice(case);
    let ways = lattice.map_or_else(Vec::new, |lbm| {
        let factor = scene.coupling.as_ref();
        let factor = factor.map_or(1.0, Coupling::hydraulic_radius_factor);
        gaps::case_gaps(case, lbm, factor).ways
    });
    if let Some(flow) = &scene.flow {
        scene.density_causes = density::causes(scene, flow, &ways);
        let of_bodies = moving::causes(scene, flow);
        scene.density_causes.extend(of_bodies);
    }
    if let (Some(accuracy), Some(lbm)) = (asked(written), lattice) {
        scene.chosen.accuracy = Some(accuracy);
        blocked(case, &ways, findings);
        step::choose(scene, lbm, accuracy.target(), &ways, findings);
        promise::judge(scene, case, lbm, accuracy.target(), findings);
    }
    hold_means_in_eddies(scene);
    if written.coupling.is_none() {
        solids::closed_pores(scene, findings);
    }
    let target = asked(written).map(Accuracy::target);
    if case.contact.is_none() || solids::without_stiffness(case) {
        solids::choose_contact(scene, case, target, findings);
    }
    if let (Some(target), Some(_)) = (target, &scene.seepage) {
        scene.chosen.accuracy = asked(written);
        seepage::choose(scene, target, findings);
    }
}
