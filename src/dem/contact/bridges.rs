//! Capillary bridges of water between spheres in addition to another law: the force of Willett et al.
//!
//! ```text
//! F_n = F_n(law) - F,   F = 2 pi R gamma f(S) exp[f1 - f2 exp(f3 ln s + f4 (ln s)^2)],   s = gap/(2 R sqrt(V*))
//! gap of rupture = R (1 + theta/2)(V*^(1/3) + V*^(2/3)/10),                              V* = V/R^3
//! ```
//!
//! `R = 2 r1 r2/(r1 + r2)` is the mean radius of Derjaguin, at a wall `2 r`. `f1` to `f4` are polynomials in `ln V*`
//! with coefficients that depend on the contact angle `theta`. A bridge forms where two surfaces touch, acts while they
//! overlap (with the force at contact) and across a gap, and breaks at the gap of rupture. It then forms again only at
//! the next contact, so that a cycle of approach and separation dissipates the integral of F over the gap.
//!
//! The volume of a bridge is stated, or follows from the moisture of the ground: grains of one size with z bridges
//! each, which share the water `w` per volume of grains, have `V* = 8 pi w/(3 z)`. The fit holds from V* = 0.001 to 0.1
//! and up to a contact angle of 50 degrees. Below this range there is no bridge; above it the force is that of its end.
//! With more water bridges merge and lose their suction: `f(S)` falls linearly from 1 at the degree of saturation of
//! merging to 0 at 1.
//!
//! Limits: against a numerical solution of the equation of Young and Laplace the fit is within 1 % between 0.1 and 0.8
//! of the gap of rupture, up to 3 % low at contact, and up to 8 % high at 0.9. The mean radius of Derjaguin is exact
//! for small bridges. Viscosity and weight of the bridge, the hysteresis of the contact angle and the exchange of
//! water between bridges are not modelled.
//!
//! Sources: C. D. Willett, M. J. Adams, S. A. Johnson, J. P. K. Seville, Langmuir 16 (2000) 9396,
//! doi:10.1021/la000657y (appendix); gap of rupture with the leading term of G. Lian, C. Thornton, M. J. Adams,
//! J. Colloid Interface Sci. 161 (1993) 138, doi:10.1006/jcis.1993.1452.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::Space;
use super::input::pair_table;
use super::wrapped::{model_of_law_below, springs_of_law_below};
use super::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, PairProperties, PairTable,
    SceneFacts, TimeLimits,
};
use base::error::{Remedy, Report};

/// Capillary bridges of water between spheres in contact, and between spheres and walls (3-D only): Willett, Adams,
/// Johnson and Seville (2000).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Bridges")]
pub struct BridgesInput {
    /// Surface tension of the water [N/m]. Default: 0.0728, pure water at 20 °C.
    #[serde(default = "water")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tension: f64,
    /// Contact angle of the water on the grains \[degrees\]. Default: 0, clean quartz.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub contact_angle_degrees: f64,
    /// Volume of the bridges.
    pub volume: BridgeVolume,
    /// Pairs of materials with another surface tension or contact angle; a surface tension of 0 means no bridges.
    #[serde(default)]
    pub pairs: Vec<BridgePair>,
}

fn water() -> f64 {
    0.0728
}

/// Volume of a bridge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BridgeVolume {
    /// Volume over the cube of the mean radius R = 2 r1 r2/(r1 + r2), at a wall R = 2 r \[1\].
    Ratio(#[schemars(range(min = 0.001, max = 0.1))] f64),
    /// Volume from the water in the cell of the grains: needs `fluid.darcy.unsaturated`.
    Moisture(BridgeMoisture),
}

/// Volume of a bridge in unsaturated ground: the water of a cell is divided among the bridges of its grains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BridgeMoisture {
    /// Mean number of bridges of a grain \[1\].
    #[serde(default = "six")]
    #[schemars(range(min = 1.0, max = 20.0))]
    pub bridges_per_grain: f64,
    /// Degree of saturation at which bridges begin to merge \[1\]: the force falls linearly from there to 0 at
    /// saturation.
    #[serde(default = "pendular")]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub merging_saturation: f64,
}

fn six() -> f64 {
    6.0
}

fn pendular() -> f64 {
    0.3
}

