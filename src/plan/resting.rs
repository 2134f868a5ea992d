//! Dashpots that keep discs and spheres at rest in partially saturated cells.
//!
//! The load of the water on a body is that of its motion in the last two steps of the lattice
//! ([`coupling::partially_saturated`]). A body that lies on others oscillates against the shear springs of its contacts
//! with the angular frequency w, w² = k_s (1/m + R²/I), in the plane 3 k_s/m and in space 3.5 k_s/m. The delay of the
//! load turns a part of the inertia of the water into a negative damping: for w dt of 0.6 and more bodies at rest shook
//! themselves, from rounding errors up to about 1 mm/s, where friction limits them. Dashpots dissipate more than the
//! delay supplies: with a damping ratio of 0.2 every body stayed at rest, with 0.1 most did
//! (`benches/stability/resting.csv`, `resting-3d.csv`).

use super::critical_step::moving;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use base::error::Remedy;
use base::number::to_u32;
use case::coupling::Coupling;
use dem::contact::{ContactModel, Depth, StaticContact};

/// Least damping ratio of the shear dashpots with which every measured body stayed at rest.
const DAMPED: f64 = 0.2;
/// Least value of w dt from which on bodies are judged; the softest that shook had 0.6.
const FREQUENCY: f64 = 0.4;
/// Damping ratio of the normal dashpots that keeps light bodies from bouncing, up to which density ratio they are
/// light, and the range of w dt in which they bounced with 0.2.
const DAMPED_NORMAL: f64 = 0.3;
const LIGHT: f64 = 1.5;
const BOUNCING: [f64; 2] = [0.7, 3.0];

/// Returns the damping ratio and the angular frequency \[1/s\] of a disc or sphere in contact with a body that does not
/// move: against the normal spring, and rolling against the shear spring.
fn oscillations(
    scene: &Scene,
    law: &dyn ContactModel,
    (material, radius): (usize, f64),
    other: usize,
) -> [(f64, f64); 2] {
    let mass = scene.mass(material, radius);
    let springs = law.springs(&StaticContact {
        materials: [to_u32(material), to_u32(other)],
        diameter: 2.0 * radius,
        radius,
        mass,
        overlap: None,
        depth: Depth::Expected,
        bonded: false,
    });
    // (1/m + R²/I) m.
    let rolling = if scene.grid.dimension == 2 { 3.0 } else { 3.5 };
    [(0, 1.0), (1, rolling)].map(|(kind, lever)| {
        let (stiffness, dashpot) = (springs.stiffness[kind], springs.dashpots[kind]);
        let ratio = dashpot / (2.0 * (mass * stiffness).sqrt());
        (ratio, (lever * stiffness / mass).sqrt())
    })
}

