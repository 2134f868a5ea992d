//! Populations of one slab in memory, with streaming in place.
//!
//! Only this module computes the position of a population in memory, so that the layout can change without the others.
//!
//! # Position of a population
//!
//! Two passes alternate (the AA pattern of Bailey et al. 2009). Slot i of cell x is one number in memory:
//!
//! | after the | outgoing f*_i(x), after collision | incoming f_j(x), before the next collision |
//! |---|---|---|
//! | even pass | slot ī of x | slot j̄ of x - c_j |
//! | odd pass | slot i of x + c_i | slot j of x |
//!
//! The population that leaves x along i and the one that returns along ī are therefore the same two numbers in memory
//! after either pass; only their roles are exchanged ([`Link`]). Every boundary and every moving body is a rule that
//! gives the incoming number as a function of the outgoing one; only this file depends on the parity. Each number is
//! accessed by exactly one cell per pass, so that the order of cells, threads and ranks has no effect.
//!
//! # Layout
//!
//! There is one array per population, with the split axis slowest, the longer of the other axes innermost (below a
//! free surface a horizontal one), and one ghost cell on every side. Rows are padded to 64 bytes but not to 4 KiB, and
//! the arrays are staggered, because array distances of 0 modulo 4096 bytes cost a third of the speed. Memory comes
//! from `mmap` with huge pages advised before the first access.
//!
//! The address of an array is the sum of two parts, one of c_x and one of (c_y, c_z). After either pass the numbers
//! that a cell reads and writes therefore lie at nine addresses and two distances from them, which fit into the
//! registers of the processor; 27 addresses do not. D3Q19 does not use four of these arrays; they are never
//! accessed and take no physical memory.

use super::error::FluidError;
#[cfg(target_arch = "x86_64")]
use super::lanes::{Avx2, Avx512};
use super::lanes::{Lanes, Level, Memory, Stored, WIDEST, prefetch};
use super::lattice::Velocities;
use super::pages::Pages;
use super::quanta::{quanta, sum_of_quanta};
use base::number::real;
use base::thread_pool;

/// Parity of the last pass, which determines the incoming end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// State at the start and after an odd pass: populations are stored in their own cells.
    Home,
    /// State after an even pass: outgoing populations are stored, reversed, in the positions from which they were
    /// read.
    Reversed,
}

/// Positions in the whole array of the two numbers at the ends of a link from cell x along direction i.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Link {
    /// Slot ī of x.
    pub near: u32,
    /// Slot i of x + c_i.
    pub far: u32,
}

/// Minimum number of cells of a row across the vertical axis of a fluid with a free surface.
const LEAST_ACROSS: usize = 32;

/// Returns the axis of unit stride: the longer one of those normal to the split axis (the first if equal), because
/// the faces at the ends of rows cost most: one cache line per value. Below a free surface it is horizontal, unless
/// rows would be short: then interface cells are adjacent in memory.
fn fastest(
    cells: [usize; 3],
    dimension: usize,
    split: usize,
    surface_axis: Option<usize>,
) -> usize {
    let longest = |vertical: Option<usize>| {
        (0..dimension)
            .filter(|&a| a != split && Some(a) != vertical)
            .rev()
            .max_by_key(|&a| cells[a])
    };
    longest(surface_axis)
        .filter(|&a| cells[a] >= LEAST_ACROSS)
        .or_else(|| longest(None))
        .unwrap_or(0)
}

/// Buffers of a thread for sums over rows and for the moments of one row, reused between rows.
#[derive(Clone, Debug, Default)]
pub struct RowSums {
    sums: [i128; 4],
    moments: [Vec<f64>; 4],
}

/// Maximum number of populations of a cell.
const MAX_POPULATIONS: usize = 27;

impl Link {
    /// Returns the position of the outgoing f*_i(x).
    #[inline(always)]
    #[must_use]
    pub fn out(self, parity: Parity) -> usize {
        (match parity {
            Parity::Reversed => self.near,
            Parity::Home => self.far,
        }) as usize
    }

