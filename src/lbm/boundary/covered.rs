//! Open faces at cells covered by solids: the covered part of a cell is closed.
//!
//! The rules of inlets and outlets do not take account of covered cells: an inlet in front of a bed of rock would
//! force water into the rock, and an outlet would draw it out. The entering population of a cell with the solid
//! fraction ε is therefore mixed with half-way bounce-back,
//!
//! f_ī(x, t+1) = (1 - ε) f_ī^rule + ε (f*_i(x, t) - 6 w_i c_i·u_s),
//!
//! which closes the face of a fully covered cell like a wall with the velocity u_s of the solid (Ladd 1994): what is
//! inside a body that leaves through the face leaves with it. At a stationary wall it would pile up in the cells of the
//! face, to twice its density within 1/u_s steps. Moving walls are not changed, because nothing passes through them.

use super::links::each_part;
use crate::lanes::Stored;
use crate::populations::{Link, Populations};

/// Solid in a cell at an open face.
#[derive(Clone, Copy, Debug)]
pub struct SolidPart {
    /// Solid fraction ε.
    pub fraction: f64,
    /// Velocity of the solid in lattice units.
    pub velocity: [f64; 3],
}

impl SolidPart {
    /// Returns a solid at rest.
    #[must_use]
    pub fn at_rest(fraction: f64) -> Self {
        Self {
            fraction,
            velocity: [0.0; 3],
        }
    }
}

/// Minimum number of cells per thread.
const CELLS_PER_THREAD: usize = 1000;

/// Cell at open faces.
#[derive(Clone, Copy, Debug)]
struct OpenCell {
    cell: usize,
    /// Indices of the cell in the slab.
    local: [usize; 3],
    first: usize,
    count: usize,
}

/// Link of an open face.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenLink {
    pub(super) link: Link,
    /// 6 w_i c_i: what a wall takes along, per unit of its velocity.
    pub(super) taken: [f64; 3],
}

/// Links of open faces, sorted by cells.
#[derive(Debug, Default)]
pub(super) struct OpenCells {
    cells: Vec<OpenCell>,
    links: Vec<OpenLink>,
}

impl OpenCells {
    /// Adds a link; the links of one cell follow each other.
    pub(super) fn add(&mut self, (cell, local): (usize, [usize; 3]), link: OpenLink) {
        match self.cells.last_mut() {
            Some(last) if last.cell == cell => last.count += 1,
            _ => self.cells.push(OpenCell {
                cell,
                local,
                first: self.links.len(),
                count: 1,
            }),
        }
        self.links.push(link);
    }

    /// Closes covered cells, after all rules of the faces: `solid` is the solid in a cell, by its position within an
    /// array and its indices in the slab.
    pub(super) fn close<S: Stored>(
        &self,
        solid: impl Fn(usize, [usize; 3]) -> SolidPart + Sync,
        populations: &mut Populations<S>,
    ) {
        let parity = populations.parity();
        let count = self.cells.len();
        each_part(count, CELLS_PER_THREAD, populations, |part, numbers| {
            for open in &self.cells[part] {
                let SolidPart { fraction, velocity } = solid(open.cell, open.local);
                if fraction > 0.0 {
                    for OpenLink { link, taken } in &self.links[open.first..][..open.count] {
                        let [x, y, z] = [0, 1, 2].map(|a| taken[a] * velocity[a]);
                        let passes = x + y + z;
                        // SAFETY: positions in the slab, of this link alone.
                        unsafe {
                            let back = numbers.add(link.out(parity)).read().to_f64() - passes;
                            let number = numbers.add(link.incoming(parity));
                            let rule = number.read().to_f64();
                            let value = fraction.mul_add(back - rule, rule);
                            number.write(S::from_f64(value));
                        }
                    }
                }
            }
        });
    }
}
