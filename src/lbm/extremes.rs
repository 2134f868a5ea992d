//! The extreme values of each row of a slab, found by all threads, to locate values that are not finite or exceed a
//! limit.

use super::fluid::Fluid;
use super::lanes::Stored;
use super::populations::Populations;
use super::surface::SlabSurface;
use base::thread_pool;

/// Extreme values of the rows of a slab, in the order of [`Populations::rows`]; a reusable buffer.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    threads: Vec<Share>,
}

/// Rows of one thread.
#[derive(Clone, Debug, Default)]
struct Share {
    /// Moments of a row.
    work: [Vec<f64>; 4],
    found: Vec<Extremes>,
}

impl Rows {
    /// Checks every row.
    pub fn check<S: Stored>(&mut self, fluid: &Fluid<S>) {
        if let Some(found) = fluid.extremes_on_gpu() {
            self.threads.resize_with(1, Share::default);
            self.threads[0].found = found;
            return;
        }
        let populations = fluid.populations();
        let [slow, middle, fast] = populations.order();
        let cells = populations.cells();
        if fluid.corrects_velocities() {
            self.threads.resize_with(1, Share::default);
            let Share { work, found } = &mut self.threads[0];
            found.clear();
            let rows = populations.rows();
            found.extend(rows.map(|(_, cell)| fluid.row_extremes(cell, cells[fast], work)));
            return;
        }
        let half = fluid.half_force();
        let wet = fluid.surface().map(SlabSurface::planes);
        let rows = cells[slow] * cells[middle];
        let pieces = thread_pool::threads().min(cells[slow]).max(1);
        self.threads.resize_with(pieces, Share::default);
        thread_pool::each_item(&mut self.threads, 1, |piece, share| {
            share.found.clear();
            for row in rows * piece / pieces..rows * (piece + 1) / pieces {
                let mut at = [0; 3];
                (at[slow], at[middle]) = (row / cells[middle], row % cells[middle]);
                // Rows of gas contain no water to check.
                if wet.is_some_and(|planes| planes[at[slow]].is_dry(at[middle])) {
                    share.found.push(Extremes::AT_REST);
                    continue;
                }
                let first = populations.interior_cell(at);
                let found = populations.row_extremes(first, cells[fast], half, &mut share.work);
                share.found.push(found);
            }
        });
    }

    /// Returns the extreme values of each row.
    pub fn iter(&self) -> impl Iterator<Item = &Extremes> {
        self.threads.iter().flat_map(|share| &share.found)
    }
}

impl<S: Stored> Populations<S> {
    /// Computes the moments of a row like [`Self::row_moments`], and the extreme values of its cells, with `half`
    /// of the body force in the momentum.
    #[inline(never)]
    pub fn row_extremes(
        &self,
        cell: usize,
        length: usize,
        half: [f64; 3],
        moments: &mut [Vec<f64>; 4],
    ) -> Extremes {
        self.row_moments(cell, length, moments);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has these instructions.
            return unsafe { extremes_avx2(moments, half) };
        }
        extremes(moments, half)
    }
}

/// Returns the extreme values of cells from their density deviations and velocities.
pub(super) fn of_velocities([drho, u, v, w]: &[Vec<f64>; 4]) -> Extremes {
    let mut found = Extremes::AT_REST;
    for ((drho, u), (v, w)) in drho.iter().zip(u).zip(v.iter().zip(w)) {
        let squared = u * u + v * v + w * w;
        found.squared_speed = found.squared_speed.max(squared);
        found.compression = found.compression.max(drho.abs());
        found.finite &= drho.is_finite() && squared.is_finite();
    }
    found
}

/// Extreme values of the cells of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Largest squared speed.
    pub squared_speed: f64,
    /// Largest absolute density deviation.
    pub compression: f64,
    /// `true` if every number is finite.
    pub finite: bool,
}

impl Extremes {
    /// Values of cells without water.
    const AT_REST: Self = Self {
        squared_speed: 0.0,
        compression: 0.0,
        finite: true,
    };
}

