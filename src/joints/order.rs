//! Order of elimination of large networks: nested dissection by position.
//!
//! The unknowns are divided into two parts along the longest axis of their box, near the middle; those of one part that
//! are joined to the other one separate them and come last (George, SIAM J. Numer. Anal. 10, 345 (1973); by
//! coordinates: Miller, Teng, Thurston and Vavasis, J. ACM 44, 1 (1997)). The place with fewest separators is taken.
//! The parts are divided in the same way down to small sets, which approximate minimum degree orders. The time for the
//! order grows like the number of unknowns times its logarithm.

use crate::ldl::minimum_degree;
use nalgebra::Vector3;

/// Largest set that minimum degree orders.
const LEAF: usize = 600;
/// Number of places, in addition to the middle, at which a set may be divided.
const STEPS: usize = 6;

/// Neighbours of each unknown.
struct Graph {
    starts: Vec<usize>,
    others: Vec<usize>,
}

impl Graph {
    fn new(count: usize, pairs: &[[usize; 2]]) -> Self {
        let mut starts = vec![0; count + 1];
        for unknown in pairs.iter().flatten() {
            starts[unknown + 1] += 1;
        }
        for unknown in 0..count {
            starts[unknown + 1] += starts[unknown];
        }
        let mut next = starts.clone();
        let mut others = vec![0; 2 * pairs.len()];
        for &[a, b] in pairs {
            for (from, to) in [(a, b), (b, a)] {
                others[next[from]] = to;
                next[from] += 1;
            }
        }
        Self { starts, others }
    }

    fn neighbours(&self, unknown: usize) -> &[usize] {
        &self.others[self.starts[unknown]..self.starts[unknown + 1]]
    }
}

/// Sets that are being divided.
struct Dissection<'a> {
    graph: Graph,
    positions: &'a [Vector3<f64>],
    /// Set of each unknown; unknowns that are already in the order belong to no set.
    set: Vec<usize>,
    sets: usize,
    order: Vec<usize>,
}

/// Returns an order of elimination of unknowns at these positions \[m\], with nonzero entries at `pairs` of them.
pub(crate) fn dissection(positions: &[Vector3<f64>], pairs: &[[usize; 2]]) -> Vec<usize> {
    let mut work = Dissection {
        graph: Graph::new(positions.len(), pairs),
        positions,
        set: vec![0; positions.len()],
        sets: 1,
        order: Vec::with_capacity(positions.len()),
    };
    work.divide((0..positions.len()).collect());
    work.order
}