    /// Returns the position of the incoming f_ī(x) of the next step.
    #[inline(always)]
    #[must_use]
    pub fn incoming(self, parity: Parity) -> usize {
        (match parity {
            Parity::Reversed => self.far,
            Parity::Home => self.near,
        }) as usize
    }
}

/// Populations g_i = f_i - w_i of one slab.
///
/// Local cell coordinates run from -1 (ghost) over `0..cells` to `cells` (ghost) along each axis.
pub struct Populations<S: Stored> {
    memory: Pages<S>,
    /// Number of interior cells along x, y, z (z = 1 in 2-D).
    cells: [usize; 3],
    /// Distance in elements between neighbours along x, y, z.
    strides: [usize; 3],
    /// Number of positions from the start of an array to that of the next one.
    array: usize,
    /// Start of the array of each population.
    begins: Vec<usize>,
    /// Distance in positions to the neighbour along each direction.
    offsets: Vec<isize>,
    /// Position of the incoming population j of the cell at position 0 after an even pass, modulo 2^64.
    reversed: Vec<usize>,
    /// Position of cell (0, 0, 0) within an array.
    origin: usize,
    /// Axes from slowest to fastest.
    order: [usize; 3],
    velocities: Velocities,
    parity: Parity,
    /// Instruction set of the sums over rows.
    level: Level,
    /// `true` if the current values are on the GPU and this copy is outdated.
    on_device: bool,
}

/// Layout of a slab in memory.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Axes from slowest to fastest.
    order: [usize; 3],
    /// Distance between rows in numbers.
    pitch: usize,
    /// Number of rows of a plane, including ghosts.
    rows: usize,
    /// Number of planes, including ghosts.
    planes: usize,
    /// Distance between the arrays of two populations in numbers.
    array: usize,
}

impl Layout {
    /// Returns the axes of a slab of `cells` (x, y, z) with the slab axis `split`, from slowest to fastest;
    /// `surface_axis` is the vertical axis of a fluid with a free surface.
    #[must_use]
    pub fn order(
        dimension: usize,
        cells: [usize; 3],
        split: usize,
        surface_axis: Option<usize>,
    ) -> [usize; 3] {
        let fast = fastest(cells, dimension, split, surface_axis);
        [split, 3 - split - fast, fast]
    }

    /// Returns the axes of a domain of `cells` (x, y, z) on slabs across its longest axis, like [`Self::order`].
    #[must_use]
    pub fn usual(dimension: usize, cells: [usize; 3], surface_axis: Option<usize>) -> [usize; 3] {
        let longest = (0..dimension).rev().max_by_key(|&a| cells[a]);
        Self::order(dimension, cells, longest.unwrap_or(0), surface_axis)
    }

    /// Returns the layout of a slab of `cells` (x, y, z) with these axes from slowest to fastest.
    #[must_use]
    pub fn for_slab<S>(velocities: &Velocities, cells: [usize; 3], order: [usize; 3]) -> Self {
        let [split, middle, fast] = order;
        // The pitch has capacity for whole vectors beyond the last cell and is never a multiple of a page.
        let mut pitch = 8 + cells[fast].next_multiple_of(8) + 8;
        if pitch.is_multiple_of(512) {
            pitch += 8;
        }
        let ghosts = |axis: usize| usize::from(axis < velocities.dimension);
        let rows = cells[middle] + 2 * ghosts(middle);
        let planes = cells[split] + 2 * ghosts(split);
        let page = 4096 / size_of::<S>();
        let stagger = 1600 / size_of::<S>();
        let used = pitch.saturating_mul(rows).saturating_mul(planes);
        Self {
            order,
            pitch,
            rows,
            planes,
            array: used.saturating_add(page - 1) / page * page + stagger,
        }
    }

    /// Returns the number of positions of an array, including ghosts and the padding of rows.
    #[must_use]
    pub fn positions(&self) -> f64 {
        real(self.pitch) * real(self.rows) * real(self.planes)
    }
}

impl<S: Stored> Populations<S> {
    /// Allocates a slab of `cells` (x, y, z), all populations at rest. `split` is the slab axis.
    ///
    /// # Errors
    /// If the memory cannot be allocated, or the slab needs more than 2³² numbers.
    pub fn new(
        velocities: Velocities,
        cells: [usize; 3],
        split: usize,
    ) -> Result<Self, FluidError> {
        let order = Layout::order(velocities.dimension, cells, split, None);
        Self::with_order(velocities, cells, order)
    }

