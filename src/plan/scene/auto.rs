//! Automatic choices for fields that a case leaves out, from its values and its accuracy: spacing, time step, operator,
//! eddy viscosity, storage precision, coupling, contact law. Values that a case states are never changed.
//!
//! 1. The coupling, from the shapes ([`solids`]).
//! 2. The spacing, from the features that the flow must resolve ([`features`]) and the measured errors ([`measured`]),
//!    so that every edge of the domain is a whole number of cells ([`spacing`]).
//! 3. The time step and the operator, from the velocities of the resolved scene ([`step`]). A fast flow may require
//!    finer cells; the scene is then resolved once more.
//! 4. The stiffness of contacts, from the speed of impacts ([`solids`]). In seepage, stiffness and coupling
//!    interval follow from the load on the bed ([`seepage`]), and the error of the resistance law from comparison
//!    with resolved flow ([`resistance`]).
//! 5. In seepage without grains the spacing follows from its lengths and the results that the case requests
//!    ([`ground`]).
//! 6. Water with a free surface has promised errors for the answers of its probes ([`surface`]).
//!
//! Spacing, time step and related fields are chosen only if a case names an `accuracy` or leaves out spacing or time
//! step.

pub mod answers;
mod bound;
pub mod density;
pub(crate) mod features;
pub(crate) mod gaps;
pub mod ground;
pub mod measured;
pub(crate) mod moving;
mod passages;
pub(crate) mod promise;
mod resistance;
mod sections;
mod seepage;
pub(crate) mod solids;
pub mod sound;
pub(crate) mod spacing;
pub(crate) mod step;
pub mod surface;
mod suspended;

use super::Scene;
use super::bodies::Mobility;
use super::findings::Findings;
use answers::PromisedAnswer;
use base::error::Remedy;
use case::Case;
use case::accuracy::Accuracy;
use case::contact::Contact;
use case::coupling::Coupling;
use ground::Ground;
use lbm::boundary::Condition;
use lbm::boundary::pressure::Held;
use serde::Serialize;
use serde_json::json;
use spacing::Spacing;
use std::borrow::Cow;
use surface::SurfaceFlow;

/// Choices made for a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Chosen {
    /// The requested accuracy; none if no choice depends on it.
    pub accuracy: Option<Accuracy>,
    /// Bound of the relative error of forces and flows at a confidence of 95 %; none if the case lies outside the
    /// measured range. For a body that crosses cells the bound applies to the mean force over some cells: the force
    /// in single steps fluctuates as nodes are covered and uncovered.
    pub promised: Option<f64>,
    /// Features on which the promised accuracy is based, each with its cells and its bound, and the features that
    /// it does not cover.
    pub details: Vec<String>,
    /// Ground of a seepage without grains; none if no measured error covers it.
    pub ground: Option<Ground>,
    /// Flow of water with a free surface; none if no measured error covers it.
    pub water: Option<SurfaceFlow>,
    /// Answers of a seepage without grains or of water with a free surface, with the error promised for each.
    pub answers: Vec<PromisedAnswer>,
    /// All choices with their reasons.
    pub reasons: Vec<Reason>,
    /// Contact law, if it was chosen.
    pub law: Option<Contact>,
    /// Limits of the time step, if it was chosen.
    pub limits: Vec<Limit>,
    /// Edges of the domain \[m\], if they were rounded up to whole cells of the chosen spacing.
    pub size: Option<Vec<f64>>,
}

/// Subject of an automatic choice, under which its reason is found when a plan lists its models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
#[allow(missing_docs, reason = "`name` is the documentation")]
pub enum Subject {
    Accuracy,
    Collision,
    ContactLaw,
    Coupling,
    CouplingInterval,
    Populations,
    Spacing,
    TimeStep,
    Turbulence,
}

impl Subject {
    /// Returns the name that a plan prints.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Collision => "collision",
            Self::ContactLaw => "contact law",
            Self::Coupling => "coupling",
            Self::CouplingInterval => "coupling interval",
            Self::Populations => "populations",
            Self::Spacing => "spacing",
            Self::TimeStep => "time step",
            Self::Turbulence => "turbulence",
        }
    }
}

impl From<Subject> for &'static str {
    fn from(subject: Subject) -> Self {
        subject.name()
    }
}

/// Choice and its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// Subject of the choice.
    pub what: Subject,
    /// Reason.
    pub text: String,
}

/// Upper bound of the time step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Requirement that the bound satisfies.
    pub what: String,
    /// Longest time step that satisfies the requirement \[s\].
    pub time_step: f64,
}

impl Chosen {
    /// Returns the reason of a choice; none if it was not made automatically.
    #[must_use]
    pub fn reason_of(&self, what: Subject) -> Option<&str> {
        let found = self.reasons.iter().find(|reason| reason.what == what);
        found.map(|reason| reason.text.as_str())
    }

    /// Returns a remedy that sets a spacing which divides the edges of the scene, and sets these edges if they were
    /// rounded.
    pub(crate) fn state_spacing(&self, remedy: Remedy, spacing: f64) -> Remedy {
        let remedy = remedy.set("domain.spacing", spacing);
        match &self.size {
            Some(size) => remedy.set("domain.size", json!(size)),
            None => remedy,
        }
    }

