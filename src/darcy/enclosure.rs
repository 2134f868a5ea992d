//! Walls around the water: the fraction of each cell, and of each face between cells, that lies inside them.
//!
//! Cells outside the walls are blocked. Porosity is relative to the volume inside. The conductance of a face is
//! proportional to its open area. Half-spaces cut boxes exactly, by clipping a convex polyhedron (its volume by the
//! divergence theorem) and a convex polygon.

use super::grid::SeepageGrid;
use base::number::real;
use base::vector::{cross, dot, minus};

type Point = [f64; 3];

/// Region that the water may fill.
#[derive(Clone, Debug, PartialEq)]
pub enum Enclosure {
    /// Whole grid.
    Everything,
    /// Points with n·x ≤ d for every (n, d), n of unit length: a convex region, cut exactly.
    HalfSpaces(Vec<(Point, f64)>),
}

/// Minimum fraction of a cell inside the walls: other cells are blocked, because slivers conduct almost nothing and
/// could contain a whole grain by its centre. Faces with a smaller open fraction are closed, as their flow would be
/// lost in rounding.
pub const MIN_OPEN: f64 = 0.01;

/// Face between the ground and a drain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrainFace {
    /// Position of the cell of the ground.
    pub cell: usize,
    /// Axis of the normal.
    pub axis: usize,
    /// `true` if the drain lies above the cell along the axis.
    pub upper: bool,
    /// Open fraction of the face; for a source the fraction of the cell that contains water.
    pub open: f64,
    /// `true` for a source in the cell instead of a face.
    pub source: bool,
    /// Index of the drain.
    pub drain: usize,
}

/// Open fractions of cells and faces; the same on every rank.
#[derive(Clone, Debug, PartialEq)]
pub struct Openness {
    /// Fraction of a cell's volume inside the walls; 0 for a blocked cell.
    pub inside: Vec<f64>,
    /// Fraction of the area of each cell's lower face inside the walls, per axis; 0 next to a blocked cell. Indices
    /// are those of a grid with one more cell along the axis.
    pub faces: [Vec<f64>; 3],
    /// Faces between the ground and drains, in ascending order of the positions of their cells.
    pub drain_faces: Vec<DrainFace>,
    /// Grid of cells.
    pub grid: SeepageGrid,
}

impl Openness {
    /// Computes the open fractions of an enclosure on a grid.
    #[must_use]
    pub fn measure(grid: &SeepageGrid, enclosure: &Enclosure) -> Self {
        let mut all = Self {
            inside: vec![1.0; grid.count()],
            faces: std::array::from_fn(|axis| vec![1.0; with_one_more(grid, axis).count()]),
            drain_faces: Vec::new(),
            grid: grid.clone(),
        };
        match enclosure {
            Enclosure::Everything => {}
            Enclosure::HalfSpaces(planes) => all.clip(planes),
        }
        for fraction in &mut all.inside {
            if *fraction < MIN_OPEN {
                *fraction = 0.0;
            }
        }
        all.close_faces();
        all
    }

    /// Returns the position of the lower face of a cell normal to `axis`; `cell[axis]` may be one past the last.
    #[must_use]
    pub fn face(&self, axis: usize, cell: [usize; 3]) -> usize {
        let [nx, ny, _] = self.grid.cells;
        let (nx, ny) = (nx + usize::from(axis == 0), ny + usize::from(axis == 1));
        (cell[2] * ny + cell[1]) * nx + cell[0]
    }

    /// Returns the volume of a cell inside the walls \[m3; per metre of depth in 2-D, m2\].
    #[must_use]
    pub fn volume(&self, index: usize) -> f64 {
        self.inside[index] * self.grid.volume(self.grid.cell(index))
    }

    /// Returns `true` if a cell cannot contain water.
    #[must_use]
    pub fn blocked(&self, index: usize) -> bool {
        self.inside[index] <= 0.0
    }

