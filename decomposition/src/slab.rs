//! Ownership of planes: the domain is split along one axis into one slab for each rank.
//!
//! Integers decide ownership. A plane belongs to the rank whose range contains it. The caller finds the
//! plane of a position once; no rank compares a position with the face of a slab in floating point.
//! Every particle therefore has exactly one owner.

use crate::comm::Communicator;
use std::ops::Range;

/// Axis of space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SplitAxis {
    /// First coordinate.
    X,
    /// Second coordinate.
    Y,
    /// Third coordinate.
    Z,
}

impl SplitAxis {
    /// Returns the index of the coordinate in a vector: 0, 1 or 2.
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }

    /// Returns the axis with the largest number of cells (the first of equals), which is the default direction of
    /// the split.
    #[must_use]
    pub fn longest(cells: [usize; 3]) -> Self {
        if cells[0] >= cells[1] && cells[0] >= cells[2] {
            Self::X
        } else if cells[1] >= cells[2] {
            Self::Y
        } else {
            Self::Z
        }
    }
}

/// Invalid split of the domain.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SlabError {
    /// The list of bounds does not start at 0, decreases, or contains no slab.
    #[error(
        "slab bounds must start at 0, not decrease and contain at least one slab, not {bounds:?}"
    )]
    Bounds {
        /// Bounds given by the caller.
        bounds: Vec<usize>,
    },
    /// The number of slabs differs from the number of ranks.
    #[error("the domain is split into {slabs} slabs, but there are {ranks} ranks")]
    Ranks {
        /// Number of slabs.
        slabs: usize,
        /// Number of ranks of the communicator.
        ranks: usize,
    },
}

/// Split of `planes` planes along one axis, equal on every rank. Slab r belongs to rank r.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slabs {
    axis: SplitAxis,
    /// The planes of rank r are `bounds[r]..bounds[r + 1]`; bounds do not decrease, and the first is 0.
    bounds: Vec<usize>,
    periodic: bool,
}

impl Slabs {
    /// Returns slabs whose thickness differs by at most one plane, the thicker ones first. With more ranks than
    /// planes the last slabs are empty. A `size` of 0 counts as 1.
    #[must_use]
    pub fn even(axis: SplitAxis, planes: usize, size: usize, periodic: bool) -> Self {
        let size = size.max(1);
        let (thickness, thicker) = (planes / size, planes % size);
        let bounds = (0..=size)
            .map(|rank| rank * thickness + rank.min(thicker))
            .collect();
        Self {
            axis,
            bounds,
            periodic,
        }
    }

    /// Returns the slabs `bounds[r]..bounds[r + 1]`; two equal bounds in the list give an empty slab.
    ///
    /// # Errors
    /// If the list does not start at 0, falls, or is shorter than two, [`SlabError::Bounds`].
    pub fn from_bounds(
        axis: SplitAxis,
        bounds: Vec<usize>,
        periodic: bool,
    ) -> Result<Self, SlabError> {
        if bounds.len() < 2 || bounds[0] != 0 || !bounds.is_sorted() {
            return Err(SlabError::Bounds { bounds });
        }
        Ok(Self {
            axis,
            bounds,
            periodic,
        })
    }

    /// Returns the axis along which the domain is cut.
    #[must_use]
    pub fn axis(&self) -> SplitAxis {
        self.axis
    }

    /// Returns the number of planes of the whole domain.
    #[must_use]
    pub fn planes(&self) -> usize {
        self.bounds[self.bounds.len() - 1]
    }

    /// Returns the number of slabs, which is the number of ranks.
    #[must_use]
    pub fn size(&self) -> usize {
        self.bounds.len() - 1
    }

    /// Returns `true` if the plane after the last one is the first.
    #[must_use]
    pub fn periodic(&self) -> bool {
        self.periodic
    }

    /// Returns the bounds of the slabs, one more than slabs.
    #[must_use]
    pub fn bounds(&self) -> &[usize] {
        &self.bounds
    }

