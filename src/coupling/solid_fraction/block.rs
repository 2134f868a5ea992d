//! Exact solid fractions of a convex polyhedron in all cells of a layer at once.
//!
//! Along a row of cells the solid begins or ends at each face, so that the volume in cell k of the row is
//!
//! V_k = -Σ ∫ clamp(k + 1 - x, 0, 1) n_x dA
//!
//! over the part of the surface in the row's square column, x along the row and n the outward normal (the
//! divergence theorem). A piece of a face within cell k adds its integral to that cell, and its projected area to
//! each cell behind it. The faces are cut along the planes between layers, rows and cells, each piece from the
//! previous one. Planes of other faces are not involved, so that the cost is proportional to the surface: some 30
//! ns per piece, for any number of faces.
//!
//! Each layer is cut from the whole faces, so that its fractions have the same bits for any set of computed layers.
//! The axis along which volumes are summed changes the rounding, which is seen in cells that hold a billionth of a
//! solid. It is therefore a function of the domain: where the rows of the lattice run along another axis, because
//! the slabs do, the fractions of the box are computed first and read in the order of the rows.

use super::faces;
use base::number::{floor_i32, to_i32};
use dem::polyhedron::Polyhedron;
use lbm::lanes::WIDEST;
use lbm::links::CellPlane;
use nalgebra::{Matrix3, Vector3};

/// Fraction below which a cell counts as free, because it is rounding.
const ROUNDING_FRACTION: f64 = 1e-12;

/// Surface of a convex polyhedron in cells.
#[derive(Debug, Default, PartialEq)]
pub struct PolyhedronSurface {
    planes: Vec<CellPlane>,
    /// Corners of one face after another, counter-clockwise seen from outside.
    corners: Vec<[f64; 3]>,
    /// End of each face in the list of corners.
    ends: Vec<usize>,
    /// The corners of the shape.
    placed: Vec<[f64; 3]>,
}

impl PolyhedronSurface {
    /// Computes the surface of a shape: body frame rotated by `rotation`, centroid at `centre`, `spacing` metres
    /// per cell.
    pub fn set_pose(
        &mut self,
        shape: &Polyhedron,
        rotation: &Matrix3<f64>,
        centre: [f64; 3],
        spacing: f64,
    ) {
        faces(shape, rotation, centre, spacing, &mut self.planes);
        self.placed.clear();
        self.placed.extend(shape.vertices().iter().map(|corner| {
            let turned = rotation * corner / spacing;
            <[f64; 3]>::from(turned + Vector3::from(centre))
        }));
        self.corners.clear();
        self.ends.clear();
        for face in 0..self.planes.len() {
            let corners = shape.face(face).iter();
            self.corners
                .extend(corners.map(|&corner| self.placed[corner as usize]));
            self.ends.push(self.corners.len());
        }
    }

    /// Returns its planes, in the order of the faces of the shape.
    #[must_use]
    pub fn planes(&self) -> &[CellPlane] {
        &self.planes
    }

    /// Returns plane and corners of each face.
    fn faces(&self) -> impl Iterator<Item = (&CellPlane, &[[f64; 3]])> {
        let mut start = 0;
        self.planes
            .iter()
            .zip(&self.ends)
            .map(move |(plane, &end)| {
                let corners = &self.corners[start..end];
                start = end;
                (plane, corners)
            })
    }
}

/// Point: its coordinates along the slow, the middle and the fast axis.
type Point = [f64; 3];

/// Axes of layers, of the rows of a layer and of the cells of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowAxes {
    /// Axes of the rows of the lattice.
    pub lattice: [usize; 3],
    /// Axes of the rows along which volumes are summed: the same on all slabs.
    pub sums: [usize; 3],
}

/// Fractions of a layer of cells; the buffers are reused. [`Self::fill`] starts a body, [`Self::layer`] computes a
/// layer, and [`Self::row`] returns the fractions of a row.
#[derive(Debug, Default)]
pub struct BlockTable {
    /// Axes of the sums from slowest to fastest.
    order: [usize; 3],
    /// Lowest cell and number of cells, in the order of `order`. Rows begin at the body, so that sums along them do
    /// not depend on the box.
    lower: [i32; 3],
    cells: [usize; 3],
    /// Number of cells of a row before the box.
    cells_before_box: usize,
    /// Volume in each cell of the layer from faces within it, and volume that begins there for all later cells.
    within: Vec<f64>,
    from: Vec<f64>,
    /// Filled fractions of the cells of a row.
    fractions: Vec<f64>,
    cut: Cut,
    /// Fractions of the box in the order of the lattice, if it differs from that of the sums; else empty.
    turned: Vec<f64>,
    /// Numbers of rows of a layer and of cells of a row of the lattice, and the present layer.
    rows: [usize; 2],
    present: usize,
}

