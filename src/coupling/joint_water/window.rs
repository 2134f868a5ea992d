//! Several steps of a lattice for each step of the joints.
//!
//! The means of the pressures at the mouths and of the loads on the blocks over the steps of the lattice drive a step
//! of the joints at the end of these steps. The water that leaves a mouth in it returns to the lattice in equal parts
//! in as many steps of the lattice, the first one at the end of the present step. Several steps need fixed blocks.

use super::JointWater;
use base::number::{real, whole};
use nalgebra::Vector3;

/// Number of values of a window in a checkpoint without those of mouths and blocks.
const COUNTS: usize = 4;
/// Number of values of a mouth and of a block in a checkpoint.
const MOUTH_VALUES: usize = 2;
const BLOCK_VALUES: usize = 12;
/// Value in a checkpoint for a mouth without water: no pressure.
const NO_WATER: f64 = f64::MAX;

/// Forces and torques of a lattice on the blocks.
type BlockLoads = Vec<[Vector3<f64>; 2]>;

/// Steps of a lattice in a step of the joints.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Number of steps of the lattice in a step of the joints.
    length: u64,
    /// Number of steps of the lattice since the last step of the joints.
    passed: u64,
    /// Number of steps of the lattice in which water of the last step of the joints still returns.
    left: u64,
    /// Sums over the steps of the lattice: pressures in front of the mouths \[Pa\], none at a mouth without water in
    /// one of the steps, and loads on the blocks.
    fronts: Vec<Option<f64>>,
    loads: BlockLoads,
    /// `true` for each mouth with water in front of it in the last step of the lattice.
    open: Vec<bool>,
}

impl Window {
    /// Returns the window of a number of steps of the lattice, at least 1, before the first step.
    pub(super) fn new(length: u64) -> Self {
        Self {
            length: length.max(1),
            passed: 0,
            left: 1,
            fronts: Vec::new(),
            loads: Vec::new(),
            open: Vec::new(),
        }
    }

    /// Returns `true` if the joints make a step after the present step of the lattice.
    pub(super) fn is_due(&self) -> bool {
        self.passed == 0
    }

    /// Adds the pressures at the mouths and the loads on the blocks in a step of the lattice. Returns their means if
    /// the joints make a step after it.
    pub(super) fn add(
        &mut self,
        fronts: Vec<Option<f64>>,
        loads: BlockLoads,
    ) -> Option<(Vec<Option<f64>>, BlockLoads)> {
        self.open = fronts.iter().map(Option::is_some).collect();
        if self.passed == 0 {
            (self.fronts, self.loads) = (fronts, loads);
        } else {
            for (sum, front) in self.fronts.iter_mut().zip(fronts) {
                *sum = sum.zip(front).map(|(sum, front)| sum + front);
            }
            for (sum, load) in self.loads.iter_mut().zip(loads) {
                for (sum, load) in sum.iter_mut().zip(load) {
                    *sum += load;
                }
            }
        }
        self.passed += 1;
        if self.passed < self.length {
            return None;
        }
        self.passed = 0;
        self.left = self.length;
        let count = real(self.length);
        let mut means = (
            std::mem::take(&mut self.fronts),
            std::mem::take(&mut self.loads),
        );
        for front in means.0.iter_mut().flatten() {
            *front /= count;
        }
        for load in means.1.iter_mut().flatten() {
            *load /= count;
        }
        Some(means)
    }

    /// Returns `true` for a mouth with water in front of it.
    pub(super) fn is_open(&self, mouth: usize) -> bool {
        self.open.get(mouth).copied().unwrap_or(false)
    }

    /// Takes the parts of volumes of water that return in this step of the lattice \[m³\]: those of open mouths. None
    /// return before the first step of a run or after a restart, when the bodies are mapped without a step.
    fn take_parts(&mut self, volumes: &mut [(usize, f64)]) -> Vec<(usize, f64)> {
        if self.open.is_empty() {
            return Vec::new();
        }
        let count = real(self.left);
        self.left = (self.left - 1).max(1);
        let mut parts = Vec::with_capacity(volumes.len());
        for (mouth, volume) in volumes {
            if self.is_open(*mouth) {
                let part = *volume / count;
                *volume -= part;
                parts.push((*mouth, part));
            }
        }
        parts
    }
}

impl JointWater {
    /// Returns the number of steps of a lattice in a step of the joints.
    #[must_use]
    pub fn lattice_steps(&self) -> u64 {
        self.window.length
    }

    /// Returns `true` if the joints make a step after the present step of the lattice.
    #[must_use]
    pub fn is_due(&self) -> bool {
        self.window.is_due()
    }

