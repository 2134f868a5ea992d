//! Contact laws: the force between two bodies from their overlap and relative motion.
//!
//! A contact law is one file. It holds, in this order:
//!
//! 1. the equation and its source;
//! 2. `Input`: the parameters as written in a case, with the unit, range and default of each, and their resolution
//!    to parameters for every pair of materials, with findings ([`ContactParameters`]);
//! 3. the resolved law for the plan: a line of description, limits of the time step, springs, bonds
//!    ([`ContactModel`]);
//! 4. the constants of a pair, the history of a contact, and the force ([`ContactLaw`]);
//! 5. the bodies: `impl Bodies`, whose defaults are those of spheres.
//!
//! To add a law, write the file and add one line to each of the two lists below: the enum of the case with its schema
//! ([`Contact`]), and the resolved laws ([`Law`]) with the dispatch to the engine, which is compiled for each law: no
//! loop tests for the law. `tests/toy.rs` is the smallest example.
//!
//! | file | holds |
//! |---|---|
//! | `linear`, `cohesive_frictional`, `contact_bond`, `hertz_mindlin`, `blocks` | a law each |
//! | `rolling` | resistance to rolling on top of another law |
//! | `bridges` | capillary bridges on top of another law |
//! | `softened` | contact bonds that weaken with the moisture of the ground |
//! | `wrapped` | functions that these three pass on to the law below them |
//! | `input` | what the parameters of all laws share: [`Scaled`], [`Pair`], [`SceneFacts`] |
//! | `pairs` | [`PairTable`], parameters for every pair of materials |
//! | `model` | [`ContactModel`], the interface between plan and law |
//! | `family` | functions of the engine for a law of a list |
//!
//! Forces are those on the second partner, normals point from the first to the second. Both act at the contact point in
//! the middle of the overlap, so that angular momentum is conserved (lever arms `r - overlap / 2`).

pub mod bridges;
pub(crate) mod family;
mod input;
mod model;
mod pairs;
pub mod rolling;
pub mod softened;
#[cfg(test)]
mod tests;
mod wrapped;

pub use input::{ContactParameters, MaterialFacts, Pair, Preparation, Scaled, SceneFacts};
pub use model::{BondOpening, ContactModel, Depth, Springs, StaticContact, TimeLimits};
pub use pairs::PairTable;

use std::fmt::Debug;

use base::family::family;
use bridges::Bridged;
use family::{CriticalTimeStep, Family, Visitor};
use rolling::Rolling;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use softened::Softened;

use super::particles::Body;
use super::space::{Components, Space};

/// Properties of a pair from which a law may compute its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairProperties {
    /// Indices of the materials of both bodies.
    pub materials: [u32; 2],
    /// Mean diameter \[m\] of two grains, or the diameter of a grain at a wall.
    pub diameter: f64,
    /// Effective mass \[kg\]: `m1 m2 / (m1 + m2)`, or the mass of a grain at a wall or at a grain that does not
    /// move under forces.
    pub mass: f64,
    /// Effective radius `r1 r2 / (r1 + r2)` \[m\], or the radius of a grain at a wall.
    pub rolling_radius: f64,
    /// Effective moment of inertia `(1/I1 + 1/I2)^-1` [kg m²] about the contact point, with the exceptions of the
    /// mass.
    pub rolling_inertia: f64,
}

/// Overlap and relative motion of two bodies in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactKinematics<S: Space> {
    /// Overlap \[m\]; negative for a gap.
    pub overlap: f64,
    /// Unit normal from the first to the second body.
    pub normal: S::Vector,
    /// Velocity of separation [m/s].
    pub separation_rate: f64,
    /// Sliding velocity of the second body relative to the first at the contact point [m/s].
    pub slip: S::Tangent,
    /// Spin of the second body relative to the first [rad/s].
    pub roll: S::Spin,
    /// Time step \[s\] over which the history advances.
    pub time_step: f64,
    /// Degree of saturation, and volume of water per volume of grains \[1\], as means of both bodies; at a wall those
    /// of the grain. 0 unless the law uses them: [`ContactLaw::NEEDS_MOISTURE`].
    pub moisture: [f64; 2],
}

