//! Automatic choice of the coupling of solids and fluid, and of the contact law.

use super::{Subject, seepage, step};
use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::contact::{ContactTable, fastest_approach};
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use base::error::Remedy;
use base::vector::norm;
use case::Case;
use case::contact::Contact;
use case::coupling::{BounceBack, Coupling, PartiallySaturated, Scheme};
use case::grains::GrainSource as Initial;
use case::solids::Motion;
use dem::contact::{Scaled, blocks, hertz_mindlin, linear};
use serde_json::json;

/// Maximum overlap for a chosen spring stiffness, in diameters.
const OVERLAP: f64 = 0.01;
/// Default friction angle and damping ratio.
const FRICTION_DEGREES: f64 = 30.0;
const DAMPING: f64 = 0.2;
const RESTITUTION: f64 = 0.5;

/// Returns the coupling for the shapes of a case, and the reason.
pub(crate) fn coupling(case: &Case) -> (Coupling, &'static str) {
    if super::features::lattice(case).is_some_and(|lbm| lbm.surface.is_some()) {
        let cells = Coupling::PartiallySaturated(PartiallySaturated::default());
        return (
            cells,
            "water with a free surface: links of moving bodies do not work with it",
        );
    }
    if case.blocks.is_some() || case.bodies.iter().any(|body| !body.shape.round()) {
        let cells = Coupling::PartiallySaturated(PartiallySaturated::default());
        return (
            cells,
            "bodies with plane faces: joints and gaps narrower than a cell still conduct water and transmit its \
             pressure",
        );
    }
    if lie_packed(case) {
        let cells = Coupling::PartiallySaturated(PartiallySaturated::default());
        return (
            cells,
            "packed grains: their pores are narrower than cells, where links trap moving water and interpolation \
             loses mass",
        );
    }
    let links = BounceBack {
        scheme: Scheme::Interpolated,
        ..BounceBack::default()
    };
    let reason = "discs and spheres: this coupling has the smallest error at every number of cells";
    (Coupling::BounceBack(links), reason)
}

/// Returns `true` if spheres grow or settle into a packing. In 3-D water flows through the packing; in 2-D touching
/// discs close the pores with any coupling.
fn lie_packed(case: &Case) -> bool {
    /// Number of neighbours of a sphere in a loose packing.
    const NEIGHBOURS: u32 = 6;
    let many = match case.grains.as_ref().map(|grains| &grains.initial) {
        Some(Initial::Growth(_)) => true,
        Some(Initial::Deposition(deposition)) => deposition.number > NEIGHBOURS,
        _ => false,
    };
    many && case.domain.size.0.len() == 3
}

/// Returns `true` if discs or spheres move freely. Blocks and bonds have properties without default values.
pub(crate) fn move_without_law(case: &Case) -> bool {
    let free = |motion: &Motion| matches!(motion, Motion::Free { .. });
    let moving = case.grains.is_some() || case.bodies.iter().any(|body| free(&body.motion));
    let bonded = case
        .grains
        .as_ref()
        .is_some_and(|grains| grains.bond_at_start);
    let faces = case.blocks.is_some() || case.bodies.iter().any(|body| !body.shape.round());
    moving && !faces && !bonded
}

