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
//!
//! In the corner between two bodies, or between a body and a structure, a link acts in the same way by axis on both
//! ([`CornerLink`]).

use super::{BodyLink, Load, Rigid, add_force, surface_velocity};
use crate::lanes::Stored;
use crate::populations::{Link, Populations};
use crate::quanta::quanta;
use crate::term::{FootAxes, FootLoad, bounded_sum};

/// Link through a face at the foot of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FootLink {
    /// Link from the cell of water through the face.
    pub link: BodyLink,
    /// Position of the cell.
    pub cell: u32,
    /// Axes along which the link leads into the body.
    pub axes: FootAxes,
    /// `true` if the body receives the momentum of both populations: at openings, and if the link leads past the body
    /// into a structure.
    pub both: bool,
    /// Structure into which the link leads past the body, which has the momentum of the link as well.
    pub structure: Option<AtStructure>,
}

/// Component along one axis of the momentum of a link in the corner between two solids.
///
/// A link that ends in one solid crosses the other one, which is next to its cell along an axis. The component along
/// this axis acts on that solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerLink {
    /// Positions of the populations.
    pub link: Link,
    /// Midpoint of the link in half cells, in the frame of the body's raw position.
    pub middle: [i32; 3],
    /// Axis.
    pub axis: usize,
    /// Component of the direction along the axis.
    pub along: i8,
    /// `true` if the body receives the component, `false` if it gives it away.
    pub receives: bool,
    /// Population that has left along the link in this step.
    pub left: f64,
}

/// Link in the corner between a body and a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureCorner {
    /// Link at the body.
    pub link: CornerLink,
    /// Structure that gives or receives the component.
    pub structure: AtStructure,
}

/// Point of a link at a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtStructure {
    /// Positions of cells in the map: the structure is that of the lowest index in them.
    pub places: [u32; 3],
    /// Midpoint of the link in half cells, in the frame of the domain.
    pub middle: [i32; 3],
}

impl CornerLink {
    /// Keeps the population that leaves, before solids reflect it.
    pub fn keep<S: Stored>(&mut self, populations: &Populations<S>) {
        self.left = populations.numbers()[self.link.out(populations.parity())].to_f64();
    }

    /// Adds the component to the load on the body after the population has returned, and returns this force in quanta.
    pub fn load<S: Stored, const D: usize>(
        &self,
        populations: &Populations<S>,
        load: &mut Load,
    ) -> [i64; 3] {
        let returned = populations.numbers()[self.link.incoming(populations.parity())].to_f64();
        let both = i64::from(self.along) * bounded_sum(quanta(self.left), quanta(returned));
        let mut force = [0; 3];
        force[self.axis] = if self.receives { both } else { -both };
        add_force::<D>(load, force, self.middle);
        force
    }
}

/// Adds the loads on a body at its feet, after the faces have returned their populations, lists them, and passes those
/// that a structure loses.
pub fn load_feet<S: Stored, const D: usize>(
    populations: &Populations<S>,
    feet: &[FootLink],
    motion: &Rigid,
    load: &mut Load,
    given: &mut Vec<FootLoad>,
    mut lose: impl FnMut(AtStructure, [i64; 3]),
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
        let along = if foot.both {
            bounded_sum(
                quanta(left),
                quanta(numbers[link.incoming(parity)].to_f64()),
            )
        } else {
            let r = std::array::from_fn(|a| 0.5 * f64::from(middle[a]) - motion.position[a]);
            let u = surface_velocity::<D>(motion, r);
            quanta(2.0 * left - crate::boundary::wall::term(w, c, u))
        };
        let part = |a: usize| i64::from(foot.axes[a]) * i64::from(c[a]);
        let force: [i64; 3] = std::array::from_fn(|a| part(a) * along);
        add_force::<D>(load, force, middle);
        if let Some(structure) = foot.structure {
            lose(structure, force);
        }
        given.push(FootLoad {
            link: (foot.cell, direction),
            axes: foot.axes,
            given: along,
        });
    }
}
