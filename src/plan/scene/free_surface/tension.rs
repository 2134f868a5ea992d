//! Surface tension of a scene, with the faces at which the water has a contact angle.

use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, LATTICE_PATH};
use base::error::Remedy;
use case::Case;
use case::fluid::LatticeBoltzmann;
use case::free_surface::FreeSurface as Written;
use lbm::boundary::SurfaceKind;
use serde::Serialize;

/// Surface tension of the water.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tension {
    /// Surface tension [N/m].
    pub value: f64,
    /// Contact angle at the walls, in the water \[degrees\].
    pub contact_angle: f64,
    /// `true` for each end of the axes that is a wall with this angle; elsewhere the angle is 90 degrees.
    pub walls: [[bool; 2]; 3],
}

/// Largest surface tension in lattice units, σ dt²/(ρ h³): the speed of the shortest waves stays far below that of
/// sound, and their period above the step.
const MAX_TENSION: f64 = 0.02;

impl Tension {
    /// Returns the longest time step \[s\] for a density [kg/m³] and a cell size \[m\].
    #[must_use]
    pub fn step_limit(&self, density: f64, spacing: f64) -> f64 {
        (MAX_TENSION * density * spacing.powi(3) / self.value).sqrt()
    }

    /// Returns the contact angle at each end of the axes \[rad\].
    #[must_use]
    pub fn contact_angles(&self) -> [[f64; 2]; 3] {
        let angle = |wall: bool| if wall { self.contact_angle } else { 90.0 };
        self.walls
            .map(|ends| ends.map(|wall| angle(wall).to_radians()))
    }

    /// Returns the capillary length (σ/(ρ g))^½ \[m\]; infinite without gravity.
    #[must_use]
    pub fn capillary_length(&self, density: f64, gravity: f64) -> f64 {
        (self.value / (density * gravity)).sqrt()
    }
}

/// Returns the surface tension of a case; reports features that do not work with it.
pub(super) fn resolve(
    case: &Case,
    (lbm, written): (&LatticeBoltzmann, &Written),
    patches: &[Vec<ScenePatch>; 6],
    findings: &mut Findings,
) -> Option<Tension> {
    let angle = format!("{LATTICE_PATH}.surface.contact_angle_degrees");
    let path = format!("{LATTICE_PATH}.surface.surface_tension");
    let Some(value) = written.surface_tension else {
        if written.contact_angle_degrees.is_some() {
            findings.error(
                &angle,
                "without surface tension the contact angle has no effect",
                Remedy::take_out("add `surface_tension`, or remove the angle", &angle),
            );
        }
        return None;
    };
    let bodies = !case.bodies.is_empty() || case.grains.is_some() || case.blocks.is_some();
    for (there, what) in [
        (bodies, "bodies, grains and blocks"),
        (!case.structures.is_empty(), "structures"),
        (lbm.joints.is_some(), "water in joints"),
    ] {
        if there {
            findings.error(
                &path,
                format!("surface tension is not verified with {what}: the water has no contact angle there"),
                Remedy::take_out("remove the surface tension, or the solids", &path),
            );
        }
    }
    let is_wall = |face: &Vec<ScenePatch>| {
        let kind = |patch: &ScenePatch| patch.condition.model().kind().surface;
        face.iter()
            .all(|patch| matches!(kind(patch), SurfaceKind::Wall | SurfaceKind::MovingWall))
    };
    Some(Tension {
        value,
        contact_angle: written.contact_angle_degrees.unwrap_or(90.0),
        walls: std::array::from_fn(|axis| [0, 1].map(|end| is_wall(&patches[2 * axis + end]))),
    })
}
