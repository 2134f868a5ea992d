//! Springs of blocks (B-04), with damping by mass (B-01).
//!
//! Two blocks, a block and a sphere and a block at a wall meet in the narrow phase of [`crate::dem::polyhedron`], and their force is
//! [`crate::dem::polyhedron::force`]. Here are the parameters, and the same law for two spheres and a sphere at a wall:
//!
//! ```text
//! F_n = k_n overlap - c_n d(gap)/dt, at least 0
//! F_s = cut(F_s' - k_s slip dt - c_s slip)      cut to length mu F_n
//! area = pi R overlap,   R = r1 r2/(r1 + r2), the radius at a wall
//! ```
//!
//! The area counts where stiffness is per area; to leading order the volume of the overlap is `area overlap`, as for a block's patch.

use super::super::blocks::{in_space, out_of_space};
use super::super::polyhedron::{self, History, Model, Polyhedron};
use super::super::space::{Components, Space};
use super::super::{Body, Kind};
use super::{ContactLaw, PairTable, PairProperties, ContactForce, ContactKinematics, cut_to};

/// The law: see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// Per pair of materials.
    pub parameters: PairTable<polyhedron::Law>,
    /// How contacts of blocks are condensed to a point.
    pub model: Model,
    /// Damping in proportion to mass (1/s) of all bodies, blocks and spheres; 0 for none.
    pub mass_damping: f64,
}

/// Per pair: effective mass (kg), and `r1 r2/(r1 + r2)` (m) of the spheres round both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    pub(in crate::dem) mass: f64,
    radius: f64,
}

/// Per pair: see [`Scale`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    pub(in crate::dem) law: polyhedron::Law,
    pub(in crate::dem) scale: Scale,
}

impl Blocks {
    /// `sqrt(m/k)` (s) of the stiffest contact that any free one of these blocks can make with bodies or walls of `materials`
    /// materials, for stiffness per area over the block's largest face. The explicit step must stay well below: 0.1 is usual.
    #[must_use]
    pub fn critical_time_step<'a>(
        &self,
        blocks: impl IntoIterator<Item = (&'a Body, &'a Polyhedron)>,
        materials: u32,
    ) -> f64 {
        let mut limit = f64::INFINITY;
        for (body, shape) in blocks {
            if body.kind != Kind::Free {
                continue;
            }
            let area = shape.largest_face();
            for material in 0..materials.max(1) {
                let law = self.parameters.get(body.material, material);
                let [normal, shear] = law.stiffness(area);
                limit = limit.min((body.mass / normal.max(shear)).sqrt());
            }
        }
        limit
    }
}

impl<S: Space> ContactLaw<S> for Blocks {
    type Row = polyhedron::Law;
    type Scale = Scale;
    type Constants = Constants;
    type History = History;

    fn table(&self) -> PairTable<Self::Row> {
        self.parameters.clone()
    }

    fn scale(_: &Self::Row, pair: &PairProperties) -> Scale {
        Scale {
            mass: pair.mass,
            radius: pair.rolling_radius,
        }
    }

    #[inline(always)]
    fn constants(row: &Self::Row, scale: &Scale, _: f64) -> Constants {
        Constants {
            law: *row,
            scale: *scale,
        }
    }

    #[inline(always)]
    fn force(constants: &Constants, history: &mut History, kinematics: &ContactKinematics<S>) -> ContactForce<S> {
        let Constants { law, scale } = constants;
        let [normal, shear] = law.stiffness(std::f64::consts::PI * scale.radius * kinematics.overlap);
        let dashpot =
            |fraction: f64, stiffness: f64| 2.0 * fraction * (scale.mass * stiffness).sqrt();
        let push =
            normal * kinematics.overlap - dashpot(law.normal_damping, normal) * kinematics.separation_rate;
        let push = push.max(0.0);
        let limit = law.friction * push;
        let carried = S::turn(&out_of_space(&history.spring()), &kinematics.normal);
        let spring = carried - kinematics.slip * (shear * kinematics.time_step);
        let total = spring - kinematics.slip * dashpot(law.shear_damping, shear);
        let length = total.length();
        let (tangent, spring) = if length > limit {
            let cut = cut_to(total, length, limit);
            (cut, cut)
        } else {
            (total, spring)
        };
        history.hold(&S::to_volume(&kinematics.normal), &in_space(&spring));
        ContactForce {
            normal: push,
            tangent,
            moment: S::Spin::default(),
            failure: None,
        }
    }

    fn bonded(_: &History) -> bool {
        false
    }

    fn bond(_: &Constants, _: &mut History, _: f64) -> bool {
        false
    }

    fn normal_spring(constants: &Constants, _: &History, overlap: f64) -> f64 {
        let area = std::f64::consts::PI * constants.scale.radius * overlap;
        constants.law.stiffness(area)[0] * overlap
    }

    fn unbond(_: &mut History) {}

    fn widest_opening(&self, _: [f64; 2]) -> f64 {
        0.0
    }

    /// Over the section of the sphere: no patch of what is inside it is larger.
    fn stiffness(constants: &Constants) -> [f64; 2] {
        let radius = constants.scale.radius;
        constants
            .law
            .stiffness(std::f64::consts::PI * radius * radius)
    }

    const NUMBERS: usize = History::NUMBERS;

    fn save(history: &History, numbers: &mut Vec<f64>) {
        numbers.extend(history.save());
    }

    fn load(numbers: &[f64]) -> History {
        let mut all = [0.0; History::NUMBERS];
        for (number, saved) in all.iter_mut().zip(numbers) {
            *number = *saved;
        }
        History::load(&all)
    }
}
