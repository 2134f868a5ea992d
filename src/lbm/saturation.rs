//! Partially saturated cells: a cell with solid fraction ε collides as fluid and as solid at once.
//!
//! ```text
//! f_i* = f_i + (1 - B) (Ω_i + S_i) + B Ω^s_i
//! ```
//!
//! Ω_i is the collision of the fluid with its force S_i, Ω^s_i the solid collision operator (one file each), and B the
//! weighting of ε ([`Weighting`]). The force of a cell on the solid is the momentum that the fluid loses, -B Σ c_i
//! Ω^s_i, to rounding. The mass of a cell is conserved. Sources: D. R. Noble, J. R. Torczynski, Int. J. Mod. Phys. C 9
//! (1998) 1189; D. J. Holdych, PhD thesis, Urbana (2003); D. R. J. Owen, C. R. Leonardi, Y. T. Feng, Int. J. Numer.
//! Meth. Eng. 87 (2011) 66.
//!
//! **Several bodies in a cell.** B(ε) is evaluated for the sum of their fractions, at most 1, and shared in proportion,
//! so that two blocks that fill a cell together close it. The cell moves with the mean of their velocities, weighted by
//! their shares. Each body receives its own part of the force, and the parts add up to the momentum that the fluid
//! loses. The force is evaluated at the mean velocity: at the individual velocities two bodies with parts a and b would
//! exchange a b ρ (u_a - u_b) per step, an unphysical drag between them.
//!
//! **Deep inside** a body, where no neighbouring cell contains fluid, the populations are set to the equilibrium at the
//! solid's velocity. Otherwise nothing there damps the populations that enter from the surface. Bodies that slide on
//! each other would then stir the internal fluid until it carries momentum through them, and this fluid would appear in
//! cells that are uncovered.
//!
//! **Full cells** at a surface, and between bodies in contact, reverse populations with a loss of 1/64. An undamped
//! exchange between two full cells would oscillate for ever, and grow at high Reynolds numbers.
//!
//! **Bodies in contact**, and a body on a wall of the domain at rest, exchange pressure but no drag through full cells
//! (`contact.rs`).
//!
//! Besides the populations a cell holds ε (f32) and its body ([`cover`]): 8 bytes. The loop tests once per vector of
//! cells whether any is covered, and then selects the operator. The rest of this module runs only for covered cells
//! (`pass.rs`).

mod contact;
#[cfg(not(target_arch = "nvptx64"))]
pub mod cover;
mod mixed;
pub(crate) mod pass;
pub mod solid;
#[cfg(not(target_arch = "nvptx64"))]
pub(crate) mod sums;
#[cfg(target_arch = "nvptx64")]
pub(crate) use super::gpu::sums;
mod weighting;

#[cfg(not(target_arch = "nvptx64"))]
pub use cover::{Cover, cells};
pub use solid::{CoveringBody, DEEP};
pub use weighting::Weighting;

use super::collision::along;
use super::collision::trt::AntisymmetricRate;
use super::lanes::Lanes;
use super::lattice::{Lattice, unroll};
#[cfg(not(target_arch = "nvptx64"))]
use schemars::{JsonSchema, Schema};
#[cfg(not(target_arch = "nvptx64"))]
use serde::{Deserialize, Serialize};
#[cfg(not(target_arch = "nvptx64"))]
use serde_json::json;

