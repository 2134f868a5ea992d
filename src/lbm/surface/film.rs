//! Films: water on a wall without a liquid cell inside.
//!
//! Water on a wall that is at most one cell thick has no liquid cell from which the traction could be extrapolated.
//! With the pressure of the gas in it, nothing would resist the part of gravity along a slope of its surface: the edge
//! of water at rest would run down and empty, and a wave of a film would have no force that restores it. A wall
//! carries the part of the body force along each axis along which it lies next to the cell, on either side: a floor
//! by pressure, a ceiling by suction. The density of a film is that of water at rest under this part of the force,
//! zero at the surface, as in shallow water. Along an axis without a wall the water falls freely: a film on a vertical
//! wall and a jet have the pressure of the gas.
//!
//! Links through openings are no walls, and the surface of a body is none.

use super::cells::Cells;
use super::facet::bounded;
use super::ghosts::Around;
use super::kind::{HELD, SOLID};
use super::stencil::Stencil;
use crate::lanes::Stored;
use crate::lattice::Lattice;
use crate::populations::Populations;
use base::vector::dot;

/// Minimum part of the body force along an axis that a wall carries: a vertical wall carries nothing where gravity
/// has a rounded component across it.
const LEAST: f64 = 0.01;

/// Returns the components of half of the body force that walls can carry.
pub(super) fn heavy(half_force: [f64; 3]) -> [f64; 3] {
    let least = LEAST * dot(half_force, half_force).sqrt();
    half_force.map(|f| if f.abs() > least { f } else { 0.0 })
}

/// Surface of the film in a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// Normal towards the gas.
    pub(super) normal: [f64; 3],
    /// Gradient of the density along the normal.
    pub(super) at_rest: f64,
}

/// Walls around cells: faces of the domain, structures, sheets and planes of symmetry.
#[derive(Clone, Copy)]
pub(super) struct Walls<'a, S: Stored> {
    pub(super) cells: &'a Cells,
    pub(super) around: &'a Around,
    pub(super) populations: &'a Populations<S>,
}

impl<S: Stored> Walls<'_, S> {
    /// Returns `true` if a wall closes the link of a cell along a direction.
    fn closes(&self, cell: usize, i: usize) -> bool {
        let next = self.cells.neighbour(cell, i);
        let solid = self.cells.kind_along(cell, i) == SOLID && !self.cells.leads_out(cell, i);
        solid || self.around.reflects(self.populations, next)
    }

    /// Returns the lower and the upper side of each axis for which `is` returns `true` for the direction along it.
    fn sides<L: Lattice<Q>, const Q: usize>(is: impl Fn(usize) -> bool) -> [[bool; 2]; 3] {
        let mut sides = [[false; 2]; 3];
        for (i, c) in L::C.iter().enumerate().skip(1) {
            if c.iter().map(|c| c.abs()).sum::<i8>() != 1 {
                continue;
            }
            for (sides, &c) in sides.iter_mut().zip(c) {
                if c != 0 {
                    sides[usize::from(c > 0)] = is(i);
                }
            }
        }
        sides
    }

    /// Returns the sides of a cell along which a wall is next to it.
    fn walled<L: Lattice<Q>, const Q: usize>(&self, cell: usize) -> [[bool; 2]; 3] {
        Self::sides::<L, Q>(|i| self.closes(cell, i))
    }

    /// Returns `true` if a wall lies below a cell along an axis: water that rests on it is not stray.
    #[cold]
    pub(super) fn carry<L: Lattice<Q>, const Q: usize>(
        &self,
        cell: usize,
        half_force: [f64; 3],
    ) -> bool {
        let sides = self.walled::<L, Q>(cell);
        let mut axes = heavy(half_force).into_iter().zip(sides);
        axes.any(|(f, sides)| f != 0.0 && sides[usize::from(f > 0.0)])
    }

    /// Returns the film in a cell without a liquid cell inside, for half of the body force; `None` if no wall carries
    /// the water.
    ///
    /// In the gradient of the fill levels the cells behind these walls count as water. The mirror image of a film of
    /// less than one cell would end behind the wall and turn the normal towards it.
    #[cold]
    pub(super) fn film<L: Lattice<Q>, const Q: usize>(
        &self,
        cell: usize,
        half_force: [f64; 3],
    ) -> Option<Film> {
        let sides = self.walled::<L, Q>(cell);
        // At the edge of an opening and a plane of symmetry a diagonal link belongs to the one or the other, which
        // depends on the slab: there it is open.
        let open = Self::sides::<L, Q>(|i| self.cells.leads_out(cell, i));
        let mut carried = heavy(half_force);
        for (f, sides) in carried.iter_mut().zip(sides) {
            if sides == [false; 2] {
                *f = 0.0;
            }
        }
        if carried.iter().all(|f| f.abs() <= 0.0) {
            return None;
        }
        let mut sum = [0.0; 3];
        for i in 1..Q {
            let c = L::C[i];
            let on = |sides: [[bool; 2]; 3], a: usize| c[a] != 0 && sides[a][usize::from(c[a] > 0)];
            let below = (0..3).any(|a| carried[a] != 0.0 && on(sides, a));
            let outward = (0..3).any(|a| on(open, a));
            let level = if below && !outward && self.closes(cell, i) {
                1.0
            } else if matches!(self.cells.kind_along(cell, i), SOLID | HELD) {
                self.cells.mirrored_level(cell, c)
            } else {
                bounded(self.cells.fill[self.cells.neighbour(cell, i)], 0.0, 1.0)
            };
            for (sum, c) in sum.iter_mut().zip(Stencil::<L, Q>::C[i]) {
                *sum -= c * (L::W[i] * level);
            }
        }
        let length = dot(sum, sum).sqrt();
        let normal = sum.map(|n| n / length);
        (length > 0.0).then(|| Film {
            normal,
            at_rest: 6.0 * dot(carried, normal),
        })
    }
}