    fn clip(&mut self, planes: &[(Point, f64)]) {
        let grid = self.grid.clone();
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            let (lower, widths) = (grid.corner(cell), grid.widths(cell));
            let upper = std::array::from_fn(|a| lower[a] + widths[a]);
            self.inside[index] = clipped_volume(lower, upper, planes) / grid.volume(cell);
        }
        for axis in 0..3 {
            let faces = with_one_more(&grid, axis);
            for index in 0..faces.count() {
                let mut cell = faces.cell(index);
                let corner = grid.corner(cell);
                cell[axis] = cell[axis].min(grid.cells[axis] - 1);
                let polygon = rectangle(corner, grid.widths(cell), axis);
                let area = area(&clip_polygon(polygon, planes));
                self.faces[axis][index] = (area / grid.area(axis, cell)).min(1.0);
            }
        }
    }

    /// Closes faces next to blocked cells, and slivers.
    pub(super) fn close_faces(&mut self) {
        for axis in 0..3 {
            let faces = with_one_more(&self.grid, axis);
            for index in 0..faces.count() {
                let upper = faces.cell(index);
                let mut lower = upper;
                let open = |cell: [usize; 3]| self.inside[self.grid.index(cell)] > 0.0;
                let mut either = upper[axis] < self.grid.cells[axis] && !open(upper);
                if upper[axis] > 0 {
                    lower[axis] -= 1;
                    either |= !open(lower);
                }
                if either || self.faces[axis][index] < MIN_OPEN {
                    self.faces[axis][index] = 0.0;
                }
            }
        }
    }
}

pub(super) fn with_one_more(grid: &SeepageGrid, axis: usize) -> SeepageGrid {
    let mut faces = grid.clone();
    faces.cells[axis] += 1;
    faces
}

fn rectangle(corner: Point, spacing: Point, axis: usize) -> Vec<Point> {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let at = |p: f64, q: f64| {
        let mut x = corner;
        x[a] += p * spacing[a];
        x[b] += q * spacing[b];
        x
    };
    vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]
}

/// Returns twice the area of a convex polygon as a vector along its normal.
fn double_area(polygon: &[Point]) -> Point {
    let mut sum = [0.0; 3];
    for k in 2..polygon.len() {
        let part = cross(
            minus(polygon[k - 1], polygon[0]),
            minus(polygon[k], polygon[0]),
        );
        for a in 0..3 {
            sum[a] += part[a];
        }
    }
    sum
}

fn area(polygon: &[Point]) -> f64 {
    let twice = double_area(polygon);
    0.5 * dot(twice, twice).sqrt()
}

/// Returns a polygon cut by n·x ≤ d (Sutherland and Hodgman 1974); the new points on the plane are appended to
/// `cut`.
fn cut_polygon(polygon: &[Point], plane: &(Point, f64), cut: &mut Vec<Point>) -> Vec<Point> {
    let side = |x: &Point| dot(plane.0, *x) - plane.1;
    let mut kept = Vec::new();
    for (k, from) in polygon.iter().enumerate() {
        let to = &polygon[(k + 1) % polygon.len()];
        let (s, t) = (side(from), side(to));
        if s <= 0.0 {
            kept.push(*from);
        }
        if (s <= 0.0) != (t <= 0.0) {
            let u = s / (s - t);
            let x = std::array::from_fn(|a| from[a] + u * (to[a] - from[a]));
            kept.push(x);
            cut.push(x);
        }
    }
    kept
}

fn clip_polygon(mut polygon: Vec<Point>, planes: &[(Point, f64)]) -> Vec<Point> {
    for plane in planes {
        polygon = cut_polygon(&polygon, plane, &mut Vec::new());
    }
    polygon
}

/// Returns the volume of a box cut by half-spaces.
fn clipped_volume(lower: Point, upper: Point, planes: &[(Point, f64)]) -> f64 {
    let size = minus(upper, lower);
    let whole: f64 = size.iter().product();
    let mut faces: Vec<Vec<Point>> = Vec::with_capacity(6 + planes.len());
    for axis in 0..3 {
        let mut low = rectangle(lower, size, axis);
        low.reverse();
        faces.push(low);
        let mut corner = lower;
        corner[axis] = upper[axis];
        faces.push(rectangle(corner, size, axis));
    }
    let mut touched = false;
    for plane in planes {
        let furthest = (0..3).fold(-plane.1, |sum, a| {
            sum + (plane.0[a] * lower[a]).max(plane.0[a] * upper[a])
        });
        if furthest <= 0.0 {
            continue;
        }
        touched = true;
        let mut cut = Vec::new();
        faces = faces
            .iter()
            .map(|face| cut_polygon(face, plane, &mut cut))
            .filter(|face| face.len() > 2)
            .collect();
        if cut.len() > 2 {
            faces.push(sorted_around(cut, plane.0));
        }
    }
    if !touched {
        return whole;
    }
    // Divergence theorem about a corner of the box, which keeps numbers small.
    let six_times: f64 = faces
        .iter()
        .map(|face| dot(double_area(face), minus(face[0], lower)))
        .sum();
    (six_times / 6.0).clamp(0.0, whole)
}

