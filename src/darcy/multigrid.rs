//! Symmetric multigrid cycle in single precision, the preconditioner of the conjugate gradients.
//!
//! ```text
//! (A x)_i = sum_f t_f (x_i - x_j) + sum_b g_b x_i         t: conductance of a face, g: of a face with imposed pressure
//! ```
//!
//! Cells are merged in pairs along the axes of strongest coupling ([`merging`]). A correction is constant in a coarse
//! cell, and residuals are summed; the two operators are the transposes of each other. A coarse face conducts through
//! parallel lanes, each a series of half the inner face of one coarse cell, the face itself, and half the inner
//! face of the other:
//!
//! ```text
//! T = sum over lanes 1/(1/(2 t_inner) + 1/t_face + 1/(2 t_inner'))        a closed inner face does not contribute
//! ```
//!
//! This is the conductance of a uniform coarse grid, follows harmonic means where cells differ, and preserves exactly
//! the connections of the fine grid. Two Jacobi steps before and after the correction, with the weights of Chebyshev's
//! polynomial, smooth independently of the order of cells, so that any decomposition gives the same bits. The ranks
//! share the finest level. Each rank computes all other levels, together a seventh of the work (a third in 2-D).

mod merging;

use super::grid::SeepageGrid;
use super::layout::{Gather, Halo, Layout, Part};
use base::number::single;
use merging::{AxisMerging, Merging, Widths};

/// Maximum number of cells of a level that is solved by elimination.
const DIRECT: usize = 48;

/// Chebyshev weights of two Jacobi steps for eigenvalues of D^-1 A in `MIN_EIGENVALUE … 2`: the part of the error that
/// a coarse grid cannot represent.
const MIN_EIGENVALUE: f64 = 0.35;

/// Conductances of one level.
#[derive(Clone, Debug)]
pub(super) struct Matrix<T> {
    /// Conductance of the lower face of each cell, per axis.
    pub(super) t: [Vec<T>; 3],
    /// Sum over the faces of each cell; 1 for a cell without faces.
    pub(super) diagonal: Vec<T>,
    /// Sum over the faces of each cell that have an imposed pressure.
    pub(super) leak: Vec<T>,
}

/// Face with an imposed pressure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// Position of its cell.
    pub(super) at: usize,
    /// Axis, or [`STORED`].
    pub(super) axis: usize,
    pub(super) conductance: f64,
}

/// Axis index for a conductance that represents water stored in a cell, which is in series with nothing.
pub(super) const STORED: usize = 3;

impl<T: Copy + Default> Matrix<T> {
    pub(super) fn new(layout: &Layout) -> Self {
        Self {
            t: std::array::from_fn(|_| vec![T::default(); layout.len()]),
            diagonal: vec![T::default(); layout.len()],
            leak: vec![T::default(); layout.len()],
        }
    }
}

/// Number type of a level.
pub(super) trait Real:
    Copy
    + Send
    + Sync
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
{
}
impl Real for f32 {}
impl Real for f64 {}

/// Computes the flow into the cells of a row from their neighbours, sum of t (x_j - x_i) over the faces, and passes it
/// to `put(index in the row, sum)`.
///
/// Differences are computed before products: where open water is next to soil, its large conductances multiply
/// differences near zero, and the flow through the soil is not lost in rounding.
#[inline(always)]
pub(super) fn inflow<'a, T: Real>(
    matrix: &'a Matrix<T>,
    layout: &Layout,
    x: &'a [T],
    start: usize,
    length: usize,
    mut put: impl FnMut(usize, T),
) {
    let cut = |from: usize, of: &'a [T]| &of[from..from + length];
    let [_, sy, sz] = layout.stride;
    let (west, east) = (
        cut(start, &matrix.t[0][..]),
        cut(start + 1, &matrix.t[0][..]),
    );
    let (south, north) = (
        cut(start, &matrix.t[1][..]),
        cut(start + sy, &matrix.t[1][..]),
    );
    let (below, above) = (
        cut(start, &matrix.t[2][..]),
        cut(start + sz, &matrix.t[2][..]),
    );
    let here = cut(start, x);
    let (xw, xe) = (cut(start - 1, x), cut(start + 1, x));
    let (xs, xn) = (cut(start - sy, x), cut(start + sy, x));
    let (xb, xa) = (cut(start - sz, x), cut(start + sz, x));
    for i in 0..length {
        let x = here[i];
        put(
            i,
            ((west[i] * (xw[i] - x) + east[i] * (xe[i] - x))
                + (south[i] * (xs[i] - x) + north[i] * (xn[i] - x)))
                + (below[i] * (xb[i] - x) + above[i] * (xa[i] - x)),
        );
    }
}

