//! Contact laws: the force between two bodies from their overlap and relative motion.
//!
//! A contact law is one file. It holds, in this order:
//!
//! 1. the equation and its source;
//! 2. `Input`: the parameters as they stand in a case, with the unit, range and default of each, and their resolution
//!    to parameters for every pair of materials, with findings ([`ContactParameters`]);
//! 3. the law and its answers to the plan: a line of description, limits of the time step, springs, bonds
//!    ([`ContactModel`]);
//! 4. the constants of a pair, the history of a contact, and the force ([`ContactLaw`]);
//! 5. the bodies: `impl Bodies`, whose defaults are those of spheres.
//!
//! To add a law, write the file, declare the module, and add one line to the list below. The list generates the enum of
//! the case with its schema ([`Contact`]), the resolved laws ([`Law`]), and the dispatch to the engine, which is
//! compiled for each law: no loop tests for the law. `tests/toy.rs` is the smallest example.
//!
//! | file | holds |
//! |---|---|
//! | `linear`, `cohesive_frictional`, `contact_bond`, `hertz_mindlin`, `blocks` | a law each |
//! | `rolling` | resistance to rolling on top of another law |
//! | `input` | what the parameters of all laws share: [`Scaled`], [`Pair`], [`SceneFacts`] |
//! | `pairs` | [`PairTable`], parameters for every pair of materials |
//! | `model` | [`ContactModel`], the interface between plan and law |
//! | `family` | the list as types |
//!
//! Forces are those on the second partner, normals point from the first to the second. Both act at the contact point in
//! the middle of the overlap, so that angular momentum is conserved (lever arms `r - overlap / 2`).

pub mod blocks;
pub mod cohesive_frictional;
pub mod contact_bond;
pub(crate) mod family;
pub mod hertz_mindlin;
mod input;
pub mod linear;
mod model;
mod pairs;
pub mod rolling;
#[cfg(test)]
mod tests;

pub use input::{ContactParameters, MaterialFacts, Pair, Preparation, Scaled, SceneFacts};
pub use model::{BondOpening, ContactModel, Depth, Springs, StaticContact, TimeLimits};
pub use pairs::PairTable;

use std::fmt::Debug;

use family::{CriticalTimeStep, Family, contact_laws};
use rolling::Rolling;

use super::particles::Body;
use super::space::{Components, Space};

/// The properties of a pair that a law may compute its constants from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairProperties {
    /// Both materials.
    pub materials: [u32; 2],
    /// Mean diameter \[m\] of two grains, the grain's own against a wall.
    pub diameter: f64,
    /// Effective mass \[kg\]: `m1 m2 / (m1 + m2)`, the grain's own against a wall or a grain that forces do not move.
    pub mass: f64,
    /// `r1 r2 / (r1 + r2)` \[m\], the grain's radius against a wall.
    pub rolling_radius: f64,
    /// `(1/I1 + 1/I2)^-1` [kg m²] about the contact point, the grain's own as for the mass.
    pub rolling_inertia: f64,
}

/// Overlap and relative motion of two bodies in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactKinematics<S: Space> {
    /// Overlap \[m\]; negative for a gap.
    pub overlap: f64,
    /// Unit normal from the first to the second.
    pub normal: S::Vector,
    /// Velocity of separation [m/s].
    pub separation_rate: f64,
    /// Sliding velocity of the second relative to the first at the contact point [m/s].
    pub slip: S::Tangent,
    /// Spin of the second relative to the first [rad/s].
    pub roll: S::Spin,
    /// Time step \[s\] over which the history advances.
    pub time_step: f64,
}

/// Mode of failure of a bond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// Pulled apart.
    Tension,
    /// Sheared off.
    Shear,
}

/// The force on the second partner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce<S: Space> {
    /// Along the normal \[N\], positive in compression.
    pub normal: f64,
    /// Across it \[N\].
    pub tangent: S::Tangent,
    /// Rolling moment \[N m\]; only where the law is one that rolls: [`ContactLaw::ROLLS`].
    pub moment: S::Spin,
    /// The bond failed in this step.
    pub failure: Option<Failure>,
}

/// The force of a contact law, compiled into the pair loop.
pub trait ContactLaw<S: Space>: Clone + Debug + Send + Sync {
    /// Values computed once per pair of materials.
    type Row: Copy + Debug + Send + Sync;
    /// Values computed once per pair that cost roots or divisions: as small as possible, since every pair in the lists
    /// has them.
    type Scale: Copy + Debug + Send + Sync;
    /// Values that the force of a pair is computed from.
    type Constants: Copy + Debug + Send + Sync;
    /// The history of a contact; its default is that of a new contact.
    type History: Copy + Debug + Default + PartialEq + Send + Sync;

    /// `true` if the force has a rolling moment.
    const ROLLS: bool = false;
    /// Number of values of a history.
    const NUMBERS: usize;

