//! Motion of the grains in every cell, as the water between them meets it.
//!
//! The mean over the volume of the grains in a cell,
//!
//! ```text
//! <x> = sum_i w_i V_i x_i / sum_i w_i V_i        w_i: the part of grain i in the cell
//! ```
//!
//! is taken of the velocity \[m/s\], of the gain of velocity until the next coupling \[m/s\], and of the volume over the mass of grains
//! that forces move \[m3/kg\], which is 0 for all others. All are 0 in cells without grains.
//!
//! Sums are integers: they do not depend on the order of grains or ranks. Their step is 2^-62 of a power of two above the largest
//! value on any rank.

use super::reproducible::power_above;
use crate::number::real;
use decomposition::{Communicator, quantise};

/// Numbers that are summed in each cell: volume, velocity, gain of velocity, volume over mass.
const SUMS: usize = 8;

/// A grain as the motion of the bed counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moving {
    /// Velocity \[m/s\].
    pub velocity: [f64; 3],
    /// What the velocity gains until the next coupling \[m/s\].
    pub gain: [f64; 3],
    /// Volume over mass \[m3/kg\]; 0 where forces do not move the grain.
    pub lightness: f64,
}

impl Moving {
    /// The largest speed along an axis \[m/s\], and the volume over the mass.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        let speeds = self.velocity.iter().chain(&self.gain);
        let speed = speeds.fold(0.0_f64, |most, v| {
            if v.is_finite() {
                most.max(v.abs())
            } else {
                f64::INFINITY
            }
        });
        [speed, self.lightness]
    }
}

/// The means of all cells.
#[derive(Clone, Debug)]
pub struct BedMotion {
    /// Units of the sums: of speeds \[m/s\] and of volumes over masses \[m3/kg\].
    units: [f64; 2],
    sums: Vec<[i128; SUMS]>,
    words: Vec<u128>,
    velocity: Vec<[f64; 3]>,
    gain: Vec<[f64; 3]>,
    lightness: Vec<f64>,
}

impl BedMotion {
    /// A number of cells without grains.
    #[must_use]
    pub fn new(cells: usize) -> Self {
        Self {
            units: [1.0; 2],
            sums: vec![[0; SUMS]; cells],
            words: vec![0; SUMS * cells],
            velocity: vec![[0.0; 3]; cells],
            gain: vec![[0.0; 3]; cells],
            lightness: vec![0.0; cells],
        }
    }

    /// Forgets all grains. `largest` is the largest [`Moving::size`] of the grains of this rank. Collective.
    ///
    /// # Errors
    /// Where a velocity is not finite, on every rank.
    pub fn clear(
        &mut self,
        largest: [f64; 2],
        communicator: &Communicator,
    ) -> Result<(), super::Error> {
        for (unit, largest) in self.units.iter_mut().zip(largest) {
            let most = communicator.all_reduce_max_f64(largest);
            if !most.is_finite() {
                return Err(super::Error::NotFinite("the velocity of a grain"));
            }
            *unit = if most > 0.0 { power_above(most) } else { 1.0 };
        }
        self.sums.fill([0; SUMS]);
        Ok(())
    }

    /// Adds a grain with its parts in cells and its volume over that of a cell.
    pub fn add(&mut self, parts: &[(usize, f64)], volume: f64, moving: &Moving) {
        let [u, l] = self.units;
        let [v, w] = [moving.velocity, moving.gain];
        for &(cell, part) in parts {
            let weight = part * volume;
            let terms = [
                1.0,
                v[0] / u,
                v[1] / u,
                v[2] / u,
                w[0] / u,
                w[1] / u,
                w[2] / u,
                moving.lightness / l,
            ];
            for (sum, term) in self.sums[cell].iter_mut().zip(terms) {
                *sum += i128::from(quantise(weight * term));
            }
        }
    }

    /// Sums over the ranks and divides by the volumes. Collective.
    pub fn finish(&mut self, communicator: &Communicator) {
        for (words, sums) in self.words.as_chunks_mut().0.iter_mut().zip(&self.sums) {
            *words = sums.map(i128::cast_unsigned);
        }
        communicator.all_reduce_sum_u128s(&mut self.words);
        let [u, l] = self.units;
        for (cell, words) in self.words.as_chunks::<SUMS>().0.iter().enumerate() {
            let sums = words.map(|word| real(word.cast_signed()));
            let mean = |n: usize, unit: f64| {
                if sums[0] > 0.0 {
                    unit * (sums[n] / sums[0])
                } else {
                    0.0
                }
            };
            self.velocity[cell] = [1, 2, 3].map(|n| mean(n, u));
            self.gain[cell] = [4, 5, 6].map(|n| mean(n, u));
            self.lightness[cell] = mean(7, l);
        }
    }

    /// Mean velocity in each cell \[m/s\].
    #[must_use]
    pub fn velocity(&self) -> &[[f64; 3]] {
        &self.velocity
    }

    /// Mean gain of velocity in each cell \[m/s\].
    #[must_use]
    pub fn gain(&self) -> &[[f64; 3]] {
        &self.gain
    }

    /// Mean volume over mass in each cell \[m3/kg\].
    #[must_use]
    pub fn lightness(&self) -> &[f64] {
        &self.lightness
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_weighted_by_volume() {
        let mut motion = BedMotion::new(2);
        let serial = Communicator::serial();
        let a = Moving {
            velocity: [1.0, -2.0, 0.5],
            gain: [0.0, 0.25, 0.0],
            lightness: 4e-4,
        };
        let b = Moving {
            velocity: [4.0, 0.0, 0.0],
            ..Moving::default()
        };
        let most = [a.size(), b.size()];
        assert_eq!(most, [[2.0, 4e-4], [4.0, 0.0]]);
        motion.clear([4.0, 4e-4], &serial).unwrap();
        motion.add(&[(0, 0.5), (1, 0.5)], 0.02, &a);
        motion.add(&[(0, 1.0)], 0.03, &b);
        motion.finish(&serial);
        assert!((motion.velocity()[0][0] - (0.01 * 1.0 + 0.03 * 4.0) / 0.04).abs() < 1e-14);
        assert!((motion.gain()[0][1] - 0.25 * 0.25).abs() < 1e-15);
        assert!((motion.lightness()[0] - 1e-4).abs() < 1e-18);
        for (mean, own) in motion.velocity()[1].iter().zip(a.velocity) {
            assert!((mean - own).abs() < 1e-14);
        }
        let bad = Moving {
            velocity: [f64::NAN, 0.0, 0.0],
            ..Moving::default()
        };
        assert!(motion.clear(bad.size(), &serial).is_err());
    }
}