    /// Allocates a slab like [`Self::new`] with these axes from slowest to fastest.
    ///
    /// # Errors
    /// The errors are those of [`Self::new`].
    pub fn with_order(
        velocities: Velocities,
        cells: [usize; 3],
        order: [usize; 3],
    ) -> Result<Self, FluidError> {
        let layout = Layout::for_slab::<S>(&velocities, cells, order);
        let Layout {
            order,
            pitch,
            rows,
            array,
            ..
        } = layout;
        let [split, middle, fast] = order;
        let ghosts = |axis: usize| usize::from(axis < velocities.dimension);
        let mut strides = [0; 3];
        strides[fast] = 1;
        strides[middle] = pitch;
        strides[split] = pitch * rows;
        let origin = 8 + strides[middle] * ghosts(middle) + strides[split] * ghosts(split);
        let ranks: Vec<usize> = velocities.c.iter().map(|c| rank(*c, &velocities)).collect();
        let arrays = ranks.iter().max().map_or(0, |last| last + 1);
        let total = array
            .checked_mul(arrays)
            .filter(|&n| u32::try_from(n).is_ok())
            .ok_or(FluidError::TooLarge(cells))?;
        let begins: Vec<usize> = ranks.iter().map(|rank| rank * array).collect();
        let distance = |c: &[i8; 3]| -> isize {
            (0..3)
                .map(|a| isize::from(c[a]) * strides[a].cast_signed())
                .sum()
        };
        let offsets: Vec<isize> = velocities.c.iter().map(distance).collect();
        let back = velocities.opposite.iter().zip(&offsets);
        let reversed = back.map(|(&i, offset)| begins[i].wrapping_add_signed(-offset));
        Ok(Self {
            memory: Pages::new(total)?,
            cells,
            strides,
            array,
            reversed: reversed.collect(),
            offsets,
            begins,
            origin,
            order,
            velocities,
            parity: Parity::Home,
            level: Level::best(),
            on_device: false,
        })
    }

    /// Returns the number of interior cells along x, y, z.
    #[must_use]
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// Returns the axes from slowest (the slab axis) to fastest (unit stride).
    #[must_use]
    pub fn order(&self) -> [usize; 3] {
        self.order
    }

    /// Returns the velocity set.
    #[must_use]
    pub fn velocities(&self) -> &Velocities {
        &self.velocities
    }

    /// Returns the instruction set of the processor.
    pub(crate) fn level(&self) -> Level {
        self.level
    }

    /// Returns the parity of the last pass.
    #[must_use]
    pub fn parity(&self) -> Parity {
        self.parity
    }

    /// Returns the length of an array with one entry per position of this layout (for flags and maps).
    #[must_use]
    pub fn cell_positions(&self) -> usize {
        self.array
    }

    /// Returns the position of a cell or ghost cell within one array.
    #[inline(always)]
    #[must_use]
    pub fn cell(&self, at: [isize; 3]) -> usize {
        self.origin
            .wrapping_add_signed(at[0] * self.strides[0].cast_signed())
            .wrapping_add_signed(at[1] * self.strides[1].cast_signed())
            .wrapping_add_signed(at[2] * self.strides[2].cast_signed())
    }

    /// Returns the position of an interior cell.
    #[must_use]
    pub fn interior_cell(&self, at: [usize; 3]) -> usize {
        self.cell(at.map(usize::cast_signed))
    }

    /// Returns the distance in positions from a cell to its neighbour along direction `i`.
    #[inline(always)]
    #[must_use]
    pub fn offset(&self, i: usize) -> isize {
        self.offsets[i]
    }

    /// Returns the link that leaves the cell at position `cell` along direction `i`.
    #[inline]
    #[must_use]
    pub fn link(&self, cell: usize, i: usize) -> Link {
        let back = self.velocities.opposite[i];
        Link {
            near: position(self.begins[back] + cell),
            far: position(self.reversed[back].wrapping_add(cell)),
        }
    }

