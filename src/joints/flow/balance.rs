//! Balances of the water of the nodes and of the momentum of the blocks, and their matrix.

use super::{JointFlow, ROTATION_PAIRS};
use crate::motion::{FREEDOMS, Mover};
use nalgebra::Vector6;

/// Returns the inertia of a freedom of a block.
fn inertia(mover: &Mover, freedom: usize) -> f64 {
    if freedom < 3 {
        mover.mass
    } else {
        mover.inertia[(freedom - 3, freedom - 3)]
    }
}

impl JointFlow {
    /// Sets the velocities of an iterate, and the corresponding gaps at the end of a stage.
    fn move_blocks(&mut self, unknowns: &[f64], interval: f64) {
        if self.movers.is_empty() {
            return;
        }
        let nodes = self.storage.volumes.len();
        let velocities = unknowns[nodes..].chunks_exact(FREEDOMS);
        let starts = self.work.starts.iter().zip(velocities);
        for (mover, ([start, _], velocity)) in self.movers.iter_mut().zip(starts) {
            mover.velocity = Vector6::from_column_slice(velocity);
            mover.displacement = start + mover.velocity * interval;
        }
        self.place_moving_walls(interval);
    }

    /// Computes the imbalances of the nodes and blocks at these pressures and velocities. Without `stores` the flow is
    /// steady. Returns the sum of the squares of the nodal imbalances.
    pub(super) fn imbalance(&mut self, unknowns: &[f64], interval: f64, stores: bool) -> f64 {
        if stores {
            self.move_blocks(unknowns, interval);
        }
        self.set_discharges(unknowns);
        let mut work = std::mem::take(&mut self.work.imbalance);
        let nodes = self.storage.volumes.len();
        for (number, base) in work.iter_mut().zip(&self.work.base) {
            *number = -base;
        }
        if stores {
            for cell in 0..self.storage.sizes.len() {
                let more = self.settings.water.compression(unknowns[cell]).0;
                // With stationary walls this form adds no rounding of the volume itself.
                let moved = self.storage.fills[cell] - self.work.before[cell];
                let opened = self.storage.opened[cell] - self.work.opened[cell];
                work[cell] += self.storage.volumes[cell] * more + moved + opened;
            }
        }
        let (inner, outer) = self.links.ends.split_at(self.links.inner);
        let discharges = &self.links.discharge;
        for ([from, to], discharge) in inner.iter().zip(discharges) {
            let passed = interval * discharge;
            work[*from as usize] += passed;
            work[*to as usize] -= passed;
        }
        for ([from, _], discharge) in outer.iter().zip(&discharges[self.links.inner..]) {
            work[*from as usize] += interval * discharge;
        }
        if stores {
            self.balance_blocks(unknowns, interval, &mut work);
        } else {
            for &node in &self.system.held {
                work[node] = 0.0;
            }
            // Blocks are fixed in a steady flow.
            work[nodes..].fill(0.0);
        }
        let sum = work[..nodes].iter().map(|number| number * number).sum();
        self.work.imbalance = work;
        sum
    }

    /// Computes the imbalances of the momentum of the moving blocks.
    fn balance_blocks(&self, unknowns: &[f64], interval: f64, imbalance: &mut [f64]) {
        let nodes = self.storage.volumes.len();
        let blocks = self.movers.iter().zip(&self.work.starts);
        for (number, (mover, [_, start])) in blocks.enumerate() {
            let change = mover.momentum(&(mover.velocity - start)) - mover.load * interval;
            let first = nodes + FREEDOMS * number;
            for freedom in 0..FREEDOMS {
                imbalance[first + freedom] = -change[freedom];
            }
        }
        for touch in &self.touches {
            let first = nodes + FREEDOMS * touch.mover;
            let pressure = interval * unknowns[touch.cell];
            for freedom in 0..FREEDOMS {
                imbalance[first + freedom] += touch.arm[freedom] * pressure;
            }
        }
    }

    /// Computes the matrix of the balances at these pressures and velocities, to be factorised.
    pub(super) fn set_matrix(&mut self, unknowns: &[f64], interval: f64, stores: bool) {
        let [mut diagonal, mut pairs] = std::mem::take(&mut self.system.factored);
        let nodes = self.storage.volumes.len();
        diagonal.fill(0.0);
        if stores {
            for cell in 0..self.storage.sizes.len() {
                let slope = self.settings.water.compression(unknowns[cell]).1;
                diagonal[cell] = self.storage.volumes[cell] * slope;
            }
        }
        for (link, [from, to]) in self.links.ends.iter().enumerate() {
            let conducted = interval * self.discharge_of(link, unknowns).1;
            diagonal[*from as usize] += conducted;
            if link < self.links.inner {
                diagonal[*to as usize] += conducted;
                pairs[link] = -conducted;
            }
        }
        if stores {
            self.set_matrix_of_blocks(
                interval,
                &mut diagonal[nodes..],
                &mut pairs[self.links.inner..],
            );
        } else {
            for &node in &self.system.held {
                // A cell without open links is isolated.
                diagonal[node] = if diagonal[node] > 0.0 {
                    2.0 * diagonal[node]
                } else {
                    1.0
                };
            }
            pairs[self.links.inner..].fill(0.0);
            diagonal[nodes..].fill(-1.0);
        }
        self.system.factored = [diagonal, pairs];
    }

    /// Computes the rows of the moving blocks in the matrix.
    fn set_matrix_of_blocks(&self, interval: f64, diagonal: &mut [f64], pairs: &mut [f64]) {
        let freedoms = diagonal.chunks_exact_mut(FREEDOMS);
        for (mover, diagonal) in self.movers.iter().zip(freedoms) {
            for (freedom, entry) in diagonal.iter_mut().enumerate() {
                *entry = -inertia(mover, freedom);
            }
        }
        let (touching, turning) = pairs.split_at_mut(FREEDOMS * self.touches.len());
        for (touch, pairs) in self.touches.iter().zip(touching.chunks_exact_mut(FREEDOMS)) {
            for (pair, arm) in pairs.iter_mut().zip(&touch.arm) {
                *pair = interval * arm;
            }
        }
        let turning = turning.chunks_exact_mut(ROTATION_PAIRS.len());
        for (mover, pairs) in self.movers.iter().zip(turning) {
            for (pair, [a, b]) in pairs.iter_mut().zip(ROTATION_PAIRS) {
                *pair = -mover.inertia[(a - 3, b - 3)];
            }
        }
    }

    /// Returns the largest pressure that the imbalance of a node amounts to at its place alone \[Pa\].
    pub(super) fn largest_imbalance(&self) -> f64 {
        let nodes = self.storage.volumes.len();
        let all = self.work.imbalance[..nodes]
            .iter()
            .zip(&self.system.factored[0]);
        all.fold(0.0, |most, (number, diagonal)| {
            let pressure = (number / diagonal).abs();
            // Not a number stays so.
            if pressure <= most { most } else { pressure }
        })
    }

    /// Returns the largest velocity or rate that the imbalance of a block amounts to.
    pub(super) fn largest_kick(&self) -> f64 {
        let blocks = self.work.imbalance[self.storage.volumes.len()..].chunks_exact(FREEDOMS);
        let kicks = self.movers.iter().zip(blocks);
        kicks.fold(0.0, |most, (mover, imbalances)| {
            let rows = imbalances.iter().enumerate();
            let kicks = rows.map(|(freedom, row)| row.abs() / inertia(mover, freedom));
            kicks.fold(most, f64::max)
        })
    }
}