/// Makes the list of solid collision operators: the modules that hold them, and the enum that a case chooses from. The
/// name of an operator in a case is that of its module.
macro_rules! solid_operators {
    ($(#[$attribute:meta])* $list:ident: $($module:ident $operator:ident,)*) => {
        $(pub mod $module;)*

        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(
            not(target_arch = "nvptx64"),
            derive(Serialize, Deserialize, JsonSchema),
            serde(rename_all = "snake_case"),
            schemars(inline, transform = Self::describe_choices)
        )]
        #[repr(u32)]
        $(#[$attribute])*
        pub enum $list {
            $(
                #[allow(missing_docs, reason = "the documentation of an operator stands in its module")]
                $operator,
            )*
        }

        #[cfg(not(target_arch = "nvptx64"))]
        impl $list {
            /// Every operator of the list.
            pub const ALL: &[Self] = &[$(Self::$operator,)*];

            /// The description of the operator.
            #[must_use]
            pub fn model(self) -> &'static dyn SolidOperatorModel {
                match self {
                    $(Self::$operator => &$module::$operator,)*
                }
            }

            /// Name in a case.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$operator => stringify!($module),)*
                }
            }

            /// Describes each choice of the schema by the text of its operator.
            fn describe_choices(schema: &mut Schema) {
                let choices = [$((stringify!($module), $module::$operator.documentation()),)*];
                let choices = choices.map(|(name, text)| {
                    json!({"type": "string", "const": name, "description": text})
                });
                schema.remove("type");
                schema.remove("enum");
                schema.insert("oneOf".into(), json!(choices));
            }

            /// See [`SolidCollision::force_left_out`].
            fn force_left_out(self, fluid: &CoveredFluid, fraction: f64) -> f64 {
                match self {
                    $(Self::$operator => $module::$operator.force_left_out(fluid, fraction),)*
                }
            }
        }

        impl $list {
            #[inline(always)]
            fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
                self,
                covered: &CoveredFluid,
                cell: &Cell<N>,
                before: &[N; Q],
                fluid: &[N; Q],
                g: &mut [N; Q],
            ) -> Act<N> {
                match self {
                    $(Self::$operator => $module::$operator.collide::<L, N, Q>(covered, cell, before, fluid, g),)*
                }
            }
        }
    };
}

solid_operators! {
    /// Solid collision operator.
    SolidOperator:
    non_equilibrium_bounce_back NonEquilibriumBounceBack,
    superposition Superposition,
    bounce_back_about_solid BounceBackAboutSolid,
    viscosity_matched ViscosityMatched,
}

/// A solid collision operator: its interface to the program.
pub trait SolidOperatorModel {
    /// The operator in the schema of a case.
    fn documentation(&self) -> &'static str;

    /// The operator for `plan`.
    fn describe(&self) -> &'static str;

    /// Its rows in the table of measured errors (`scene::auto`): blocks, and blocks in gaps narrower than themselves.
    fn measured_rows(&self) -> [&'static str; 2];

    /// Returns `true` if it uses the weighting of a case.
    fn weighted(&self) -> bool {
        true
    }

    /// Returns `true` if it scales the rates of an operator that has one for all symmetric and one for all
    /// antisymmetric parts.
    fn needs_two_rates(&self) -> bool {
        false
    }

    /// Density ratios of free bodies whose fluid inside is left out of their inertia, from
    /// `benches/stability/README.md`.
    fn lightest(&self, body: &LightBody) -> DensityRatios;

    /// Density ratio from which on grains hold that touch others on all sides, as in a bed: there the water between
    /// them resists each one's motion within the step. From `benches/stability/README.md`; for discs and spheres of two
    /// to six cells in radius.
    fn lightest_in_a_bed(&self, body: &LightBody) -> f64;
}

/// A body that may be too light for the fluid that carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBody {
    /// `true` if the domain is 2-D.
    pub flat: bool,
    /// Radius in cells; n V/A in n dimensions for bodies that are no balls.
    pub radius: f64,
    /// Relaxation time of the fluid.
    pub relaxation_time: f64,
}

/// Relaxation times between which the density ratios were measured; beyond they are wider.
const MEASURED: core::ops::Range<f64> = 0.55..1.25;

impl LightBody {
    /// a + b/R, but not below c.
    fn falls(&self, a: f64, b: f64, c: f64) -> f64 {
        (a + b / self.radius).max(c)
    }

    /// Between the bound at a relaxation time of 0.6 and that at 0.9: spheres depend on it more than discs.
    fn rises(&self, slow: f64, fast: f64) -> f64 {
        slow + (fast - slow) * ((self.relaxation_time - 0.6) / 0.3).clamp(0.0, 1.0)
    }

    /// The relaxation time, which the bound of a bed follows, but not below `least`, nor below `slow` where it is below
    /// 0.6.
    fn time_in_a_bed(&self, least: f64, slow: f64) -> f64 {
        let least = if self.relaxation_time < 0.6 {
            slow
        } else {
            least
        };
        self.relaxation_time.max(least)
    }

    /// Returns `true` if the relaxation time is one of those that were measured.
    fn measured(&self) -> bool {
        MEASURED.contains(&self.relaxation_time)
    }
}

