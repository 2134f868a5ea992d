//! A rock mass cut into blocks by joint sets.
//!
//! The mass is a convex solid. The planes of the sets are applied one after another; each cuts a block that it
//! crosses with the probability `persistence` of the set. This is the definition of persistence in 3DEC (Itasca,
//! `block cut joint-set`): a block must stay convex, and a joint cannot end inside one. A cut that would leave a
//! part thinner or smaller than the given limits is not made, so that the blocks always fill the mass. Finally the
//! faces on joints are moved apart by the aperture, so that water can enter.
//!
//! Random numbers are functions of the seed and of the previous cuts of a block; they do not depend on the order in
//! which blocks are processed.

pub mod joints;
pub mod list;

use base::random::Stream;
use dem::polyhedron::{HalfSpace, Piece, PlacedPolyhedron, ShapeError};
use joints::JointSet;

/// Convex rock mass and its joint sets.
#[derive(Clone, Debug)]
pub struct RockMass {
    /// Solid before cutting.
    pub solid: PlacedPolyhedron,
    /// Joint sets, in the order in which they cut.
    pub sets: Vec<JointSet>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Distance between the two walls of a joint \[m\].
    pub aperture: f64,
    /// Minimum thickness of a block \[m\]: the diameter of its inscribed sphere, before joints open.
    pub smallest_thickness: f64,
    /// Minimum volume of a block \[m³\], before joints open.
    pub smallest_volume: f64,
}

/// Block during cutting, and the random number that represents its previous cuts.
type Part = (Piece, u64);

impl RockMass {
    /// Returns an upper estimate of the number of blocks.
    #[must_use]
    pub fn expected(&self) -> f64 {
        let whole = Piece::from_polyhedron(&self.solid);
        let cuts = |set: &JointSet| {
            let (low, high) = whole.extent(&set.normal);
            1.0 + set.persistence * (high - low) / set.spacing.mean()
        };
        self.sets.iter().map(cuts).product()
    }

    /// Returns the blocks.
    ///
    /// # Errors
    /// If the aperture is as large as a block, of which nothing would remain.
    pub fn blocks(&self) -> Result<Vec<PlacedPolyhedron>, ShapeError> {
        let back = 0.5 * self.aperture;
        self.parts()
            .iter()
            .map(|(piece, _)| piece.solid(back))
            .collect()
    }

    fn parts(&self) -> Vec<Part> {
        let whole = Piece::from_polyhedron(&self.solid);
        let mut parts = vec![(whole.clone(), 0)];
        let mut first = 0;
        for (place, set) in (0..).zip(&self.sets) {
            let (low, high) = whole.extent(&set.normal);
            let offsets = set.offsets(self.seed, place, low, high);
            let mut after = Vec::with_capacity(parts.len());
            for part in parts {
                self.cut(part, set, &offsets, first, &mut after);
            }
            parts = after;
            first += offsets.len();
        }
        parts
    }

    /// Cuts a part by the planes of a set in ascending order; the lowest plane of the set has number `first`.
    fn cut(
        &self,
        (mut rest, mut line): Part,
        set: &JointSet,
        offsets: &[f64],
        first: usize,
        done: &mut Vec<Part>,
    ) {
        let (low, high) = rest.extent(&set.normal);
        let start = offsets.partition_point(|&at| at <= low);
        for (n, &offset) in offsets.iter().enumerate().skip(start) {
            if offset >= high {
                break;
            }
            let number = u32::try_from(first + n).unwrap_or(u32::MAX);
            let mut draw = Stream::new(self.seed, line, number);
            if draw.uniform() >= set.persistence {
                continue;
            }
            let plane = HalfSpace {
                normal: set.normal,
                offset,
            };
            let halves = rest.split(&plane);
            let Some([below, above]) =
                halves.filter(|halves| halves.iter().all(|half| self.lasts(half)))
            else {
                continue;
            };
            let mut line_of = || u64::from(draw.bits()) << 32 | u64::from(draw.bits());
            done.push((below, line_of()));
            (rest, line) = (above, line_of());
        }
        done.push((rest, line));
    }

    /// Returns `true` if a part is thick and large enough to remain a block.
    fn lasts(&self, part: &Piece) -> bool {
        part.volume() >= self.smallest_volume && part.thickness() >= self.smallest_thickness
    }
}

#[cfg(test)]
mod tests;
