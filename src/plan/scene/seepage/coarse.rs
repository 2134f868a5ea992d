//! Coarse grid of a seepage: the cells of the domain, or those of its own grid, equal or graded.

use super::PATH;
use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use base::error::Remedy;
use base::number::real;
use case::Case;
use case::darcy::{CellWidths, Darcy};
use case::fluid::Fluid;
use darcy::grid::GradedFaces;
use darcy::{GridAxis, SeepageGrid};
use std::sync::Arc;

/// Maximum number of cells along an axis.
const MOST_CELLS: f64 = 1e5;
/// Largest ratio of the widths of neighbouring cells that needs no warning.
///
/// Cells of 0.0125 m at the tip of a sheet pile in ground of 1 m that widen by a constant ratio lower its discharge by
/// 0.05 % at a ratio of 1.1, 0.2 % at 1.2, 1.1 % at 1.5, 3.1 % at 2 and 7.3 % at 3, and its exit gradient by at most
/// 0.05 %.
const USUAL_RATIO: f64 = 1.5;
/// Loss of discharge at the usual ratio, in percent.
const USUAL_LOSS: f64 = 1.0;
/// Difference between a sum of widths and the length of the grid that is rounding, relative to the length.
const ROUNDING: f64 = 1e-6;
/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Returns the coarse grid of a case without findings; none if the case has no seepage or a wrong grid.
pub(crate) fn grid_of(case: &Case, grid: &Grid) -> Option<SeepageGrid> {
    match &case.fluid {
        // Findings are reported where the seepage is resolved.
        Some(Fluid::Darcy(written)) => resolve(written, grid, &mut Findings::new(case)),
        _ => None,
    }
}