/// Mode of failure of a bond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// Tensile failure.
    Tension,
    /// Shear failure.
    Shear,
}

/// Force on the second partner of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce<S: Space> {
    /// Normal component \[N\], positive in compression.
    pub normal: f64,
    /// Tangential component \[N\].
    pub tangent: S::Tangent,
    /// Rolling moment \[N m\]; used only if the law has one: [`ContactLaw::HAS_ROLLING`].
    pub moment: S::Spin,
    /// Mode in which the bond failed in this step; none if it did not.
    pub failure: Option<Failure>,
}

impl<S: Space> ContactForce<S> {
    /// Returns no force.
    #[inline(always)]
    fn none() -> Self {
        Self {
            normal: 0.0,
            tangent: S::Tangent::default(),
            moment: S::Spin::default(),
            failure: None,
        }
    }
}

/// Force of a contact law, compiled into the pair loop.
pub trait ContactLaw<S: Space>: Clone + Debug + Send + Sync {
    /// Values computed once per pair of materials.
    type Row: Copy + Debug + Send + Sync;
    /// Values computed once per pair of bodies because they need roots or divisions; as small as possible, since
    /// every listed pair stores them.
    type Scale: Copy + Debug + Send + Sync;
    /// Constants from which the force of a pair is computed.
    type Constants: Copy + Debug + Send + Sync;
    /// History of a contact; its default is that of a new contact.
    type History: Copy + Debug + Default + PartialEq + Send + Sync;

    /// `true` if the force has a rolling moment.
    const HAS_ROLLING: bool = false;
    /// `true` if the law exists in 3-D only. Its engine is then not compiled for discs.
    const SPATIAL: bool = false;
    /// `true` if the force depends on the moisture of the ground.
    const NEEDS_MOISTURE: bool = false;
    /// Number of values of a history.
    const NUMBERS: usize;

    /// Returns the number of materials, and the row of every ordered pair of materials.
    fn table(&self) -> PairTable<Self::Row>;
    /// Returns the scale of a pair.
    fn scale(row: &Self::Row, pair: &PairProperties) -> Self::Scale;
    /// Returns the constants of a pair with mean diameter `diameter` \[m\], by multiplications alone.
    fn constants(row: &Self::Row, scale: &Self::Scale, diameter: f64) -> Self::Constants;
    /// Returns the constants of a pair.
    fn between(row: &Self::Row, pair: &PairProperties) -> Self::Constants {
        Self::constants(row, &Self::scale(row, pair), pair.diameter)
    }
    /// Returns the force, and the history after this step. Called if the surfaces overlap or [`Self::holds`];
    /// otherwise the history is dropped.
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
    /// Returns the normal and shear stiffness [N/m] for the critical time step; if they grow with the overlap,
    /// those at the largest expected overlap.
    fn stiffness(constants: &Self::Constants) -> [f64; 2];
    /// Appends the history as [`Self::NUMBERS`] numbers.
    fn save(history: &Self::History, numbers: &mut Vec<f64>);
    /// Returns the history from [`Self::NUMBERS`] numbers.
    fn load(numbers: &[f64]) -> Self::History;

    // Bonds: a law without bonds keeps these defaults.

    /// Returns `true` if the history holds a bond.
    #[inline(always)]
    fn bonded(_: &Self::History) -> bool {
        false
    }
    /// Returns `true` if a pair with this history acts across a gap, by a bond or a capillary bridge.
    #[inline(always)]
    fn holds(history: &Self::History) -> bool {
        Self::bonded(history)
    }
    /// Returns the attraction of the capillary bridge \[N\]; 0 without one.
    fn bridge(_: &Self::History) -> f64 {
        0.0
    }
    /// Returns the largest gap \[m\] across which a pair is bonded.
    fn bonding_gap(_: &Self::Constants) -> f64 {
        0.0
    }
    /// Bonds a pair with this overlap \[m\], negative for a gap; returns `true` if its materials can bond.
    fn bond(_: &Self::Constants, _: &mut Self::History, _overlap: f64) -> bool {
        false
    }
    /// Multiplies the strengths of the bonds that the law makes by a factor.
    fn strengthen(&mut self, _factor: f64) {}
    /// Multiplies the strength of an existing bond by a factor, if its history holds the strength.
    fn strengthen_bond(_: &mut Self::History, _factor: f64) {}
    /// Returns the largest gap \[m\] over which a pair that [`Self::holds`] still acts, for a range of mean diameters
    /// \[m\] of pairs.
    fn widest_opening(&self, _diameters: [f64; 2]) -> f64 {
        0.0
    }
}

