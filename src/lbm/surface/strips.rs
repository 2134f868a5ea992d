//! Values of the cells at the ends of a slab, sent only where the surface is near.
//!
//! The outer plane of a slab is divided into strips of consecutive cells. A strip is sent only if an interface cell
//! lies in it or next to it, in the plane of either slab. Both slabs know the kinds of the cells of both planes, and
//! thus the same strips, so that the messages have fixed sizes and none is sent for the rest of the plane: gas has no
//! state, and the values of water away from the surface are not used.

use super::kind::is_surface;
use bytemuck::Pod;
use decomposition::{Domain, FixedExchange};

/// Minimum number of cells in a strip.
const LEAST: usize = 64;

/// Maximum number of strips of a plane.
const MOST: usize = 128;

/// Number of cells of a row that are compared at once.
const TOGETHER: usize = 32;

/// Message tags of an exchange, at the cuts between slabs and at that across the periodic axis.
pub(super) type Tags = [u8; 2];

/// Exchange with one or, if the slab is its own neighbour, both neighbours.
struct Cut {
    /// Messages of each strip.
    strips: Vec<FixedExchange>,
    /// `true` for the strips that contain or touch interface cells.
    near: Vec<bool>,
    /// End (0: lower, 1: upper) whose plane each message of a strip sends, and end at which the answer arrives.
    ends: Vec<[usize; 2]>,
}

/// Exchange of the values of the outer planes with the neighbours.
pub(super) struct Strips {
    cuts: Vec<Cut>,
    /// Number of cells of a strip.
    length: usize,
    /// Number of values of a cell.
    values: usize,
    /// Number of rows of a plane, and of cells of a row.
    plane: [usize; 2],
}

impl Strips {
    /// Returns the exchange of `values` numbers for each cell of a plane with these numbers of rows and cells in a row.
    ///
    /// # Errors
    /// If a neighbour does not exist.
    pub(super) fn new<T: Pod>(
        domain: &Domain,
        tags: Tags,
        plane: [usize; 2],
        values: usize,
    ) -> Result<Self, String> {
        let cells = plane[0] * plane[1];
        let length = cells.div_ceil(MOST).max(LEAST);
        let (rank, communicator) = (domain.rank(), domain.communicator());
        let neighbours = [domain.lower_neighbour(), domain.upper_neighbour()];
        let cut = |partner: usize, tag: u8, ends: Vec<[usize; 2]>| -> Result<Cut, String> {
            let strip = |first: usize| {
                let bytes = length.min(cells - first) * values * size_of::<T>();
                let messages = vec![(partner, bytes); ends.len()];
                FixedExchange::new(communicator, tag, &messages, &messages)
                    .map_err(|e| e.to_string())
            };
            let strips: Vec<FixedExchange> = (0..cells)
                .step_by(length)
                .map(strip)
                .collect::<Result<_, _>>()?;
            let near = vec![true; strips.len()];
            Ok(Cut { strips, near, ends })
        };
        let mut cuts = Vec::new();
        if neighbours == [Some(rank); 2] {
            cuts.push(cut(rank, tags[1], vec![[0, 1], [1, 0]])?);
        } else {
            // Two slabs that are neighbours at both ends distinguish the cut across the periodic axis.
            for (end, partner) in neighbours.into_iter().enumerate() {
                if let Some(partner) = partner {
                    let across = (end == 0) == (partner > rank);
                    cuts.push(cut(partner, tags[usize::from(across)], vec![[end; 2]])?);
                }
            }
        }
        Ok(Self {
            cuts,
            length,
            values,
            plane,
        })
    }

    /// Finds the strips next to the surface; `row` returns the kinds of a row of the outer plane (`false`) or of the
    /// ghost plane (`true`) at an end. Both must be those that the neighbour has.
    pub(super) fn find<'a>(&mut self, row: impl Fn(usize, bool, usize) -> &'a [u8]) {
        let [rows, length] = self.plane;
        for cut in &mut self.cuts {
            let end = cut.ends[0][0];
            cut.near.fill(false);
            for (m, ghost) in (0..rows).flat_map(|m| [(m, false), (m, true)]) {
                for (part, kinds) in row(end, ghost, m).chunks(TOGETHER).enumerate() {
                    // Without a branch, so that all cells of a part are compared at once.
                    if !kinds
                        .iter()
                        .fold(false, |any, &kind| any | is_surface(kind))
                    {
                        continue;
                    }
                    for (k, _) in kinds
                        .iter()
                        .enumerate()
                        .filter(|(_, kind)| is_surface(**kind))
                    {
                        let f = part * TOGETHER + k;
                        for m in [m, m + 1, m + rows - 1] {
                            for f in [f, f + 1, f + length - 1] {
                                let cell = (m % rows) * length + f % length;
                                cut.near[cell / self.length] = true;
                            }
                        }
                    }
                }
            }
        }
    }

    /// Returns `true` if the surface is near the plane of a neighbour at an end.
    pub(super) fn is_near(&self, end: usize) -> bool {
        let mut cuts = self.cuts.iter();
        cuts.any(|cut| cut.ends.iter().any(|[_, to]| *to == end) && cut.near.contains(&true))
    }

    /// Sends values of the outer planes; `fill` writes those of a cell, given by end and index in the plane. With
    /// `all`, strips far from the surface are sent too.
    pub(super) fn send<T: Pod>(&mut self, all: bool, fill: impl Fn(usize, usize, &mut [T])) {
        let (values, length) = (self.values, self.length);
        for Cut { strips, near, ends } in &mut self.cuts {
            let strips = strips.iter_mut().zip(near).enumerate();
            for (n, (strip, _)) in strips.filter(|(_, (_, near))| all || **near) {
                for (k, &[from, _]) in ends.iter().enumerate() {
                    let buffer = strip.send_buffer_mut::<T>(k).chunks_exact_mut(values);
                    for (cell, to) in (n * length..).zip(buffer) {
                        fill(from, cell, to);
                    }
                }
                strip.start();
            }
        }
    }

    /// Receives the values that the neighbours have sent with the same `all`; `take` receives those of a ghost cell,
    /// given by end and index in the plane.
    pub(super) fn receive<T: Pod>(&mut self, all: bool, mut take: impl FnMut(usize, usize, &[T])) {
        let (values, length) = (self.values, self.length);
        for Cut { strips, near, ends } in &mut self.cuts {
            let strips = strips.iter_mut().zip(near).enumerate();
            for (n, (strip, _)) in strips.filter(|(_, (_, near))| all || **near) {
                strip.finish();
                for (k, &[_, to]) in ends.iter().enumerate() {
                    let received = strip.received::<T>(k).chunks_exact(values);
                    for (cell, from) in (n * length..).zip(received) {
                        take(to, cell, from);
                    }
                }
            }
        }
    }
}
