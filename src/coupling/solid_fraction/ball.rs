//! Exact solid fractions of a ball in the cells at its surface, with the same bits as
//! [`sphere_box`](darcy::overlap::sphere_box) at a fraction of its cost.
//!
//! The volume of a ball in a cell is the sum over its eight corners, with alternating signs, of a function of the
//! corner. This function consists of one function of each coordinate (cap) and one of each pair (edge, three
//! arctangents). Cells share corners, and corners share coordinates. Edges are tabulated: 3 N² of them for a ball N
//! cells across, whereas its surface alone needs 24 for each of some 3 N² cells. Corners and fractions are computed a
//! layer at a time. The loops along a row have neither branches nor calls, and rows are padded to whole vectors
//! ([`WIDEST`]), so that the compiler vectorises all of it, in a version for each instruction set ([`Level`]).

use base::ball::{Coordinate, edge_by, filled, meeting, minus_third_of_cube, octant_of};
use base::number::real;
use lbm::lanes::{Level, WIDEST, Work};

/// Coordinates of the corners along one axis, in radii from the centre. Those after the last corner lie at the
/// surface of the ball.
#[derive(Debug, Default)]
struct Coordinates {
    count: usize,
    size: Vec<f64>,
    sign: Vec<f64>,
    cap: Vec<f64>,
    /// Value of [`minus_third_of_cube`] at each size.
    less: Vec<f64>,
    /// Index of the coordinate nearest to the centre.
    nearest: usize,
}

/// Plane of corners: the signed part of the ball between its centre and each corner, in units of the cubed radius.
#[derive(Debug, Default)]
struct Corners {
    /// Index of the plane along the slowest axis; none before the first.
    plane: Option<usize>,
    parts: Vec<f64>,
}

/// Ball and the cells that [`BallTable::fill`] prepares.
#[derive(Clone, Copy, Debug)]
pub struct BallInCells {
    /// Centre, in cells.
    pub centre: [f64; 3],
    /// Radius, in cells.
    pub radius: f64,
    /// Lower corner of the first cell.
    pub lower: [i32; 3],
    /// Number of cells along each axis.
    pub cells: [usize; 3],
    /// Axes from slowest to fastest.
    pub order: [usize; 3],
}

/// Corner values of some cells; the buffers are reused.
///
/// [`Self::fill`] starts a ball, [`Self::layer`] computes a layer of cells, and [`Self::row`] returns the fractions
/// of a row of the layer.
#[derive(Debug)]
pub struct BallTable {
    level: Level,
    coordinates: [Coordinates; 3],
    /// Edge functions along axes a and a + 1, in rows along the fastest axis, or along axis a + 1 if neither is the
    /// fastest.
    edges: [Vec<f64>; 3],
    /// Axes from slowest to fastest.
    order: [usize; 3],
    /// Vector from the first corner to the centre, and the radius, in cells.
    centre: [f64; 3],
    radius: f64,
    corners: [Corners; 2],
    /// Filled fractions of the cells of the layer, row by row.
    fractions: Vec<f64>,
}

impl Default for BallTable {
    fn default() -> Self {
        Self {
            level: Level::best(),
            coordinates: Default::default(),
            edges: Default::default(),
            order: [0, 1, 2],
            centre: [0.0; 3],
            radius: 0.0,
            corners: Default::default(),
            fractions: Vec::new(),
        }
    }
}

impl BallTable {
    /// Prepares a ball.
    pub fn fill(&mut self, ball: &BallInCells) {
        self.level.run(Fill(self, ball));
    }

    /// Computes a layer of cells, counted along the slowest axis. Consecutive layers share their corners.
    pub fn layer(&mut self, layer: usize) {
        self.level.run(Layer(self, layer));
    }

    /// Returns the filled fractions of `count` cells from number `first` on in row `row` of the layer, counted
    /// along the axis between the slowest and the fastest. Undefined are the values of cells with all eight corners
    /// inside the ball, of cells that the ball does not reach, and of up to [`WIDEST`] elements beyond the row.
    #[must_use]
    pub fn row(&self, row: usize, first: usize, count: usize) -> &[f64] {
        let along = self.coordinates[self.order[2]].size.len();
        &self.fractions[row * along + first..][..count]
    }