/// Returns points of a plane sorted around their mean, counter-clockwise about the normal.
fn sorted_around(points: Vec<Point>, normal: Point) -> Vec<Point> {
    let n = real(points.len());
    let mean: Point = std::array::from_fn(|a| points.iter().map(|x| x[a]).sum::<f64>() / n);
    let axis = (0..3)
        .min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()))
        .unwrap_or(0);
    let mut unit = [0.0; 3];
    unit[axis] = 1.0;
    let u = cross(normal, unit);
    let v = cross(normal, u);
    let angle = |x: &Point| dot(minus(*x, mean), v).atan2(dot(minus(*x, mean), u));
    let mut sorted = points;
    sorted.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> SeepageGrid {
        SeepageGrid {
            cells: [n; 3],
            origin: [0.0; 3],
            spacing: [1.0 / real(n); 3],
            dimension: 3,
            ..SeepageGrid::default()
        }
    }

    fn total(openness: &Openness) -> f64 {
        (0..openness.grid.count()).map(|k| openness.volume(k)).sum()
    }

    fn tetrahedron() -> Vec<(Point, f64)> {
        let n = 1.0 / 3.0_f64.sqrt();
        vec![
            ([-1.0, 0.0, 0.0], -0.1),
            ([0.0, -1.0, 0.0], -0.1),
            ([0.0, 0.0, -1.0], -0.1),
            ([n, n, n], n),
        ]
    }

    #[test]
    fn clipping_keeps_the_volume_of_a_tetrahedron() {
        // Legs of length 0.7: 0.7^3/6. Slivers below the minimum fraction are missing, with an error bounded by
        // their number.
        let exact = 0.7_f64.powi(3) / 6.0;
        for n in [1, 2, 5, 8] {
            let grid = grid(n);
            let planes = tetrahedron();
            let mut sum = 0.0;
            for index in 0..grid.count() {
                let lower = grid.corner(grid.cell(index));
                let upper = lower.map(|x| x + grid.spacing[0]);
                sum += clipped_volume(lower, upper, &planes);
            }
            assert!((sum / exact - 1.0).abs() < 1e-12, "{n}: {sum}");
            let open = Openness::measure(&grid, &Enclosure::HalfSpaces(planes));
            assert!(total(&open) <= exact * (1.0 + 1e-12));
            assert!(total(&open) > 0.98 * exact);
        }
    }

    #[test]
    fn a_wedge_opens_faces_by_their_area() {
        // x ≤ z in a grid of one unit cell: half the volume, half of the faces normal to y, nothing of that at x =
        // 1.
        let s = 0.5_f64.sqrt();
        let wedge = Enclosure::HalfSpaces(vec![([s, 0.0, -s], 0.0)]);
        let open = Openness::measure(&grid(1), &wedge);
        assert!((open.inside[0] - 0.5).abs() < 1e-15);
        assert!((open.faces[1][0] - 0.5).abs() < 1e-15);
        assert!((open.faces[0][0] - 1.0).abs() < 1e-15);
        assert!(open.faces[0][1] < 1e-15);
        assert!((open.faces[2][1] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn cells_outside_are_blocked_and_their_faces_closed() {
        let open = Openness::measure(
            &grid(4),
            &Enclosure::HalfSpaces(vec![([1.0, 0.0, 0.0], 0.5)]),
        );
        for index in 0..64 {
            let [x, ..] = open.grid.cell(index);
            assert_eq!(open.blocked(index), x >= 2);
        }
        assert!(open.faces[0][open.face(0, [2, 0, 0])] <= 0.0);
        assert!(open.faces[0][open.face(0, [1, 0, 0])] >= 1.0);
        assert!(open.faces[1][open.face(1, [3, 2, 0])] <= 0.0);
    }
}