struct Level {
    layout: Layout,
    matrix: Matrix<f32>,
    inverse: Vec<f32>,
    ground: Vec<Ground>,
    /// Cells merged for the next level.
    merging: Merging,
    /// Right side, solution, and a second buffer.
    b: Vec<f32>,
    x: Vec<f32>,
    y: Vec<f32>,
}

/// Levels, from the finest.
pub(super) struct Multigrid {
    levels: Vec<Level>,
    part: Part,
    halo: Halo,
    gather: Option<Gather>,
    /// Lower triangle of the factor of the last level, by rows, and the positions of its cells.
    factor: Vec<f64>,
    positions: Vec<usize>,
    solution: Vec<f64>,
    weights: [f32; 2],
}

/// Returns the planes along an axis of the finest grid at which slabs may be cut, between merged cells, both ends
/// included.
pub(super) fn cuts(grid: &SeepageGrid, axis: usize) -> Vec<usize> {
    let merging = if grid.count() <= DIRECT {
        Merging::equal([1; 3])
    } else {
        Widths::new(grid).merge(grid.cells)
    };
    merging.starts(axis, grid.cells[axis])
}

impl Multigrid {
    /// Returns the levels for a grid, without coefficients. `ranges` are the planes of every rank along the axis of
    /// `part`, in multiples of the merged cells.
    pub(super) fn new(
        grid: &SeepageGrid,
        part: Part,
        halo: Halo,
        ranges: &[std::ops::Range<usize>],
        communicator: &decomposition::Communicator,
        tag: u8,
    ) -> Result<Self, super::SeepageError> {
        let mut levels = Vec::new();
        let (mut cells, mut widths) = (grid.cells, Widths::new(grid));
        let mut sizes = Vec::new();
        let mut gather = None;
        loop {
            sizes.push(cells);
            let layout = Layout::new(cells);
            let last = layout.count() <= DIRECT;
            let merging = if last {
                Merging::equal([1; 3])
            } else {
                widths.merge(cells)
            };
            let n = layout.len();
            levels.push(Level {
                layout,
                matrix: Matrix::new(&layout),
                inverse: vec![0.0; n],
                ground: Vec::new(),
                merging: merging.clone(),
                b: vec![0.0; n],
                x: vec![0.0; n],
                y: vec![0.0; n],
            });
            if last {
                break;
            }
            cells = merging.cells(cells);
            widths = widths.coarser(&merging);
            if levels.len() == 1 && communicator.size() > 1 {
                let coarse: Vec<_> = (ranges.iter())
                    .map(|range| merging.planes(part.axis, range))
                    .collect();
                gather = Some(Gather::new::<f32>(
                    Layout::new(cells),
                    part.axis,
                    &coarse,
                    communicator,
                    tag,
                )?);
            }
        }
        if levels.len() == 1 && communicator.size() > 1 {
            gather = Some(Gather::new::<f32>(
                levels[0].layout,
                part.axis,
                ranges,
                communicator,
                tag,
            )?);
        }
        log::debug!(
            "multigrid of {} levels, the last solved directly: cells {:?}",
            levels.len(),
            sizes
        );
        let last = levels.last().map(|l| l.layout);
        let positions: Vec<usize> =
            last.map_or(Vec::new(), |l| l.rows(&l.whole()).flatten().collect());
        let n = positions.len();
        let (middle, half) = (0.5 * (2.0 + MIN_EIGENVALUE), 0.5 * (2.0 - MIN_EIGENVALUE));
        let root = |k: f64| single(1.0 / (middle + half * (std::f64::consts::PI * k / 4.0).cos()));
        Ok(Self {
            levels,
            part,
            halo,
            gather,
            factor: vec![0.0; n * (n + 1) / 2],
            positions,
            solution: vec![0.0; n],
            weights: [root(1.0), root(3.0)],
        })
    }

