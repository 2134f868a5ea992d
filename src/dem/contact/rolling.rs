//! Rolling resistance in addition to another law: the elastic-plastic spring-dashpot model, type C of Ai et al.
//!
//! ```text
//! M_k = cut(M_k' - k_r roll dt)          cut to length M_m = mu_r R_r max(F_n, 0)
//! M_d = -c_r roll                        where the spring is below M_m, else 0
//! k_r = 2.25 k_n mu_r² R_r²,             c_r = eta 2 sqrt(I_r k_r)
//! ```
//!
//! `roll` is the spin of the second body relative to the first without its part along the normal,
//! `R_r = r1 r2/(r1 + r2)`, and `I_r = (1/I1 + 1/I2)^-1` with the moments of inertia about the contact point. Against a
//! wall `R_r` and `I_r` are the grain's. `M_k'` is the spring's moment of the last step, rotated with the contact.
//! Equal and opposite moments act on both bodies, so that angular momentum is conserved.
//!
//! Source: J. Ai, J.-F. Chen, J. M. Rotter, J. Y. Ooi, Powder Technology 206 (2011) 269,
//! doi:10.1016/j.powtec.2010.09.030.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::{Components, Space};
use super::wrapped::{
    bonds_of_law_below, limits_of_law_below, model_of_law_below, springs_of_law_below,
};
use super::{ContactForce, ContactKinematics, ContactLaw, ContactModel, PairProperties, PairTable};

/// Resistance to rolling as an elastic-plastic spring-dashpot: type C of Ai, Chen, Rotter and Ooi (2011).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Rolling")]
pub struct RollingParameters {
    /// Coefficient of rolling friction \[1\]: the moment is at most this times the rolling radius times the normal
    /// force. It is the tangent of the slope on which a grain begins to roll.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// Dashpot in parallel with the rolling spring, as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub damping_ratio: f64,
}

/// Contact law with resistance to rolling: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rolling<L> {
    /// Law of normal and shear forces.
    pub law: L,
    /// Parameters per pair of materials.
    pub parameters: PairTable<RollingParameters>,
}

impl<L: ContactModel> Rolling<L> {
    /// Returns a law with the same resistance to rolling for all pairs.
    #[must_use]
    pub fn everywhere(law: L, parameters: RollingParameters) -> Self {
        Self {
            parameters: PairTable::uniform(law.materials(), parameters),
            law,
        }
    }
}

/// Everything except the description is that of the underlying law: the rolling spring does not shorten the time
/// step.
impl<L: ContactModel> ContactModel for Rolling<L> {
    fn describe(&self) -> String {
        format!("{}, resistance to rolling", self.law.describe())
    }

    fn moisture(&self) -> Option<String> {
        self.law.moisture()
    }

    model_of_law_below!();
    limits_of_law_below!();
}

/// Values per pair: those of the underlying law, lever arm of the limit \[m\], and rolling dashpot [N m s].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingScale<C> {
    law: C,
    lever: f64,
    dashpot: f64,
}

/// Values per pair: those of the underlying law, rolling stiffness [N m], dashpot [N m s], and lever arm of the
/// limit \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingConstants<C> {
    law: C,
    stiffness: f64,
    dashpot: f64,
    lever: f64,
}

/// History of the underlying law, and the moment of the rolling spring [N m] on the second partner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RollingHistory<M, S: Space> {
    law: M,
    moment: S::Spin,
}

impl<S: Space, L: ContactLaw<S>> ContactLaw<S> for Rolling<L> {
    type Row = (L::Row, RollingParameters);
    type Scale = RollingScale<L::Scale>;
    type Constants = RollingConstants<L::Constants>;
    type History = RollingHistory<L::History, S>;
    const NUMBERS: usize = L::NUMBERS + S::Spin::COUNT;
    const HAS_ROLLING: bool = true;
    const SPATIAL: bool = L::SPATIAL;
    const NEEDS_MOISTURE: bool = L::NEEDS_MOISTURE;

    fn table(&self) -> PairTable<Self::Row> {
        // The index in both tables is the same, because they have the same materials.
        let laws = self.law.table();
        let mut table = laws.map(|law| (*law, *self.parameters.get(0, 0)));
        laws.for_each_pair(|a, b, law| table.set(a, b, (*law, *self.parameters.get(a, b))));
        table
    }

    fn scale((row, p): &Self::Row, pair: &PairProperties) -> RollingScale<L::Scale> {
        let scale = L::scale(row, pair);
        let law = L::constants(row, &scale, pair.diameter);
        let lever = p.friction * pair.rolling_radius;
        let stiffness = 2.25 * L::stiffness(&law)[0] * lever * lever;
        RollingScale {
            law: scale,
            lever,
            dashpot: 2.0 * p.damping_ratio * (pair.rolling_inertia * stiffness).sqrt(),
        }
    }

    #[inline(always)]
    fn constants(
        row: &Self::Row,
        scale: &RollingScale<L::Scale>,
        diameter: f64,
    ) -> Self::Constants {
        let law = L::constants(&row.0, &scale.law, diameter);
        RollingConstants {
            law,
            stiffness: 2.25 * L::stiffness(&law)[0] * scale.lever * scale.lever,
            dashpot: scale.dashpot,
            lever: scale.lever,
        }
    }

    #[inline(always)]
    fn force(
        c: &Self::Constants,
        history: &mut Self::History,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let force = L::force(&c.law, &mut history.law, kinematics);
        let roll = S::rolling(&kinematics.roll, &kinematics.normal);
        let spring = S::turn_moment(&history.moment, &kinematics.normal)
            - roll * (c.stiffness * kinematics.time_step);
        let (length, limit) = (spring.length(), c.lever * force.normal.max(0.0));
        let moment = if length > limit {
            history.moment = spring * (limit / length);
            history.moment
        } else {
            history.moment = spring;
            spring - roll * c.dashpot
        };
        ContactForce { moment, ..force }
    }

    fn save(history: &Self::History, numbers: &mut Vec<f64>) {
        L::save(&history.law, numbers);
        for k in 0..S::Spin::COUNT {
            numbers.push(history.moment.get(k));
        }
    }

    fn load(numbers: &[f64]) -> Self::History {
        let mut moment = S::Spin::default();
        for k in 0..S::Spin::COUNT {
            moment.set(k, numbers.get(L::NUMBERS + k).copied().unwrap_or(0.0));
        }
        RollingHistory {
            law: L::load(numbers),
            moment,
        }
    }

    springs_of_law_below!(L, law);
    bonds_of_law_below!(L, law);
}

impl<S: Space, L: ContactLaw<S> + 'static> Bodies<S> for Rolling<L> {
    type Scratch = ();
}
