//! Load of the grains on a wall: force, torque and mean stresses, with the position and area of the wall.
//!
//! ```text
//! force = - sum over contacts: N n + S,   torque = sum: (x - about) x (-N n - S)
//! normal stress = sum N / area,   shear stress = |sum S| / area
//! ```
//!
//! N and S are the forces of the normal and of the shear spring of a contact on the grain, n points from the wall to
//! the grain, x is the contact point, in a periodic domain its image inside the box. Dashpots are left out: the load is
//! that of slow deformation and rest. **Compression is positive.** The area of a plane is that of its part within the
//! domain and in front of the other planes ([`dem::walls::area`]), at their present positions; the area of a surface is
//! the sum over its facets.
//!
//! Sums are exact, so that no value depends on the number of ranks.

use super::quantity::Quantity;
use super::{Heading, Rows, VELOCITY, area_unit};
use crate::grains::{force_unit, space_vector, torque_unit};
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use decomposition::ExactSum;
use dem::space::Space;
use dem::walls::area::PlaneArea;
use nalgebra::Vector3;
use plan::scene::Scene;

/// Number of columns without the time.
const COLUMNS: usize = 16;

/// Wall that grains load.
#[derive(Debug)]
pub(super) struct WallLoad {
    wall: usize,
    about: Vector3<f64>,
    area: PlaneArea,
}

impl WallLoad {
    /// Returns the probe of a wall, given by its index in the scene; `about` is the reference point of the torque
    /// \[m\].
    pub(super) fn new(wall: usize, about: [f64; 3]) -> Self {
        Self {
            wall,
            about: about.into(),
            area: PlaneArea::default(),
        }
    }

    /// Returns the values of this step without the time. Collective.
    fn measure<S: Space>(&mut self, view: &StateView<S>) -> [f64; COLUMNS] {
        let Some(dem) = view.dem else {
            return [f64::NAN; COLUMNS];
        };
        let grid = &view.plan.scene.grid;
        let mut normal = ExactSum::new();
        let mut sums: [ExactSum; 9] = std::array::from_fn(|_| ExactSum::new());
        let mut contacts = 0_u64;
        dem.for_each_contact(view.particles, |contact| {
            if contact.wall.map(|wall| wall as usize) != Some(self.wall) {
                return;
            }
            contacts += u64::from(contact.touches());
            let push = Vector3::from(space_vector(&contact.normal)) * contact.normal_force;
            let shear = Vector3::from(space_vector(&contact.shear_force));
            let mut at = space_vector(&contact.position);
            for a in (0..grid.dimension).filter(|a| grid.periodic[*a]) {
                at[a] -= (at[a] / grid.size[a]).floor() * grid.size[a];
            }
            let force = -push - shear;
            let torque = (Vector3::from(at) - self.about).cross(&force);
            normal.add(contact.normal_force);
            let values = [force, torque, shear];
            let values = values.iter().flat_map(|v| [v.x, v.y, v.z]);
            for (sum, value) in sums.iter_mut().zip(values) {
                sum.add(value);
            }
        });
        let communicator = view.domain.communicator();
        let sum = |mut sum: ExactSum| {
            sum.all_reduce(communicator);
            sum.value()
        };
        let normal = sum(normal);
        let [fx, fy, fz, tx, ty, tz, sx, sy, sz] = sums.map(sum);
        let contacts = communicator.all_reduce_sum_u64(contacts);
        let wall = &dem.walls()[self.wall];
        let region = dem.settings().region;
        let area = match &wall.surface {
            None => (self.area).of_wall(dem.walls(), self.wall, [region.lower, region.upper]),
            Some(surface) => surface.area(),
        };
        let written = Vector3::from(view.plan.scene.walls[self.wall].point);
        let moved = S::to_volume(&wall.point) - written;
        let velocity = S::to_volume(&wall.drift());
        let shear = Vector3::new(sx, sy, sz).norm();
        [
            moved.x,
            moved.y,
            moved.z,
            velocity.x,
            velocity.y,
            velocity.z,
            fx,
            fy,
            fz,
            tx,
            ty,
            tz,
            area,
            normal / area,
            shear / area,
            real(contacts),
        ]
    }
}

impl Quantity for WallLoad {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        let (force, torque) = (force_unit(dimension), torque_unit(dimension));
        let [vx, vy, vz] = VELOCITY;
        vec![
            ("displacement_x", "m"),
            ("displacement_y", "m"),
            ("displacement_z", "m"),
            vx,
            vy,
            vz,
            ("force_x", force),
            ("force_y", force),
            ("force_z", force),
            ("torque_x", torque),
            ("torque_y", torque),
            ("torque_z", torque),
            ("area", area_unit(dimension)),
            ("normal_stress", "Pa"),
            ("shear_stress", "Pa"),
            ("contacts", "-"),
        ]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = self.measure(view);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}