/// Returns the coarse grid; reports a finding if it is wrong.
pub(super) fn resolve(
    written: &Darcy,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<SeepageGrid> {
    let Some(own) = &written.grid else {
        let mut spacing = [grid.spacing; 3];
        if grid.dimension == 2 {
            spacing[2] = 1.0;
        }
        return Some(SeepageGrid {
            cells: grid.cells,
            spacing,
            dimension: grid.dimension,
            ..SeepageGrid::default()
        });
    };
    let path = format!("{PATH}.grid");
    let mut corner = |written: &Option<_>, name: &str, default: [f64; 3]| {
        written.as_ref().map_or(default, |corner| {
            AlignedBox::vector(grid, corner, &format!("{path}.{name}"), findings)
        })
    };
    let from = corner(&own.from, "from", [0.0; 3]);
    let to = corner(&own.to, "to", grid.size);
    for a in 0..grid.dimension {
        if from[a] < -1e-9 * grid.size[a] || to[a] > grid.size[a] * (1.0 + 1e-9) {
            findings.error(
                &path,
                format!(
                    "the grid extends beyond the domain, which is 0 … {} m along {}",
                    number(grid.size[a]),
                    AXES[a]
                ),
                "end the grid at the face of the domain",
            );
            return None;
        }
    }
    match (&own.cells, &own.spacing) {
        (Some(cells), None) => equal(cells, [from, to], grid.dimension, findings),
        (None, Some(widths)) => {
            let made = graded(widths, [from, to], grid.dimension, findings)?;
            check_ratios(&made, findings);
            Some(made)
        }
        (both, _) => {
            let reason = if both.is_some() {
                "the grid has both a number of cells and widths of cells"
            } else {
                "the grid has neither a number of cells nor widths of cells"
            };
            findings.error(
                &path,
                reason,
                "write the number of equal cells along each axis in `cells`, or the widths in `spacing`",
            );
            None
        }
    }
}

/// Returns a grid of equal cells.
fn equal(
    written: &[u32],
    [from, to]: [[f64; 3]; 2],
    dimension: usize,
    findings: &mut Findings,
) -> Option<SeepageGrid> {
    let path = format!("{PATH}.grid");
    if written.len() != dimension || written.iter().any(|n| *n == 0 || *n > 100_000) {
        findings.error(
            &format!("{path}.cells"),
            format!("this list needs {dimension} numbers from 1 to 100000"),
            "write the number of cells along each axis",
        );
        return None;
    }
    let (mut cells, mut spacing) = ([1; 3], [1.0; 3]);
    for a in 0..dimension {
        cells[a] = written[a] as usize;
        spacing[a] = (to[a] - from[a]) / real(cells[a]);
        if !has_extent(spacing[a], a, findings) {
            return None;
        }
    }
    Some(SeepageGrid {
        cells,
        origin: from,
        spacing,
        dimension,
        ..SeepageGrid::default()
    })
}

/// Returns `true` for a positive length; reports a finding otherwise.
fn has_extent(length: f64, axis: usize, findings: &mut Findings) -> bool {
    let good = length > 0.0 && length.is_finite();
    if !good {
        findings.error(
            &format!("{PATH}.grid"),
            format!("the grid has no extent along {}", AXES[axis]),
            "write the lower corner in `from`, the upper one in `to`",
        );
    }
    good
}

/// Returns a grid of cells with stated widths.
fn graded(
    written: &[CellWidths],
    [from, to]: [[f64; 3]; 2],
    dimension: usize,
    findings: &mut Findings,
) -> Option<SeepageGrid> {
    let path = format!("{PATH}.grid.spacing");
    if written.len() != dimension {
        findings.error(
            &path,
            format!("this list needs one entry for each of the {dimension} axes"),
            "write for each axis {\"width\": ...}, {\"points\": ...} or {\"widths\": ...}",
        );
        return None;
    }
    let mut made = SeepageGrid {
        cells: [1; 3],
        origin: from,
        spacing: [1.0; 3],
        dimension,
        ..SeepageGrid::default()
    };
    let mut graded: GradedFaces = [None, None, None];
    for (a, widths) in written.iter().enumerate() {
        if !has_extent(to[a] - from[a], a, findings) {
            return None;
        }
        match faces(widths, from[a], to[a]) {
            Ok(faces) => {
                let cells = faces.len() - 1;
                let mean = (to[a] - from[a]) / real(cells);
                let differs = |pair: &[f64]| (pair[1] - pair[0] - mean).abs() > 1e-9 * mean;
                (made.cells[a], made.spacing[a]) = (cells, mean);
                // Equal cells are those of a uniform axis.
                graded[a] = faces.windows(2).any(differs).then(|| Arc::from(faces));
            }
            Err((field, reason, remedy)) => {
                findings.error(&format!("{path}[{a}].{field}"), reason, remedy);
                return None;
            }
        }
    }
    Some(made.with_faces(graded))
}

/// Field, reason and remedy of a wrong list of widths.
type Fault = (String, String, Remedy);

/// Returns the faces between the cells of an axis.
fn faces(written: &CellWidths, from: f64, to: f64) -> Result<Vec<f64>, Fault> {
    let length = to - from;
    let positive = |width: f64| width > 0.0 && width.is_finite();
    let not_positive = |width: f64| format!("a width is {}; it must be above 0 m", number(width));
    let too_many = |cells: f64| {
        format!(
            "this makes {} cells; at most {MOST_CELLS} are allowed along an axis",
            number(cells)
        )
    };
    match written {
        CellWidths::Width(width) => {
            let fault = |reason: String, remedy: Remedy| Err(("width".to_owned(), reason, remedy));
            let cells = length / width;
            if !positive(*width) {
                return fault(not_positive(*width), "write a width in m".into());
            }
            if cells > MOST_CELLS {
                return fault(too_many(cells), "use wider cells".into());
            }
            let whole = cells.round().max(1.0);
            if (cells - whole).abs() > ROUNDING * whole {
                let remedy = format!("use {} m", length / whole);
                let reason = format!(
                    "the grid is {} m long, {} widths; it must be a whole number of them",
                    number(length),
                    number(cells)
                );
                return fault(reason, remedy.into());
            }
            let cells = base::number::whole(whole);
            let face = |n: usize| from + length * (real(n) / whole);
            Ok((0..=cells).map(face).collect())
        }
        CellWidths::Widths(widths) => {
            let fault =
                |reason: String, remedy: &str| Err(("widths".to_owned(), reason, remedy.into()));
            if let Some(width) = widths.iter().find(|width| !positive(**width)) {
                return fault(not_positive(*width), "write widths in m");
            }
            let sum: f64 = widths.iter().sum();
            if real(widths.len()) > MOST_CELLS {
                return fault(too_many(real(widths.len())), "use wider cells");
            }
            if sum.is_nan() || (sum - length).abs() > ROUNDING * length {
                let reason = format!(
                    "the widths add up to {} m, but the grid is {} m long",
                    number(sum),
                    number(length)
                );
                return fault(
                    reason,
                    "add or remove cells, or correct `from` and `to` of the grid",
                );
            }
            let mut at = 0.0;
            let mut faces = vec![from];
            for width in widths {
                at += width;
                faces.push(from + at * (length / sum));
            }
            faces[widths.len()] = to;
            Ok(faces)
        }
        CellWidths::Points(points) => faces_by_points(points, from, to),
    }
}

/// Returns the faces of cells whose widths change linearly between points: in each interval a geometric series of the
/// smallest number of cells that are not wider than stated, by its middle. All points are faces.
fn faces_by_points(points: &[[f64; 2]], from: f64, to: f64) -> Result<Vec<f64>, Fault> {
    let fault = |n: usize, reason: String, remedy: &str| {
        Err((format!("points[{n}]"), reason, Remedy::from(remedy)))
    };
    let slack = ROUNDING * (to - from);
    for (n, [at, width]) in points.iter().enumerate() {
        if !(*width > 0.0 && width.is_finite()) {
            let reason = format!("the width is {}; it must be above 0 m", number(*width));
            return fault(n, reason, "write [position, width] in m");
        }
        if !(*at >= from - slack && *at <= to + slack) {
            let reason = format!(
                "the position {} m lies outside the grid, which reaches from {} to {} m",
                number(*at),
                number(from),
                number(to)
            );
            return fault(n, reason, "move the point into the grid");
        }
        if n > 0 && *at <= points[n - 1][0] + slack {
            let reason = format!(
                "the position {} m is not above that of the point before, {} m",
                number(*at),
                number(points[n - 1][0])
            );
            return fault(
                n,
                reason,
                "list the points in ascending order of their positions",
            );
        }
    }
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        let reason = "the list has no points".to_owned();
        return Err((
            "points".into(),
            reason,
            "write at least one [position, width]".into(),
        ));
    };
    let mut all = points.to_vec();
    if first[0] > from + slack {
        all.insert(0, [from, first[1]]);
    }
    if last[0] < to - slack {
        all.push([to, last[1]]);
    }
    let end = all.len() - 1;
    (all[0][0], all[end][0]) = (from, to);
    let mut faces = vec![from];
    for (n, pair) in all.windows(2).enumerate() {
        let ([start, width], [stop, wider]) = (pair[0], pair[1]);
        let slope = (wider - width) / (stop - start);
        let equal = (wider / width - 1.0).abs() < 1e-9;
        // Integral of 1/width over the interval.
        let count = if equal {
            (stop - start) / width
        } else {
            (wider / width).ln() / slope
        };
        if real(faces.len()) + count > MOST_CELLS {
            let reason = format!("more than {MOST_CELLS} cells along an axis");
            return fault(n.min(points.len() - 1), reason, "use wider cells");
        }
        let cells = (count - ROUNDING).ceil().max(1.0);
        for k in 1..base::number::whole(cells) {
            let part = real(k) / cells;
            faces.push(if equal {
                start + (stop - start) * part
            } else {
                start + width * (slope * count * part).exp_m1() / slope
            });
        }
        faces.push(stop);
    }
    Ok(faces)
}

