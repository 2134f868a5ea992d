//! Common parts of bodies, blocks and grains: the initial motion, and the density that free motion requires.

use super::aligned_box::AlignedBox;
use super::findings::Findings;
use super::grid::Grid;
use base::error::Remedy;
use base::history::{self, TimeTable};
use case::Case;
use case::geometry::{Rotation, Vector};

/// Refuses a material without density if a freely moving body has it.
pub(super) fn needs_density(case: &Case, name: &str, findings: &mut Findings) {
    if case
        .materials
        .get(name)
        .is_some_and(|m| m.density.is_none())
    {
        findings.error(
            &format!("materials.{name}.density"),
            "a freely moving body needs the density of its material",
            Remedy::from("add it in kg/m3, for example 2650")
                .set(format!("materials.{name}.density"), 2650),
        );
    }
}

/// Returns the table of velocity factors in time, if it is valid and changes something.
pub(super) fn factors(
    written: Option<&Vec<[f64; 2]>>,
    velocities: [[f64; 3]; 2],
    path: &str,
    findings: &mut Findings,
) -> Option<Vec<[f64; 2]>> {
    let table = written?;
    let path = format!("{path}.history");
    if !history::check(table, &path, findings) {
        return None;
    }
    if velocities.as_flattened().iter().all(|v| *v == 0.0) {
        findings.error(
            &path,
            "the table multiplies a velocity of zero, so that nothing moves",
            Remedy::take_out(
                "add a velocity, for example of 1 m/s along the motion, or remove the table",
                &path,
            ),
        );
    }
    Some(table.clone())
}

/// Returns the factor of a velocity table at the start of the run, and the largest magnitude of its factors.
pub(super) fn first_and_largest(table: Option<&Vec<[f64; 2]>>) -> [f64; 2] {
    let table = TimeTable::new(table.map(Vec::as_slice), 1.0);
    [table.value_after(0.0), table.largest()]
}

/// Returns the velocity [m/s] and rotation rate [rad/s] at the start.
pub(super) fn motion(
    grid: &Grid,
    velocity: Option<&Vector>,
    rotation: Option<&Rotation>,
    path: &str,
    findings: &mut Findings,
) -> ([f64; 3], [f64; 3]) {
    let v = velocity.map_or([0.0; 3], |v| {
        AlignedBox::vector(grid, v, &format!("{path}.velocity"), findings)
    });
    if let Some(rotation) = rotation
        && matches!(rotation, Rotation::AboutZ(_)) != (grid.dimension == 2)
    {
        findings.error(
            &format!("{path}.angular_velocity"),
            "an angular velocity is one number in 2-D and three numbers in 3-D",
            "write one number in 2-D, or a list of three numbers in 3-D",
        );
    }
    (v, rotation.map_or([0.0; 3], Rotation::to_array))
}