    /// Returns the position of slot `i` of a cell, independently of the parity.
    #[inline(always)]
    #[must_use]
    pub fn slot(&self, cell: usize, i: usize) -> usize {
        self.begins[i] + cell
    }

    /// Returns the position of the incoming f_j of a cell.
    #[inline]
    #[must_use]
    pub fn incoming(&self, cell: usize, j: usize) -> usize {
        self.incoming_after(self.parity, cell, j)
    }

    /// Returns the position of the incoming f_j of a cell after a pass of this parity.
    #[inline]
    #[must_use]
    pub fn incoming_after(&self, parity: Parity, cell: usize, j: usize) -> usize {
        match parity {
            Parity::Home => self.begins[j] + cell,
            Parity::Reversed => self.reversed[j].wrapping_add(cell),
        }
    }

    /// Returns the position of the outgoing f*_i of a cell (meaningful after a pass, before the next).
    #[inline]
    #[must_use]
    pub fn outgoing(&self, cell: usize, i: usize) -> usize {
        match self.parity {
            Parity::Reversed => self.begins[self.velocities.opposite[i]] + cell,
            Parity::Home => self.begins[i] + cell.wrapping_add_signed(self.offset(i)),
        }
    }

    /// Returns the numbers of all populations.
    ///
    /// # Panics
    /// If the current numbers are on a GPU and have not been fetched, because these would be an old state.
    #[must_use]
    pub fn numbers(&self) -> &[S] {
        assert!(!self.on_device, "the populations are on the GPU");
        &self.memory
    }

    /// Returns the numbers of all populations for writing.
    ///
    /// # Panics
    /// If the current numbers are on a GPU, see [`Self::numbers`].
    pub fn numbers_mut(&mut self) -> &mut [S] {
        assert!(!self.on_device, "the populations are on the GPU");
        &mut self.memory
    }

    /// Sets the parity to that of the start, after every incoming population has been filled.
    pub fn set_home(&mut self) {
        self.parity = Parity::Home;
    }