/// Warns of neighbouring cells of very different widths.
fn check_ratios(grid: &SeepageGrid, findings: &mut Findings) {
    for a in 0..grid.dimension {
        let axis = grid.axis(a);
        let (ratio, face) = axis.largest_ratio();
        if ratio > USUAL_RATIO * (1.0 + 1e-9) {
            findings.warn(
                &format!("{PATH}.grid.spacing[{a}]"),
                format!(
                    "two neighbouring cells at {} = {} m differ in width by a factor of {}: cells that widen by \
                     {USUAL_RATIO} from one to the next change the discharge below a sheet pile by {USUAL_LOSS} %, \
                     by 2 three times as much",
                    AXES[a],
                    number(axis.face(face)),
                    number(ratio)
                ),
                "let the widths change more slowly, by more points or a longer distance between them",
            );
        }
    }
}

/// Returns the widths of cells that are `ratio` times as wide as those of an axis: the given ones divided into equal
/// parts, or merged.
#[must_use]
pub fn rescaled_widths(axis: &GridAxis<'_>, ratio: f64) -> Vec<f64> {
    if ratio < 1.0 {
        let parts = (1.0 / ratio).round();
        let of_cell =
            |cell| std::iter::repeat_n(axis.width(cell) / parts, base::number::whole(parts));
        (0..axis.cells).flat_map(of_cell).collect()
    } else {
        let merged = base::number::whole(ratio.round());
        let starts = (0..axis.cells).step_by(merged);
        starts
            .map(|start| axis.length(start, (start + merged).min(axis.cells)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratios(faces: &[f64]) -> Vec<f64> {
        let widths: Vec<f64> = faces.windows(2).map(|pair| pair[1] - pair[0]).collect();
        widths.windows(2).map(|pair| pair[1] / pair[0]).collect()
    }

    #[test]
    fn widths_between_points_are_a_geometric_series() {
        let points = vec![[0.0, 4.0], [60.0, 0.5], [70.0, 0.5]];
        let faces = faces(&CellWidths::Points(points), 0.0, 100.0).unwrap();
        assert_eq!((faces[0], faces[faces.len() - 1]), (0.0, 100.0));
        for at in [60.0, 70.0] {
            assert!(faces.contains(&at), "{at}");
        }
        let fine = faces.iter().position(|x| *x == 60.0).unwrap();
        let falling = ratios(&faces[..=fine]);
        for ratio in &falling {
            assert!((ratio / falling[0] - 1.0).abs() < 1e-9, "{falling:?}");
        }
        let last = faces[fine] - faces[fine - 1];
        assert!(last < 0.55 && last > 0.45, "{last}");
        // Beyond the last point the width stays the same.
        assert_eq!(faces.len() - 1 - fine, 80);
    }

    #[test]
    fn widths_are_refined_and_merged() {
        let grid = SeepageGrid {
            cells: [1, 4, 1],
            spacing: [1.0, 0.5, 1.0],
            dimension: 2,
            ..SeepageGrid::default()
        };
        let grid = grid.with_faces([Some(Arc::from([0.0, 1.0, 3.0, 6.0, 6.5])), None, None]);
        let fine = rescaled_widths(&grid.axis(0), 0.5);
        assert_eq!(fine, [0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 0.25, 0.25]);
        assert_eq!(rescaled_widths(&grid.axis(0), 2.0), [3.0, 3.5]);
        assert_eq!(rescaled_widths(&grid.axis(1), 1.0), [0.5; 4]);
    }

    #[test]
    fn wrong_widths_are_refused_by_name() {
        let wrong = |written: CellWidths| faces(&written, 0.0, 10.0).unwrap_err();
        for (written, field, reason) in [
            (CellWidths::Width(0.0), "width", "above 0"),
            (CellWidths::Width(3.0), "width", "whole number"),
            (CellWidths::Width(1e-9), "width", "at most"),
            (CellWidths::Widths(vec![5.0, -5.0]), "widths", "above 0"),
            (CellWidths::Widths(vec![5.0, 4.0]), "widths", "add up to 9"),
            (CellWidths::Widths(vec![]), "widths", "add up to 0"),
            (CellWidths::Points(vec![]), "points", "no points"),
            (
                CellWidths::Points(vec![[11.0, 1.0]]),
                "points[0]",
                "outside",
            ),
            (
                CellWidths::Points(vec![[1.0, f64::NAN]]),
                "points[0]",
                "above 0",
            ),
            (
                CellWidths::Points(vec![[2.0, 1.0], [2.0, 2.0]]),
                "points[1]",
                "not above",
            ),
            (
                CellWidths::Points(vec![[2.0, 1e-9]]),
                "points[0]",
                "more than",
            ),
        ] {
            let (at, text, _) = wrong(written.clone());
            assert!(
                at == field && text.contains(reason),
                "{written:?}: {at} {text}"
            );
        }
    }
}
