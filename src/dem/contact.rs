//! Contact laws: overlap and relative motion of two bodies to the force between them.
//!
//! A law is one file: its parameters (per pair of materials), what it computes once per pair ([`ContactLaw::constants`]), what
//! it remembers from step to step ([`ContactLaw::History`]), and the force. The pair loop is compiled once per law. To add one:
//! write the file, and add one line to [`Law`], to the matches in `dem.rs` and to those in `dem/state.rs`, and its name to the laws
//! of spheres in `dem/engine/bodies.rs`.
//!
//! Forces are those on the second partner, normals point from the first to the second. Both act at the contact point in the
//! middle of the overlap, so that angular momentum is conserved (lever arms `r - overlap / 2`).

pub mod blocks;
pub mod cohesive_frictional;
pub mod contact_bond;
pub mod hertz_mindlin;
pub mod linear;
pub mod rolling;

use std::fmt::Debug;

use super::space::{Components, Space};

/// Parameters for every unordered pair of materials.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTable<P> {
    materials: u32,
    rows: Vec<P>,
}

impl<P: Clone> PairTable<P> {
    /// The same parameters for every pair of `materials` materials.
    #[must_use]
    pub fn uniform(materials: u32, parameters: P) -> Self {
        let materials = materials.max(1);
        Self {
            materials,
            rows: vec![parameters; materials as usize * materials as usize],
        }
    }

    /// Sets the parameters of one pair.
    pub fn set(&mut self, a: u32, b: u32, parameters: P) {
        let [i, j] = [self.row(a, b), self.row(b, a)];
        self.rows[i] = parameters.clone();
        self.rows[j] = parameters;
    }

    /// The parameters of one pair; materials beyond the table use its last row.
    #[must_use]
    pub fn get(&self, a: u32, b: u32) -> &P {
        &self.rows[self.row(a, b)]
    }

    /// Every row, each pair twice.
    pub fn rows(&self) -> impl Iterator<Item = &P> {
        self.rows.iter()
    }

    /// The same table of something made from each row.
    #[must_use]
    pub fn map<Q>(&self, make: impl FnMut(&P) -> Q) -> PairTable<Q> {
        PairTable {
            materials: self.materials,
            rows: self.rows.iter().map(make).collect(),
        }
    }

    /// Calls `visit` with every pair of materials, each once.
    pub(super) fn for_each_pair(&self, mut visit: impl FnMut(u32, u32, &P)) {
        for a in 0..self.materials {
            for b in a..self.materials {
                visit(a, b, self.get(a, b));
            }
        }
    }

    /// The place of a pair in the table, to be looked up by [`Self::at`].
    #[expect(clippy::cast_possible_truncation, reason = "a few materials, squared")]
    pub(super) fn place(&self, a: u32, b: u32) -> u32 {
        self.row(a, b) as u32
    }

    /// The parameters at a place.
    #[inline(always)]
    pub(super) fn at(&self, place: u32) -> &P {
        &self.rows[place as usize]
    }

    fn row(&self, a: u32, b: u32) -> usize {
        let last = self.materials - 1;
        a.min(last) as usize * self.materials as usize + b.min(last) as usize
    }
}

/// Who meets whom: what a law may compute its constants from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairProperties {
    /// Both materials.
    pub materials: [u32; 2],
    /// Mean diameter (m) of two grains, the grain's own against a wall.
    pub diameter: f64,
    /// Effective mass (kg): `m1 m2 / (m1 + m2)`, the grain's own against a wall or a grain that forces do not move.
    pub mass: f64,
    /// `r1 r2 / (r1 + r2)` (m), the grain's radius against a wall.
    pub rolling_radius: f64,
    /// `(1/I1 + 1/I2)^-1` (kg m²) about the contact point, the grain's own as for the mass.
    pub rolling_inertia: f64,
}

/// How two bodies touch now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactKinematics<S: Space> {
    /// Overlap (m); negative for a gap.
    pub overlap: f64,
    /// Unit normal from the first to the second.
    pub normal: S::Vector,
    /// Velocity of separation (m/s).
    pub separation_rate: f64,
    /// Sliding velocity of the second relative to the first at the contact point (m/s).
    pub slip: S::Tangent,
    /// Spin of the second relative to the first (rad/s).
    pub roll: S::Spin,
    /// Time step (s) over which the history advances.
    pub time_step: f64,
}

/// How a bond failed.
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
    /// Along the normal (N), positive in compression.
    pub normal: f64,
    /// Across it (N).
    pub tangent: S::Tangent,
    /// Rolling moment (N m); only where the law is one that rolls: [`ContactLaw::ROLLS`].
    pub moment: S::Spin,
    /// The bond failed in this step.
    pub failure: Option<Failure>,
}

