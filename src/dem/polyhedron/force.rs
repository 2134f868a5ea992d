//! Force of a contact of blocks: normal and shear springs, friction, dashpots.
//!
//! ```text
//! F_n = k_n depth - c_n d(gap)/dt, at least 0
//! F_s = F_s' - k_s slip dt - c_s slip
//! M_t = M_t' - k_t spin_n dt - c_t spin_n,      R = 2/3 of the radius of the patch
//! (|F_s|/(mu F_n))² + (M_t/(mu F_n R))² <= 1    both cut by one factor
//! M_r = cut(-c_r Q (spin across n))             cut to F_n times the patch's radius of gyration about M_r
//! ```
//!
//! Sliding and spinning share the friction of a patch: a sliding face resists twist less, and a spinning face
//! slides more easily. The limit surface is the ellipsoid of R. D. Howe, M. R. Cutkosky, Int. J. Robotics Res. 15
//! (1996) 557.
//!
//! The stiffness is given for a contact [N/m], or for an area of contact [Pa/m] as is usual for rock joints: then
//! `k = (stiffness per area) * area`, and with [`super::BlockContactModel::Patch`] the normal force is the sum over
//! a bed of springs. `F_s'` is the force of the shear spring in the last step, transported with the contact: it is
//! rotated with the normal and by the mean spin of both blocks about the normal, and keeps its length.
//!
//! `M_t` resists the twist of a face on a face, with the polar moment J of the patch: `k_t = k_s J/area`. `R` is exact
//! for a disc under uniform pressure. Without `M_t` a block could spin freely on a single contact point.
//!
//! The dashpots are distributed over the patch like the springs: `c_t = c_s J/area`, and `c_r = c_n/area` with the
//! second moments `Q` of the area about the axes across the normal. The rocking of a face is damped, while a block
//! rotates freely about an edge. A dashpot at one point would leave rocking undamped. The patch of a sphere moves
//! over its surface as it rolls: there is no rocking, and `M_r` is zero ([`Geometry::rocks`]).
//!
//! The contacts of a block with the facets of one plane, also of several walls, are parts of one patch
//! ([`Approach::part`]): springs add up, and each part has its fraction of the dashpots of the whole. The dashpots
//! are those of discrete steps ([`over_step`]).
//!
//! Force and moment are equal and opposite at one point: momentum and angular momentum are conserved.
//!
//! Source: R. Hart, P. A. Cundall, J. Lemos, Int. J. Rock Mech. Min. Sci. & Geomech. Abstr. 25 (1988) 117. They use
//! mass-proportional damping ([`super::Damping`]); the dashpots are for collisions.

use nalgebra::Vector3;
use serde::Serialize;

use super::contact::{BlockHistory, Geometry};
use crate::dashpot::{over_step, part_of_step};

/// Stiffness of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stiffness {
    /// Stiffness equal for every contact.
    PerContact {
        /// Normal stiffness [N/m].
        normal: f64,
        /// Shear stiffness [N/m].
        shear: f64,
    },
    /// Stiffness proportional to the contact area.
    PerArea {
        /// Normal stiffness [Pa/m].
        normal: f64,
        /// Shear stiffness [Pa/m].
        shear: f64,
    },
}

/// Contact law of a pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BlockPairLaw {
    /// Stiffness of the contact.
    pub stiffness: Stiffness,
    /// Coefficient of friction mu.
    pub friction: f64,
    /// Normal dashpot as a fraction of critical damping of the pair.
    pub normal_damping_ratio: f64,
    /// Shear dashpot as a fraction of critical damping.
    pub shear_damping_ratio: f64,
}

/// Motion of the second body relative to the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Velocity of the second centre minus that of the first [m/s].
    pub velocity: Vector3<f64>,
    /// Spins of both bodies [rad/s], in the axes of space.
    pub spins: [Vector3<f64>; 2],
    /// Vector from the first centre to the second \[m\].
    pub separation: Vector3<f64>,
    /// Effective mass \[kg\]: `m1 m2/(m1 + m2)`, or the mass of a block against a body that does not move.
    pub mass: f64,
    /// Time step \[s\].
    pub time_step: f64,
    /// Fraction of the patch area that belongs to this contact; 1 for the whole patch.
    pub part: f64,
    /// Fraction of the normal dashpot that acts, from 0 to 1; below 1 if a face touches only the rim of a block
    /// that rests on another face.
    pub damped: f64,
}

/// Force, moment and state of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactResponse {
    /// Force \[N\] on the second body; the opposite force acts on the first.
    pub force: Vector3<f64>,
    /// Moment \[N m\] on the first body about its centre.
    pub on_first: Vector3<f64>,
    /// Moment \[N m\] on the second body about its centre.
    pub on_second: Vector3<f64>,
}

impl BlockPairLaw {
    /// Returns the normal and shear stiffness [N/m] of a contact over `area` \[m²\]: for the critical time step,
    /// `0.1 sqrt(m/k)` or less.
    #[must_use]
    pub fn stiffness(&self, area: f64) -> [f64; 2] {
        match self.stiffness {
            Stiffness::PerContact { normal, shear } => [normal, shear],
            Stiffness::PerArea { normal, shear } => [normal * area, shear * area],
        }
    }