    pub(crate) fn note(&mut self, what: Subject, text: impl Into<String>) {
        let text = text.into();
        self.reasons.push(Reason { what, text });
    }
}

/// Returns the accuracy of the automatic choices; none if the case states all values and no accuracy.
pub(crate) fn requested_accuracy(case: &Case) -> Option<Accuracy> {
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

/// Returns the case with its spacing, whole cells along every edge of its domain, and its coupling filled in.
pub(crate) fn with_choices<'a>(
    case: &'a Case,
    spacing: &Spacing,
    chosen: &mut Chosen,
) -> Cow<'a, Case> {
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
        chosen.note(Subject::Coupling, solids::coupling(case).1);
        filled.to_mut().coupling = Some(coupling);
    }
    filled
}

/// Copies the resolved choices of the scene being continued; end time, outputs and drives do not change them.
pub(crate) fn keep_choices(
    scene: &mut Scene,
    (case, written): (&Case, &Case),
    like: &Scene,
    findings: &mut Findings,
) {
    if let (Some(flow), Some(chosen)) = (&mut scene.flow, &like.flow) {
        flow.time_step = chosen.time_step;
        flow.relaxation_time = chosen.relaxation_time;
        flow.models = chosen.models;
        flow.storage = chosen.storage;
    }
    choose_extents_of_pressures(scene);
    if let (Some(seepage), Some(chosen)) = (&mut scene.seepage, &like.seepage) {
        seepage.coupling_time = chosen.coupling_time;
    }
    if written.contact.is_none() {
        scene.contact.clone_from(&like.contact);
    }
    scene.chosen = like.chosen.clone();
    scene.density_causes.clone_from(&like.density_causes);
    solids::keep_stiffness(scene, case, findings);
}

/// Chooses the extent over which pressures are imposed where the case does not state it and the scene decides: as
/// means with an eddy viscosity, because eddies do not leave through cells with one pressure each; else in each cell
/// if bodies move, because a body that reaches an opening parts the water there, and a mean does not determine the
/// pressure of each part.
fn choose_extents_of_pressures(scene: &mut Scene) {
    let mut bodies = scene.bodies.iter();
    let moves = bodies.any(|body| body.mobility != Mobility::Fixed)
        || scene.grains.is_some()
        || scene.blocks.is_some();
    let Some(flow) = &mut scene.flow else { return };
    let extent = match flow.models.turbulence {
        Some(_) => Held::Mean,
        None if moves => Held::EachCell,
        None => return,
    };
    for patch in flow.faces.iter_mut().flatten() {
        if let Condition::Pressure(pressure) = &mut patch.condition
            && pressure.gradient.is_none()
        {
            pressure.held.get_or_insert(extent);
        }
    }
}

/// Reports solids that touch each other from wall to wall, so that no water passes.
fn report_blocked(case: &Case, narrow_gaps: &[(usize, gaps::Gap)], findings: &mut Findings) {
    for (axis, gap) in narrow_gaps.iter().filter(|(_, gap)| gap.width <= 0.0) {
        let axis = ["x", "y", "z"][*axis];
        let path = if case.bodies.is_empty() {
            "grains"
        } else {
            "bodies"
        };
        findings.warn(
            path,
            format!(
                "no water can pass along {axis}: the solids touch across the domain, and even the widest opening \
                 has no {}",
                gap.what
            ),
            "move the solids apart, or make them smaller",
        );
    }
}

/// Makes the choices that depend on the resolved scene, from the case as filled and as written.
pub(crate) fn choose_remaining(
    scene: &mut Scene,
    case: &Case,
    written: &Case,
    findings: &mut Findings,
) {
    let lattice = features::lattice(case);
    let narrow_gaps = lattice.map_or_else(Vec::new, |lbm| {
        let factor = scene.coupling.as_ref();
        let factor = factor.map_or(1.0, Coupling::hydraulic_radius_factor);
        gaps::case_gaps(case, lbm, factor).passages
    });
    if let Some(flow) = &scene.flow {
        scene.density_causes = density::flow_causes(scene, flow, &narrow_gaps);
        let of_bodies = moving::causes(scene, flow);
        scene.density_causes.extend(of_bodies);
        let of_weight = suspended::cause(scene, flow);
        scene.density_causes.extend(of_weight);
    }
    if let (Some(accuracy), Some(lbm)) = (requested_accuracy(written), lattice) {
        scene.chosen.accuracy = Some(accuracy);
        report_blocked(case, &narrow_gaps, findings);
        step::choose(scene, lbm, accuracy.target(), &narrow_gaps, findings);
        if scene.surface.is_none() {
            promise::compute_promise(scene, case, lbm, accuracy.target(), findings);
        }
    }
    choose_extents_of_pressures(scene);
    solids::closed_pores(scene, written.coupling.is_some(), findings);
    let target = requested_accuracy(written).map(Accuracy::target);
    if scene.surface.is_some() {
        surface::promise(scene, target, findings);
    }
    if case.contact.is_none() || solids::without_stiffness(case) {
        solids::choose_contact(scene, case, target, findings);
    }
    if scene.seepage.is_some() {
        scene.chosen.accuracy = requested_accuracy(written);
        if !scene.has_solids() {
            ground::promise(scene, case, target, findings);
        } else if let Some(target) = target {
            seepage::choose(scene, target, findings);
        }
    }
}
