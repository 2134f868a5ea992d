//! Keys of contacts, which apply to any lists on any rank.

/// Key of a contact at a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct WallKey {
    /// Id of the grain.
    pub(crate) grain: u64,
    pub(crate) wall: u32,
    /// Facet of the wall; 0 for a plane.
    pub(crate) facet: u32,
}

/// Key of a contact: ids, and the offset in periods of the second raw position from the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    pub(crate) first: u64,
    pub(crate) second: u64,
    pub(crate) shift: [i32; 3],
}

/// Returns the key of a pair of grains, each given by its id and its shift in periods.
pub(super) fn key(first: (u64, [i32; 3]), second: (u64, [i32; 3])) -> Key {
    Key {
        first: first.0,
        second: second.0,
        shift: std::array::from_fn(|axis| second.1[axis] - first.1[axis]),
    }
}
