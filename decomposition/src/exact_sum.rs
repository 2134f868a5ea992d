//! Sums that are independent of the order of their terms, and therefore of the number of ranks and threads.
//!
//! - [`ExactSum`] adds any floats without rounding in an integer of 2240 bits and rounds once, at the
//!   end (U. Kulisch, Computer Arithmetic and Validity, 2nd ed., 2013, chapter 8). Digits of 32 bits
//!   are stored in words of 64, so that carries can be deferred (R. M. Neal, arXiv:1505.05571). It serves
//!   residuals, dot products and budgets.
//! - [`Fixed`] adds numbers of known size, below 2 in magnitude, in steps of 2^-62: one multiplication
//!   and one integer addition for each term. It serves the loads of many cells on one grain.

use crate::comm::Communicator;

/// Number of digits of the exact sum. The largest double is 2098 bits above the smallest; the other 142 bits allow
/// the sum of 2^140 such numbers.
const DIGITS: usize = 70;
/// Number of bits of a digit.
const DIGIT_BITS: u32 = 32;
const DIGIT_MASK: i64 = 0xffff_ffff;
/// Number of additions after which carries are propagated: each adds less than 2^32 to a digit.
const ADDITIONS_BEFORE_CARRY: u32 = 1 << 30;

/// Exact sum of floats, rounded once: the bits are independent of order and grouping.
///
/// The value is the correctly rounded sum (to nearest, ties to even), 0.0 for no terms and for
/// terms that cancel. NaN, or infinities of both signs, give NaN; infinities of one sign give that
/// infinity.
#[derive(Debug, Clone)]
pub struct ExactSum {
    /// Digits of the sum Σ digits\[i\] · 2^(32 i - 1074).
    digits: [i64; DIGITS],
    /// Number of additions since the last carry.
    additions: u32,
    nans: i64,
    positive_infinities: i64,
    negative_infinities: i64,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self::new()
    }
}

impl PartialEq for ExactSum {
    /// Returns `true` if the exact sums are equal, including digits that a float cannot represent.
    fn eq(&self, other: &Self) -> bool {
        let (mut one, mut two) = (self.clone(), other.clone());
        one.carry();
        two.carry();
        one.digits == two.digits && one.special().to_bits() == two.special().to_bits()
    }
}

impl ExactSum {
    /// Returns the empty sum.
    #[must_use]
    pub fn new() -> Self {
        Self {
            digits: [0; DIGITS],
            additions: 0,
            nans: 0,
            positive_infinities: 0,
            negative_infinities: 0,
        }
    }

    /// Adds one number, without rounding.
    #[inline]
    pub fn add(&mut self, value: f64) {
        const MANTISSA: u64 = (1 << 52) - 1;
        let bits = value.to_bits();
        let exponent = (bits >> 52) & 0x7ff;
        if exponent == 0x7ff {
            self.add_special(value);
            return;
        }
        // The value is ± mantissa · 2^(place - 1074); subnormal numbers have no leading one.
        let normal = exponent.min(1);
        let mantissa = (bits & MANTISSA) | (normal << 52);
        let place = exponent - normal;
        let first = digit_index(place);
        let shifted = u128::from(mantissa) << (place % u64::from(DIGIT_BITS));
        // With sign 0 or -1, x ^ sign - sign negates without a branch.
        let sign = bits.cast_signed() >> 63;
        for (place, digit) in self.digits[first..first + 3].iter_mut().enumerate() {
            *digit += (digit_of(shifted, place) ^ sign) - sign;
        }
        self.additions += 1;
        if self.additions >= ADDITIONS_BEFORE_CARRY {
            self.carry();
        }
    }

    /// Adds every number of a list.
    pub fn add_all(&mut self, values: &[f64]) {
        for &value in values {
            self.add(value);
        }
    }