    /// Returns the planes of a rank; empty for an empty slab.
    ///
    /// # Panics
    /// If there is no such rank.
    #[must_use]
    pub fn range(&self, rank: usize) -> Range<usize> {
        self.bounds[rank]..self.bounds[rank + 1]
    }

    /// Returns the rank that owns a plane; `None` beyond the last plane.
    #[must_use]
    pub fn owner_of_plane(&self, plane: usize) -> Option<usize> {
        // Of several slabs with the same start, the last one has planes.
        let after = self.bounds.partition_point(|&bound| bound <= plane);
        (plane < self.planes()).then(|| after - 1)
    }

    /// Returns the rank that owns the plane below the first plane of a rank: the rank itself if it is alone and
    /// periodic, `None` at a closed end and for an empty slab.
    ///
    /// # Panics
    /// If there is no such rank.
    #[must_use]
    pub fn lower_neighbour(&self, rank: usize) -> Option<usize> {
        let range = self.range(rank);
        if range.is_empty() {
            None
        } else if range.start > 0 {
            self.owner_of_plane(range.start - 1)
        } else if self.periodic {
            self.owner_of_plane(self.planes() - 1)
        } else {
            None
        }
    }

    /// Returns the rank that owns the plane above the last plane of a rank: the rank itself if it is alone and
    /// periodic, `None` at a closed end and for an empty slab.
    ///
    /// # Panics
    /// If there is no such rank.
    #[must_use]
    pub fn upper_neighbour(&self, rank: usize) -> Option<usize> {
        let range = self.range(rank);
        if range.is_empty() {
            None
        } else if range.end < self.planes() {
            self.owner_of_plane(range.end)
        } else if self.periodic {
            self.owner_of_plane(0)
        } else {
            None
        }
    }
}

/// Split of the domain, and this rank's slab.
#[derive(Debug, Clone)]
pub struct Domain {
    communicator: Communicator,
    slabs: Slabs,
}

impl Domain {
    /// Returns the domain in which each rank of the communicator has its slab.
    ///
    /// # Errors
    /// If there are not as many slabs as ranks, [`SlabError::Ranks`].
    pub fn new(communicator: Communicator, slabs: Slabs) -> Result<Self, SlabError> {
        if slabs.size() != communicator.size() {
            return Err(SlabError::Ranks {
                slabs: slabs.size(),
                ranks: communicator.size(),
            });
        }
        let rank = communicator.rank();
        log::debug!(
            "rank {rank} of {}: planes {:?} along {:?}",
            communicator.size(),
            slabs.range(rank),
            slabs.axis
        );
        Ok(Self {
            communicator,
            slabs,
        })
    }

    /// Returns the whole domain on this process, without MPI.
    #[must_use]
    pub fn serial(axis: SplitAxis, planes: usize, periodic: bool) -> Self {
        Self {
            communicator: Communicator::serial(),
            slabs: Slabs::even(axis, planes, 1, periodic),
        }
    }

    /// Returns the ranks of the domain.
    #[must_use]
    pub fn communicator(&self) -> &Communicator {
        &self.communicator
    }

    /// Returns the split, the same on every rank.
    #[must_use]
    pub fn slabs(&self) -> &Slabs {
        &self.slabs
    }

