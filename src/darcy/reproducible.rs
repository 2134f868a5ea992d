//! Dot products with the same bits for any order of the terms, at a few operations per term.
//!
//! A term is split at two fixed positions. `q = (x + s) - s` with `s = 1.5 · 2^k` is x rounded to a multiple of
//! 2^(k-52). With 2^k ≥ 2 N max|x| any partial sum of N such parts is exact, so that lanes, rows and ranks may add in
//! any order. The remainder of x is split in the same way with a smaller `s`. The two parts represent the sum to about
//! N^2 2^-104 of the largest term (J. Demmel and H. D. Nguyen, IEEE Trans. Comput. 64 (2015) 2060). A first pass finds
//! the largest term, which is also independent of the order.

use super::layout::{Layout, Part};
use base::number::real;
use decomposition::Communicator;

const LANES: usize = 8;

/// Returns the sum of `a[i] b[i]` over the cells of all ranks' parts, the same bits however they are cut. Collective.
pub(super) fn dot<B: Copy + Into<f64>>(
    (layout, part): (&Layout, &Part),
    a: &[f64],
    b: &[B],
    communicator: &Communicator,
) -> f64 {
    let mut largest = 0.0_f64;
    let mut bad = false;
    for row in layout.rows(part) {
        let (row_largest, row_bad) = largest_term(&a[row.clone()], &b[row]);
        largest = largest.max(row_largest);
        bad |= row_bad;
    }
    // A maximum would lose a NaN.
    let largest = communicator.all_reduce_max_f64(if bad { f64::INFINITY } else { largest });
    if !largest.is_finite() {
        return f64::NAN;
    }
    if largest <= 0.0 {
        return 0.0;
    }
    let terms = real(layout.count().next_power_of_two());
    let coarse = 2.0 * terms * power_above(largest);
    // The remainder of a term is at most half a step of the coarse part, which is 2^-52 of `coarse`.
    let fine = 2.0 * terms * coarse * 2.0_f64.powi(-53);
    if !coarse.is_finite() || fine * 2.0_f64.powi(-52) < f64::MIN_POSITIVE {
        return f64::NAN;
    }
    let (s, t) = (1.5 * coarse, 1.5 * fine);
    let mut sums = [[0.0_f64; LANES]; 2];
    for row in layout.rows(part) {
        split_sum(&a[row.clone()], &b[row], s, t, &mut sums);
    }
    let unit = |place: f64| place * 2.0_f64.powi(-52);
    let mut steps = [
        to_steps(sums[0].iter().sum::<f64>() / unit(coarse)),
        to_steps(sums[1].iter().sum::<f64>() / unit(fine)),
    ];
    communicator.all_reduce_sum_i64s(&mut steps);
    from_steps(steps[0]) * unit(coarse) + from_steps(steps[1]) * unit(fine)
}

#[inline]
fn largest_term<B: Copy + Into<f64>>(a: &[f64], b: &[B]) -> (f64, bool) {
    let mut lanes = [0.0_f64; LANES];
    let mut bad = [0.0_f64; LANES];
    each_product(a, b, |lane, x| {
        let size = x.abs();
        lanes[lane] = if size > lanes[lane] {
            size
        } else {
            lanes[lane]
        };
        // NaN and infinity times zero give NaN.
        bad[lane] += x * 0.0;
    });
    let largest = lanes.iter().fold(0.0, |m: f64, &x| m.max(x));
    (largest, bad.iter().any(|x| x.is_nan()))
}

#[inline]
fn split_sum<B: Copy + Into<f64>>(
    a: &[f64],
    b: &[B],
    s: f64,
    t: f64,
    sums: &mut [[f64; LANES]; 2],
) {
    each_product(a, b, |lane, x| {
        let high = (x + s) - s;
        let low = ((x - high) + t) - t;
        sums[0][lane] += high;
        sums[1][lane] += low;
    });
}

/// Passes each product of two lists to `take`, with its lane.
#[inline(always)]
fn each_product<B: Copy + Into<f64>>(a: &[f64], b: &[B], mut take: impl FnMut(usize, f64)) {
    let (a_all, b_all) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a_all.0.iter().zip(b_all.0) {
        for lane in 0..LANES {
            take(lane, a[lane] * b[lane].into());
        }
    }
    for (a, b) in a_all.1.iter().zip(b_all.1) {
        take(0, a * (*b).into());
    }
}

/// Returns the power of two above a finite positive number.
pub fn power_above(x: f64) -> f64 {
    let exponent = (x.to_bits() >> 52) & 0x7ff;
    f64::from_bits((exponent + 1).min(2046) << 52)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "whole and below 2^53 by the choice of the unit"
)]
fn to_steps(x: f64) -> i64 {
    x as i64
}

#[expect(
    clippy::cast_precision_loss,
    reason = "below 2^53 over all ranks by the choice of the unit"
)]
fn from_steps(x: i64) -> f64 {
    x as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::random::SplitMix;
    use decomposition::ExactSum;

    #[test]
    fn as_good_as_the_exact_sum_in_any_order() {
        let n = 999;
        let layout = Layout::new([n, 1, 1]);
        let mut draws = SplitMix::new(7);
        let mut a = vec![0.0; layout.len()];
        let mut b = vec![0.0; layout.len()];
        let part = layout.whole();
        let row = layout.rows(&part).next().unwrap();
        for i in row.clone() {
            let scale = 10.0_f64.powf(20.0 * draws.uniform() - 10.0);
            a[i] = (draws.uniform() - 0.5) * scale;
            b[i] = draws.uniform();
        }
        let mut exact = ExactSum::new();
        for i in row.clone() {
            exact.add_product(a[i], b[i]);
        }
        let serial = Communicator::serial();
        let sum = dot((&layout, &part), &a, &b, &serial);
        assert!((sum / exact.value() - 1.0).abs() < 1e-14);
        a[row.clone()].reverse();
        b[row].reverse();
        assert_eq!(
            sum.to_bits(),
            dot((&layout, &part), &a, &b, &serial).to_bits()
        );
    }

    #[test]
    fn what_is_not_finite_shows() {
        let layout = Layout::new([9, 1, 1]);
        let mut a = vec![1.0; layout.len()];
        let b = vec![1.0; layout.len()];
        let part = layout.whole();
        let at = layout.rows(&part).next().unwrap().start + 3;
        for bad in [f64::NAN, f64::INFINITY] {
            a[at] = bad;
            assert!(dot((&layout, &part), &a, &b, &Communicator::serial()).is_nan());
        }
        a.fill(0.0);
        assert_eq!(dot((&layout, &part), &a, &b, &Communicator::serial()), 0.0);
    }
}
