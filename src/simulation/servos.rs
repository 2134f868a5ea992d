//! Servo walls of a run: their controls, and the required stress of each as a function of time. The stress of a step is
//! that of the table at the beginning of the step. A checkpoint contains no state of a control except the position and
//! the velocity of its wall: with these, the grains and the table, the control continues as without a restart.

use base::history::TimeTable;
use dem::space::{Space, vector};
use dem::{Dem, Servo};
use plan::Plan;

/// Stresses \[Pa\] in time \[s\] of the servo walls, in the order of their walls.
#[derive(Debug, Default)]
pub(super) struct Servos(Vec<TimeTable>);

impl Servos {
    /// Returns the servo walls of a plan and gives the solids their controls.
    pub(super) fn start<S: Space>(plan: &Plan, dem: Option<&mut Dem<S>>) -> Self {
        let Some(dem) = dem else {
            return Self::default();
        };
        let (mut tables, mut controls) = (Vec::new(), Vec::new());
        for (wall, written) in plan.scene.walls.iter().enumerate() {
            let Some(servo) = &written.servo else {
                continue;
            };
            tables.push(TimeTable::new(Some(&servo.history), 0.0));
            controls.push(Servo {
                wall,
                stress: 0.0,
                gain: servo.gain,
                velocity_limit: servo.velocity_limit,
                sliding: vector::<S>(written.velocity),
            });
        }
        dem.set_servos(controls);
        Self(tables)
    }

    /// Sets the required stresses of the step that begins at `time` \[s\].
    #[inline]
    pub(super) fn set_stresses<S: Space>(&self, time: f64, dem: &mut Dem<S>) {
        for (place, table) in self.0.iter().enumerate() {
            dem.set_servo_stress(place, table.value(time));
        }
    }
}
