//! Wetted surface of a structure in the ground, and the force of the water on it.
//!
//! The surface is divided into pieces, each in one cell. The pressure of a piece is that of the cell in front of it
//! whose water lies on the same side of all structures, extrapolated by the gradient in this cell. In 2-D force and
//! torque of a pressure that is linear in a cell are exact.

use super::Pressure;
use super::cut_cells::centre_of_water;
use super::grid::{GridAxis, SeepageGrid};
use base::vector::norm;
use decomposition::ExactSum;
use std::collections::BTreeMap;
use std::sync::Arc;
use structure::Images;

/// Distance in front of a surface at which its cell is sought, relative to the smallest edge of a cell; the distance of
/// outline or facets from the true surface is added.
const IN_FRONT: f64 = 1e-6;
/// Fraction of the distance to the water of a cell that may lie in a solid because of rounding.
const ROUNDING: f64 = 1e-7;
/// Points of Gauss's two-point rule on 0 to 1.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Maximum distance of an outline or of facets from the true surface, relative to the smallest edge of a cell.
const TOLERANCE: f64 = 1e-3;

/// Point of the surface: its cell, its position \[m\], and area times outward normal \[m²\].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    cell: usize,
    point: [f64; 3],
    area: [f64; 3],
}

/// Centres of the water of cells \[m\]; none for a cell without water.
type WaterCentres = BTreeMap<usize, Option<[f64; 3]>>;

/// Structures in the ground.
pub type Solids = Vec<Arc<Images>>;

/// Surface of a structure in the ground.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WettedSurface {
    pieces: Vec<Piece>,
}

impl WettedSurface {
    /// Divides the surface of the structure with an index; `wet` returns `true` for cells that contain water.
    #[must_use]
    pub fn new(
        grid: &SeepageGrid,
        solids: &[Arc<Images>],
        index: usize,
        wet: &dyn Fn(usize) -> bool,
    ) -> Self {
        let smallest =
            (0..grid.dimension).fold(f64::INFINITY, |least, a| least.min(grid.spacing[a]));
        let deviation = solids
            .get(index)
            .map_or(0.0, |solid| solid.solid().deviation(TOLERANCE * smallest));
        let front = IN_FRONT * smallest + (1.0 + ROUNDING) * deviation;
        let mut pieces = Vec::new();
        let mut water = BTreeMap::new();
        let mut add = |point: [f64; 3], area: [f64; 3]| {
            let size = norm(area);
            if size > 0.0 {
                let start: [f64; 3] = std::array::from_fn(|a| point[a] + front * area[a] / size);
                if let Some(cell) = in_front(grid, solids, (wet, &mut water), start) {
                    pieces.push(Piece { cell, point, area });
                }
            }
        };
        if let Some(solid) = solids.get(index) {
            if grid.dimension == 2 {
                outline(grid, &solid.solid().outline(TOLERANCE * smallest), &mut add);
            } else {
                let facets = solid.solid().facets(TOLERANCE * smallest);
                for face in &facets.faces {
                    let corner = |k: usize| facets.vertices[face[k] as usize];
                    for k in 1..face.len().saturating_sub(1) {
                        triangle(
                            [corner(0), corner(k), corner(k + 1)],
                            0.5 * smallest,
                            &mut add,
                        );
                    }
                }
            }
        }
        Self { pieces }
    }
}

impl Pressure {
    /// Returns the force of the water on a surface \[N; in 2-D N/m\] and its torque about a point \[m\].
    #[must_use]
    pub fn load(&self, surface: &WettedSurface, about: [f64; 3]) -> [f64; 6] {
        let (grid, weight) = (self.grid(), self.weight());
        let mut sums: [ExactSum; 6] = std::array::from_fn(|_| ExactSum::new());
        for piece in &surface.pieces {
            let centre = grid.centre(grid.cell(piece.cell));
            let gradient = self.inner_gradient(piece.cell);
            let mut value = self.reduced(piece.cell);
            for a in 0..grid.dimension {
                value += gradient[a] * (piece.point[a] - centre[a]) + weight[a] * piece.point[a];
            }
            let force = piece.area.map(|n| -value * n);
            let arm: [f64; 3] = std::array::from_fn(|a| piece.point[a] - about[a]);
            for a in 0..3 {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                sums[a].add(force[a]);
                sums[3 + a].add(arm[b] * force[c] - arm[c] * force[b]);
            }
        }
        sums.map(|sum| sum.value())
    }
}

/// Passes the points of an outline to `add`, two in each part of an edge within a cell.
fn outline(grid: &SeepageGrid, outline: &[[f64; 2]], add: &mut impl FnMut([f64; 3], [f64; 3])) {
    for (k, from) in outline.iter().enumerate() {
        let to = outline[(k + 1) % outline.len()];
        let ends = [[from[0], from[1], 0.0], [to[0], to[1], 0.0]];
        let along: [f64; 2] = [to[0] - from[0], to[1] - from[1]];
        let mut cuts = vec![0.0, 1.0];
        for a in 0..2 {
            cut(ends, a, grid.axis(a), &mut cuts);
        }
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            let part = 0.5 * (pair[1] - pair[0]);
            for place in GAUSS {
                let t = pair[0] + place * (pair[1] - pair[0]);
                let point = [from[0] + t * along[0], from[1] + t * along[1], 0.0];
                add(point, [part * along[1], -part * along[0], 0.0]);
            }
        }
    }
}

