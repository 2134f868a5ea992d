//! Cover of the cells by solids on a GPU, and the loads on the bodies.
//!
//! It is separate from [`super::Gpu`], because most fluids have no covered cells. If all bodies are balls, the GPU
//! computes the fractions ([`super::balls`]). For other bodies the processor computes fractions and owners, and those
//! of all cells are sent if any cell has changed, 8 bytes per cell. Moving bodies change so many cells that sending
//! only the changed ones, with twelve bytes each from scattered memory, takes longer. The bodies are sent before each
//! pass.

use super::balls::{BLOCK, BallBox, Balls, Counters, WARP};
use super::lists::CoveredCells;
use super::loads::BodyLoad;
use super::program::Program;
use super::{Argument, Pinned, launch_of};
use crate::saturation::Cover;
use crate::saturation::pass::View;
use crate::saturation::solid::{Share, Shares};
use base::number::to_u32;
use cudarc::driver::{
    CudaContext, CudaEvent, CudaFunction, CudaSlice, CudaStream, DevicePtr, DeviceRepr,
    DriverError, PushKernelArg, ValidAsZeroBits,
};
use std::mem::MaybeUninit;
use std::sync::Arc;

/// Kernels for covered cells.
pub(super) struct Kernels {
    /// Passes over the cells deep inside bodies, and over the other covered cells.
    pub(super) deep: CudaFunction,
    pub(super) mixed: CudaFunction,
    /// Kernel that lists the covered cells.
    list_covered: CudaFunction,
    /// Kernels of [`Balls`], in the order of their launches.
    balls: [CudaFunction; 4],
}

impl Kernels {
    /// Loads the kernels by their names.
    pub(super) fn new<E>(
        [deep, mixed]: [String; 2],
        function: impl Fn(&str) -> Result<CudaFunction, E>,
    ) -> Result<Self, E> {
        Ok(Self {
            deep: function(&deep)?,
            mixed: function(&mixed)?,
            list_covered: function("list_covered")?,
            balls: [
                function("ball_clear")?,
                function("ball_edges")?,
                function("ball_cover")?,
                function("ball_settle")?,
            ],
        })
    }
}

/// Number of bytes per cell on the GPU in addition to [`Cover::BYTES`]: head of a list, number in the list of covered
/// cells, and previous fraction.
pub(super) const EXTRA_BYTES: usize = 2 * size_of::<u32>() + size_of::<f32>();

/// Cover on the GPU. The work on bodies has its own stream, so that the host receives the forces and moves the bodies
/// while the open cells collide.
pub(super) struct OnGpu {
    /// Stream of the work on bodies.
    pub(super) stream: Arc<CudaStream>,
    pub(super) events: CoverEvents,
    pub(super) kernels: Kernels,
    /// Pinned memory of the cells on the host, for transfers.
    _pinned: [Option<Pinned>; 2],
    /// Origin of the fractions on the GPU.
    made_from: MadeFrom,
    /// Fractions of the current cover and of the previous one, which the pass over the open cells may still read, and
    /// the index of the current ones.
    fractions: [CudaSlice<f32>; 2],
    now: usize,
    /// Owner of each cell, by position.
    owner: CudaSlice<u32>,
    /// Bodies by slot.
    solids: Buffer,
    /// Lists of the bodies of shared cells, and their fractions.
    shares: Buffer,
    parts: Buffer,
    mapping: Mapping,
    /// Memory of the lists of covered cells.
    _numbers: CudaSlice<u32>,
    counters: CudaSlice<u32>,
    /// Number of changes of the bodies at the last transfer.
    motions: u64,
    /// `true` if the last transfer may be incomplete.
    in_flight: bool,
    /// [`BodyLoad::COPIES`] loads for each slot, and the number of slots.
    pub(super) loads: Buffer,
    pub(super) bodies: u32,
    /// Arguments of the next passes: the view of the cover, and the lists of covered cells.
    pub(super) view: View,
    pub(super) covered: CoveredCells,
    /// Reusable buffers on the host.
    work: Work,
}

