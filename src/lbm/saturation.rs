//! Partially saturated cells: the collision of a cell with solid fraction ε is a mixture of a fluid and a solid
//! collision.
//!
//! ```text
//! f_i* = f_i + (1 - B) (Ω_i + S_i) + B Ω^s_i
//! ```
//!
//! Ω_i is the collision of the fluid, S_i its source term of the body force, Ω^s_i the solid collision operator (one
//! file each), and B the weighting of ε ([`Weighting`]). The force of a cell on the solid equals, up to rounding, the
//! momentum that the fluid loses, -B Σ c_i Ω^s_i. The mass of a cell is conserved. This method is separate from moving
//! links ([`super::links`]), which do not change the collision. Sources: D. R. Noble, J. R. Torczynski, Int. J. Mod.
//! Phys. C 9 (1998) 1189; D. J. Holdych, PhD thesis, Urbana (2003); D. R. J. Owen, C. R. Leonardi, Y. T. Feng, Int. J.
//! Numer. Meth. Eng. 87 (2011) 66.
//!
//! **Several bodies in a cell.** B(ε) is evaluated for the sum of their fractions, limited to 1, and divided in
//! proportion to the fractions, so that two blocks that together fill a cell close it. The solid velocity of the cell
//! is the mean of the velocities of the bodies, weighted by their fractions. Each body receives its part of the force,
//! and the parts add up to the momentum that the fluid loses. The force is evaluated at the mean velocity: at the
//! individual velocities, two bodies with parts a and b would exchange a b ρ (u_a - u_b) per step, an unphysical drag
//! between them.
//!
//! **Deep inside** a body, where no neighbouring cell contains fluid, the populations are set to the equilibrium at the
//! velocity of the solid. Otherwise nothing would damp the populations that enter from the surface: bodies that slide
//! on each other would set the internal fluid in motion until it transports momentum through them, and this fluid would
//! appear in cells that become uncovered.
//!
//! **Weight inside.** The body force acts on the fluid inside a solid as well: the solid gives it the part B that S_i
//! leaves out, so that the sum of both is the force F of a cell of water. Ω^s_i acts on the populations with half of
//! this force, f_i + 3 w_i c_i·F/2, and gives the other half afterwards. In water at rest the content of a body thus
//! has the pressure of the water around it at every height, at any time, and passes it on to a wall or another body
//! below. Without it the content would tend to a uniform pressure, and the uplift on a body on the ground with it. The
//! total force on a body is that of the water on its surface in both cases. Along periodic axes, where no pressure
//! balances a body force, it does not act inside.
//!
//! **Full cells** at a surface, and between bodies in contact, reverse populations with a loss of 1/64. An undamped
//! exchange between two full cells would oscillate indefinitely, and grow at high Reynolds numbers.
//!
//! **Bodies in contact**, and a body in contact with a stationary wall of the domain, exchange pressure but no drag
//! through full cells (`contact.rs`).
//!
//! A cell stores ε (f32) and its body ([`cover`]) in addition to the populations: 8 bytes. The loop tests once per
//! vector of cells whether any of them is covered, and then selects the operator; all other code of this module runs
//! for covered cells only (`pass.rs`).

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

