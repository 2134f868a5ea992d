//! Reynolds number of the pores, estimated before the run.
//!
//! ```text
//! Re = rho q d/mu        q: superficial velocity, d: diameter of the largest grains
//! ```
//!
//! Darcy's law holds up to about Re = 1 to 10 (J. Bear, Dynamics of Fluids in Porous Media, 1972, section 5.11):
//! beyond, inertial losses grow with the square of the velocity. The flux is the largest imposed flux, or that
//! driven by the largest difference of imposed pressures over the height of the grid through a bed of equal grains
//! in random close packing (with zones: in the most permeable zone). The run computes the Reynolds number again
//! from the solution.

use super::explicit_drag;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use base::error::Remedy;
use darcy::Equations;
use serde_json::json;

/// Reynolds number above which inertial losses matter.
const DARCY: f64 = 1.0;
/// Porosity of equal spheres in random packing.
const PACKED_POROSITY: f64 = 0.4;
const PATH: &str = "fluid.darcy.resistance";

/// Returns the Reynolds number of the pores; none without seepage, grains or drive.
#[must_use]
pub fn reynolds(scene: &Scene) -> Option<f64> {
    let seepage = scene.seepage.as_ref()?;
    let (_, radius) = scene.grains.as_ref()?.radii?;
    let (written, diameter) = (&seepage.written, 2.0 * radius);
    let liquid = written.liquid();
    let height = seepage.height(scene.gravity, scene.grid.dimension);
    let gradient = seepage.pressure_drop(scene.gravity) / height;
    // The permeability does not cover looser ground than its maximum porosity.
    let porosity = explicit_drag::porosity(scene, seepage)
        .max(PACKED_POROSITY)
        .min(written.porosity_cap().max(PACKED_POROSITY));
    let beds = explicit_drag::bed_properties(seepage, (porosity, diameter), liquid, gradient);
    let permeability = beds.into_iter().fold(0.0, |most, (_, k)| k.max(most));
    let driven = permeability * gradient / liquid.viscosity;
    let imposed = seepage.patches.iter();
    let imposed = imposed.filter_map(|patch| patch.condition.flux().map(f64::abs));
    let flux = imposed.fold(driven, f64::max);
    let reynolds = liquid.density * flux * diameter / liquid.viscosity;
    (reynolds.is_finite() && reynolds > 0.0).then_some(reynolds)
}

/// Warns if a linear resistance is used outside its range of validity.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let (Some(seepage), Some(reynolds)) = (&scene.seepage, reynolds(scene)) else {
        return;
    };
    let written = &seepage.written;
    if written.resistance().model().depends_on_the_gradient() || reynolds <= DARCY {
        return;
    }
    let text =
        "use a resistance with inertial losses, such as \"gidaspow\", or check the pressures";
    let mut remedy = Remedy::from(text).set(PATH, "gidaspow");
    if written.equations == Equations::Paper {
        remedy = remedy.set("fluid.darcy.equations", json!("corrected"));
    }
    findings.warn(
        PATH,
        format!(
            "the Reynolds number of the seepage (density x flux x diameter / viscosity) is about {}: inertial \
             losses matter above about {}, and a resistance proportional to the flux overestimates the flux",
            number(reynolds),
            number(DARCY)
        ),
        remedy,
    );
}