    /// Returns every interior cell of the slab in the order slow, middle, fast: local coordinates and position.
    pub fn interior(&self) -> impl Iterator<Item = ([usize; 3], usize)> + '_ {
        let [s, m, f] = self.order;
        let cells = self.cells;
        (0..cells[s]).flat_map(move |i| {
            (0..cells[m]).flat_map(move |j| {
                (0..cells[f]).map(move |k| {
                    let mut at = [0; 3];
                    at[s] = i;
                    at[m] = j;
                    at[f] = k;
                    (at, self.cell(at.map(usize::cast_signed)))
                })
            })
        })
    }

    /// Returns every row of interior cells along the fastest axis in memory order: local coordinates and position
    /// of its first cell.
    pub fn rows(&self) -> impl Iterator<Item = ([usize; 3], usize)> + use<'_, S> {
        let [s, m, _] = self.order;
        let cells = self.cells;
        (0..cells[s]).flat_map(move |i| {
            (0..cells[m]).map(move |j| {
                let mut at = [0; 3];
                at[s] = i;
                at[m] = j;
                (at, self.cell(at.map(usize::cast_signed)))
            })
        })
    }

    /// Changes the parity after a pass.
    pub(crate) fn flip(&mut self) {
        self.parity = match self.parity {
            Parity::Home => Parity::Reversed,
            Parity::Reversed => Parity::Home,
        };
    }

    /// Returns, for each population, the position from which a row of cells starting at `cell` reads it; the
    /// opposite population is written there.
    pub(crate) fn row_positions<const Q: usize>(&self, cell: usize) -> [usize; Q] {
        std::array::from_fn(|i| self.incoming(cell, i))
    }

    /// Returns `true` if the current values are on the GPU.
    pub(crate) fn are_on_device(&self) -> bool {
        self.on_device
    }

    /// Sets whether the current values are on the GPU.
    pub(crate) fn set_on_device(&mut self, on_device: bool) {
        self.on_device = on_device;
    }

    /// Returns the address of the numbers of all populations.
    pub(crate) fn base(&mut self) -> *mut S {
        assert!(!self.on_device, "the populations are on the GPU");
        self.memory.start()
    }

    /// Returns the density deviation and momentum Σ c g of a cell from its incoming populations, for either parity.
    #[must_use]
    pub fn moments(&self, cell: usize) -> (f64, [f64; 3]) {
        self.sums(|i| self.incoming(cell, i))
    }

    /// Computes the moments of a row of `length` cells along the fastest axis from `cell` on, with the same bits as
    /// [`Self::moments`], in memory order: density deviation, then the three components of the momentum.
    #[inline(never)]
    pub fn row_moments(&self, cell: usize, length: usize, moments: &mut [Vec<f64>; 4]) {
        // The length is rounded up to whole vectors, for which a row has capacity.
        let padded = length.next_multiple_of(WIDEST);
        for m in moments.iter_mut() {
            m.clear();
            m.resize(padded, 0.0);
        }
        let base = self.numbers().as_ptr();
        let mut rows = [base; MAX_POPULATIONS];
        for (i, row) in rows.iter_mut().take(self.velocities.q()).enumerate() {
            *row = base.wrapping_add(self.incoming(cell, i));
        }
        let velocities = &self.velocities.c[..];
        match self.level {
            // SAFETY: the processor has this instruction set, as `Level::best` detected; the rows are in the array.
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => unsafe { add_rows_avx512(velocities, &rows, moments) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Level::Avx2 => unsafe { add_rows_avx2(velocities, &rows, moments) },
            // SAFETY: as above.
            Level::Scalar => unsafe { add_rows::<S, f64>(velocities, &rows, moments) },
        }
        for m in moments.iter_mut() {
            m.truncate(length);
        }
    }

    /// Returns the sum of values of cells in quanta, independent of the order.
    #[must_use]
    pub fn in_quanta(&self, values: &[f64]) -> i128 {
        sum_of_quanta(self.level, values)
    }

    /// Returns the density deviation and momentum of all interior cells in quanta, summed on all threads.
    #[must_use]
    pub fn totals(&self, buffers: &mut Vec<RowSums>) -> [i128; 4] {
        self.sum_rows(buffers, |_, moments, sums| {
            for (sum, values) in sums.iter_mut().zip(moments) {
                *sum += self.in_quanta(values);
            }
        })
    }

    /// Returns the sum of the density deviation over all cells and of the momentum over selected cells.
    #[must_use]
    pub fn totals_within(
        &self,
        buffers: &mut Vec<RowSums>,
        within: impl Fn([usize; 3]) -> bool + Sync,
    ) -> [i128; 4] {
        let [.., fast] = self.order;
        self.sum_rows(buffers, |mut at, [drho, momentum @ ..], sums| {
            sums[0] += self.in_quanta(drho);
            for k in 0..drho.len() {
                at[fast] = k;
                if within(at) {
                    for (sum, m) in sums[1..].iter_mut().zip(momentum) {
                        *sum += i128::from(quanta(m[k]));
                    }
                }
            }
        })
    }

    /// Returns the sums that `add` computes from the moments of each row, on all threads.
    fn sum_rows(
        &self,
        buffers: &mut Vec<RowSums>,
        add: impl Fn([usize; 3], &[Vec<f64>; 4], &mut [i128; 4]) + Sync,
    ) -> [i128; 4] {
        buffers.resize_with(thread_pool::threads(), RowSums::default);
        for part in &mut *buffers {
            part.sums = [0; 4];
        }
        let length = self.cells[self.order[2]];
        self.by_rows(buffers, |at, part| {
            self.row_moments(self.interior_cell(at), length, &mut part.moments);
            add(at, &part.moments, &mut part.sums);
        });
        let mut totals = [0; 4];
        for part in buffers {
            for (total, sum) in totals.iter_mut().zip(part.sums) {
                *total += sum;
            }
        }
        totals
    }

    /// Calls `each` with the first cell of every row and an entry of `gathered`, on as many threads as there are
    /// entries; each thread has its own entry.
    pub fn by_rows<T: Send>(&self, gathered: &mut [T], each: impl Fn([usize; 3], &mut T) + Sync) {
        let [slow, middle, _] = self.order;
        let rows = self.cells[slow] * self.cells[middle];
        let pieces = thread_pool::threads().min(rows).min(gathered.len());
        thread_pool::each_item(&mut gathered[..pieces], 1, |piece, gathered| {
            for row in rows * piece / pieces..rows * (piece + 1) / pieces {
                let mut at = [0; 3];
                (at[slow], at[middle]) = (row / self.cells[middle], row % self.cells[middle]);
                each(at, gathered);
            }
        });
    }

    /// Returns the local coordinates of the interior or ghost cell at a position within an array.
    #[must_use]
    pub fn coordinates(&self, position: usize) -> [isize; 3] {
        let [slow, middle, fast] = self.order;
        let mut at = [0; 3];
        // Coordinates are counted from the first ghost cell, so that none is negative; rows have 8 positions before
        // their first cell.
        let ghosts = |axis: usize| usize::from(axis < self.velocities.dimension);
        let first = 8 - ghosts(fast).min(8);
        let rest = position - first;
        at[slow] = (rest / self.strides[slow]).cast_signed() - ghosts(slow).cast_signed();
        let rest = rest % self.strides[slow];
        at[middle] = (rest / self.strides[middle]).cast_signed() - ghosts(middle).cast_signed();
        at[fast] = (rest % self.strides[middle]).cast_signed() - ghosts(fast).cast_signed();
        at
    }

    /// Returns the moments of the outgoing populations, that is, the state after the collision.
    #[must_use]
    pub fn outgoing_moments(&self, cell: usize) -> (f64, [f64; 3]) {
        self.sums(|i| self.outgoing(cell, i))
    }

    /// Returns the density deviation and momentum of the numbers at a position for each population.
    #[inline]
    fn sums(&self, at: impl Fn(usize) -> usize) -> (f64, [f64; 3]) {
        let numbers = self.numbers();
        let mut drho = 0.0;
        let mut m = [0.0; 3];
        for (i, c) in self.velocities.c.iter().enumerate() {
            let g = numbers[at(i)].to_f64();
            drho += g;
            for a in 0..3 {
                m[a] += f64::from(c[a]) * g;
            }
        }
        (drho, m)
    }
}

