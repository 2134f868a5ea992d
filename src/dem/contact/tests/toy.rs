//! A toy law: a spring whose force is proportional to the square of the overlap, without friction: `F_n = k
//! overlap²`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::contact::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters, PairProperties,
    PairTable, SceneFacts, Springs, StaticContact, TimeLimits,
};
use crate::engine::bodies::Bodies;
use crate::space::Space;
use base::error::Report;

/// Parameters of the toy law in a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Input {
    /// Stiffness k [N/m2].
    #[schemars(extend("exclusiveMinimum" = 0))]
    stiffness: f64,
    /// Largest expected overlap [m].
    #[serde(default = "deepest")]
    deepest: f64,
}

fn deepest() -> f64 {
    1e-4
}

impl<F: From<Toy>> ContactParameters<F> for Input {
    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        if scene.bond_at_start {
            report.error(
                "grains.bond_at_start",
                "toys have no bonds".into(),
                "remove it".into(),
            );
        }
        let parameters = PairTable::uniform(scene.material_count(), self.clone());
        Some(Toy { parameters }.into())
    }
}

/// Minimal law with its parameters for every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Toy {
    parameters: PairTable<Input>,
}

impl ContactModel for Toy {
    fn describe(&self) -> String {
        "a toy".into()
    }

    fn materials(&self) -> u32 {
        self.parameters.materials()
    }

    fn friction(&self, _: [u32; 2]) -> f64 {
        0.0
    }

    fn normal_stiffness(&self, [a, b]: [u32; 2], diameter: f64) -> f64 {
        2e-4 * diameter * self.parameters.get(a, b).stiffness
    }

    fn prepare(&mut self, _: Option<f64>, _: Option<f64>) {}

    fn springs(&self, contact: &StaticContact) -> Springs {
        let [a, b] = contact.materials;
        let toy = self.parameters.get(a, b);
        let overlap = contact.overlap.unwrap_or(toy.deepest);
        let stiffness = [2.0 * toy.stiffness * overlap, 0.0];
        Springs::damped(stiffness, false, ([0.0; 2], 1.0), contact.mass)
    }

    fn time_limits(&self, material: u32, _: [f64; 2], mass: f64) -> TimeLimits {
        let pairs = self.parameters.rows_of(material);
        let stiffest = pairs.map(|toy| 2.0 * toy.stiffness * toy.deepest);
        TimeLimits::of_spring(mass, stiffest.fold(0.0, f64::max))
    }
}

impl<S: Space> ContactLaw<S> for Toy {
    type Row = [f64; 2];
    type Scale = ();
    type Constants = [f64; 2];
    type History = ();
    const NUMBERS: usize = 0;

    fn table(&self) -> PairTable<Self::Row> {
        self.parameters.map(|toy| [toy.stiffness, toy.deepest])
    }

    fn scale(_: &Self::Row, _: &PairProperties) {}

    fn constants(row: &Self::Row, (): &(), _: f64) -> Self::Constants {
        *row
    }

    fn force(
        [stiffness, _]: &Self::Constants,
        (): &mut (),
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        ContactForce {
            normal: stiffness * kinematics.overlap * kinematics.overlap,
            tangent: S::Tangent::default(),
            moment: S::Spin::default(),
            failure: None,
        }
    }

    fn shear_spring((): &()) -> S::Tangent {
        S::Tangent::default()
    }

    fn stiffness([stiffness, deepest]: &Self::Constants) -> [f64; 2] {
        [2.0 * stiffness * deepest, 0.0]
    }

    fn save((): &(), _: &mut Vec<f64>) {}

    fn load(_: &[f64]) {}
}

impl<S: Space> Bodies<S> for Toy {
    type Scratch = ();
}