    /// Adds a product without rounding, as for a dot product: the rounded product and its rounding
    /// error by one fused multiply-add. Exact unless the product overflows or falls below 2^-969,
    /// and in any case the same for any order of the terms.
    #[inline]
    pub fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(product);
        if product.is_finite() {
            self.add(a.mul_add(b, -product));
        }
    }

    #[cold]
    fn add_special(&mut self, value: f64) {
        if value.is_nan() {
            self.nans += 1;
        } else if value > 0.0 {
            self.positive_infinities += 1;
        } else {
            self.negative_infinities += 1;
        }
    }

    /// Adds another sum, without rounding.
    pub fn merge(&mut self, other: &Self) {
        let mut other = other.clone();
        other.carry();
        self.carry();
        for (mine, its) in self.digits.iter_mut().zip(&other.digits) {
            *mine += its;
        }
        self.additions += 1;
        self.nans += other.nans;
        self.positive_infinities += other.positive_infinities;
        self.negative_infinities += other.negative_infinities;
    }

    /// Replaces the sum by that over all ranks, the same on each; collective.
    pub fn all_reduce(&mut self, communicator: &Communicator) {
        self.carry();
        let mut words = [0; DIGITS + 3];
        words[..DIGITS].copy_from_slice(&self.digits);
        words[DIGITS..].copy_from_slice(&[
            self.nans,
            self.positive_infinities,
            self.negative_infinities,
        ]);
        communicator.all_reduce_sum_i64s(&mut words);
        self.digits.copy_from_slice(&words[..DIGITS]);
        self.nans = words[DIGITS];
        self.positive_infinities = words[DIGITS + 1];
        self.negative_infinities = words[DIGITS + 2];
        self.carry();
    }

    /// Propagates carries: afterwards all digits but the last are in 0..2^32 and the last has the sign, so that
    /// equal sums have equal digits.
    fn carry(&mut self) {
        let mut carry = 0;
        for digit in &mut self.digits[..DIGITS - 1] {
            let sum = *digit + carry;
            *digit = sum & DIGIT_MASK;
            carry = sum >> DIGIT_BITS;
        }
        self.digits[DIGITS - 1] += carry;
        // The remainder counts as one addition: each digit is below 2^32.
        self.additions = 1;
    }

    /// Returns the contribution of the terms that are not finite; 0 if all are finite.
    fn special(&self) -> f64 {
        match (
            self.nans > 0,
            self.positive_infinities > 0,
            self.negative_infinities > 0,
        ) {
            (false, false, false) => 0.0,
            (false, true, false) => f64::INFINITY,
            (false, false, true) => f64::NEG_INFINITY,
            _ => f64::NAN,
        }
    }

    /// Returns the sum, rounded to nearest (ties to even).
    #[must_use]
    pub fn value(&self) -> f64 {
        let special = self.special();
        if special.is_nan() || special.is_infinite() {
            return special;
        }
        let mut sum = self.clone();
        sum.carry();
        let negative = sum.digits[DIGITS - 1] < 0;
        if negative {
            for digit in &mut sum.digits {
                *digit = -*digit;
            }
            sum.carry();
        }
        let magnitude = sum.round();
        if negative { -magnitude } else { magnitude }
    }

    /// Returns the rounded sum of nonnegative digits, of which all but the last are below 2^32.
    fn round(&self) -> f64 {
        let Some(top) = self.digits.iter().rposition(|&digit| digit != 0) else {
            return 0.0;
        };
        let digit = |index: usize| -> u128 {
            let digit = self.digits.get(index);
            digit.map_or(0, |digit| u128::from(digit.cast_unsigned()))
        };
        // The digits are an integer of `length` bits, in units of 2^-1074; the lowest `drop` of them
        // do not fit into a mantissa.
        let digit_bits = DIGIT_BITS as usize;
        let length = digit_bits * top + bit_length(self.digits[top]);
        let drop = length.saturating_sub(53);
        let (first, shift) = (drop / digit_bits, drop % digit_bits);
        let kept =
            low_word((digit(first) | (digit(first + 1) << 32) | (digit(first + 2) << 64)) >> shift);
        let up = drop > 0 && {
            let (first, shift) = ((drop - 1) / digit_bits, (drop - 1) % digit_bits);
            let half = (digit(first) >> shift) & 1 == 1;
            let below = digit(first) & ((1 << shift) - 1) != 0
                || self.digits[..first].iter().any(|&digit| digit != 0);
            half && (below || kept & 1 == 1)
        };
        // Bit 52 of `kept`, set unless the number is subnormal, adds one to the exponent field; so
        // does a carry of the rounding into bit 53.
        let encoded = ((drop as u64) << 52) + kept + u64::from(up);
        f64::from_bits(encoded.min(f64::INFINITY.to_bits()))
    }
}

