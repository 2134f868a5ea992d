//! Structures on the coarse grid: the water fraction of each cell, and the open fraction of each face.
//!
//! A cell that a surface may cut is divided into sub-cells. Two neighbouring sub-cells are connected if the line
//! between their centres does not pass through a solid, so that a sheet thinner than any cell separates them. **The
//! water of a cell is its largest connected part**, and a face is open where it joins the water of the cells on
//! both sides. Any path through open faces is therefore a path through water: no sheet leaks, whatever its
//! direction, and its effective position is within half a cell of the true one. A sheet on the faces of cells is
//! represented exactly.

use super::enclosure::{MIN_OPEN, Openness};
use super::grid::SeepageGrid;
use base::number::real;
use std::sync::Arc;
use structure::Images;

/// Number of sub-cells along an edge of a cell, in 2-D and in 3-D.
const DIVISIONS: [usize; 2] = [32, 8];
/// Length of a solid part of a line, in sub-cells, below which it is rounding. A centre of a sub-cell on a surface is
/// water.
const ROUNDING: f64 = 1e-9;

/// Part of a cell that structures leave to the water.
#[derive(Clone, Debug)]
enum OpenPart {
    /// Whole cell.
    Water,
    /// No part of the cell.
    Solid,
    /// Sub-cells of the water in the cell, x fastest.
    Part(Vec<bool>),
}

/// Division of the cells into sub-cells.
struct Division<'a> {
    grid: &'a SeepageGrid,
    solids: &'a [Arc<Images>],
    /// Number of sub-cells along each axis: 1 along z in 2-D.
    sub_cells: [usize; 3],
}

