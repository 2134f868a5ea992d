//! Clusters: grains that contacts and bonds connect to each other, and whether something stationary holds them.
//!
//! Each rank joins the entries that it has. Ghosts join the clusters of the ranks: the owner of a grain and the ranks
//! with its ghosts exchange the names of the clusters that have it.

use super::particles::Particles;
use super::space::Space;
use super::{Dem, Kind};
use base::error::Error;
use decomposition::Domain;
use std::collections::{BTreeSet, HashMap, HashSet};

/// Gap below which two bodies count as touching, as a fraction of the smaller radius: more than the rounding of
/// coordinates that a person writes, less than any fall that counts.
const TOUCHING: f64 = 1e-3;

/// Sets of entries, joined pair by pair.
struct Sets(Vec<usize>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn root(&mut self, mut k: usize) -> usize {
        while self.0[k] != k {
            self.0[k] = self.0[self.0[k]];
            k = self.0[k];
        }
        k
    }

    /// Joins the sets of two entries; the lower root is the root of both.
    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.0[one.max(other)] = one.min(other);
    }
}

impl<S: Space> Dem<S> {
    /// Returns, for each owned grain, `true` if contacts and bonds connect it to a wall or to a fixed or driven body.
    /// Bodies that are held connect nothing. Bodies closer than a thousandth of the smaller radius count as in contact.
    /// Builds the lists again. Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn supported(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<Vec<bool>, Error> {
        self.engine.forget_lists();
        self.prepare(particles, domain)?;
        let mut sets = Sets::new(particles.len());
        let mut on_support = vec![false; particles.len()];
        let kind = |k: usize| particles.body[k].kind;
        self.engine
            .for_each_near(particles, TOUCHING, &mut |one, other| {
                let Some(other) = other else {
                    on_support[one] = true;
                    return;
                };
                match [kind(one), kind(other)] {
                    [Kind::Free, Kind::Free] => sets.join(one, other),
                    [Kind::Free, Kind::Fixed | Kind::Driven] => on_support[one] = true,
                    [Kind::Fixed | Kind::Driven, Kind::Free] => on_support[other] = true,
                    _ => {}
                }
            });
        let roots: Vec<usize> = (0..particles.len()).map(|k| sets.root(k)).collect();
        // Clusters of this rank are named by the lowest id in them.
        let mut names = vec![u64::MAX; particles.len()];
        for (k, &root) in roots.iter().enumerate() {
            names[root] = names[root].min(particles.body[k].id);
        }
        let name = |k: usize| names[roots[k]];
        let standing: BTreeSet<u64> = (0..particles.len())
            .filter(|&k| on_support[k])
            .map(name)
            .collect();
        let standing = join_over_ranks(particles, &name, &standing, domain);
        Ok((0..particles.owned())
            .map(|k| kind(k) == Kind::Free && standing.contains(&name(k)))
            .collect())
    }
}

/// Returns the names of the clusters of any rank that stand on something, directly or through clusters of other ranks
/// and periodic images. `name` returns the name of the cluster of an entry, `standing` has those of this rank.
/// Collective.
fn join_over_ranks<S: Space>(
    particles: &Particles<S>,
    name: &dyn Fn(usize) -> u64,
    standing: &BTreeSet<u64>,
    domain: &Domain,
) -> HashSet<u64> {
    let communicator = domain.communicator();
    let gather = |numbers: &mut dyn Iterator<Item = u64>| -> Vec<u64> {
        let bytes: Vec<u8> = numbers.flat_map(u64::to_le_bytes).collect();
        let all = communicator.all_gather_bytes(&bytes);
        let words = all.iter().flat_map(|part| part.as_chunks::<8>().0);
        words.map(|word| u64::from_le_bytes(*word)).collect()
    };
    let free = |k: &usize| particles.body[*k].kind == Kind::Free;
    let ghosts = (particles.owned()..particles.len()).filter(free);
    let of_ghosts = gather(&mut ghosts.flat_map(|k| [particles.body[k].id, name(k)]));
    let (of_ghosts, _) = of_ghosts.as_chunks::<2>();
    let asked: HashSet<u64> = of_ghosts.iter().map(|[id, _]| *id).collect();
    let own = (0..particles.owned()).filter(|&k| asked.contains(&particles.body[k].id));
    let of_owners = gather(&mut own.flat_map(|k| [particles.body[k].id, name(k)]));
    let (of_owners, _) = of_owners.as_chunks::<2>();
    let standing = gather(&mut standing.iter().copied());

    // Sets of the names that meet, by position in a list of them.
    let owners: HashMap<u64, u64> = of_owners.iter().map(|[id, name]| (*id, *name)).collect();
    let met: BTreeSet<u64> = of_ghosts.iter().map(|[_, name]| *name).collect();
    let met: BTreeSet<u64> = met.into_iter().chain(owners.values().copied()).collect();
    let met: Vec<u64> = met.into_iter().collect();
    let place = |name: &u64| met.binary_search(name).ok();
    let mut sets = Sets::new(met.len());
    for [id, name] in of_ghosts {
        let owner = owners.get(id).and_then(place);
        if let (Some(one), Some(other)) = (place(name), owner) {
            sets.join(one, other);
        }
    }
    let mut result: HashSet<u64> = standing.iter().copied().collect();
    let roots: HashSet<usize> = standing
        .iter()
        .filter_map(place)
        .map(|k| sets.root(k))
        .collect();
    for (k, name) in met.iter().enumerate() {
        if roots.contains(&sets.root(k)) {
            result.insert(*name);
        }
    }
    result
}