/// Bridges of one pair of materials; fields that are left out keep the values above.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BridgePair {
    /// Names of the two materials, in either order.
    pub materials: [String; 2],
    /// Surface tension [N/m]; 0 for no bridges.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tension: Option<f64>,
    /// Contact angle \[degrees\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 50.0))]
    pub contact_angle_degrees: Option<f64>,
}

impl BridgesInput {
    /// Returns `law` with these bridges; reports a finding and returns none in 2-D. `path` is the path of the bridges
    /// in the case.
    pub(super) fn on<L: ContactModel>(
        &self,
        law: L,
        path: &'static str,
        scene: &SceneFacts<'_>,
        report: &mut dyn Report,
    ) -> Option<Bridged<L>> {
        if scene.dimension == 2 {
            report.error(
                path,
                "capillary bridges act between spheres only: there is no fit of their force for discs in 2-D".into(),
                Remedy::take_out("remove it, or use a domain of three dimensions", path),
            );
            return None;
        }
        let base = BridgeParameters {
            surface_tension: self.tension,
            contact_angle: self.contact_angle_degrees.to_radians(),
            volume: self.volume,
        };
        let parameters = pair_table(
            (path, scene),
            PairTable::uniform(scene.material_count(), base),
            (&self.pairs, |pair| &pair.materials),
            report,
            |_, pair, _, _| BridgeParameters {
                surface_tension: pair.tension.unwrap_or(base.surface_tension),
                contact_angle: pair
                    .contact_angle_degrees
                    .map_or(base.contact_angle, f64::to_radians),
                ..base
            },
        );
        Some(Bridged {
            law,
            parameters,
            path,
        })
    }
}

/// Bridges of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BridgeParameters {
    /// Surface tension gamma [N/m].
    pub surface_tension: f64,
    /// Contact angle theta \[rad\].
    pub contact_angle: f64,
    /// Volume of a bridge.
    pub volume: BridgeVolume,
}

/// Range of V* in which the fit holds.
const RANGE: [f64; 2] = [0.001, 0.1];

impl BridgeParameters {
    /// Returns the smallest and the largest V* of a bridge.
    fn volumes(&self) -> [f64; 2] {
        match self.volume {
            BridgeVolume::Ratio(ratio) => [ratio; 2],
            BridgeVolume::Moisture(_) => RANGE,
        }
    }

    /// Returns the largest slope of the force over the gap [N/m]; it does not depend on the radius.
    #[must_use]
    pub fn steepest(&self) -> f64 {
        const POINTS: u32 = 400;
        let row = self.row();
        let ratio = self.volumes()[0];
        let reach = row.fit.rupture(ratio);
        let force = |n: u32| {
            row.tension
                * row
                    .fit
                    .force(ratio, reach * f64::from(n) / f64::from(POINTS))
        };
        let step = reach / f64::from(POINTS);
        (1..POINTS)
            .map(|n| (force(n + 1) - force(n)).abs() / step)
            .fold(0.0, f64::max)
    }

    fn row(&self) -> BridgeRow {
        let (ratio, per_moisture, merging) = match self.volume {
            BridgeVolume::Ratio(ratio) => (ratio, 0.0, 0.0),
            BridgeVolume::Moisture(m) => (
                0.0,
                8.0 * PI / (3.0 * m.bridges_per_grain),
                m.merging_saturation,
            ),
        };
        BridgeRow {
            tension: 2.0 * PI * self.surface_tension,
            ratio,
            per_moisture,
            merging,
            fit: Fit::new(self.contact_angle),
        }
    }
}

/// Fit of Willett et al. at a contact angle: coefficients of `f1` to `f4` as polynomials in `ln V*`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    polynomials: [[f64; 4]; 4],
    /// Factor of the gap of rupture, 1 + theta/2.
    wetting: f64,
}

