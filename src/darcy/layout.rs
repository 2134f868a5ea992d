//! Arrangement of the cells in memory, and the cells that each rank computes.
//!
//! x is fastest. One layer of ghost cells surrounds the grid. Their conductances and values are always 0, so that
//! loops need no case distinctions. A grid of a plane has no ghost cells along z, which would take two thirds of the
//! memory: there the stride along z is 0, and all conductances along z are 0. Every rank has arrays of the whole
//! grid, computes the planes of its [`Part`], and receives the neighbouring planes in messages.

use decomposition::{Communicator, Disagreement, Domain, FixedExchange, HaloBytes, HaloExchange};
use rayon::prelude::*;
use std::ops::Range;

/// Layout of the cells of a grid in arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) cells: [usize; 3],
    pub(super) stride: [usize; 3],
}

/// Range of planes of a layout along one axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) axis: usize,
    pub(super) planes: Range<usize>,
}

impl Layout {
    pub(super) fn new(cells: [usize; 3]) -> Self {
        let x = cells[0] + 2;
        let plane = x * (cells[1] + 2);
        Self {
            cells,
            stride: [1, x, if cells[2] == 1 { 0 } else { plane }],
        }
    }

    /// Returns the length of an array, including ghosts.
    pub(super) fn len(&self) -> usize {
        if self.stride[2] == 0 {
            self.stride[1] * (self.cells[1] + 2)
        } else {
            self.stride[2] * (self.cells[2] + 2)
        }
    }

    pub(super) fn count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the position of a cell.
    #[inline]
    pub(super) fn position(&self, cell: [usize; 3]) -> usize {
        (cell[0] + 1) + (cell[1] + 1) * self.stride[1] + (cell[2] + 1) * self.stride[2]
    }

    /// Returns the cell at a position.
    pub(super) fn cell(&self, at: usize) -> [usize; 3] {
        let [_, row, plane] = self.stride;
        let (z, rest) = match at.checked_div(plane) {
            Some(z) => (z - 1, at % plane),
            None => (0, at),
        };
        [rest % row - 1, rest / row - 1, z]
    }

    /// Returns all cells as a part.
    pub(super) fn whole(&self) -> Part {
        Part {
            axis: 2,
            planes: 0..self.cells[2],
        }
    }

    /// Returns the range of cells along each axis.
    fn bounds(&self, part: &Part) -> [Range<usize>; 3] {
        std::array::from_fn(|a| {
            if a == part.axis {
                part.planes.clone()
            } else {
                0..self.cells[a]
            }
        })
    }

    /// Returns the rows of cells of a part along x, in ascending order of y, then z.
    pub(super) fn rows(&self, part: &Part) -> impl Iterator<Item = Range<usize>> + use<> {
        let layout = *self;
        let [x, y, z] = self.bounds(part);
        z.flat_map(move |k| {
            let x = x.clone();
            y.clone().map(move |j| {
                let start = layout.position([x.start, j, k]);
                start..start + x.len()
            })
        })
    }

    /// Returns the positions of the cells of one plane normal to an axis, in the order of the other two axes.
    pub(super) fn plane(&self, axis: usize, plane: usize) -> impl Iterator<Item = usize> + use<> {
        let (a, b) = match axis {
            0 => (1, 2),
            1 => (0, 2),
            _ => (0, 1),
        };
        let layout = *self;
        let (cells, stride) = (self.cells, self.stride);
        (0..cells[b]).flat_map(move |j| {
            let mut cell = [0; 3];
            cell[axis] = plane;
            cell[b] = j;
            let start = layout.position(cell);
            (0..cells[a]).map(move |i| start + i * stride[a])
        })
    }

    /// Returns the number of cells of a plane normal to an axis.
    pub(super) fn plane_size(&self, axis: usize) -> usize {
        self.cells[(axis + 1) % 3] * self.cells[(axis + 2) % 3]
    }

    /// Calls `work(first position, row of out)` for every row of a part; on several threads if the grid is large.
    pub(super) fn sweep<T: Send>(
        &self,
        part: &Part,
        out: &mut [T],
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        const WORTH_THREADS: usize = 1 << 15;
        /// Minimum number of rows of a plane in a piece.
        const ROWS: usize = 16;
        if self.count() < WORTH_THREADS || rayon::current_num_threads() == 1 {
            for row in self.rows(part) {
                work(row.start, &mut out[row]);
            }
            return;
        }
        let [x, y, z] = self.bounds(part);
        let stride = self.stride;
        if stride[2] == 0 {
            out.par_chunks_mut(stride[1])
                .enumerate()
                .with_min_len(ROWS)
                .filter(|(row, _)| *row > 0 && y.contains(&(row - 1)))
                .for_each(|(row, out)| {
                    let start = 1 + x.start;
                    work(row * stride[1] + start, &mut out[start..start + x.len()]);
                });
            return;
        }
        out.par_chunks_mut(stride[2])
            .enumerate()
            .filter(|(plane, _)| *plane > 0 && z.contains(&(plane - 1)))
            .for_each(|(plane, out)| {
                for j in y.clone() {
                    let start = 1 + x.start + (j + 1) * stride[1];
                    work(plane * stride[2] + start, &mut out[start..start + x.len()]);
                }
            });
    }
}

