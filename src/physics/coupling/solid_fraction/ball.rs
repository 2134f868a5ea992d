//! The exact solid fractions of a ball in the cells at its surface: the bits of [`sphere_box`](crate::darcy::overlap::sphere_box) at a
//! fraction of its cost.
//!
//! The volume of a ball in a cell is the sum over its eight corners, with alternating signs, of a function of the corner. This function
//! consists of one function of each coordinate (cap) and one of each pair (edge, three arctangents). Cells share corners, and corners
//! share coordinates. Edges are tabulated: 3 N² of them for a ball N cells across, whereas its surface alone needs 24 for each of some
//! 3 N² cells. Corners are computed once, a plane of them at a time, and only near the surface. The loops along a row have neither branches
//! nor calls, so that the compiler vectorises them.

use crate::darcy::overlap::{cap, edge, octant_of};
use crate::number::{real, whole};
use std::ops::Range;

/// The coordinates of the corners along one axis, in radii from the centre.
#[derive(Debug, Default)]
struct Coordinates {
    size: Vec<f64>,
    sign: Vec<f64>,
    cap: Vec<f64>,
}

/// A plane of corners: the signed part of the ball between its centre and each corner, in units of the cubed radius.
#[derive(Debug, Default)]
struct Corners {
    /// Which plane along the slowest axis; none before the first.
    plane: Option<usize>,
    parts: Vec<f64>,
}

/// The parts of the corners of some cells; buffers reused.
///
/// [`Self::fill`] starts a ball, [`Self::layer`] a layer of cells, and [`Self::row`] gives the fractions of a row of the layer.
#[derive(Debug, Default)]
pub struct BallTable {
    coordinates: [Coordinates; 3],
    /// Of axes a and a + 1, the fastest of all axes last.
    edges: [Vec<f64>; 3],
    /// Axes from slowest to fastest.
    order: [usize; 3],
    /// From the first corner to the centre, along each axis, and the radius, in cells.
    centre: [f64; 3],
    radius: f64,
    corners: [Corners; 2],
    layer: usize,
}

impl BallTable {
    /// For `cells` cells along each axis from the one with this lower corner on. `order` lists the axes from slowest to fastest.
    pub fn fill(
        &mut self,
        centre: [f64; 3],
        radius: f64,
        lower: [i32; 3],
        cells: [usize; 3],
        order: [usize; 3],
    ) {
        self.radius = radius;
        self.order = order;
        self.centre = std::array::from_fn(|a| centre[a] - f64::from(lower[a]));
        for (a, axis) in self.coordinates.iter_mut().enumerate() {
            axis.size.clear();
            axis.sign.clear();
            axis.cap.clear();
            for x in (lower[a]..).take(cells[a] + 1) {
                let at = ((f64::from(x) - centre[a]) / radius).clamp(-1.0, 1.0);
                axis.size.push(at.abs());
                axis.sign.push(at.signum());
                axis.cap.push(cap(at.abs()));
            }
        }
        for a in 0..3 {
            let (first, second) = (
                &self.coordinates[a].size,
                &self.coordinates[(a + 1) % 3].size,
            );
            let edges = &mut self.edges[a];
            edges.clear();
            if a == order[2] {
                for &q in second {
                    edges.extend(first.iter().map(|&p| edge(p, q)));
                }
            } else {
                for &p in first {
                    edges.extend(second.iter().map(|&q| edge(p, q)));
                }
            }
        }
        let plane = (cells[order[1]] + 1) * (cells[order[2]] + 1);
        for corners in &mut self.corners {
            corners.plane = None;
            corners.parts.resize(plane, 0.0);
        }
    }

    /// Goes to a layer of cells, counted along the slowest axis. Layers in rising order share their corners.
    pub fn layer(&mut self, layer: usize) {
        self.layer = layer;
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
    }

