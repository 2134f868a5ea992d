//! Interface cells of each plane, and the parts of rows that contain water.

use super::kind::{GAS, LIQUID, is_surface, is_wet};
use base::number::to_u32;

/// Number of cells of a row that are processed together: the widest vector of the pass.
pub(crate) const TOGETHER: usize = 8;

/// Bits of kinds of cells that hold water, in as many bytes: these kinds have numbers from 2 on.
const WET: u64 = u64::from_le_bytes([!1; TOGETHER]);

/// Kinds of as many cells full of water.
const FULL: u64 = u64::from_le_bytes([LIQUID; TOGETHER]);

/// Lists of one plane of the slab.
#[derive(Debug, Default)]
pub(crate) struct Plane {
    /// Positions of the interface cells.
    pub(super) surface: Vec<u32>,
    /// Density that the surface tension adds in each interface cell; empty without it.
    pub(super) capillary: Vec<f64>,
    /// Runs of cells of gas that the pass collides because their vectors hold water: first position and end.
    pub(super) dry: Vec<[u32; 2]>,
    /// Rows with interface cells.
    pub(super) rows: Vec<u32>,
    /// `true` if kinds of cells have changed since the lists were made.
    pub(super) changed: bool,
    /// Index of the first span of each row, and total.
    begins: Vec<u32>,
    /// First cell and end of each part of a row that contains water, in whole vectors up to the end of the row.
    spans: Vec<[u32; 2]>,
}

impl Plane {
    /// Returns the lists of a plane without a free surface, from the parts of its rows to process.
    pub(crate) fn of_spans<'a>(rows: impl Iterator<Item = &'a [[u32; 2]]>) -> Self {
        let mut plane = Self::default();
        plane.set_spans(rows.map(|row| row.iter().copied()));
        plane
    }

    /// Sets the parts of the rows to process.
    pub(super) fn set_spans(&mut self, rows: impl Iterator<Item = impl Iterator<Item = [u32; 2]>>) {
        self.begins.clear();
        self.spans.clear();
        self.begins.push(0);
        for row in rows {
            self.spans.extend(row);
            self.begins.push(to_u32(self.spans.len()));
        }
    }

    /// Returns `true` if there is no part to process.
    pub(super) fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }

    /// Returns the parts of a row that contain water.
    #[inline(always)]
    pub(crate) fn spans(&self, row: usize) -> &[[u32; 2]] {
        &self.spans[self.begins[row] as usize..self.begins[row + 1] as usize]
    }

    /// Returns `true` if a row contains no water, and its lists have been made.
    pub(crate) fn is_dry(&self, row: usize) -> bool {
        self.is_made() && self.spans(row).is_empty()
    }

    /// Returns `true` if the plane contains water, or has since the lists were made.
    pub(super) fn is_live(&self) -> bool {
        !self.is_made() || self.changed || !self.spans.is_empty()
    }

    /// Returns `true` if kinds of cells have changed since the lists were made.
    pub(super) fn is_outdated(&self) -> bool {
        !self.is_made() || self.changed
    }

    /// Returns the number of cells in the parts of rows that contain water.
    pub(super) fn wet(&self) -> usize {
        let lengths = self.spans.iter().map(|[first, end]| end - first);
        lengths.sum::<u32>() as usize
    }

    /// Returns `true` if the lists have been made.
    pub(super) fn is_made(&self) -> bool {
        !self.begins.is_empty()
    }

    /// Makes the lists from the kinds of the cells; `rows` returns the position of the first cell of each row.
    pub(super) fn find(&mut self, kinds: &[u8], rows: impl Iterator<Item = usize>, length: usize) {
        self.changed = false;
        self.surface.clear();
        self.rows.clear();
        self.dry.clear();
        self.begins.clear();
        self.spans.clear();
        for (row_index, first) in (0..).zip(rows) {
            let before = self.surface.len();
            let begin = self.spans.len();
            self.begins.push(to_u32(begin));
            let row = &kinds[first..first + length];
            for (n, some) in row.chunks(TOGETHER).enumerate() {
                let (dry, full) = match <&[u8; TOGETHER]>::try_from(some) {
                    Ok(some) => {
                        let all = u64::from_le_bytes(*some);
                        (all & WET == 0, all == FULL)
                    }
                    Err(_) => (some.iter().all(|&kind| !is_wet(kind)), false),
                };
                if dry {
                    continue;
                }
                let at = n * TOGETHER;
                let end = to_u32((at + TOGETHER).min(length));
                match self.spans[begin..].last_mut() {
                    Some(span) if span[1] == to_u32(at) => span[1] = end,
                    _ => self.spans.push([to_u32(at), end]),
                }
                if full {
                    continue;
                }
                for (k, &kind) in some.iter().enumerate() {
                    let cell = to_u32(first + at + k);
                    if is_surface(kind) {
                        self.surface.push(cell);
                    } else if kind == GAS {
                        match self.dry.last_mut() {
                            Some(run) if run[1] == cell => run[1] = cell + 1,
                            _ => self.dry.push([cell, cell + 1]),
                        }
                    }
                }
            }
            if self.surface.len() > before {
                self.rows.push(row_index);
            }
        }
        self.begins.push(to_u32(self.spans.len()));
    }
}

/// Returns `true` if the pass may write to a plane: it contains water, is next to a plane with water, or is at an end
/// of the slab.
pub(crate) fn is_written(planes: &[Plane], plane: isize) -> bool {
    let planes = usize::try_from(plane - 1)
        .ok()
        .and_then(|below| planes.get(below..below + 3));
    planes.is_none_or(|planes| planes.iter().any(Plane::is_live))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::kind::SURFACE;

    #[test]
    fn vectors_without_water_are_left_out() {
        let mut kinds = vec![GAS; 64];
        kinds[3] = LIQUID;
        kinds[17] = SURFACE;
        kinds[20] = LIQUID;
        kinds[40..59].fill(LIQUID);
        let mut plane = Plane::default();
        // Rows of 30 cells from 0 and from 32.
        plane.find(&kinds, [0, 32].into_iter(), 30);
        assert_eq!(plane.spans(0), [[0, 8], [16, 24]]);
        assert_eq!(plane.spans(1), [[8, 30]]);
        assert_eq!(plane.surface, [17]);
        assert_eq!(
            plane.dry,
            [[0, 3], [4, 8], [16, 17], [18, 20], [21, 24], [59, 62]]
        );
    }
}
