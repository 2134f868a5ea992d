//! Vorticity of the fluid: derivatives of the velocities of a slab and of the adjacent planes of other slabs.

use base::error::Error;
use coupling::{BandStates, FluidView, bands};
use decomposition::{Domain, exchange};

/// Velocities of a slab of fluid, in lattice units, with one plane of each neighbour along the split axis; the
/// buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct Velocities {
    cells: [usize; 3],
    own: Vec<[f64; 3]>,
    axis: usize,
    below: Option<Vec<[f64; 3]>>,
    above: Option<Vec<[f64; 3]>>,
    states: BandStates,
}

impl Velocities {
    /// Reads the slab and exchanges the outer planes with the neighbours, including periodic ones. Collective.
    pub(crate) fn read(&mut self, fluid: &dyn FluidView, domain: &Domain) -> Result<(), Error> {
        self.cells = fluid.cells();
        self.axis = domain.axis().index();
        self.own.clear();
        for band in bands(self.cells[2]) {
            fluid.band_states(band, &mut self.states);
            self.own.extend_from_slice(&self.states.velocity);
        }
        let (lower, upper) = (domain.lower_neighbour(), domain.upper_neighbour());
        let mut messages = Vec::new();
        if let Some(rank) = lower {
            messages.push((rank, self.plane_bytes(0)));
        }
        if let Some(rank) = upper {
            messages.push((rank, self.plane_bytes(self.cells[self.axis] - 1)));
        }
        let size = self.plane_cells();
        (self.below, self.above) = (None, None);
        for (source, bytes) in exchange(domain.communicator(), messages) {
            let mut planes = bytes.chunks_exact((size * 24).max(1));
            // Every rank sends its first plane first; received from a rank above, it is the plane above this slab.
            if upper == Some(source) {
                self.above = planes.next().map(from_bytes);
            }
            if lower == Some(source) {
                self.below = planes.next().map(from_bytes);
            }
        }
        if lower.is_some() != self.below.is_some() || upper.is_some() != self.above.is_some() {
            return Err(Error::Internal(
                "a plane of velocities did not arrive".into(),
            ));
        }
        Ok(())
    }

    fn plane_cells(&self) -> usize {
        (0..3)
            .filter(|&a| a != self.axis)
            .map(|a| self.cells[a])
            .product()
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.cells[1] + y) * self.cells[0] + x
    }

    /// Returns the index of a cell in a plane across the split axis.
    fn place_in_plane(&self, cell: [usize; 3]) -> usize {
        match self.axis {
            0 => cell[2] * self.cells[1] + cell[1],
            1 => cell[2] * self.cells[0] + cell[0],
            _ => cell[1] * self.cells[0] + cell[0],
        }
    }

    fn plane_bytes(&self, plane: usize) -> Vec<u8> {
        let mut ends = self.cells;
        ends[self.axis] = plane + 1;
        let mut starts = [0; 3];
        starts[self.axis] = plane;
        let mut bytes = Vec::with_capacity(self.plane_cells() * 24);
        for z in starts[2]..ends[2] {
            for y in starts[1]..ends[1] {
                for x in starts[0]..ends[0] {
                    for u in self.own[self.index([x, y, z])] {
                        bytes.extend_from_slice(&u.to_le_bytes());
                    }
                }
            }
        }
        bytes
    }

    /// Returns the velocity of a cell of the slab.
    pub(crate) fn velocity_at(&self, cell: [usize; 3]) -> [f64; 3] {
        self.own[self.index(cell)]
    }

    /// Returns the velocity of the adjacent cell along `axis`, up or down; none outside the domain.
    fn neighbour(
        &self,
        cell: [usize; 3],
        axis: usize,
        up: bool,
        periodic: bool,
    ) -> Option<[f64; 3]> {
        let last = self.cells[axis] - 1;
        let at_end = cell[axis] == if up { last } else { 0 };
        if at_end && axis == self.axis {
            let plane = if up { &self.above } else { &self.below };
            return plane
                .as_ref()
                .and_then(|plane| plane.get(self.place_in_plane(cell)).copied());
        }
        if at_end && !periodic {
            return None;
        }
        let mut next = cell;
        next[axis] = match (at_end, up) {
            (true, true) => 0,
            (true, false) => last,
            (false, true) => cell[axis] + 1,
            (false, false) => cell[axis] - 1,
        };
        Some(self.velocity_at(next))
    }

    /// Returns the derivative of the velocity along `axis` per cell: central, or one-sided in the cells at a face
    /// of the domain.
    fn derivative(&self, cell: [usize; 3], axis: usize, periodic: bool) -> [f64; 3] {
        let here = self.velocity_at(cell);
        let low = self.neighbour(cell, axis, false, periodic);
        let high = self.neighbour(cell, axis, true, periodic);
        let (from, to, over) = match (low, high) {
            (Some(low), Some(high)) => (low, high, 0.5),
            (Some(low), None) => (low, here, 1.0),
            (None, Some(high)) => (here, high, 1.0),
            (None, None) => (here, here, 1.0),
        };
        std::array::from_fn(|k| (to[k] - from[k]) * over)
    }

    /// Returns the vorticity of a cell, per step; in 2-D only the last component is non-zero.
    pub(crate) fn vorticity(&self, cell: [usize; 3], periodic: [bool; 3]) -> [f64; 3] {
        let [dx, dy, dz] = std::array::from_fn(|axis| self.derivative(cell, axis, periodic[axis]));
        [dy[2] - dz[1], dz[0] - dx[2], dx[1] - dy[0]]
    }
}

fn from_bytes(bytes: &[u8]) -> Vec<[f64; 3]> {
    let (numbers, _) = bytes.as_chunks::<8>();
    let (rows, _) = numbers.as_chunks::<3>();
    rows.iter().map(|row| row.map(f64::from_le_bytes)).collect()
}
