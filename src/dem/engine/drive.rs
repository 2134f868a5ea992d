//! The motion of servo walls in a step: sums over their contacts, then the velocity of [`crate::servo`].

use super::*;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Gives the servo walls their velocities for the next solid step. Positions and lists are those of the end of the
    /// present one. Collective.
    pub(super) fn drive_servos(&mut self, particles: &Particles<S>, domain: &Domain) {
        let (region, dt) = (self.settings.region, self.settings.time_step);
        let mut servos = std::mem::take(&mut self.servos);
        for servo in &servos.list {
            if self.walls[servo.wall].open {
                continue;
            }
            let corners = [region.lower, region.upper];
            let area = servos.area.of_wall(&self.walls, servo.wall, corners);
            let sums = self.normal_springs(servo.wall, particles).map(|mut sum| {
                sum.all_reduce(domain.communicator());
                sum.value()
            });
            let wall = &mut self.walls[servo.wall];
            wall.velocity = servo.sliding + wall.normal * servo.velocity(sums, area, dt);
        }
        self.servos = servos;
    }

    /// Returns the sums of the forces of the normal springs at a plane wall \[N\] and of their tangent stiffnesses
    /// [N/m], over the grains of this rank.
    fn normal_springs(&self, wall: usize, particles: &Particles<S>) -> [ExactSum; 2] {
        let mut sums = [ExactSum::new(), ExactSum::new()];
        let plane = &self.walls[wall];
        let pairs = self.solids.wall_pairs.iter();
        for pair in pairs.filter(|pair| pair.wall as usize == wall) {
            let distance = plane.distance(&particles.motion[pair.grain as usize].position);
            if distance >= pair.radius && !L::bonded(&pair.history) {
                continue;
            }
            let overlap = pair.radius - distance;
            sums[0].add(L::normal_spring(&pair.constants, &pair.history, overlap));
            sums[1].add(L::tangent_stiffness(&pair.constants, overlap));
        }
        sums
    }
}
