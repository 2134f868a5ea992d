//! Surface of the ground, resolved on the coarse grid: the cells above it, by the conditions on its parts.
//!
//! The surface is a staircase of the faces of cells, to which the conditions apply as to those of a drain. Its error
//! is of the first order in the size of the cells.

use super::polygons::points;
use super::{Drain, PATH, Seepage};
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use crate::scene::region::region;
use crate::scene::unique;
use base::error::Remedy;
use case::Case;
use case::darcy::{Terrain, TerrainSurface};
use case::geometry::Vector;
use darcy::{Condition, DrainCells};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Minimum and maximum number of points of a surface.
const POINTS: std::ops::RangeInclusive<usize> = 2..=1_000_000;
/// Path of the surface of the ground in a case.
const SURFACE: &str = "terrain";

/// Returns the path of a condition on the surface, without that of the seepage.
pub(super) fn path_of(condition: usize) -> String {
    format!("{SURFACE}.conditions[{condition}]")
}

/// Height of the ground over the horizontal coordinates.
enum Height {
    /// Points in the order of x, in 2-D \[m\].
    Line(Vec<[f64; 2]>),
    /// Coordinates x and y of the nodes, and the height of each, y fastest \[m\].
    Raster(Vec<f64>, Vec<f64>, Vec<f64>),
}

impl Height {
    /// Returns the height at a point \[m\].
    fn over(&self, point: [f64; 3]) -> f64 {
        match self {
            Self::Line(points) => {
                let next = points.partition_point(|p| p[0] <= point[0]);
                let clamped = |n: usize| points[n.min(points.len() - 1)];
                if next == 0 {
                    return points[0][1];
                }
                let ([x, low], [end, high]) = (clamped(next - 1), clamped(next));
                if end > x {
                    low + (high - low) * (point[0] - x) / (end - x)
                } else {
                    low
                }
            }
            Self::Raster(x, y, heights) => {
                let ([i, k], part) = interval(x, point[0]);
                let ([j, l], across) = interval(y, point[1]);
                let height = |i: usize, j: usize| heights[i * y.len() + j];
                let along = |j| (1.0 - part) * height(i, j) + part * height(k, j);
                (1.0 - across) * along(j) + across * along(l)
            }
        }
    }
}

/// Returns the two nodes around a coordinate, and its distance from the first as a fraction of their distance.
fn interval(nodes: &[f64], x: f64) -> ([usize; 2], f64) {
    let last = nodes.len() - 1;
    let next = nodes.partition_point(|node| *node <= x).min(last);
    let before = next.saturating_sub(1);
    if next == before {
        return ([before, next], 0.0);
    }
    let part = (x - nodes[before]) / (nodes[next] - nodes[before]);
    ([before, next], part.clamp(0.0, 1.0))
}

impl Seepage {
    /// Returns the parts of the surface of the ground; reports findings for an invalid surface.
    pub(super) fn terrain_of(
        &self,
        case: &Case,
        grid: &Grid,
        findings: &mut Findings,
    ) -> Vec<Drain> {
        let Some(written) = &self.written.terrain else {
            return Vec::new();
        };
        let path = format!("{PATH}.{SURFACE}");
        if case.grains.is_some() && self.written.unsaturated.is_none() {
            findings.error(
                &path,
                "grains in saturated ground form their own surface, so that their case has no terrain",
                Remedy::take_out("remove the terrain, or the grains", &path),
            );
            return Vec::new();
        }
        let Some(height) = height(case, &written.surface, grid, findings) else {
            return Vec::new();
        };
        let coarse = self.coarse_grid(grid.dimension);
        let up = grid.dimension - 1;
        let above = |cell: usize| {
            let cell = coarse.cell(cell);
            let centre = coarse.centre(cell);
            // Where a slope passes through centres, rounding decides. Counting all of these cells as ground, or none,
            // would change the discharge of a trapezoid of 80 cells by 0.9 %, every other one by 0.4 %.
            centre[up] > height.over(centre)
        };
        let above: Vec<bool> = (0..coarse.count()).map(above).collect();
        let place = format!("{path}.surface");
        if above.iter().all(|above| *above) {
            findings.error(
                &place,
                "the surface lies below the grid everywhere, so that there is no ground",
                "correct the heights, in m above the lower face of the domain",
            );
            return Vec::new();
        }
        if !above.iter().any(|above| *above) {
            findings.warn(
                &place,
                "the surface lies above the grid everywhere and has no effect",
                "correct the heights, in m above the lower face of the domain",
            );
        }
        self.parts(written, grid, &above, findings)
    }

