//! Cells of different widths at the points where the flow is singular, and how fast they widen away from these points.
//!
//! The errors of a flow round the edges of heads and walls have two parts. That of the cells at an edge decreases with
//! the number of them across the shortest length. That of the cells farther away follows the part of their distance
//! from the edge by which they widen: where widths form a geometric series, the logarithm of its ratio. The second
//! part changes with the square of the widening, and halving every cell halves the widening.

use super::{Reader, number};
use darcy::GridAxis;

/// Largest ratio of the widths of neighbouring cells for which errors were measured.
const MOST_RATIO: f64 = 1.8;
/// Distance over the width of the narrowest cells within which a position lies on a face.
const ON_FACE: f64 = 1e-5;

/// Cells of a grid with regard to the singular points of the flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resolution {
    /// Largest edge of a cell at a singular point, in isotropic ground \[m\]; of all cells if they are equal.
    pub(super) edge: f64,
    /// Largest increase of the width of a cell over its distance from the nearest singular point \[1\].
    pub(super) widening: f64,
}

/// Returns the width of the widest cell that touches a position \[m\].
fn width_at(axis: &GridAxis<'_>, position: f64) -> f64 {
    let slack = ON_FACE * axis.spacing;
    let cells = [position - slack, position + slack].map(|at| axis.cell_at(at));
    let widths = cells.into_iter().flatten().map(|cell| axis.width(cell));
    widths.fold(0.0, f64::max)
}

/// Returns the largest increase of the width of a cell over its distance from the nearest position \[1\].
fn widening(axis: &GridAxis<'_>, positions: &[f64]) -> f64 {
    let of_cell = |cell: usize| {
        let centre = axis.centre(cell);
        let away = |at: &f64| (centre - at).abs();
        let nearest = positions
            .iter()
            .min_by(|a, b| away(a).total_cmp(&away(b)))?;
        Some((axis.width(cell) - width_at(axis, *nearest)) / away(nearest))
    };
    (0..axis.cells).filter_map(of_cell).fold(0.0, f64::max)
}

impl Reader<'_> {
    /// Returns the cells at the singular points; or the reason why no measured error applies to them.
    pub(super) fn resolution(&self, edges: &[(usize, f64)]) -> Result<Resolution, String> {
        let axes = || (0..2).filter(|a| self.idle != Some(*a));
        if !self.seepage.is_graded() {
            let edge = axes()
                .map(|a| self.seepage.spacing[a] * self.factors[a][1])
                .fold(0.0, f64::max);
            return Ok(Resolution {
                edge,
                widening: 0.0,
            });
        }
        let mut found = Resolution {
            edge: 0.0,
            widening: 0.0,
        };
        for a in axes() {
            let axis = self.seepage.axis(a);
            let (ratio, _) = axis.largest_ratio();
            if ratio > MOST_RATIO * (1.0 + 1e-9) {
                return Err(format!(
                    "neighbouring cells differ in width by a factor of {}, and errors were measured up to {MOST_RATIO}",
                    number(ratio)
                ));
            }
            let positions = self.singular(a, edges);
            let edge = if positions.is_empty() {
                self.seepage.widest(a)
            } else {
                let widths = positions.iter().map(|at| width_at(&axis, *at));
                widths.fold(0.0, f64::max)
            };
            found.edge = found.edge.max(edge * self.factors[a][1]);
            found.widening = found.widening.max(widening(&axis, &positions));
        }
        Ok(found)
    }

    /// Returns the coordinates of the singular points along an axis: edges of conditions, the faces on which they lie,
    /// and corners of structures \[m\].
    fn singular(&self, axis: usize, edges: &[(usize, f64)]) -> Vec<f64> {
        let (origin, end) = (self.seepage.origin[axis], self.end[axis]);
        let of_axis = edges.iter().filter(|(a, _)| *a == axis);
        let mut found: Vec<f64> = of_axis.map(|(_, at)| origin + at).collect();
        let boundaries = self.seepage.written.boundaries.iter();
        for boundary in boundaries.filter(|b| b.patch.is_some() && b.face.axis() == axis) {
            found.push(if boundary.face.is_max() { end } else { origin });
        }
        for [low, high] in self.parts.iter().filter_map(|part| part.ends) {
            found.extend([low[axis], high[axis]]);
        }
        found.retain(|at| *at >= origin && *at <= end);
        found
    }

    /// Returns `true` if the edges of all conditions lie on faces of cells of different widths.
    pub(super) fn is_on_faces(&self, edges: &[(usize, f64)]) -> bool {
        edges.iter().all(|(a, at)| {
            let axis = self.seepage.axis(*a);
            let position = axis.origin + at;
            let face = axis.face(axis.nearest_face(position));
            (face - position).abs() <= ON_FACE * axis.spacing
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(faces: &[f64]) -> GridAxis<'_> {
        GridAxis {
            cells: faces.len() - 1,
            origin: faces[0],
            spacing: 0.5,
            faces: Some(faces),
        }
    }

    /// Checks a geometric series from an edge at 0: its n-th cell begins at (r^n - 1)/(r - 1).
    #[test]
    fn a_geometric_series_widens_by_about_the_logarithm_of_its_ratio() {
        for ratio in [1.05_f64, 1.2, 1.5] {
            let mut faces = vec![0.0, 0.5];
            for n in 1..40 {
                faces.push(faces[n] + 0.5 * ratio.powi(i32::try_from(n).unwrap()));
            }
            let axis = axis(&faces);
            let found = widening(&axis, &[0.0]);
            assert!((found / ratio.ln() - 1.0).abs() < 0.12, "{ratio}: {found}");
            // A second edge at the wide end has no wider cells.
            assert!(widening(&axis, &[axis.end()]).abs() < 1e-12);
        }
    }

    #[test]
    fn the_width_at_a_position_is_that_of_the_wider_neighbour() {
        let faces = [0.0, 0.5, 1.0, 2.0, 4.0];
        let axis = axis(&faces);
        for (at, width) in [(0.0, 0.5), (0.7, 0.5), (1.0, 1.0), (2.0, 2.0), (4.0, 2.0)] {
            assert!((width_at(&axis, at) - width).abs() < 1e-12, "{at}");
        }
        // The last cell is 1 m wider than those at 1 m, and its centre 2 m away.
        assert!((widening(&axis, &[1.0]) - 0.5).abs() < 1e-12);
        assert!(widening(&axis, &[]).abs() < 1e-12);
    }
}
