//! Open faces where solids cover their cells: what solids fill lets nothing through.
//!
//! The rules of inlets and outlets know nothing of what covers their cells: an inlet before a bed of rock would press water into the
//! rock, and an outlet draw it out. So what they give a cell that solids fill by ε is mixed with half-way bounce-back,
//!
//! f_ī(x, t+1) = (1 - ε) f_ī^rule + ε f*_i(x, t),
//!
//! which closes the face before a full cell like a wall at rest. Moving walls are left as they are: nothing goes through them.

use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Link, Populations};

/// A cell at open faces.
#[derive(Clone, Copy, Debug)]
struct OpenCell {
    cell: usize,
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
    /// One more link; those of one cell come one after another.
    pub(super) fn add(&mut self, cell: usize, link: Link) {
        match self.cells.last_mut() {
            Some(last) if last.cell == cell => last.count += 1,
            _ => self.cells.push(OpenCell {
                cell,
                first: self.links.len(),
                count: 1,
            }),
        }
        self.links.push(link);
    }

    /// Closes what is covered, after all rules of the faces: `fraction` is ε of a cell.
    pub(super) fn close<S: Stored>(
        &self,
        fraction: impl Fn(usize) -> f64,
        populations: &mut Populations<S>,
    ) {
        let parity = populations.parity();
        let numbers = populations.numbers_mut();
        for open in &self.cells {
            let fraction = fraction(open.cell);
            if fraction > 0.0 {
                for link in &self.links[open.first..][..open.count] {
                    let back = numbers[link.out(parity)].to_f64();
                    let rule = numbers[link.incoming(parity)].to_f64();
                    let value = fraction.mul_add(back - rule, rule);
                    numbers[link.incoming(parity)] = S::from_f64(value);
                }
            }
        }
    }
}
