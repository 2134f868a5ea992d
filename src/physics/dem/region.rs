//! The box of the grains and the planes by which ranks share it.

use super::space::{Components, Space};

/// The box the grains live in, and the planes of the split axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region<S: Space> {
    /// Lower corner \[m\].
    pub lower: S::Vector,
    /// Upper corner \[m\].
    pub upper: S::Vector,
    /// Which axes are periodic.
    pub periodic: [bool; 3],
    /// Thickness of one plane of the split axis \[m\], counted from the lower corner.
    pub spacing: f64,
}

impl<S: Space> Region<S> {
    /// A box without periodic axes, split in planes of `spacing` \[m\].
    #[must_use]
    pub fn closed(lower: S::Vector, upper: S::Vector, spacing: f64) -> Self {
        Self {
            lower,
            upper,
            periodic: [false; 3],
            spacing,
        }
    }

    pub(super) fn length(&self, axis: usize) -> f64 {
        self.upper.get(axis) - self.lower.get(axis)
    }

    /// Length along periodic axes, else 0.
    pub(super) fn periodic_lengths(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.periodic[axis] {
                self.length(axis)
            } else {
                0.0
            }
        })
    }

    /// The lower corner, 0 along axes that are not there.
    pub(super) fn origin(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION {
                self.lower.get(axis)
            } else {
                0.0
            }
        })
    }

    pub(super) fn any_periodic(&self) -> bool {
        self.periodic[..S::DIMENSION].contains(&true)
    }
}

/// The plane that contains a coordinate, clamped to `0..planes`; NaN falls to plane 0. With [`decomposition::Slabs::owner_of_plane`] it alone decides
/// which rank owns a grain.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 0; a cast of a float saturates"
)]
pub(super) fn plane_of(coordinate: f64, origin: f64, spacing: f64, planes: usize) -> usize {
    (((coordinate - origin) / spacing).floor().max(0.0) as usize).min(planes.saturating_sub(1))
}

/// How many box lengths to add to bring a raw `coordinate` into `[lower, lower + length)`: nothing else decides.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a grain beyond 2^31 box lengths is caught as lost"
)]
pub(super) fn wraps(coordinate: f64, lower: f64, length: f64) -> i32 {
    -(((coordinate - lower) / length).floor() as i32)
}

#[expect(
    clippy::cast_precision_loss,
    reason = "plane counts are far below 2^53"
)]
pub(super) fn edge(plane: usize, lower: f64, spacing: f64) -> f64 {
    lower + plane as f64 * spacing
}

#[cfg(test)]
mod tests {
    use super::plane_of;
    use decomposition::{Axis, Slabs};

    #[test]
    fn every_coordinate_has_one_owner() {
        let bounds = vec![0, 2, 2, 7];
        let slabs = Slabs::from_bounds(Axis::X, bounds, false).unwrap();
        for (origin, spacing) in [(0.0, 0.1), (-2.7, 1e-6), (1.3, 1.9)] {
            let mut before = 0;
            for face in -2..=9_i32 {
                let at = origin + spacing * f64::from(face);
                // One unit in the last place below the face of a cell, at it, and above it.
                for coordinate in [at.next_down(), at, at.next_up()] {
                    let plane = plane_of(coordinate, origin, spacing, slabs.planes());
                    let owners = (0..slabs.size()).filter(|&r| slabs.range(r).contains(&plane));
                    assert!(owners.eq(slabs.owner_of_plane(plane)), "{coordinate}");
                    // Planes are in the order of coordinates and within one of the exact plane.
                    assert!(before <= plane, "{coordinate}");
                    before = plane;
                    let near = [face - 1, face].map(|n| usize::try_from(n.clamp(0, 6)).unwrap());
                    assert!(near.contains(&plane), "{coordinate}");
                }
            }
        }
    }

    #[test]
    fn lost_coordinates_have_a_plane() {
        for coordinate in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            assert!(plane_of(coordinate, 0.0, 0.1, 7) < 7, "{coordinate}");
        }
        assert_eq!(plane_of(f64::NAN, 0.0, 0.1, 7), 0);
        assert_eq!(plane_of(1.0, 0.0, 1.0, 0), 0);
    }
}
