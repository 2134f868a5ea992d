//! Kernels that compute the solid fractions of the cells covered by balls on a GPU.
//!
//! They are separate from `coupling::cover_map`, which computes the fractions of all shapes on the processor, because
//! the work is divided differently; both give the same bits for balls.
//!
//! Each ball has a box of the cells that it may reach. The closed forms of [`base::ball`] need the values of [`edge`]
//! at pairs of coordinates, with three arctangents each. Many cells use the same value, so that these values are
//! computed first, in a kernel of their own.
//!
//! | kernel | work of a thread | result |
//! |---|---|---|
//! | `clear` | a cell of the slab | the cell without bodies |
//! | `edge` | a coordinate of the corners of a box, or a pair of coordinates | cap, or edge |
//! | `cover` | a cell of a box | its fraction, put at the head of the list of the same cell of the slab |
//! | `settle` | a cell of a box | owner and fraction of the cell of the slab, if this is the head of the list |
//!
//! If several balls fill parts of a cell, the parts are stored in the order of the names of the balls, independently of
//! the order of the threads.

use crate::rigid::Rigid;
use crate::saturation::solid::{CoveringBody, DEEP, NONE, SHARED, STILL, Share, Shares, total};
use base::ball::{Coordinate, NormalDistances, around, chord, edge, filled, octant_of, within};
use base::number::single;
use core::sync::atomic::{AtomicU32, Ordering};

/// Box of the cells that a ball may reach. The layout is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct BallBox {
    /// Slot of the ball in the list of bodies.
    slot: u32,
    /// Index of the first cell of the box among the cells of all boxes, and of its first edge among all edges.
    pub(crate) first: u32,
    edges: u32,
    /// First cell of the box in the slab, and number of cells along each axis. Ghost cells have the coordinates -1 and
    /// the number of cells of the slab.
    low: [i32; 3],
    cells: [i32; 3],
}

/// Number of threads of a warp.
pub(crate) const WARP: u32 = 32;

/// Number of threads of a block. The first cell of each box has an index that is a multiple of this number, so that all
/// cells of a block belong to the same box.
pub(crate) const BLOCK: u32 = 128;

impl BallBox {
    /// Returns the box of a body in a slab with the given numbers of cells. The box has no cells if the ball does not
    /// reach the slab.
    #[cfg(not(target_arch = "nvptx64"))]
    fn new(slot: u32, solid: &CoveringBody, slab: [i32; 3], (first, edges): (u32, u32)) -> Self {
        use base::number::floor_i32;
        let Rigid {
            position, radius, ..
        } = solid.motion;
        let (mut low, mut cells) = ([0; 3], [0; 3]);
        for a in 0..3 {
            low[a] = (floor_i32(position[a] - radius) + solid.frame[a]).max(-1);
            let high = (floor_i32(position[a] + radius) + 1 + solid.frame[a]).min(slab[a] + 1);
            cells[a] = (high - low[a]).max(0);
        }
        if cells.contains(&0) {
            cells = [0; 3];
        }
        Self {
            slot,
            first,
            edges,
            low,
            cells,
        }
    }

    /// Returns the number of blocks and the maximum number of edges of the box of a ball, for any position of the ball.
    #[cfg(not(target_arch = "nvptx64"))]
    fn blocks_and_edges(solid: &CoveringBody) -> (u32, u32) {
        use base::number::floor_i32;
        let across = floor_i32(2.0 * solid.motion.radius).cast_unsigned() + 2;
        let corners = across + 1;
        (
            across.pow(3).div_ceil(BLOCK),
            3 * corners * corners + 6 * corners,
        )
    }

