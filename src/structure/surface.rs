//! Solid from an STL file, convex or not; or a sheet of a given thickness about an open surface.

use super::mesh;
use super::solid::{Scope, Solid, trace};
use super::{Facets, Point, only_in};
use base::error::{Remedy, Report};
use base::geometry::Mesh;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A triangulated surface (3-D): the solid inside a closed one, or a sheet about an open one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Surface {
    /// File with the surface. Triangles are wound consistently if they are not in the file; if shells intersect, the
    /// solid is their union.
    pub mesh: Mesh,
    /// Thickness of the sheet, half on each side of the surface [m]. Default: the surface is closed and its inside is
    /// solid.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub thickness: Option<f64>,
}

impl Surface {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, read } = at;
        if !only_in(3, frame, path, "polygon", report) {
            return None;
        }
        let made = read(&self.mesh).and_then(|triangles| mesh::TriangleMesh::new(&triangles));
        let mesh = match made {
            Ok(mesh) => mesh,
            Err(reason) => {
                report.error(
                    &format!("{path}.mesh.path"),
                    reason,
                    "correct the path (relative to the case) or the file".into(),
                );
                return None;
            }
        };
        if !judge_unit(&self.mesh, &mesh.extent(), &frame.size, path, report) {
            return None;
        }
        if mesh.open_edges() > 0 && self.thickness.is_none() {
            report.error(
                path,
                format!(
                    "the surface is open: {} of its edges belong to one triangle only, so that it has no inside",
                    mesh.open_edges()
                ),
                "close the surface, or add a `thickness` to make it a sheet".into(),
            );
            return None;
        }
        Some(Arc::new(Triangulated {
            mesh,
            half: self.thickness.map(|thickness| 0.5 * thickness),
        }))
    }
}

/// Maximum length of a surface in domain lengths; a longer one is probably in another unit.
const DOMAINS: f64 = 100.0;

/// Refuses a surface that is far larger than the domain: drawings are often in millimetres. Returns `true` for an
/// acceptable size.
pub fn judge_unit(
    mesh: &Mesh,
    extent: &[Point; 2],
    domain: &Point,
    path: &str,
    report: &mut dyn Report,
) -> bool {
    let lengths: Point = std::array::from_fn(|axis| extent[1][axis] - extent[0][axis]);
    let times = (0..3)
        .map(|axis| lengths[axis] / domain[axis])
        .fold(0.0, f64::max);
    if times <= DOMAINS {
        return true;
    }
    let [x, y, z] = lengths;
    let scale = mesh.scale * 1e-3;
    let remedy =
        "state the length unit of the file in m; drawings are often in millimetres (0.001)";
    report.error(
        &format!("{path}.mesh.scale"),
        format!("the surface measures {x} x {y} x {z} m, {times:.0} times the domain"),
        Remedy::from(remedy).set(format!("{path}.mesh.scale"), serde_json::json!(scale)),
    );
    false
}

#[derive(Debug)]
struct Triangulated {
    mesh: mesh::TriangleMesh,
    /// Half the thickness of a sheet.
    half: Option<f64>,
}

impl Solid for Triangulated {
    fn distance(&self, at: Point) -> f64 {
        let distance = self.mesh.distance(at);
        self.half.map_or(distance, |half| distance.abs() - half)
    }

    fn extent(&self) -> [Point; 2] {
        let [low, high] = self.mesh.extent();
        let half = self.half.unwrap_or(0.0);
        [low.map(|x| x - half), high.map(|x| x + half)]
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        match self.half {
            Some(_) => trace(self, from, along, found),
            None => self.mesh.chords(from, along, found),
        }
    }

    fn outline(&self, _: f64) -> Vec<[f64; 2]> {
        Vec::new()
    }

    /// Returns the triangles unchanged; for a sheet those of its middle surface.
    fn facets(&self, _: f64) -> Facets {
        let mut facets = Facets::default();
        for triangle in self.mesh.triangles() {
            facets.face(&triangle);
        }
        facets
    }
}
