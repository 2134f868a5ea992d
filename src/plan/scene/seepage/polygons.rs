//! Polygons that bound zones in 2-D, from lists and tables, and the reader of points in tables.

use crate::scene::findings::Findings;
use case::Case;
use case::darcy::{Zone, ZonePolygon};
use io::sheet::{Column, Refusal, Sheet, Unit};
use structure::edges_that_meet;

/// Maximum number of corners.
const MAX_CORNERS: usize = 10_000;

/// Returns the corners of the polygon of a zone \[m\], empty if it has none; reports a finding if the polygon
/// encloses no area or crosses itself.
pub(super) fn polygon(
    case: &Case,
    zone: &Zone,
    path: &str,
    findings: &mut Findings,
) -> Vec<[f64; 2]> {
    let Some(written) = &zone.polygon else {
        return Vec::new();
    };
    let path = format!("{path}.polygon");
    if case.domain.size.0.len() != 2 {
        findings.error(
            &path,
            "a polygon bounds a zone in 2-D, and this is a 3-D problem",
            "use a `region` or a `raster`",
        );
        return Vec::new();
    }
    if zone.region.is_some() {
        findings.error(
            &path,
            "the zone has both a region and a polygon",
            "remove one of them",
        );
    }
    let mut points = match written {
        ZonePolygon::Points(points) => points.clone(),
        // A drawing that could not be read has its finding.
        ZonePolygon::Dxf(_) => return Vec::new(),
        ZonePolygon::Path(file) => {
            let text = io::plain::text(&case.directory.join(file), io::plain::LONGEST_INPUT);
            let read = text.map_err(|e| e.to_string());
            let read = read
                .and_then(|text| corners(&text).map_err(|e| format!("{}: {e}", file.display())));
            match read {
                Ok(points) => points,
                Err(reason) => {
                    findings.error(
                        &format!("{path}.path"),
                        reason,
                        "correct the path (relative to the case) or the file",
                    );
                    return Vec::new();
                }
            }
        }
    };
    let finite = points.iter().flatten().all(|x| x.is_finite());
    if !finite || area(&points).abs() <= 0.0 || points.len() > MAX_CORNERS {
        findings.error(
            &path,
            format!("{} corners do not enclose an area", points.len()),
            format!("write 3 to {MAX_CORNERS} corners in their order along the boundary, in m"),
        );
        return Vec::new();
    }
    // Tables of other programs often repeat the first corner at the end.
    if points.len() > 3 && points.first() == points.last() {
        points.pop();
    }
    if let Some(edges) = edges_that_meet(&points) {
        let of = match written {
            ZonePolygon::Path(file) => format!(" of {}", file.display()),
            _ => String::new(),
        };
        findings.error(
            &path,
            format!("the polygon{of} crosses or touches itself: {edges}"),
            "write the corners in their order along the boundary, each once",
        );
        return Vec::new();
    }
    points
}

/// Reads the corners of a table with the columns `x` and `y`.
fn corners(text: &str) -> Result<Vec<[f64; 2]>, String> {
    let points = points(text, 2, "A polygon")?;
    Ok(points.into_iter().map(|[x, y, _]| [x, y]).collect())
}

/// Reads the points of a table with the columns `x`, `y` and, in 3-D, `z`. `subject` begins a sentence about them.
pub(super) fn points(text: &str, dimension: usize, subject: &str) -> Result<Vec<[f64; 3]>, String> {
    let column = |name| Column {
        name,
        aliases: &[],
        unit: Unit::Length,
        required: true,
    };
    let names = &["x", "y", "z"][..dimension];
    let columns: Vec<Column> = names.iter().copied().map(column).collect();
    let sheet = Sheet::new(text, &columns).map_err(|refusal| match refusal {
        Refusal::Sentence(sentence) => sentence,
        Refusal::Unknown(name) => format!(
            "the header has an unknown column `{name}`. {subject} has: {}",
            names.join(", ")
        ),
    })?;
    let mut points = Vec::new();
    sheet.each(|row| {
        let mut point = [0.0; 3];
        for (a, x) in point[..dimension].iter_mut().enumerate() {
            *x = row.number(a)?;
        }
        points.push(point);
        Ok(())
    })?;
    Ok(points)
}