/// Densities of bodies over that of the fluid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityRatios {
    /// Every lighter body was unstable.
    pub fails: f64,
    /// No heavier body was unstable.
    pub holds: f64,
}

impl DensityRatios {
    /// Returns the ratios for a body: within the measured relaxation times as given, beyond them wider: every body
    /// below 0.3 fails, and bodies hold from `wider` above.
    fn for_body(body: &LightBody, fails: f64, holds: f64, wider: f64) -> Self {
        if body.measured() {
            Self { fails, holds }
        } else {
            Self {
                fails: fails.min(0.3),
                holds: holds + wider,
            }
        }
    }
}

/// Action of solids on the cells that they cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SaturationMethod {
    /// Operator that acts on the populations.
    pub operator: SolidOperator,
    /// Weight of a covered fraction.
    pub weighting: Weighting,
}

/// The fluid whose cells are covered, as the operators see it.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CoveredFluid {
    weighting: Weighting,
    /// τ - ½ of the fluid itself, also where eddies add to it: B is a matter of geometry, made when a body is mapped.
    time: f64,
    /// Rule by which the rate of the antisymmetric parts follows from that of the symmetric parts.
    antisymmetric: AntisymmetricRate,
}

/// The kernel of a solid collision operator.
trait SolidCollision: Copy {
    /// Makes the outgoing populations `g` of partially saturated cells from those that came in, `before`, and those
    /// that the collision of the fluid left, `fluid`. They are apart, so that a lane without solid is chosen in a
    /// register: a store under a mask takes several times as long.
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
        self,
        covered: &CoveredFluid,
        cell: &Cell<N>,
        before: &[N; Q],
        fluid: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N>;

    /// Returns the part of the body force on a cell filled by `fraction` that does not act on the fluid.
    fn force_left_out(self, fluid: &CoveredFluid, fraction: f64) -> f64;
}

/// Type of a pass: with or without covered cells.
pub trait Solids: Copy + Send + Sync + 'static {
    /// `true` if the pass checks for solids.
    const ACTIVE: bool;
}

/// Water only, or bodies whose links bounce.
#[derive(Clone, Copy, Debug)]
pub struct Open;

impl Solids for Open {
    const ACTIVE: bool = false;
}

/// Cells may be covered.
#[derive(Clone, Copy, Debug)]
pub struct Covered;

impl Solids for Covered {
    const ACTIVE: bool = true;
}

/// Part of what a full cell reverses that it loses: caught between two full cells it would go to and fro for ever, and
/// the force with it.
const LEAK: f64 = 1.0 / 64.0;

/// Moments of cells and their solids.
pub(crate) struct Cell<N> {
    /// ε
    fraction: N,
    drho: N,
    /// Momentum that came in.
    m: [N; 3],
    /// Velocity with half the force, and of the solid.
    u: [N; 3],
    us: [N; 3],
    /// Both times the density, and their squares.
    ru: [N; 3],
    rs: [N; 3],
    uu: N,
    ss: N,
    omega: N,
}

impl<N: Lanes> Cell<N> {
    /// Even part of the equilibrium of population i: `squared` is ρ v·v, `along` ρ (c·v)².
    #[inline(always)]
    fn even<L: Lattice<Q>, const Q: usize>(&self, i: usize, squared: N, along: N) -> N {
        let rest = self.drho - N::splat(1.5) * squared;
        N::splat(L::W[i]) * along.mul_add(N::splat(4.5), rest)
    }

    /// The equilibrium at the velocity of the solid, population by population.
    #[inline(always)]
    fn at_solid<L: Lattice<Q>, const Q: usize>(&self, mut leave: impl FnMut(usize, N)) {
        leave(0, self.even::<L, Q>(0, self.ss, N::splat(0.0)));
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let (along_u, along_m) = (along(c, &self.us), along(c, &self.rs));
            let even = self.even::<L, Q>(i, self.ss, along_m * along_u);
            let odd = N::splat(3.0 * L::W[i]) * along_m;
            leave(i, even + odd);
            leave(j, even - odd);
        });
    }
}

/// The force on the solids of a cell: -share (scale u_s + rest).
pub(crate) struct Act<N> {
    rest: [N; 3],
    scale: N,
    share: N,
}

#[cfg(test)]
mod tests;
