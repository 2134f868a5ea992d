//! The faces of the hole and the shear stress on them.
//!
//! The paper's equation 10 (corrected) gives the shear stress on a face as `tau_h = mu dV_x/dy`. `V_x(y)` is the
//! velocity along the hole, averaged over its length, with zero velocity in solid cells. Two other definitions are
//! computed as well: the balance of the pressure difference and the stress on both faces, `dP d_h / (2 L)`, as in hole
//! erosion tests, and the summed traction on the grains. The three are equal for plane Poiseuille flow between straight
//! faces.
//!
//! Faces: `s` is the solid fraction averaged along the hole, and `s_0` its value in the intact packing. The face is the
//! step from 0 to `s_0` that fits the profile best, in the least-squares sense, from the middle of the hole to the
//! wall. Loose grains in the hole and gaps in the packing do not move it, whereas a search for the first solid cell
//! would stop at them. The position of the step within its cell is where `s` crosses `s_0 / 2`.

use base::number::real;

/// Cell-centred values across the hole: entry `j` lies at `origin + (j + 1/2) spacing`.
#[derive(Clone, Copy, Debug)]
pub struct HoleProfile<'a> {
    /// Edge of the first cell, m.
    pub origin: f64,
    /// Cell width, m.
    pub spacing: f64,
    /// One value per cell.
    pub values: &'a [f64],
}

impl HoleProfile<'_> {
    /// Returns the position of the centre of a cell, m.
    fn centre(&self, cell: usize) -> f64 {
        self.origin + (real(cell) + 0.5) * self.spacing
    }

    /// Returns the position of the far edge of the last cell, m.
    fn end(&self) -> f64 {
        self.origin + real(self.values.len()) * self.spacing
    }
}
/// Mean positions of the two faces of the hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoleFaces {
    /// Lower face, m.
    pub lower: f64,
    /// Upper face, m.
    pub upper: f64,
}

impl HoleFaces {
    /// Returns the distance between the faces, m.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.upper - self.lower
    }
}

/// Shear stresses on the two faces, positive where the fluid pulls the face along +x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallShear {
    /// Stress on the lower face, Pa.
    pub lower: f64,
    /// Stress on the upper face, Pa.
    pub upper: f64,
}

impl WallShear {
    /// Returns the mean of both faces, Pa.
    #[must_use]
    pub fn mean(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }
}

/// Finds the faces of the hole from the solid fraction averaged along it.
///
/// `intact` is the mean solid fraction of the packing before erosion, `middle` the height at which the hole was cut, m.
/// If the packing is eroded down to the wall, the face is at the wall. `None` if the hole is closed, that is, if no
/// cell within half the distance from the middle to either wall has less than half the intact solid fraction, or if
/// there are no cells.
#[must_use]
pub fn hole_faces(solid: HoleProfile<'_>, intact: f64, middle: f64) -> Option<HoleFaces> {
    let cells = solid.values.len();
    if cells == 0 || intact.is_nan() || intact <= 0.0 {
        return None;
    }
    // The open cell nearest to the middle: a hole that moved a little is still found.
    let open = (0..cells)
        .filter(|&cell| solid.values[cell] < 0.5 * intact)
        .min_by(|&a, &b| {
            let distance = |cell: usize| (solid.centre(cell) - middle).abs();
            distance(a).total_cmp(&distance(b))
        })?;
    if (solid.centre(open) - middle).abs() > 0.25 * (solid.end() - solid.origin) {
        return None;
    }
    let inward = |cell: usize| solid.values[cell] / intact;
    let upward = step(
        open,
        (open + 1..cells).collect::<Vec<_>>().as_slice(),
        inward,
    );
    let downward = step(open, (0..open).rev().collect::<Vec<_>>().as_slice(), inward);
    Some(HoleFaces {
        lower: downward.map_or(solid.origin, |depth| {
            solid.centre(open) - depth * solid.spacing
        }),
        upper: upward.map_or_else(
            || solid.end(),
            |depth| solid.centre(open) + depth * solid.spacing,
        ),
    })
}

/// Returns the distance in cells from `open` to the best step from 0 to 1 along `path`; `None` where no packing is
/// left.
///
/// A step before path entry `k` leaves the misfit `sum_{<k} s^2 + sum_{>=k} (s - 1)^2`, which is smallest where the sum
/// of `2 s - 1` over the solid side is largest.
fn step(open: usize, path: &[usize], solid: impl Fn(usize) -> f64) -> Option<f64> {
    let mut best = None;
    let mut most = 0.0;
    let mut sum = 0.0;
    for (k, &cell) in path.iter().enumerate().rev() {
        sum += 2.0 * solid(cell) - 1.0;
        if sum > most {
            most = sum;
            best = Some(k);
        }
    }
    let first = best?;
    let before = solid(if first == 0 { open } else { path[first - 1] });
    let after = solid(path[first]);
    // `before` < 1/2 < `after`; otherwise the step would be elsewhere.
    let crossing = ((0.5 - before) / (after - before)).clamp(0.0, 1.0);
    Some(real(first) + crossing)
}

