//! Clusters of grains held together by unbroken bonds: blocks of clay, single grains of sand.

use std::collections::{BTreeMap, HashMap};

/// Groups grains by their bonds. A bond counts only if both grains are in the list. Grains and clusters are in
/// ascending order of id, independently of the order of the bonds.
#[must_use]
pub fn clusters(grains: &[u64], bonds: &[[u64; 2]]) -> Vec<Vec<u64>> {
    let mut sorted = grains.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let mut parent: Vec<usize> = (0..sorted.len()).collect();
    for bond in bonds {
        let [Ok(a), Ok(b)] = bond.map(|id| sorted.binary_search(&id)) else {
            continue;
        };
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        // The lower index is the root, so that a cluster is identified by its lowest grain.
        parent[a.max(b)] = a.min(b);
    }
    let mut groups: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
    for k in 0..sorted.len() {
        let root = root(&mut parent, k);
        groups.entry(root).or_default().push(sorted[k]);
    }
    groups.into_values().collect()
}

/// Returns the root of a group and shortens the paths to it.
fn root(parent: &mut [usize], mut k: usize) -> usize {
    while parent[k] != k {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    k
}

/// Returns the size of each of the `blocks` counted by its grains in `left`, and 1 for every grain of `left`
/// without a block.
#[must_use]
pub fn sizes_of_left(left: &[u64], blocks: &[Vec<u64>]) -> Vec<u64> {
    let block_of: HashMap<u64, usize> = blocks
        .iter()
        .enumerate()
        .flat_map(|(n, block)| block.iter().map(move |&id| (id, n)))
        .collect();
    let mut together = vec![0; blocks.len()];
    let mut sizes = Vec::new();
    for id in left {
        match block_of.get(id) {
            Some(&n) => together[n] += 1,
            None => sizes.push(1),
        }
    }
    sizes.extend(together.into_iter().filter(|&size| size > 0));
    sizes
}

/// Returns the number of occurrences of each size, in ascending order of size.
#[must_use]
pub fn histogram(sizes: impl IntoIterator<Item = u64>) -> Vec<(u64, u64)> {
    let mut counts = BTreeMap::new();
    for size in sizes {
        *counts.entry(size).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bonds_join_in_any_order_and_outsiders_join_nothing() {
        let grains = [9, 1, 4, 7, 2, 30];
        let bonds = [[4, 9], [1, 2], [9, 1], [7, 8], [8, 30]];
        let expected = vec![vec![1, 2, 4, 9], vec![7], vec![30]];
        assert_eq!(clusters(&grains, &bonds), expected);
        let mut turned: Vec<[u64; 2]> = bonds.iter().map(|[a, b]| [*b, *a]).collect();
        turned.reverse();
        assert_eq!(clusters(&grains, &turned), expected);
        let sizes = expected.iter().map(|cluster| cluster.len() as u64);
        assert_eq!(histogram(sizes), [(1, 2), (4, 1)]);
    }

    #[test]
    fn sand_is_single_grains() {
        assert_eq!(
            histogram(clusters(&[3, 1, 2], &[]).iter().map(|c| c.len() as u64)),
            [(1, 3)]
        );
        assert!(clusters(&[], &[[1, 2]]).is_empty());
    }

    #[test]
    fn what_left_together_counts_once() {
        let blocks = [vec![1, 2, 5], vec![6, 8]];
        assert_eq!(
            histogram(sizes_of_left(&[1, 3, 5, 6, 9], &blocks)),
            [(1, 3), (2, 1)]
        );
    }
}
