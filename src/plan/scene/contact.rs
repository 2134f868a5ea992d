//! Contact law of a scene, and the properties of the scene that its resolution needs.

use super::Scene;
use super::findings::Findings;
use super::grains::{GrainSource as Resolved, Grains};
use super::has_grains;
use super::has_polyhedra;
use super::motion::first_and_largest;
use base::error::Remedy;
use base::number::to_u32;
use base::vector::norm;
use case::Case;
use case::fluid::Fluid;
use case::grains::GrainSource;
use case::solids::Motion;
use dem::contact::{
    ContactModel, Depth, Law, MaterialFacts, Preparation, SceneFacts, StaticContact,
};
use serde::Serialize;

/// Contact law of a scene with its parameters for every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactTable {
    /// Law; materials are given by their indices in [`super::Scene::materials`].
    pub law: Law,
    /// Local damping: a force of this fraction of the force on a grain opposes its motion; 0 switches it off.
    pub local_damping: f64,
}

impl ContactTable {
    /// Returns the law as an interface for plan, preparation and outputs.
    #[must_use]
    pub fn model(&self) -> &dyn ContactModel {
        self.law.model()
    }

    /// Returns `true` if no contact has a dashpot and only friction dissipates energy in an impact.
    #[must_use]
    pub fn is_elastic(&self) -> bool {
        let law = self.model();
        let damped = law.blocks().is_some_and(|blocks| blocks.mass_damping > 0.0);
        let no_dashpot = |materials| {
            let contact = StaticContact {
                materials,
                diameter: 1.0,
                radius: 0.5,
                mass: 1.0,
                overlap: Some(1e-3),
                depth: Depth::Start,
                bonded: false,
            };
            law.springs(&contact).dashpots[0] == 0.0
        };
        let all = 0..law.materials();
        let mut pairs = all.clone().flat_map(|a| all.clone().map(move |b| [a, b]));
        self.local_damping == 0.0 && !damped && pairs.all(no_dashpot)
    }

    pub(crate) fn resolve(
        case: &Case,
        sample: Option<&Grains>,
        saturated_cells: bool,
        findings: &mut Findings,
    ) -> Option<Self> {
        let written = case.contact.as_ref()?;
        let materials: Vec<MaterialFacts> = case
            .materials
            .iter()
            .map(|(name, material)| MaterialFacts {
                name: name.clone(),
                young_modulus: material.young_modulus,
                poisson_ratio: material.poisson_ratio,
            })
            .collect();
        let grains = case.grains.as_ref();
        let facts = SceneFacts {
            dimension: case.domain.size.0.len(),
            materials: &materials,
            polyhedra: has_polyhedra(case),
            grains: match grains.map(|grains| &grains.initial) {
                Some(GrainSource::Growth(_)) => Preparation::Growth,
                Some(GrainSource::Deposition(deposition)) => Preparation::Deposition {
                    softened: deposition.falling_stiffness.is_some(),
                },
                Some(GrainSource::File { .. } | GrainSource::List(_)) | None => Preparation::Listed,
            },
            bond_at_start: grains.is_some_and(|grains| grains.bond_at_start),
            fastest_approach: fastest_approach(case, sample),
            saturated_cells,
        };
        let law = written.model().resolve(&facts, findings)?;
        let path = "grains.bond_at_start";
        if facts.bond_at_start && !law.model().bonds() && !findings.wrong_in(&[path]) {
            findings.error(
                path,
                "the contact law of this case does not support bonds",
                Remedy::from("write false, or use contact_bond or cohesive_frictional")
                    .set(path, false),
            );
        }
        let drains =
            matches!(&case.fluid, Some(Fluid::Darcy(darcy)) if darcy.unsaturated.is_some());
        if let Some(path) = law.model().moisture().filter(|_| !drains) {
            findings.error(
                &path,
                "this depends on the moisture of the ground, and no part of this case computes it",
                Remedy::take_out("add `fluid.darcy.unsaturated`, or remove it", &path),
            );
        }
        Some(Self {
            law,
            local_damping: written.model().local_damping(),
        })
    }
}

