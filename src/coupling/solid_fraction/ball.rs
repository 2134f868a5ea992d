//! The exact solid fractions of a ball in all cells of a box at once: the bits of [`sphere_box`](crate::darcy::overlap::sphere_box) at a fraction of
//! its cost.
//!
//! The volume of a ball in a cell is the sum over its eight corners, with alternating signs, of a function of the corner. This function
//! consists of one function of each coordinate (cap) and one of each pair (edge, three arctangents). Cells share corners, and corners
//! share coordinates, so that both are tabulated: 3 N² edges for a ball N cells across, whereas its surface alone needs 24 for each of
//! some 3 N² cells.

use crate::darcy::overlap::{cap, edge, octant_of};

/// One coordinate of the corners, in radii from the centre.
#[derive(Clone, Copy, Debug)]
struct Coordinate {
    size: f64,
    sign: f64,
    cap: f64,
}

/// The parts of the corners of some cells; buffers reused.
#[derive(Debug, Default)]
pub struct BallTable {
    coordinates: [Vec<Coordinate>; 3],
    /// Of coordinates a and a + 1, the former slower.
    edges: [Vec<f64>; 3],
    radius: f64,
}

impl BallTable {
    /// For `cells` cells along each axis from the one with this lower corner on.
    pub fn fill(&mut self, centre: [f64; 3], radius: f64, lower: [i32; 3], cells: [usize; 3]) {
        self.radius = radius;
        for a in 0..3 {
            let corners = (lower[a]..).take(cells[a] + 1);
            self.coordinates[a].clear();
            self.coordinates[a].extend(corners.map(|x| {
                let at = ((f64::from(x) - centre[a]) / radius).clamp(-1.0, 1.0);
                Coordinate {
                    size: at.abs(),
                    sign: at.signum(),
                    cap: cap(at.abs()),
                }
            }));
        }
        for a in 0..3 {
            let (first, second) = (&self.coordinates[a], &self.coordinates[(a + 1) % 3]);
            self.edges[a].clear();
            for p in first {
                let row = second.iter().map(|q| edge(p.size, q.size));
                self.edges[a].extend(row);
            }
        }
    }

    /// The filled part of a cell, counted from the first.
    #[must_use]
    pub fn fraction(&self, cell: [usize; 3]) -> f64 {
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let at: [usize; 3] = std::array::from_fn(|a| cell[a] + (corner >> a & 1));
            let c: [Coordinate; 3] = std::array::from_fn(|a| self.coordinates[a][at[a]]);
            let mut sign = 1.0;
            for a in 0..3 {
                if corner >> a & 1 == 0 {
                    sign = -sign;
                }
                sign *= c[a].sign;
            }
            let edges = [0, 1, 2].map(|a| {
                let b = (a + 1) % 3;
                self.edges[a][at[a] * self.coordinates[b].len() + at[b]]
            });
            sum += sign * octant_of(c.map(|c| c.size), c.map(|c| c.cap), edges);
        }
        let radius = self.radius;
        (sum * radius * radius * radius).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::darcy::overlap::sphere_box;

    #[test]
    fn the_bits_of_one_cell_after_the_other() {
        let mut table = BallTable::default();
        for (centre, radius, lower, edge) in [
            ([4.3, 5.1, 3.7], 2.9, [0, 1, -1], 9),
            ([-3.2, 0.4, 7.9], 0.3, [-5, -1, 6], 4),
            ([8.0, 8.0, 8.0], 4.0, [3, 4, 2], 12),
            ([0.25, -6.75, 1.5], 7.3, [-8, -15, -7], 18),
        ] {
            let cells = [edge; 3];
            table.fill(centre, radius, lower, cells);
            let mut volume = 0.0;
            for x in 0..cells[0] {
                for y in 0..cells[1] {
                    for z in 0..cells[2] {
                        let cell = [x, y, z];
                        let low: [f64; 3] =
                            std::array::from_fn(|a| f64::from(lower[a]) + cell[a] as f64);
                        let exact = sphere_box(centre, radius, low, low.map(|x| x + 1.0));
                        let found = table.fraction(cell);
                        assert_eq!(found.to_bits(), exact.clamp(0.0, 1.0).to_bits(), "{cell:?}");
                        volume += found;
                    }
                }
            }
            let ball = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius;
            assert!((volume / ball - 1.0).abs() < 1e-12, "{volume} {ball}");
        }
    }
}
