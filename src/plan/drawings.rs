//! Polygons of a case that are layers of a drawing (DXF): read, checked and replaced by their corners.
//!
//! The drawing is read before the case is resolved, so that the scene, the copy of the case in the results and the
//! hash of the case have the corners, and the file is no longer needed. Arcs become chords. The unit of the drawing is
//! that of its header unless the case states one.

use base::error::{Problem, Remedy, Severity};
use base::geometry::DrawnLayer;
use case::Case;
use case::darcy::{TerrainSurface, ZonePolygon};
use case::fluid::Fluid;
use case::geometry::Vector;
use io::dxf::{Drawing, Polyline};
use serde_json::{Value, json};
use std::path::Path;
use structure::{Shape, edges_that_meet};

/// Distance between an arc and its chords over the extent of a polyline, unless the case states one.
const TOLERANCE: f64 = 1e-3;
/// Extents of a polyline over that of the domain beyond which its unit is wrong.
const EXTENTS: [f64; 2] = [1e-4, 1e4];
/// Maximum number of corners.
const MAX_CORNERS: usize = 10_000;

/// Reason and remedy of a layer that cannot be used, with the field below the drawing.
struct Fault(&'static str, String, String);

/// Kind of polyline that a field needs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outline {
    Closed,
    Open,
}

/// Replaces the drawings of a case and of its text by their corners, and returns the problems found.
pub(super) fn replace(case: &mut Case, text: &mut String) -> Vec<Problem> {
    let (mut problems, mut found) = (Vec::new(), Vec::new());
    let (directory, size) = (case.directory.clone(), case.domain.size.0.clone());
    let mut read = |path: String, drawn: &DrawnLayer, outline: Outline| {
        let points = corners(&directory, drawn, &size, outline);
        match points {
            Ok(points) => {
                found.push((path, points.clone()));
                Some(points)
            }
            Err(Fault(field, reason, remedy)) => {
                problems.push(Problem {
                    path: format!("{path}.dxf{field}"),
                    value: json!(drawn).to_string(),
                    reason,
                    remedy: Remedy::from(remedy),
                    severity: Severity::Error,
                });
                None
            }
        }
    };
    if let Some(Fluid::Darcy(darcy)) = &mut case.fluid {
        for (n, zone) in darcy.zones.iter_mut().enumerate() {
            if let Some(ZonePolygon::Dxf(drawn)) = &zone.polygon {
                let path = format!("fluid.darcy.zones[{n}].polygon");
                let points = read(path, drawn, Outline::Closed);
                zone.polygon = points.map(ZonePolygon::Points);
            }
        }
        if let Some(terrain) = &mut darcy.terrain
            && let TerrainSurface::Dxf(drawn) = &terrain.surface
        {
            let path = "fluid.darcy.terrain.surface".to_owned();
            if let Some(points) = read(path, drawn, Outline::Open) {
                let points = points.into_iter().map(|[x, y]| Vector(vec![x, y]));
                terrain.surface = TerrainSurface::Points(points.collect());
            }
        }
    }
    for (n, structure) in case.structures.iter_mut().enumerate() {
        if let Shape::Polygon(polygon) = &mut structure.shape
            && let Some(drawn) = &polygon.dxf
        {
            let path = format!("structures[{n}].shape.polygon");
            if let Some(points) = read(path, drawn, Outline::Closed) {
                (polygon.points, polygon.dxf) = (points, None);
            }
        }
    }
    if !found.is_empty()
        && let Ok(mut tree) = serde_json::from_str::<Value>(text)
    {
        for (path, points) in found {
            let pointer: String = path
                .split(['.', '['])
                .map(|part| part.trim_end_matches(']'))
                .fold(String::new(), |all, part| all + "/" + part);
            if let Some(field) = tree.pointer_mut(&pointer).and_then(Value::as_object_mut) {
                field.remove("dxf");
                field.insert("points".into(), json!(points));
            }
        }
        *text = tree.to_string();
    }
    problems
}

/// Returns the corners of a layer \[m\].
fn corners(
    directory: &Path,
    drawn: &DrawnLayer,
    size: &[f64],
    outline: Outline,
) -> Result<Vec<[f64; 2]>, Fault> {
    let name = drawn.path.display();
    let drawing = io::plain::bytes(&directory.join(&drawn.path), io::plain::LONGEST_INPUT)
        .map_err(|e| e.to_string())
        .and_then(|bytes| io::dxf::read(&bytes).map_err(|e| format!("{name}: {e}")))
        .map_err(|reason| {
            let remedy = "correct the path (relative to the case), or save the drawing as text in the format DXF";
            Fault(".path", reason, remedy.into())
        })?;
    let polyline = only(&drawing, drawn, outline)?;
    let scale = drawn.scale.or(drawing.unit).ok_or_else(|| {
        Fault(
            "",
            format!("{name} does not state the unit of its lengths ($INSUNITS)"),
            "add `scale`, the length of a unit of the drawing in m: 1 for m, 0.001 for mm".into(),
        )
    })?;
    let origin = drawn.origin.unwrap_or([0.0; 2]);
    let ends = extent(polyline.vertices.iter().map(|v| v.at));
    let longest = ends[0].max(ends[1]);
    let tolerance = drawn.tolerance.map_or(TOLERANCE * longest, |t| t / scale);
    let points = polyline.points(tolerance.max(1e-9 * longest));
    let mut points: Vec<[f64; 2]> = (points.into_iter())
        .map(|at| [0, 1].map(|a| scale.mul_add(at[a], origin[a])))
        .collect();
    if outline == Outline::Open && points[0][0] > points[points.len() - 1][0] {
        points.reverse();
    }
    check(drawn, &points, size, (scale, outline))?;
    Ok(points)
}