    /// Sets the coefficients of the finest level, multiplied by `scale`, and derives those of the others.
    pub(super) fn set(&mut self, fine: &Matrix<f64>, ground: &[Ground], scale: f64) {
        if let Some(level) = self.levels.first_mut() {
            for (mine, theirs) in level.matrix.t.iter_mut().zip(&fine.t) {
                for (mine, theirs) in mine.iter_mut().zip(theirs) {
                    *mine = single(theirs * scale);
                }
            }
            level.ground.clear();
            let scaled = ground.iter().map(|one| Ground {
                conductance: one.conductance * scale,
                ..*one
            });
            level.ground.extend(scaled);
            level.diagonal();
        }
        for k in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            if let (Some(fine), Some(coarse)) = (fine.last(), coarse.first_mut()) {
                coarse.coarsen(fine);
                coarse.diagonal();
            }
        }
        self.factorise();
    }

    fn factorise(&mut self) {
        let Some(level) = self.levels.last() else {
            return;
        };
        let stride = level.layout.stride;
        let row = |i: usize| i * (i + 1) / 2;
        for (i, &at) in self.positions.iter().enumerate() {
            for (j, &other) in self.positions[..=i].iter().enumerate() {
                self.factor[row(i) + j] = if i == j {
                    // Computed from the same conductances in double precision, so that those of open water do not
                    // hide the flow through soil in rounding.
                    let faces = (0..3).flat_map(|a| [(a, at), (a, at + stride[a])]);
                    let sum: f64 = faces
                        .map(|(a, face)| f64::from(level.matrix.t[a][face]))
                        .sum();
                    let sum = sum + f64::from(level.matrix.leak[at]);
                    if sum > 0.0 { sum } else { 1.0 }
                } else {
                    let face = (0..3).find(|&a| other + stride[a] == at);
                    face.map_or(0.0, |a| -f64::from(level.matrix.t[a][at]))
                };
            }
        }
        let l = &mut self.factor;
        for i in 0..self.positions.len() {
            for j in 0..=i {
                let mut sum = l[row(i) + j];
                for k in 0..j {
                    sum -= l[row(i) + k] * l[row(j) + k];
                }
                l[row(i) + j] = if i == j {
                    // Positive except for rounding of a nearly singular matrix.
                    sum.max(1e-12 * l[row(i) + i]).sqrt()
                } else {
                    sum / l[row(j) + j]
                };
            }
        }
    }

    /// Solves the last level.
    fn eliminate(&mut self) {
        let Some(level) = self.levels.last_mut() else {
            return;
        };
        let (l, x) = (&self.factor, &mut self.solution);
        let row = |i: usize| i * (i + 1) / 2;
        for (i, &at) in self.positions.iter().enumerate() {
            let mut sum = f64::from(level.b[at]);
            for k in 0..i {
                sum -= l[row(i) + k] * x[k];
            }
            x[i] = sum / l[row(i) + i];
        }
        for i in (0..x.len()).rev() {
            let mut sum = x[i];
            for k in i + 1..x.len() {
                sum -= l[row(k) + i] * x[k];
            }
            x[i] = sum / l[row(i) + i];
        }
        for (&at, &x) in self.positions.iter().zip(x.iter()) {
            level.x[at] = single(x);
        }
    }

    /// Returns the right side of the finest level, to be set within the part.
    pub(super) fn right_side(&mut self) -> &mut [f32] {
        &mut self.levels[0].b
    }

    /// Returns the result of [`Self::cycle`] within the part.
    pub(super) fn solution(&self) -> &[f32] {
        &self.levels[0].x
    }

    /// Performs one V-cycle from zero. Collective.
    pub(super) fn cycle(&mut self) {
        let last = self.levels.len() - 1;
        if last == 0
            && let Some(gather) = &mut self.gather
        {
            gather.fill(&mut self.levels[0].b);
        }
        for k in 0..last {
            let part = self.part_of(k);
            let halo = (k == 0).then_some(&mut self.halo);
            self.levels[k].descend(&part, halo, self.weights);
            let (fine, coarse) = self.levels.split_at_mut(k + 1);
            fine[k].restrict(&part, &mut coarse[0]);
            if k == 0
                && let Some(gather) = &mut self.gather
            {
                gather.fill(&mut coarse[0].b);
            }
        }
        self.eliminate();
        for k in (0..last).rev() {
            let part = self.part_of(k);
            let halo = (k == 0).then_some(&mut self.halo);
            let (fine, coarse) = self.levels.split_at_mut(k + 1);
            fine[k].correct(&part, &coarse[0]);
            fine[k].ascend(&part, halo, self.weights);
        }
    }

    fn part_of(&self, level: usize) -> Part {
        if level == 0 {
            self.part.clone()
        } else {
            self.levels[level].layout.whole()
        }
    }
}

