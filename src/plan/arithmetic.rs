//! Collisions in f32: the scenes that have them, and their effect on velocities.
//!
//! A pass with arithmetic in f32 exists for open cells without eddy viscosity and operators whose errors in f32 were
//! measured ([`lbm::fluid::collides_in_single`]). Rounding is negligible where it stays below a tenth of the promised
//! error, or below the smallest error of the measured runs if nothing is promised.

use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::rounding;
use crate::scene::terms::SceneTerm;
use base::error::Remedy;
use case::coupling::Coupling;
use case::fluid::{Device, Precision};
use lbm::fluid::collides_in_single;

/// Fraction of the promised error that rounding may reach.
const PART: f64 = 0.1;

/// Smallest error of the measured runs from which promises are made.
const SMALLEST: f64 = 0.001;

/// Returns the features of a scene that have no collisions in f32.
fn obstacles(scene: &Scene, flow: &Flow) -> Vec<String> {
    let mut all = Vec::new();
    if !collides_in_single(flow.models.collision) {
        all.push(format!("the collision {}", flow.models.collision.name()));
    }
    if flow.models.turbulence.is_some() {
        all.push("an eddy viscosity".into());
    }
    if matches!(scene.coupling, Some(Coupling::PartiallySaturated(_))) {
        all.push("partially saturated cells".into());
    }
    let terms = scene.terms.iter().map(SceneTerm::model);
    let terms = terms.filter(|term| !term.runs_in_single());
    all.extend(terms.map(|term| term.name().to_owned()));
    if scene.surface.is_some() {
        all.push("a free surface".into());
    }
    all
}

/// Returns the largest change of velocities by rounding that is negligible compared with the errors of a scene.
fn negligible(scene: &Scene) -> f64 {
    let promised = scene.chosen.promised;
    promised.map_or(SMALLEST, |promised| PART * promised)
}

/// Returns the reason that the plan prints for the storage of the populations: the precision of the arithmetic, and
/// whether f32 would suffice.
pub(super) fn describe(scene: &Scene, flow: &Flow) -> String {
    let percent = || number(100.0 * rounding::of_single(scene, flow));
    let one_array = "streamed in place: one array";
    if flow.arithmetic == Precision::F32 {
        return format!(
            "{one_array}; arithmetic in f32, whose rounding changes velocities by up to {} %",
            percent()
        );
    }
    let offered = scene.chosen.promised.is_some()
        && flow.device == Device::Cpu
        && scene.joints.is_none()
        && obstacles(scene, flow).is_empty()
        && rounding::of_single(scene, flow) <= negligible(scene);
    if offered {
        format!(
            "{one_array}; arithmetic in f64; `arithmetic` f32 is faster, and changes velocities by up to {} %",
            percent()
        )
    } else {
        format!("{one_array}; arithmetic in f64")
    }
}

