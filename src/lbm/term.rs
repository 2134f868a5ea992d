//! Terms of the fluid step: all operations on the populations in addition to collision and streaming.
//!
//! The step queries the list of its terms ([`super::fluid::Fluid::terms`]): may two steps be made in one sweep, can
//! a GPU run the term, which momentum did it add to the water, and what is the velocity of a cell between two
//! steps? The defaults of [`Term`] are on the safe side, so that a term that does not override them costs speed and
//! not correctness.
//!
//! | term | acts | file |
//! |---|---|---|
//! | body force | in the collision | `fluid/force.rs` |
//! | eddy viscosity | in the collision | `turbulence.rs` |
//! | covered cells | in the collision | `saturation/cover.rs` |
//! | boundaries | after the exchange of the halos | `boundary.rs` |
//! | closed cells | after the boundaries | here |
//! | free surface | around the collision | `surface.rs` |
//! | porous zones | before the collision, through [`Term::act`] | `term/porous.rs` |
//!
//! A new term that acts on the incoming populations of its cells is a file with a type that implements [`Term`],
//! and a file in `plan::scene::terms`, which has all that a scene, a plan and a run need of it.

pub mod porous;

use super::boundary::Boundaries;
use super::feet::{FootLoad, StructureFoot};
use super::fluid::Force;
use super::lanes::Stored;
use super::populations::Populations;
use super::saturation::Cover;
use super::surface::SlabSurface;
use super::turbulence::EddyViscosity;
use std::collections::{HashMap, HashSet};

/// Function that makes a term for the slab of these populations, whose first cell is given in cells of the domain.
pub type TermBuilder<S> = Box<dyn Fn(&Populations<S>, [usize; 3]) -> Box<dyn Term<S>>>;

/// Operation on the fluid in a step.
pub trait Term<S: Stored> {
    /// Returns the name of the term in messages: "a GPU does not run ... yet".
    fn name(&self) -> &'static str;

    /// Returns `true` if two steps may be made in one sweep, because the term requires only the collision and the
    /// walls between them.
    fn allows_two_steps(&self) -> bool {
        false
    }

    /// Returns `true` if GPU kernels support the term.
    fn runs_on_gpu(&self) -> bool {
        false
    }

    /// Changes the incoming populations of the cells, before they collide with `half` of the body force.
    fn act(&mut self, _populations: &mut Populations<S>, _half: [f64; 3], _cover: Option<&Cover>) {}

    /// Returns the momentum that the cells for which `counts` is true (local coordinates) received in the last
    /// step, in quanta; the uniform body force is counted elsewhere.
    fn impulse(
        &self,
        _populations: &Populations<S>,
        _counts: &dyn Fn([usize; 3]) -> bool,
    ) -> [i128; 3] {
        [0; 3]
    }

    /// Returns `true` if the term changes the velocities between two steps, in addition to momentum and body force.
    fn changes_velocities(&self) -> bool {
        false
    }

    /// Returns the velocity of the cell at a position, given that from its momentum and half of the body force.
    fn velocity(
        &self,
        _position: usize,
        of_momentum: [f64; 3],
        _cover: Option<&Cover>,
    ) -> [f64; 3] {
        of_momentum
    }

    /// Returns the inverse of [`Self::velocity`].
    fn of_momentum(
        &self,
        _position: usize,
        velocity: [f64; 3],
        _cover: Option<&Cover>,
    ) -> [f64; 3] {
        velocity
    }
}

impl<S: Stored> Term<S> for Force {
    fn name(&self) -> &'static str {
        "a body force"
    }
    fn allows_two_steps(&self) -> bool {
        true
    }
    fn runs_on_gpu(&self) -> bool {
        true
    }
}

impl<S: Stored> Term<S> for EddyViscosity {
    fn name(&self) -> &'static str {
        "a fluid with an eddy viscosity"
    }
    fn allows_two_steps(&self) -> bool {
        true
    }
}

impl<S: Stored> Term<S> for Boundaries<S> {
    fn name(&self) -> &'static str {
        "a fluid with openings or with faces of free slip"
    }
    fn allows_two_steps(&self) -> bool {
        self.are_walls()
    }
    fn runs_on_gpu(&self) -> bool {
        self.are_walls()
    }
}

impl<S: Stored> Term<S> for Cover {
    fn name(&self) -> &'static str {
        "cells that solids cover"
    }
    fn runs_on_gpu(&self) -> bool {
        true
    }
}

