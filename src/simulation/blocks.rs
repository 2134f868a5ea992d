//! The blocks in `summary.json`: mean position, mean velocity and energies.
//!
//! The values are means over all blocks that can move, weighted by mass. The potential energy is that
//! of gravity above the origin of the domain. A decrease of the sum of potential and kinetic energy was
//! dissipated by friction and dashpots, or is stored in the contact springs. The sums are exact, so
//! that they do not depend on the ranks.

use decomposition::{Communicator, ExactSum};
use dem::particles::{Kind, Particles};
use dem::space::{Components, Space};
use plan::Plan;
use serde_json::{Value, json};

/// Number of sums: mass, kinetic and potential energy, then mass times position, velocity and
/// displacement.
const SUMS: usize = 3 + 3 * 3;

/// Returns the summary of the blocks; none if the case has none. Collective.
pub fn summary<S: Space>(
    plan: &Plan,
    particles: &Particles<S>,
    communicator: &Communicator,
) -> Option<Value> {
    let blocks = plan.scene.blocks.as_ref()?;
    let named = plan.scene.bodies.len() as u64;
    let mut sums: [ExactSum; SUMS] = std::array::from_fn(|_| ExactSum::new());
    for k in 0..particles.owned() {
        let body = &particles.body[k];
        let ours = (named..plan.scene.first_grain()).contains(&body.id);
        let Some((shape, state)) = particles.polyhedron(k).filter(|_| ours) else {
            continue;
        };
        if body.kind != Kind::Free {
            continue;
        }
        let motion = &particles.motion[k];
        let inertia = shape.inertia(body.mass / shape.volume());
        let speeds = (0..S::DIMENSION).map(|axis| motion.velocity.get(axis).powi(2));
        let energy = 0.5 * body.mass * speeds.sum::<f64>();
        sums[0].add(body.mass);
        sums[1].add(energy + state.energy(&inertia));
        let displacement = particles.displacement(k).unwrap_or_default();
        for axis in 0..S::DIMENSION {
            let position = motion.position.get(axis);
            sums[2].add_product(-body.mass * plan.scene.gravity[axis], position);
            sums[3 + axis].add_product(body.mass, position);
            sums[6 + axis].add_product(body.mass, motion.velocity.get(axis));
            sums[9 + axis].add_product(body.mass, displacement.get(axis));
        }
    }
    for sum in &mut sums {
        sum.all_reduce(communicator);
    }
    let values = sums.map(|sum| sum.value());
    let mean = |first: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| values[first + axis] / values[0]);
        json!({ "x": x, "y": y, "z": z })
    };
    let moving = values[0] > 0.0;
    let mut report = json!({
        "number": blocks.number,
        "fixed": blocks.fixed,
        "volume": blocks.volume,
        "mass": values[0],
        "kinetic_energy": values[1],
        "potential_energy": values[2],
    });
    if moving {
        report["centre_of_mass"] = mean(3);
        report["mean_velocity"] = mean(6);
        if plan.scene.follows_grains() {
            report["mean_displacement"] = mean(9);
        }
    }
    Some(report)
}