/// Returns the area of a polygon \[m²\], negative if it runs clockwise.
fn area(points: &[[f64; 2]]) -> f64 {
    let next = points.iter().cycle().skip(1);
    let twice = points
        .iter()
        .zip(next)
        .map(|(a, b)| a[0] * b[1] - a[1] * b[0]);
    0.5 * twice.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the findings on the zones of a sheet pile in sand with a second zone in this polygon.
    fn findings(polygon: &Value, folder: &Path) -> Vec<String> {
        let text = case::examples::find("sheet-pile").unwrap().text;
        let mut case: Value = serde_json::from_str(text).unwrap();
        let zone = json!({"name": "lens", "polygon": polygon, "permeability": {"hydraulic_conductivity": 1e-5}});
        let zones = case["fluid"]["darcy"]["zones"].as_array_mut().unwrap();
        zones.push(zone);
        let read = Document::read(&case.to_string(), &[], folder).and_then(Plan::prepare);
        let found = read.map_or_else(|problems| problems, |plan| plan.warnings);
        let of_zones = found.iter().filter(|p| p.path.contains("zones"));
        of_zones.map(ToString::to_string).collect()
    }

    /// Checks a list and a table of corners: two edges that cross are named, and a table that repeats its first corner
    /// at the end is accepted. The edges from (1, 0.2) to (2, 0.6) and from (2, 0.2) to (1, 0.6) cross in (1.5, 0.4).
    #[test]
    fn a_polygon_that_crosses_itself_is_refused_with_its_edges() {
        let folder = tempfile::tempdir().unwrap();
        let table = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
        table("bow.csv", "x,y\n1,0.2\n2,0.6\n2,0.2\n1,0.7\n").unwrap();
        table("closed.csv", "x,y\n1,0.2\n2,0.2\n2,0.6\n1,0.6\n1,0.2\n").unwrap();
        let bow = json!({"points": [[1, 0.2], [2, 0.6], [2, 0.2], [1, 0.7]]});
        for crossed in [bow, json!({"path": "bow.csv"})] {
            let found = findings(&crossed, folder.path());
            assert_eq!(found.len(), 1, "{crossed}: {found:?}");
            for part in [
                "zones[1].polygon",
                "from corner 0 at 1.0, 0.2 m to corner 1 at 2.0, 0.6 m",
                "from corner 2 at 2.0, 0.2 m to corner 3 at 1.0, 0.7 m",
            ] {
                assert!(found[0].contains(part), "{part}: {}", found[0]);
            }
        }
        let simple = json!({"points": [[1, 0.2], [2, 0.2], [2, 0.6], [1, 0.6]]});
        for good in [simple, json!({"path": "closed.csv"})] {
            let found = findings(&good, folder.path());
            assert!(found.is_empty(), "{good}: {found:?}");
        }
    }

    /// Checks a wall in the shape of a five-pointed star drawn in one stroke, whose corners all turn to the same side,
    /// and a regular pentagon.
    #[test]
    fn a_wall_that_crosses_itself_is_refused() {
        for (stride, refused) in [(2, true), (1, false)] {
            let corner = |k: u32| {
                let angle = f64::from(stride * k) * std::f64::consts::TAU / 5.0;
                json!([
                    0.012 + 0.004 * angle.cos(),
                    0.01,
                    0.05 + 0.004 * angle.sin()
                ])
            };
            let corners: Vec<Value> = (0..5).map(corner).collect();
            let text = case::examples::find("deposition").unwrap().text;
            let mut case: Value = serde_json::from_str(text).unwrap();
            let walls = case["walls"].as_array_mut().unwrap();
            walls.push(json!({"name": "star", "material": "soil", "shape": {"polygon": corners}}));
            let read =
                Document::read(&case.to_string(), &[], Path::new("")).and_then(Plan::prepare);
            let found = read.map_or_else(|problems| problems, |plan| plan.warnings);
            let of_wall = found.iter().filter(|p| p.path.starts_with("walls[3]"));
            let told: Vec<String> = of_wall.map(ToString::to_string).collect();
            assert_eq!(
                told.iter().any(|t| t.contains("crosses or touches itself")),
                refused,
                "{found:?}"
            );
        }
    }
}