    #[inline(always)]
    fn fill_at_any_width(&mut self, ball: &BallInCells) {
        let &BallInCells {
            centre,
            radius,
            lower,
            cells,
            order,
        } = ball;
        self.radius = radius;
        self.order = order;
        for a in 0..3 {
            self.centre[a] = centre[a] - f64::from(lower[a]);
            let axis = &mut self.coordinates[a];
            axis.count = cells[a] + 1;
            let padded = axis.count.next_multiple_of(WIDEST);
            axis.size.clear();
            axis.size.resize(padded, 1.0);
            axis.sign.clear();
            axis.sign.resize(padded, 1.0);
            axis.cap.clear();
            axis.cap.resize(padded, 0.0);
            axis.nearest = 0;
            for (k, x) in (lower[a]..).take(axis.count).enumerate() {
                let Coordinate { size, sign, cap } = Coordinate::at_corner(x, centre[a], radius);
                (axis.size[k], axis.sign[k], axis.cap[k]) = (size, sign, cap);
                if size < axis.size[axis.nearest] {
                    axis.nearest = k;
                }
            }
            axis.less.clear();
            axis.less
                .extend(axis.size.iter().map(|&size| minus_third_of_cube(size)));
        }
        for a in 0..3 {
            let (first, second) = (&self.coordinates[a], &self.coordinates[(a + 1) % 3]);
            // The bits of an edge function depend on the order of its arguments.
            if a == order[2] {
                tabulate::<false>(second, first, &mut self.edges[a]);
            } else {
                tabulate::<true>(first, second, &mut self.edges[a]);
            }
        }
        let plane = self.coordinates[order[1]].count * self.coordinates[order[2]].size.len();
        for corners in &mut self.corners {
            corners.plane = None;
            // The last row of cells reads one element beyond its corners.
            corners.parts.resize(plane + 1, 0.0);
        }
        self.fractions.resize(plane + WIDEST, 0.0);
    }

    #[inline(always)]
    fn layer_at_any_width(&mut self, layer: usize) {
        for plane in [layer, layer + 1] {
            if self.corners[plane % 2].plane != Some(plane) {
                let mut corners = std::mem::take(&mut self.corners[plane % 2]);
                match self.order[2] {
                    0 => self.plane::<0>(plane, &mut corners.parts),
                    1 => self.plane::<1>(plane, &mut corners.parts),
                    _ => self.plane::<2>(plane, &mut corners.parts),
                }
                corners.plane = Some(plane);
                self.corners[plane % 2] = corners;
            }
        }
        let [slow, middle, fast] = self.order;
        let along = self.coordinates[fast].size.len();
        let rows = self.coordinates[middle].count - 1;
        let lower = &self.corners[layer % 2].parts[..];
        let upper = &self.corners[(layer + 1) % 2].parts[..];
        let near = |axis: usize, cell: usize| {
            let low = real(cell) - self.centre[axis];
            low.max(-1.0 - low).max(0.0)
        };
        let (out, all) = (near(slow, layer), self.radius * self.radius);
        let radius = self.radius;
        let mut fractions = std::mem::take(&mut self.fractions);
        for (row, fractions) in fractions.chunks_exact_mut(along).take(rows).enumerate() {
            let beside = near(middle, row);
            if out * out + beside * beside >= all {
                continue;
            }
            let edges = [
                &lower[row * along..][..=along],
                &lower[(row + 1) * along..][..=along],
                &upper[row * along..][..=along],
                &upper[(row + 1) * along..][..=along],
            ];
            match self.order {
                [0, 1, 2] => sum_corners::<0, 1, 2>(edges, radius, fractions),
                [0, 2, 1] => sum_corners::<0, 2, 1>(edges, radius, fractions),
                [1, 0, 2] => sum_corners::<1, 0, 2>(edges, radius, fractions),
                [1, 2, 0] => sum_corners::<1, 2, 0>(edges, radius, fractions),
                [2, 0, 1] => sum_corners::<2, 0, 1>(edges, radius, fractions),
                _ => sum_corners::<2, 1, 0>(edges, radius, fractions),
            }
        }
        self.fractions = fractions;
    }