/// Coefficients of the appendix: of 1, theta and theta² for each power of `ln V*`.
const COEFFICIENTS: [[[f64; 3]; 4]; 4] = [
    [
        [-0.44507, 0.050832, -1.1466],
        [-0.1119, -0.000411, -0.1490],
        [-0.012101, -0.0036456, -0.01255],
        [-0.0005, -0.0003505, -0.00029076],
    ],
    [
        [1.9222, -0.57473, -1.2918],
        [-0.0668, -0.1201, -0.22574],
        [-0.0013375, -0.0068988, -0.01137],
        [0.0, 0.0, 0.0],
    ],
    [
        [1.268, -0.01396, -0.23566],
        [0.198, 0.092, -0.06418],
        [0.02232, 0.02238, -0.009853],
        [0.0008585, 0.001318, -0.00053],
    ],
    [
        [-0.010703, 0.073776, -0.34742],
        [0.03345, 0.04543, -0.09056],
        [0.0018574, 0.004456, -0.006257],
        [0.0, 0.0, 0.0],
    ],
];

impl Fit {
    /// Returns the fit at a contact angle \[rad\].
    #[must_use]
    pub fn new(theta: f64) -> Self {
        let at = |[one, linear, square]: [f64; 3]| one + theta * (linear + theta * square);
        Self {
            polynomials: COEFFICIENTS.map(|polynomial| polynomial.map(at)),
            wetting: 1.0 + 0.5 * theta,
        }
    }

    /// Returns the force over `2 pi R gamma` of a bridge of volume `ratio` over R³ at a gap over R.
    #[must_use]
    #[inline]
    pub fn force(&self, ratio: f64, gap: f64) -> f64 {
        let v = ratio.ln();
        let [f1, f2, f3, f4] = self
            .polynomials
            .map(|[a, b, c, d]| a + v * (b + v * (c + v * d)));
        if gap <= 0.0 {
            return f1.exp();
        }
        let s = (0.5 * gap / ratio.sqrt()).ln();
        (f1 - f2 * (s * (f3 + f4 * s)).exp()).exp()
    }

    /// Returns the gap of rupture over R.
    #[must_use]
    #[inline]
    pub fn rupture(&self, ratio: f64) -> f64 {
        let root = ratio.cbrt();
        self.wetting * (root + 0.1 * root * root)
    }
}

/// Contact law with capillary bridges: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bridged<L> {
    /// Law of the contacts.
    pub law: L,
    /// Bridges per pair of materials.
    pub parameters: PairTable<BridgeParameters>,
    /// JSON path of the bridges.
    pub path: &'static str,
}

/// Springs, friction and bonds are those of the underlying law. A sample is prepared dry.
impl<L: ContactModel> ContactModel for Bridged<L> {
    fn describe(&self) -> String {
        format!("{}, capillary bridges", self.law.describe())
    }

    fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
        self.law.prepare(normal_stiffness, friction);
        for pair in self.parameters.rows_mut() {
            pair.surface_tension = 0.0;
        }
    }

    /// The slope of the force of a bridge limits the step like a spring.
    fn time_limits(&self, material: u32, radii: [f64; 2], mass: f64) -> TimeLimits {
        let own = self.law.time_limits(material, radii, mass);
        let pairs = self.parameters.rows_of(material);
        let steepest = pairs.map(BridgeParameters::steepest).fold(0.0, f64::max);
        TimeLimits {
            spring: own.spring.min(TimeLimits::of_spring(mass, steepest).spring),
            ..own
        }
    }

    fn bridges(&self) -> bool {
        true
    }

    fn moisture(&self) -> Option<String> {
        let by_moisture = |p: &BridgeParameters| matches!(p.volume, BridgeVolume::Moisture(_));
        self.parameters
            .rows()
            .any(by_moisture)
            .then(|| format!("{}.volume.moisture", self.path))
    }

    model_of_law_below!();
}

/// Bridges of a pair of materials: force per radius [N/m], V* without and per moisture, degree of saturation at which
/// bridges begin to merge, and the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeRow {
    tension: f64,
    ratio: f64,
    per_moisture: f64,
    merging: f64,
    fit: Fit,
}

impl BridgeRow {
    /// Returns V* and the factor of the force in ground of this moisture.
    #[inline(always)]
    fn water(&self, [saturation, water]: [f64; 2]) -> (f64, f64) {
        let ratio = (self.ratio + self.per_moisture * water).min(RANGE[1]);
        let left = (1.0 - saturation) / (1.0 - self.merging);
        (ratio, left.clamp(0.0, 1.0))
    }
}

/// Values per pair: those of the underlying law, and the mean radius \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeScale<C> {
    law: C,
    radius: f64,
}