impl Level {
    fn diagonal(&mut self) {
        let layout = self.layout;
        let Matrix { t, diagonal, leak } = &mut self.matrix;
        let [sx, sy, sz] = layout.stride;
        for row in layout.rows(&layout.whole()) {
            for i in row {
                diagonal[i] = ((t[0][i] + t[0][i + sx]) + (t[1][i] + t[1][i + sy]))
                    + (t[2][i] + t[2][i + sz]);
            }
        }
        leak.fill(0.0);
        for one in &self.ground {
            diagonal[one.at] += single(one.conductance);
            leak[one.at] += single(one.conductance);
        }
        for row in layout.rows(&layout.whole()) {
            for i in row {
                if diagonal[i] <= 0.0 {
                    diagonal[i] = 1.0;
                }
                self.inverse[i] = 1.0 / diagonal[i];
            }
        }
    }

    /// Returns the position of the inner face normal to `axis` of the coarse cell that contains a fine cell.
    fn inner(&self, axis: usize, at: usize, index: usize) -> Option<usize> {
        let place = self.merging.inner(axis, index)?;
        Some(at + place * self.layout.stride[axis])
    }

    /// Returns a conductance in series with half of the inner face of the coarse cell of a fine cell.
    fn in_series(&self, conductance: f64, axis: usize, at: usize, index: usize) -> f64 {
        match self.inner(axis, at, index) {
            Some(face) => {
                let t = 2.0 * f64::from(self.matrix.t[axis][face]);
                if t > 0.0 {
                    conductance * t / (conductance + t)
                } else {
                    conductance
                }
            }
            None => conductance,
        }
    }

    fn coarsen(&mut self, fine: &Self) {
        for t in &mut self.matrix.t {
            t.fill(0.0);
        }
        let (to, from) = (self.layout, fine.layout);
        for z in 0..from.cells[2] {
            for y in 0..from.cells[1] {
                for x in 0..from.cells[0] {
                    let fine_cell = [x, y, z];
                    let at = from.position(fine_cell);
                    let coarse = to.position(fine.merging.coarse(fine_cell));
                    for axis in 0..3 {
                        // Inner faces of coarse cells are not faces of the coarse grid.
                        let t = fine.matrix.t[axis][at];
                        if !fine.merging.is_between(axis, fine_cell[axis]) || t <= 0.0 {
                            continue;
                        }
                        let upper = fine.in_series(f64::from(t), axis, at, fine_cell[axis]);
                        let below = at - from.stride[axis];
                        let lane =
                            fine.in_series(upper, axis, below, fine_cell[axis].wrapping_sub(1));
                        self.matrix.t[axis][coarse] += single(lane);
                    }
                }
            }
        }
        self.ground.clear();
        for &Ground {
            at,
            axis,
            conductance,
        } in &fine.ground
        {
            let cell = from.cell(at);
            let lane = if axis == STORED {
                conductance
            } else {
                fine.in_series(conductance, axis, at, cell[axis])
            };
            self.ground.push(Ground {
                at: to.position(fine.merging.coarse(cell)),
                axis,
                conductance: lane,
            });
        }
    }

    fn jacobi(&mut self, part: &Part, weight: f32) {
        let (layout, matrix, x, b) = (&self.layout, &self.matrix, &self.x, &self.b);
        let inverse = &self.inverse;
        layout.sweep(part, &mut self.y, |start, out| {
            let n = out.len();
            let (x_row, b) = (&x[start..start + n], &b[start..start + n]);
            let (inverse, leak) = (&inverse[start..start + n], &matrix.leak[start..start + n]);
            inflow(matrix, layout, x, start, n, |i, sum| {
                out[i] = x_row[i] + weight * (inverse[i] * ((b[i] - leak[i] * x_row[i]) + sum));
            });
        });
        std::mem::swap(&mut self.x, &mut self.y);
    }

