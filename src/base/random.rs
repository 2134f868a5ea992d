//! Random numbers.
//!
//! The numbers of a run come from the counter-based generator Philox4x32-10. A draw is a function of (seed, id,
//! purpose, index), so that it is the same on any rank, in any order, and after a restart. Source: J. K. Salmon, M.
//! A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11,
//! doi:10.1145/2063384.2063405; checked against the known-answer vectors of their Random123 library.

/// Returns the block function: ten rounds over a counter of four words with a key of two.
#[must_use]
pub fn philox4x32_10(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
    const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
    for _ in 0..10 {
        let [high0, low0] = halves(u64::from(MULTIPLIERS[0]) * u64::from(counter[0]));
        let [high1, low1] = halves(u64::from(MULTIPLIERS[1]) * u64::from(counter[2]));
        counter = [
            high1 ^ counter[1] ^ key[0],
            low1,
            high0 ^ counter[3] ^ key[1],
            low0,
        ];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

/// Returns the high and the low word of a product.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the two halves of 64 bits are 32 bits each"
)]
const fn halves(value: u64) -> [u32; 2] {
    [(value >> 32) as u32, value as u32]
}

/// Sequence of random draws for one object (`id`) and one purpose (`purpose`) under one seed.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u32; 2],
    id: [u32; 2],
    purpose: u32,
    block: u32,
    words: [u32; 4],
    used: usize,
}

impl Stream {
    /// Returns the stream of `(seed, id, purpose)`, at its beginning.
    #[must_use]
    pub fn new(seed: u64, id: u64, purpose: u32) -> Self {
        let [high, low] = halves(seed);
        let [id_high, id_low] = halves(id);
        Self {
            key: [low, high],
            id: [id_low, id_high],
            purpose,
            block: 0,
            words: [0; 4],
            used: 4,
        }
    }

    /// Returns the next 32 random bits.
    pub fn bits(&mut self) -> u32 {
        if self.used == 4 {
            self.words =
                philox4x32_10([self.block, self.purpose, self.id[0], self.id[1]], self.key);
            self.block = self.block.wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.words[self.used - 1]
    }

    /// Returns the next number, uniform over [0, 1) with 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        const UNIT: f64 = 1.0 / 9_007_199_254_740_992.0;
        let high = f64::from(self.bits() >> 5);
        let low = f64::from(self.bits() >> 6);
        (high * 67_108_864.0 + low) * UNIT
    }
}

/// SplitMix64: a counter with a mixing function, for draws that only have to be reproducible from a seed, as in a
/// bootstrap.
///
/// Source: G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
#[derive(Clone, Debug)]
pub struct SplitMix {
    state: u64,
}

impl SplitMix {
    /// Returns the generator of a seed, at its start.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// Returns the next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns the next number, uniform over [0, 1) with 53 random bits.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Returns the next whole number below `limit`, with a bias below `limit / 2^64`.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the product's high half is below `limit`"
    )]
    pub fn below(&mut self, limit: usize) -> usize {
        ((u128::from(self.bits()) * limit as u128) >> 64) as usize
    }
}

/// Random numbers of several distributions.
#[derive(Clone, Debug)]
pub struct Draws(SplitMix);

impl Draws {
    /// Returns the sequence of a seed, at its start.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(SplitMix::new(seed))
    }

    /// Draws a number between 0 and 1, both exclusive.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub fn uniform(&mut self) -> f64 {
        ((self.0.bits() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Draws from the normal distribution of mean 0 and variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Draws from the exponential distribution with the given rate.
    pub fn exponential(&mut self, rate: f64) -> f64 {
        -self.uniform().ln() / rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks against the known answers in `kat_vectors` of Random123 for philox 4x32, 10 rounds.
    #[test]
    fn known_answers() {
        assert_eq!(
            philox4x32_10([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox4x32_10([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32_10(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn streams_are_uniform_and_apart() {
        let mut mean = 0.0;
        let mut square = 0.0;
        let count = 20_000_u32;
        let mut stream = Stream::new(7, 3, 1);
        for _ in 0..count {
            let x = stream.uniform();
            assert!((0.0..1.0).contains(&x));
            mean += x / f64::from(count);
            square += x * x / f64::from(count);
        }
        // 4 standard errors: sqrt(1/12 / 20000) = 0.002, sqrt(4/45 / 20000) = 0.0021.
        assert!((mean - 0.5).abs() < 0.0082, "{mean}");
        assert!((square - 1.0 / 3.0).abs() < 0.0085, "{square}");
        let first = |seed, id, purpose| Stream::new(seed, id, purpose).bits();
        let all = [
            first(7, 3, 1),
            first(8, 3, 1),
            first(7, 4, 1),
            first(7, 3, 2),
            first(7 << 32, 3, 1),
        ];
        for (k, a) in all.iter().enumerate() {
            assert!(all[k + 1..].iter().all(|b| a != b));
        }
    }
}
