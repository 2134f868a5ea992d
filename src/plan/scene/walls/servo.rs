//! Servo walls of a scene: their stress in time, and the cases in which a control cannot work.

use super::SceneWall;
use crate::scene::auto::solids::without_stiffness;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use base::error::Remedy;
use base::history;
use base::vector::norm;
use case::Case;
use case::solids::{Servo as Written, Wall as WrittenWall, WallShape, WallStage};
use dem::contact::Contact;
use dem::walls::area::{HalfSpace, PlaneArea};
use nalgebra::Vector3;
use serde::Serialize;

/// Control of a plane wall by the mean normal stress of its contacts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneServo {
    /// Times \[s\] in ascending order, and stresses \[Pa\]; one row if the stress is constant.
    pub history: Vec<[f64; 2]>,
    /// Largest velocity along the normal [m/s].
    pub velocity_limit: f64,
    /// Fraction of the missing force that the springs gain in a solid step.
    pub gain: f64,
}

impl SceneServo {
    /// Returns the largest stress \[Pa\].
    #[must_use]
    pub fn largest_stress(&self) -> f64 {
        let stresses = self.history.iter().map(|[_, stress]| *stress);
        stresses.fold(0.0, f64::max)
    }
}

/// Resolves the control of a wall with this unit normal; none if the case states no control.
pub(super) fn resolve(
    case: &Case,
    wall: &WrittenWall,
    (normal, velocity): ([f64; 3], [f64; 3]),
    path: &str,
    findings: &mut Findings,
) -> Option<SceneServo> {
    let written = wall.servo.as_ref()?;
    let at = format!("{path}.servo");
    if !matches!(wall.shape, WallShape::Plane(_)) {
        findings.error(
            &at,
            "a servo moves a plane along its normal, but this wall is not a plane",
            Remedy::take_out("use a plane, or remove the servo", &at),
        );
    }
    if wall.during == WallStage::Preparation {
        findings.error(
            &at,
            "a servo acts during the run, but this wall is removed when the run begins",
            Remedy::take_out("remove the servo, or `during`", &at),
        );
    }
    let across: f64 = normal.iter().zip(velocity).map(|(n, v)| n * v).sum();
    let speed = norm(velocity);
    if across.abs() > 1e-12 * speed {
        findings.error(
            &format!("{path}.velocity"),
            format!(
                "the servo moves the wall along its normal, but the prescribed velocity also has a normal \
                 component of {} m/s",
                number(across)
            ),
            "keep only the component along the plane, or remove the servo",
        );
    }
    check_contacts(case, &at, findings);
    Some(SceneServo {
        history: stresses(written, &at, findings),
        velocity_limit: written.velocity_limit,
        gain: written.gain,
    })
}

/// Returns the table of stresses in time; it has one row if the stress is constant.
fn stresses(written: &Written, path: &str, findings: &mut Findings) -> Vec<[f64; 2]> {
    let Some(table) = &written.history else {
        return vec![[0.0, written.stress]];
    };
    let path = format!("{path}.history");
    if history::check(table, &path, findings) && table.iter().any(|[_, stress]| *stress < 0.0) {
        findings.error(
            &path,
            "a stress of the table is below 0, but a wall can only press grains, not pull them",
            "use stresses of 0 or more; compression is positive",
        );
    }
    table.clone()
}

/// Refuses a control if the contact law has no point contacts, or if nothing can press on the wall.
fn check_contacts(case: &Case, path: &str, findings: &mut Findings) {
    if matches!(case.contact, Some(Contact::Blocks(_))) {
        findings.error(
            path,
            "a servo measures point contacts of discs and spheres, but the law `blocks` has contacts over areas",
            Remedy::take_out("remove the servo, or use another law", path),
        );
    } else if case.grains.is_none() && case.bodies.is_empty() && case.regions.is_empty() {
        // One cause is one finding, of the first such wall.
        let first = case.walls.iter().position(|wall| wall.servo.is_some());
        if first.is_some_and(|first| path == format!("walls[{first}].servo")) {
            findings.error(
                path,
                "there are no grains and no bodies that could bear the stress of the wall",
                Remedy::take_out("add `grains`, or remove the servo", path),
            );
            findings.depends(&["grains", "bodies", "fluid"]);
        }
    } else if case.contact.is_none() || without_stiffness(case) {
        findings.error(
            "contact",
            "a servo wall needs an explicit contact stiffness, because the automatic choice does not consider \
             the stress of the wall",
            "set `normal_stiffness` of `linear` to the stress times the diameter (2-D: to the stress) divided by \
             the overlap that you accept, or use `hertz_mindlin`",
        );
    }
}

/// Refuses controls of planes that no grain can reach.
pub(super) fn check_areas(walls: &[SceneWall], grid: &Grid, findings: &mut Findings) {
    let half_space = |wall: &SceneWall| HalfSpace {
        point: Vector3::from(wall.point),
        normal: Vector3::from(wall.normal),
    };
    let known = |wall: &SceneWall| {
        wall.surface.is_none() && Vector3::from(wall.normal).norm_squared() > 0.5
    };
    let mut size = grid.size;
    if grid.dimension == 2 {
        size[2] = 1.0;
    }
    for (n, wall) in walls.iter().enumerate() {
        if wall.servo.is_none() || !known(wall) {
            continue;
        }
        let others = walls.iter().enumerate();
        let others = others.filter(|(m, other)| {
            *m != n && known(other) && !other.temporary && other.from.is_none()
        });
        let area = PlaneArea::default().within(
            &half_space(wall),
            [Vector3::zeros(), Vector3::from(size)],
            others.map(|(_, other)| half_space(other)),
        );
        if area <= 0.0 {
            findings.error(
                &format!("walls[{n}].shape.plane"),
                format!(
                    "no part of the plane `{}` lies inside the domain and in front of the other walls, so that \
                     its servo has no area for the mean stress",
                    wall.name
                ),
                "move the plane into the domain",
            );
        }
    }
}