    /// Returns the parts of the surface below the cells `above` it.
    fn parts(
        &self,
        written: &Terrain,
        grid: &Grid,
        above: &[bool],
        findings: &mut Findings,
    ) -> Vec<Drain> {
        let coarse = self.coarse_grid(grid.dimension);
        let mut known: Vec<&str> = self.patches.iter().map(|p| p.name.as_str()).collect();
        let mut owner: Vec<Option<usize>> = vec![None; above.len()];
        for (n, part) in written.conditions.iter().enumerate() {
            let path = format!("{PATH}.{}", path_of(n));
            unique(&mut known, &part.name, &format!("{path}.name"), findings);
            if matches!(part.condition, Condition::Discharge { .. }) {
                findings.error(
                    &format!("{path}.condition.discharge"),
                    "a discharge belongs to a well or to a face of the grid, not to the surface of the ground",
                    "state a flux per area, or add a drain",
                );
            }
            let whole = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
            let place = format!("{path}.region");
            let [from, to] = (part.region.as_ref())
                .map_or(whole, |written| region(grid, written, &place, findings));
            let mut touches = above.iter().all(|above| !above);
            for cell in (0..above.len()).filter(|&cell| above[cell]) {
                let centre = coarse.centre(coarse.cell(cell));
                if (0..3).all(|a| centre[a] >= from[a] && centre[a] < to[a]) {
                    owner[cell] = Some(n);
                    touches |= next_to_ground(&coarse, above, coarse.cell(cell));
                }
            }
            if !touches {
                findings.error(
                    &place,
                    "no part of the surface of the ground lies in the region",
                    "enlarge the region: it must contain centres of cells of air or open water on the surface",
                );
            }
        }
        let mut parts = Vec::new();
        for n in std::iter::once(None).chain((0..written.conditions.len()).map(Some)) {
            let only: Vec<bool> = (above.iter().zip(&owner))
                .map(|(above, owner)| *above && *owner == n)
                .collect();
            let Some([from, to]) = ends(&coarse, &only) else {
                continue;
            };
            let part = n.map(|n| &written.conditions[n]);
            let history = part.and_then(|part| part.history.clone());
            let history = history.unwrap_or_default();
            let mut condition = part.map_or(Condition::NoFlow {}, |part| part.condition);
            if let Some([_, value]) = history.first() {
                condition.set_value(*value);
            }
            parts.push(Drain {
                name: part.map_or_else(|| "impermeable surface".into(), |part| part.name.clone()),
                path: n.map_or_else(|| SURFACE.to_owned(), path_of),
                cells: DrainCells {
                    from,
                    to,
                    stays: false,
                    only: Some(Arc::from(only)),
                },
                condition,
                history,
            });
        }
        parts
    }

    /// Returns `true` if cells above the surface are next to a cell of ground, also across an edge.
    pub(super) fn reaches(&self, cells: &DrainCells, cell: [usize; 3]) -> bool {
        let Some(only) = &cells.only else {
            return false;
        };
        let dimension = if self.cells[2] == 1 { 2 } else { 3 };
        let coarse = self.coarse_grid(dimension);
        (0..only.len()).filter(|&n| only[n]).any(|n| {
            let other = coarse.cell(n);
            (0..3).all(|a| other[a].abs_diff(cell[a]) <= 1)
        })
    }
}

/// Returns `true` if one of the neighbours of a cell is ground.
fn next_to_ground(grid: &darcy::SeepageGrid, above: &[bool], cell: [usize; 3]) -> bool {
    (0..grid.dimension).any(|a| {
        let mut lower = cell;
        let mut upper = cell;
        upper[a] += 1;
        let below = lower[a].checked_sub(1).is_some_and(|at| {
            lower[a] = at;
            !above[grid.index(lower)]
        });
        below || upper[a] < grid.cells[a] && !above[grid.index(upper)]
    })
}