/// Warns of a law without friction if solids may touch.
pub(crate) fn warn_of_friction(case: &Case, findings: &mut Findings) {
    let solids = has_grains(case) || case.blocks.is_some() || !case.bodies.is_empty();
    if solids
        && case
            .contact
            .as_ref()
            .is_some_and(|law| !law.model().states_friction())
    {
        findings.warn(
            "contact",
            "the contact law has no friction angle: the contacts have no friction, although real solids do",
            "set friction_angle_degrees to the measured value, or to 0 for contacts without friction",
        );
    }
}

impl Scene {
    /// Returns the contact law of a scene; a law without forces if nothing can touch.
    #[must_use]
    pub fn contact_law(&self) -> Law {
        self.contact.as_ref().map_or_else(
            || Law::without_forces(to_u32(self.materials.len())),
            |contact| contact.law.clone(),
        )
    }
}

/// Returns an upper bound of the speed [m/s] at which two bodies of a case approach each other: the two largest
/// initial speeds plus that of a fall through the domain.
pub(crate) fn fastest_approach(case: &Case, sample: Option<&Grains>) -> f64 {
    let mut speeds = vec![0.0, 0.0];
    for body in &case.bodies {
        let (velocity, table) = match &body.motion {
            Motion::Free { velocity, .. } => (velocity, None),
            Motion::Driven {
                velocity, history, ..
            } => (velocity, history.as_ref()),
            Motion::Fixed {} => continue,
        };
        let [_, factor] = first_and_largest(table);
        speeds.extend(velocity.as_ref().map(|v| factor * norm(v.to_array())));
    }
    if let Some(Resolved::List(grains) | Resolved::File { grains, .. }) =
        sample.map(|grains| &grains.source)
    {
        let moving = grains.iter().map(|grain| norm(grain.velocity));
        speeds.extend(moving.filter(|speed| *speed > 0.0));
    }
    speeds.extend(case.walls.iter().filter_map(|wall| {
        let [_, factor] = first_and_largest(wall.history.as_ref());
        Some(factor * norm(wall.velocity.as_ref()?.to_array()))
    }));
    let servos = case.walls.iter().filter_map(|wall| wall.servo.as_ref());
    speeds.extend(servos.map(|servo| servo.velocity_limit));
    speeds.sort_by(|a, b| b.total_cmp(a));
    let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| g.to_array());
    let extent = case.domain.size.to_array();
    let fall: f64 = (0..3).map(|a| 2.0 * gravity[a].abs() * extent[a]).sum();
    let fastest = speeds[0] + speeds[1] + fall.sqrt();
    // If nothing moves or falls, use a millimetre per second.
    if fastest > 0.0 { fastest } else { 1e-3 }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    #[test]
    fn a_law_without_any_damping_is_elastic() {
        for (damping, elastic) in [
            ("", true),
            (r#", "normal_damping_ratio": 0.0"#, true),
            (r#", "normal_damping_ratio": 0.1"#, false),
            (r#", "local_damping": 0.2"#, false),
        ] {
            let text = format!(
                r#"{{"domain": {{"size": [1, 1, 1]}}, "materials": {{"glass": {{"density": 2500}}}},
                "bodies": [{{"name": "ball", "shape": {{"sphere": {{"radius": 0.1}}}}, "position": [0.5, 0.5, 0.5],
                    "motion": {{"free": {{}}}}, "material": "glass"}}],
                "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e5}},
                "friction_angle_degrees": 20{damping}}}}},
                "time": {{"end": 0.01}}}}"#
            );
            let document = Document::read(&text, &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let contact = plan.scene.contact.as_ref().unwrap();
            assert_eq!(contact.is_elastic(), elastic, "{damping}");
            let says = |choice: &crate::models::Choice| choice.what == "contact damping";
            assert_eq!(plan.models.iter().any(says), elastic, "{damping}");
        }
    }
}
