//! Analytic centre of an overlap: the point that maximises the product of its distances from all planes,
//!
//! ```text
//! minimise  f(x) = -sum ln t_i,   t_i = d_i - a_i . x
//! ```
//!
//! Newton's method with the damping for self-concordant functions solves it: steps are scaled by `1/(1 + decrement)`
//! far from the centre and full near it. The iterates stay inside without a line search. Overlaps may be flat by a
//! factor of 1e6 and more; the Hessian `sum a a^T / t²` then exceeds double precision. The step is therefore the
//! least-squares solution of `(a_i / t_i) . y = -1`, by Householder reflections with rows sorted by size and column
//! pivoting: row-wise stable, and as accurate for a thin overlap as for a round one (A. J. Cox, N. J. Higham, 1998).
//!
//! Sources: the analytic centre as contact point, C. W. Boon, G. T. Houlsby, S. Utili, Computers and Geotechnics 44
//! (2012) 73; the damping, S. Boyd, L. Vandenberghe, Convex Optimization (2004), section 9.6.

use nalgebra::Vector3;

use super::HalfSpace;

/// Maximum number of Newton steps; ten from the deepest point and two or three from the previous centre are usual.
const STEPS: usize = 60;

/// Returns the centre, from a start point strictly inside, and `true` if it was reached. The returned point is
/// always inside.
pub(super) fn find(
    planes: &[HalfSpace],
    start: &Vector3<f64>,
    rows: &mut Vec<[f64; 4]>,
) -> (Vector3<f64>, bool) {
    let mut x = *start;
    let scale = planes.iter().map(|p| p.offset.abs()).fold(0.0, f64::max);
    for _ in 0..STEPS {
        rows.clear();
        let mut least = f64::INFINITY;
        for plane in planes {
            let slack = -plane.height(&x);
            if slack <= 0.0 {
                return (*start, false);
            }
            least = least.min(slack);
            let row = plane.normal / slack;
            rows.push([row.x, row.y, row.z, -1.0]);
        }
        // With unit normals, the magnitude of a row is 1/slack.
        rows.sort_unstable_by(|a, b| squared(b).total_cmp(&squared(a)));
        let Some((step, decrement)) = least_squares(rows) else {
            return (x, false);
        };
        let damping = if decrement > 0.25 {
            // Take the step allowed by theory, and further while the slope still decreases.
            reach(planes, &x, &step, 1.0 / (1.0 + decrement))
        } else {
            1.0
        };
        let next = x + step * damping;
        if planes.iter().any(|plane| plane.height(&next) >= 0.0) {
            return (x, false);
        }
        x = next;
        // Distances from planes are accurate to the rounding of the size of the blocks, which also limits the
        // centre of an overlap that is hardly thicker.
        if decrement < 1e-7_f64.max(32.0 * f64::EPSILON * scale / least) {
            return (x, true);
        }
    }
    (x, false)
}

fn squared(row: &[f64; 4]) -> f64 {
    row[0] * row[0] + row[1] * row[1] + row[2] * row[2]
}

/// Returns a step length near the minimum along `step`, by Newton's method in one dimension from a safe length.
fn reach(planes: &[HalfSpace], x: &Vector3<f64>, step: &Vector3<f64>, safe: f64) -> f64 {
    let mut length = safe;
    for _ in 0..3 {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for plane in planes {
            let rate = plane.normal.dot(step);
            let part = rate / (-plane.height(x) - length * rate);
            slope += part;
            curvature += part * part;
        }
        // The same damping in one dimension.
        let newton = slope.abs() / curvature.sqrt();
        length -= slope / curvature / (1.0 + newton);
    }
    if length.is_finite() && length > safe {
        length
    } else {
        safe
    }
}

/// Solves the least-squares problem `row . y = right side` for rows in descending order of magnitude; returns the
/// solution, and the length of the projection of the right side: the Newton decrement.
fn least_squares(rows: &mut [[f64; 4]]) -> Option<(Vector3<f64>, f64)> {
    let mut order = [0, 1, 2];
    for step in 0..3 {
        // Pivot: the longest remaining column.
        let length = |column: usize, rows: &[[f64; 4]]| {
            rows[step..]
                .iter()
                .map(|row| row[column] * row[column])
                .sum::<f64>()
        };
        let mut best = (step, length(order[step], rows));
        for other in step + 1..3 {
            let size = length(order[other], rows);
            if size > best.1 {
                best = (other, size);
            }
        }
        order.swap(step, best.0);
        let column = order[step];
        let norm = best.1.sqrt();
        // The largest element of the column is moved to the top, for row-wise stability.
        let top = (step..rows.len())
            .max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(step, top);
        let diagonal = -norm.copysign(rows[step][column]);
        let scale = diagonal * (diagonal - rows[step][column]);
        if scale <= 0.0 || !scale.is_finite() {
            return None;
        }
        let head = rows[step][column] - diagonal;
        for &target in order[step + 1..].iter().chain(&[3]) {
            let mut product = head * rows[step][target];
            for row in &rows[step + 1..] {
                product += row[column] * row[target];
            }
            let factor = product / scale;
            rows[step][target] -= factor * head;
            for row in &mut rows[step + 1..] {
                row[target] -= factor * row[column];
            }
        }
        rows[step][column] = diagonal;
    }
    let decrement =
        (rows[0][3] * rows[0][3] + rows[1][3] * rows[1][3] + rows[2][3] * rows[2][3]).sqrt();
    let [p, q, r] = order;
    let mut y = Vector3::zeros();
    y[r] = rows[2][3] / rows[2][r];
    y[q] = (rows[1][3] - rows[1][r] * y[r]) / rows[1][q];
    y[p] = (rows[0][3] - rows[0][q] * y[q] - rows[0][r] * y[r]) / rows[0][p];
    y.iter().all(|c| c.is_finite()).then_some((y, decrement))
}
