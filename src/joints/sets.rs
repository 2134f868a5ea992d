//! Disjoint sets: each member has a parent, and the first member of a set is its own.

/// Returns the first member of a set, and halves the path to it.
pub(crate) fn root(parents: &mut [usize], mut member: usize) -> usize {
    while parents[member] != member {
        parents[member] = parents[parents[member]];
        member = parents[member];
    }
    member
}
