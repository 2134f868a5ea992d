//! The named bodies of a scene.

use super::aligned_box::AlignedBox;
use super::findings::Findings;
use super::grid::Grid;
use super::motion::{factors, first_and_largest, motion, needs_density};
use super::{blocks, material, unique};
use base::error::Remedy;
use case::Case;
use case::solids::{Motion as WrittenMotion, Shape};
use dem::polyhedron::{Piece, PlacedPolyhedron};
use nalgebra::Vector3;
use serde::Serialize;

/// Named disc (2-D), or sphere or polyhedron (3-D).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedBody {
    /// Name of the body.
    pub name: String,
    /// Radius \[m\]; for a polyhedron that of the enclosing sphere about its centroid.
    pub radius: f64,
    /// Polyhedron in its initial position; none for a disc or sphere.
    #[serde(skip)]
    pub solid: Option<PlacedPolyhedron>,
    /// Centre \[m\].
    pub position: [f64; 3],
    /// Velocity at the start [m/s]; of a driven body the velocity that `history` multiplies.
    pub velocity: [f64; 3],
    /// Rotation rate at the start [rad/s]; of a driven body the rate that `history` multiplies.
    pub angular_velocity: [f64; 3],
    /// Times \[s\] and factors of both velocities of a driven body; none if they are constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history: Option<Vec<[f64; 2]>>,
    /// Kind of motion.
    pub mobility: Mobility,
    /// Index of its material.
    pub material: usize,
}

impl NamedBody {
    /// Returns velocity [m/s] and rotation rate [rad/s] at the start of the run.
    #[must_use]
    pub fn motion_at_start(&self) -> [[f64; 3]; 2] {
        let [first, _] = first_and_largest(self.history.as_ref());
        [self.velocity, self.angular_velocity].map(|v| v.map(|v| v * first))
    }

    /// Returns the largest velocity [m/s] and rotation rate [rad/s] of a prescribed motion; those at the start of a
    /// free body.
    #[must_use]
    pub fn largest_motion(&self) -> [[f64; 3]; 2] {
        let [_, largest] = first_and_largest(self.history.as_ref());
        [self.velocity, self.angular_velocity].map(|v| v.map(|v| v * largest))
    }

    /// Returns the diameter of the inscribed sphere of a polyhedron \[m\]; none for a disc or sphere.
    #[must_use]
    pub fn thickness(&self) -> Option<f64> {
        self.solid
            .as_ref()
            .map(|solid| Piece::from_polyhedron(solid).thickness())
    }
}

/// Kind of motion of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mobility {
    /// Fixed body.
    Fixed,
    /// Body with a prescribed velocity.
    Driven,
    /// Body that moves under the forces on it.
    Free,
}

/// Returns the named bodies of a case.
pub(crate) fn bodies(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<NamedBody> {
    let mut known = Vec::new();
    let mut bodies = Vec::new();
    for (n, body) in case.bodies.iter().enumerate() {
        let path = format!("bodies[{n}]");
        unique(&mut known, &body.name, &format!("{path}.name"), findings);
        check_dimension(&body.shape, grid, &format!("{path}.shape"), findings);
        let position =
            AlignedBox::vector(grid, &body.position, &format!("{path}.position"), findings);
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
        let shape = format!("{path}.shape");
        check_width(solid.as_ref(), radius, grid, &shape, findings);
        let moves = moves(&body.motion, grid, &format!("{path}.motion"), findings);
        let index = material(names, &body.material, &format!("{path}.material"), findings);
        if moves.mobility == Mobility::Free && index.is_some() {
            needs_density(case, &body.material, findings);
        }
        bodies.push(NamedBody {
            name: body.name.clone(),
            radius,
            solid,
            position,
            velocity: moves.velocity,
            angular_velocity: moves.angular_velocity,
            history: moves.history,
            mobility: moves.mobility,
            material: index.unwrap_or(0),
        });
    }
    bodies
}

/// Refuses a disc in 3-D, and other shapes in 2-D.
fn check_dimension(shape: &Shape, grid: &Grid, path: &str, findings: &mut Findings) {
    let flat = matches!(shape, Shape::Disc { .. });
    if flat != (grid.dimension == 2) {
        let right = if flat { "sphere" } else { "disc" };
        findings.error(
            path,
            format!("this shape does not fit a {}-D problem", grid.dimension),
            format!("use {right}"),
        );
    }
}

/// Refuses a body that is wider than the domain.
fn check_width(
    solid: Option<&PlacedPolyhedron>,
    radius: f64,
    grid: &Grid,
    path: &str,
    findings: &mut Findings,
) {
    let longer = match solid {
        Some(solid) => longer_than_domain(grid, solid, &[true; 3]).map(|(axis, _)| axis),
        None => (0..grid.dimension).find(|a| 2.0 * radius > grid.size[*a] * (1.0 + 1e-9)),
    };
    if let Some(axis) = longer {
        findings.error(
            path,
            format!(
                "the body is wider than the domain along {}",
                ["x", "y", "z"][axis]
            ),
            "make it smaller, or the domain larger",
        );
    }
}

/// Returns the first of these axes along which a polyhedron is longer than the domain, and its length \[m\].
pub(crate) fn longer_than_domain(
    grid: &Grid,
    solid: &PlacedPolyhedron,
    axes: &[bool; 3],
) -> Option<(usize, f64)> {
    let piece = Piece::from_polyhedron(solid);
    let lengths = (0..grid.dimension).filter(|a| axes[*a]).map(|a| {
        let along = Vector3::from_fn(|axis, _| if axis == a { 1.0 } else { 0.0 });
        let (low, high) = piece.extent(&along);
        (a, high - low)
    });
    // A body as long as the domain, up to rounding of its corners, closes it.
    let mut longer = lengths.filter(|(a, length)| *length > grid.size[*a] * (1.0 + 1e-9));
    longer.next()
}

/// Motion of a body.
struct BodyMotion {
    mobility: Mobility,
    velocity: [f64; 3],
    angular_velocity: [f64; 3],
    history: Option<Vec<[f64; 2]>>,
}

/// Resolves the motion of a body.
fn moves(written: &WrittenMotion, grid: &Grid, path: &str, findings: &mut Findings) -> BodyMotion {
    let (mobility, name, velocity, rotation) = match written {
        WrittenMotion::Fixed {} => {
            return BodyMotion {
                mobility: Mobility::Fixed,
                velocity: [0.0; 3],
                angular_velocity: [0.0; 3],
                history: None,
            };
        }
        WrittenMotion::Driven {
            velocity,
            angular_velocity,
            ..
        } => (Mobility::Driven, "driven", velocity, angular_velocity),
        WrittenMotion::Free {
            velocity,
            angular_velocity,
        } => (Mobility::Free, "free", velocity, angular_velocity),
    };
    let table = match written {
        WrittenMotion::Driven { history, .. } => history.as_ref(),
        _ => None,
    };
    let path = format!("{path}.{name}");
    let (velocity, rotation) = (velocity.as_ref(), rotation.as_ref());
    let (velocity, angular_velocity) = motion(grid, velocity, rotation, &path, findings);
    BodyMotion {
        mobility,
        velocity,
        angular_velocity,
        history: factors(table, [velocity, angular_velocity], &path, findings),
    }
}
