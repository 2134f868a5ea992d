//! Kinetic energy of all bodies that move under forces, for `summary.json`.

use decomposition::{Communicator, ExactSum};
use dem::particles::{Kind, Particles};
use dem::space::{Components, Space};

/// Returns the kinetic energy of translation and rotation \[J; in 2-D J/m\]. The sum is exact, so that
/// it does not depend on the ranks. Collective.
pub fn kinetic_energy<S: Space>(particles: &Particles<S>, communicator: &Communicator) -> f64 {
    let mut sum = ExactSum::new();
    for k in 0..particles.owned() {
        let (body, motion) = (&particles.body[k], &particles.motion[k]);
        if body.kind != Kind::Free {
            continue;
        }
        sum.add(0.5 * body.mass * motion.velocity.scalar(&motion.velocity));
        sum.add(match particles.polyhedron(k) {
            Some((shape, state)) => state.energy(&shape.inertia(body.mass / shape.volume())),
            None => {
                let spins = (0..S::Spin::COUNT).map(|axis| motion.spin.get(axis).powi(2));
                0.5 * body.inertia * spins.sum::<f64>()
            }
        });
    }
    sum.all_reduce(communicator);
    sum.value()
}