/// Warns that touching discs in 2-D leave no path for the fluid, unless their hydraulic radius leaves at least a cell
/// between them. `stated`: the case states the coupling.
///
/// The water in a closed pore has no way out, and the cells that moving discs cover or free are whole: the density of
/// a pore of a few cells swings by a cell in their number.
pub(crate) fn closed_pores(scene: &Scene, stated: bool, findings: &mut Findings) {
    /// Ratio of the hydraulic radius to the radius (Sibille, Lomine and Marot 2012).
    const FACTOR: f64 = 0.8;
    let Some(Coupling::BounceBack(written)) = &scene.coupling else {
        return;
    };
    let (Some(_), Some(grains)) = (&scene.flow, &scene.grains) else {
        return;
    };
    let smallest = grains.radii.map_or(0.0, |(smallest, _)| smallest);
    let throat = |factor: f64| 2.0 * (1.0 - factor) * smallest / scene.grid.spacing;
    let alone = grains.expected < 2;
    if scene.grid.dimension != 2 || alone || throat(written.hydraulic_radius_factor) >= 1.0 {
        return;
    }
    if !stated {
        findings.warn(
            "coupling",
            "in 2-D touching discs close all pores between them, and the case defines no hydraulic radius; the water \
             in a closed pore is compressed where discs move, and guards.max_compression may end the run",
            Remedy::from(
                "for a permeable packing write for example \"coupling\": {\"bounce_back\": \
                 {\"hydraulic_radius_factor\": 0.8}}",
            )
            .set(
                "coupling",
                json!({"bounce_back": {"hydraulic_radius_factor": FACTOR}}),
            ),
        );
        return;
    }
    let path = "coupling.bounce_back.hydraulic_radius_factor";
    let remedy = Remedy::from(
        "use for example 0.8 with at least 5 cells per diameter, which leaves a cell of water between touching discs",
    );
    findings.warn(
        path,
        format!(
            "{} leaves {} cells of water between discs that touch, so that they close all pores between them; the \
             water in a closed pore is compressed where discs move, and guards.max_compression may end the run",
            number(written.hydraulic_radius_factor),
            number(throat(written.hydraulic_radius_factor))
        ),
        if throat(FACTOR) >= 1.0 {
            remedy.set(path, FACTOR)
        } else {
            remedy
        },
    );
}

/// Returns `true` if the bodies of a case are in partially saturated cells of a fluid.
pub(crate) fn in_saturated_cells(case: &Case) -> bool {
    let in_lattice = super::features::lattice(case).is_some();
    let stated = case.coupling.as_ref();
    let cells = |coupling: &Coupling| matches!(coupling, Coupling::PartiallySaturated(_));
    in_lattice && stated.map_or_else(|| cells(&coupling(case).0), cells)
}

/// Returns `true` if the linear law of a case states no stiffness.
pub(crate) fn without_stiffness(case: &Case) -> bool {
    matches!(&case.contact, Some(Contact::Linear(law)) if law.normal_stiffness.is_none())
}

/// Chooses the contact law of moving bodies, or the stiffness that a law leaves out; for polyhedra that do not move
/// a law that is never used.
pub(crate) fn choose_contact(
    scene: &mut Scene,
    case: &Case,
    target: Option<f64>,
    findings: &mut Findings,
) {
    let free = scene
        .bodies
        .iter()
        .any(|body| body.mobility == Mobility::Free);
    let moves = free || scene.grains.is_some() || scene.blocks.is_some();
    let (law, text) = if let Some(Contact::Linear(law)) = &case.contact {
        let (stiffness, text) = stiffness(scene, case, target);
        let law = linear::LinearInput {
            normal_stiffness: Some(Scaled::Absolute(stiffness)),
            ..law.clone()
        };
        (Contact::Linear(law), text)
    } else if move_without_law(case) {
        sphere_law(scene, case, target)
    } else if !moves && scene.polyhedra().next().is_some() {
        let law = blocks::BlockInput::without_use();
        (
            Contact::Blocks(law),
            String::from("nothing moves, so that no contacts occur"),
        )
    } else {
        return;
    };
    scene.chosen.note(Subject::ContactLaw, text);
    if scene.grains.is_some() && case.contact.is_none() {
        findings.warn(
            "contact",
            format!("the case has no contact law: a friction angle of {FRICTION_DEGREES} degrees is assumed, but \
                     the true value depends on the grains"),
            "write for example \"contact\": {\"linear\": {..}} with the measured friction angle",
        );
    }
    set_law(scene, case, law, findings);
}

/// Sets the contact law of a scene.
fn set_law(scene: &mut Scene, case: &Case, law: Contact, findings: &mut Findings) {
    scene.chosen.law = Some(law.clone());
    let with_law = Case {
        contact: Some(law),
        ..case.clone()
    };
    scene.contact = ContactTable::resolve(
        &with_law,
        scene.grains.as_ref(),
        in_saturated_cells(case),
        findings,
    );
}

