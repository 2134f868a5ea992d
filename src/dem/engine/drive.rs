//! The motion of servo walls in a step: sums over their contacts, then the velocity of [`crate::servo`].

use super::Engine;
use super::bodies::Bodies;
use crate::particles::Particles;
use crate::servo::{WallSums, from_quanta, quanta};
use crate::space::{Components, Space};
use decomposition::Domain;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Sets the velocities of the servo walls for the next solid step, from the positions and lists at the end of the
    /// present step. Collective.
    pub(super) fn drive_servos(&mut self, particles: &Particles<S>, domain: &Domain) {
        let (region, dt) = (self.settings.region, self.settings.time_step);
        let mut servos = std::mem::take(&mut self.servos);
        servos.sums.clear();
        for servo in &servos.list {
            let sums = self.normal_springs(servo.wall, particles);
            servos.sums.extend(sums.map(i128::cast_unsigned));
        }
        domain.communicator().all_reduce_sum_u128s(&mut servos.sums);
        let (sums, _) = servos.sums.as_chunks::<3>();
        for (servo, sums) in servos.list.iter().zip(sums) {
            if self.walls[servo.wall].open {
                continue;
            }
            let corners = [region.lower, region.upper];
            let area = (servos.area).of_wall(&self.walls, servo.wall, corners);
            let [force, stiffness, receding] = sums.map(|sum| from_quanta(sum.cast_signed()));
            let sums = WallSums {
                force,
                stiffness,
                receding,
            };
            let wall = &mut self.walls[servo.wall];
            wall.velocity = servo.sliding + wall.normal * servo.velocity(&sums, area, dt);
        }
        self.servos = servos;
    }

    /// Returns the [`WallSums`] of a plane wall in quanta, over the grains of this rank.
    fn normal_springs(&self, wall: usize, particles: &Particles<S>) -> [i128; 3] {
        let mut sums = [0_i128; 3];
        let plane = &self.walls[wall];
        let pairs = self.solids.wall_pairs.iter();
        for pair in pairs.filter(|pair| pair.wall as usize == wall) {
            let motion = &particles.motion[pair.grain as usize];
            let distance = plane.distance(&motion.position);
            if distance >= pair.radius && !L::holds(&pair.history) {
                continue;
            }
            let overlap = pair.radius - distance;
            let force = L::normal_spring(&pair.constants, &pair.history, overlap);
            let stiffness = L::tangent_stiffness(&pair.constants, overlap);
            let receding = stiffness * plane.normal.scalar(&motion.velocity);
            for (sum, part) in sums.iter_mut().zip([force, stiffness, receding]) {
                *sum = sum.saturating_add(quanta(part));
            }
        }
        sums
    }
}