/// Returns the shear stress from the velocity gradient at the faces (equation 10).
///
/// A parabola is fitted by least squares to the cells whose centres lie in the hole, from the face inwards over a
/// quarter of the width, at least four cells and at most half the width (the face itself is not a data point: no slip
/// is not forced on a rough face), and differentiated at the face. The fit is exact for Poiseuille flow and for any
/// profile that is a parabola near the face, wherever the face lies inside its cell. `viscosity` is dynamic, Pa s.
/// `None` where a half of the hole has fewer than four cells.
#[must_use]
pub fn shear_by_gradient(
    velocity: HoleProfile<'_>,
    faces: HoleFaces,
    viscosity: f64,
) -> Option<WallShear> {
    let middle = 0.5 * (faces.lower + faces.upper);
    let depth = (0.25 * faces.width()).max(4.0 * velocity.spacing);
    // Distance from the face into the fluid and velocity at this distance.
    let near = |face: f64, sign: f64| -> Vec<(f64, f64)> {
        let reach = depth.min((middle - face).abs());
        velocity
            .values
            .iter()
            .enumerate()
            .map(|(cell, &v)| ((velocity.centre(cell) - face) * sign, v))
            // A cell centre on the middle, up to rounding, belongs to both halves.
            .filter(|&(distance, _)| distance > 0.0 && distance <= reach + 1e-9 * velocity.spacing)
            .collect()
    };
    let lower = parabola_slope(&near(faces.lower, 1.0), velocity.spacing)?;
    let upper = parabola_slope(&near(faces.upper, -1.0), velocity.spacing)?;
    Some(WallShear {
        lower: viscosity * lower,
        upper: viscosity * upper,
    })
}

/// Returns the slope at 0 of the least-squares parabola through `(distance, value)`; `None` for fewer than four points.
fn parabola_slope(points: &[(f64, f64)], scale: f64) -> Option<f64> {
    if points.len() < 4 {
        return None;
    }
    // Orthogonal polynomials on the points make the normal equations diagonal.
    let n = real(points.len());
    let x: Vec<f64> = points.iter().map(|&(x, _)| x / scale).collect();
    let mean = x.iter().sum::<f64>() / n;
    let p1: Vec<f64> = x.iter().map(|x| x - mean).collect();
    let s2: f64 = p1.iter().map(|p| p * p).sum();
    let s3: f64 = p1.iter().map(|p| p * p * p).sum();
    let (skew, variance) = (s3 / s2, s2 / n);
    let p2: Vec<f64> = p1.iter().map(|p| p * p - skew * p - variance).collect();
    let project = |p: &[f64]| {
        let norm: f64 = p.iter().map(|p| p * p).sum();
        p.iter().zip(points).map(|(p, &(_, v))| p * v).sum::<f64>() / norm
    };
    let (c1, c2) = (project(&p1), project(&p2));
    let at_face = -mean;
    Some((c1 + c2 * (2.0 * at_face - skew)) / scale)
}

/// Returns the shear stress from the balance of forces on the water in the hole, `dP d_h / (2 L)`, Pa: the pressure
/// difference over the length `length` of the hole against its two faces, as hole erosion tests are read.
#[must_use]
pub fn shear_by_balance(pressure_difference: f64, width: f64, length: f64) -> f64 {
    pressure_difference * width / (2.0 * length)
}

