//! Two relaxation times (I. Ginzburg, F. Verhaeghe, D. d'Humières, Commun. Comput. Phys. 3 (2008) 427), with Guo
//! forcing.
//!
//! The symmetric part of each pair of opposite populations, their half sum, relaxes at ω⁺ = 1/τ, which sets the
//! viscosity ν = (τ - ½)/3. The antisymmetric part, their half difference, relaxes at ω⁻. The product Λ =
//! (1/ω⁺ - ½)(1/ω⁻ - ½) fixes the position of a half-way wall, independently of the viscosity: Λ = 3/16 puts
//! it exactly half-way in Poiseuille flow, Λ = 1/4 is the most stable choice.

pub mod kernel;

pub use kernel::{AntisymmetricRate, Trt, antisymmetric_rate};

use super::border::{self, Border, MovingBody, ReynoldsBounds, Situation, Surroundings};
use super::{CollisionModel, Dispatch, Kernels};
use crate::lattice::VelocitySet;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Two relaxation times (Ginzburg et al. 2008). The position of walls does not depend on the viscosity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct TrtParameters {
    /// Magic parameter (tau+ - 1/2)(tau- - 1/2) \[1\]. With 3/16 straight walls lie exactly half-way between nodes.
    #[serde(default = "three_sixteenths")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 10))]
    pub magic: f64,
}

fn three_sixteenths() -> f64 {
    0.1875
}

impl Default for TrtParameters {
    fn default() -> Self {
        Self {
            magic: three_sixteenths(),
        }
    }
}

const FREE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.21, 30.0, 60.0),
    ReynoldsBounds::up_to(f64::INFINITY, 1.7, 8.4),
];
const LID: &[ReynoldsBounds] = &ReynoldsBounds::always(20.0, 28.0);
const CUBE: &[ReynoldsBounds] = &ReynoldsBounds::always(20.0, 30.0);
/// Bounds in a duct with D3Q19. Outside the map, a duct of 24 cells failed at 7.7.
const DUCT_19: [ReynoldsBounds; 1] = ReynoldsBounds::always(6.9, 7.6);
const DUCT_27: [ReynoldsBounds; 1] = ReynoldsBounds::always(10.0, 10.5);

impl CollisionModel for TrtParameters {
    fn describe(&self, _: f64) -> Description {
        Description::new(
            format!("TRT, magic parameter {}", self.magic),
            "the position of walls does not depend on the viscosity",
        )
    }

    fn antisymmetric_rate(&self) -> Option<AntisymmetricRate> {
        Some(AntisymmetricRate::Magic(self.magic))
    }

    fn border(&self, situation: &Situation) -> Option<Border> {
        border_of_two_rates(situation, FREE, LID, CUBE, [&DUCT_19, &DUCT_27], false)
    }

    fn border_of_moving(&self, body: &MovingBody) -> Option<Border> {
        Some(body.border(border::SPHERE))
    }

    fn fails_at_faces(&self) -> f64 {
        20.0
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_any_set(*self)
    }

    fn dispatch_single<D: Dispatch>(&self, to: D) -> Option<D::Output> {
        Some(self.dispatch(to))
    }
}

/// Returns the stability limit of an operator with one or two rates from its bounds in each scene: without walls in
/// 2-D, under a lid in 2-D, in 3-D, and in a duct between openings with D3Q19 and with D3Q27; `single` if both rates
/// are equal.
///
/// With an eddy viscosity, turbulent Taylor-Green vortices failed with WALE and with Smagorinsky
/// (`benches/accuracy/eddy-models`), and so did ducts between openings, in which operators with more rates are
/// stable.
pub(super) fn border_of_two_rates(
    situation: &Situation,
    free: &'static [ReynoldsBounds],
    lid: &'static [ReynoldsBounds],
    cube: &'static [ReynoldsBounds],
    duct: [&'static [ReynoldsBounds]; 2],
    single: bool,
) -> Option<Border> {
    let open = situation.surroundings == Surroundings::Openings;
    if situation.eddies && open && !situation.lid_meets_wall {
        return Some(border::DUCT_WITH_EDDIES);
    }
    if situation.duct() {
        let [of_19, of_27] = duct;
        let more = situation.velocities == VelocitySet::D3Q27;
        return Some(border::duct(if more { of_27 } else { of_19 }));
    }
    Some(
        match (situation.surroundings, situation.velocities.dimension()) {
            (Surroundings::Openings, _) => border::CYLINDER[usize::from(single)],
            (Surroundings::Periodic, 2) => Border {
                map: "shear-layers-64",
                bounds: free,
            },
            (_, 2) => Border {
                map: "cavity-32",
                bounds: lid,
            },
            _ => border::cube(cube),
        },
    )
}

impl Kernels for TrtParameters {
    type Uniform<const FORCED: bool> = Trt<FORCED>;
    type Local = Trt<true>;
    type Covered = Trt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Trt<FORCED> {
        Trt {
            omega,
            antisymmetric: AntisymmetricRate::Magic(self.magic),
            force,
        }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        self.uniform(omega, force)
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        self.uniform(omega, force)
    }
}
