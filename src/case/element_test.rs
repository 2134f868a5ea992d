//! Element tests: a sample between walls, as in a laboratory, and the requested results.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Test of a sample between two opposite planes, as in a laboratory: oedometer, triaxial and biaxial test, unconfined
/// compression, shear. The results follow from the records of probes, all with the same `every`; `summary.json` and the
/// table at the end contain each result with its interval, and name a peak that is the last reading (`peak_at_end`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElementTest {
    /// Probes `wall_load` of the two planes that face each other along the axis of the test.
    pub axial: [String; 2],
    /// Probes `wall_load` of walls across other axes, for the lateral stress.
    #[serde(default)]
    pub lateral: Vec<String>,
    /// Probe `grains` for the lateral stress, where the sample has no walls there.
    #[serde(default)]
    pub inside: Option<String>,
    /// Time from which answers count [s]. The strain is 0 at the first sample from then.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub from: f64,
    /// Answers in the order of the table.
    pub answers: Vec<TestAnswer>,
}

/// A result of an element test. It is the mean of all measurements of the quantity, and its interval is their range:
/// the two planes of the axis, each lateral wall or component. Around a sample in equilibrium all walls measure the
/// same value, so that the interval shows the lack of equilibrium.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TestAnswer {
    /// Quantity that the test measures.
    pub quantity: TestQuantity,
    /// Value with which the answer is compared, in the unit of the quantity. Default: none.
    #[serde(default)]
    pub known: Option<f64>,
    /// Source of the known value.
    #[serde(default)]
    pub source: Option<String>,
}

/// Quantity of an element test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum TestQuantity {
    /// Normal stress on the planes at the end [Pa].
    AxialStress,
    /// Shortening between the planes, from the first sample to the end, over their distance at the first sample [1].
    AxialStrain,
    /// Change of the axial stress from the first sample to the end over that of the axial strain [Pa].
    SecantModulus,
    /// Largest axial stress [Pa].
    Strength,
    /// Largest ratio of the axial to the lateral stress [1].
    PeakStressRatio,
    /// Angle of friction of the largest stress ratio R, asin((R - 1)/(R + 1)) [degrees].
    PeakFrictionAngle,
    /// Ratio of the lateral to the axial stress at the end [1].
    LateralStressRatio,
    /// Largest ratio of the shear to the normal stress on the planes [1].
    PeakShearRatio,
}

impl TestQuantity {
    /// Returns the name and the unit.
    #[must_use]
    pub fn name_and_unit(self) -> (&'static str, &'static str) {
        match self {
            Self::AxialStress => ("axial_stress", "Pa"),
            Self::AxialStrain => ("axial_strain", "-"),
            Self::SecantModulus => ("secant_modulus", "Pa"),
            Self::Strength => ("strength", "Pa"),
            Self::PeakStressRatio => ("peak_stress_ratio", "-"),
            Self::PeakFrictionAngle => ("peak_friction_angle", "degrees"),
            Self::LateralStressRatio => ("lateral_stress_ratio", "-"),
            Self::PeakShearRatio => ("peak_shear_ratio", "-"),
        }
    }

    /// Returns `true` if the quantity needs a lateral stress.
    #[must_use]
    pub fn is_lateral(self) -> bool {
        matches!(
            self,
            Self::PeakStressRatio | Self::PeakFrictionAngle | Self::LateralStressRatio
        )
    }
}