    /// Computes the corners of a plane.
    #[inline(always)]
    fn plane<const FAST: usize>(&self, plane: usize, parts: &mut [f64]) {
        let [slow, middle, _] = self.order;
        let along = self.coordinates[FAST].size.len();
        let mut at = [0; 3];
        at[slow] = plane;
        // Pairs (FAST, next), (next, last) and (last, FAST), each in the order of the arguments of `edge`.
        let (next, last) = ((FAST + 1) % 3, (FAST + 2) % 3);
        let others = self.coordinates[last].size.len();
        let own = &self.coordinates[FAST];
        // Squared distance from the centre to the nearer of the cells on both sides of a corner.
        let near = |axis: usize, corner: usize| {
            let away = (real(corner) - self.centre[axis]).abs();
            (away - 1.0).max(0.0).powi(2)
        };
        let (out, all) = (near(slow, plane), self.radius * self.radius);
        for (j, parts) in parts.chunks_exact_mut(along).enumerate() {
            // The ball reaches no cell next to these corners.
            if out + near(middle, j) >= all * (1.0 + 1e-9) {
                continue;
            }
            at[middle] = j;
            let row = |axis: usize, k: usize| &self.edges[axis][k * along..][..along];
            let (of_next, of_last) = (row(FAST, at[next]), row(last, at[last]));
            let between = self.edges[next][at[next] * others + at[last]];
            let (sizes, signs, caps) = (&own.size[..along], &own.sign[..along], &own.cap[..along]);
            let other = |a: usize| {
                let axis = &self.coordinates[a];
                (axis.size[at[a]], axis.sign[at[a]], axis.cap[at[a]])
            };
            let (p, q) = (other(next), other(last));
            let sign = p.1 * q.1;
            for k in 0..along {
                let (mut size, mut caps_of, mut edges) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                (size[FAST], size[next], size[last]) = (sizes[k], p.0, q.0);
                (caps_of[FAST], caps_of[next], caps_of[last]) = (caps[k], p.2, q.2);
                (edges[FAST], edges[next], edges[last]) = (of_next[k], between, of_last[k]);
                parts[k] = sign * signs[k] * octant_of(size, caps_of, edges);
            }
        }
    }
}

/// Tabulates the edge functions of two axes, in rows along the second of them; `FORWARD` if the first axis is the
/// first argument of [`edge`](crate::ball::edge).
#[inline(always)]
fn tabulate<const FORWARD: bool>(rows: &Coordinates, along: &Coordinates, edges: &mut Vec<f64>) {
    let width = along.size.len();
    edges.resize(rows.count * width, 0.0);
    let meets = |p: f64, k: usize| {
        let q = along.size[k];
        (if FORWARD {
            meeting(p, q)
        } else {
            meeting(q, p)
        }) > 0.0
    };
    // Interval about the centre in which the planes of a row and those along it intersect within the ball; it
    // changes little from row to row.
    let (mut from, mut to) = (along.nearest, along.nearest + 1);
    for (row, edges) in edges.chunks_exact_mut(width).enumerate() {
        let (p, less) = (rows.size[row], rows.less[row]);
        if !meets(p, along.nearest) {
            edges.fill(0.0);
            continue;
        }
        while !meets(p, from) {
            from += 1;
        }
        while from > 0 && meets(p, from - 1) {
            from -= 1;
        }
        while !meets(p, to - 1) {
            to -= 1;
        }
        while to < along.count && meets(p, to) {
            to += 1;
        }
        // Computed in whole vectors. Beyond the interval an edge function is 0.
        let length = (to - from).next_multiple_of(WIDEST);
        let start = from.min(width - length);
        edges[..start].fill(0.0);
        edges[start + length..].fill(0.0);
        let own = start..start + length;
        let (edges, sizes) = (&mut edges[own.clone()], &along.size[own.clone()]);
        for ((edge, &q), &its) in edges.iter_mut().zip(sizes).zip(&along.less[own]) {
            *edge = if FORWARD {
                edge_by([p, q], |_| less, |_| its)
            } else {
                edge_by([q, p], |_| its, |_| less)
            };
        }
    }
}