/// Number of steps of [`Fixed`] in 1: 2^62.
const STEPS: f64 = 4_611_686_018_427_387_904.0;
/// Twice 2^62: the smallest magnitude that is out of range.
const STEPS_LIMIT: f64 = 2.0 * STEPS;

/// Returns `value` in steps of 2^-62, rounded towards zero: 1.0 is 2^62. For |value| < 2.
///
/// Outside that range the result is `i64::MAX` or `-i64::MAX`, for NaN it is `i64::MIN`; no number in
/// the range gives one of these, so a guard can see them, and [`Fixed`] does.
#[inline]
#[must_use]
pub fn quantise(value: f64) -> i64 {
    let steps = value * STEPS;
    // The comparison is false for NaN.
    if steps.abs() < STEPS_LIMIT {
        // SAFETY: finite, and its magnitude is below 2^63.
        unsafe { steps.to_int_unchecked() }
    } else {
        out_of_range(value)
    }
}

#[cold]
fn out_of_range(value: f64) -> i64 {
    if value.is_nan() {
        i64::MIN
    } else if value > 0.0 {
        i64::MAX
    } else {
        -i64::MAX
    }
}

/// Sum in fixed point, in steps of 2^-62: the bits are independent of order and grouping. It has capacity for 2^62
/// terms below 2 in magnitude; a term out of range or NaN makes the sum permanently invalid.
///
/// Plain data of 16 bytes, to be packed into messages and added with [`Fixed::merge`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Fixed(i128);

impl Fixed {
    /// Empty sum.
    pub const ZERO: Self = Self(0);
    /// Sum with a term out of range; a value that valid terms cannot reach.
    pub const INVALID: Self = Self(i128::MIN);

    /// Adds one number below 2 in magnitude, rounded towards zero to 2^-62.
    #[inline]
    pub fn add(&mut self, value: f64) {
        self.add_quantised(quantise(value));
    }

    /// Adds a number that [`quantise`] has converted to steps.
    #[inline]
    pub fn add_quantised(&mut self, steps: i64) {
        if steps.unsigned_abs() >= i64::MAX.unsigned_abs() {
            *self = Self::INVALID;
        } else {
            self.merge(Self(i128::from(steps)));
        }
    }

    /// Adds another sum.
    #[inline]
    pub fn merge(&mut self, other: Self) {
        if *self == Self::INVALID || other == Self::INVALID {
            *self = Self::INVALID;
        } else {
            self.0 = self.0.wrapping_add(other.0);
        }
    }

    /// Returns `true` if all terms were in range.
    #[must_use]
    pub fn is_valid(self) -> bool {
        self != Self::INVALID
    }

    /// Returns the sum in steps of 2^-62.
    #[must_use]
    pub fn steps(self) -> i128 {
        self.0
    }