impl<S: Stored> Term<S> for SlabSurface {
    fn name(&self) -> &'static str {
        "a free surface"
    }
    fn allows_two_steps(&self) -> bool {
        self.allows_two_steps()
    }
}

/// Cells of structures, at which openings are closed, and links through faces at the feet of solids.
#[derive(Clone, Debug, Default)]
pub struct ClosedCells {
    /// `true` for the cells of structures, by position; empty without structures.
    closed: Vec<bool>,
    /// Links, by position of the cell and direction, that structures cut at planes of symmetry.
    cut: HashSet<(u32, u8)>,
    /// Links through faces at the feet of structures, by position of the cell and direction.
    feet: HashMap<(u32, u8), StructureFoot>,
    /// Momenta that bodies received in the last step at links through faces.
    at_bodies: Vec<FootLoad>,
}

/// Momenta that solids received in the last step at links through faces.
pub struct Feet<'a> {
    structures: &'a HashMap<(u32, u8), StructureFoot>,
    bodies: HashMap<(u32, u8), [Option<i64>; 3]>,
}

impl Feet<'_> {
    /// Returns the momentum along a link that solids have received for each axis, in quanta; none for axes along which
    /// the face has it. The link is given by position of the cell and direction, with the populations that left along
    /// it and returned, in quanta.
    #[must_use]
    pub fn given(&self, link: (u32, u8), sent: [i64; 2]) -> [Option<i64>; 3] {
        let mut given = self.bodies.get(&link).copied().unwrap_or_default();
        if let Some(foot) = self.structures.get(&link) {
            for (given, leads) in given.iter_mut().zip(foot.axes) {
                if leads && given.is_none() {
                    *given = Some(foot.given(sent));
                }
            }
        }
        given
    }
}

impl ClosedCells {
    /// Marks the cells at these positions of a slab as closed.
    pub fn close<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        cells: impl Iterator<Item = usize>,
    ) {
        self.closed = vec![false; populations.cell_positions()];
        for cell in cells {
            self.closed[cell] = true;
        }
    }

    /// Records the links, by position of the cell and direction, that structures cut at planes of symmetry.
    pub fn cut_at_planes(&mut self, links: impl Iterator<Item = (u32, u8)>) {
        self.cut = links.collect();
    }

    /// Returns `true` if a structure cuts a link, given by position of the cell and direction, at a plane of symmetry.
    #[must_use]
    pub fn cuts(&self, link: (u32, u8)) -> bool {
        self.cut.contains(&link)
    }

    /// Records the links through faces at the feet of structures: the momentum along the axes that lead into
    /// structures is a load on these, not on the face.
    pub fn share_feet(&mut self, links: impl Iterator<Item = ((u32, u8), StructureFoot)>) {
        self.feet = links.collect();
    }

    /// Returns the momenta that bodies received in the last step at links through faces, for the coupling to set.
    pub fn at_bodies_mut(&mut self) -> &mut Vec<FootLoad> {
        &mut self.at_bodies
    }

    /// Returns the momenta that solids received in the last step at links through faces.
    #[must_use]
    pub fn feet(&self) -> Feet<'_> {
        let mut bodies = HashMap::<_, [Option<i64>; 3]>::new();
        for load in &self.at_bodies {
            let sums = bodies.entry(load.link).or_default();
            for (sum, _) in sums.iter_mut().zip(load.axes).filter(|(_, leads)| *leads) {
                *sum = Some(load.given);
            }
        }
        Feet {
            structures: &self.feet,
            bodies,
        }
    }

    /// Returns `true` if there are no structures.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.closed.is_empty()
    }

    /// Returns `true` if the cell at a position belongs to a structure.
    #[must_use]
    pub fn holds(&self, position: usize) -> bool {
        self.closed.get(position).is_some_and(|closed| *closed)
    }

    /// Returns the solid fraction of the cell at a position, 0 or 1.
    #[must_use]
    pub fn fraction(&self, position: usize) -> f64 {
        f64::from(u8::from(self.closed[position]))
    }
}

impl<S: Stored> Term<S> for ClosedCells {
    fn name(&self) -> &'static str {
        "structures"
    }
    fn allows_two_steps(&self) -> bool {
        self.is_empty()
    }
    fn runs_on_gpu(&self) -> bool {
        self.is_empty()
    }
}