/// Order of (c_y, c_z) in memory: those of D2Q9 first, those that D3Q19 does not combine with c_x last.
pub(super) const ACROSS: [[i8; 2]; 9] = [
    [0, 0],
    [1, 0],
    [-1, 0],
    [0, 1],
    [0, -1],
    [1, 1],
    [-1, -1],
    [1, -1],
    [-1, 1],
];

/// Returns the index of the array of a velocity.
fn rank(c: [i8; 3], velocities: &Velocities) -> usize {
    let across = ACROSS.iter().position(|a| *a == [c[1], c[2]]).unwrap_or(0);
    let all = if velocities.dimension == 2 { 3 } else { 9 };
    let along = match c[0] {
        0 => 0,
        1 => 1,
        _ => 2,
    };
    along * all + across
}

/// Prefetch distance in bytes for sums over rows.
const AHEAD: usize = 256;

/// Adds the density deviation and momentum of the cells of a row, given the start of the row for each population.
///
/// # Safety
/// Each of `rows` that a velocity has must be followed by as many numbers as `moments` has; the processor must support
/// the instructions of `N`.
#[inline(always)]
unsafe fn add_rows<S: Memory<N>, N: Lanes>(
    velocities: &[[i8; 3]],
    rows: &[*const S; MAX_POPULATIONS],
    [drho, x, y, z]: &mut [Vec<f64>; 4],
) where
    f64: Memory<N>,
{
    for k in (0..drho.len()).step_by(N::WIDTH) {
        let mut sum = N::splat(0.0);
        let mut m = [sum; 3];
        for (c, row) in velocities.iter().zip(rows) {
            // The prefetcher of the processor follows fewer streams than there are populations.
            prefetch(row.wrapping_add(k + AHEAD / size_of::<S>()));
            // SAFETY: promised by the caller.
            let g = unsafe { <S as Memory<N>>::load(row.add(k)) };
            sum = sum + g;
            for a in 0..3 {
                match c[a] {
                    1 => m[a] = m[a] + g,
                    -1 => m[a] = m[a] - g,
                    _ => {}
                }
            }
        }
        for (values, value) in [
            (&mut *drho, sum),
            (&mut *x, m[0]),
            (&mut *y, m[1]),
            (&mut *z, m[2]),
        ] {
            // SAFETY: the buffer has capacity for whole vectors.
            unsafe { <f64 as Memory<N>>::store(values.as_mut_ptr().add(k), value) };
        }
    }
}