impl Dissection<'_> {
    /// Adds the unknowns of a set to the order.
    fn divide(&mut self, mut members: Vec<usize>) {
        if members.len() <= LEAF {
            self.order_leaf(&members);
            return;
        }
        let axes = self.axes(&members);
        let positions = self.positions;
        members.sort_unstable_by(|&a, &b| {
            let along = |axis: usize| positions[a][axis].total_cmp(&positions[b][axis]);
            let order = along(axes[0]).then(along(axes[1])).then(along(axes[2]));
            order.then(a.cmp(&b))
        });
        let [one, other] = [self.sets, self.sets + 1];
        self.sets += 2;
        let (mut split, mut between) = (0, members.clone());
        for at in self.splits(&members, axes[0]) {
            self.mark(&members[..at], one);
            self.mark(&members[at..], other);
            let below = self.touching(&members[..at], other);
            let above = self.touching(&members[at..], one);
            for found in [below, above] {
                if found.len() < between.len() {
                    (split, between) = (at, found);
                }
            }
        }
        let upper = members.split_off(split);
        self.mark(&members, one);
        self.mark(&upper, other);
        let separators = self.sets;
        self.sets += 1;
        self.mark(&between, separators);
        for (mut half, set) in [(members, one), (upper, other)] {
            half.retain(|&unknown| self.set[unknown] == set);
            self.divide(half);
        }
        self.order.extend(between);
    }

    /// Returns the members of a list that have neighbours in a set.
    fn touching(&self, list: &[usize], set: usize) -> Vec<usize> {
        let is_joined = |&&unknown: &&usize| {
            let mut others = self.graph.neighbours(unknown).iter();
            others.any(|&unknown| self.set[unknown] == set)
        };
        list.iter().filter(is_joined).copied().collect()
    }

    /// Returns the places at which a list, sorted along an axis, may be divided: the middle, and the widest steps near
    /// it, where a regular arrangement has planes between its layers.
    fn splits(&self, members: &[usize], axis: usize) -> Vec<usize> {
        let count = members.len();
        let at = |place: usize| self.positions[members[place]][axis];
        let step = |place: &usize| at(*place) - at(*place - 1);
        let mut steps: Vec<usize> = (3 * count / 8..=5 * count / 8).collect();
        steps.sort_by(|a, b| {
            let middle = |place: usize| place.abs_diff(count / 2);
            let order = step(b).total_cmp(&step(a));
            order.then(middle(*a).cmp(&middle(*b))).then(a.cmp(b))
        });
        steps.truncate(STEPS);
        steps.insert(0, count / 2);
        steps
    }

    fn mark(&mut self, members: &[usize], set: usize) {
        for &unknown in members {
            self.set[unknown] = set;
        }
    }

    /// Returns the axes from the longest extent of a set to the shortest.
    fn axes(&self, members: &[usize]) -> [usize; 3] {
        let first = self.positions[members[0]];
        let (mut low, mut high) = (first, first);
        for &unknown in members {
            low = low.inf(&self.positions[unknown]);
            high = high.sup(&self.positions[unknown]);
        }
        let extent = high - low;
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| extent[b].total_cmp(&extent[a]).then(a.cmp(&b)));
        axes
    }

    /// Adds a small set by minimum degree.
    fn order_leaf(&mut self, members: &[usize]) {
        let set = self.sets;
        self.sets += 1;
        self.mark(members, set);
        let mut local = std::collections::HashMap::with_capacity(members.len());
        local.extend(members.iter().copied().zip(0..));
        let mut pairs = Vec::new();
        for (number, &unknown) in members.iter().enumerate() {
            for other in self.graph.neighbours(unknown) {
                if let Some(&other) = local.get(other)
                    && number < other
                {
                    pairs.push([number, other]);
                }
            }
        }
        let order = minimum_degree(members.len(), &pairs);
        self.order
            .extend(order.into_iter().map(|number| members[number]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ldl::Factors;

    #[test]
    fn a_lattice_in_space_is_divided_into_every_unknown_once_and_fills_little() {
        let n = 24;
        let at = |x: usize, y: usize, z: usize| x + n * (y + n * z);
        let (mut positions, mut pairs) = (Vec::new(), Vec::new());
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    let real = [x, y, z].map(base::number::real);
                    positions.push(Vector3::from(real));
                    if x > 0 {
                        pairs.push([at(x - 1, y, z), at(x, y, z)]);
                    }
                    if y > 0 {
                        pairs.push([at(x, y - 1, z), at(x, y, z)]);
                    }
                    if z > 0 {
                        pairs.push([at(x, y, z - 1), at(x, y, z)]);
                    }
                }
            }
        }
        let start = std::time::Instant::now();
        let order = dissection(&positions, &pairs);
        println!("dissection in {:?}", start.elapsed());
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..n * n * n));
        let count = positions.len();
        let divided = Factors::in_order(order, &pairs).entries();
        let natural = Factors::in_order((0..count).collect(), &pairs).entries();
        let start = std::time::Instant::now();
        let degree = Factors::new(count, &pairs).entries();
        println!("order by degree, and its factors, in {:?}", start.elapsed());
        println!(
            "entries: {divided} by dissection, {degree} by degree, {natural} point after point"
        );
        assert!(3 * divided < natural && 2 * divided < 3 * degree);
    }
}