impl Division<'_> {
    fn count(&self) -> usize {
        self.sub_cells.iter().product()
    }

    fn index(&self, sub: [usize; 3]) -> usize {
        (sub[2] * self.sub_cells[1] + sub[1]) * self.sub_cells[0] + sub[0]
    }

    /// Returns the edge of a sub-cell of a cell \[m\].
    fn edge(&self, axis: usize, cell: [usize; 3]) -> f64 {
        self.grid.width(axis, cell) / real(self.sub_cells[axis])
    }

    fn centre(&self, cell: [usize; 3], sub: [usize; 3]) -> [f64; 3] {
        let corner = self.grid.corner(cell);
        std::array::from_fn(|a| {
            if a < self.grid.dimension {
                corner[a] + (real(sub[a]) + 0.5) * self.edge(a, cell)
            } else {
                0.0
            }
        })
    }

    /// Returns the sub-cells of a layer normal to an axis.
    fn layer(&self, axis: usize, level: usize) -> impl Iterator<Item = [usize; 3]> + '_ {
        let count = self.count() / self.sub_cells[axis];
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        (0..count).map(move |n| {
            let mut sub = [0; 3];
            sub[axis] = level;
            sub[a] = n % self.sub_cells[a];
            sub[b] = n / self.sub_cells[a];
            sub
        })
    }

    /// Finds the solid parts of a line along an axis, in metres from its start.
    fn solid_parts(&self, from: [f64; 3], axis: usize, length: f64, found: &mut Vec<[f64; 2]>) {
        found.clear();
        let mut along = [0.0; 3];
        along[axis] = length;
        let mut one = Vec::new();
        for solid in self.solids {
            if solid.distance(from) < length {
                solid.chords(from, along, &mut one);
                found.extend(one.iter().map(|part| part.map(|t| t * length)));
            }
        }
    }

    /// Returns the part of a cell that structures leave to the water.
    fn open_part(&self, cell: [usize; 3]) -> OpenPart {
        let centre = self.grid.centre(cell);
        let dimension = self.grid.dimension;
        let reach = 0.5001
            * (0..dimension)
                .map(|a| self.grid.width(a, cell).powi(2))
                .sum::<f64>()
                .sqrt();
        let distances = self.solids.iter().map(|solid| solid.distance(centre));
        let nearest = distances.fold(f64::INFINITY, f64::min);
        if nearest > reach {
            return OpenPart::Water;
        }
        if nearest < -reach {
            return OpenPart::Solid;
        }
        // Marks of sub-cells: 1 for solid; 2, 4, 8 for separated from the next sub-cell along an axis.
        let mut marks = vec![0_u8; self.count()];
        let mut parts = Vec::new();
        for axis in 0..dimension {
            let edge = self.edge(axis, cell);
            let near = ROUNDING * edge;
            let steps = self.sub_cells[axis] - 1;
            for first in self.layer(axis, 0) {
                self.solid_parts(
                    self.centre(cell, first),
                    axis,
                    real(steps) * edge,
                    &mut parts,
                );
                for level in 0..=steps {
                    let mut sub = first;
                    sub[axis] = level;
                    let (low, high) = (real(level) * edge, real(level + 1) * edge);
                    let mark = &mut marks[self.index(sub)];
                    if parts.iter().any(|[s, t]| s + near < low && low + near < *t) {
                        *mark |= 1;
                    }
                    let cuts = |[s, t]: &[f64; 2]| t.min(high) - s.max(low) > near;
                    if level < steps && parts.iter().any(cuts) {
                        *mark |= 2 << axis;
                    }
                }
            }
            // The ends of a segment do not determine the medium there.
            for level in [0, steps] {
                for sub in self.layer(axis, level) {
                    let at = self.centre(cell, sub);
                    if self.solids.iter().any(|solid| solid.distance(at) < -near) {
                        marks[self.index(sub)] |= 1;
                    }
                }
            }
        }
        self.largest(&marks)
    }

    /// Returns the largest connected part; among equal ones the first.
    fn largest(&self, marks: &[u8]) -> OpenPart {
        let mut part = vec![0_u32; marks.len()];
        let (mut parts, mut best) = (0_u32, (0, 0));
        let mut stack = Vec::new();
        for start in 0..marks.len() {
            if marks[start] & 1 > 0 || part[start] > 0 {
                continue;
            }
            parts += 1;
            part[start] = parts;
            stack.push(start);
            let mut size = 0;
            while let Some(at) = stack.pop() {
                size += 1;
                let sub = [
                    at % self.sub_cells[0],
                    at / self.sub_cells[0] % self.sub_cells[1],
                    at / (self.sub_cells[0] * self.sub_cells[1]),
                ];
                for axis in 0..self.grid.dimension {
                    let stride: usize = self.sub_cells[..axis].iter().product();
                    let up = (sub[axis] + 1 < self.sub_cells[axis]).then(|| (at, at + stride));
                    let down = (sub[axis] > 0).then(|| (at - stride, at - stride));
                    for (lower, next) in up.into_iter().chain(down) {
                        if marks[lower] & (2 << axis) == 0
                            && marks[next] & 1 == 0
                            && part[next] == 0
                        {
                            part[next] = parts;
                            stack.push(next);
                        }
                    }
                }
            }
            if size > best.0 {
                best = (size, parts);
            }
        }
        match best {
            (0, _) => OpenPart::Solid,
            (size, _) if size == marks.len() => OpenPart::Water,
            (_, name) => OpenPart::Part(part.iter().map(|p| *p == name).collect()),
        }
    }

    /// Returns the open fraction of the face below a cell, which may be one past the last; `of` returns the parts
    /// of cells.
    fn face<'a>(
        &self,
        axis: usize,
        upper: [usize; 3],
        of: impl Fn([usize; 3]) -> Option<&'a OpenPart>,
    ) -> f64 {
        let mut lower = upper;
        lower[axis] = upper[axis].wrapping_sub(1);
        let [below, above] = [lower, upper].map(of);
        let whole = |left: Option<&OpenPart>| matches!(left, None | Some(OpenPart::Water));
        if [below, above]
            .iter()
            .any(|left| matches!(left, Some(OpenPart::Solid)))
        {
            return 0.0;
        }
        // A sheet may lie between two cells without solids.
        let wet = |left: Option<&OpenPart>, sub: [usize; 3]| match left {
            Some(OpenPart::Part(part)) => part[self.index(sub)],
            other => whole(other),
        };
        // Edges of the sub-cells below and above the face.
        let edges = [lower, upper].map(|mut cell| {
            cell[axis] = cell[axis].min(self.grid.cells[axis] - 1);
            self.edge(axis, cell)
        });
        let least = edges[0].min(edges[1]);
        let mut parts = Vec::new();
        let (mut open, mut all) = (0_usize, 0_usize);
        for first in self.layer(axis, 0) {
            all += 1;
            let mut last = first;
            last[axis] = self.sub_cells[axis] - 1;
            if !wet(below, last) || !wet(above, first) {
                continue;
            }
            // From centre to centre; at the ends of the grid from or to the face.
            let (from, length) = match (below, above) {
                (Some(_), Some(_)) => (self.centre(lower, last), 0.5 * (edges[0] + edges[1])),
                (Some(_), None) => (self.centre(lower, last), 0.5 * edges[0]),
                _ => {
                    let mut from = self.centre(upper, first);
                    from[axis] -= 0.5 * edges[1];
                    (from, 0.5 * edges[1])
                }
            };
            self.solid_parts(from, axis, length, &mut parts);
            if parts.iter().all(|[s, t]| t - s <= ROUNDING * least) {
                open += 1;
            }
        }
        real(open) / real(all)
    }
}