/// Calls [`add_rows`] with the instructions of AVX2.
///
/// # Safety
/// The conditions are those of [`add_rows`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn add_rows_avx2<S: Stored>(
    velocities: &[[i8; 3]],
    rows: &[*const S; MAX_POPULATIONS],
    moments: &mut [Vec<f64>; 4],
) {
    // SAFETY: forwarded from the caller.
    unsafe { add_rows::<S, Avx2>(velocities, rows, moments) };
}

/// Calls [`add_rows`] with the instructions of AVX-512.
///
/// # Safety
/// The conditions are those of [`add_rows`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma")]
unsafe fn add_rows_avx512<S: Stored>(
    velocities: &[[i8; 3]],
    rows: &[*const S; MAX_POPULATIONS],
    moments: &mut [Vec<f64>; 4],
) {
    // SAFETY: forwarded from the caller.
    unsafe { add_rows::<S, Avx512>(velocities, rows, moments) };
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "`Populations::new` refuses slabs with more positions than u32 can number"
)]
#[inline(always)]
fn position(n: usize) -> u32 {
    n as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::D3Q19;

    #[test]
    fn a_position_leads_back_to_its_cell() {
        for split in 0..3 {
            let velocities = Velocities::for_lattice::<D3Q19, 19>();
            let lattice = Populations::<f64>::new(velocities, [5, 4, 3], split).unwrap();
            for z in -1..4 {
                for y in -1..5 {
                    for x in -1..6 {
                        let cell = lattice.cell([x, y, z]);
                        assert_eq!(lattice.coordinates(cell), [x, y, z]);
                    }
                }
            }
        }
    }

    #[test]
    fn rows_lie_across_the_vertical_axis_below_a_surface() {
        let order = |cells, split, vertical| Layout::order(3, cells, split, vertical);
        assert_eq!(order([96, 96, 480], 0, None), [0, 1, 2]);
        assert_eq!(order([96, 96, 480], 0, Some(2)), [0, 2, 1]);
        assert_eq!(order([96, 40, 480], 2, Some(2)), [2, 1, 0]);
        // Rows would be short.
        assert_eq!(order([96, 20, 480], 0, Some(2)), [0, 1, 2]);
        assert_eq!(Layout::order(2, [768, 384, 1], 0, Some(1)), [0, 2, 1]);
    }

    #[test]
    fn moments_of_a_row_are_those_of_its_cells() {
        for split in 0..3 {
            let velocities = Velocities::for_lattice::<D3Q19, 19>();
            let mut lattice = Populations::<f64>::new(velocities, [5, 4, 3], split).unwrap();
            for (n, number) in (0_u32..).zip(lattice.numbers_mut()) {
                *number = f64::from(n.wrapping_mul(2_654_435_761)) * 1e-12 - 2e-3;
            }
            for _ in 0..2 {
                let fast = lattice.order()[2];
                let mut row = [(); 4].map(|()| vec![7.0; 2]);
                let mut rows = lattice.rows();
                for (at, cell) in lattice.interior() {
                    if at[fast] == 0 {
                        assert_eq!(rows.next(), Some((at, cell)));
                        lattice.row_moments(cell, lattice.cells()[fast], &mut row);
                    }
                    let (one, m) = lattice.moments(cell);
                    assert_eq!(row[0][at[fast]].to_bits(), one.to_bits());
                    assert_eq!([1, 2, 3].map(|a| row[a][at[fast]]), m);
                }
                assert!(rows.next().is_none());
                drop(rows);
                lattice.flip();
            }
        }
    }
}