/// Defines the list of solid collision operators: their modules, and the enum from which a case selects. The name of an
/// operator in a case is that of its module.
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
            /// Operators of the list.
            pub const ALL: &[Self] = &[$(Self::$operator,)*];

            /// Returns the interface of the operator to the program.
            #[must_use]
            pub fn model(self) -> &'static dyn SolidOperatorModel {
                match self {
                    $(Self::$operator => &$module::$operator,)*
                }
            }

            /// Returns the name of the operator in a case.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$operator => stringify!($module),)*
                }
            }

            /// Sets the description of each choice in the schema to the text of its operator.
            fn describe_choices(schema: &mut Schema) {
                let choices = [$((stringify!($module), $module::$operator.documentation()),)*];
                let choices = choices.map(|(name, text)| {
                    json!({"type": "string", "const": name, "description": text})
                });
                schema.remove("type");
                schema.remove("enum");
                schema.insert("oneOf".into(), json!(choices));
            }

            /// Returns the result of [`SolidCollision::force_left_out`] for the selected operator.
            fn force_left_out(self, fluid: &CoveredFluid, fraction: f64) -> f64 {
                match self {
                    $(Self::$operator => $module::$operator.force_left_out(fluid, fraction),)*
                }
            }
        }

        impl $list {
            /// Calls [`SolidCollision::collide`] of the selected operator.
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

/// Interface of a solid collision operator to the program.
pub trait SolidOperatorModel {
    /// Returns the description of the operator in the schema of a case.
    fn documentation(&self) -> &'static str;

    /// Returns the name of the operator in the output of `plan`.
    fn describe(&self) -> &'static str;

    /// Returns the rows of the operator in the table of measured errors (`scene::auto`): that of blocks, and that of
    /// blocks in gaps narrower than the blocks.
    fn measured_rows(&self) -> [&'static str; 2];

    /// Returns `true` if the operator uses the weighting of a case.
    fn weighted(&self) -> bool {
        true
    }

    /// Returns `true` if the operator requires a fluid collision with one rate for all symmetric parts and one for all
    /// antisymmetric parts, which it scales.
    fn needs_two_rates(&self) -> bool {
        false
    }

    /// Returns the limits of stability in the density ratio of free bodies whose inertia excludes the fluid inside
    /// them, from `benches/stability/README.md`.
    fn lightest(&self, body: &LightBody) -> DensityRatios;

    /// Returns the minimum density ratio at which grains that touch others on all sides, as in a bed, are stable. The
    /// limit is higher than for a free body, because the water between the grains resists the motion of each grain
    /// within the step. The values are those of `benches/stability/README.md` for discs and spheres with a radius of
    /// two to six cells.
    fn lightest_in_a_bed(&self, body: &LightBody) -> f64;
}

/// Properties of a body and its fluid on which the minimum stable density ratio depends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBody {
    /// `true` if the domain is 2-D.
    pub flat: bool,
    /// Radius \[cells\]; n V/A in n dimensions for bodies other than balls, with volume V and surface A.
    pub radius: f64,
    /// Relaxation time τ of the fluid \[steps\].
    pub relaxation_time: f64,
}

/// Range of relaxation times \[steps\] in which the density ratios were measured; outside, a margin is added.
const MEASURED: core::ops::Range<f64> = 0.55..1.25;

impl LightBody {
    /// Returns a + b/R, but at least c.
    fn by_radius(&self, a: f64, b: f64, c: f64) -> f64 {
        (a + b / self.radius).max(c)
    }

    /// Interpolates between the limit at a relaxation time of 0.6 (`slow`) and that at 0.9 (`fast`), for spheres, whose
    /// limits depend on the relaxation time more than those of discs.
    fn by_time(&self, slow: f64, fast: f64) -> f64 {
        slow + (fast - slow) * ((self.relaxation_time - 0.6) / 0.3).clamp(0.0, 1.0)
    }

    /// Returns the relaxation time on which the limit of a bed depends: at least `least`, or at least `slow` if
    /// the relaxation time of the fluid is below 0.6.
    fn time_in_a_bed(&self, least: f64, slow: f64) -> f64 {
        let least = if self.relaxation_time < 0.6 {
            slow
        } else {
            least
        };
        self.relaxation_time.max(least)
    }

    /// Returns `true` if the relaxation time is in the measured range.
    fn measured(&self) -> bool {
        MEASURED.contains(&self.relaxation_time)
    }
}

/// Limits of stability in the ratio of the density of a body to that of the fluid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityRatios {
    /// Ratio below which every body was unstable.
    pub fails: f64,
    /// Ratio above which no body was unstable.
    pub holds: f64,
}

impl DensityRatios {
    /// Returns the limits for a body. In the measured range of relaxation times they are as given; outside, `fails` is
    /// at most 0.3 and `holds` is increased by `wider`.
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

/// Method by which solids act on the cells that they cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SaturationMethod {
    /// Operator that acts on the populations.
    pub operator: SolidOperator,
    /// Weighting of the solid fraction.
    pub weighting: Weighting,
}

