//! Common parts of bodies, blocks and grains: the initial motion, and the density that free motion requires.

use super::block::AlignedBox;
use super::findings::Findings;
use super::grid::Grid;
use base::error::Remedy;
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
