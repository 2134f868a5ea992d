//! Exchange of the populations that leave a slab, and their copies across periodic axes within it.
//!
//! Only the populations that cross a face are sent: 3 of D2Q9, 9 of D3Q27 per cell of the face. After an even pass
//! a ghost plane receives the slots that point away from the slab; after an odd pass it returns them.

use super::error::FluidError;
use super::lanes::Stored;
use super::populations::{Parity, Populations};
use decomposition::{Domain, HaloBytes, HaloExchange};

/// Message tag of the populations.
const TAG: u8 = 1;

/// Exchange of one slab along the split axis.
pub struct Halo {
    exchange: HaloExchange,
    /// Directions that point to lower planes; the next field has those that point to higher planes.
    down: Vec<usize>,
    up: Vec<usize>,
    /// Positions in a plane, including ghosts, relative to its cell (0, 0).
    plane: Vec<isize>,
    planes: isize,
}

impl Halo {
    /// Sets up the exchange for the slab of `populations` in `domain`. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        domain: &Domain,
    ) -> Result<Self, FluidError> {
        let [slow, middle, fast] = populations.order();
        let velocities = populations.velocities();
        let cells = populations.cells();
        let leaving = |sign: i8| -> Vec<usize> {
            (0..velocities.q())
                .filter(|&i| velocities.c[i][slow] == sign)
                .collect()
        };
        let extent = |axis: usize| {
            let ghost = isize::from(axis < velocities.dimension);
            -ghost..cells[axis].cast_signed() + ghost
        };
        let zero = populations.cell([0; 3]).cast_signed();
        let mut plane = Vec::new();
        for j in extent(middle) {
            for k in extent(fast) {
                let mut at = [0; 3];
                at[middle] = j;
                at[fast] = k;
                plane.push(populations.cell(at).cast_signed() - zero);
            }
        }
        let (down, up) = (leaving(-1), leaving(1));
        let planes = cells[slow].cast_signed();
        let bytes = plane.len() * down.len() * size_of::<S>();
        let exchange = HaloExchange::new(domain, TAG, HaloBytes::symmetric(bytes))?;
        log::debug!(
            "rank {}: {} of {} populations cross a cut each way, {} cells a plane, {bytes} bytes a message",
            domain.rank(),
            down.len(),
            velocities.q(),
            plane.len()
        );
        Ok(Self {
            exchange,
            down,
            up,
            plane,
            planes,
        })
    }

    /// Packs the leaving populations and starts sending, after the first and the last plane have been updated.
    pub fn start<S: Stored>(&mut self, populations: &Populations<S>) {
        let exchange = &mut self.exchange;
        let (to_lower, to_upper) = match populations.parity() {
            Parity::Reversed => (0, self.planes - 1),
            Parity::Home => (-1, self.planes),
        };
        // After an even pass the neighbour's ghosts need the slots that point away from it, that is, towards this
        // rank.
        let (lower_slots, upper_slots) = match populations.parity() {
            Parity::Reversed => (&self.up, &self.down),
            Parity::Home => (&self.down, &self.up),
        };
        let (lower, upper) = exchange.send_buffers_mut::<S>();
        if let Some(buffer) = lower {
            copy_out(populations, to_lower, lower_slots, &self.plane, buffer);
        }
        if let Some(buffer) = upper {
            copy_out(populations, to_upper, upper_slots, &self.plane, buffer);
        }
        exchange.start();
    }

    /// Waits for the messages of the neighbours and unpacks them.
    pub fn finish<S: Stored>(&mut self, populations: &mut Populations<S>) {
        let exchange = &mut self.exchange;
        exchange.finish();
        let (from_lower, from_upper) = match populations.parity() {
            Parity::Reversed => (-1, self.planes),
            Parity::Home => (0, self.planes - 1),
        };
        let (lower_slots, upper_slots) = match populations.parity() {
            Parity::Reversed => (&self.down, &self.up),
            Parity::Home => (&self.up, &self.down),
        };
        let (lower, upper) = exchange.received::<S>();
        if let Some(buffer) = lower {
            copy_in(populations, from_lower, lower_slots, &self.plane, buffer);
        }
        if let Some(buffer) = upper {
            copy_in(populations, from_upper, upper_slots, &self.plane, buffer);
        }
    }
}