/// Parameters of the fluid that the solid collision operators need.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CoveredFluid {
    weighting: Weighting,
    /// τ - ½ of the fluid without eddy viscosity: B is a property of the surface, where the eddy viscosity vanishes.
    time: f64,
    /// Rule that gives the rate of the antisymmetric parts from that of the symmetric parts.
    antisymmetric: AntisymmetricRate,
}

/// Kernel of a solid collision operator.
trait SolidCollision: Copy {
    /// Computes the outgoing populations `g` of partially saturated cells from the incoming ones, `before`, and those
    /// after the fluid collision, `fluid`. The three arrays are separate, so that the result of a lane without solid is
    /// selected in a register: a masked store takes several times as long.
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
        self,
        covered: &CoveredFluid,
        cell: &Cell<N>,
        before: &[N; Q],
        fluid: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N>;

    /// Returns the fraction of the body force of a cell that does not act on the fluid, given the solid fraction of the
    /// cell.
    fn force_left_out(self, fluid: &CoveredFluid, fraction: f64) -> f64;
}

/// Property of a pass: with or without covered cells.
pub trait Solids: Copy + Send + Sync + 'static {
    /// `true` if the pass checks for covered cells.
    const ACTIVE: bool;
}

/// Pass without covered cells: fluid only, or bodies with moving links.
#[derive(Clone, Copy, Debug)]
pub struct Open;

impl Solids for Open {
    const ACTIVE: bool = false;
}

/// Pass over cells that may be covered.
#[derive(Clone, Copy, Debug)]
pub struct Covered;

impl Solids for Covered {
    const ACTIVE: bool = true;
}

/// Relative loss of the populations that a full cell reverses. Without it, populations between two full cells would
/// oscillate indefinitely, and the force with them.
const LEAK: f64 = 1.0 / 64.0;

/// Moments of the fluid and of the solids in `N::WIDTH` cells.
pub(crate) struct Cell<N> {
    /// Solid fraction ε, 0 … 1.
    fraction: N,
    /// Density deviation δρ.
    drho: N,
    /// Momentum Σ c f of the incoming populations.
    m: [N; 3],
    /// Velocity u of the fluid, which includes half the force, and velocity u_s of the solid.
    u: [N; 3],
    us: [N; 3],
    /// ρ u and ρ u_s, then ρ u·u and ρ u_s·u_s.
    ru: [N; 3],
    rs: [N; 3],
    uu: N,
    ss: N,
    /// Relaxation rate ω of the fluid.
    omega: N,
    /// Half of the body force on the fluid inside solids.
    inside: [N; 3],
}

impl<N: Lanes> Cell<N> {
    /// Returns the symmetric part of the equilibrium of population i at a velocity v: `squared` is ρ v·v, `along` is
    /// ρ (c·v)².
    #[inline(always)]
    fn even<L: Lattice<Q>, const Q: usize>(&self, i: usize, squared: N, along: N) -> N {
        let rest = self.drho - N::splat(1.5) * squared;
        N::splat(L::W[i]) * along.mul_add(N::splat(4.5), rest)
    }

    /// Calls `leave` with each population of the equilibrium at the velocity of the solid and half of the body force.
    #[inline(always)]
    fn at_solid<L: Lattice<Q>, const Q: usize>(&self, mut leave: impl FnMut(usize, N)) {
        leave(0, self.even::<L, Q>(0, self.ss, N::splat(0.0)));
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let (along_u, along_m) = (along(c, &self.us), along(c, &self.rs));
            let even = self.even::<L, Q>(i, self.ss, along_m * along_u);
            let odd = N::splat(3.0 * L::W[i]) * (along_m + along(c, &self.inside));
            leave(i, even + odd);
            leave(j, even - odd);
        });
    }
}

/// Force on the solids of a cell, -`share` (`scale` u_s + `rest`) in lattice units.
pub(crate) struct Act<N> {
    rest: [N; 3],
    scale: N,
    share: N,
}

#[cfg(test)]
mod tests;