    /// Returns the rank of this process.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.communicator.rank()
    }

    /// Returns the axis along which the domain is cut.
    #[must_use]
    pub fn axis(&self) -> SplitAxis {
        self.slabs.axis
    }

    /// Returns the planes of this rank.
    #[must_use]
    pub fn range(&self) -> Range<usize> {
        self.slabs.range(self.rank())
    }

    /// Returns the rank that owns the plane below the first of this rank; see [`Slabs::lower_neighbour`].
    #[must_use]
    pub fn lower_neighbour(&self) -> Option<usize> {
        self.slabs.lower_neighbour(self.rank())
    }

    /// Returns the rank that owns the plane above the last of this rank; see [`Slabs::upper_neighbour`].
    #[must_use]
    pub fn upper_neighbour(&self) -> Option<usize> {
        self.slabs.upper_neighbour(self.rank())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn even_slabs_differ_by_one_plane() {
        let slabs = Slabs::even(SplitAxis::X, 10, 4, false);
        assert_eq!(slabs.bounds(), [0, 3, 6, 8, 10]);
        let few = Slabs::even(SplitAxis::X, 2, 4, false);
        assert_eq!(few.bounds(), [0, 1, 2, 2, 2]);
        assert_eq!(Slabs::even(SplitAxis::X, 5, 0, false).size(), 1);
    }

    #[test]
    fn bounds_are_checked() {
        for wrong in [vec![], vec![0], vec![1, 4], vec![0, 5, 4]] {
            let refused = Slabs::from_bounds(SplitAxis::X, wrong.clone(), false);
            assert_eq!(refused, Err(SlabError::Bounds { bounds: wrong }));
        }
        let two = Slabs::even(SplitAxis::X, 8, 2, false);
        let refused = Domain::new(Communicator::serial(), two).unwrap_err();
        assert_eq!(refused, SlabError::Ranks { slabs: 2, ranks: 1 });
    }

    #[test]
    fn neighbours_skip_empty_slabs() {
        let bounds = vec![0, 0, 3, 3, 3, 7, 7];
        let closed = Slabs::from_bounds(SplitAxis::Y, bounds.clone(), false).unwrap();
        let owners: Vec<_> = (0..8).map(|plane| closed.owner_of_plane(plane)).collect();
        let (one, four) = (Some(1), Some(4));
        assert_eq!(owners, [one, one, one, four, four, four, four, None]);
        let sides =
            |slabs: &Slabs, rank| (slabs.lower_neighbour(rank), slabs.upper_neighbour(rank));
        assert_eq!(sides(&closed, 1), (None, four));
        assert_eq!(sides(&closed, 4), (one, None));
        assert_eq!(sides(&closed, 2), (None, None));
        let periodic = Slabs::from_bounds(SplitAxis::Y, bounds, true).unwrap();
        assert_eq!(sides(&periodic, 1), (four, four));
        assert_eq!(sides(&periodic, 4), (one, one));
        assert_eq!(sides(&periodic, 0), (None, None));
        let alone = Slabs::from_bounds(SplitAxis::Y, vec![0, 0, 5], true).unwrap();
        assert_eq!(sides(&alone, 1), (Some(1), Some(1)));
    }

    #[test]
    fn longest_axis_prefers_the_first() {
        assert_eq!(SplitAxis::longest([4, 4, 1]), SplitAxis::X);
        assert_eq!(SplitAxis::longest([4, 5, 5]), SplitAxis::Y);
        assert_eq!(SplitAxis::longest([4, 5, 6]).index(), 2);
    }

    fn split() -> impl Strategy<Value = Slabs> {
        (
            prop::collection::vec(0_usize..6, 1..6),
            1_usize..4,
            any::<bool>(),
        )
            .prop_map(|(thickness, last, periodic)| {
                let mut bounds = vec![0];
                let mut sum = 0;
                for planes in thickness.into_iter().chain([last]) {
                    sum += planes;
                    bounds.push(sum);
                }
                Slabs::from_bounds(SplitAxis::X, bounds, periodic).unwrap()
            })
    }

    proptest! {
        /// Checks that neighbours are mutual, and that a message downwards arrives from above.
        #[test]
        fn neighbours_are_mutual(slabs in split()) {
            for rank in 0..slabs.size() {
                if let Some(lower) = slabs.lower_neighbour(rank) {
                    prop_assert_eq!(slabs.upper_neighbour(lower), Some(rank));
                }
                if let Some(upper) = slabs.upper_neighbour(rank) {
                    prop_assert_eq!(slabs.lower_neighbour(upper), Some(rank));
                }
            }
            let planes: usize = (0..slabs.size()).map(|rank| slabs.range(rank).len()).sum();
            prop_assert_eq!(planes, slabs.planes());
        }
    }
}