/// Returns the shear stress from the force along the hole on the grains of both faces, N/m: `F_x / (2 L)`, Pa.
#[must_use]
pub fn shear_by_traction(force: f64, length: f64) -> f64 {
    force / (2.0 * length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use base::random::Draws;

    const H: f64 = 2e-5;
    const CELLS: usize = 100;

    /// Returns the solid fraction of a bed with sharp faces, each cell covered in proportion, and Poiseuille flow
    /// between them.
    fn channel(lower: f64, upper: f64, gradient: f64, viscosity: f64) -> (Vec<f64>, Vec<f64>) {
        let covered = |j: usize| {
            let (a, b) = (real(j) * H, real(j + 1) * H);
            let fluid = (b.min(upper) - a.max(lower)).max(0.0);
            0.8 * (1.0 - fluid / H)
        };
        let velocity = |j: usize| {
            let y = (real(j) + 0.5) * H;
            (gradient / (2.0 * viscosity) * (y - lower) * (upper - y)).max(0.0)
        };
        (
            (0..CELLS).map(covered).collect(),
            (0..CELLS).map(velocity).collect(),
        )
    }

    fn profile(values: &[f64]) -> HoleProfile<'_> {
        HoleProfile {
            origin: 0.0,
            spacing: H,
            values,
        }
    }

    #[test]
    fn sharp_faces_are_found_to_a_tenth_of_a_cell() {
        for shift in 0..20 {
            let lower = (30.0 + 0.05 * f64::from(shift)) * H;
            let upper = (71.0 - 0.033 * f64::from(shift)) * H;
            let (solid, _) = channel(lower, upper, 1.0, 1.0);
            let faces = hole_faces(profile(&solid), 0.8, 50.0 * H).unwrap();
            assert!((faces.lower - lower).abs() < 0.1 * H, "{shift}: {faces:?}");
            assert!((faces.upper - upper).abs() < 0.1 * H, "{shift}: {faces:?}");
        }
    }

    #[test]
    fn the_gradient_is_exact_for_poiseuille_flow_wherever_the_faces_lie() {
        let viscosity = 1e-3;
        for shift in 0..20 {
            let faces = HoleFaces {
                lower: (30.0 + 0.05 * f64::from(shift)) * H,
                upper: (71.0 - 0.033 * f64::from(shift)) * H,
            };
            let gradient = 0.3 / 1e-2;
            let (_, velocity) = channel(faces.lower, faces.upper, gradient, viscosity);
            let shear = shear_by_gradient(profile(&velocity), faces, viscosity).unwrap();
            let exact = shear_by_balance(0.3, faces.width(), 1e-2);
            assert_relative_eq!(shear.lower, exact, max_relative = 1e-9);
            assert_relative_eq!(shear.upper, exact, max_relative = 1e-9);
            assert_relative_eq!(shear.mean(), exact, max_relative = 1e-9);
        }
    }

    #[test]
    fn noise_and_found_faces_move_the_stress_by_a_few_per_cent() {
        let viscosity = 1e-3;
        let mut draws = Draws::new(7);
        let (lower, upper) = (29.3 * H, 70.8 * H);
        let exact = shear_by_balance(0.3, upper - lower, 1e-2);
        let mut worst: f64 = 0.0;
        let mut sum = 0.0;
        for _ in 0..200 {
            let (mut solid, mut velocity) = channel(lower, upper, 0.3 / 1e-2, viscosity);
            let top = velocity.iter().copied().fold(0.0, f64::max);
            for (s, v) in solid.iter_mut().zip(&mut velocity) {
                *s += 0.02 * draws.normal();
                *v += 0.005 * top * draws.normal();
            }
            let faces = hole_faces(profile(&solid), 0.8, 50.0 * H).unwrap();
            let shear = shear_by_gradient(profile(&velocity), faces, viscosity)
                .unwrap()
                .mean();
            worst = worst.max((shear / exact - 1.0).abs());
            sum += shear / exact - 1.0;
        }
        assert!(worst < 0.15, "{worst}");
        assert!((sum / 200.0).abs() < 0.01, "{sum}");
    }

    #[test]
    fn carried_grains_and_gaps_in_the_packing_do_not_move_the_faces() {
        let (mut solid, _) = channel(30.0 * H, 70.0 * H, 1.0, 1.0);
        let clean = hole_faces(profile(&solid), 0.8, 50.0 * H).unwrap();
        solid[55..60].fill(0.55); // a cluster passes
        solid[80..84].fill(0.2); // a void in the packing
        solid[0] = 0.1; // discs touch a wall in points
        solid[CELLS - 1] = 0.1;
        let faces = hole_faces(profile(&solid), 0.8, 50.0 * H).unwrap();
        assert_eq!(faces, clean);
    }

    #[test]
    fn an_eroded_packing_ends_at_the_wall_and_a_closed_hole_is_none() {
        let solid = vec![0.05; CELLS];
        let faces = hole_faces(profile(&solid), 0.8, 50.0 * H).unwrap();
        assert!(faces.lower.abs() < 1e-15);
        assert_relative_eq!(faces.upper, real(CELLS) * H);
        assert_eq!(hole_faces(profile(&[0.8; CELLS]), 0.8, 50.0 * H), None);
        assert_eq!(hole_faces(profile(&[]), 0.8, 0.0), None);
        assert_eq!(hole_faces(profile(&solid), 0.0, 50.0 * H), None);
    }

    #[test]
    fn too_few_cells_give_no_stress() {
        let faces = HoleFaces {
            lower: 48.0 * H,
            upper: 53.0 * H,
        };
        let (_, velocity) = channel(faces.lower, faces.upper, 1.0, 1.0);
        assert_eq!(shear_by_gradient(profile(&velocity), faces, 1.0), None);
    }

    #[test]
    fn the_three_ways_agree_on_straight_faces() {
        // The traction on both faces carries the whole pressure difference over the hole's width.
        let (pressure, width, length) = (0.5, 8e-4, 1.2e-2);
        assert_relative_eq!(
            shear_by_balance(pressure, width, length),
            shear_by_traction(pressure * width, length)
        );
    }
}
