//! Box of the grains, and the planes by which ranks divide it.

use super::space::{Components, Space};

/// Box that contains the grains, and the planes along the split axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrainDomain<S: Space> {
    /// Lower corner \[m\].
    pub lower: S::Vector,
    /// Upper corner \[m\].
    pub upper: S::Vector,
    /// `true` for periodic axes.
    pub periodic: [bool; 3],
    /// Thickness of one plane of the split axis \[m\], counted from the lower corner.
    pub spacing: f64,
    /// `true` for the lower and the upper face of each axis beyond which solids may go any distance; beyond the other
    /// faces a solid counts as lost when it is more than one length of the box outside.
    pub exits: [[bool; 2]; 3],
}

impl<S: Space> GrainDomain<S> {
    /// Returns a box without periodic axes, divided into planes of `spacing` \[m\].
    #[must_use]
    pub fn closed(lower: S::Vector, upper: S::Vector, spacing: f64) -> Self {
        Self {
            lower,
            upper,
            periodic: [false; 3],
            spacing,
            exits: [[false; 2]; 3],
        }
    }

    /// Returns `true` for the centre of a solid that has passed one of the exits.
    pub(super) fn passed_an_exit(&self, at: &S::Vector) -> bool {
        (0..S::DIMENSION)
            .filter(|axis| !self.periodic[*axis])
            .any(|axis| {
                let [low, high] = self.exits[axis];
                let x = at.get(axis);
                (low && x < self.lower.get(axis)) || (high && x > self.upper.get(axis))
            })
    }

    pub(super) fn length(&self, axis: usize) -> f64 {
        self.upper.get(axis) - self.lower.get(axis)
    }

    /// Returns the length along periodic axes, otherwise 0.
    pub(super) fn periodic_lengths(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.periodic[axis] {
                self.length(axis)
            } else {
                0.0
            }
        })
    }

    /// Returns the lower corner, 0 along axes that do not exist.
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

/// Returns the plane that contains a coordinate, clamped to `0..planes`; NaN gives plane 0. With
/// [`decomposition::Slabs::owner_of_plane`] it alone determines which rank owns a grain.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 0; a cast of a float saturates"
)]
pub(super) fn plane_of(coordinate: f64, origin: f64, spacing: f64, planes: usize) -> usize {
    (((coordinate - origin) / spacing).floor().max(0.0) as usize).min(planes.saturating_sub(1))
}

/// Returns the number of periods that move a raw `coordinate` into `[lower, lower + length)`. No other function
/// computes it.
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
    use super::{plane_of, wraps};
    use decomposition::{Slabs, SplitAxis};
    use proptest::prelude::*;

    fn split() -> impl Strategy<Value = Slabs> {
        let thickness = prop::collection::vec(0_usize..6, 1..6);
        (thickness, 1_usize..4, any::<bool>()).prop_map(|(thickness, last, periodic)| {
            let mut bounds = vec![0];
            for planes in thickness.into_iter().chain([last]) {
                bounds.push(bounds[bounds.len() - 1] + planes);
            }
            Slabs::from_bounds(SplitAxis::X, bounds, periodic).unwrap()
        })
    }

    proptest! {
        /// Checks coordinates one unit in the last place below the face of a cell, at it, and above it.
        #[test]
        fn every_coordinate_has_one_owner(
            slabs in split(),
            origin in -3.0_f64..3.0,
            spacing in 1e-6_f64..2.0,
        ) {
            let planes = i32::try_from(slabs.planes()).unwrap();
            let mut before = 0;
            for face in -2..=planes + 2 {
                let at = origin + spacing * f64::from(face);
                for coordinate in [at.next_down(), at, at.next_up()] {
                    let plane = plane_of(coordinate, origin, spacing, slabs.planes());
                    let owners = (0..slabs.size()).filter(|&r| slabs.range(r).contains(&plane));
                    prop_assert!(owners.eq(slabs.owner_of_plane(plane)), "{}", coordinate);
                    // Planes are in the order of coordinates, and differ from the exact plane by at most one.
                    prop_assert!(before <= plane, "{}", coordinate);
                    before = plane;
                    let inside = |n: i32| usize::try_from(n.clamp(0, planes - 1)).unwrap();
                    prop_assert!([inside(face - 1), inside(face)].contains(&plane), "{}", coordinate);
                }
            }
        }

        /// Checks that coordinates within some periods are wrapped into the box, to one unit in the last place of
        /// the added length.
        #[test]
        fn wrapped_coordinates_are_in_the_box(
            lower in -3.0_f64..3.0,
            length in 1e-6_f64..2.0,
            boxes in -5.0_f64..5.0,
        ) {
            let raw = lower + boxes * length;
            let wrapped = raw + f64::from(wraps(raw, lower, length)) * length;
            let rounding = 4.0 * f64::EPSILON * (lower.abs() + 6.0 * length);
            prop_assert!(wrapped >= lower - rounding && wrapped < lower + length + rounding, "{}", wrapped);
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
