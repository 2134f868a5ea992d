//! Porosity by points: a grain is represented by 29 points (17 in 2-D) of equal weight.
//!
//! One point is the centre; 14 (8 in 2-D) lie on each of two shells, in the 6 + 8 directions of the axes and corners.
//! Each shell represents 14/29 of the volume, the centre the innermost 1/29. A point lies at the mean radius of its
//! shell. When a centre crosses a face, the porosity changes by 1/29 of the grain instead of the whole.

use super::PorosityFormula;
use crate::grid::SeepageGrid;
use base::number::real;
use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::LazyLock;

/// Porosity method by points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Divided;

/// Points of a disc and of a sphere.
static POINTS: LazyLock<[Vec<[f64; 3]>; 2]> = LazyLock::new(|| [satellites(2), satellites(3)]);

impl PorosityFormula for Divided {
    fn summary() -> &'static str {
        "A grain is divided into 29 points (17 in 2-D) of equal weight."
    }

    fn description(&self) -> String {
        "points of equal weight".into()
    }

    fn parts(
        &self,
        grid: &SeepageGrid,
        centre: [f64; 3],
        radius: f64,
        parts: &mut Vec<(usize, f64)>,
    ) {
        let points = &POINTS[usize::from(grid.dimension != 2)];
        let share = 1.0 / real(points.len());
        for point in points {
            let at = std::array::from_fn(|a| centre[a] + radius * point[a]);
            if let Some(cell) = grid.holding(at) {
                parts.push((grid.index(cell), share));
            }
        }
    }
}

/// Returns the mean radius of a shell between two radii in a ball (or disc) of radius 1.
fn mean_radius(inner: f64, outer: f64, dimension: i32) -> f64 {
    let n = f64::from(dimension);
    n / (n + 1.0) * (outer.powi(dimension + 1) - inner.powi(dimension + 1))
        / (outer.powi(dimension) - inner.powi(dimension))
}

/// Returns the points of the divided method, for a grain of radius 1.
fn satellites(dimension: usize) -> Vec<[f64; 3]> {
    let mut directions: Vec<[f64; 3]> = Vec::new();
    for axis in 0..dimension {
        for sign in [-1.0, 1.0] {
            let mut unit = [0.0; 3];
            unit[axis] = sign;
            directions.push(unit);
        }
    }
    let c = if dimension == 2 {
        FRAC_1_SQRT_2
    } else {
        1.0 / 3.0_f64.sqrt()
    };
    let signs: &[f64] = if dimension == 2 { &[0.0] } else { &[-c, c] };
    for &z in signs {
        for y in [-c, c] {
            for x in [-c, c] {
                directions.push([x, y, z]);
            }
        }
    }
    let (total, n) = (real(1 + 2 * directions.len()), directions.len());
    let (power, exponent) = if dimension == 2 {
        (2, 0.5)
    } else {
        (3, 1.0 / 3.0)
    };
    let first = (1.0 / total).powf(exponent);
    let second = (real(1 + n) / total).powf(exponent);
    let shells = [
        mean_radius(first, second, power),
        mean_radius(second, 1.0, power),
    ];
    let mut points = vec![[0.0; 3]];
    for shell in shells {
        points.extend(directions.iter().map(|d| d.map(|x| x * shell)));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn satellites_are_balanced_and_lie_inside() {
        for (dimension, count) in [(2, 17), (3, 29)] {
            let points = satellites(dimension);
            assert_eq!(points.len(), count);
            for axis in 0..3 {
                assert!(points.iter().map(|p| p[axis]).sum::<f64>().abs() < 1e-14);
            }
            assert!(
                points
                    .iter()
                    .all(|p| p.iter().map(|x| x * x).sum::<f64>() < 1.0)
            );
        }
        // Published offsets of the inner shell: 0.6275 of the radius.
        let inner = satellites(3)[1][0].abs();
        assert!((inner - 0.6275).abs() < 2e-4, "{inner}");
    }
}