/// Warns of springs whose dashpots may not keep a body at rest.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let (Some(flow), Some(Coupling::PartiallySaturated(cells)), Some(contact)) =
        (&scene.flow, &scene.coupling, &scene.contact)
    else {
        return;
    };
    if !cells.exclude_inner_fluid {
        return;
    }
    let law = contact.model();
    let Some([normal_path, path]) = law.damping_paths() else {
        return;
    };
    let count = scene.materials.len();
    let known = |grain: &(usize, f64)| grain.0 < count && grain.1 > 0.0;
    let pairs = moving(scene).into_iter().filter(known);
    let pairs = pairs.flat_map(|grain| (0..count).map(move |other| (grain, other)));
    let springs: Vec<_> = pairs
        .map(|(grain, other)| {
            let light = scene.density(grain.0) < LIGHT * flow.density;
            (light, oscillations(scene, law, grain, other))
        })
        .collect();
    let step = flow.time_step;
    let least = |weak: &dyn Fn(bool, f64, f64) -> bool, kind: usize| {
        let of_kind = springs.iter().map(|(light, both)| (*light, both[kind]));
        let weak = of_kind.filter(|(light, (damping, w))| weak(*light, *damping, w * step));
        weak.map(|(_, spring)| spring)
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let shear = |_: bool, damping: f64, w: f64| w > FREQUENCY && damping < DAMPED * (1.0 - 1e-9);
    if let Some((damping, w)) = least(&shear, 1) {
        findings.warn(
            path,
            format!(
                "the dashpots of the shear springs have {} of critical damping, and bodies oscillate against these \
                 springs with w dt = {}: in partially saturated cells the load of the water follows the motion with a \
                 delay, and discs at rest with a damping ratio below {DAMPED} shook at up to 1 mm/s",
                number(damping),
                number(w * step)
            ),
            Remedy::from(format!(
                "write {DAMPED} or more, or omit it with a normal damping ratio of {DAMPED} or more"
            ))
            .set(path, DAMPED),
        );
    }
    let normal = |light: bool, damping: f64, w: f64| {
        light && (BOUNCING[0]..BOUNCING[1]).contains(&w) && damping < DAMPED_NORMAL * (1.0 - 1e-9)
    };
    if let Some((damping, w)) = least(&normal, 0) {
        findings.warn(
            normal_path,
            format!(
                "the dashpots of the normal springs have {} of critical damping, and bodies of less than {LIGHT} times \
                 the density of the water oscillate against these springs with w dt = {}: in partially saturated cells \
                 such discs bounced on the floor at up to 2 mm/s, and lay still with a damping ratio of \
                 {DAMPED_NORMAL}",
                number(damping),
                number(w * step)
            ),
            Remedy::from(format!("write {DAMPED_NORMAL} or more")).set(normal_path, DAMPED_NORMAL),
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use serde_json::json;

    /// Returns the number of warnings about shear dashpots of a disc on a floor, with this contact law and coupling.
    fn warnings(law: &serde_json::Value, coupling: &serde_json::Value) -> usize {
        warnings_of("shear", 1500.0, law, coupling)
    }

    /// Returns the number of warnings about normal or shear dashpots of a disc of some density on a floor.
    fn warnings_of(
        kind: &str,
        density: f64,
        law: &serde_json::Value,
        coupling: &serde_json::Value,
    ) -> usize {
        let case = json!({
            "domain": {"size": [0.02, 0.012], "spacing": 0.0005},
            "gravity": [0, -9.81],
            "materials": {"stone": {"density": density}, "floor": {}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "time_step": 2e-4}},
            "contact": {"linear": law},
            "box_walls": ["x_min", "x_max", "y_min", "y_max"],
            "box_wall_material": "floor",
            "coupling": coupling,
            "bodies": [{"name": "b", "shape": {"disc": {"radius": 0.0015}}, "position": [0.01, 0.0015],
                        "motion": {"free": {}}, "material": "stone"}],
            "time": {"end": 0.2},
            "output": {},
        });
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let all = plan.warnings.iter();
        let path = format!("contact.linear.{kind}_damping_ratio");
        all.filter(|w| w.path == path).count()
    }

    #[test]
    fn dashpots_that_may_not_keep_a_body_at_rest_are_named() {
        let cells = json!({"partially_saturated": {}});
        let law = |normal: f64, k: f64| {
            json!({"friction_angle_degrees": 20, "normal_damping_ratio": normal,
                   "normal_stiffness": {"absolute": k}})
        };
        let stated = |damping: f64| {
            let mut law = law(0.2, 1e5);
            law["shear_damping_ratio"] = json!(damping);
            law
        };
        assert_eq!(warnings(&stated(0.0), &cells), 1);
        assert_eq!(warnings(&stated(0.1), &cells), 1);
        assert_eq!(warnings(&stated(0.2), &cells), 0);
        // Without a shear dashpot in the case it is that of the normal spring.
        assert_eq!(warnings(&law(0.2, 1e5), &cells), 0);
        assert_eq!(warnings(&law(0.05, 1e5), &cells), 1);
        // Soft springs follow the load; links have no such delay.
        assert_eq!(warnings(&law(0.05, 1e3), &cells), 0);
        assert_eq!(warnings(&stated(0.0), &json!({"bounce_back": {}})), 0);
        // Bodies little heavier than the water bounce with the normal dashpots that hold heavier ones.
        assert_eq!(warnings_of("normal", 1200.0, &law(0.2, 2e5), &cells), 1);
        assert_eq!(warnings_of("normal", 1200.0, &law(0.3, 2e5), &cells), 0);
        assert_eq!(warnings_of("normal", 2600.0, &law(0.2, 4e5), &cells), 0);
    }
}
