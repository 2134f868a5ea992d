//! A hash that compares two global states bit by bit, independent of the split.
//!
//! Every entry (field, global index, bits) passes a mixer, and the results are added modulo 2^128.
//! Addition is commutative, so that the sum is independent of ranks, threads and partitions. The mixer is a Feistel
//! network (M. Luby, C. Rackoff, SIAM J. Comput. 17 (1988) 373) on (index, bits) with keys from the field. It is a
//! permutation: no two entries of a field collide.

use crate::comm::Communicator;

/// Number of rounds of the network; from the fourth on, each bit of the input affects each bit of the output.
const ROUNDS: usize = 5;

/// Odd constants: 2^64 divided by the golden ratio, and the multipliers of SplitMix64 (Steele et
/// al., OOPSLA 2014).
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
const MIX_1: u64 = 0xbf58_476d_1ce4_e5b9;
const MIX_2: u64 = 0x94d0_49bb_1331_11eb;

/// Order-independent hash of a global state. It detects errors, but does not protect against an adversary.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StateHash {
    sum: u128,
}

impl StateHash {
    /// Returns the hash of the empty state.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the `bits` of entry `global_index` of a field; see [`field_key`] for `field`. Each entry must be added
    /// once, by its owner.
    #[inline]
    pub fn add(&mut self, field: u64, global_index: u64, bits: u64) {
        let keys = round_keys(field);
        self.sum = self.sum.wrapping_add(mix(&keys, global_index, bits));
    }

    /// Adds consecutive entries of a field, the first of them with index `first`. The bits count:
    /// 0.0 and -0.0 differ.
    pub fn add_f64s(&mut self, field: u64, first: u64, values: &[f64]) {
        let bits = values.iter().map(|value| value.to_bits());
        self.add_entries(field, (first..).zip(bits));
    }

    /// Adds entries of a field, each with its index and its bits, in any order.
    #[inline]
    pub fn add_entries(&mut self, field: u64, entries: impl Iterator<Item = (u64, u64)>) {
        let keys = round_keys(field);
        for (index, bits) in entries {
            self.sum = self.sum.wrapping_add(mix(&keys, index, bits));
        }
    }

    /// Adds the entries of another part of the state.
    pub fn merge(&mut self, other: Self) {
        self.sum = self.sum.wrapping_add(other.sum);
    }

    /// Returns the hash of all ranks' parts together, the same on each; collective.
    #[must_use]
    pub fn all_reduce(self, communicator: &Communicator) -> Self {
        Self {
            sum: communicator.all_reduce_sum_u128(self.sum),
        }
    }

    /// Returns the hash as a number.
    #[must_use]
    pub fn value(self) -> u128 {
        self.sum
    }

    /// Returns the hash as text of 32 hexadecimal digits.
    #[must_use]
    pub fn hex(self) -> String {
        format!("{:032x}", self.sum)
    }
}

