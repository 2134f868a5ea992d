//! The named bodies of a scene.

use super::block::Block;
use super::findings::Findings;
use super::grid::Grid;
use super::motion::{motion, needs_density};
use super::{blocks, material, unique};
use crate::case::Case;
use crate::case::solids::{Motion as WrittenMotion, Shape};
use crate::dem::polyhedron::{Piece, Solid};
use crate::error::Remedy;
use nalgebra::Vector3;
use serde::Serialize;

/// A named disc (2-D), or sphere or polyhedron (3-D).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Radius \[m\]; of a polyhedron that of the sphere round its centroid that holds it.
    pub radius: f64,
    /// The polyhedron, if it is one, where it stands.
    #[serde(skip)]
    pub solid: Option<Solid>,
    /// Centre \[m\].
    pub position: [f64; 3],
    /// Velocity at the start [m/s], or at all times if driven.
    pub velocity: [f64; 3],
    /// Rotation rate at the start [rad/s], or at all times if driven.
    pub angular_velocity: [f64; 3],
    /// How it moves.
    pub mobility: Mobility,
    /// Index of its material.
    pub material: usize,
}

impl Body {
    /// Diameter of the largest sphere in a polyhedron \[m\].
    #[must_use]
    pub fn thickness(&self) -> Option<f64> {
        self.solid
            .as_ref()
            .map(|solid| Piece::of(solid).thickness())
    }
}

/// How a body moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mobility {
    /// Not at all.
    Fixed,
    /// With a prescribed velocity.
    Driven,
    /// By the forces on it.
    Free,
}

/// The named bodies of a case.
pub(crate) fn bodies(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Body> {
    let mut known = Vec::new();
    let mut bodies = Vec::new();
    for (n, body) in case.bodies.iter().enumerate() {
        let path = format!("bodies[{n}]");
        unique(&mut known, &body.name, &format!("{path}.name"), findings);
        let flat = matches!(body.shape, Shape::Disc { .. });
        if flat != (grid.dimension == 2) {
            let right = if flat { "sphere" } else { "disc" };
            findings.error(
                &format!("{path}.shape"),
                format!("this shape does not fit a {}-D problem", grid.dimension),
                format!("use {right}"),
            );
        }
        let position = Block::vector(grid, &body.position, &format!("{path}.position"), findings);
        let (solid, radius) = match &body.shape {
            Shape::Disc { radius } | Shape::Sphere { radius } => {
                if body.orientation.is_some() {
                    findings.error(
                        &format!("{path}.orientation"),
                        "the orientation of a disc or sphere has no effect",
                        Remedy::take_out("remove it", &format!("{path}.orientation")),
                    );
                }
                (None, *radius)
            }
            shape => {
                let turn = body.orientation.as_ref();
                let Some(mut solid) = blocks::solid(case, shape, turn, &path, findings) else {
                    continue;
                };
                solid.position = position.into();
                let radius = solid.shape.radius();
                (Some(solid), radius)
            }
        };
        if !grid.contains(position) {
            findings.error(
                &format!("{path}.position"),
                "the centre lies outside the domain",
                "move it inside",
            );
        }
        for a in 0..grid.dimension {
            let along = Vector3::from_fn(|axis, _| if axis == a { 1.0 } else { 0.0 });
            let width = solid.as_ref().map_or(2.0 * radius, |solid| {
                let (low, high) = Piece::of(solid).extent(&along);
                high - low
            });
            // As wide as the domain, but for the rounding of its corners, closes it.
            if width > grid.size[a] * (1.0 + 1e-9) {
                findings.error(
                    &format!("{path}.shape"),
                    format!(
                        "the body is wider than the domain along {}",
                        ["x", "y", "z"][a]
                    ),
                    "make it smaller, or the domain larger",
                );
                break;
            }
        }
        let at = format!("{path}.motion");
        let (mobility, velocity, angular_velocity) = match &body.motion {
            WrittenMotion::Fixed {} => (Mobility::Fixed, [0.0; 3], [0.0; 3]),
            WrittenMotion::Driven {
                velocity,
                angular_velocity,
            } => {
                let (v, w) = motion(
                    grid,
                    velocity.as_ref(),
                    angular_velocity.as_ref(),
                    &format!("{at}.driven"),
                    findings,
                );
                (Mobility::Driven, v, w)
            }
            WrittenMotion::Free {
                velocity,
                angular_velocity,
            } => {
                let (v, w) = motion(
                    grid,
                    velocity.as_ref(),
                    angular_velocity.as_ref(),
                    &format!("{at}.free"),
                    findings,
                );
                (Mobility::Free, v, w)
            }
        };
        let index = material(names, &body.material, &format!("{path}.material"), findings);
        if mobility == Mobility::Free && index.is_some() {
            needs_density(case, &body.material, findings);
        }
        bodies.push(Body {
            name: body.name.clone(),
            radius,
            solid,
            position,
            velocity,
            angular_velocity,
            mobility,
            material: index.unwrap_or(0),
        });
    }
    bodies
}
