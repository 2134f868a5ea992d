//! Steady solution, and a step in time.

use super::{DIAGONAL, Drive, FlowError, JointFlow, StepReport};
use decomposition::ExactSum;

impl JointFlow {
    /// Updates the gaps and the pressures outside the network to a time.
    fn follow(&mut self, drive: &dyn Drive, time: f64) {
        for (number, front) in self.work.fronts.iter_mut().enumerate() {
            *front = drive.pressure(number, time);
            self.work.outside[number] = drive.resistance(number);
        }
        let mut moved = false;
        for (joint, gap) in self.walls.base_gaps.iter_mut().enumerate() {
            if let Some(new) = drive.gap(joint, time) {
                moved |= new != *gap;
                *gap = new;
            }
        }
        if moved {
            self.place_walls();
        }
    }

    /// Finds the parts of the network without an open end: in each of them the pressure of one node is fixed.
    fn find_held(&mut self) {
        let parts = self.network.parts();
        let mut held = vec![true; self.pressure.len()];
        for [from, piece] in &self.links.ends[self.links.inner..] {
            if self.work.fronts[*piece as usize].is_some() {
                held[parts[*from as usize]] = false;
            }
        }
        let roots = parts.iter().enumerate();
        self.system.held = roots
            .filter(|&(node, &root)| node == root && held[node])
            .map(|(node, _)| node)
            .collect();
    }

    /// Computes the steady flow under the pressures at a time. Parts of the network without an open end keep the
    /// pressure of their first cell and have no flow.
    ///
    /// # Errors
    /// If there is no solution.
    pub fn solve_steady(&mut self, drive: &dyn Drive, time: f64) -> Result<StepReport, FlowError> {
        self.system.keeps = false;
        self.follow(drive, time);
        self.find_held();
        self.work.base.fill(0.0);
        self.answer_steadily();
        let newton = self.solve(1.0, false)?;
        // The matrices of steps in time are others.
        self.system.keeps = false;
        self.set_steady_modes();
        self.links.responses_of = None;
        Ok(StepReport {
            newton,
            ..StepReport::default()
        })
    }

    /// Sums the discharges into each node \[m³/s\].
    fn sum_discharges(&mut self) {
        self.work.net.fill(0.0);
        let (inner, outer) = self.links.ends.split_at(self.links.inner);
        for ([from, to], discharge) in inner.iter().zip(&self.links.discharge) {
            self.work.net[*from as usize] -= discharge;
            self.work.net[*to as usize] += discharge;
        }
        for ([from, _], discharge) in outer.iter().zip(&self.links.discharge[self.links.inner..]) {
            self.work.net[*from as usize] -= discharge;
        }
    }

    /// Adds the water that leaves through open pieces during a time \[s\]; returns the water that enters through all of
    /// them \[m³\].
    fn pass_water(&mut self, time: f64) -> f64 {
        let mut sum = ExactSum::new();
        let outer = &self.links.ends[self.links.inner..];
        for ([_, piece], discharge) in outer.iter().zip(&self.links.discharge[self.links.inner..]) {
            self.passed[*piece as usize] += time * discharge;
            sum.add(-discharge);
        }
        time * sum.value()
    }

    /// Makes a step from `time` to `time + interval` \[s\].
    ///
    /// # Errors
    /// If the pressures do not converge or are not finite; the state is then lost.
    pub fn advance(
        &mut self,
        drive: &dyn Drive,
        time: f64,
        interval: f64,
    ) -> Result<StepReport, FlowError> {
        self.system.factorisations = 0;
        let stage = DIAGONAL * interval;
        self.work.base.copy_from_slice(&self.storage.surplus);
        for cell in 0..self.storage.sizes.len() {
            let (more, _) = self.settings.water.compression(self.pressure[cell]);
            self.work.base[cell] += self.storage.volumes[cell] * more;
        }
        self.work.before.copy_from_slice(&self.storage.fills);
        self.work.opened.copy_from_slice(&self.storage.opened);
        for (start, mover) in self.work.starts.iter_mut().zip(&self.movers) {
            *start = [mover.displacement, mover.velocity];
        }
        self.passed.fill(0.0);
        self.follow(drive, time + stage);
        self.prepare_answers(stage);
        let mut newton = self.solve(stage, true)?;
        let mut entered = self.pass_water((1.0 - DIAGONAL) * interval);
        self.sum_discharges();
        // The second stage starts with the extrapolated changes of the first.
        let carried = (1.0 - DIAGONAL) / DIAGONAL;
        self.set_modes(stage, Some(carried));
        for (base, net) in self.work.base.iter_mut().zip(&self.work.net) {
            *base += (1.0 - DIAGONAL) * interval * net;
        }
        for (start, mover) in self.work.starts.iter_mut().zip(&self.movers) {
            let [place, velocity] = *start;
            start[0] += carried * (mover.displacement - place);
            start[1] += carried * (mover.velocity - velocity);
        }
        self.follow(drive, time + interval);
        self.prepare_answers(stage);
        newton += self.solve(stage, true)?;
        self.set_modes(stage, None);
        entered += self.pass_water(stage);
        // What is missing in the balance of a node belongs to the next step.
        for (surplus, imbalance) in self.storage.surplus.iter_mut().zip(&self.work.imbalance) {
            *surplus = -imbalance;
        }
        Ok(StepReport {
            newton,
            factorisations: self.system.factorisations,
            entered,
        })
    }
}