/// Refuses collisions in f32 for a scene that has no kernel for them, and warns if rounding is not negligible.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref() else {
        return;
    };
    if flow.arithmetic != Precision::F32 {
        return;
    }
    let path = format!("{PATH}.arithmetic");
    let storage = format!("{PATH}.storage");
    let in_f64 = |text: &str| Remedy::from(text).set(&path, "f64").set(&storage, "f32");
    if flow.storage != Precision::F32 {
        findings.error(
            &storage,
            "collisions in f32 need populations in f32",
            Remedy::from("use f32, or leave it out").set(&storage, "f32"),
        );
        return;
    }
    let against = obstacles(scene, flow);
    if !against.is_empty() {
        findings.error(
            &path,
            format!("there are no collisions in f32 with {}", against.join(", ")),
            in_f64("use f64, with storage f32 for half the memory"),
        );
        return;
    }
    let (found, limit) = (rounding::of_single(scene, flow), negligible(scene));
    if found > limit {
        findings.warn(
            &path,
            format!(
                "rounding in f32 changes velocities by up to {} %, more than {} %, {}",
                number(100.0 * found),
                number(100.0 * limit),
                if scene.chosen.promised.is_some() {
                    "a tenth of the promised error"
                } else {
                    "the smallest measured error of any scheme"
                }
            ),
            in_f64("use f64, with storage f32 for half the memory, or coarser cells"),
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::{Document, examples};
    use std::path::Path;

    const IN_F32: &str = "fluid.lattice_boltzmann.arithmetic=f32";

    fn planned(example: &str, set: &[&str]) -> Result<Plan, Vec<Problem>> {
        let set: Vec<String> = set.iter().map(|&text| text.into()).collect();
        let text = examples::find(example).unwrap().text;
        Plan::prepare(Document::read(text, &set, Path::new("."))?)
    }

    fn reason(plan: &Plan) -> String {
        let found = plan
            .models
            .iter()
            .find(|choice| choice.what == "populations");
        let choice = found.unwrap();
        format!("{}; {}", choice.model, choice.reason)
    }

    #[test]
    fn features_without_collisions_in_f32_are_refused() {
        // The cavity in 3-D.
        let cavity = [
            "domain={\"size\": [0.01, 0.01, 0.01], \"spacing\": 5e-4}",
            "fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity=[0.01, 0, 0]",
            "probes=[]",
        ];
        let cumulants = "fluid.lattice_boltzmann.collision={\"cumulant\": {}}";
        let eddies = "fluid.lattice_boltzmann.turbulence={\"smagorinsky\": {}}";
        for (example, set, expected) in [
            (
                "cavity",
                [cavity.as_slice(), &[cumulants]].concat(),
                "the collision cumulant",
            ),
            (
                "cavity",
                [cavity.as_slice(), &[eddies]].concat(),
                "an eddy viscosity",
            ),
            ("dam-break", Vec::new(), "a free surface"),
            (
                "settling-disc",
                vec!["coupling={\"partially_saturated\": {}}"],
                "partially saturated cells",
            ),
        ] {
            let problems = planned(example, &[&[IN_F32], &set[..]].concat());
            let problems = problems.err().unwrap_or_default();
            let of_f32 = |problem: &&Problem| {
                problem.path == "fluid.lattice_boltzmann.arithmetic"
                    && problem.severity == Severity::Error
            };
            let found = problems.iter().find(of_f32);
            let named = found.is_some_and(|problem| problem.reason.contains(expected));
            assert!(named, "{example} {set:?}: {problems:?}");
        }
        assert!(planned("cavity", &[&cavity[..], &[IN_F32]].concat()).is_ok());
    }

    #[test]
    fn populations_follow_the_collisions() {
        let plan = planned("couette", &[IN_F32]).unwrap();
        assert!(reason(&plan).contains("f32, deviations from rest; "));
        assert!(reason(&plan).contains("arithmetic in f32"));
        let problems = planned("couette", &[IN_F32, "fluid.lattice_boltzmann.storage=f64"]);
        let problems = problems.err().unwrap();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(problems[0].path, "fluid.lattice_boltzmann.storage");
        let memory = |set: &[&str]| planned("cavity", set).unwrap().estimate.memory_bytes;
        assert!(memory(&[IN_F32]) < memory(&[]));
    }

    /// Checks the warning about rounding: the number of roundings grows with the square of the number of cells between
    /// walls and with the inverse of the viscosity.
    #[test]
    fn rounding_that_counts_is_a_warning() {
        let warned = |set: &[&str]| {
            let plan = planned("cavity", &[&[IN_F32], set].concat()).unwrap();
            let path = "fluid.lattice_boltzmann.arithmetic";
            plan.warnings.iter().any(|problem| problem.path == path)
        };
        assert!(!warned(&["domain.spacing=2e-4"]));
        assert!(warned(&[
            "domain.spacing=2e-5",
            "fluid.lattice_boltzmann.lattice_velocity=0.02"
        ]));
    }
}