    /// Returns the number of materials, and the row of every ordered pair of them.
    fn table(&self) -> PairTable<Self::Row>;
    /// Returns the scale of a pair.
    fn scale(row: &Self::Row, pair: &PairProperties) -> Self::Scale;
    /// Returns the constants of a pair of mean diameter `diameter` \[m\], by multiplications alone.
    fn constants(row: &Self::Row, scale: &Self::Scale, diameter: f64) -> Self::Constants;
    /// Returns the constants of a pair.
    fn between(row: &Self::Row, pair: &PairProperties) -> Self::Constants {
        Self::constants(row, &Self::scale(row, pair), pair.diameter)
    }
    /// Returns the force, and the history after this step. Called where the surfaces overlap or the pair is bonded;
    /// where they do not overlap and the pair is not bonded the history is dropped instead.
    fn force(
        constants: &Self::Constants,
        history: &mut Self::History,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S>;
    /// Returns the force of the normal spring \[N\] at an overlap \[m\], positive in compression.
    fn normal_spring(constants: &Self::Constants, _: &Self::History, overlap: f64) -> f64 {
        Self::stiffness(constants)[0] * overlap
    }
    /// Returns the stiffness of the normal spring [N/m] at an overlap \[m\]: the derivative of its force.
    fn tangent_stiffness(constants: &Self::Constants, _overlap: f64) -> f64 {
        Self::stiffness(constants)[0]
    }
    /// Returns the force of the shear spring \[N\] on the second partner.
    fn shear_spring(history: &Self::History) -> S::Tangent;
    /// Returns the normal and shear stiffness [N/m], for the critical time step; where they grow with the overlap,
    /// those at the deepest one that is expected.
    fn stiffness(constants: &Self::Constants) -> [f64; 2];
    /// Appends the history as [`Self::NUMBERS`] numbers.
    fn save(history: &Self::History, numbers: &mut Vec<f64>);
    /// Returns the history from [`Self::NUMBERS`] numbers.
    fn load(numbers: &[f64]) -> Self::History;

    // Bonds: a law without bonds leaves the rest as it is.

    /// Returns `true` if the history holds a bond.
    #[inline(always)]
    fn bonded(_: &Self::History) -> bool {
        false
    }
    /// Returns the widest gap \[m\] across which a pair is bonded.
    fn bonding_gap(_: &Self::Constants) -> f64 {
        0.0
    }
    /// Bonds a pair of this overlap \[m\], negative for a gap; returns `true` if its materials can bond.
    fn bond(_: &Self::Constants, _: &mut Self::History, _overlap: f64) -> bool {
        false
    }
    /// Takes the bond away.
    fn unbond(_: &mut Self::History) {}
    /// Returns the widest gap \[m\] over which a bonded pair still acts, for mean diameters \[m\] between the two.
    fn widest_opening(&self, _diameters: [f64; 2]) -> f64 {
        0.0
    }
}

contact_laws! {
    /// The law of all contacts; pairs of materials may have their own parameters.
    pub Contact,
    /// A contact law with its parameters for every pair of materials.
    Law:
    /// Linear springs with friction, no tension.
    Linear(linear::LinearInput) => Linear(linear::Linear), RollingLinear(Rolling<linear::Linear>);
    /// Linear springs with friction and brittle cohesion.
    CohesiveFrictional(cohesive_frictional::CohesiveFrictionalInput) =>
        CohesiveFrictional(cohesive_frictional::CohesiveFrictional);
    /// The linear law with bonds of given tensile and shear strength.
    ContactBond(contact_bond::ContactBondInput) => ContactBond(contact_bond::ContactBond),
        RollingContactBond(Rolling<contact_bond::ContactBond>);
    /// Elastic spheres: Hertz's normal force, Mindlin's without slip across it, friction (3-D only).
    HertzMindlin(hertz_mindlin::HertzMindlinInput) => HertzMindlin(hertz_mindlin::HertzMindlin);
    /// Blocks, and spheres among them: springs over the area of contact or at a point, friction (3-D only).
    Blocks(blocks::BlockInput) => Blocks(blocks::BlockLaw);
}

impl Law {
    /// Returns a law without forces, for scenes in which nothing can touch.
    #[must_use]
    pub fn without_forces(materials: u32) -> Self {
        Self::Linear(linear::Linear {
            parameters: PairTable::uniform(materials, linear::LinearParameters::WITHOUT_FORCES),
        })
    }

    /// Returns `sqrt(m/k)` \[s\] of the stiffest contact any of `grains` can make with grains or walls of `materials`
    /// materials: the explicit step must stay well below it (half a period of a pair lasts `pi sqrt(m/(2 k))`; 0.1 to
    /// 0.2 of the limit is usual).
    #[must_use]
    pub fn critical_time_step<'a, S: Space>(
        &self,
        grains: impl IntoIterator<Item = &'a Body> + Clone,
        materials: u32,
    ) -> f64 {
        Family::visit::<S, _>(self, CriticalTimeStep { grains, materials })
    }
}

/// Returns a length of a tangent cut down to `limit`, its direction kept.
#[inline(always)]
pub(super) fn cut_to<T: Components>(tangent: T, length: f64, limit: f64) -> T {
    if length > limit {
        tangent * (limit / length)
    } else {
        tangent
    }
}

/// Returns a tangent from the front of `numbers`.
pub(super) fn load_tangent<T: Components>(numbers: &[f64]) -> T {
    let mut tangent = T::default();
    for (k, value) in numbers.iter().take(T::COUNT).enumerate() {
        tangent.set(k, *value);
    }
    tangent
}

/// Appends a tangent behind `numbers`.
pub(super) fn save_tangent<T: Components>(tangent: &T, numbers: &mut Vec<f64>) {
    for k in 0..T::COUNT {
        numbers.push(tangent.get(k));
    }
}