/// A contact law, compiled into the pair loop.
pub trait ContactLaw<S: Space>: Clone + Debug + Send + Sync {
    /// What is computed once per pair of materials.
    type Row: Copy + Debug + Send + Sync;
    /// What is computed once per pair and costs roots or divisions: as small as can be, since every pair in the lists has one.
    type Scale: Copy + Debug + Send + Sync;
    /// What the force of a pair is computed from.
    type Constants: Copy + Debug + Send + Sync;
    /// What is remembered; its default is a contact just born.
    type History: Copy + Debug + Default + PartialEq + Send + Sync;

    /// How many materials, and the row of every ordered pair of them.
    fn table(&self) -> PairTable<Self::Row>;
    /// The scale of a pair.
    fn scale(row: &Self::Row, partners: &PairProperties) -> Self::Scale;
    /// The constants of a pair of mean diameter `diameter` (m), by multiplications alone.
    fn constants(row: &Self::Row, scale: &Self::Scale, diameter: f64) -> Self::Constants;
    /// The constants of two partners.
    fn between(row: &Self::Row, partners: &PairProperties) -> Self::Constants {
        Self::constants(row, &Self::scale(row, partners), partners.diameter)
    }
    /// The force, and the memory after this step. Called where the surfaces overlap or the pair is bonded; where they do not
    /// overlap and the pair is not bonded the memory is dropped instead.
    fn force(constants: &Self::Constants, memory: &mut Self::History, touch: &ContactKinematics<S>) -> ContactForce<S>;
    /// Whether replies hold a rolling moment.
    const ROLLS: bool = false;
    /// Whether the memory holds a bond.
    fn bonded(memory: &Self::History) -> bool;
    /// The widest gap (m) across which a pair is bonded.
    fn bonding_gap(_: &Self::Constants) -> f64 {
        0.0
    }
    /// Bonds a pair of this overlap (m), negative for a gap; false where its materials do not bond.
    fn bond(constants: &Self::Constants, memory: &mut Self::History, overlap: f64) -> bool;
    /// Force of the normal spring (N) at an overlap (m), positive in compression.
    fn normal_spring(constants: &Self::Constants, _: &Self::History, overlap: f64) -> f64 {
        Self::stiffness(constants)[0] * overlap
    }
    /// Takes the bond away.
    fn unbond(memory: &mut Self::History);
    /// The widest gap (m) over which a bonded pair still acts, for mean diameters (m) between the two.
    fn widest_opening(&self, diameters: [f64; 2]) -> f64;
    /// Normal and shear stiffness (N/m), for the critical time step; where they grow with the overlap, those at the deepest one
    /// that is expected.
    fn stiffness(constants: &Self::Constants) -> [f64; 2];
    /// How many numbers a memory is.
    const NUMBERS: usize;
    /// The memory as numbers, [`Self::NUMBERS`] of them.
    fn save(memory: &Self::History, numbers: &mut Vec<f64>);
    /// The memory from [`Self::NUMBERS`] numbers.
    fn load(numbers: &[f64]) -> Self::History;
}

/// The laws a scene may choose from.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Springs, dashpots and Coulomb friction: [`linear`].
    Linear(linear::Linear),
    /// Springs, cohesion and friction: [`cohesive_frictional`].
    CohesiveFrictional(cohesive_frictional::CohesiveFrictional),
    /// The linear law with bonds of given strengths: [`contact_bond`].
    ContactBond(contact_bond::ContactBond),
    /// The linear law with resistance to rolling: [`rolling`].
    RollingLinear(rolling::Rolling<linear::Linear>),
    /// Contact bonds with resistance to rolling: [`rolling`].
    RollingContactBond(rolling::Rolling<contact_bond::ContactBond>),
    /// Elastic spheres: [`hertz_mindlin`].
    HertzMindlin(hertz_mindlin::HertzMindlin),
    /// Convex polyhedra, and spheres among them; in space only: [`blocks`].
    Blocks(blocks::Blocks),
}

/// A length of a tangent cut down to `limit`, its direction kept.
#[inline(always)]
pub(super) fn cut_to<T: Components>(tangent: T, length: f64, limit: f64) -> T {
    if length > limit {
        tangent * (limit / length)
    } else {
        tangent
    }
}

/// A tangent from the front of `numbers`.
pub(super) fn load_tangent<T: Components>(numbers: &[f64]) -> T {
    let mut tangent = T::default();
    for (k, value) in numbers.iter().take(T::COUNT).enumerate() {
        tangent.set(k, *value);
    }
    tangent
}

/// A tangent behind `numbers`.
pub(super) fn save_tangent<T: Components>(tangent: &T, numbers: &mut Vec<f64>) {
    for k in 0..T::COUNT {
        numbers.push(tangent.get(k));
    }
}
