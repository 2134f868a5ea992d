//! Single relaxation time (P. L. Bhatnagar, E. P. Gross, M. Krook, Phys. Rev. 94 (1954) 511), with Guo forcing.
//!
//! f_i ← f_i - ω (f_i - f_i^eq) + (1 - ω/2) w_i [3 (c - u) + 9 (c·u) c]·F, ω = 1/τ, ν = (τ - ½)/3 in lattice
//! units. The position of a half-way wall depends on τ: it is exactly half-way only at τ = ½ + √3/4.

pub mod kernel;

pub use kernel::Bgk;

use super::border::{self, Border, MovingBody, ReynoldsBounds, Situation};
use super::trt::{self, AntisymmetricRate, Trt};
use super::{CollisionModel, Dispatch, Kernels};
use base::error::number;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One relaxation time for all moments (Bhatnagar, Gross and Krook 1954). The position of walls depends on tau.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct BgkParameters {}

const FREE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.21, 180.0, 200.0),
    ReynoldsBounds::up_to(f64::INFINITY, 1.7, 8.4),
];
const LID: &[ReynoldsBounds] = &ReynoldsBounds::always(10.0, 18.0);
const CUBE: &[ReynoldsBounds] = &ReynoldsBounds::always(10.0, 20.0);
const DUCT_19: [ReynoldsBounds; 1] = ReynoldsBounds::always(9.0, 10.0);
const DUCT_27: [ReynoldsBounds; 1] = ReynoldsBounds::always(15.0, 17.6);
const CUBE_EDDIES: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.03, 30.0, 90.0),
    ReynoldsBounds::up_to(f64::INFINITY, 10.0, 20.0),
];

impl CollisionModel for BgkParameters {
    fn describe(&self, relaxation_time: f64) -> Description {
        let tau = number(relaxation_time);
        Description::new(
            "BGK",
            format!(
                "requested; walls lie half-way between cells only near tau = 0.933 (here tau = {tau})"
            ),
        )
    }

    fn antisymmetric_rate(&self) -> Option<AntisymmetricRate> {
        Some(AntisymmetricRate::AsSymmetric)
    }

    fn border(&self, situation: &Situation) -> Option<Border> {
        trt::border_of_two_rates(
            situation,
            FREE,
            LID,
            if situation.eddies { CUBE_EDDIES } else { CUBE },
            [&DUCT_19, &DUCT_27],
            true,
        )
    }

    fn border_of_moving(&self, body: &MovingBody) -> Option<Border> {
        Some(body.border(border::SPHERE))
    }

    fn fails_at_faces(&self) -> f64 {
        2.0
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_any_set(*self)
    }

    fn dispatch_single<D: Dispatch>(&self, to: D) -> Option<D::Output> {
        Some(self.dispatch(to))
    }
}

/// Kernels: cells with different viscosities use the passes of TRT with equal rates.
impl Kernels for BgkParameters {
    type Uniform<const FORCED: bool> = Bgk<FORCED>;
    type Local = Trt<true>;
    type Covered = Trt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Bgk<FORCED> {
        Bgk { omega, force }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        Trt {
            omega,
            antisymmetric: AntisymmetricRate::AsSymmetric,
            force,
        }
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        self.local(omega, force)
    }
}
