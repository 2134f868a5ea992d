//! Momentum that solids receive at their feet: at links through faces of the domain next to a solid.

/// Axes of a link along which it leads into a solid; it leaves the domain along its other axes.
pub type FootAxes = [bool; 3];

/// Link through a face at the foot of a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StructureFoot {
    /// Axes along which the link leads into the structure.
    pub axes: FootAxes,
    /// `true` if the face is a moving wall.
    pub wall_moves: bool,
}

impl StructureFoot {
    /// Returns the momentum along the link that a structure receives, in quanta, from those of the populations that
    /// left along the link and returned. A moving wall keeps the momentum that it has added: a structure at rest
    /// would have returned the population that left.
    #[must_use]
    pub fn given(&self, [left, returned]: [i64; 2]) -> i64 {
        if self.wall_moves {
            bounded_sum(left, left)
        } else {
            bounded_sum(left, returned)
        }
    }
}

/// Returns the sum of two values in quanta, bounded as each of them: those of a run that diverges fill the range until
/// its guards stop it.
#[must_use]
pub fn bounded_sum(a: i64, b: i64) -> i64 {
    a.saturating_add(b).max(-i64::MAX)
}

/// Momentum that a body received in a step at a link through a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FootLoad {
    /// Position of the cell, and direction of the link.
    pub link: (u32, u8),
    /// Axes along which the link leads into the body.
    pub axes: FootAxes,
    /// Momentum along the link, in quanta: the force along an axis is that times the component of the direction.
    pub given: i64,
}

#[cfg(test)]
mod tests {
    use super::bounded_sum;
    use crate::quanta::quanta;

    /// Checks that the momentum along a link of a run that has diverged can be added and turned round.
    #[test]
    fn momenta_of_a_run_that_diverges_stay_in_range() {
        let [most, least] = [1e300, -1e300].map(quanta);
        for (a, b) in [(most, most), (least, least), (most, least)] {
            let sum = bounded_sum(a, b);
            assert_eq!(sum.checked_neg(), Some(-sum));
        }
        assert_eq!(bounded_sum(3, -5), -2);
    }
}