/// Events by which the streams of the bodies and of the fluid wait for each other.
pub(super) struct CoverEvents {
    /// Event on the stream of the bodies: the cover is complete.
    pub(super) made: CudaEvent,
    /// Event on the stream of the bodies: the covered cells have collided.
    pub(super) passed: CudaEvent,
    /// Event on the stream of the fluid: the populations are ready for a pass.
    pub(super) ready: CudaEvent,
    /// Events on the stream of the fluid: the pass over the open cells no longer reads the fractions with this index.
    done: [CudaEvent; 2],
}

impl CoverEvents {
    fn new(context: &Arc<CudaContext>) -> Result<Self, DriverError> {
        Ok(Self {
            made: context.new_event(None)?,
            passed: context.new_event(None)?,
            ready: context.new_event(None)?,
            done: [context.new_event(None)?, context.new_event(None)?],
        })
    }
}

/// Origin of the fractions on the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MadeFrom {
    /// No fractions yet.
    Nothing,
    /// Cells of the host, with their version.
    Cells(u64),
    /// Balls mapped on the GPU, with the number of their moves.
    Balls(u64),
}

/// Arrays of the kernels that map balls, see [`Balls`].
struct Mapping {
    heads: CudaSlice<u32>,
    boxes: Buffer,
    of_blocks: Buffer,
    edges: Buffer,
    fractions: Buffer,
    positions: Buffer,
    next: Buffer,
}

/// Buffers for lists that are sent to the GPU, and the list that was sent last.
#[derive(Default)]
struct Work {
    parts: Vec<Share>,
    shares: Vec<[u64; 2]>,
    boxes: Vec<BallBox>,
    of_blocks: Vec<u32>,
    sent_of_blocks: Vec<u32>,
}

/// Growing array on the GPU, with a pinned array on the host for direct transfers.
pub(super) struct Buffer {
    /// Array on the GPU.
    there: CudaSlice<Byte>,
    /// Pin of the array on the host; it is dropped before the array.
    pinned: Option<Pinned>,
    /// Array on the host.
    here: Vec<u64>,
}

/// Byte of a number or of padding, which may be uninitialised.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Byte(MaybeUninit<u8>);

// SAFETY: any byte is valid.
unsafe impl DeviceRepr for Byte {}
// SAFETY: as above.
unsafe impl ValidAsZeroBits for Byte {}

impl Buffer {
    /// Allocates a small array on the GPU.
    fn new(stream: &Arc<CudaStream>) -> Result<Self, DriverError> {
        Ok(Self {
            there: stream.alloc_zeros(1 << 12)?,
            pinned: None,
            here: Vec::new(),
        })
    }

    /// Returns the address of the array on the GPU.
    pub(super) fn address(&self, stream: &Arc<CudaStream>) -> u64 {
        self.there.device_ptr(stream).0
    }

    /// Allocates memory for `count` elements on the GPU if necessary, and returns its address. The contents may be
    /// lost.
    fn reserve<T>(&mut self, stream: &Arc<CudaStream>, count: usize) -> Result<u64, DriverError> {
        let bytes = count * size_of::<T>();
        if bytes > self.there.len() {
            self.there = stream.alloc_zeros(bytes.next_power_of_two())?;
        }
        Ok(self.address(stream))
    }

    /// Returns the first `bytes` bytes of the array on the host, which is extended if necessary.
    fn here(&mut self, bytes: usize) -> &mut [u8] {
        if bytes > size_of_val(&self.here[..]) {
            self.pinned = None;
            self.here = vec![0; bytes.next_power_of_two().max(1 << 12) / size_of::<u64>()];
            // SAFETY: the array outlives the pin.
            self.pinned = unsafe { Pinned::new(bytemuck::cast_slice(&self.here)) };
        }
        &mut bytemuck::cast_slice_mut(&mut self.here)[..bytes]
    }