/// Returns a key for a field from its name (FNV-1a, 64 bits); it can be evaluated at compile time.
#[must_use]
pub const fn field_key(name: &str) -> u64 {
    let bytes = name.as_bytes();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut index = 0;
    while index < bytes.len() {
        hash = (hash ^ bytes[index] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        index += 1;
    }
    hash
}

/// Returns independent keys for the rounds: a SplitMix64 sequence that starts at the field.
#[inline]
fn round_keys(field: u64) -> [u64; ROUNDS] {
    let mut state = field;
    [(); ROUNDS].map(|()| {
        state = state.wrapping_add(GOLDEN);
        let mut key = state;
        key = (key ^ (key >> 30)).wrapping_mul(MIX_1);
        key = (key ^ (key >> 27)).wrapping_mul(MIX_2);
        key ^ (key >> 31)
    })
}

/// Returns a permutation of pairs of words.
#[inline]
fn mix(keys: &[u64; ROUNDS], index: u64, bits: u64) -> u128 {
    let (mut left, mut right) = (index, bits);
    for &key in keys {
        (left, right) = (right, left ^ fold(right ^ key));
    }
    (u128::from(left) << 64) | u128::from(right)
}

/// Returns the exclusive-or of the high and low halves of a product of 64 by 64 bits; shifts move its high bits
/// downwards.
#[inline]
fn fold(word: u64) -> u64 {
    let word = word ^ (word >> 32);
    let product = u128::from(word.wrapping_mul(MIX_1)) * u128::from(GOLDEN);
    high(product) ^ low(product)
}

#[inline]
fn high(product: u128) -> u64 {
    (product >> 64) as u64
}

#[inline]
#[expect(clippy::cast_possible_truncation, reason = "the lower half is wanted")]
fn low(product: u128) -> u64 {
    product as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    fn one(field: u64, index: u64, bits: u64) -> u128 {
        let mut hash = StateHash::new();
        hash.add(field, index, bits);
        hash.value()
    }

    #[test]
    fn every_single_bit_matters_and_reaches_half_of_the_hash() {
        for base in [
            [0, 0, 0],
            [1, 2, 3],
            [field_key("density"), 77, 1.5_f64.to_bits()],
        ] {
            let [field, index, bits] = base;
            let reference = one(field, index, bits);
            let mut flips = 0;
            for bit in 0..64 {
                let flip = 1_u64 << bit;
                for changed in [
                    one(field ^ flip, index, bits),
                    one(field, index ^ flip, bits),
                    one(field, index, bits ^ flip),
                ] {
                    let differing = (changed ^ reference).count_ones();
                    assert!((32..=96).contains(&differing), "{base:?} {bit} {differing}");
                    flips += differing;
                }
            }
            // 192 samples of a binomial with 128 trials: mean 64, deviation of the mean 0.4.
            let mean = f64::from(flips) / 192.0;
            assert!((mean - 64.0).abs() < 2.5, "{mean}");
        }
    }

    #[test]
    fn small_numbers_do_not_collide() {
        let mut seen = HashSet::new();
        for field in 0..12 {
            for index in 0..40 {
                for bits in 0..40 {
                    assert!(seen.insert(one(field, index, bits)));
                }
            }
        }
    }

    #[test]
    fn exchanging_two_values_changes_the_hash() {
        let hash = |values: &[f64]| {
            let mut hash = StateHash::new();
            hash.add_f64s(field_key("pressure"), 10, values);
            hash
        };
        assert_ne!(hash(&[1.0, 2.0]), hash(&[2.0, 1.0]));
        assert_ne!(hash(&[0.0]), hash(&[-0.0]));
        assert_ne!(hash(&[0.0]), StateHash::new());
        // Structured states: equal differences in value and index do not cancel.
        assert_ne!(hash(&[1.0, 2.0, 3.0, 4.0]), hash(&[2.0, 1.0, 4.0, 3.0]));
    }

    #[test]
    fn hex_has_32_digits_and_stays_what_it_was() {
        assert_eq!(StateHash::new().hex(), "0".repeat(32));
        assert_ne!(field_key("velocity_x"), field_key("velocity_y"));
        // FNV's published value for "foobar".
        assert_eq!(field_key("foobar"), 0x8594_4171_f739_67e8);
        let mut hash = StateHash::new();
        hash.add_f64s(field_key("density"), 0, &[1.0, 2.0]);
        hash.add(
            field_key("solid_fraction"),
            5,
            u64::from(0.25_f32.to_bits()),
        );
        hash.add(field_key("id"), 0, 7);
        assert_eq!(hash.hex(), KNOWN);
    }

    /// Hash of the state in the test above; a change would invalidate recorded hashes.
    const KNOWN: &str = "ff4ea927c4d5ca14529bea2a10831a05";

    proptest! {
        #[test]
        fn any_partition_gives_the_same_hash(
            values in prop::collection::vec(any::<f64>(), 1..80),
            cuts in prop::collection::vec(0_usize..80, 0..5),
        ) {
            let field = field_key("velocity_x");
            let mut whole = StateHash::new();
            whole.add_f64s(field, 0, &values);
            let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut % values.len()).collect();
            cuts.extend([0, values.len()]);
            cuts.sort_unstable();
            let mut total = StateHash::new();
            for pair in cuts.windows(2).rev() {
                let mut part = StateHash::new();
                part.add_f64s(field, pair[0] as u64, &values[pair[0]..pair[1]]);
                total.merge(part);
            }
            prop_assert_eq!(total, whole);
            let mut singly = StateHash::new();
            for (index, value) in values.iter().enumerate().rev() {
                singly.add(field, index as u64, value.to_bits());
            }
            prop_assert_eq!(singly, whole);
        }
    }
}
