//! An axis-parallel box, resolved.

use super::findings::{Findings, number};
use super::grid::Grid;
use case::geometry::{Extent, Vector};
use serde::Serialize;

/// Axis-parallel box \[m\]; in 2-D the third component is zero and has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AlignedBox {
    /// Lower corner \[m\].
    pub from: [f64; 3],
    /// Upper corner \[m\].
    pub to: [f64; 3],
    /// Dimension: 2 or 3.
    pub dimension: usize,
}

impl AlignedBox {
    /// Returns `true` if a point is inside; lower faces belong to the box, upper ones do not.
    #[must_use]
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..self.dimension).all(|a| point[a] >= self.from[a] && point[a] < self.to[a])
    }

    /// Returns `true` if a disc or sphere touches the box.
    #[must_use]
    pub fn touches(&self, centre: [f64; 3], radius: f64) -> bool {
        let gap = |a: usize| {
            (self.from[a] - centre[a])
                .max(centre[a] - self.to[a])
                .max(0.0)
        };
        let squared: f64 = (0..self.dimension).map(|a| gap(a).powi(2)).sum();
        squared <= radius * radius
    }

    /// Returns the area (2-D) or volume (3-D).
    #[must_use]
    pub fn measure(&self) -> f64 {
        (0..self.dimension)
            .map(|a| self.to[a] - self.from[a])
            .product()
    }

    /// Returns a vector with the right number of components, or a finding.
    pub(crate) fn vector(
        grid: &Grid,
        vector: &Vector,
        path: &str,
        findings: &mut Findings,
    ) -> [f64; 3] {
        vector.resolve(grid.dimension, path, findings)
    }

    /// Returns a box inside the domain, or a finding.
    pub(crate) fn resolve(
        grid: &Grid,
        extent: &Extent,
        path: &str,
        findings: &mut Findings,
    ) -> Self {
        let from = Self::vector(grid, &extent.from, &format!("{path}.from"), findings);
        let to = Self::vector(grid, &extent.to, &format!("{path}.to"), findings);
        let slack = 1e-6 * grid.spacing;
        for a in 0..grid.dimension {
            let axis = ["x", "y", "z"][a];
            if from[a] >= to[a] {
                findings.error(
                    path,
                    format!(
                        "the box has no extent along {axis}: from {} to {}",
                        number(from[a]),
                        number(to[a])
                    ),
                    "make every component of `to` larger than that of `from`",
                );
            } else if from[a] < -slack || to[a] > grid.size[a] + slack {
                findings.error(
                    path,
                    format!(
                        "the box lies outside the domain, which is 0 … {} m along {axis}",
                        number(grid.size[a])
                    ),
                    "move it into the domain",
                );
            }
        }
        Self {
            from,
            to,
            dimension: grid.dimension,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_discs_are_in_half_open_and_closed_boxes() {
        let block = AlignedBox {
            from: [0.0, 0.0, 0.0],
            to: [1.0, 2.0, 0.0],
            dimension: 2,
        };
        assert!(block.contains([0.0, 0.0, 5.0]));
        assert!(!block.contains([1.0, 0.5, 0.0]));
        assert!(block.touches([1.5, 1.0, 0.0], 0.5));
        assert!(!block.touches([1.5, 2.5, 0.0], 0.7));
        assert!((block.measure() - 2.0).abs() < 1e-15);
    }
}