/// Returns the first and one past the last cell along each axis; none if there are no cells.
fn ends(grid: &darcy::SeepageGrid, only: &[bool]) -> Option<[[usize; 3]; 2]> {
    let cells = (0..only.len()).filter(|&n| only[n]).map(|n| grid.cell(n));
    cells.fold(None, |ends, cell| {
        let [mut from, mut to] = ends.unwrap_or([cell, cell]);
        for a in 0..3 {
            from[a] = from[a].min(cell[a]);
            to[a] = to[a].max(cell[a] + 1);
        }
        Some([from, to])
    })
}

/// Returns the height of a surface; reports a finding if its points do not define a surface.
fn height(
    case: &Case,
    surface: &TerrainSurface,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<Height> {
    let path = format!("{PATH}.{SURFACE}.surface");
    let (listed, place) = match surface {
        TerrainSurface::Points(written) => {
            let place = format!("{path}.points");
            let wrong = written.iter().position(|p| p.0.len() != grid.dimension);
            if let Some(n) = wrong {
                written[n].resolve(grid.dimension, &format!("{place}[{n}]"), findings);
                return None;
            }
            (written.iter().map(Vector::to_array).collect(), place)
        }
        // A drawing that could not be read has its finding.
        TerrainSurface::Dxf(_) => return None,
        TerrainSurface::Path(file) => {
            let place = format!("{path}.path");
            let text = io::plain::text(&case.directory.join(file), io::plain::LONGEST_INPUT);
            let read = text.map_err(|e| e.to_string()).and_then(|text| {
                points(&text, grid.dimension, "A surface")
                    .map_err(|e| format!("{}: {e}", file.display()))
            });
            match read {
                Ok(listed) => (listed, place),
                Err(reason) => {
                    let remedy = "correct the path (relative to the case) or the file";
                    findings.error(&place, reason, remedy);
                    return None;
                }
            }
        }
    };
    let made = if !POINTS.contains(&listed.len()) {
        Err(format!("the surface has {} points", listed.len()))
    } else if listed.iter().flatten().any(|x| !x.is_finite()) {
        Err("a coordinate of the surface is not a finite number".to_owned())
    } else if grid.dimension == 2 {
        line(&listed)
    } else {
        raster(&listed)
    };
    made.map_err(|reason| {
        let remedy = format!(
            "write {} to {} points, {}",
            POINTS.start(),
            POINTS.end(),
            if grid.dimension == 2 {
                "from left to right"
            } else {
                "one for each combination of the coordinates x and y"
            }
        );
        findings.error(&place, reason, remedy);
    })
    .ok()
}

/// Returns the height by the points of a line.
fn line(points: &[[f64; 3]]) -> Result<Height, String> {
    let back = points.windows(2).position(|pair| pair[1][0] < pair[0][0]);
    if let Some(n) = back {
        return Err(format!(
            "point {} of the surface, at x = {} m, lies to the left of the one before it, at {} m",
            n + 1,
            number(points[n + 1][0]),
            number(points[n][0])
        ));
    }
    Ok(Height::Line(points.iter().map(|p| [p[0], p[1]]).collect()))
}

/// Returns the height by the nodes of a raster.
fn raster(points: &[[f64; 3]]) -> Result<Height, String> {
    // One zero for both signs of it.
    let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(|x| x + 0.0)).collect();
    let coordinates = |a: usize| {
        let mut all: Vec<f64> = points.iter().map(|point| point[a]).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let (x, y) = (coordinates(0), coordinates(1));
    let bits = |point: &[f64; 3]| [point[0].to_bits(), point[1].to_bits()];
    let known: BTreeMap<[u64; 2], f64> = points.iter().map(|p| (bits(p), p[2])).collect();
    if known.len() != points.len() || points.len() != x.len() * y.len() {
        return Err(format!(
            "the {} points of the surface do not cover each of the {} x {} combinations of x and y exactly once",
            points.len(),
            x.len(),
            y.len()
        ));
    }
    let mut heights = Vec::with_capacity(points.len());
    for &at in &x {
        for &across in &y {
            let height = known.get(&[at.to_bits(), across.to_bits()]);
            heights.push(*height.ok_or("a node of the surface is missing")?);
        }
    }
    Ok(Height::Raster(x, y, heights))
}
