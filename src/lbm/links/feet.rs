//! Feet of bodies: links that leave the domain next to a body.
//!
//! A link from a cell in the corner between a face of the domain and a body leaves the domain along one or two axes and
//! leads into the body along the others. The face returns its population, but its momentum acts on both: along the axes
//! on which it leaves on the face, along the others on the body. Without these links a sixth of the pressure on the
//! lowest cell of a body that stands on a face would be missing.
//!
//! The body receives 2 f*_i - 6 w_i c_i·u_b, as if its own surface, of velocity u_b, had returned the population. The
//! difference from what a wall returns is a shear force on the wall. Along a link through an opening the body receives
//! the momentum of both populations.

use super::{BodyLink, Load, Rigid, add_force, surface_velocity};
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::quanta;
use crate::term::{FootAxes, FootLoad};

/// Link through a face at the foot of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FootLink {
    /// Link from the cell of water through the face.
    pub link: BodyLink,
    /// Position of the cell.
    pub cell: u32,
    /// Axes along which the link leads into the body.
    pub axes: FootAxes,
    /// `true` if the face is an opening, otherwise it is a wall.
    pub opening: bool,
}

/// Adds the loads on a body at its feet, after the faces have returned their populations, and lists them.
pub fn load_feet<S: Stored, const D: usize>(
    populations: &Populations<S>,
    feet: &[FootLink],
    motion: &Rigid,
    load: &mut Load,
    given: &mut Vec<FootLoad>,
) {
    let (parity, numbers) = (populations.parity(), populations.numbers());
    let velocities = populations.velocities();
    for foot in feet {
        let BodyLink {
            link,
            middle,
            direction,
            ..
        } = foot.link;
        let (c, w) = (
            velocities.c[usize::from(direction)],
            velocities.w[usize::from(direction)],
        );
        let left = numbers[link.out(parity)].to_f64();
        let along = if foot.opening {
            quanta(left) + quanta(numbers[link.incoming(parity)].to_f64())
        } else {
            let r = std::array::from_fn(|a| 0.5 * f64::from(middle[a]) - motion.position[a]);
            let u = surface_velocity::<D>(motion, r);
            quanta(2.0 * left - crate::boundary::wall::term(w, c, u))
        };
        let part = |a: usize| i64::from(foot.axes[a]) * i64::from(c[a]);
        add_force::<D>(load, std::array::from_fn(|a| part(a) * along), middle);
        given.push(FootLoad {
            link: (foot.cell, direction),
            axes: foot.axes,
            given: along,
        });
    }
}
