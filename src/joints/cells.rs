//! Cells of a joint: the Voronoi division of its overlap among the points of a grid.
//!
//! The line between the points of two neighbours is normal to their common edge, so that a two-point flux is consistent
//! on polygons of any shape (Eymard, Gallouët and Herbin, Handbook of Numerical Analysis 7, 713 (2000), section 9). A
//! rectangle whose edges are those of the grid is divided into equal rectangles.

use crate::pairs::Joint;
use crate::polygon::Polygon;
use base::number::{real, whole};
use nalgebra::Vector2;

/// Distance from the edges of the overlap, divided by the spacing, below which a point of the grid is omitted.
const NEAR_EDGE: f64 = 0.25;
/// Maximum number of cells along an axis of a joint.
const MAX_CELLS: usize = 1000;

/// Neighbour of a cell across one of its edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Edge of the overlap, by its index.
    Edge(usize),
    /// Another cell of the joint, by its index in the joint.
    Cell(usize),
}

/// Cell of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Point of the cell's pressure, in the plane of the joint \[m\].
    pub point: Vector2<f64>,
    /// Outline of the cell, with the neighbours behind its edges.
    pub outline: Polygon<Side>,
    /// Area \[m²\].
    pub area: f64,
    /// Centroid, in the plane of the joint \[m\].
    pub centroid: Vector2<f64>,
}

/// Points of a regular grid over an overlap.
struct Grid {
    points: Vec<Vector2<f64>>,
    /// Cell of each position of the grid, if it has one.
    cell: Vec<Option<usize>>,
    /// Position of each cell in the grid.
    place: Vec<[usize; 2]>,
    counts: [usize; 2],
    spacing: Vector2<f64>,
}

impl Grid {
    fn new(overlap: &Polygon<usize>, size: f64) -> Self {
        let [low, high] = overlap.bounds();
        let extent = high - low;
        let count = |length: f64| whole((length / size - 1e-9).ceil()).clamp(1, MAX_CELLS);
        let counts = [count(extent.x), count(extent.y)];
        let spacing = Vector2::new(extent.x / real(counts[0]), extent.y / real(counts[1]));
        let mut grid = Self {
            points: Vec::new(),
            cell: vec![None; counts[0] * counts[1]],
            place: Vec::new(),
            counts,
            spacing,
        };
        let least = NEAR_EDGE * spacing.min();
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                let steps = Vector2::new(real(x) + 0.5, real(y) + 0.5);
                let point = low + steps.component_mul(&spacing);
                let inside = |(from, to, _): (Vector2<f64>, Vector2<f64>, usize)| {
                    (to - from).normalize().perp(&(point - from)) >= least
                };
                if overlap.edges().all(inside) {
                    grid.cell[x + counts[0] * y] = Some(grid.points.len());
                    grid.points.push(point);
                    grid.place.push([x, y]);
                }
            }
        }
        if grid.points.is_empty() {
            // If no cell fits, the whole overlap is a single cell.
            let (_, centroid) = overlap.area_and_centroid();
            (grid.counts, grid.cell) = ([1, 1], vec![Some(0)]);
            (grid.points, grid.place) = (vec![centroid], vec![[0, 0]]);
            grid.spacing = extent;
        }
        grid
    }

    /// Calls a function with the cells at a distance of `ring` positions from a cell, row by row.
    fn each_at(&self, cell: usize, ring: usize, mut visit: impl FnMut(usize)) {
        let [x, y] = self.place[cell];
        let rows = y.saturating_sub(ring)..=(y + ring).min(self.counts[1] - 1);
        for row in rows {
            let columns = x.saturating_sub(ring)..=(x + ring).min(self.counts[0] - 1);
            for column in columns {
                let far = column.abs_diff(x).max(row.abs_diff(y));
                if let (true, Some(other)) = (far == ring, self.cell[column + self.counts[0] * row])
                {
                    visit(other);
                }
            }
        }
    }
}

/// Returns the cells of a joint, with edges of at most about this size \[m\].
#[must_use]
pub fn divide(joint: &Joint, size: f64) -> Vec<Cell> {
    let grid = Grid::new(&joint.overlap, size);
    let corners = joint.overlap.corners().iter();
    let whole: Vec<_> = corners.map(|&(c, edge)| (c, Side::Edge(edge))).collect();
    let outline = |cell: usize| {
        let point = grid.points[cell];
        let mut outline = Polygon::new(whole.clone());
        let least = grid.spacing.min();
        for ring in 1..grid.counts[0].max(grid.counts[1]) {
            // A point further away than twice the farthest corner does not affect the cell.
            let far = |outline: &Polygon<Side>| {
                let corners = outline.corners().iter();
                corners.map(|(c, _)| (c - point).norm()).fold(0.0, f64::max)
            };
            if real(ring) * least > 2.0 * far(&outline) {
                break;
            }
            grid.each_at(cell, ring, |other| {
                let step = grid.points[other] - point;
                let normal = step.normalize();
                let middle = point + 0.5 * step;
                outline.clip(normal, normal.dot(&middle), Side::Cell(other));
            });
        }
        outline
    };
    let cell = |number: usize| {
        let outline = outline(number);
        let (area, centroid) = outline.area_and_centroid();
        Cell {
            point: grid.points[number],
            outline,
            area,
            centroid,
        }
    };
    (0..grid.points.len()).map(cell).collect()
}