impl<'a> Division<'a> {
    fn new(grid: &'a SeepageGrid, solids: &'a [Arc<Images>]) -> Self {
        let n = DIVISIONS[usize::from(grid.dimension == 3)];
        Self {
            grid,
            solids,
            sub_cells: std::array::from_fn(|a| if a < grid.dimension { n } else { 1 }),
        }
    }
}

/// Returns the centroid of the water of a cell near these solids \[m\]; none for a cell without water.
#[must_use]
pub fn centre_of_water(
    grid: &SeepageGrid,
    solids: &[Arc<Images>],
    cell: [usize; 3],
) -> Option<[f64; 3]> {
    let division = Division::new(grid, solids);
    match division.open_part(cell) {
        OpenPart::Water => Some(grid.centre(cell)),
        OpenPart::Solid => None,
        OpenPart::Part(wet) => {
            let (mut sum, mut count) = ([0.0; 3], 0_usize);
            for (place, _) in wet.iter().enumerate().filter(|(_, wet)| **wet) {
                let sub_cells = division.sub_cells;
                let sub = [
                    place % sub_cells[0],
                    place / sub_cells[0] % sub_cells[1],
                    place / (sub_cells[0] * sub_cells[1]),
                ];
                let centre = division.centre(cell, sub);
                sum = std::array::from_fn(|a| sum[a] + centre[a]);
                count += 1;
            }
            Some(sum.map(|x| x / real(count)))
        }
    }
}

impl Openness {
    /// Returns the open fractions of cells and faces reduced by these solids.
    #[must_use]
    pub fn with_structures(mut self, solids: &[Arc<Images>]) -> Self {
        if solids.is_empty() {
            return self;
        }
        let grid = self.grid.clone();
        let division = Division::new(&grid, solids);
        let cells = 0..grid.count();
        let left: Vec<OpenPart> = cells.map(|k| division.open_part(grid.cell(k))).collect();
        for (fraction, left) in self.inside.iter_mut().zip(&left) {
            *fraction *= match left {
                OpenPart::Water => 1.0,
                OpenPart::Solid => 0.0,
                OpenPart::Part(part) => {
                    real(part.iter().filter(|wet| **wet).count()) / real(part.len())
                }
            };
            if *fraction < MIN_OPEN {
                *fraction = 0.0;
            }
        }
        let near = |cell: [usize; 3]| {
            // Larger than the distance from a centre to the far corner of an adjacent cell.
            let reach = reach(&grid, cell);
            let centre = grid.centre(cell);
            solids
                .iter()
                .any(|solid| solid.distance(centre).abs() < reach)
        };
        let of = |cell: [usize; 3]| {
            let inside = (0..3).all(|a| cell[a] < grid.cells[a]);
            inside.then(|| &left[grid.index(cell)])
        };
        for axis in 0..grid.dimension {
            let faces = super::enclosure::with_one_more(&grid, axis);
            let open: Vec<f64> = (0..faces.count())
                .map(|k| {
                    let upper = faces.cell(k);
                    let mut beside = upper;
                    beside[axis] = upper[axis].min(grid.cells[axis] - 1);
                    // Solid cells close their lower faces.
                    if near(beside) {
                        division.face(axis, upper, of)
                    } else {
                        1.0
                    }
                })
                .collect();
            for (fraction, open) in self.faces[axis].iter_mut().zip(open) {
                *fraction *= open;
            }
        }
        self.close_faces();
        self
    }
}

/// Returns a length above the distance from the centre of a cell to the far corner of an adjacent one \[m\].
fn reach(grid: &SeepageGrid, cell: [usize; 3]) -> f64 {
    let wider = |a: usize| {
        let (axis, at) = (grid.axis(a), cell[a]);
        let next = axis
            .width(at.saturating_sub(1))
            .max(axis.width((at + 1).min(axis.cells - 1)));
        1.6 / 1.5 * (0.5 * axis.width(at) + next)
    };
    if grid.is_graded() {
        norm(std::array::from_fn(wider), grid.dimension)
    } else {
        1.6 * norm(grid.spacing, grid.dimension)
    }
}