    /// The corners of a plane that cells at the surface have.
    fn plane<const FAST: usize>(&self, plane: usize, parts: &mut [f64]) {
        let [slow, middle, _] = self.order;
        let along = self.coordinates[FAST].size.len();
        let away = |axis: usize, corner: usize| (real(corner) - self.centre[axis]).abs();
        let squared = |x: f64| x * x;
        let out = away(slow, plane);
        for (j, parts) in parts.chunks_exact_mut(along).enumerate() {
            // The cells at a corner reach one cell to each side.
            let beside = away(middle, j);
            let near = squared((out - 1.0).max(0.0)) + squared((beside - 1.0).max(0.0));
            let far = squared(out + 1.0) + squared(beside + 1.0);
            let all = squared(self.radius);
            if near >= all {
                continue;
            }
            let (outer, inner) = ((all - near).sqrt(), (all - far).max(0.0).sqrt());
            let corner = |x: f64| whole(x.max(0.0)).min(along);
            let centre = self.centre[FAST];
            let (first, last) = (corner(centre - outer - 1.0), corner(centre + outer + 3.0));
            let (left, right) = (corner(centre - inner + 3.0), corner(centre + inner - 1.0));
            if left < right {
                self.part_of_row::<FAST>(plane, j, first..left, parts);
                self.part_of_row::<FAST>(plane, j, right..last, parts);
            } else {
                self.part_of_row::<FAST>(plane, j, first..last, parts);
            }
        }
    }

    #[inline(always)]
    fn part_of_row<const FAST: usize>(
        &self,
        plane: usize,
        j: usize,
        range: Range<usize>,
        parts: &mut [f64],
    ) {
        let [slow, middle, _] = self.order;
        let along = self.coordinates[FAST].size.len();
        let mut at = [0; 3];
        at[slow] = plane;
        at[middle] = j;
        // The pairs (FAST, next), (next, last) and (last, FAST), each in the order that `edge` takes.
        let (next, last) = ((FAST + 1) % 3, (FAST + 2) % 3);
        let row = |axis: usize, k: usize| &self.edges[axis][k * along..][range.clone()];
        let (of_next, of_last) = (row(FAST, at[next]), row(last, at[last]));
        let others = self.coordinates[last].size.len();
        let between = self.edges[next][at[next] * others + at[last]];
        let own = &self.coordinates[FAST];
        let (sizes, signs, caps) = (
            &own.size[range.clone()],
            &own.sign[range.clone()],
            &own.cap[range.clone()],
        );
        let [p, q] = [next, last].map(|a| {
            let axis = &self.coordinates[a];
            (axis.size[at[a]], axis.sign[at[a]], axis.cap[at[a]])
        });
        let sign = p.1 * q.1;
        for (k, part) in parts[range].iter_mut().enumerate() {
            let (mut size, mut caps_of, mut edges) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            (size[FAST], size[next], size[last]) = (sizes[k], p.0, q.0);
            (caps_of[FAST], caps_of[next], caps_of[last]) = (caps[k], p.2, q.2);
            (edges[FAST], edges[next], edges[last]) = (of_next[k], between, of_last[k]);
            *part = sign * signs[k] * octant_of(size, caps_of, edges);
        }
    }

    /// The filled parts of cells at the surface in row `row` of the layer, counted along the axis between the slowest and the fastest.
    /// The value of a cell with all eight corners inside the ball has no meaning.
    pub fn row(&self, row: usize, cells: Range<usize>, fractions: &mut Vec<f64>) {
        let along = self.coordinates[self.order[2]].size.len();
        let count = cells.len();
        // Corner c lies at the upper end of the axes whose bit it has.
        let corners: [&[f64]; 8] = std::array::from_fn(|c| {
            let [slow, middle, fast] = self.order.map(|axis| c >> axis & 1);
            let parts = &self.corners[(self.layer + slow) % 2].parts;
            &parts[(row + middle) * along + cells.start + fast..][..count]
        });
        let radius = self.radius;
        fractions.clear();
        fractions.extend((0..count).map(|k| {
            let c = corners.map(|parts| parts[k]);
            let sum = 0.0 - c[0] + c[1] + c[2] - c[3] + c[4] - c[5] - c[6] + c[7];
            (sum * radius * radius * radius).clamp(0.0, 1.0)
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::darcy::overlap::sphere_box;

    #[test]
    fn the_bits_of_one_cell_after_the_other() {
        let mut table = BallTable::default();
        let mut row = Vec::new();
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
                table.fill(centre, radius, lower, cells, order);
                let mut surface = 0;
                let mut volume = 0.0;
                for i in 0..cells[slow] {
                    table.layer(i);
                    for j in 0..cells[middle] {
                        table.row(j, 0..cells[fast], &mut row);
                        for (k, &found) in row.iter().enumerate() {
                            let mut low = [0.0; 3];
                            low[slow] = f64::from(lower[slow]) + real(i);
                            low[middle] = f64::from(lower[middle]) + real(j);
                            low[fast] = f64::from(lower[fast]) + real(k);
                            let exact = sphere_box(centre, radius, low, low.map(|x| x + 1.0));
                            volume += exact;
                            // Cells inside by their corners, and those that no ball of this size reaches, are not asked for.
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
