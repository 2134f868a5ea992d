//! Ways of the water of a lattice past structures: water that an opening imposes must reach another opening.

use super::boundaries::ScenePatch;
use super::findings::Findings;
use super::flow::{Flow, PATH};
use super::grid::Grid;
use super::structures::Structure;
use base::number::real;
use case::geometry::Face;
use lbm::boundary::Inflow;

/// Maximum number of cells among which ways are sought.
const MAX_CELLS: usize = 2_000_000;
/// Part of the imposed flow that may remain without a way out: rounding.
const ROUNDING: f64 = 1e-9;
/// Mark of a cell inside a structure, and of one that was not reached yet.
const SOLID: u32 = u32::MAX;
const NEW: u32 = u32::MAX - 1;

/// Refuses openings whose imposed flow cannot leave because structures close the domain.
pub(crate) fn check(flow: &Flow, grid: &Grid, structures: &[Structure], findings: &mut Findings) {
    let solids: Vec<&Structure> = structures.iter().filter(|s| s.stops.water()).collect();
    let imposes = |patch: &ScenePatch| {
        let place = patch.imposed_at(grid, PATH);
        matches!(patch.condition.model().largest_inflow(&place), Inflow::Mean(mean) if mean.abs() > 0.0)
    };
    if solids.is_empty()
        || grid.cells.iter().product::<usize>() > MAX_CELLS
        || !flow.faces.iter().flatten().any(imposes)
    {
        return;
    }
    let part = parts(grid, &solids);
    let count = part.iter().filter(|p| **p < NEW).max().map_or(0, |p| p + 1);
    let mut sums = vec![[0.0; 2]; count as usize];
    let mut free = vec![false; count as usize];
    let mut first: Vec<Option<&ScenePatch>> = vec![None; count as usize];
    for face in Face::ALL {
        for cell in face_cells(grid, face) {
            let found = part[index(grid, cell)];
            let holds = |patch: &&ScenePatch| {
                let others = (0..3).filter(|a| *a != face.axis());
                others
                    .clone()
                    .all(|a| (patch.from[a]..patch.to[a]).contains(&cell[a]))
            };
            let patches = flow.faces[face.index()].iter().rev();
            let Some(patch) = patches.clone().find(holds).filter(|_| found < NEW) else {
                continue;
            };
            let n = found as usize;
            match patch
                .condition
                .model()
                .largest_inflow(&patch.imposed_at(grid, PATH))
            {
                Inflow::None => {}
                Inflow::Any => free[n] = true,
                Inflow::Mean(mean) => {
                    sums[n][0] += mean;
                    sums[n][1] += mean.abs();
                    first[n] = first[n].or(Some(patch));
                }
            }
        }
    }
    for (n, patch) in first.iter().enumerate() {
        let Some(patch) = patch.filter(|_| !free[n] && sums[n][0].abs() > ROUNDING * sums[n][1])
        else {
            continue;
        };
        let path = patch
            .path("profile")
            .unwrap_or_else(|| format!("{PATH}.boundaries"));
        findings.error(
            &path,
            format!(
                "the water of `{}` cannot reach another opening: structures block every path",
                patch.name
            ),
            "leave a gap of at least one cell, or remove the opening",
        );
        return;
    }
}

/// Returns the position of a cell in a list of all cells.
fn index(grid: &Grid, cell: [usize; 3]) -> usize {
    (cell[2] * grid.cells[1] + cell[1]) * grid.cells[0] + cell[0]
}

/// Returns the cells at a face.
fn face_cells(grid: &Grid, face: Face) -> Vec<[usize; 3]> {
    let axis = face.axis();
    if axis >= grid.dimension || grid.periodic[axis] {
        return Vec::new();
    }
    let (mut from, mut to) = ([0; 3], grid.cells);
    if face.is_max() {
        from[axis] = grid.cells[axis] - 1;
    } else {
        to[axis] = 1;
    }
    let mut cells = Vec::new();
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            cells.extend((from[0]..to[0]).map(|x| [x, y, z]));
        }
    }
    cells
}

/// Returns the connected part to which each cell belongs.
fn parts(grid: &Grid, solids: &[&Structure]) -> Vec<u32> {
    let cells = grid.cells;
    let mut part = vec![NEW; cells.iter().product()];
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let cell = [x, y, z];
                let mut at = cell.map(|n| (real(n) + 0.5) * grid.spacing);
                if grid.dimension == 2 {
                    at[2] = 0.0;
                }
                if solids.iter().any(|solid| solid.solid.distance(at) < 0.0) {
                    part[index(grid, cell)] = SOLID;
                }
            }
        }
    }
    let mut next = 0;
    let mut stack = Vec::new();
    for start in 0..part.len() {
        if part[start] != NEW {
            continue;
        }
        part[start] = next;
        stack.push(start);
        while let Some(at) = stack.pop() {
            let cell = [
                at % cells[0],
                at / cells[0] % cells[1],
                at / (cells[0] * cells[1]),
            ];
            for a in 0..grid.dimension {
                for step in [cells[a] - 1, 1] {
                    let mut other = cell;
                    other[a] = (cell[a] + step) % cells[a];
                    let wraps = cell[a].abs_diff(other[a]) > 1;
                    let near = !wraps || grid.periodic[a];
                    let to = index(grid, other);
                    if near && part[to] == NEW {
                        part[to] = next;
                        stack.push(to);
                    }
                }
            }
        }
        next += 1;
    }
    part
}