/// Returns the squared speed of a cell from its density deviation, its momentum and half of the body force. There
/// is a single formula, so that the result of a cell has the same bits alone and in its row.
#[inline(always)]
#[must_use]
pub fn squared_speed(drho: f64, momentum: [f64; 3], half: [f64; 3]) -> f64 {
    let m: [f64; 3] = std::array::from_fn(|a| momentum[a] + half[a]);
    (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / ((1.0 + drho) * (1.0 + drho))
}

/// Number of cells compared at a time.
const AT_ONCE: usize = 8;

#[inline(always)]
fn extremes(moments: &[Vec<f64>; 4], half: [f64; 3]) -> Extremes {
    let [drho, m @ ..] = moments;
    let (mut fastest, mut squeezed) = ([0.0_f64; AT_ONCE], [0.0_f64; AT_ONCE]);
    // A product with 0 is 0 for finite numbers and NaN otherwise; comparisons would ignore NaN.
    let mut zero = [0.0_f64; AT_ONCE];
    let mut look = |k: usize, d: f64, m: [f64; 3]| {
        let squared = squared_speed(d, m, half);
        fastest[k] = if squared > fastest[k] {
            squared
        } else {
            fastest[k]
        };
        squeezed[k] = if d.abs() > squeezed[k] {
            d.abs()
        } else {
            squeezed[k]
        };
        zero[k] += 0.0 * squared;
    };
    let chunks = |row: &Vec<f64>| row.len() / AT_ONCE * AT_ONCE;
    let whole = chunks(drho);
    let parts = drho[..whole]
        .chunks_exact(AT_ONCE)
        .zip(m[0].chunks_exact(AT_ONCE))
        .zip(m[1].chunks_exact(AT_ONCE).zip(m[2].chunks_exact(AT_ONCE)));
    for ((d, x), (y, z)) in parts {
        for k in 0..AT_ONCE {
            look(k, d[k], [x[k], y[k], z[k]]);
        }
    }
    for n in whole..drho.len() {
        look(n - whole, drho[n], [m[0][n], m[1][n], m[2][n]]);
    }
    Extremes {
        squared_speed: fastest.into_iter().fold(0.0, f64::max),
        compression: squeezed.into_iter().fold(0.0, f64::max),
        finite: zero.into_iter().sum::<f64>() == 0.0,
    }
}

/// Computes the extremes with four lanes.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn extremes_avx2(moments: &[Vec<f64>; 4], half: [f64; 3]) -> Extremes {
    extremes(moments, half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{D3Q19, Velocities};

    #[test]
    fn extremes_of_a_row_are_those_of_its_cells() {
        let velocities = Velocities::for_lattice::<D3Q19, 19>();
        let mut lattice = Populations::<f64>::new(velocities, [21, 4, 3], 2).unwrap();
        for (n, number) in (0_u32..).zip(lattice.numbers_mut()) {
            *number = f64::from(n.wrapping_mul(2_654_435_761)) * 1e-12 - 2e-3;
        }
        let half = [1e-4, -2e-4, 3e-4];
        let fast = lattice.order()[2];
        let mut row = <[Vec<f64>; 4]>::default();
        let first = lattice.interior_cell([0, 2, 1]);
        let place = lattice.slot(first + 5, 7);
        for poison in [None, Some(f64::NAN), Some(f64::INFINITY)] {
            if let Some(poison) = poison {
                lattice.numbers_mut()[place] = poison;
            }
            let found = lattice.row_extremes(first, lattice.cells()[fast], half, &mut row);
            assert_eq!(found.finite, poison.is_none());
            if poison.is_some() {
                continue;
            }
            let (mut fastest, mut squeezed) = (0.0_f64, 0.0_f64);
            for k in 0..lattice.cells()[fast] {
                let (d, m) = lattice.moments(first + k);
                fastest = fastest.max(squared_speed(d, m, half));
                squeezed = squeezed.max(d.abs());
            }
            assert_eq!(found.squared_speed.to_bits(), fastest.to_bits());
            assert_eq!(found.compression.to_bits(), squeezed.to_bits());
        }
    }
}