    /// Returns the stiffness of a part of a patch: that of its area, or its fraction of the stiffness per contact.
    fn stiffness_of(&self, area: f64, part: f64) -> [f64; 2] {
        match self.stiffness {
            Stiffness::PerContact { normal, shear } => [normal * part, shear * part],
            Stiffness::PerArea { .. } => self.stiffness(area),
        }
    }

    /// Returns the action of a contact; its springs are stored in `history`.
    pub fn act(
        &self,
        touch: &Geometry,
        history: &mut BlockHistory,
        approach: &Approach,
    ) -> ContactResponse {
        let dt = approach.time_step;
        let n = touch.normal;
        let [spin, other] = approach.spins;
        let arms = [touch.arm, touch.arm - approach.separation];
        let relative = approach.velocity + other.cross(&arms[1]) - spin.cross(&arms[0]);
        let rate = n.dot(&relative);
        let slip = relative - n * rate;
        let [stiff, shear_stiff] = self.stiffness_of(touch.area, approach.part);
        let mass = approach.mass * approach.part;
        let dashpots = [
            2.0 * self.normal_damping_ratio * (mass * stiff).sqrt() * approach.damped,
            2.0 * self.shear_damping_ratio * (mass * shear_stiff).sqrt(),
        ];
        let brake = over_step(dashpots[0], dt, 1.0, mass) * part_of_step(touch.depth, rate, dt);
        let normal = (stiff * touch.depth - brake * rate).max(0.0);
        let limit = self.friction * normal;

        let turning = 0.5 * dt * (spin + other).dot(&n);
        let carried = carry(&history.shear, &history.normal, &n, turning);
        let mut spring = carried - slip * (shear_stiff * dt);
        let mut shear = spring - slip * dashpots[1];

        let (mut twist, mut moment) = (0.0, Vector3::zeros());
        let polar = touch.polar();
        let mut used = shear.norm() / limit;
        if touch.area > 0.0 && polar > 0.0 {
            let spread = polar / touch.area;
            let turning = other - spin;
            let about = turning.dot(&n);
            let radius = (2.0 / 3.0) * (2.0 * spread).sqrt();
            twist = history.twist - shear_stiff * spread * about * dt;
            let mut total = twist - dashpots[1] * spread * about;
            used = used.hypot(total / (limit * radius));
            if used > 1.0 {
                total /= used;
                twist = total;
            }
            moment = n * total;
            if touch.rocks {
                moment += rocking(touch, &(turning - n * about), dashpots[0], normal);
            }
        }
        if used > 1.0 {
            shear /= used;
            spring = shear;
        }
        moment += touch.couple * normal;
        history.normal = n;
        history.shear = spring;
        history.twist = twist;

        let force = n * normal + shear;
        ContactResponse {
            force,
            on_first: -arms[0].cross(&force) - moment,
            on_second: arms[1].cross(&force) + moment,
        }
    }
}

/// Returns the moment [N m] of the normal dashpots on the second body if the patch rotates at the rate `across`
/// about axes in its plane.
fn rocking(touch: &Geometry, across: &Vector3<f64>, dashpot: f64, normal: f64) -> Vector3<f64> {
    let polar = touch.polar();
    // Rotation about an axis moves the points off their positions: with arms rotated by a right angle, Q = J -
    // second moments.
    let about_axis = |axis: &Vector3<f64>| axis * polar - touch.second * axis;
    let rocking = about_axis(across) * (-dashpot / touch.area);
    let size = rocking.norm();
    if size <= 0.0 {
        return rocking;
    }
    let axis = rocking / size;
    let gyration = (axis.dot(&about_axis(&axis)) / touch.area).max(0.0).sqrt();
    axis * size.min(normal * gyration)
}

/// Returns a tangential vector transported from one normal to the next by the shortest rotation, then rotated about
/// it by an angle [rad].
fn carry(
    tangent: &Vector3<f64>,
    old: &Vector3<f64>,
    new: &Vector3<f64>,
    angle: f64,
) -> Vector3<f64> {
    let length = tangent.norm();
    if length <= 0.0 {
        return Vector3::zeros();
    }
    let axis = old.cross(new);
    let cos = old.dot(new);
    // Rodrigues' rotation of a vector normal to the old normal; if the normal has reversed, the spring restarts at
    // zero.
    let turned = if cos > -0.9 {
        tangent + axis.cross(tangent) + axis * (axis.dot(tangent) / (1.0 + cos))
            - tangent * (1.0 - cos)
    } else {
        return Vector3::zeros();
    };
    let (sin, cos) = angle.sin_cos();
    let about = turned * cos + new.cross(&turned) * sin;
    // Corrects rounding: the vector is projected normal to the new normal and keeps its length.
    let flat = about - new * new.dot(&about);
    let size = flat.norm();
    if size > 0.0 {
        flat * (length / size)
    } else {
        Vector3::zeros()
    }
}