    /// Returns the sum, rounded to nearest; NaN if it is invalid.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        if self.is_valid() {
            nearest(self.0) / STEPS
        } else {
            f64::NAN
        }
    }

    /// Replaces each sum by that over all ranks, the same on each; collective, with the same number
    /// of sums on each rank.
    pub fn all_reduce(sums: &mut [Self], communicator: &Communicator) {
        const CHUNK: usize = 64;
        let mut values = [0_u128; CHUNK];
        let mut invalid = [0_i64; CHUNK];
        for chunk in sums.chunks_mut(CHUNK) {
            for (index, sum) in chunk.iter().enumerate() {
                values[index] = sum.0.cast_unsigned();
                invalid[index] = i64::from(!sum.is_valid());
            }
            communicator.all_reduce_sum_u128s(&mut values[..chunk.len()]);
            communicator.all_reduce_sum_i64s(&mut invalid[..chunk.len()]);
            for (index, sum) in chunk.iter_mut().enumerate() {
                *sum = if invalid[index] > 0 {
                    Self::INVALID
                } else {
                    Self(values[index].cast_signed())
                };
            }
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a place is below 2048, so its digit is below 64"
)]
#[inline]
fn digit_index(place: u64) -> usize {
    (place / DIGIT_BITS as u64) as usize
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the mask leaves 32 bits of the number"
)]
#[inline]
fn digit_of(value: u128, place: usize) -> i64 {
    ((value >> (DIGIT_BITS as usize * place)) as i64) & DIGIT_MASK
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "called with numbers of at most 54 bits"
)]
fn low_word(value: u128) -> u64 {
    value as u64
}

#[expect(
    clippy::cast_precision_loss,
    reason = "the cast rounds to nearest, which is what is wanted"
)]
fn nearest(value: i128) -> f64 {
    value as f64
}