/// Intermediate polygons.
#[derive(Debug, Default)]
struct Cut {
    slab: Vec<Point>,
    spare: Vec<Point>,
    row: Vec<Point>,
    cell: Vec<Point>,
    remaining: Vec<Point>,
}

impl BlockTable {
    /// Prepares a body over the `cells` from `lower` on.
    pub fn fill(
        &mut self,
        surface: &PolyhedronSurface,
        lower: [i32; 3],
        cells: [usize; 3],
        axes: RowAxes,
    ) {
        self.begin(surface, lower, cells, axes.sums);
        let [layers, rows, length] = axes.lattice.map(|axis| cells[axis]);
        self.rows = [rows, length];
        self.turned.clear();
        if axes.lattice == axes.sums {
            return;
        }
        let mut turned = std::mem::take(&mut self.turned);
        turned.resize(layers * rows * length + WIDEST, 0.0);
        let mut strides = [0; 3];
        (strides[axes.lattice[0]], strides[axes.lattice[1]]) = (rows * length, length);
        strides[axes.lattice[2]] = 1;
        let strides = axes.sums.map(|axis| strides[axis]);
        let [layers, rows, length] = axes.sums.map(|axis| cells[axis]);
        for layer in 0..layers {
            self.sum_layer(surface, layer);
            for row in 0..rows {
                let first = layer * strides[0] + row * strides[1];
                for (k, fraction) in self.sum_row(row, 0, length).iter().enumerate() {
                    turned[first + k * strides[2]] = *fraction;
                }
            }
        }
        self.turned = turned;
    }

    /// Prepares the sums of a body in rows along the last axis of `order`.
    fn begin(
        &mut self,
        surface: &PolyhedronSurface,
        lower: [i32; 3],
        cells: [usize; 3],
        order: [usize; 3],
    ) {
        self.order = order;
        self.lower = order.map(|axis| lower[axis]);
        self.cells = order.map(|axis| cells[axis]);
        let (least, _) = range(surface.placed.iter().map(|corner| corner[order[2]]));
        let first = floor_i32(least).min(self.lower[2]);
        self.cells_before_box = usize::try_from(self.lower[2] - first).unwrap_or(0);
        self.lower[2] = first;
        self.cells[2] += self.cells_before_box;
        // One extra cell receives the volume that begins after the last.
        let room = self.cells[1] * (self.cells[2] + 1);
        self.within.resize(self.within.len().max(room), 0.0);
        self.from.resize(self.from.len().max(room), 0.0);
        self.fractions.resize(self.cells[2] + 2 * WIDEST, 0.0);
    }

    /// Computes a layer of the lattice, counted from the first.
    pub fn layer(&mut self, surface: &PolyhedronSurface, layer: usize) {
        self.present = layer;
        if self.turned.is_empty() {
            self.sum_layer(surface, layer);
        }
    }

    /// Computes the sums of a layer.
    fn sum_layer(&mut self, surface: &PolyhedronSurface, layer: usize) {
        let length = self.cells[2] + 1;
        self.within[..self.cells[1] * length].fill(0.0);
        self.from[..self.cells[1] * length].fill(0.0);
        let [slow, middle, fast] = self.order;
        let bottom = f64::from(self.lower[0] + to_i32(layer));
        let mut cut = std::mem::take(&mut self.cut);
        for (plane, corners) in surface.faces() {
            // The normal points against the row: the solid begins.
            let sign = -plane.normal[fast];
            if sign == 0.0 {
                continue;
            }
            let (least, most) = range(corners.iter().map(|corner| corner[slow]));
            if least >= bottom + 1.0 || most <= bottom {
                continue;
            }
            cut.slab.clear();
            cut.slab
                .extend(corners.iter().map(|at| [at[slow], at[middle], at[fast]]));
            if least < bottom {
                split::<0>(&cut.slab, bottom, &mut cut.remaining, &mut cut.spare);
                std::mem::swap(&mut cut.slab, &mut cut.spare);
            }
            if most > bottom + 1.0 {
                split::<0>(&cut.slab, bottom + 1.0, &mut cut.spare, &mut cut.remaining);
                std::mem::swap(&mut cut.slab, &mut cut.spare);
            }
            self.rows(&mut cut, 1_f64.copysign(sign));
        }
        self.cut = cut;
    }

    /// Cuts the part of a face in the layer into rows.
    fn rows(&mut self, cut: &mut Cut, sign: f64) {
        let (least, most) = range(cut.slab.iter().map(|at| at[1]));
        let mut row = floor_i32(least);
        while most > f64::from(row + 1) {
            split::<1>(&cut.slab, f64::from(row + 1), &mut cut.row, &mut cut.spare);
            std::mem::swap(&mut cut.slab, &mut cut.spare);
            self.pieces(cut, row, sign);
            row += 1;
        }
        std::mem::swap(&mut cut.slab, &mut cut.row);
        self.pieces(cut, row, sign);
    }

