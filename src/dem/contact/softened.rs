//! Contact bonds that weaken as the ground gets wet: the strengths of the contact-bond law times a factor of the
//! degree of saturation S of the ground around both bodies.
//!
//! ```text
//! T(S) = w(S) T,   shear strength likewise,   w(S) = c + (1 - c) exp(-b S)
//! ```
//!
//! This is the law that Hawkins and McConnell fitted to the strength of 35 sandstones over their content of water,
//! relative to the strength when dry: `c` is the part that no water takes, `b` the rate. A content of water per mass is
//! `S` times that at saturation, so that `b` is the rate per content times the content at saturation. A bond under
//! load fails in the step in which its strength falls below the load; bonds that failed do not heal on drying. Springs
//! and friction do not depend on the water.
//!
//! Source: A. B. Hawkins, B. J. McConnell, Q. J. Eng. Geol. 25 (1992) 115, doi:10.1144/GSL.QJEG.1992.025.02.05.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::Space;
use super::wrapped::{
    bonds_of_law_below, limits_of_law_below, model_of_law_below, springs_of_law_below,
};
use super::{ContactForce, ContactKinematics, ContactLaw, ContactModel, PairProperties, PairTable};

/// Loss of strength of bonds on wetting: strengths times c + (1 - c) exp(-b S), with the degree of saturation S of the
/// ground (Hawkins and McConnell 1992). Needs `fluid.darcy.unsaturated`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Softening")]
pub struct SofteningParameters {
    /// Fraction c of the dry strength that remains at any moisture \[1\].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub residual: f64,
    /// Rate b of the loss with the degree of saturation \[1\].
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1000))]
    pub rate: f64,
}

impl SofteningParameters {
    /// Returns the factor of the strengths at a degree of saturation.
    #[must_use]
    #[inline]
    pub fn factor(&self, saturation: f64) -> f64 {
        self.residual + (1.0 - self.residual) * (-self.rate * saturation).exp()
    }
}

/// Law of bonds whose strengths can be lowered.
pub trait BondStrength<S: Space>: ContactLaw<S> {
    /// Returns the constants of a pair with all strengths of bonds times a factor.
    fn weakened(constants: &Self::Constants, factor: f64) -> Self::Constants;
}

/// Contact bonds that weaken with the moisture: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Softened<L> {
    /// Law in dry ground.
    pub law: L,
    /// Loss of strength.
    pub softening: SofteningParameters,
}

/// Everything is that of the law in dry ground, which is the strongest.
impl<L: ContactModel> ContactModel for Softened<L> {
    fn describe(&self) -> String {
        format!(
            "{} that keep {:.3} of their strength in saturated ground",
            self.law.describe(),
            self.softening.factor(1.0)
        )
    }

    fn moisture(&self) -> Option<String> {
        Some("contact.contact_bond.softening".into())
    }

    model_of_law_below!();
    limits_of_law_below!();
}

/// Values per pair: those of the law in dry ground, and the loss of strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftenedConstants<C> {
    law: C,
    softening: SofteningParameters,
}

impl<S: Space, L: BondStrength<S>> ContactLaw<S> for Softened<L> {
    type Row = (L::Row, SofteningParameters);
    type Scale = L::Scale;
    type Constants = SoftenedConstants<L::Constants>;
    type History = L::History;
    const NUMBERS: usize = L::NUMBERS;
    const HAS_ROLLING: bool = L::HAS_ROLLING;
    const SPATIAL: bool = L::SPATIAL;
    const NEEDS_MOISTURE: bool = true;

    fn table(&self) -> PairTable<Self::Row> {
        let rows = L::table(&self.law);
        rows.map(|row| (*row, self.softening))
    }

    fn scale((row, _): &Self::Row, pair: &PairProperties) -> L::Scale {
        L::scale(row, pair)
    }

    #[inline(always)]
    fn constants(row: &Self::Row, scale: &L::Scale, diameter: f64) -> Self::Constants {
        SoftenedConstants {
            law: L::constants(&row.0, scale, diameter),
            softening: row.1,
        }
    }

    #[inline(always)]
    fn force(
        c: &Self::Constants,
        history: &mut L::History,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let law = L::weakened(&c.law, c.softening.factor(kinematics.moisture[0]));
        L::force(&law, history, kinematics)
    }

    fn save(history: &L::History, numbers: &mut Vec<f64>) {
        L::save(history, numbers);
    }

    fn load(numbers: &[f64]) -> L::History {
        L::load(numbers)
    }

    springs_of_law_below!(L);
    bonds_of_law_below!(L);
}

impl<S: Space, L: BondStrength<S> + 'static> Bodies<S> for Softened<L> {
    type Scratch = ();
}
