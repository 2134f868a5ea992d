//! A contact law requires one file and one line: a list with the linear law and a toy law, from the text of a case
//! to a collision of two spheres.

mod toy;

use approx::assert_relative_eq;
use nalgebra::Vector3;
use serde_json::json;

use super::bridges::Bridged;
use super::family::{CriticalTimeStep, Family, Visitor};
use super::rolling::Rolling;
use super::*;
use crate::{Body, Dem, DemSettings, GrainDomain, Motion, Particles, Volume, alone};
use base::error::{Remedy, Report};

family! {
    dispatch each_input;
    /// Contact laws of this test: the linear law and a law that exists only here.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Contact: dyn ContactParameters<Law> {
        Linear(linear::LinearInput),
        Toy(toy::Input),
    }
}

family! {
    dispatch each_resolved;
    /// Laws that the choices resolve to.
    #[derive(Clone, Debug, PartialEq)]
    enum Law: dyn ContactModel, from {
        Linear(linear::Linear),
        RollingLinear(Rolling<linear::Linear>),
        BridgedLinear(Bridged<linear::Linear>),
        BridgedRollingLinear(Bridged<Rolling<linear::Linear>>),
        Toy(toy::Toy),
    }
}

impl Family for Law {
    fn visit<S: Space, V: Visitor<S>>(&self, visitor: V) -> V::Output {
        each_resolved!(self, law => visitor.visit(law))
    }
}

/// Collector of the paths of all findings.
#[derive(Default)]
struct Paths(Vec<String>);

impl Report for Paths {
    fn error(&mut self, path: &str, _: String, _: Remedy) {
        self.0.push(path.into());
    }

    fn unknown_material(&mut self, path: &str, _: &str, _: &[&str]) {
        self.0.push(path.into());
    }
}

fn glass() -> [MaterialFacts; 1] {
    [MaterialFacts {
        name: "glass".into(),
        ..MaterialFacts::default()
    }]
}

fn facts(materials: &[MaterialFacts], bond_at_start: bool) -> SceneFacts<'_> {
    SceneFacts {
        dimension: 3,
        materials,
        polyhedra: false,
        grains: Preparation::Listed,
        bond_at_start,
        fastest_approach: 1.0,
        saturated_cells: false,
    }
}

fn resolved(contact: serde_json::Value) -> Law {
    let contact: Contact = serde_json::from_value(contact).unwrap();
    let mut report = Paths::default();
    let input = contact.model();
    let law = input.resolve(&facts(&glass(), false), &mut report);
    assert_eq!(report.0, Vec::<String>::new());
    assert!(input.local_damping() <= 0.0 && !input.of_polyhedra() && input.states_friction());
    law.unwrap()
}

#[test]
fn the_schema_and_the_findings_know_a_law_by_its_line() {
    let schema = serde_json::to_string(&schemars::schema_for!(Contact)).unwrap();
    assert!(schema.contains("\"toy\"") && schema.contains("exclusiveMinimum"));
    let contact: Contact = serde_json::from_value(json!({"toy": {"stiffness": 1e9}})).unwrap();
    let mut report = Paths::default();
    let _ = contact.model().resolve(&facts(&glass(), true), &mut report);
    assert_eq!(report.0, ["grains.bond_at_start"]);
}

#[test]
fn a_toy_is_described_limited_and_stepped() {
    let mut law = resolved(json!({"toy": {"stiffness": 1e9}}));
    assert_eq!(law.model().describe(), "a toy");
    assert!(!law.model().bonds());
    each_resolved!(&mut law, law => law.prepare(None, Some(0.5)));
    let bodies = [1, 2].map(|id| Body::uniform::<Volume>(id, 1e-3, 2500.0, 0));
    let mass = bodies[0].mass;
    let critical = Family::visit::<Volume, _>(
        &law,
        CriticalTimeStep {
            grains: &bodies,
            materials: 1,
        },
    );
    assert_relative_eq!(critical, (mass / 2e5).sqrt(), max_relative = 1e-12);
    let limits = law.model().time_limits(0, [1e-3; 2], mass);
    assert_relative_eq!(limits.shorter(), 2.0 * critical, max_relative = 1e-12);

    let region = GrainDomain::closed(Vector3::repeat(-0.1), Vector3::repeat(0.1), 1e-3);
    let settings = DemSettings::new(region, 1e-3 * critical, 1e-4);
    let mut dem = Dem::of_family(&law, settings, Vec::new()).unwrap();
    let mut particles = Particles::<Volume>::new();
    for (body, sign) in bodies.into_iter().zip([-1.0, 1.0]) {
        let motion = Motion {
            position: Vector3::x() * (sign * 1e-3),
            velocity: Vector3::x() * (sign * -0.1),
            ..Motion::default()
        };
        particles.insert(body, motion);
    }
    let overlap = |particles: &Particles<Volume>| 2e-3 - 2.0 * particles.motion[1].position.x;
    let mut deepest = 0.0_f64;
    while particles.motion[1].velocity.x < 0.0 || overlap(&particles) > 0.0 {
        dem.advance(&mut particles, &alone()).unwrap();
        deepest = deepest.max(overlap(&particles));
        assert!(dem.steps() < 100_000);
    }
    // Two masses of 0.1 m/s each: k/3 overlap³ = m v².
    let expected = (3.0 * mass * 0.01 / 1e9).cbrt();
    assert_relative_eq!(deepest, expected, max_relative = 1e-4);
    assert_relative_eq!(particles.motion[1].velocity.x, 0.1, max_relative = 1e-6);
}

/// Checks that pairs of materials must be named, known and given once, and that an override applies to the law of its
/// list.
#[test]
fn overrides_of_pairs_are_checked() {
    let pair = json!({"materials": ["glass", "glass"], "friction_angle_degrees": 45});
    let law = |pairs: Vec<serde_json::Value>| {
        json!({"linear": {"normal_stiffness": {"absolute": 1e5},
        "rolling": {"friction": 0.1}, "pairs": pairs}})
    };
    let rolling = resolved(law(vec![pair.clone()]));
    assert!(matches!(rolling, Law::RollingLinear(_)));
    assert_relative_eq!(rolling.model().friction([0, 0]), 1.0, max_relative = 1e-12);
    let wrong = json!({"materials": ["glass", "brass"], "cohesion": {"absolute": 1}});
    let contact: Contact = serde_json::from_value(law(vec![pair.clone(), wrong, pair])).unwrap();
    let mut report = Paths::default();
    let _ = contact
        .model()
        .resolve(&facts(&glass(), false), &mut report);
    assert_eq!(
        report.0,
        [
            "contact.linear.pairs[1].materials[1]",
            "contact.linear.pairs[2].materials"
        ]
    );
}