fn norm(lengths: [f64; 3], dimension: usize) -> f64 {
    lengths[..dimension]
        .iter()
        .map(|x| x * x)
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Enclosure;
    use structure::{Frame, Shape};

    struct Silent;

    impl base::error::Report for Silent {
        fn error(&mut self, path: &str, reason: String, _: base::error::Remedy) {
            panic!("{path}: {reason}");
        }

        fn unknown_material(&mut self, _: &str, _: &str, _: &[&str]) {}
    }

    fn solid(text: &str, dimension: usize) -> Arc<Images> {
        let shape: Shape = serde_json::from_str(text).unwrap();
        let frame = Frame {
            dimension,
            size: [1.0; 3],
        };
        let read = |_: &base::geometry::Mesh| Err(String::new());
        let solid = shape.solid(&frame, "", &read, &mut Silent).unwrap();
        Arc::new(Images::new(solid, frame, [false; 3], 0.0))
    }

    fn open(text: &str, n: usize, dimension: usize) -> Openness {
        let flat = dimension == 2;
        let grid = SeepageGrid {
            cells: [n, n, if flat { 1 } else { n }],
            origin: [0.0; 3],
            spacing: [
                1.0 / real(n),
                1.0 / real(n),
                if flat { 1.0 } else { 1.0 / real(n) },
            ],
            dimension,
            ..SeepageGrid::default()
        };
        Openness::measure(&grid, &Enclosure::Everything).with_structures(&[solid(text, dimension)])
    }

    /// Returns `true` if open faces connect the first cell with the last.
    fn leads_through(open: &Openness) -> bool {
        let grid = &open.grid;
        let mut seen = vec![false; grid.count()];
        let mut stack = vec![0];
        while let Some(k) = stack.pop() {
            if std::mem::replace(&mut seen[k], true) || open.blocked(k) {
                continue;
            }
            let cell = grid.cell(k);
            for axis in 0..grid.dimension {
                let mut next = cell;
                next[axis] += 1;
                if next[axis] < grid.cells[axis] && open.faces[axis][open.face(axis, next)] > 0.0 {
                    stack.push(grid.index(next));
                }
                if cell[axis] > 0 && open.faces[axis][open.face(axis, cell)] > 0.0 {
                    next[axis] -= 2;
                    stack.push(grid.index(next));
                }
            }
        }
        seen[grid.count() - 1]
    }

    /// Checks that no sheet leaks: with a thickness of a thousandth of a cell, upright, between cells or within them,
    /// and oblique. A sheet that ends in the ground leaves a path.
    #[test]
    fn no_sheet_leaks_however_it_stands() {
        for (text, through) in [
            (
                r#"{"box": {"from": [0.49995, 0], "to": [0.50005, 1]}}"#,
                false,
            ),
            (r#"{"box": {"from": [0.53, 0], "to": [0.5301, 1]}}"#, false),
            (
                r#"{"polygon": {"points": [[0.2, 0], [0.2001, 0], [0.9001, 1], [0.9, 1]]}}"#,
                false,
            ),
            (
                r#"{"polygon": {"points": [[0, 0.71], [1, 0.32], [1, 0.3201], [0, 0.7101]]}}"#,
                false,
            ),
            (
                r#"{"box": {"from": [0.53, 0.13], "to": [0.5301, 1]}}"#,
                true,
            ),
        ] {
            for n in [4, 10, 13] {
                let open = open(text, n, 2);
                assert_eq!(leads_through(&open), through, "{text} {n}");
            }
        }
        let sheet = r#"{"polygon": {"points": [[0.2, 0], [0.2001, 0], [0.9001, 1], [0.9, 1]], "axis": "y", "from": 0,
            "to": 1}}"#;
        assert!(!leads_through(&open(sheet, 5, 3)));
    }

    /// Checks that volume and area fractions of cells cut by a box are those of the box, within a sub-cell.
    #[test]
    fn fractions_are_those_of_the_solid() {
        let open_2d = open(r#"{"box": {"from": [-1, -1], "to": [2, 0.33]}}"#, 10, 2);
        let at = |y: usize| open_2d.inside[open_2d.grid.index([4, y, 0])];
        assert_eq!([at(2), at(4)], [0.0, 1.0]);
        assert!((at(3) - 0.7).abs() < 1.0 / 64.0 + 1e-12, "{}", at(3));
        let side = open_2d.faces[0][open_2d.face(0, [4, 3, 0])];
        assert!((side - 0.7).abs() < 1.0 / 64.0 + 1e-12);
        assert_eq!(open_2d.faces[1][open_2d.face(1, [4, 3, 0])], 0.0);
        assert_eq!(open_2d.faces[1][open_2d.face(1, [4, 4, 0])], 1.0);
        // Half way up a cell, the open fraction of a face shows it.
        let pile = open(
            r#"{"box": {"from": [0.4999, 0.35], "to": [0.5001, 2]}}"#,
            10,
            2,
        );
        let face = |y: usize| pile.faces[0][pile.face(0, [5, y, 0])];
        assert_eq!([face(2), face(3), face(4)], [1.0, 0.5, 0.0]);
        let ball = open(
            r#"{"sphere": {"centre": [0.5, 0.5, 0.5], "radius": 0.3}}"#,
            8,
            3,
        );
        let water: f64 = (0..ball.grid.count()).map(|k| ball.volume(k)).sum();
        let exact = 1.0 - 4.0 / 3.0 * std::f64::consts::PI * 0.027;
        assert!((water - exact).abs() < 2e-3, "{water} {exact}");
    }
}