    /// Sends a list to the GPU without waiting, and returns its address there.
    fn send<T: Copy>(&mut self, stream: &Arc<CudaStream>, list: &[T]) -> Result<u64, DriverError> {
        let address = self.reserve::<T>(stream, list.len())?;
        let count = size_of_val(list);
        if count > 0 {
            let here = self.here(count);
            // SAFETY: the array has this number of bytes, and any value is valid; kernels read structs of the same
            // layout (`repr(C)`).
            unsafe {
                std::ptr::copy_nonoverlapping(list.as_ptr().cast(), here.as_mut_ptr(), count);
            }
            let here = std::ptr::from_ref(here);
            let mut there = self.there.slice_mut(..count);
            // SAFETY: these are the bytes copied above, and any byte is a valid `Byte`.
            let bytes: &[Byte] = unsafe { &*(here as *const [Byte]) };
            stream.memcpy_htod(bytes, &mut there)?;
        }
        Ok(address)
    }

    /// Copies `count` words back from the GPU and waits for them.
    fn take(&mut self, stream: &Arc<CudaStream>, count: usize) -> Result<&[u64], DriverError> {
        let bytes = count * size_of::<u64>();
        if bytes == 0 {
            stream.synchronize()?;
            return Ok(&[]);
        }
        let here = std::ptr::from_mut(self.here(bytes));
        // SAFETY: these are the bytes of the array, and any byte is a valid `Byte`.
        let to: &mut [Byte] = unsafe { &mut *(here as *mut [Byte]) };
        stream.memcpy_dtoh(&self.there.slice(..bytes), to)?;
        stream.synchronize()?;
        Ok(&self.here[..count])
    }
}

/// Returns an address on the GPU as a pointer, which the host must not dereference.
pub(super) fn pointer<T>(address: u64) -> *mut T {
    // A GPU has addresses of 64 bits, like any host with a GPU.
    std::ptr::without_provenance_mut(usize::try_from(address).unwrap_or(0))
}

impl OnGpu {
    /// Allocates a cover on the GPU and sends the cells.
    ///
    /// # Safety
    /// Each call of [`Self::update`] must have the same cover, which must outlive this value.
    pub(super) unsafe fn new(
        context: &Arc<CudaContext>,
        kernels: Kernels,
        cover: &Cover,
        program: &Program,
    ) -> Result<Self, DriverError> {
        // The stream has a higher priority than that of the fluid, because the host waits for the forces.
        let stream = &context.new_stream_with_priority(-1)?;
        let (owner, fraction) = cover.cells();
        // SAFETY: the caller ensures that lists of cells are not moved.
        let pinned = unsafe {
            [
                Pinned::new(bytemuck::cast_slice(owner)),
                Pinned::new(bytemuck::cast_slice(fraction)),
            ]
        };
        let [planes, rows, length] = program.cells;
        let cells = planes * rows * length;
        let numbers = stream.alloc_zeros(cells as usize)?;
        let counters = stream.alloc_zeros(size_of::<Counters>() / size_of::<u32>())?;
        let covered = CoveredCells {
            numbers: pointer(numbers.device_ptr(stream).0),
            counters: pointer(counters.device_ptr(stream).0),
            planes,
            rows,
            cells,
        };
        Ok(Self {
            events: CoverEvents::new(context)?,
            kernels,
            _pinned: pinned,
            made_from: MadeFrom::Nothing,
            mapping: Mapping {
                heads: stream.alloc_zeros(fraction.len())?,
                boxes: Buffer::new(stream)?,
                of_blocks: Buffer::new(stream)?,
                edges: Buffer::new(stream)?,
                fractions: Buffer::new(stream)?,
                positions: Buffer::new(stream)?,
                next: Buffer::new(stream)?,
            },
            fractions: [stream.clone_htod(fraction)?, stream.clone_htod(fraction)?],
            now: 0,
            owner: stream.clone_htod(owner)?,
            solids: Buffer::new(stream)?,
            shares: Buffer::new(stream)?,
            parts: Buffer::new(stream)?,
            _numbers: numbers,
            counters,
            motions: u64::MAX,
            in_flight: false,
            loads: Buffer::new(stream)?,
            bodies: 0,
            view: View::NONE,
            covered,
            work: Work::default(),
            stream: stream.clone(),
        })
    }