/// Arguments of [`BallTable::fill`], for a run at the best vector width.
struct Fill<'a>(&'a mut BallTable, &'a BallInCells);

impl Work for Fill<'_> {
    #[inline(always)]
    fn run(self) {
        self.0.fill_at_any_width(self.1);
    }
}

/// Arguments of [`BallTable::layer`], for a run at the best vector width.
struct Layer<'a>(&'a mut BallTable, usize);

impl Work for Layer<'_> {
    #[inline(always)]
    fn run(self) {
        self.0.layer_at_any_width(self.1);
    }
}

/// Sums up the filled fractions of a row of cells from its four edges; the index is 2 times the position along the
/// slowest axis plus that along the middle one.
#[inline(always)]
fn sum_corners<const SLOW: usize, const MIDDLE: usize, const FAST: usize>(
    edges: [&[f64]; 4],
    radius: f64,
    fractions: &mut [f64],
) {
    let count = fractions.len();
    // Corner c lies at the upper end of the axes whose bit is set. Closures over arrays would remain calls in the
    // loop.
    let corner = |c: usize| {
        let edge = edges[2 * (c >> SLOW & 1) + (c >> MIDDLE & 1)];
        &edge[c >> FAST & 1..][..count]
    };
    let (c0, c1, c2, c3) = (corner(0), corner(1), corner(2), corner(3));
    let (c4, c5, c6, c7) = (corner(4), corner(5), corner(6), corner(7));
    for k in 0..count {
        let corners = [c0[k], c1[k], c2[k], c3[k], c4[k], c5[k], c6[k], c7[k]];
        fractions[k] = filled(corners, radius);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darcy::overlap::sphere_box;

    #[test]
    fn the_bits_of_one_cell_after_the_other() {
        let mut table = BallTable::default();
        for (centre, radius, lower, edge) in [
            ([4.3, 5.1, 3.7], 2.9, [0, 1, -1], 9),
            ([-3.2, 0.4, 7.9], 0.3, [-5, -1, 6], 4),
            ([8.0, 8.0, 8.0], 4.0, [3, 4, 2], 12),
            ([0.25, -6.75, 1.5], 7.3, [-8, -15, -7], 18),
            ([9.1, 9.7, 8.6], 8.9, [0, 0, 0], 6),
        ] {
            for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                let cells = [edge, edge + 1, edge + 2];
                let [slow, middle, fast] = order;
                table.fill(&BallInCells {
                    centre,
                    radius,
                    lower,
                    cells,
                    order,
                });
                let mut surface = 0;
                let mut volume = 0.0;
                for i in 0..cells[slow] {
                    table.layer(i);
                    for j in 0..cells[middle] {
                        for (k, &found) in table.row(j, 0, cells[fast]).iter().enumerate() {
                            let mut low = [0.0; 3];
                            low[slow] = f64::from(lower[slow]) + real(i);
                            low[middle] = f64::from(lower[middle]) + real(j);
                            low[fast] = f64::from(lower[fast]) + real(k);
                            let exact = sphere_box(centre, radius, low, low.map(|x| x + 1.0));
                            volume += exact;
                            // Cells with all corners inside, and those that no ball of this size reaches, are not
                            // compared.
                            let (mut near, mut far) = (0.0, 0.0);
                            for a in 0..3 {
                                let (p, q) = (low[a] - centre[a], low[a] + 1.0 - centre[a]);
                                near += f64::powi(p.max(-q).max(0.0), 2);
                                far += f64::powi(q.max(-p), 2);
                            }
                            if near < radius * radius && far > radius * radius {
                                let exact = exact.clamp(0.0, 1.0);
                                assert_eq!(found.to_bits(), exact.to_bits(), "{low:?} {order:?}");
                                surface += 1;
                            }
                        }
                    }
                }
                assert!(surface > 0);
                if edge != 6 {
                    let ball = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius;
                    assert!((volume / ball - 1.0).abs() < 1e-12, "{volume} {ball}");
                }
            }
        }
    }
}