    /// Lists the boxes of all balls in a slab, and the index of the box of each block. Returns the maximum number of
    /// edges of all boxes together.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn list_all(
        solids: &[CoveringBody],
        slab: [i32; 3],
        boxes: &mut Vec<Self>,
        of_blocks: &mut Vec<u32>,
    ) -> u32 {
        boxes.clear();
        of_blocks.clear();
        let mut edges = 0;
        for (slot, solid) in (0..).zip(solids) {
            if solid.motion.radius > 0.0 {
                let first = base::number::to_u32(of_blocks.len()) * BLOCK;
                let (blocks, more) = Self::blocks_and_edges(solid);
                let number = base::number::to_u32(boxes.len());
                of_blocks.extend((0..blocks).map(|_| number));
                boxes.push(Self::new(slot, solid, slab, (first, edges)));
                edges += more;
            }
        }
        edges
    }

    /// Returns the number of cells of the box.
    #[inline(always)]
    fn count(&self) -> u32 {
        let [x, y, z] = self.cells.map(i32::cast_unsigned);
        x * y * z
    }

    /// Returns the index of the first edge for coordinates along `axis` and the next axis, and the number of corners
    /// along the next axis.
    #[inline(always)]
    fn edges_of(&self, axis: u32) -> (u32, u32) {
        let [x, y, z] = self.cells.map(|count| count.cast_unsigned() + 1);
        match axis {
            0 => (0, y),
            1 => (x * y, z),
            _ => (x * y + y * z, x),
        }
    }

    /// Returns the index after the last coordinate of the box.
    #[inline(always)]
    fn end_of_coordinates(&self) -> u32 {
        let [x, y, z] = self.cells.map(|count| count.cast_unsigned() + 1);
        x * y + y * z + z * x + 2 * (x + y + z)
    }

    /// Returns the index of the first coordinate along an axis. Coordinates are stored after all edges of the box, as
    /// two numbers each: the coordinate in radii, and its cap.
    #[inline(always)]
    fn coordinates_of(&self, axis: u32) -> u32 {
        let [x, y, z] = self.cells.map(|count| count.cast_unsigned() + 1);
        let edges = x * y + y * z + z * x;
        match axis {
            0 => edges,
            1 => edges + 2 * x,
            _ => edges + 2 * (x + y),
        }
    }
}

/// Counters that threads increment: [`Share`]s, lists of them, cells deep inside bodies, and other covered cells.
#[derive(Debug, Default)]
#[repr(C)]
pub(crate) struct Counters {
    shares: AtomicU32,
    pub lists: AtomicU32,
    pub(crate) deep: AtomicU32,
    pub(crate) mixed: AtomicU32,
}

/// Returns the component along an axis. The branches keep the array in registers: a GPU stores an array in memory if
/// an index is known only at run time.
#[inline(always)]
fn component<T: Copy>([x, y, z]: [T; 3], axis: u32) -> T {
    match axis {
        0 => x,
        1 => y,
        _ => z,
    }
}

/// Balls, cells of a slab, and arrays of the kernels. The layout is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Balls {
    /// Bodies by slot.
    pub(crate) solids: *const CoveringBody,
    /// Boxes of the balls, in the order of their cells.
    pub(crate) boxes: *const BallBox,
    /// Index of the box of each block.
    pub(crate) of_blocks: *const u32,
    /// Edges and coordinates of all boxes.
    pub(crate) edges: *mut f64,
    /// Fraction of each cell of the boxes, position of the cell in the slab, and next cell of the same list.
    pub(crate) parts: *mut f32,
    pub(crate) positions: *mut u32,
    pub(crate) next: *mut u32,
    /// Head of the list of each cell of the slab, by position.
    pub(crate) heads: *const AtomicU32,
    /// Fraction and owner of the cells of the slab, by position.
    pub(crate) fraction: *mut f32,
    pub(crate) owner: *mut u32,
    /// Fractions in cells that several balls cover, and the list of each of these cells.
    pub(crate) shares: *mut Share,
    pub(crate) shared: *mut Shares,
    pub(crate) counters: *const Counters,
    /// Number of cells of all boxes, and number of positions of the slab.
    pub(crate) cells_of_boxes: u32,
    pub(crate) count_of_positions: u32,
    /// Position of cell (0, 0, 0) of the slab, distance in positions between neighbours along each axis, and number of
    /// cells.
    pub(crate) origin: u32,
    pub(crate) strides: [i32; 3],
    pub(crate) cells: [i32; 3],
    /// Axes from slowest to fastest in memory.
    pub(crate) order: [u32; 3],
}