/// Returns the only polyline of a layer.
fn only<'d>(
    drawing: &'d Drawing,
    drawn: &DrawnLayer,
    outline: Outline,
) -> Result<&'d Polyline, Fault> {
    let (name, layer) = (drawn.path.display(), &drawn.layer);
    let same = |other: &str| other.to_lowercase() == layer.to_lowercase();
    let found: Vec<&Polyline> = (drawing.polylines.iter())
        .filter(|line| same(&line.layer) && line.vertices.len() > 1)
        .collect();
    let [polyline] = found[..] else {
        if found.len() > 1 {
            return Err(Fault(
                ".layer",
                format!(
                    "layer `{layer}` of {name} has {} polylines, and one is needed",
                    found.len()
                ),
                "put each polyline on a layer of its own".into(),
            ));
        }
        let others = drawing.others.iter().find(|(other, _)| same(other));
        if let Some((_, kinds)) = others {
            let kinds: Vec<String> = (kinds.iter())
                .map(|(kind, number)| format!("{number} {kind}"))
                .collect();
            return Err(Fault(
                ".layer",
                format!(
                    "layer `{layer}` of {name} has no polyline, but {}",
                    kinds.join(", ")
                ),
                "join lines and arcs to a polyline (PEDIT), explode blocks, and draw splines as polylines".into(),
            ));
        }
        let mut known: Vec<&str> = (drawing.polylines.iter())
            .map(|line| line.layer.as_str())
            .collect();
        known.sort_unstable();
        known.dedup();
        return Err(Fault(
            ".layer",
            format!("{name} has no layer `{layer}`"),
            match known[..] {
                [] => "draw the outline as a polyline".into(),
                _ => format!("use one of its layers with polylines: {}", known.join(", ")),
            },
        ));
    };
    if outline == Outline::Closed && !polyline.closed {
        let [first, last] = [
            polyline.vertices[0],
            polyline.vertices[polyline.vertices.len() - 1],
        ];
        let gap = (last.at[0] - first.at[0]).hypot(last.at[1] - first.at[1]);
        return Err(Fault(
            ".layer",
            format!(
                "the polyline of layer `{layer}` (line {} of {name}) is open: its ends are {gap} units apart",
                polyline.line
            ),
            "close the polyline in the drawing".into(),
        ));
    }
    if outline == Outline::Open && polyline.closed {
        return Err(Fault(
            ".layer",
            format!(
                "the polyline of layer `{layer}` (line {} of {name}) is closed, but a surface is a line from one end \
                 of the ground to the other",
                polyline.line
            ),
            "draw the surface as an open polyline".into(),
        ));
    }
    Ok(polyline)
}

/// Returns the extent of points along both axes.
fn extent(points: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for at in points {
        for a in 0..2 {
            ends[a] = [ends[a][0].min(at[a]), ends[a][1].max(at[a])];
        }
    }
    ends.map(|[low, high]| high - low)
}

/// Checks the corners of a layer against the domain and each other.
fn check(
    drawn: &DrawnLayer,
    points: &[[f64; 2]],
    size: &[f64],
    (scale, outline): (f64, Outline),
) -> Result<(), Fault> {
    let (name, layer) = (drawn.path.display(), &drawn.layer);
    if points.len() > MAX_CORNERS {
        return Err(Fault(
            ".tolerance",
            format!(
                "the polyline of layer `{layer}` becomes {} corners, and at most {MAX_CORNERS} are allowed",
                points.len()
            ),
            "use a larger `tolerance`".into(),
        ));
    }
    let longest = extent(points.iter().copied())
        .into_iter()
        .fold(0.0, f64::max);
    let domain = size.iter().copied().fold(0.0, f64::max);
    let ratio = longest / domain;
    if !(EXTENTS[0]..=EXTENTS[1]).contains(&ratio) {
        return Err(Fault(
            ".scale",
            format!(
                "layer `{layer}` of {name} is {longest:.4e} m long with {scale} m per unit, and the domain {domain} m"
            ),
            "state the length of a unit of the drawing in m in `scale`".into(),
        ));
    }
    let outside = |a: usize| {
        let beyond = |at: &[f64; 2]| at[a] <= 0.0;
        let behind = |at: &[f64; 2]| at[a] >= size[a];
        points.iter().all(beyond) || points.iter().all(behind)
    };
    if size.len() == 2 && (0..2).any(outside) {
        return Err(Fault(
            ".origin",
            format!(
                "layer `{layer}` of {name} lies outside the domain: it begins at {:?} m",
                points[0]
            ),
            "state in `origin` where the origin of the drawing lies in the domain in m, or correct `scale`".into(),
        ));
    }
    if outline == Outline::Closed
        && let Some(edges) = edges_that_meet(points)
    {
        return Err(Fault(
            ".layer",
            format!("the polyline of layer `{layer}` of {name} crosses or touches itself: {edges}"),
            "correct the outline in the drawing".into(),
        ));
    }
    Ok(())
}