    /// Cuts the part of a face in a row into cells and adds up the pieces.
    fn pieces(&mut self, cut: &mut Cut, row: i32, sign: f64) {
        let row = row - self.lower[1];
        let Some(row) = usize::try_from(row).ok().filter(|&row| row < self.cells[1]) else {
            return;
        };
        let length = self.cells[2] + 1;
        let within = &mut self.within[row * length..][..length];
        let from = &mut self.from[row * length..][..length];
        let mut add = |cell: i32, polygon: &[Point]| {
            let (area, behind) = integrals(polygon, f64::from(cell));
            let first = usize::try_from(cell - self.lower[2]);
            if let Some(first) = first.ok().filter(|&first| first + 1 < length) {
                within[first] += sign * behind;
                from[first + 1] += sign * area;
            }
        };
        let (least, most) = range(cut.row.iter().map(|at| at[2]));
        let mut cell = floor_i32(least);
        while most > f64::from(cell + 1) {
            split::<2>(
                &cut.row,
                f64::from(cell + 1),
                &mut cut.cell,
                &mut cut.remaining,
            );
            std::mem::swap(&mut cut.row, &mut cut.remaining);
            add(cell, &cut.cell);
            cell += 1;
        }
        add(cell, &cut.row);
    }

    /// Computes the filled fractions of `count` cells from number `first` on in a row of the layer. Up to
    /// [`WIDEST`] elements beyond the row are undefined.
    pub fn row(&mut self, row: usize, first: usize, count: usize) -> &[f64] {
        if self.turned.is_empty() {
            return self.sum_row(row, first, count);
        }
        let [rows, length] = self.rows;
        &self.turned[(self.present * rows + row) * length + first..][..count]
    }

    /// Computes the filled fractions of cells in a row along the sums.
    fn sum_row(&mut self, row: usize, first: usize, count: usize) -> &[f64] {
        let length = self.cells[2] + 1;
        let within = &self.within[row * length..][..length];
        let from = &self.from[row * length..][..length];
        let mut sum = 0.0;
        for (fraction, (within, from)) in self.fractions.iter_mut().zip(within.iter().zip(from)) {
            sum += from;
            let part = sum + within;
            *fraction = if part < ROUNDING_FRACTION {
                0.0
            } else {
                part.min(1.0)
            };
        }
        &self.fractions[self.cells_before_box + first..][..count]
    }
}

/// Returns the smallest and the largest of some coordinates.
#[inline(always)]
fn range(coordinates: impl Iterator<Item = f64>) -> (f64, f64) {
    coordinates.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| {
        (least.min(x), most.max(x))
    })
}

/// Splits a convex polygon at a coordinate into the parts below and above it. The polygon must extend to both
/// sides.
#[inline(always)]
fn split<const AXIS: usize>(
    polygon: &[Point],
    at: f64,
    below: &mut Vec<Point>,
    above: &mut Vec<Point>,
) {
    below.clear();
    above.clear();
    let Some(&last) = polygon.last() else { return };
    let mut from = last;
    let mut height = from[AXIS] - at;
    for &to in polygon {
        let next = to[AXIS] - at;
        if height * next < 0.0 {
            let part = height / (height - next);
            let mut cut: Point = std::array::from_fn(|a| from[a] + (to[a] - from[a]) * part);
            cut[AXIS] = at;
            below.push(cut);
            above.push(cut);
        }
        if next <= 0.0 {
            below.push(to);
        }
        if next >= 0.0 {
            above.push(to);
        }
        (from, height) = (to, next);
    }
}

/// Returns the area of a polygon projected along the fast axis, and the area times its mean distance to the upper
/// end of a cell.
#[inline(always)]
fn integrals(polygon: &[Point], cell: f64) -> (f64, f64) {
    let [first, remaining @ ..] = polygon else {
        return (0.0, 0.0);
    };
    let (mut area, mut moment) = (0.0, 0.0);
    for pair in remaining.windows(2) {
        let [a, b] = [0, 1].map(|k: usize| [pair[k][0] - first[0], pair[k][1] - first[1]]);
        let twice = a[0] * b[1] - a[1] * b[0];
        area += twice;
        moment += twice * ((first[2] - cell) + (pair[0][2] - cell) + (pair[1][2] - cell));
    }
    let side = 1_f64.copysign(area);
    let area = 0.5 * area.abs();
    (area, area - side * moment / 6.0)
}
