//! Walls that are inserted or removed at a given time, such as a gate that opens.
//!
//! A wall changes at the end of the first step whose time is not below the time in the case. The contacts at a
//! removed wall end, and the contact loads are computed again, so that the next step does not depend on the removed
//! wall. The walls present are a function of the step, so that no checkpoint contains them.

use super::setup;
use base::error::Error;
use decomposition::Domain;
use dem::{Dem, Particles, Space};
use plan::Plan;

/// Insertion or removal of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WallChange {
    step: u64,
    wall: usize,
    inserted: bool,
}

/// Walls that are inserted or removed during the run.
#[derive(Debug, Default)]
pub(super) struct Gates {
    /// Changes in ascending order of steps.
    changes: Vec<WallChange>,
    /// Number of changes made.
    changes_made: usize,
    messages: Vec<String>,
}

impl Gates {
    pub(super) fn new(plan: &Plan) -> Self {
        let mut changes = Vec::new();
        for (wall, written) in plan.scene.walls.iter().enumerate() {
            let times = [(written.from, true), (written.until, false)];
            changes.extend(times.into_iter().filter_map(|(time, inserted)| {
                let step = plan.clock.interval_to_steps(time?);
                Some(WallChange {
                    step,
                    wall,
                    inserted,
                })
            }));
        }
        changes.sort_by_key(|change| (change.step, change.wall, !change.inserted));
        Self {
            changes,
            ..Self::default()
        }
    }

    /// Sets the walls to their state after this many steps. A wall that is inserted later is open from the start.
    pub(super) fn restore<S: Space>(&mut self, step: u64, dem: &mut Dem<S>) {
        self.changes_made = self.changes.partition_point(|change| change.step <= step);
        for change in &self.changes[..self.changes_made] {
            move_wall(*change, dem);
        }
    }

    /// Returns `true` if a wall is absent after this many steps.
    pub(super) fn wall_is_absent(&self, step: u64, wall: usize) -> bool {
        let of_wall = || self.changes.iter().filter(|change| change.wall == wall);
        let last = of_wall().rfind(|change| change.step <= step);
        match last {
            Some(change) => !change.inserted,
            None => of_wall().next().is_some_and(|change| change.inserted),
        }
    }

    /// Makes the changes of this step and returns `true` if there were any. Collective.
    ///
    /// # Errors
    /// If a wall is inserted where a grain is; the same on all ranks.
    #[inline]
    pub(super) fn apply_changes<S: Space>(
        &mut self,
        (step, plan): (u64, &Plan),
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<bool, Error> {
        let before = self.changes_made;
        while let Some(change) = self
            .changes
            .get(self.changes_made)
            .filter(|c| c.step <= step)
        {
            let change = *change;
            self.changes_made += 1;
            let name = &plan.scene.walls[change.wall].name;
            if change.inserted {
                check_clearance(plan, [change.wall], particles, domain)
                    .map_err(Error::Numerical)?;
            }
            move_wall(change, dem);
            particles.forget_loads();
            let verb = if change.inserted {
                "inserted"
            } else {
                "removed"
            };
            let time = base::number::real(step) * plan.clock.time_step;
            self.messages
                .push(format!("wall `{name}` {verb} at {time:.6e} s, step {step}"));
        }
        Ok(self.changes_made > before)
    }

    /// Returns the events since the last call, one line each.
    pub(super) fn take_events(&mut self) -> Vec<String> {
        std::mem::take(&mut self.messages)
    }
}

fn move_wall<S: Space>(change: WallChange, dem: &mut Dem<S>) {
    if change.inserted {
        dem.close_walls(&[change.wall]);
    } else {
        dem.open_walls(&[change.wall]);
    }
}

/// Checks that no grain overlaps walls that are about to be inserted. Collective.
///
/// # Errors
/// If a wall cuts into a grain; the text names both and is the same on all ranks.
pub(super) fn check_clearance<S: Space>(
    plan: &Plan,
    new: impl IntoIterator<Item = usize>,
    particles: &Particles<S>,
    domain: &Domain,
) -> Result<(), String> {
    /// Maximum overlap of a contact with a new wall, as a fraction of the radius; a deeper overlap would accelerate
    /// the grain violently.
    const ALLOWED: f64 = 0.05;
    let walls = setup::walls::<S>(plan);
    let mut struck = None;
    for n in new {
        let (wall, written) = (&walls[n], &plan.scene.walls[n]);
        for k in 0..particles.owned() {
            let at = particles.location(k);
            let radius = particles.body[k].radius;
            let allowed = (1.0 - ALLOWED) * radius;
            let distance = match &wall.surface {
                None => wall.distance(&at),
                Some(surface) => {
                    let at = S::to_volume(&at);
                    if !surface.is_within(&at, allowed) {
                        continue;
                    }
                    surface.clearance(&at)
                }
            };
            if distance < allowed {
                struck.get_or_insert_with(|| {
                    format!(
                        "the new wall `{}` cuts into body {} (its surface is {:.3e} m from the centre, the radius is \
                         {radius:.3e} m); move it away from all bodies",
                        written.name, particles.body[k].id, distance
                    )
                });
            }
        }
    }
    domain
        .communicator()
        .agree(struck.map_or(Ok(()), Err))
        .map_err(|e| e.message)
}