impl Balls {
    /// Returns the box that contains cell `n` of all boxes.
    ///
    /// # Safety
    /// `n` must be below the number of cells of all boxes.
    #[inline(always)]
    unsafe fn box_of(&self, n: u32) -> &BallBox {
        // SAFETY: promised by the caller.
        unsafe {
            let number = self.of_blocks.add((n / BLOCK) as usize).read();
            &*self.boxes.add(number as usize)
        }
    }

    /// Returns the centre and the radius of a ball in cells of its raw frame, and the offset of this frame.
    ///
    /// # Safety
    /// The slot must be that of a box.
    #[inline(always)]
    unsafe fn ball(&self, slot: u32) -> ([f64; 3], f64, [i32; 3]) {
        // SAFETY: promised by the caller.
        let solid = unsafe { &*self.solids.add(slot as usize) };
        (solid.motion.position, solid.motion.radius, solid.frame)
    }

    /// Removes all bodies from the cell at a position.
    ///
    /// # Safety
    /// All arrays must be as described, and no other thread may work on this position.
    #[inline(always)]
    pub(crate) unsafe fn clear(&self, position: u32) {
        if position >= self.count_of_positions {
            return;
        }
        let at = position as usize;
        // SAFETY: promised by the caller.
        unsafe {
            (*self.heads.add(at)).store(NONE, Ordering::Relaxed);
            if self.owner.add(at).read() != STILL {
                self.owner.add(at).write(NONE);
                self.fraction.add(at).write(0.0);
            }
        }
    }

    /// Computes edges and coordinates of box `number`: those with index `thread` and every [`BLOCK`]-th after it.
    ///
    /// # Safety
    /// The conditions are those of [`Self::clear`].
    #[inline(always)]
    pub(crate) unsafe fn edge(&self, number: u32, thread: u32) {
        // SAFETY: promised by the caller.
        let ball_box = unsafe { &*self.boxes.add(number as usize) };
        let mut place = thread;
        while ball_box.cells[0] > 0 && place < ball_box.end_of_coordinates() {
            // SAFETY: promised by the caller.
            unsafe { self.one_edge(ball_box, place) };
            place += BLOCK;
        }
    }

    /// Computes the edge, coordinate or cap with an index in a box.
    ///
    /// # Safety
    /// The conditions are those of [`Self::edge`].
    #[inline(always)]
    unsafe fn one_edge(&self, ball_box: &BallBox, place: u32) {
        // SAFETY: the slot is that of a box.
        let (centre, radius, frame) = unsafe { self.ball(ball_box.slot) };
        let coordinate = |axis: u32, corner: u32| {
            let axis = axis % 3;
            let x = component(ball_box.low, axis) - component(frame, axis) + corner.cast_signed();
            Coordinate::at_corner(x, component(centre, axis), radius)
        };
        let last = |start: fn(&BallBox, u32) -> u32| {
            let from = |axis: u32| u32::from(place >= start(ball_box, axis));
            from(1) + from(2)
        };
        let value = if place >= ball_box.coordinates_of(0) {
            let axis = last(BallBox::coordinates_of);
            let place = place - ball_box.coordinates_of(axis);
            let Coordinate { size, sign, cap } = coordinate(axis, place / 2);
            if place.is_multiple_of(2) {
                sign * size
            } else {
                cap
            }
        } else {
            let axis = last(|ball_box, axis| ball_box.edges_of(axis).0);
            let (start, along) = ball_box.edges_of(axis);
            // A divisor of at least 1 keeps the compiler from adding a panic for division by zero, which GPUs cannot
            // link.
            let (place, along) = (place - start, along.max(1));
            let size = |axis: u32, corner: u32| coordinate(axis, corner).size;
            edge(size(axis, place / along), size(axis + 1, place % along))
        };
        // SAFETY: the index is that of this edge or coordinate.
        unsafe {
            self.edges
                .add((ball_box.edges + place) as usize)
                .write(value)
        };
    }