    /// Sends the bodies and updates the cover of the cells, if they have changed. Does not wait for the GPU.
    pub(super) fn update(
        &mut self,
        cover: &mut Cover,
        program: &Program,
    ) -> Result<(), DriverError> {
        self.view.set_inside(cover.inside());
        let balls = cover.balls();
        let wanted = balls.map_or(MadeFrom::Cells(cover.version()), MadeFrom::Balls);
        if self.motions == cover.motions() && self.made_from == wanted {
            return Ok(());
        }
        let stream = &self.stream.clone();
        if std::mem::replace(&mut self.in_flight, true) {
            stream.synchronize()?;
        }
        let solids = self.solids.send(stream, cover.solids())?;
        self.motions = cover.motions();
        self.view.move_solids(solids);
        if self.made_from != wanted {
            self.now = 1 - self.now;
            stream.wait(&self.events.done[self.now])?;
            stream.memset_zeros(&mut self.counters)?;
            let shares = if balls.is_some() {
                self.map_balls(stream, cover, program, solids)?
            } else {
                self.send_cells(stream, cover)?
            };
            let addresses = [
                self.fractions[self.now].device_ptr(stream).0,
                self.owner.device_ptr(stream).0,
                solids,
                shares,
            ];
            self.view = View::on_gpu(cover, addresses);
            let mut launch = stream.launch_builder(&self.kernels.list_covered);
            let (slab, view) = (Argument(program.passes[0].slab), Argument(self.view));
            let covered = Argument(self.covered);
            launch.arg(&slab).arg(&view).arg(&covered);
            let rows = self.covered.planes * self.covered.rows;
            let shape = launch_of((rows * WARP).div_ceil(BLOCK));
            // SAFETY: the kernel takes these arguments, and its buffer has an element for each cell.
            unsafe { launch.launch(shape) }?;
            self.made_from = wanted;
            self.events.made.record(stream)?;
        }
        Ok(())
    }

    /// Sends the cells of the host, and returns the address of the lists of bodies of shared cells.
    fn send_cells(
        &mut self,
        stream: &Arc<CudaStream>,
        cover: &mut Cover,
    ) -> Result<u64, DriverError> {
        let (owner, fraction) = cover.cells();
        stream.memcpy_htod(fraction, &mut self.fractions[self.now])?;
        stream.memcpy_htod(owner, &mut self.owner)?;
        let Work { parts, shares, .. } = &mut self.work;
        parts.clear();
        parts.extend(cover.shared().flatten().copied());
        let mut at = self.parts.send(stream, parts)?;
        shares.clear();
        shares.extend(cover.shared().map(|of_cell| {
            let here = Shares::words(at, of_cell.len());
            at += size_of_val(of_cell) as u64;
            here
        }));
        self.shares.send(stream, shares)
    }