    /// Smooths from zero, and stores the residual in `y`.
    fn descend(&mut self, part: &Part, mut halo: Option<&mut Halo>, weights: [f32; 2]) {
        let (inverse, b) = (&self.inverse, &self.b);
        self.layout.sweep(part, &mut self.x, |start, out| {
            let n = out.len();
            for ((x, inverse), b) in out
                .iter_mut()
                .zip(&inverse[start..start + n])
                .zip(&b[start..])
            {
                *x = weights[0] * (inverse * b);
            }
        });
        if let Some(halo) = &mut halo {
            halo.fill(&mut self.x);
        }
        self.jacobi(part, weights[1]);
        if let Some(halo) = &mut halo {
            halo.fill(&mut self.x);
        }
        let (layout, matrix, x, b) = (&self.layout, &self.matrix, &self.x, &self.b);
        layout.sweep(part, &mut self.y, |start, out| {
            let n = out.len();
            let (x_row, b) = (&x[start..start + n], &b[start..start + n]);
            let leak = &matrix.leak[start..start + n];
            inflow(matrix, layout, x, start, n, |i, sum| {
                out[i] = (b[i] - leak[i] * x_row[i]) + sum;
            });
        });
    }

    /// Sums the residual over the cells of each coarse cell: along x, then y, then z.
    fn restrict(&self, part: &Part, coarse: &mut Self) {
        let (fine, joined) = (self.layout, self.merging.joined);
        let coarse_part = Part {
            axis: part.axis,
            planes: self.merging.planes(part.axis, &part.planes),
        };
        let to = coarse.layout;
        let r = &self.y;
        if let Some(axes) = &self.merging.graded {
            to.sweep(&coarse_part, &mut coarse.b, |start, out| {
                sum_merged(&fine, axes, r, to.cell(start), out);
            });
            return;
        }
        to.sweep(&coarse_part, &mut coarse.b, |start, out| {
            let first = to.cell(start);
            out.fill(0.0);
            for dz in 0..joined[2] {
                for dy in 0..joined[1] {
                    let cell = [
                        first[0] * joined[0],
                        first[1] * joined[1] + dy,
                        first[2] * joined[2] + dz,
                    ];
                    if cell[1] >= fine.cells[1] || cell[2] >= fine.cells[2] {
                        continue;
                    }
                    let at = fine.position(cell);
                    let row = &r[at..at + fine.cells[0] - cell[0]];
                    if joined[0] == 1 {
                        for (out, r) in out.iter_mut().zip(row) {
                            *out += r;
                        }
                    } else {
                        let (pairs, rest) = row.as_chunks::<2>();
                        let whole = pairs.len();
                        for (out, [a, b]) in out.iter_mut().zip(pairs) {
                            *out += a + b;
                        }
                        if let (Some(out), Some(r)) = (out.get_mut(whole), rest.first()) {
                            *out += r;
                        }
                    }
                }
            }
        });
    }

    /// Adds the correction of the coarse level.
    fn correct(&mut self, part: &Part, coarse: &Self) {
        let (fine, joined) = (self.layout, self.merging.joined);
        let correction = &coarse.x;
        if let Some(axes) = &self.merging.graded {
            fine.sweep(part, &mut self.x, |start, out| {
                let [x, y, z] = fine.cell(start);
                let at = coarse.layout.position([0, axes[1].of[y], axes[2].of[z]]);
                for (value, merged) in out.iter_mut().zip(&axes[0].of[x..]) {
                    *value += correction[at + merged];
                }
            });
            return;
        }
        fine.sweep(part, &mut self.x, |start, out| {
            let first = fine.cell(start);
            let at = coarse
                .layout
                .position(std::array::from_fn(|a| first[a] / joined[a]));
            if joined[0] == 1 {
                for (x, c) in out.iter_mut().zip(&correction[at..]) {
                    *x += c;
                }
            } else {
                for (pair, c) in out.chunks_mut(2).zip(&correction[at..]) {
                    for x in pair {
                        *x += c;
                    }
                }
            }
        });
    }

    fn ascend(&mut self, part: &Part, mut halo: Option<&mut Halo>, weights: [f32; 2]) {
        for weight in [weights[1], weights[0]] {
            if let Some(halo) = &mut halo {
                halo.fill(&mut self.x);
            }
            self.jacobi(part, weight);
        }
    }
}

/// Sums values over the cells of each merged cell of a row: along x, then y, then z.
fn sum_merged(
    fine: &Layout,
    axes: &[AxisMerging; 3],
    values: &[f32],
    first: [usize; 3],
    out: &mut [f32],
) {
    out.fill(0.0);
    let cells = |a: usize| axes[a].starts[first[a]]..axes[a].starts[first[a] + 1];
    for z in cells(2) {
        for y in cells(1) {
            let row = fine.position([0, y, z]);
            for (sum, ends) in out.iter_mut().zip(axes[0].starts[first[0]..].windows(2)) {
                for value in &values[row + ends[0]..row + ends[1]] {
                    *sum += value;
                }
            }
        }
    }
}