/// Returns the cell whose water is in front of a point close to a surface: the one that contains the point, or the
/// nearest adjacent one whose water no structure separates from the point; none above the ground.
fn in_front(
    grid: &SeepageGrid,
    solids: &[Arc<Images>],
    (wet, water): (&dyn Fn(usize) -> bool, &mut WaterCentres),
    start: [f64; 3],
) -> Option<usize> {
    let own = grid.holding(start)?;
    let mut reaches = |cell: [usize; 3]| {
        let index = grid.index(cell);
        if !wet(index) {
            return false;
        }
        let known = water
            .entry(index)
            .or_insert_with(|| centre_of_water(grid, solids, cell));
        let Some(water) = *known else {
            return false;
        };
        let way: [f64; 3] = std::array::from_fn(|a| water[a] - start[a]);
        let mut parts = Vec::new();
        solids.iter().all(|solid| {
            solid.chords(start, way, &mut parts);
            parts.iter().all(|[from, to]| to - from <= ROUNDING)
        })
    };
    if reaches(own) {
        return Some(grid.index(own));
    }
    let mut nearest: Option<(f64, usize)> = None;
    for n in 0..27_usize {
        let step = [n % 3, n / 3 % 3, n / 9];
        let cell: [usize; 3] = std::array::from_fn(|a| (own[a] + step[a]).wrapping_sub(1));
        if (0..3).any(|a| cell[a] >= grid.cells[a]) || !reaches(cell) {
            continue;
        }
        let centre = grid.centre(cell);
        let distance: f64 = (0..3).map(|a| (centre[a] - start[a]).powi(2)).sum();
        if nearest.is_none_or(|(least, _)| distance < least) {
            nearest = Some((distance, grid.index(cell)));
        }
    }
    nearest.map(|(_, cell)| cell)
}

/// Adds the fractions of a line at which it crosses a plane between cells.
fn cut([from, to]: [[f64; 3]; 2], axis: usize, planes: GridAxis<'_>, cuts: &mut Vec<f64>) {
    let along = to[axis] - from[axis];
    for plane in 0..=planes.cells {
        let t = (planes.face(plane) - from[axis]) / along;
        if t > 0.0 && t < 1.0 {
            cuts.push(t);
        }
    }
}

/// Divides a triangle until its edges are short, and passes its points with area times normal to `add`: the
/// midpoints of the edges, which are exact for quadratic polynomials.
fn triangle(corners: [[f64; 3]; 3], longest: f64, add: &mut impl FnMut([f64; 3], [f64; 3])) {
    let middle = |a: usize, b: usize| -> [f64; 3] {
        std::array::from_fn(|k| 0.5 * (corners[a][k] + corners[b][k]))
    };
    let length = |a: usize, b: usize| {
        (0..3)
            .map(|k| (corners[a][k] - corners[b][k]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let middles = [middle(0, 1), middle(1, 2), middle(2, 0)];
    if length(0, 1).max(length(1, 2)).max(length(2, 0)) > longest {
        let [a, b, c] = corners;
        let [ab, bc, ca] = middles;
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            triangle(part, longest, add);
        }
        return;
    }
    let edge = |b: usize| -> [f64; 3] { std::array::from_fn(|k| corners[b][k] - corners[0][k]) };
    let (u, v) = (edge(1), edge(2));
    let area: [f64; 3] = std::array::from_fn(|k| {
        let (a, b) = ((k + 1) % 3, (k + 2) % 3);
        0.5 * (u[a] * v[b] - u[b] * v[a]) / 3.0
    });
    for point in middles {
        add(point, area);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_keeps_its_area_and_its_second_moment() {
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let (mut area, mut moment) = (0.0, 0.0);
        triangle(corners, 0.3, &mut |point, part| {
            area += part[2];
            moment += point[0] * point[0] * part[2];
        });
        assert!((area - 1.0).abs() < 1e-14, "{area}");
        // Base b and height h along x: h b^3/12.
        assert!((moment - 8.0 / 12.0).abs() < 1e-14, "{moment}");
    }

    #[test]
    fn a_line_is_cut_at_the_planes_between_cells() {
        let mut cuts = Vec::new();
        let mut planes = GridAxis {
            cells: 3,
            origin: 0.0,
            spacing: 1.0,
            faces: None,
        };
        let line = [[0.25, 0.0, 0.0], [2.25, 0.0, 0.0]];
        cut(line, 0, planes, &mut cuts);
        assert_eq!(cuts, [0.375, 0.875]);
        cut([[0.25, 1.0, 0.0], [0.25, 1.0, 0.0]], 0, planes, &mut cuts);
        assert_eq!(cuts.len(), 2);
        let faces = [0.0, 0.75, 1.25, 3.0];
        planes.faces = Some(&faces);
        cuts.clear();
        cut(line, 0, planes, &mut cuts);
        assert_eq!(cuts, [0.25, 0.5]);
    }
}