fn copy_out<S: Stored>(
    populations: &Populations<S>,
    plane: isize,
    slots: &[usize],
    cells: &[isize],
    buffer: &mut [S],
) {
    let origin = plane_origin(populations, plane);
    let numbers = populations.numbers();
    for (&slot, part) in slots.iter().zip(buffer.chunks_exact_mut(cells.len())) {
        let base = populations.slot(origin, slot);
        for (value, &cell) in part.iter_mut().zip(cells) {
            *value = numbers[base.wrapping_add_signed(cell)];
        }
    }
}

fn copy_in<S: Stored>(
    populations: &mut Populations<S>,
    plane: isize,
    slots: &[usize],
    cells: &[isize],
    buffer: &[S],
) {
    let origin = plane_origin(populations, plane);
    for (&slot, part) in slots.iter().zip(buffer.chunks_exact(cells.len())) {
        let base = populations.slot(origin, slot);
        let numbers = populations.numbers_mut();
        for (value, &cell) in part.iter().zip(cells) {
            numbers[base.wrapping_add_signed(cell)] = *value;
        }
    }
}

fn plane_origin<S: Stored>(populations: &Populations<S>, plane: isize) -> usize {
    let mut at = [0; 3];
    at[populations.order()[0]] = plane;
    populations.cell(at)
}

/// Copies populations across the middle axis for some planes of the slab, if it is periodic; the pass copies
/// populations along the rows.
///
/// After an even pass ghosts are filled, after an odd pass they are delivered. Whole rows are copied with their
/// ghosts, so that corners are correct.
pub fn wrap<S: Stored>(populations: &mut Populations<S>, planes: impl Iterator<Item = isize>) {
    let across = Across::new(populations);
    for plane in planes {
        let numbers = populations.numbers_mut();
        for &copy in &across.copies {
            let [source, target] = copy.map(|at| across.position(at, plane));
            numbers.copy_within(source..source + across.length, target);
        }
    }
}

/// Copies of populations across the middle axis in each plane of a slab.
pub(super) struct Across {
    /// First number of the source row and of the target row in plane 0.
    copies: Vec<[usize; 2]>,
    /// Number of cells of a row, with its ghosts.
    length: usize,
    /// Distance between planes.
    plane: isize,
}

impl Across {
    /// Returns the copies after the last pass.
    pub(super) fn new<S: Stored>(populations: &Populations<S>) -> Self {
        let [slow, middle, fast] = populations.order();
        let rows = populations.cells()[middle].cast_signed();
        let ghost = isize::from(fast < populations.velocities().dimension);
        let ends = |c: &[i8; 3]| match c[middle] {
            -1 => Some([rows - 1, -1]),
            1 => Some([0, rows]),
            _ => None,
        };
        let copies = populations.velocities().c.iter().enumerate();
        let copies = copies.filter_map(|(i, c)| {
            let [inside, outside] = ends(c)?.map(|row| {
                let mut at = [0; 3];
                (at[middle], at[fast]) = (row, -ghost);
                populations.slot(populations.cell(at), i)
            });
            Some(match populations.parity() {
                Parity::Reversed => [inside, outside],
                Parity::Home => [outside, inside],
            })
        });
        let plane = |n: isize| {
            let mut at = [0; 3];
            at[slow] = n;
            populations.cell(at).cast_signed()
        };
        Self {
            copies: copies.collect(),
            length: populations.cells()[fast] + 2 * ghost.unsigned_abs(),
            plane: plane(1) - plane(0),
        }
    }

    /// Returns a position of a plane, from that of plane 0.
    fn position(&self, in_first: usize, plane: isize) -> usize {
        in_first.wrapping_add_signed(plane * self.plane)
    }

    /// Copies the populations of a plane.
    ///
    /// # Safety
    /// `numbers` must be those of the slab, whose pass over this plane is done, and no other thread may access it.
    pub(super) unsafe fn copy<S: Stored>(&self, plane: usize, numbers: *mut S) {
        for &copy in &self.copies {
            let [source, target] = copy.map(|at| self.position(at, plane.cast_signed()));
            // SAFETY: rows of this plane, one of which is a ghost row, so that they do not overlap.
            unsafe {
                let from = numbers.add(source).cast_const();
                from.copy_to_nonoverlapping(numbers.add(target), self.length);
            }
        }
    }
}
