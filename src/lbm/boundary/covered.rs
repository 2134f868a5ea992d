//! Open faces at cells covered by solids: the covered part of a cell is closed.
//!
//! The rules of inlets and outlets do not take account of covered cells: an inlet in front of a bed of rock would
//! force water into the rock, and an outlet would draw it out. The entering population of a cell with the solid
//! fraction ε is therefore mixed with half-way bounce-back,
//!
//! f_ī(x, t+1) = (1 - ε) f_ī^rule + ε f*_i(x, t),
//!
//! which closes the face of a fully covered cell like a stationary wall. Moving walls are not changed, because
//! nothing passes through them.

use super::links::each_part;
use crate::lanes::Stored;
use crate::populations::{Link, Populations};

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

/// Links of open faces, sorted by cells.
#[derive(Debug, Default)]
pub(super) struct OpenCells {
    cells: Vec<OpenCell>,
    links: Vec<Link>,
}

impl OpenCells {
    /// Adds a link; the links of one cell follow each other.
    pub(super) fn add(&mut self, (cell, local): (usize, [usize; 3]), link: Link) {
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

    /// Closes covered cells, after all rules of the faces: `fraction` is ε of a cell, by its position within an
    /// array and its indices in the slab.
    pub(super) fn close<S: Stored>(
        &self,
        fraction: impl Fn(usize, [usize; 3]) -> f64 + Sync,
        populations: &mut Populations<S>,
    ) {
        let parity = populations.parity();
        let count = self.cells.len();
        each_part(count, CELLS_PER_THREAD, populations, |part, numbers| {
            for open in &self.cells[part] {
                let fraction = fraction(open.cell, open.local);
                if fraction > 0.0 {
                    for link in &self.links[open.first..][..open.count] {
                        // SAFETY: positions in the slab, of this link alone.
                        unsafe {
                            let back = numbers.add(link.out(parity)).read().to_f64();
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
