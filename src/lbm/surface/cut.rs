//! Distance of a plane that cuts a given fraction from a cell.
//!
//! Inverse of the volume that a plane cuts from a cube (R. Scardovelli, S. Zaleski, J. Comput. Phys. 164 (2000)
//! 228), in the closed form of M. Lehmann and S. Gekle (Computation 10 (2022) 21).

/// Returns the distance of a plane from the centre of a cell of edge 1, along its unit normal, such that the
/// fraction `part` of the cell lies behind the plane. For `part` above 1 the distance increases with it.
pub(super) fn distance(part: f64, normal: [f64; 3]) -> f64 {
    let [mut low, mut middle, mut high] = normal.map(f64::abs);
    if low > middle {
        std::mem::swap(&mut low, &mut middle);
    }
    if middle > high {
        std::mem::swap(&mut middle, &mut high);
    }
    if low > middle {
        std::mem::swap(&mut low, &mut middle);
    }
    let sum = low + middle + high;
    let inside = part.clamp(0.0, 1.0);
    let volume = 0.5 - (inside - 0.5).abs();
    let depth = smaller(volume, [low, middle, high].map(|n| n / sum));
    sum * (0.5 - depth).copysign(inside - 0.5) + (part - inside)
}

/// Returns the distance of the plane from the corner of the cube for a volume of at most ½; the components of the
/// normal ascend, and their sum is 1.
fn smaller(volume: f64, [low, middle, high]: [f64; 3]) -> f64 {
    let both = low + middle;
    let area = high * volume;
    if both <= 2.0 * area {
        return area + 0.5 * both;
    }
    // From here on the middle component is positive.
    let least = low * low / (6.0 * middle);
    if least <= area && area < least + 0.5 * (middle - low) {
        return 0.5 * (low + (low * low + 8.0 * middle * (area - least)).sqrt());
    }
    let six = 6.0 * low * middle * area;
    if area < least {
        return six.cbrt();
    }
    let squares = low * low + middle * middle;
    let cubes = low.powi(3) + middle.powi(3);
    let most = if high < both {
        let [a, b, c] = [low, middle, high];
        (c * c * (3.0 * both - c) + a * a * (a - 3.0 * c) + b * b * (b - 3.0 * c)) / (6.0 * a * b)
    } else {
        0.5 * both
    };
    let (a, b, c) = if area < most {
        (six - cubes, squares, both)
    } else {
        let cube = high.powi(3);
        (
            0.5 * (six - cubes - cube),
            0.5 * (squares + high * high),
            0.5,
        )
    };
    let t = (c * c - b).max(0.0).sqrt();
    let ratio = (c.powi(3) - 0.5 * a - 1.5 * b * c) / t.powi(3);
    c - 2.0 * t * (ratio.clamp(-1.0, 1.0).asin() / 3.0).sin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::vector::norm;

    /// Returns the fraction of a cell behind a plane, by the midpoint rule.
    fn part(distance: f64, normal: [f64; 3]) -> f64 {
        let n = 100;
        let at = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
        let mut sum = 0.0;
        for x in 0..n {
            for y in 0..n {
                // The integral is exact along the axis with the largest component.
                let rest = distance - normal[0] * at(x) - normal[1] * at(y);
                sum += (rest / normal[2] + 0.5).clamp(0.0, 1.0);
            }
        }
        sum / (n * n) as f64
    }

    #[test]
    fn a_plane_cuts_the_part_that_it_is_given() {
        for normal in [
            [0.0, 0.0, 1.0],
            [0.0, 0.3, 1.0],
            [0.0, 1.0, 1.0],
            [0.2, 0.3, 1.0],
            [0.6, 0.7, 1.0],
            [0.9, 0.95, 1.0],
            [1.0, 1.0, 1.0],
            [0.01, 0.99, 1.0],
        ] {
            let length = norm(normal);
            let normal = normal.map(|n| n / length);
            for k in 0..=40 {
                let exact = f64::from(k) / 40.0;
                let found = part(distance(exact, normal), normal);
                assert!(
                    (found - exact).abs() < 2e-4,
                    "{normal:?}: {found} for {exact}"
                );
                let turned = [-normal[2], normal[0], -normal[1]];
                let other = distance(exact, turned);
                assert!((other - distance(exact, normal)).abs() < 1e-15);
            }
        }
    }
}