    /// Computes the fraction of cell `n` of the boxes that its ball fills, and adds the cell to a list.
    ///
    /// # Safety
    /// The conditions are those of [`Self::clear`]; the edges must have been computed.
    #[inline(always)]
    pub(crate) unsafe fn cover(&self, n: u32) {
        if n >= self.cells_of_boxes {
            return;
        }
        // SAFETY: promised by the caller.
        unsafe {
            let ball_box = self.box_of(n);
            let (part, position) = self.part(ball_box, n - ball_box.first);
            let covers = part != 0.0 && self.owner.add(position as usize).read() != STILL;
            self.parts
                .add(n as usize)
                .write(if covers { part } else { 0.0 });
            if covers {
                self.positions.add(n as usize).write(position);
                let before = (*self.heads.add(position as usize)).swap(n, Ordering::Relaxed);
                self.next.add(n as usize).write(before);
            }
        }
    }

    /// Returns the fraction of a cell of a box that its ball fills, and the position of the cell in the slab. The
    /// fraction is [`DEEP`] deep inside the ball, and negative in a ghost cell.
    ///
    /// # Safety
    /// The conditions are those of [`Self::cover`].
    #[inline(always)]
    unsafe fn part(&self, ball_box: &BallBox, place: u32) -> (f32, u32) {
        let [slow, middle, fast] = self.order;
        // SAFETY: the slot is that of a box.
        let (centre, radius, frame) = unsafe { self.ball(ball_box.slot) };
        let count = |axis: u32| component(ball_box.cells, axis).cast_unsigned().max(1);
        if place >= ball_box.count() {
            return (0.0, 0);
        }
        let in_order = [
            place / count(fast) / count(middle),
            place / count(fast) % count(middle),
            place % count(fast),
        ];
        let along = |axis: u32| {
            if axis == slow {
                in_order[0]
            } else if axis == middle {
                in_order[1]
            } else {
                in_order[2]
            }
        };
        let in_box = [along(0), along(1), along(2)];
        let (mut cell, mut raw) = ([0; 3], [0; 3]);
        let (mut ghost, mut position) = (false, self.origin.cast_signed());
        for a in 0..3 {
            cell[a] = ball_box.low[a] + in_box[a].cast_signed();
            raw[a] = cell[a] - frame[a];
            ghost |= cell[a] < 0 || cell[a] >= self.cells[a];
            position += self.strides[a] * cell[a];
        }
        let across = |axis: u32| {
            NormalDistances::along_axis(component(centre, axis), f64::from(component(raw, axis)))
        };
        let across = across(slow) + across(middle);
        let (cell, centre, frame) = (
            component(cell, fast),
            component(centre, fast),
            component(frame, fast),
        );
        let line = |squared: f64| chord(centre, radius, squared);
        let lies_in = |[first, end]: [i32; 2]| first <= cell && cell < end;
        if !lies_in(around(line(across.nearest), frame)) {
            return (0.0, 0);
        }
        let part = if lies_in(within(line(across.farthest), 0, frame)) {
            if lies_in(within(line(across.beyond), 1, frame)) {
                DEEP
            } else {
                1.0
            }
        } else {
            // SAFETY: promised by the caller.
            single(unsafe { self.at_surface(ball_box, in_box, radius) })
        };
        let part = if ghost { 0.0 - part } else { part };
        (part, position.cast_unsigned())
    }

