//! Polygons that bound zones in 2-D, from lists and tables, and the reader of points in tables.

use crate::scene::findings::Findings;
use case::Case;
use case::darcy::{Zone, ZonePolygon};
use io::sheet::{Column, Refusal, Sheet, Unit};

/// Maximum number of corners.
const MAX_CORNERS: usize = 10_000;

/// Returns the corners of the polygon of a zone \[m\], empty if it has none; reports a finding if the polygon
/// encloses no area.
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
    let points = match written {
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
