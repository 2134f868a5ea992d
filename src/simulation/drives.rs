//! Walls and bodies whose velocities follow tables in time: pistons, gates, the front of a slide.
//!
//! The velocity of a step is the mean of the table over the step, so that the path is the integral of the table for any
//! rows and any length of a step. It is a function of the step alone: a checkpoint contains no state of a table.

use base::history::TimeTable;
use dem::Dem;
use dem::particles::Particles;
use dem::space::{Space, spin, vector};
use plan::Plan;

/// Wall that follows a table.
#[derive(Debug)]
struct DrivenWall<S: Space> {
    wall: usize,
    velocity: S::Vector,
    factors: TimeTable,
}

/// Body that follows a table.
#[derive(Debug)]
struct DrivenBody<S: Space> {
    id: u64,
    velocity: S::Vector,
    spin: S::Spin,
    factors: TimeTable,
}

/// Walls and bodies of a run that follow tables.
#[derive(Debug)]
pub(super) struct Drives<S: Space> {
    walls: Vec<DrivenWall<S>>,
    bodies: Vec<DrivenBody<S>>,
}

impl<S: Space> Drives<S> {
    /// Returns the walls and bodies of a plan that follow tables.
    pub(super) fn new(plan: &Plan) -> Self {
        let walls = plan.scene.walls.iter().enumerate();
        let walls = walls.filter_map(|(wall, written)| {
            Some(DrivenWall {
                wall,
                velocity: vector::<S>(written.velocity),
                factors: TimeTable::new(Some(written.history.as_ref()?), 1.0),
            })
        });
        let bodies = (0_u64..).zip(&plan.scene.bodies);
        let bodies = bodies.filter_map(|(id, written)| {
            Some(DrivenBody {
                id,
                velocity: vector::<S>(written.velocity),
                spin: spin::<S>(written.angular_velocity),
                factors: TimeTable::new(Some(written.history.as_ref()?), 1.0),
            })
        });
        Self {
            walls: walls.collect(),
            bodies: bodies.collect(),
        }
    }

    /// Sets the velocities of the step between two times \[s\].
    #[inline]
    pub(super) fn set_velocities(
        &self,
        [from, to]: [f64; 2],
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
    ) {
        for wall in &self.walls {
            dem.drive_wall(wall.wall, wall.velocity * wall.factors.mean(from, to));
        }
        for body in &self.bodies {
            let owned = &particles.body[..particles.owned()];
            // Owned bodies are in ascending order of ids.
            if let Ok(k) = owned.binary_search_by_key(&body.id, |body| body.id) {
                let factor = body.factors.mean(from, to);
                particles.drive(k, body.velocity * factor, body.spin * factor);
            }
        }
    }
}
