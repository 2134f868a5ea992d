//! Motion of a named body, and the loads of fluid and contacts on it.

use super::quantity::Quantity;
use super::structure::load_headings;
use super::{Heading, POSITION, Rows, VELOCITY};
use crate::grains::{force_unit, space_vector, spin_vector, torque_unit};
use crate::view::StateView;
use base::error::Error;
use dem::space::Space;
use plan::scene::Scene;

/// Steps by which the force of the water on a body lags behind its row: it is the mean over the last two steps.
const LOAD_OF_A_BODY: f64 = 1.0;

/// Named body whose load is sampled.
#[derive(Debug)]
pub(super) struct Body {
    id: u64,
}

impl Body {
    /// Returns the body of an index. Named bodies have the ids 0, 1, … in the order of the case.
    pub(super) fn new(index: usize) -> Self {
        Self { id: index as u64 }
    }
}

impl Quantity for Body {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        let (force, torque) = (force_unit(dimension), torque_unit(dimension));
        let mut headings = [POSITION, VELOCITY].concat();
        headings.extend([
            ("angular_velocity_x", "rad/s"),
            ("angular_velocity_y", "rad/s"),
            ("angular_velocity_z", "rad/s"),
            ("fluid_force_time", "s"),
        ]);
        headings.extend(load_headings(dimension));
        headings.extend([
            ("contact_force_x", force),
            ("contact_force_y", force),
            ("contact_force_z", force),
            ("contact_torque_x", torque),
            ("contact_torque_y", torque),
            ("contact_torque_z", torque),
        ]);
        headings
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = body(view, self.id)?;
        let (motion, loads) = values.split_at(POSITION.len() + 2 * VELOCITY.len());
        let delay = view.fluid.map_or(0.0, |_| view.plan.clock.time_step);
        for row in rows {
            row.extend_from_slice(motion);
            row.push((view.time - LOAD_OF_A_BODY * delay).max(0.0));
            row.extend_from_slice(loads);
        }
        Ok(true)
    }
}

/// Returns the motion and loads of a body; NaN if the body was removed.
fn body<S: Space>(view: &StateView<S>, id: u64) -> Result<[f64; 21], Error> {
    let particles = view.particles;
    let mut bytes = Vec::new();
    if let Some(k) = (0..particles.owned()).find(|&k| particles.body[k].id == id) {
        let (motion, fluid, contact) = (
            &particles.motion[k],
            &particles.fluid_load(k),
            &particles.contact[k],
        );
        let vectors = [
            space_vector(&motion.position),
            space_vector(&motion.velocity),
            spin_vector(&motion.spin),
            space_vector(&fluid.force),
            spin_vector(&fluid.torque),
            space_vector(&contact.force),
            spin_vector(&contact.torque),
        ];
        for value in vectors.as_flattened() {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    let mut values = [f64::NAN; 21];
    for message in view
        .domain
        .communicator()
        .gather_bytes(0, &bytes)
        .unwrap_or_default()
    {
        let (numbers, rest) = message.as_chunks::<8>();
        if !rest.is_empty() || !(numbers.is_empty() || numbers.len() == values.len()) {
            return Err(Error::Internal(format!(
                "a message about body {id} has {} bytes, which is not the expected length",
                message.len()
            )));
        }
        for (value, number) in values.iter_mut().zip(numbers) {
            *value = f64::from_le_bytes(*number);
        }
    }
    Ok(values)
}
