//! Open faces where solids cover their cells: what solids fill lets nothing through.
//!
//! The rules of inlets and outlets know nothing of what covers their cells: an inlet before a bed of rock would press
//! water into the rock, and an outlet draw it out. So what they give a cell that solids fill by ε is mixed with
//! half-way bounce-back,
//!
//! f_ī(x, t+1) = (1 - ε) f_ī^rule + ε f*_i(x, t),
//!
//! which closes the face before a full cell like a wall at rest. Moving walls are left as they are: nothing goes
//! through them.

use super::links::each_part;
use crate::lanes::Stored;
use crate::populations::{Link, Populations};

/// Cells from which a thread pays.
const CELLS_PER_THREAD: usize = 1000;

/// A cell at open faces.
#[derive(Clone, Copy, Debug)]
struct OpenCell {
    cell: usize,
    /// The cell in the slab.
    local: [usize; 3],
    first: usize,
    count: usize,
}

/// The links of open faces, by cells.
#[derive(Debug, Default)]
pub(super) struct OpenCells {
    cells: Vec<OpenCell>,
    links: Vec<Link>,
}

impl OpenCells {
    /// Adds a link; those of one cell come one after another.
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

    /// Closes what is covered, after all rules of the faces: `fraction` is ε of a cell, by its position within an
    /// array and by its place in the slab.
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