    /// Returns the fraction, inside its ball, of a cell that the surface of the ball crosses.
    ///
    /// # Safety
    /// The conditions are those of [`Self::cover`].
    #[inline(always)]
    unsafe fn at_surface(&self, ball_box: &BallBox, in_box: [u32; 3], radius: f64) -> f64 {
        // SAFETY: the index is that of an edge or coordinate of the box.
        let read = |at: u32| unsafe { self.edges.add((ball_box.edges + at) as usize).read() };
        let mut ends = [[Coordinate::default(); 2]; 3];
        // The first index is an axis; bits 1 and 0 of the second select the upper end of this axis and of the next one.
        let mut edges = [[0.0; 4]; 3];
        for a in 0..3 {
            let (start, along) = ball_box.edges_of(a);
            let (one, other) = (in_box[a as usize], in_box[(a as usize + 1) % 3]);
            for upper in 0..2 {
                let place = ball_box.coordinates_of(a) + 2 * (one + upper);
                let (at, cap) = (read(place), read(place + 1));
                ends[a as usize][upper as usize] = Coordinate {
                    size: at.abs(),
                    sign: at.signum(),
                    cap,
                };
            }
            for ends in 0..4 {
                let place = (one + ends / 2) * along + other + ends % 2;
                edges[a as usize][ends as usize] = read(start + place);
            }
        }
        let mut corners = [0.0; 8];
        for (c, corner) in corners.iter_mut().enumerate() {
            let upper = [c & 1, c >> 1 & 1, c >> 2 & 1];
            let at = [ends[0][upper[0]], ends[1][upper[1]], ends[2][upper[2]]];
            let edge = |a: usize, b: usize| edges[a][2 * upper[a] + upper[b]];
            *corner = at[0].sign
                * at[1].sign
                * at[2].sign
                * octant_of(
                    [at[0].size, at[1].size, at[2].size],
                    [at[0].cap, at[1].cap, at[2].cap],
                    [edge(0, 1), edge(1, 2), edge(2, 0)],
                );
        }
        filled(corners, radius)
    }

    /// Writes owner and fraction of a cell of the slab, given the list of its balls, if cell `n` of the boxes is the
    /// head of the list.
    ///
    /// # Safety
    /// The conditions are those of [`Self::clear`]; [`Self::cover`] must have been called for all cells of the boxes.
    #[inline(always)]
    pub(crate) unsafe fn settle(&self, n: u32) {
        // SAFETY: promised by the caller.
        unsafe {
            if n >= self.cells_of_boxes || self.parts.add(n as usize).read() == 0.0 {
                return;
            }
            let at = self.positions.add(n as usize).read() as usize;
            if (*self.heads.add(at)).load(Ordering::Relaxed) != n {
                return;
            }
            let slot_of = |n: u32| self.box_of(n).slot;
            let part_of = |n: u32| self.parts.add(n as usize).read();
            let next_of = |n: u32| self.next.add(n as usize).read();
            if next_of(n) == NONE {
                self.owner.add(at).write(slot_of(n));
                self.fraction.add(at).write(part_of(n));
                return;
            }
            let mut count = 0;
            let mut k = n;
            while k != NONE {
                (count, k) = (count + 1, next_of(k));
            }
            let counters = &*self.counters;
            let first = counters.shares.fetch_add(count, Ordering::Relaxed);
            let list = counters.lists.fetch_add(1, Ordering::Relaxed);
            let shares = self.shares.add(first as usize);
            let mut k = n;
            while k != NONE {
                let slot = slot_of(k);
                let name = (*self.solids.add(slot as usize)).name;
                let (mut before, mut other) = (0, n);
                while other != NONE {
                    let other_name = (*self.solids.add(slot_of(other) as usize)).name;
                    before += usize::from(other_name < name);
                    other = next_of(other);
                }
                let part = part_of(k);
                let fraction = if part < 0.0 { -part } else { part }.min(1.0);
                shares.add(before).write(Share { slot, fraction });
                k = next_of(k);
            }
            let shares = core::slice::from_raw_parts(shares, count as usize);
            self.shared
                .add(list as usize)
                .write(Shares::from_parts(shares));
            let sum = single(total(shares).min(1.0));
            let ghost = part_of(n) < 0.0;
            self.owner.add(at).write(SHARED | list);
            self.fraction.add(at).write(if ghost { -sum } else { sum });
        }
    }
}
