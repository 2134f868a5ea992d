//! Kind, mass and fill level of the cells of a slab and of its ghost cells, by position ([`Populations::cell`]).

use super::kind::{HELD, SOLID};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::number::{real, to_u32};
use std::collections::HashSet;

/// Minimum fraction without body by which the mass of water in a cell is divided.
const MIN_FREE: f64 = 1e-3;

/// Orders of the axes. The first two contain both orders of any two axes.
const ORDERS: [[usize; 3]; 6] = [
    [0, 1, 2],
    [2, 1, 0],
    [0, 2, 1],
    [1, 0, 2],
    [1, 2, 0],
    [2, 0, 1],
];

/// State of the cells.
#[derive(Debug)]
pub(crate) struct Cells {
    pub(super) kind: Vec<u8>,
    /// Mass of interface cells, including water in the volume of bodies; 0 in other cells.
    pub(super) mass: Vec<f64>,
    /// Fill level of the part free of bodies: m/ρ in interface cells without bodies, 1 in liquid, 0 in gas.
    pub(super) fill: Vec<f64>,
    /// Excess mass for each interface cell next to a cell that has changed kind; usually 0.
    pub(super) share: Vec<f64>,
    /// `true` for cells with a share among their neighbours.
    pub(super) takes: Vec<bool>,
    /// `true` for interface cells that the liquid cell inside carries, during a step.
    pub(super) carried: Vec<bool>,
    /// Fraction filled by bodies; empty in a fluid without bodies.
    pub(super) solid: Vec<f64>,
    /// Bits of the directions along which sheets intersect the links of a cell; the bit of direction 0 is set for a
    /// cell at an opening with water outside. Empty without sheets and openings.
    closed: Vec<u32>,
    /// Cells and directions of the links through openings.
    open: HashSet<(u32, u8)>,
    /// Distance in positions to the neighbour along each direction and along each axis.
    offsets: Vec<isize>,
    strides: [isize; 3],
}

impl Cells {
    /// Returns the state with solid cells only.
    pub(super) fn new<S: Stored>(populations: &Populations<S>) -> Self {
        let count = populations.cell_positions();
        let q = populations.velocities().q();
        let mut kind = vec![SOLID; count];
        for (_, cell) in populations.interior() {
            kind[cell] = super::kind::GAS;
        }
        Self {
            kind,
            mass: vec![0.0; count],
            fill: vec![0.0; count],
            share: vec![0.0; count],
            takes: vec![false; count],
            carried: vec![false; count],
            solid: Vec::new(),
            closed: Vec::new(),
            open: HashSet::new(),
            offsets: (0..q).map(|i| populations.offset(i)).collect(),
            strides: std::array::from_fn(|axis| {
                let mut at = [0; 3];
                at[axis] = 1;
                populations.cell(at).cast_signed() - populations.cell([0; 3]).cast_signed()
            }),
        }
    }

    /// Closes the link of a cell along a direction.
    pub(super) fn close(&mut self, cell: usize, direction: usize) {
        if self.closed.is_empty() {
            self.closed = vec![0; self.kind.len()];
        }
        self.closed[cell] |= 1 << direction;
    }

    /// Marks a cell next to water outside an opening.
    pub(super) fn feed(&mut self, cell: usize) {
        self.close(cell, 0);
    }

    /// Clears the mark set by [`Self::feed`].
    pub(super) fn clear_feed(&mut self, cell: usize) {
        if let Some(bits) = self.closed.get_mut(cell) {
            *bits &= !1;
        }
    }

    /// Marks a link through an opening.
    pub(super) fn open(&mut self, cell: usize, direction: u8) {
        self.open.insert((to_u32(cell), direction));
    }

    /// Returns `true` if the link of a cell along a direction leads through an opening.
    pub(super) fn leads_out(&self, cell: usize, direction: usize) -> bool {
        !self.open.is_empty()
            && u8::try_from(direction)
                .is_ok_and(|direction| self.open.contains(&(to_u32(cell), direction)))
    }

    /// Returns `true` for a cell next to water outside an opening.
    #[inline(always)]
    pub(super) fn is_fed(&self, cell: usize) -> bool {
        !self.closed.is_empty() && self.closed[cell] & 1 != 0
    }

    /// Returns the fraction of a cell filled by bodies.
    #[inline(always)]
    pub(super) fn solid(&self, cell: usize) -> f64 {
        if self.solid.is_empty() {
            0.0
        } else {
            self.solid[cell]
        }
    }