    /// Maps the balls at the address `solids`, and returns the address of the lists of bodies of shared cells.
    fn map_balls(
        &mut self,
        stream: &Arc<CudaStream>,
        cover: &Cover,
        program: &Program,
        solids: u64,
    ) -> Result<u64, DriverError> {
        let order = cover.order();
        let slab = &program.passes[0].slab;
        let (mut cells, mut strides) = ([0; 3], [0; 3]);
        for (axis, (count, stride)) in order
            .iter()
            .zip(program.cells.iter().zip([slab.plane, slab.row, 1]))
        {
            (cells[*axis], strides[*axis]) = (count.cast_signed(), stride.cast_signed());
        }
        let Work {
            boxes,
            of_blocks,
            sent_of_blocks,
            ..
        } = &mut self.work;
        let edges = BallBox::list_all(cover.solids(), cells, boxes, of_blocks) as usize;
        // This list only changes if bodies are added or removed.
        if of_blocks != sent_of_blocks {
            self.mapping.of_blocks.send(stream, of_blocks)?;
            sent_of_blocks.clone_from(of_blocks);
        }
        let blocks = to_u32(of_blocks.len());
        let cells_of_boxes = of_blocks.len() * BLOCK as usize;
        let shares = self.shares.reserve::<Shares>(stream, cells_of_boxes)?;
        let balls = Balls {
            solids: pointer(solids),
            boxes: pointer(self.mapping.boxes.send(stream, boxes)?),
            of_blocks: pointer(self.mapping.of_blocks.address(stream)),
            edges: pointer(self.mapping.edges.reserve::<f64>(stream, edges)?),
            parts: pointer(
                self.mapping
                    .fractions
                    .reserve::<f32>(stream, cells_of_boxes)?,
            ),
            positions: pointer(
                self.mapping
                    .positions
                    .reserve::<u32>(stream, cells_of_boxes)?,
            ),
            next: pointer(self.mapping.next.reserve::<u32>(stream, cells_of_boxes)?),
            heads: pointer(self.mapping.heads.device_ptr(stream).0),
            fraction: pointer(self.fractions[self.now].device_ptr(stream).0),
            owner: pointer(self.owner.device_ptr(stream).0),
            shares: pointer(self.parts.reserve::<Share>(stream, cells_of_boxes)?),
            shared: pointer(shares),
            counters: pointer(self.counters.device_ptr(stream).0),
            cells_of_boxes: blocks * BLOCK,
            count_of_positions: to_u32(self.fractions[0].len()),
            origin: slab.first[0],
            strides,
            cells,
            order: order.map(to_u32),
        };
        let grids = [
            balls.count_of_positions.div_ceil(BLOCK),
            to_u32(boxes.len()),
            blocks,
            blocks,
        ];
        let balls = Argument(balls);
        for (kernel, blocks) in self.kernels.balls.iter().zip(grids) {
            if blocks > 0 {
                let mut launch = stream.launch_builder(kernel);
                launch.arg(&balls);
                // SAFETY: the kernel takes this argument; the arrays have this capacity.
                unsafe { launch.launch(launch_of(blocks)) }?;
            }
        }
        Ok(shares)
    }

    /// Clears the loads of this number of bodies before a pass.
    pub(super) fn clear_loads(&mut self, bodies: usize) -> Result<(), DriverError> {
        self.bodies = to_u32(bodies);
        let bytes = bodies * BodyLoad::COPIES as usize * size_of::<BodyLoad>();
        self.loads.reserve::<u8>(&self.stream, bytes)?;
        // A driver refuses an empty range.
        if bytes == 0 {
            return Ok(());
        }
        let mut loads = self.loads.there.slice_mut(..bytes);
        self.stream.memset_zeros(&mut loads)
    }

    /// Waits for the loads, and adds them to the sums of the cover.
    pub(super) fn take_loads(&mut self, cover: &mut Cover) -> Result<(), DriverError> {
        let words = self.bodies as usize * BodyLoad::WORDS;
        let copies = BodyLoad::COPIES as usize;
        let received = self.loads.take(&self.stream, copies * words)?;
        self.in_flight = false;
        for slot in 0..self.bodies as usize {
            let mut sums = [0_u64; BodyLoad::WORDS];
            for copy in 0..copies {
                let load = &received[copy * words + slot * BodyLoad::WORDS..];
                for (sum, part) in sums.iter_mut().zip(load) {
                    *sum = sum.wrapping_add(*part);
                }
            }
            if sums.iter().any(|&part| part != 0) {
                let total = BodyLoad::from_parts(&sums).total(&cover.solids()[slot]);
                cover.receive(to_u32(slot), &total);
            }
        }
        Ok(())
    }

    /// Records on a stream that the pass over the open cells no longer reads the current fractions.
    pub(super) fn done(&self, stream: &Arc<CudaStream>) -> Result<(), DriverError> {
        self.events.done[self.now].record(stream)
    }

    /// Returns the address of the current fractions.
    pub(super) fn address_of_fractions(&self) -> u64 {
        self.fractions[self.now].device_ptr(&self.stream).0
    }

    /// Copies current fractions, from a position on, to the host.
    pub(super) fn fractions(&self, first: usize, fractions: &mut [f32]) -> Result<(), DriverError> {
        let there = self.fractions[self.now].slice(first..first + fractions.len());
        self.stream.memcpy_dtoh(&there, fractions)?;
        self.stream.synchronize()
    }
}