/// Returns the position of the highest set bit, counted from 1; 0 for zero.
fn bit_length(value: i64) -> usize {
    (i64::BITS - value.leading_zeros()) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(values: &[f64]) -> f64 {
        let mut sum = ExactSum::new();
        sum.add_all(values);
        sum.value()
    }

    fn assert_bits(left: f64, right: f64) {
        assert_eq!(
            left.to_bits(),
            right.to_bits(),
            "{left:e} against {right:e}"
        );
    }

    /// Returns the exact sum by another method: a list of nonoverlapping floats (Shewchuk, Discrete Comput Geom 18,
    /// 305 (1997)), rounded as in Python's `math.fsum`.
    fn expansion_sum(values: &[f64]) -> f64 {
        let mut parts: Vec<f64> = Vec::new();
        for &value in values {
            let mut x = value;
            let mut kept = Vec::new();
            for &part in &parts {
                let (mut large, mut small) = (x, part);
                if large.abs() < small.abs() {
                    (large, small) = (small, large);
                }
                let high = large + small;
                let low = small - (high - large);
                if low != 0.0 {
                    kept.push(low);
                }
                x = high;
            }
            kept.push(x);
            parts = kept;
        }
        let mut high = parts.pop().unwrap_or(0.0);
        let mut low = 0.0;
        while let Some(part) = parts.pop() {
            let x = high;
            high = x + part;
            low = part - (high - x);
            if low != 0.0 {
                break;
            }
        }
        if let Some(&next) = parts.last()
            && ((low < 0.0 && next < 0.0) || (low > 0.0 && next > 0.0))
        {
            // The remainder decides a tie.
            let twice = 2.0 * low;
            let x = high + twice;
            #[expect(clippy::float_cmp, reason = "asks whether the addition was exact")]
            if twice == x - high {
                high = x;
            }
        }
        high + 0.0
    }

    #[test]
    fn hard_sums_are_correctly_rounded() {
        let two_53 = 9_007_199_254_740_992.0_f64;
        assert_bits(sum(&[]), 0.0);
        assert_bits(sum(&[-0.0, -0.0]), 0.0);
        assert_bits(sum(&[1e308, 1e308, -1e308]), 1e308);
        assert_bits(sum(&[f64::MAX, f64::MAX]), f64::INFINITY);
        assert_bits(sum(&[-f64::MAX, -f64::MAX]), f64::NEG_INFINITY);
        assert_bits(sum(&[f64::MAX, -f64::MAX, 5e-324]), 5e-324);
        // Ties are rounded to even, and the smallest number decides a tie.
        assert_bits(sum(&[two_53, 1.0]), two_53);
        assert_bits(sum(&[two_53 + 2.0, 1.0]), two_53 + 4.0);
        assert_bits(sum(&[two_53, 1.0, 5e-324]), two_53 + 2.0);
        assert_bits(sum(&[two_53, 1.0, -5e-324]), two_53);
        assert_bits(sum(&[-two_53, -1.0, -5e-324]), -two_53 - 2.0);
        // Half a unit above the largest float rounds to infinity; a smaller excess does not.
        let half = f64::MAX * f64::EPSILON / 4.0;
        assert_bits(sum(&[f64::MAX, half * (1.0 - f64::EPSILON)]), f64::MAX);
        assert_bits(sum(&[f64::MAX, 2.0_f64.powi(970)]), f64::INFINITY);
        // Subnormal numbers, up to their upper limit.
        assert_bits(sum(&[5e-324; 7]), f64::from_bits(7));
        let subnormal = f64::MIN_POSITIVE.next_down();
        assert_bits(sum(&[subnormal, 5e-324]), f64::MIN_POSITIVE);
        assert_bits(sum(&[subnormal, subnormal]), 2.0 * subnormal);
        let mut power = 5e-324;
        while power < f64::INFINITY {
            assert_bits(sum(&[power]), power);
            assert_bits(sum(&[-power, 0.0]), -power);
            power *= 2.0;
        }
    }

    #[test]
    fn nan_and_infinity_are_not_lost() {
        assert_bits(sum(&[1.0, f64::INFINITY, -3.0]), f64::INFINITY);
        assert_bits(sum(&[f64::NEG_INFINITY, f64::MAX]), f64::NEG_INFINITY);
        assert!(sum(&[f64::INFINITY, f64::NEG_INFINITY]).is_nan());
        assert!(sum(&[1.0, f64::NAN]).is_nan());
        let mut lost = ExactSum::new();
        lost.add(f64::NAN);
        let mut total = ExactSum::new();
        total.add(1.0);
        total.merge(&lost);
        assert!(total.value().is_nan());
    }

    #[test]
    fn carries_come_in_time() {
        // State after many additions of the largest digit; the next addition must propagate the carries.
        let mut total = ExactSum::new();
        total.add(1.0);
        let before = total.clone();
        total.additions = ADDITIONS_BEFORE_CARRY - 1;
        total.digits[0] = DIGIT_MASK * i64::from(ADDITIONS_BEFORE_CARRY - 1);
        total.add(-1.0);
        assert_eq!(total.additions, 1);
        assert!(
            total
                .digits
                .iter()
                .all(|&digit| (0..=DIGIT_MASK).contains(&digit))
        );
        assert!(total != before);
        // Σ = (2^32 - 1) (2^30 - 1) units of 2^-1074.
        let units = 4_294_967_295.0 * 1_073_741_823.0;
        assert_bits(total.value(), units * f64::from_bits(1));
        // Merging without adding also keeps the digits small.
        for _ in 0..200 {
            let copy = total.clone();
            total.merge(&copy);
        }
        assert_bits(total.value(), units * f64::from_bits(1) * 2.0_f64.powi(200));
    }

    #[test]
    fn products_are_added_exactly() {
        let (a, b) = (1.0 + f64::EPSILON, 1.0 - f64::EPSILON);
        let mut dot = ExactSum::new();
        dot.add_product(a, b);
        dot.add(-1.0);
        assert_bits(dot.value(), -f64::EPSILON * f64::EPSILON);
    }

    #[test]
    fn quantised_numbers_stay_in_range() {
        assert_eq!(quantise(1.0), 1 << 62);
        assert_eq!(quantise(-1.5), -(3 << 61));
        assert_eq!(quantise(2.0_f64.powi(-62)), 1);
        assert_eq!(quantise(2.0_f64.powi(-62) * 1.75), 1);
        assert_eq!(quantise(-(2.0_f64.powi(-62)) * 1.75), -1);
        assert_eq!(quantise(2.0_f64.next_down()), i64::MAX - 1023);
        assert_eq!(quantise((-2.0_f64).next_up()), -(i64::MAX - 1023));
        for large in [2.0, 3.0, 1e300, f64::INFINITY] {
            assert_eq!(quantise(large), i64::MAX);
            assert_eq!(quantise(-large), -i64::MAX);
        }
        assert_eq!(quantise(f64::NAN), i64::MIN);
    }

    #[test]
    fn an_invalid_term_is_never_forgotten() {
        for wrong in [f64::NAN, 2.0, -2.0, f64::INFINITY] {
            let mut load = Fixed::ZERO;
            load.add(0.5);
            load.add(wrong);
            load.add(-0.5);
            assert!(!load.is_valid());
            assert!(load.to_f64().is_nan());
            let mut total = Fixed::default();
            total.merge(load);
            Fixed::all_reduce(std::slice::from_mut(&mut total), &Communicator::serial());
            assert!(!total.is_valid());
        }
        let mut load = Fixed::ZERO;
        load.add(1.5);
        load.add(1.5);
        load.add(-0.25);
        assert_bits(load.to_f64(), 2.75);
        assert_eq!(load.steps(), 11 << 60);
    }

    fn any_finite() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<f64>().prop_filter("finite", |value| value.is_finite()),
            -1e3..1e3,
            (any::<i32>(), -40..40).prop_map(|(m, e)| f64::from(m) * 2.0_f64.powi(e)),
        ]
    }

    proptest! {
        #[test]
        fn agrees_with_integers(terms in prop::collection::vec((-1_i64 << 53..1 << 53, 0_u32..64), 0..60)) {
            let values: Vec<f64> = terms
                .iter()
                .map(|&(mantissa, exponent)| nearest(i128::from(mantissa) << exponent))
                .collect();
            let exact: i128 = terms.iter().map(|&(m, e)| i128::from(m) << e).sum();
            prop_assert_eq!(sum(&values).to_bits(), nearest(exact).to_bits());
        }

        #[test]
        fn agrees_with_expansions(values in prop::collection::vec(any_finite(), 0..40)) {
            // Expansions overflow in intermediate results where the exact sum does not.
            let values: Vec<f64> = values.iter().map(|value| value / 64.0).collect();
            prop_assert_eq!(sum(&values).to_bits(), expansion_sum(&values).to_bits());
        }

        #[test]
        fn any_order_and_any_partition_give_the_same_bits(
            (values, shuffled, owners) in prop::collection::vec(any_finite(), 1..60)
                .prop_flat_map(|values| {
                    let owners = prop::collection::vec(0_usize..4, values.len());
                    (Just(values.clone()), Just(values).prop_shuffle(), owners)
                })
        ) {
            let mut parts = vec![ExactSum::new(); 4];
            let mut fixed = [Fixed::ZERO; 4];
            for (value, &owner) in shuffled.iter().zip(&owners) {
                parts[owner].add(*value);
                fixed[owner].add((value * 1e-3).clamp(-1.9, 1.9));
            }
            let mut total = parts.pop().unwrap();
            for part in parts.iter().rev() {
                total.merge(part);
            }
            prop_assert_eq!(total.value().to_bits(), sum(&values).to_bits());
            let mut whole = ExactSum::new();
            whole.add_all(&values);
            prop_assert!(total == whole);

            let mut fixed_whole = Fixed::ZERO;
            let mut steps = 0_i128;
            for value in &values {
                let value = (value * 1e-3).clamp(-1.9, 1.9);
                fixed_whole.add(value);
                steps += i128::from(quantise(value));
            }
            let mut fixed_total = Fixed::ZERO;
            fixed.iter().for_each(|&part| fixed_total.merge(part));
            prop_assert_eq!(fixed_total, fixed_whole);
            prop_assert_eq!(fixed_total.steps(), steps);
        }

        #[test]
        fn quantised_within_one_step(value in -2.0_f64..2.0) {
            let back = nearest(i128::from(quantise(value))) / STEPS;
            prop_assert!((back - value).abs() < 1.0 / STEPS);
            prop_assert!(back.abs() <= value.abs());
        }
    }
}