/// Gives the linear law of a case that states no stiffness the one chosen before, when the scene continues another.
pub(crate) fn keep_stiffness(scene: &mut Scene, case: &Case, findings: &mut Findings) {
    if let Some(Contact::Linear(law)) = case.contact.as_ref().filter(|_| without_stiffness(case))
        && let Some(Contact::Linear(chosen)) = &scene.chosen.law
    {
        let law = linear::LinearInput {
            normal_stiffness: chosen.normal_stiffness,
            ..law.clone()
        };
        set_law(scene, case, Contact::Linear(law), findings);
    }
}

/// Returns the law of discs and spheres, and the reason.
fn sphere_law(scene: &Scene, case: &Case, target: Option<f64>) -> (Contact, String) {
    let elastic =
        |m: &case::domain::Material| m.young_modulus.is_some() && m.poisson_ratio.is_some();
    if scene.grid.dimension == 3 && case.materials.values().all(elastic) {
        let law = Contact::HertzMindlin(hertz_mindlin::HertzMindlinInput {
            friction_angle_degrees: Some(FRICTION_DEGREES),
            restitution: RESTITUTION,
            attraction: false,
            impact_speed: None,
            bridges: None,
            local_damping: 0.0,
            pairs: Vec::new(),
        });
        (law, String::from("all materials have their moduli"))
    } else {
        let (stiffness, text) = stiffness(scene, case, target);
        let law = Contact::Linear(linear::LinearInput {
            normal_stiffness: Some(Scaled::Absolute(stiffness)),
            shear_to_normal_stiffness: 0.4,
            friction_angle_degrees: Some(FRICTION_DEGREES),
            normal_damping_ratio: DAMPING,
            shear_damping_ratio: Some(DAMPING),
            attraction: false,
            rolling: None,
            bridges: None,
            local_damping: 0.0,
            pairs: Vec::new(),
        });
        (law, text)
    }
}

/// Returns the spring stiffness [N/m] that stops bodies at the largest speed and supports the weight above them
/// within the overlap, or in seepage that of the measured rows; and the reason.
fn stiffness(scene: &Scene, case: &Case, target: Option<f64>) -> (f64, String) {
    let in_water = scene
        .flow
        .as_ref()
        .and_then(|flow| step::fastest(scene, flow));
    let speed = in_water.map_or_else(
        || fastest_approach(case, scene.grains.as_ref()),
        |speed| speed.value,
    );
    let moving = moving(scene);
    let impact = |part: f64| {
        let needed = |solid: &MovingSolid| solid.mass * (speed / (part * solid.diameter)).powi(2);
        moving.iter().map(needed).fold(0.0, f64::max)
    };
    if let Some(chosen) = target.and_then(|target| seepage::stiffness(scene, target, impact)) {
        return chosen;
    }
    let gravity = norm(scene.gravity);
    let axis = (0..scene.grid.dimension)
        .max_by(|a, b| scene.gravity[*a].abs().total_cmp(&scene.gravity[*b].abs()));
    let height = axis.map_or(0.0, |axis| scene.grid.size[axis]);
    let weight = |solid: &MovingSolid| {
        let layers = if solid.named {
            1.0
        } else {
            (height / solid.diameter).max(1.0)
        };
        solid.mass * gravity * layers / (OVERLAP * solid.diameter)
    };
    let stiffest = moving.iter().map(weight).fold(impact(OVERLAP), f64::max);
    let stiffest = if stiffest > 0.0 { stiffest } else { 1.0 };
    let text = format!(
        "{} N/m: contacts overlap by at most {} % of a diameter at {} m/s and at rest",
        number(stiffest),
        number(100.0 * OVERLAP),
        number(speed)
    );
    (stiffest, text)
}

/// Freely moving solid.
struct MovingSolid {
    /// Diameter \[m\].
    diameter: f64,
    /// Mass \[kg\].
    mass: f64,
    /// `true` for a named body, which lies alone.
    named: bool,
}

