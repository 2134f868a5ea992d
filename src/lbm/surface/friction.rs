//! Friction of films of less than one cell on walls at rest.
//!
//! The links of an interface cell to the gas carry no shear, and those to the wall act on the momentum of a whole cell.
//! A film of any thickness would therefore move like one that fills its cell. Under a force g along the wall that film
//! has the velocity g/(K ν) in the centre of the cell, with K = 8/3 in the exact parabola (TRT with a magic parameter
//! of 3/16; up to 4 with BGK); a film of thickness d has the mean velocity g d²/(3 ν) (W. Nusselt, Z. VDI 60 (1916)
//! 541). The difference is a force of the wall per mass,
//!
//! F = -κ u,  κ = ν (3/d² - K),
//!
//! which acts at the end of the step on the components along the wall. It is implicit, u' = u/(1 + κ), and stable for
//! any κ. The thickness is the fill level. The wall carries the film ([`super::film`]), and the cell has gas opposite
//! the wall and no liquid next to it.
//!
//! Only faces of the domain brake. Structures have steps on the lattice, so that the fill level of a cell is not the
//! thickness of the film on an inclined surface.

use super::batch::{Batch, each_part};
use super::cells::Cells;
use super::film::heavy;
use super::kind::{GAS, SURFACE};
use super::stencil::{Numbers, Stencil};
use crate::lanes::Stored;
use crate::lattice::Lattice;
use crate::populations::Populations;
use base::number::to_u32;
use std::collections::HashSet;

/// Friction of a film that fills its cell, over its viscosity.
const OF_CELL: f64 = 8.0 / 3.0;

/// Minimum thickness in cells: water below it is given to the cells around it.
const THINNEST: f64 = 0.2;

/// Walls and conditions of films.
#[derive(Default)]
pub(super) struct Films {
    /// Half of the body force at the start, which decides where walls carry films.
    pub(super) half_force: [f64; 3],
    /// Cells and directions of the links to faces at rest.
    walls: HashSet<(u32, u8)>,
    /// Half of the body force and viscosity of the last step.
    drive: ([f64; 3], f64),
}

impl Films {
    /// Returns the conditions without walls, for half of the body force at the start.
    pub(super) fn new(half_force: [f64; 3]) -> Self {
        Self {
            half_force,
            ..Self::default()
        }
    }

    /// Sets the links to faces at rest.
    pub(super) fn set_walls(&mut self, walls: HashSet<(u32, u8)>) {
        self.walls = walls;
    }

    /// Returns half of the body force of the last step.
    pub(super) fn half_force(&self) -> [f64; 3] {
        self.drive.0
    }

    /// Sets half of the body force and the viscosity of a step.
    pub(super) fn set_drive(&mut self, half_force: [f64; 3], viscosity: f64) {
        self.drive = (half_force, viscosity);
    }

    /// Returns the axis along which a cell lies between a wall that carries it and gas, if no other wall is next to it.
    fn across<L: Lattice<Q>, const Q: usize>(&self, cells: &Cells, cell: usize) -> Option<usize> {
        let mut found = None;
        for (i, c) in L::C.iter().enumerate().skip(1) {
            if c.iter().map(|c| c.abs()).sum::<i8>() != 1 {
                continue;
            }
            let link = (to_u32(cell), u8::try_from(i).ok()?);
            if self.walls.contains(&link) {
                if found.is_some() || cells.kind_along(cell, L::OPPOSITE[i]) != GAS {
                    return None;
                }
                found = c.iter().position(|c| *c != 0);
            }
        }
        found.filter(|&axis| heavy(self.half_force)[axis] != 0.0)
    }
}

/// Applies the friction of the walls to the films in batches.
pub(super) fn brake<L: Lattice<Q>, S: Stored, const Q: usize>(
    films: &Films,
    cells: &Cells,
    batches: &mut [Batch],
    populations: &mut Populations<S>,
) {
    if films.walls.is_empty() || batches.iter().all(|batch| batch.thin == 0) {
        return;
    }
    let numbers = &Numbers::new(populations);
    let stencil = &Stencil::<L, Q>::new(populations);
    let (half_force, viscosity) = films.drive;
    each_part(batches, |batches| {
        for batch in batches.iter().filter(|batch| batch.thin != 0) {
            for (k, &cell) in batch.positions.cells().iter().enumerate() {
                let cell = cell as usize;
                let thickness = cells.fill[cell].min(1.0);
                let thin = batch.thin & (1 << k) != 0 && cells.kind[cell] == SURFACE;
                if !thin || thickness < THINNEST || cells.solid(cell) > 0.0 {
                    continue;
                }
                let Some(across) = films.across::<L, Q>(cells, cell) else {
                    continue;
                };
                let rate = viscosity * (3.0 / (thickness * thickness) - OF_CELL);
                // SAFETY: the incoming numbers of an interface cell belong to it, and each cell to one thread.
                unsafe {
                    let (_, momentum) = stencil.momentum(numbers, cell);
                    let mut taken = [0.0; 3];
                    for a in (0..L::DIMENSION).filter(|a| *a != across) {
                        let whole = momentum[a] + half_force[a];
                        taken[a] = whole * rate / (1.0 + rate);
                    }
                    for i in 1..Q {
                        let c = Stencil::<L, Q>::C[i];
                        let part = c[0] * taken[0] + c[1] * taken[1] + c[2] * taken[2];
                        let at = stencil.incoming(cell, i);
                        numbers.write(at, numbers.read(at) - 3.0 * L::W[i] * part);
                    }
                }
            }
        }
    });
}