/// Messages that fill the planes next to a part.
pub(super) struct Halo {
    exchange: HaloExchange,
    layout: Layout,
    part: Part,
}

impl Halo {
    /// Creates the exchange of a layout. Collective.
    pub(super) fn new<T>(layout: Layout, domain: &Domain, tag: u8) -> Result<Self, Disagreement> {
        let axis = domain.axis().index();
        let bytes = layout.plane_size(axis) * size_of::<T>();
        Ok(Self {
            exchange: HaloExchange::new(domain, tag, HaloBytes::symmetric(bytes))?,
            layout,
            part: Part {
                axis,
                planes: domain.range(),
            },
        })
    }

    pub(super) fn fill<T: bytemuck::Pod>(&mut self, x: &mut [T]) {
        let (layout, axis, planes) = (self.layout, self.part.axis, self.part.planes.clone());
        let (lower, upper) = self.exchange.send_buffers_mut::<T>();
        if lower.is_none() && upper.is_none() {
            return;
        }
        for (buffer, plane) in [(lower, planes.start), (upper, planes.end.wrapping_sub(1))] {
            if let Some(buffer) = buffer {
                for (slot, at) in buffer.iter_mut().zip(layout.plane(axis, plane)) {
                    *slot = x[at];
                }
            }
        }
        self.exchange.start();
        self.exchange.finish();
        let (lower, upper) = self.exchange.received::<T>();
        for (buffer, plane) in [(lower, planes.start.wrapping_sub(1)), (upper, planes.end)] {
            if let Some(buffer) = buffer {
                for (value, at) in buffer.iter().zip(layout.plane(axis, plane)) {
                    x[at] = *value;
                }
            }
        }
    }
}

/// Messages that distribute an array to every rank, each sending its planes.
pub(super) struct Gather {
    exchange: FixedExchange,
    layout: Layout,
    axis: usize,
    mine: Range<usize>,
    others: Vec<Range<usize>>,
}

impl Gather {
    /// Creates the distribution for a layout. `planes` are those of every rank, disjoint.
    pub(super) fn new<T>(
        layout: Layout,
        axis: usize,
        planes: &[Range<usize>],
        communicator: &Communicator,
        tag: u8,
    ) -> Result<Self, super::SeepageError> {
        let bytes = |r: &Range<usize>| r.len() * layout.plane_size(axis) * size_of::<T>();
        let rank = communicator.rank();
        let others = || planes.iter().enumerate().filter(|(r, _)| *r != rank);
        let mine = planes.get(rank).cloned().unwrap_or(0..0);
        // Empty messages are not sent.
        let sends: Vec<(usize, usize)> = others()
            .filter(|_| !mine.is_empty())
            .map(|(r, _)| (r, bytes(&mine)))
            .collect();
        let full = || others().filter(|(_, range)| !range.is_empty());
        let receives: Vec<(usize, usize)> = full().map(|(r, range)| (r, bytes(range))).collect();
        Ok(Self {
            exchange: FixedExchange::new(communicator, tag, &sends, &receives)
                .map_err(|e| super::SeepageError::Messages(e.to_string()))?,
            layout,
            axis,
            others: full().map(|(_, range)| range.clone()).collect(),
            mine,
        })
    }

    pub(super) fn fill<T: bytemuck::Pod>(&mut self, x: &mut [T]) {
        let (layout, axis, mine) = (self.layout, self.axis, self.mine.clone());
        for buffer in self.exchange.send_buffers_mut::<T>() {
            let from = mine.clone().flat_map(|p| layout.plane(axis, p));
            for (slot, at) in buffer.iter_mut().zip(from) {
                *slot = x[at];
            }
        }
        self.exchange.start();
        self.exchange.finish();
        for (index, range) in self.others.iter().enumerate() {
            let to = range.clone().flat_map(|p| layout.plane(axis, p));
            for (value, at) in self.exchange.received::<T>(index).iter().zip(to) {
                x[at] = *value;
            }
        }
    }
}