    /// Takes the water that returns to the lattice in the present step of it: mouths, and volumes at the density of
    /// atmospheric pressure \[m³\]. The indices of the mouths are those of the pressures of that step.
    pub fn take_returning(&mut self) -> Vec<(usize, f64)> {
        self.window.take_parts(&mut self.returned)
    }

    /// Returns the volume of water that has left the joints and has not returned to the lattice yet \[m³\].
    #[must_use]
    pub fn on_its_way(&self) -> f64 {
        self.returned.iter().map(|(_, volume)| volume).sum()
    }

    /// Appends the state of the window to that of a checkpoint, if it has several steps.
    pub(super) fn save_window(&self, to: &mut Vec<f64>) {
        let window = &self.window;
        if window.length == 1 {
            return;
        }
        let mouths = self.flow.network().open.len();
        to.extend([window.length, window.passed, window.left, mouths as u64].map(real));
        let mut volumes = vec![0.0; mouths];
        for (mouth, volume) in &self.returned {
            if let Some(sum) = volumes.get_mut(*mouth) {
                *sum += volume;
            }
        }
        to.extend(volumes);
        let front = |mouth: usize| window.fronts.get(mouth).copied().flatten();
        to.extend((0..mouths).map(|mouth| front(mouth).unwrap_or(NO_WATER)));
        for (block, load) in self.loads.iter().enumerate() {
            let [force, torque] = window.loads.get(block).copied().unwrap_or_default();
            for vector in [load.force, load.moment, force, torque] {
                to.extend(vector.iter());
            }
        }
    }

    /// Restores the state of the window from the values of a checkpoint; returns the loads for [`Self::restore_loads`]
    /// and the values that follow, or none if the joints of the checkpoint made other steps.
    pub(super) fn restore_window<'a>(
        &mut self,
        numbers: &'a [f64],
    ) -> Option<(&'a [f64], &'a [f64])> {
        if self.window.length == 1 {
            return Some((&[], numbers));
        }
        let (counts, after) = numbers.split_at_checked(COUNTS)?;
        if counts[0].to_bits() != real(self.window.length).to_bits() {
            return None;
        }
        [self.window.passed, self.window.left] = [counts[1], counts[2]].map(|n| whole(n) as u64);
        let mouths = whole(counts[3]);
        let (volumes, after) = after.split_at_checked(mouths)?;
        let (fronts, after) = after.split_at_checked(mouths)?;
        self.returned = volumes.iter().copied().enumerate().collect();
        let front = |&front: &f64| (front < NO_WATER).then_some(front);
        self.window.fronts = fronts.iter().map(front).collect();
        let (loads, after) = after.split_at_checked(BLOCK_VALUES * self.solids.len())?;
        let sums = loads.chunks_exact(BLOCK_VALUES);
        let vector = |numbers: &[f64], at: usize| Vector3::from_column_slice(&numbers[at..at + 3]);
        self.window.loads = sums
            .map(|sums| [vector(sums, 6), vector(sums, 9)])
            .collect();
        Some((loads, after))
    }

    /// Sets the loads of the last step from the values of [`Self::restore_window`].
    pub(super) fn restore_loads(&mut self, numbers: &[f64]) {
        for (load, saved) in self
            .loads
            .iter_mut()
            .zip(numbers.chunks_exact(BLOCK_VALUES))
        {
            load.force = Vector3::from_column_slice(&saved[..3]);
            load.moment = Vector3::from_column_slice(&saved[3..6]);
        }
    }
}

/// Returns the number of values that a window adds to a checkpoint.
#[must_use]
pub fn window_numbers(lattice_steps: u32, mouths: usize, blocks: usize) -> usize {
    if lattice_steps <= 1 {
        return 0;
    }
    COUNTS + MOUTH_VALUES * mouths + BLOCK_VALUES * blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that a restart between two steps of the joints, after which the bodies are mapped before the first step,
    /// leaves the parts of the water as they are.
    #[test]
    fn water_returns_in_the_same_parts_after_a_restart() {
        let mut window = Window {
            left: 3,
            ..Window::new(4)
        };
        let mut volumes = vec![(0, 6.0)];
        assert!(window.take_parts(&mut volumes).is_empty());
        for left in [4.0, 2.0, 0.0] {
            assert!(window.add(vec![Some(1.0)], Vec::new()).is_none());
            assert_eq!(window.take_parts(&mut volumes), [(0, 2.0)]);
            assert_eq!(volumes, [(0, left)]);
        }
    }
}