/// Returns every freely moving solid.
fn moving(scene: &Scene) -> Vec<MovingSolid> {
    let mut list = Vec::new();
    let mut add = |material: usize, radius: f64, named: bool| {
        list.push(MovingSolid {
            diameter: 2.0 * radius,
            mass: scene.mass(material, radius),
            named,
        });
    };
    for body in scene
        .bodies
        .iter()
        .filter(|body| body.mobility == Mobility::Free)
    {
        add(body.material, body.radius, true);
    }
    if let Some(grains) = &scene.grains {
        match &grains.source {
            GrainSource::List(each) | GrainSource::File { grains: each, .. } => {
                each.iter().for_each(|g| add(g.material, g.radius, false));
            }
            _ => {
                let (low, high) = grains.radii.unwrap_or((0.0, 0.0));
                add(grains.material, low, false);
                add(grains.material, high, false);
            }
        }
    }
    list.retain(|solid| solid.diameter > 0.0);
    list
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use case::contact::Contact;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the paths of the warnings on closed pores of two discs of 10 cells.
    fn warned(coupling: &Value) -> Vec<String> {
        let mut case = json!({
            "domain": {"size": [0.04, 0.02], "spacing": 0.0004},
            "gravity": [0, -0.1],
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8}},
            "grains": {"material": "glass", "initial": {"list": [
                {"position": [0.01, 0.01], "radius": 0.002}, {"position": [0.03, 0.01], "radius": 0.002}]}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
            "time": {"end": 0.1}
        });
        if !coupling.is_null() {
            case["coupling"] = coupling.clone();
        }
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let closed = warnings
            .into_iter()
            .filter(|p| p.reason.contains("close all pores"));
        closed.map(|p| p.path).collect()
    }

    #[test]
    fn discs_whose_hydraulic_radius_leaves_no_cell_between_them_are_reported() {
        let factor = "coupling.bounce_back.hydraulic_radius_factor";
        assert_eq!(warned(&Value::Null), ["coupling"]);
        assert_eq!(
            warned(&json!({"bounce_back": {"scheme": "half_way"}})),
            [factor]
        );
        // 0.8 leaves two cells, 0.95 half a cell.
        let with =
            |factor: f64| warned(&json!({"bounce_back": {"hydraulic_radius_factor": factor}}));
        assert_eq!(with(0.95), [factor]);
        assert_eq!(with(0.8), Vec::<String>::new());
        assert_eq!(
            warned(&json!({"partially_saturated": {}})),
            Vec::<String>::new()
        );
    }

    /// Checks that a run which is continued to a later end keeps the stiffness that was chosen for a law without
    /// one, also with another friction angle.
    #[test]
    fn a_continued_run_keeps_the_chosen_stiffness() {
        let case = |end: f64, friction: f64| {
            let case = json!({
                "domain": {"size": [4, 5], "spacing": 0.25},
                "gravity": [0, -9.81],
                "materials": {"w": {}, "g": {"density": 2500}},
                "bodies": [{"name": "b0", "shape": {"disc": {"radius": 0.5}}, "position": [2, 4],
                    "motion": {"free": {}}, "material": "g"}],
                "contact": {"linear": {"friction_angle_degrees": friction}},
                "box_walls": ["y_min"], "box_wall_material": "w",
                "time": {"end": end}
            });
            Document::read(&case.to_string(), &[], Path::new(".")).unwrap()
        };
        let first = Plan::prepare(case(0.1, 20.0)).unwrap();
        for friction in [20.0, 25.0] {
            let next = Plan::prepare_like(case(0.3, friction), &first).unwrap();
            assert!(next.warnings.is_empty(), "{:?}", next.warnings);
            let stiffness = |plan: &Plan| match &plan.scene.chosen.law {
                Some(Contact::Linear(law)) => law.normal_stiffness,
                _ => None,
            };
            assert!(stiffness(&first).is_some());
            assert_eq!(stiffness(&next), stiffness(&first));
        }
    }
}
