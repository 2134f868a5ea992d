//! Structures: stationary solids that act on water and grains, such as sheet piles, cut-off walls, weirs, steps and
//! piers.
//!
//! A structure is defined by its signed distance. From this, and from the intersections of lines with the solid,
//! follow
//!
//! - the cells of a lattice that are solid, and where its links cross the surface ([`coupling::structure_map`]),
//! - the open parts of the cells and faces of a coarse grid ([`darcy::enclosure`]),
//! - the surface that grains touch and that is drawn ([`facets`]).
//!
//! Each shape has its own file, which contains its parameters as written in a case, in SI, and the solid that they
//! define ([`Solid`]). To add a shape, write the file and add one line to the list below.
//!
//! | file | holds |
//! |---|---|
//! | `plane`, `cuboid`, `polygon`, `disc`, `cylinder`, `sphere`, `surface` | a shape each |
//! | `solid` | [`Solid`], the interface of a shape |
//! | `images` | a solid with its periodic images |
//! | `facets` | surfaces as convex facets, outlines of 2-D solids as triangles |
//! | `mesh` | signed distance of a triangulated surface, and the parts of a line inside it |

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the texts of the schema, with units in brackets: [m]"
)]

pub mod facets;
pub mod images;
pub mod mesh;
mod solid;

use base::vector::{cross, dot, minus, norm, plus, times};
pub use facets::Facets;
pub use images::Images;
pub use polygon::{crossing, edges_that_meet};
pub use solid::{Frame, ReadMesh, Solid};

use base::error::Report;
use base::family::{describe_choices, family};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use solid::Scope;
use std::sync::Arc;

/// Point or direction; in 2-D the third component has no effect.
pub type Point = [f64; 3];

family! {
    /// Shape of a structure.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(rename = "StructureShape", transform = describe_choices)]
    pub enum Shape {
        plane: Plane(Plane),
        cuboid: Cuboid(Cuboid) as "box",
        polygon: Polygon(Polygon),
        disc: Disc(Disc),
        cylinder: Cylinder(Cylinder),
        sphere: Sphere(Sphere),
        surface: Surface(Surface),
    }
}

impl Shape {
    /// Returns the solid; reports errors in its parameters.
    #[must_use]
    pub fn solid(
        &self,
        frame: &Frame,
        path: &str,
        read: ReadMesh<'_>,
        report: &mut dyn Report,
    ) -> Option<Arc<dyn Solid>> {
        let path = &format!("{path}.{}", self.name());
        each!(self, shape => shape.solid(Scope { frame, path, read }, report))
    }
}

/// Returns `true` if a shape fits the dimension of the problem; otherwise reports a finding.
fn only_in(
    dimension: usize,
    frame: &Frame,
    path: &str,
    instead: &str,
    report: &mut dyn Report,
) -> bool {
    let fits = frame.dimension == dimension;
    if !fits {
        report.error(
            path,
            format!("this shape does not fit a {}-D problem", frame.dimension),
            format!("use {instead}").into(),
        );
    }
    fits
}

#[cfg(test)]
mod tests;