/// Values per pair: those of the underlying law, the mean radius \[m\], and the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeConstants<C> {
    law: C,
    radius: f64,
    row: BridgeRow,
}

/// History of the underlying law, and the force of the bridge in the last step \[N\]; 0 without a bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BridgeHistory<M> {
    law: M,
    pull: f64,
}

impl<S: Space, L: ContactLaw<S>> ContactLaw<S> for Bridged<L> {
    type Row = (L::Row, BridgeRow);
    type Scale = BridgeScale<L::Scale>;
    type Constants = BridgeConstants<L::Constants>;
    type History = BridgeHistory<L::History>;
    const NUMBERS: usize = L::NUMBERS + 1;
    const SPATIAL: bool = true;
    const HAS_ROLLING: bool = L::HAS_ROLLING;
    const NEEDS_MOISTURE: bool = true;

    fn table(&self) -> PairTable<Self::Row> {
        let laws = self.law.table();
        let mut table = laws.map(|law| (*law, self.parameters.get(0, 0).row()));
        laws.for_each_pair(|a, b, law| table.set(a, b, (*law, self.parameters.get(a, b).row())));
        table
    }

    fn scale((row, _): &Self::Row, pair: &PairProperties) -> Self::Scale {
        BridgeScale {
            law: L::scale(row, pair),
            radius: 2.0 * pair.rolling_radius,
        }
    }

    #[inline(always)]
    fn constants(row: &Self::Row, scale: &Self::Scale, diameter: f64) -> Self::Constants {
        BridgeConstants {
            law: L::constants(&row.0, &scale.law, diameter),
            radius: scale.radius,
            row: row.1,
        }
    }

    #[inline(always)]
    fn force(
        c: &Self::Constants,
        history: &mut Self::History,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let touches = kinematics.overlap > 0.0;
        let force = if touches || L::holds(&history.law) {
            L::force(&c.law, &mut history.law, kinematics)
        } else {
            history.law = L::History::default();
            ContactForce::none()
        };
        let gap = (-kinematics.overlap).max(0.0) / c.radius;
        let (ratio, factor) = c.row.water(kinematics.moisture);
        let wet =
            (touches || history.pull > 0.0) && ratio >= RANGE[0] && gap < c.row.fit.rupture(ratio);
        history.pull = if wet {
            c.row.tension * c.radius * factor * c.row.fit.force(ratio, gap)
        } else {
            0.0
        };
        ContactForce {
            normal: force.normal - history.pull,
            ..force
        }
    }

    #[inline(always)]
    fn bonded(history: &Self::History) -> bool {
        L::bonded(&history.law)
    }

    #[inline(always)]
    fn holds(history: &Self::History) -> bool {
        history.pull > 0.0 || L::holds(&history.law)
    }

    fn bridge(history: &Self::History) -> f64 {
        history.pull + L::bridge(&history.law)
    }

    fn normal_spring(c: &Self::Constants, history: &Self::History, overlap: f64) -> f64 {
        let own = if overlap > 0.0 || L::holds(&history.law) {
            L::normal_spring(&c.law, &history.law, overlap)
        } else {
            0.0
        };
        own - history.pull
    }

    fn tangent_stiffness(c: &Self::Constants, overlap: f64) -> f64 {
        if overlap > 0.0 {
            L::tangent_stiffness(&c.law, overlap)
        } else {
            0.0
        }
    }

    fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
        // The mean radius is at most the largest diameter: at a wall.
        let radius = diameters[0].max(diameters[1]);
        let wet = self.parameters.rows().filter(|p| p.surface_tension > 0.0);
        wet.map(|p| radius * p.row().fit.rupture(p.volumes()[1]))
            .fold(self.law.widest_opening(diameters), f64::max)
    }

    fn save(history: &Self::History, numbers: &mut Vec<f64>) {
        L::save(&history.law, numbers);
        numbers.push(history.pull);
    }

    fn load(numbers: &[f64]) -> Self::History {
        BridgeHistory {
            law: L::load(numbers),
            pull: numbers.get(L::NUMBERS).copied().unwrap_or(0.0),
        }
    }

    springs_of_law_below!(L, law);
}

impl<S: Space, L: ContactLaw<S> + 'static> Bodies<S> for Bridged<L> {
    type Scratch = ();
}

#[cfg(test)]
mod tests;