    /// Returns the fraction of a cell that is not gas, between 0 and 1.
    #[inline(always)]
    pub(super) fn content(&self, cell: usize) -> f64 {
        let fill = self.fill[cell].clamp(0.0, 1.0);
        fill + (1.0 - fill) * self.solid(cell)
    }

    /// Returns the fill level of an interface cell from its density.
    #[inline(always)]
    pub(super) fn fill_from(&self, cell: usize, mass: f64, density: f64) -> f64 {
        let solid = self.solid(cell);
        if solid > 0.0 {
            (mass - solid) / (density * (1.0 - solid).max(MIN_FREE))
        } else {
            mass / density
        }
    }

    /// Returns `true` if bodies are known.
    #[inline(always)]
    pub(super) fn has_bodies(&self) -> bool {
        !self.solid.is_empty()
    }

    /// Returns `true` if a body fills part of a cell or of an adjacent cell.
    pub(super) fn meets_body(&self, cell: usize) -> bool {
        !self.solid.is_empty()
            && (self.solid[cell] > 0.0 || self.count_neighbours(cell, |kind| kind == HELD) > 0)
    }

    /// Returns the positions of the neighbours of a cell along the axes.
    pub(super) fn along_axes(&self, cell: usize, dimension: usize) -> impl Iterator<Item = usize> {
        let strides = self.strides;
        (0..dimension).flat_map(move |axis| {
            [-strides[axis], strides[axis]].map(|stride| cell.wrapping_add_signed(stride))
        })
    }

    /// Returns the number of directions.
    #[inline(always)]
    pub(super) fn directions(&self) -> usize {
        self.offsets.len()
    }

    /// Returns the position of the neighbour of a cell along a direction.
    #[inline(always)]
    pub(super) fn neighbour(&self, cell: usize, i: usize) -> usize {
        cell.wrapping_add_signed(self.offsets[i])
    }

    /// Returns the kind of the neighbour of a cell along a direction; solid if a sheet is between them.
    #[inline(always)]
    pub(super) fn kind_along(&self, cell: usize, i: usize) -> u8 {
        if !self.closed.is_empty() && self.closed[cell] & (1 << i) != 0 {
            return SOLID;
        }
        self.kind[self.neighbour(cell, i)]
    }

    /// Returns `true` if links or openings are marked in any cell.
    #[inline(always)]
    pub(super) fn has_closed(&self) -> bool {
        !self.closed.is_empty()
    }

    /// Returns the bits of the closed directions of a cell: see [`Self::close`] and [`Self::feed`].
    #[inline(always)]
    pub(super) fn closed(&self, cell: usize) -> u32 {
        if self.closed.is_empty() {
            0
        } else {
            self.closed[cell]
        }
    }

    /// Returns the fill level behind a wall along a velocity, between 0 and 1: that of the mirror image.
    ///
    /// At a convex edge of a wall the image depends on the axis that is reflected first: the level is the mean over the
    /// orders of the axes.
    pub(super) fn mirrored_level(&self, cell: usize, c: [i8; 3]) -> f64 {
        let orders = match c.iter().filter(|&&c| c != 0).count() {
            0 | 1 => 1,
            2 => 2,
            _ => ORDERS.len(),
        };
        let images = ORDERS[..orders].iter().map(|order| {
            let mut at = cell;
            for &axis in order {
                let next = at.wrapping_add_signed(isize::from(c[axis]) * self.strides[axis]);
                if !matches!(self.kind[next], SOLID | HELD) {
                    at = next;
                }
            }
            at
        });
        let first = images.clone().next().unwrap_or(cell);
        let level = |at: usize| self.fill[at].clamp(0.0, 1.0);
        if images.clone().all(|at| at == first) {
            return level(first);
        }
        images.map(level).sum::<f64>() / real(orders)
    }

    /// Returns the number of neighbours of a cell whose kind satisfies `holds`.
    pub(super) fn count_neighbours(&self, cell: usize, holds: impl Fn(u8) -> bool) -> usize {
        (1..self.directions())
            .filter(|&i| holds(self.kind_along(cell, i)))
            .count()
    }

    /// Returns the sum of the excess masses that a cell receives from its neighbours.
    #[inline(always)]
    pub(super) fn shares_taken(&self, cell: usize) -> f64 {
        let mut sum = 0.0;
        for i in 1..self.directions() {
            let share = self.share[self.neighbour(cell, i)];
            if share != 0.0 && self.kind_along(cell, i) != SOLID {
                sum += share;
            }
        }
        sum
    }
}