family! {
    /// The law of all contacts; pairs of materials may have their own parameters.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Contact: dyn ContactParameters<Law> {
        /// Linear springs with friction, no tension.
        linear: Linear(LinearInput),
        /// Linear springs with friction and brittle cohesion.
        cohesive_frictional: CohesiveFrictional(CohesiveFrictionalInput),
        /// The linear law with bonds of given tensile and shear strength.
        contact_bond: ContactBond(ContactBondInput),
        /// Elastic spheres: normal force of Hertz, tangential force of Mindlin without slip, friction (3-D only).
        hertz_mindlin: HertzMindlin(HertzMindlinInput),
        /// Blocks, and spheres among them: springs over the area of contact or at a point, friction (3-D only).
        blocks: Blocks(BlockInput),
    }
}

family! {
    dispatch each_law;
    /// Contact law with its parameters for every pair of materials.
    #[derive(Clone, Debug, PartialEq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Law: dyn ContactModel, from {
        Linear(linear::Linear),
        RollingLinear(Rolling<linear::Linear>),
        BridgedLinear(Bridged<linear::Linear>),
        BridgedRollingLinear(Bridged<Rolling<linear::Linear>>),
        CohesiveFrictional(cohesive_frictional::CohesiveFrictional),
        ContactBond(contact_bond::ContactBond),
        RollingContactBond(Rolling<contact_bond::ContactBond>),
        SoftenedContactBond(Softened<contact_bond::ContactBond>),
        RollingSoftenedContactBond(Rolling<Softened<contact_bond::ContactBond>>),
        HertzMindlin(hertz_mindlin::HertzMindlin),
        BridgedHertzMindlin(Bridged<hertz_mindlin::HertzMindlin>),
        Blocks(blocks::BlockLaw),
    }
}

impl Family for Law {
    fn visit<S: Space, V: Visitor<S>>(&self, visitor: V) -> V::Output {
        each_law!(self, law => visitor.visit(law))
    }
}

impl Law {
    /// Returns the model for changes.
    pub fn model_mut(&mut self) -> &mut dyn ContactModel {
        each_law!(self, law => law)
    }

    /// Returns a law without forces, for scenes in which nothing can touch.
    #[must_use]
    pub fn without_forces(materials: u32) -> Self {
        Self::Linear(linear::Linear {
            parameters: PairTable::uniform(materials, linear::LinearParameters::WITHOUT_FORCES),
        })
    }

    /// Returns `sqrt(m/k)` \[s\] of the stiffest contact that any of `grains` can have with grains or walls of
    /// `materials` materials. The explicit step must be well below it (half a period of a pair lasts `pi sqrt(m/(2
    /// k))`; 0.1 to
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

/// Returns a tangential vector of this length scaled down to `limit` if it is longer.
#[inline(always)]
pub(super) fn cut_to<T: Components>(tangent: T, length: f64, limit: f64) -> T {
    if length > limit {
        tangent * (limit / length)
    } else {
        tangent
    }
}

/// Returns a tangential vector from the first of `numbers`.
pub(super) fn load_tangent<T: Components>(numbers: &[f64]) -> T {
    let mut tangent = T::default();
    for (k, value) in numbers.iter().take(T::COUNT).enumerate() {
        tangent.set(k, *value);
    }
    tangent
}

/// Appends a tangential vector to `numbers`.
pub(super) fn save_tangent<T: Components>(tangent: &T, numbers: &mut Vec<f64>) {
    for k in 0..T::COUNT {
        numbers.push(tangent.get(k));
    }
}
