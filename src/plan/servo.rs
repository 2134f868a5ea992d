//! Contacts under the stress of servo walls: their overlap, and their stiffness against that of the solid step.
//!
//! A grain of diameter d in an array under the stress sigma carries a force of the order of sigma d² (2-D: sigma d): in
//! a simple cubic array exactly that. Its spring then has the overlap
//!
//! ```text
//! delta = f/k,                   of a linear spring
//! delta = (f/c)^(2/3)            where F = c delta^(3/2)
//! ```
//!
//! Single grains of a random packing carry more or less; the largest forces are several times the mean. Above an
//! overlap of [`LARGE`] of the radius contacts are no longer small, and the plan warns. Where springs harden, the solid
//! time step follows from the overlap of the fastest impact that is expected: a stress that presses deeper makes
//! springs stiffer than the step was chosen for.

use super::critical_step::moving;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use base::error::Remedy;
use base::number::to_u32;
use dem::contact::{ContactModel, Depth, StaticContact};

/// Fraction of the radius above which an overlap is no longer small.
const LARGE: f64 = 0.1;

/// A contact of two equal grains under a force.
struct PressedContact {
    /// Overlap \[m\].
    overlap: f64,
    /// Normal stiffness at this overlap [N/m].
    stiffness: f64,
    /// Stiffness for which the contact law was set up [N/m].
    expected: f64,
    /// Speed of the impact that causes this overlap [m/s]; none for springs that do not harden.
    speed: Option<f64>,
}

/// Returns the contact of two equal grains under a force \[N\].
fn contact_under_force(
    scene: &Scene,
    law: &dyn ContactModel,
    grain: (usize, f64),
    force: f64,
) -> PressedContact {
    let (material, radius) = grain;
    let mass = 0.5 * scene.mass(material, radius);
    let contact = |overlap, depth| StaticContact {
        materials: [to_u32(material); 2],
        diameter: 2.0 * radius,
        radius: 0.5 * radius,
        mass,
        overlap,
        depth,
        bonded: false,
    };
    let stiffness = |overlap, depth| law.springs(&contact(overlap, depth)).stiffness[0];
    let expected = stiffness(None, Depth::Expected);
    if law.impact_speed().is_none() {
        return PressedContact {
            overlap: force / expected,
            stiffness: expected,
            expected,
            speed: None,
        };
    }
    let known = 1e-4 * radius;
    let factor = stiffness(Some(known), Depth::Start) / (1.5 * known.sqrt());
    let overlap = (force / factor).powf(2.0 / 3.0);
    // An impact stores its energy: m v²/2 = 2/5 c delta^(5/2).
    let speed = (0.8 * factor * overlap.powf(2.5) / mass).sqrt();
    PressedContact {
        overlap,
        stiffness: 1.5 * factor * overlap.sqrt(),
        expected,
        speed: Some(speed),
    }
}

/// Compares the contacts under servo walls with the overlap that the contact law allows and with the stiffness for
/// which the solid step was chosen.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(contact) = &scene.contact else {
        return;
    };
    let law = contact.model();
    let known = |grain: &(usize, f64)| grain.0 < scene.materials.len();
    let grains: Vec<(usize, f64)> = moving(scene).into_iter().filter(known).collect();
    for (n, wall) in scene.walls.iter().enumerate() {
        let Some(servo) = &wall.servo else { continue };
        let stress = servo.largest_stress();
        let force = |radius: f64| {
            let side = 2.0 * radius;
            stress
                * if scene.grid.dimension == 2 {
                    side
                } else {
                    side * side
                }
        };
        let all = grains.iter().map(|grain| {
            (
                grain.1,
                contact_under_force(scene, law, *grain, force(grain.1)),
            )
        });
        let deepest = all.max_by(|a, b| (a.1.overlap / a.0).total_cmp(&(b.1.overlap / b.0)));
        let Some((radius, deepest)) = deepest else {
            continue;
        };
        let part = deepest.overlap / radius;
        let path = format!("walls[{n}].servo");
        if part > LARGE {
            findings.warn(
                &path,
                format!(
                    "under a stress of {} Pa grains overlap by about {} of their radius of {} m; the overlap \
                     should be at most {LARGE} of the radius",
                    number(stress),
                    number(part),
                    number(radius)
                ),
                "use stiffer contacts or a smaller stress",
            );
        }
        let (Some(speed), Some((_, field))) = (deepest.speed, law.impact_speed()) else {
            continue;
        };
        if deepest.stiffness > deepest.expected {
            let least = 1.01 * speed;
            findings.unstable(
                &path,
                format!(
                    "a stress of {} Pa raises the contact stiffness to {} N/m, but the solid time step is chosen \
                     for {} N/m",
                    number(stress),
                    number(deepest.stiffness),
                    number(deepest.expected)
                ),
                Remedy::from(format!(
                    "set {field} to at least {} m/s, the speed of an impact with the same overlap",
                    number(least)
                ))
                .set(field, least),
            );
        }
    }
}
