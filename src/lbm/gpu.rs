//! The fluid on a GPU: the pass over the cells, the walls and the periodic axes, with the same operators as on the
//! processor.
//!
//! Velocity sets, operators and the work on a cell are compiled twice from the same files: for the processor and
//! for GPUs (the crate root `src/lbm/kernels.rs`). All operations are rounded in the same way, so that a run has
//! the same bits on both. `gpu/build.sh` compiles the PTX in `gpu/kernels.ptx.gz`, from which the driver generates
//! code for the available GPU at the start of the run. The driver is loaded at that time; without a driver the
//! program runs on the processor.
//!
//! | file | content |
//! |---|---|
//! | `cell` | the pass over one cell in one thread; also compiled for GPUs |
//! | `copies` | populations that enter at walls and cross periodic axes; also compiled for GPUs |
//! | `covered`, `loads`, `sums` | the pass over a covered cell, and the forces on solids; also compiled for GPUs |
//! | `balls` | the cover of the cells by balls; also compiled for GPUs |
//! | `lists` | the lists of the covered cells; also compiled for GPUs |
//! | `warp` | common operations of the threads of a warp; for GPUs only |
//! | `cover` | the cover of the cells on the GPU |
//! | `moments` | the extreme values of rows, for the checks of a run; also compiled for GPUs |
//! | `program` | a step of a slab as passes and copies |
//! | `build.sh`, `kernels.ptx.gz` | the command that compiles the kernels, and its result, which `zcat` shows |
//!
//! The slab remains on the GPU while steps are made and its rows are checked, and is copied back when populations
//! are read. A kernel is included after it has run on a GPU with the same bits as the processor: D3Q27 with BGK,
//! TRT and MRT, and with TRT and MRT partially saturated cells; D3Q19 with TRT; D3Q19 and D2Q9 with BGK in f64
//! without a force. Several ranks, structures, eddy viscosities and openings are not available on a GPU yet
//! ([`Fluid::new`](super::fluid::Fluid::new) refuses them).
//!
//! If all bodies are balls with exact fractions, the GPU computes the cells that they cover, and the processor
//! reads the result on demand. For other bodies the processor computes the cover and sends it.

pub mod balls;
pub mod cell;
pub mod copies;
mod cover;
#[cfg_attr(
    not(test),
    expect(dead_code, reason = "the host runs what a kernel does only to test it")
)]
pub mod covered;
pub mod host;
mod lists;
pub mod loads;
pub mod moments;
pub mod program;

use super::collision::Collision;
use super::error::FluidError;
use super::lanes::Stored;
use super::populations::Parity;
use super::saturation::Cover;
use balls::BLOCK;
use copies::Copies;
use cover::{EXTRA_BYTES, Kernels, OnGpu};
use cudarc::driver::{
    CudaContext, CudaEvent, CudaFunction, CudaSlice, CudaStream, DevicePtr, DeviceRepr,
    DriverError, LaunchConfig, PushKernelArg, sys,
};
use cudarc::nvrtc::Ptx;
use flate2::read::MultiGzDecoder;
use moments::{HalfForce, RowExtremes};
use program::Program;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ffi::c_void;
use std::fmt;
use std::io::Read;
use std::sync::{Arc, LazyLock};
use std::time::Instant;

/// Device that computes the fluid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Device {
    /// Cores of the processor.
    #[default]
    Cpu,
    /// GPU of NVIDIA.
    Gpu,
    /// A GPU if there is one and it can run the scene; otherwise the processor.
    Auto,
}

/// Compressed PTX of the kernels, made by `build.sh`.
const ARCHIVE: &[u8] = include_bytes!("gpu/kernels.ptx.gz");

/// Start of the first line of each text in the archive, before its name.
const TITLE: &str = "// Kernels: ";

/// PTX by name. The archive is read if a case requests a GPU.
static KERNELS: LazyLock<Vec<(String, String)>> = LazyLock::new(|| {
    let mut text = String::new();
    if let Err(error) = MultiGzDecoder::new(ARCHIVE).read_to_string(&mut text) {
        log::error!("the kernels of GPUs cannot be read: {error}");
    }
    let texts = text.split(TITLE).skip(1);
    let named = texts.filter_map(|text| {
        let (name, text) = text.split_once('\n')?;
        Some((name.to_owned(), text.to_owned()))
    });
    named.collect()
});

/// Returns the PTX that contains a kernel.
fn ptx_of(name: &str) -> Option<&'static str> {
    let entry = format!(".entry {name}(");
    let file = KERNELS.iter().find(|(_, text)| text.contains(&entry));
    file.map(|(_, text)| text.as_str())
}

/// Kernels for an operator: its name on GPUs, and the velocity set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Name of the operator: see [`Collision::ON_GPU`]. If solids may cover cells, the name does not include the
    /// force, which is always present.
    pub operator: &'static str,
    /// Name of the velocity set: see [`super::lattice::Lattice::NAME`].
    pub set: &'static str,
    /// `true` if solids may cover cells.
    pub covered: bool,
}

impl Kernel {
    fn name(&self, kind: &str, stored: &str) -> String {
        format!("{kind}{}_{}_{stored}", self.operator, self.set)
    }

    /// Returns `true` if the kernel was compiled for a storage: kernels are added when they have run on a GPU.
    #[must_use]
    pub fn exists(&self, stored: &str) -> bool {
        let kind = if self.covered { "mixed_" } else { "" };
        ptx_of(&self.name(kind, stored)).is_some()
    }
}

/// List of rectangles on the GPU, one for each block.
struct List {
    rectangles: CudaSlice<u8>,
    count: u32,
}

/// Slab on a GPU.
pub struct Gpu {
    stream: Arc<CudaStream>,
    name: String,
    pass: CudaFunction,
    copy: CudaFunction,
    extremes: CudaFunction,
    moments: CudaFunction,
    /// Pinned memory of the populations on the host, for transfers; it is dropped first.
    pinned: Option<Pinned>,
    numbers: CudaSlice<u8>,
    /// Cover of the cells, if they can be covered.
    cover: Option<OnGpu>,
    program: Program,
    /// Copies after the even and the odd pass.
    lists: [Vec<List>; 2],
    /// Velocity factors of the patches: on the GPU, and their current values.
    factors: CudaSlice<f64>,
    held: Vec<f64>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Pinned memory of the host, which the GPU accesses directly at several times the speed.
struct Pinned(*mut c_void);

// SAFETY: an address that is only used to release the memory.
unsafe impl Send for Pinned {}
// SAFETY: as above.
unsafe impl Sync for Pinned {}

impl Pinned {
    /// Pins the memory of a list of numbers; returns `None` if the system does not allow it.
    ///
    /// # Safety
    /// The memory must stay until this is dropped.
    unsafe fn new(bytes: &[u8]) -> Option<Self> {
        let at = bytes.as_ptr().cast_mut().cast();
        // SAFETY: memory of the caller.
        let result = unsafe { sys::cuMemHostRegister_v2(at, bytes.len(), 0) };
        (result == sys::CUresult::CUDA_SUCCESS).then_some(Self(at))
    }
}

impl Drop for Pinned {
    fn drop(&mut self) {
        // SAFETY: the memory was registered by `new`.
        unsafe { sys::cuMemHostUnregister(self.0) };
    }
}

/// Argument of a kernel with the same bytes on the host and on the GPU.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Argument<T>(T);

// SAFETY: arguments are made here from types with `repr(C)` and from numbers only.
unsafe impl<T> DeviceRepr for Argument<T> {}

/// Returns the first GPU, if there is a driver and a GPU.
fn context() -> Result<Arc<CudaContext>, FluidError> {
    // SAFETY: the call only searches for a library.
    if !unsafe { sys::is_culib_present() } {
        return Err(FluidError::NoDriver);
    }
    Ok(CudaContext::new(0)?)
}

/// Returns the name of the first GPU, and the rate in bytes per second, read and written, of a copy within its
/// memory, with which a pass is compared. `bytes` are copied at a time.
///
/// # Errors
/// If there is no GPU, or it fails.
pub fn copy_bandwidth(bytes: usize) -> Result<(String, f64), FluidError> {
    const TURNS: u32 = 10;
    let context = context()?;
    let name = context.name()?;
    let measure = || {
        let stream = context.default_stream();
        let from = stream.alloc_zeros::<u8>(bytes)?;
        let mut to = stream.alloc_zeros::<u8>(bytes)?;
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            stream.synchronize()?;
            let begun = Instant::now();
            for _ in 0..TURNS {
                stream.memcpy_dtod(&from, &mut to)?;
            }
            stream.synchronize()?;
            best = best.min(begun.elapsed().as_secs_f64());
        }
        Ok(f64::from(2 * TURNS) * base::number::real(bytes) / best)
    };
    let measured: Result<f64, DriverError> = measure();
    Ok((name, measured?))
}

/// Extreme values of a row of cells.
#[derive(Clone, Copy, Debug)]
pub struct ExtremesOfRow {
    /// Largest squared speed.
    pub squared_speed: f64,
    /// Largest absolute density deviation.
    pub compression: f64,
    /// `true` if every number is finite.
    pub finite: bool,
}

impl Gpu {
    /// Allocates memory for the numbers of a slab, and for its cover if there is one, and loads the kernels for
    /// this operator and velocity set. `factors` is the number of patches with a velocity factor.
    ///
    /// # Safety
    /// The cover must be that of each later call, and outlive this.
    ///
    /// # Errors
    /// If there is no GPU, or its memory is too small.
    pub unsafe fn new<S: Stored>(
        kernel: &Kernel,
        program: Program,
        numbers: usize,
        cover: Option<&Cover>,
        factors: usize,
    ) -> Result<Self, FluidError> {
        let context = context()?;
        let name = context.name()?;
        let (free, _) = context.mem_get_info()?;
        let (stored, bytes) = (S::NAME, numbers * size_of::<S>());
        let beside = cover.as_ref().map_or(0, |cover| {
            cover.cells().1.len() * (Cover::BYTES + EXTRA_BYTES)
        });
        if bytes + beside > free {
            return Err(FluidError::GpuMemory {
                name,
                needed: giga(bytes + beside),
                free: giga(free),
            });
        }
        let function = |name: &str| {
            let text = ptx_of(name).unwrap_or_default();
            let module = context.load_module(Ptx::from_src(text))?;
            module.load_function(name)
        };
        let set = kernel.set;
        let pass = function(&kernel.name(if cover.is_some() { "open_" } else { "" }, stored));
        let pass = pass?;
        let copy = function(&format!("copies_{stored}"))?;
        let extremes = function(&format!("extremes_{set}_{stored}"))?;
        let moments = function(&format!("moments_{set}_{stored}"))?;
        // SAFETY: all work is on streams that wait for each other by the events below, and is complete before any
        // memory is released.
        unsafe { context.disable_event_tracking() };
        let stream = context.new_stream()?;
        let cover = cover.map(|cover| {
            let names = ["deep_", "mixed_"].map(|kind| kernel.name(kind, stored));
            let kernels = Kernels::new(names, function)?;
            // SAFETY: promised by the caller.
            unsafe { OnGpu::new(&context, kernels, cover, &program) }
        });
        let cover = cover.transpose()?;
        let list = |copies: &Vec<Copies>| {
            let pieces: Vec<Copies> = copies.iter().flat_map(|all| all.pieces(BLOCK)).collect();
            Ok(List {
                rectangles: stream.clone_htod(as_bytes(&pieces))?,
                count: base::number::to_u32(pieces.len()),
            })
        };
        let lists = |pass: &program::Pass| pass.copies.iter().map(list).collect();
        let [even, odd] = &program.passes;
        let lists: [Result<Vec<List>, DriverError>; 2] = [lists(even), lists(odd)];
        let [even, odd] = lists;
        let held = vec![f64::NAN; factors.max(1)];
        // SAFETY: the memory is written by `give` before it is read.
        let room = unsafe { stream.alloc::<u8>(bytes) }?;
        log::info!("the fluid runs on the GPU {name}: {kernel:?}, {bytes} bytes");
        Ok(Self {
            name,
            pass,
            copy,
            extremes,
            moments,
            pinned: None,
            cover,
            numbers: room,
            lists: [even?, odd?],
            factors: stream.clone_htod(&held)?,
            stream,
            program,
            held,
        })
    }

    /// Sends the numbers of the slab to the GPU.
    ///
    /// # Safety
    /// These must be the same numbers in each call, and outlive the GPU.
    ///
    /// # Errors
    /// If the GPU fails.
    pub unsafe fn give<S: Stored>(&mut self, numbers: &[S]) -> Result<(), FluidError> {
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        if self.pinned.is_none() {
            // SAFETY: promised by the caller.
            self.pinned = unsafe { Pinned::new(bytes) };
            log::debug!("transfers to the GPU by itself: {}", self.pinned.is_some());
        }
        self.stream.memcpy_htod(bytes, &mut self.numbers)?;
        self.record(|there| &there.events.ready)
    }

    /// Records on the stream of the bodies that the fluid has reached an event.
    fn record(&self, so_far: impl Fn(&OnGpu) -> &CudaEvent) -> Result<(), FluidError> {
        match &self.cover {
            Some(there) => so_far(there).record(&self.stream).map_err(FluidError::from),
            None => Ok(()),
        }
    }

    /// Makes further work of the fluid wait until the stream of the bodies has reached an event.
    fn wait_for(&self, so_far: impl Fn(&OnGpu) -> &CudaEvent) -> Result<(), FluidError> {
        match &self.cover {
            Some(there) => self.stream.wait(so_far(there)).map_err(FluidError::from),
            None => Ok(()),
        }
    }

    /// Copies the numbers of the slab back to the host.
    ///
    /// # Errors
    /// If the GPU fails, also in a step before.
    pub fn take<S: Stored>(&self, numbers: &mut [S]) -> Result<(), FluidError> {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(numbers);
        self.stream
            .memcpy_dtoh(&self.numbers, bytes)
            .and_then(|()| self.stream.synchronize())
            .map_err(FluidError::from)
    }

    /// Returns the extreme values of the rows of populations of a parity, in the order of the rows. `half` is F/2.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn extremes(
        &self,
        parity: Parity,
        half: [f64; 3],
    ) -> Result<Vec<ExtremesOfRow>, FluidError> {
        let [planes, rows, _] = self.program.cells;
        let slab = Argument(self.program.after(parity).slab);
        let half = Argument(HalfForce(half));
        let count = (planes * rows) as usize;
        let words = size_of::<RowExtremes>() / size_of::<u64>();
        let found = self.stream.alloc_zeros::<u64>(count * words);
        let found = found?;
        self.wait_for(|there| &there.events.made)?;
        let fraction = self.cover.as_ref().map_or(0, OnGpu::address_of_fractions);
        let mut launch = self.stream.launch_builder(&self.extremes);
        launch
            .arg(&self.numbers)
            .arg(&slab)
            .arg(&half)
            .arg(&fraction)
            .arg(&found);
        // SAFETY: the kernel takes these arguments and writes one element for each row.
        unsafe { launch.launch(self.program.launch()) }?;
        let found = self.stream.clone_dtoh(&found)?;
        self.stream.synchronize()?;
        let rows = found.chunks_exact(words);
        Ok(rows
            .map(|row| ExtremesOfRow {
                squared_speed: f64::from_bits(row[0]),
                compression: f64::from_bits(row[1]),
                finite: row[2] == 0,
            })
            .collect())
    }

    /// Computes the density deviation and momentum of the cells of a row, for populations of a parity.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn row_moments(
        &self,
        parity: Parity,
        [plane, row]: [u32; 2],
        moments: &mut [Vec<f64>; 4],
    ) -> Result<(), FluidError> {
        let slab = Argument(self.program.after(parity).slab);
        let length = slab.0.cells as usize;
        let found = self.stream.alloc_zeros::<f64>(4 * length);
        let found = found?;
        let mut shape = self.program.launch();
        (shape.grid_dim.1, shape.grid_dim.2) = (1, 1);
        let mut launch = self.stream.launch_builder(&self.moments);
        launch
            .arg(&self.numbers)
            .arg(&slab)
            .arg(&plane)
            .arg(&row)
            .arg(&found);
        // SAFETY: the kernel takes these arguments and writes four numbers for each cell of the row.
        unsafe { launch.launch(shape) }?;
        let found = self.stream.clone_dtoh(&found)?;
        self.stream.synchronize()?;
        for (moments, found) in moments.iter_mut().zip(found.chunks_exact(length)) {
            moments.clear();
            moments.extend_from_slice(found);
        }
        Ok(())
    }

    /// Waits until all work of the GPU is complete.
    ///
    /// # Errors
    /// If it failed.
    pub fn wait(&self) -> Result<(), FluidError> {
        self.stream.synchronize().map_err(FluidError::from)
    }

    /// Starts the pass over all cells after populations of a parity; `viscosity` is that of the fluid in lattice
    /// units.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn pass<C: Collision>(
        &mut self,
        before: Parity,
        operator: C,
        viscosity: f64,
    ) -> Result<(), FluidError> {
        let slab = Argument(self.program.after(before).slab);
        let rates = Argument(operator.uniform::<f64>());
        let operator = Argument(operator);
        let shape = self.program.launch();
        let numbers = self.numbers.device_ptr(&self.stream).0;
        let Some(cover) = &self.cover else {
            let mut launch = self.stream.launch_builder(&self.pass);
            launch.arg(&numbers).arg(&slab).arg(&operator).arg(&rates);
            // SAFETY: the kernel takes these arguments; the program is that of the slab for which the memory was
            // allocated.
            return unsafe { launch.launch(shape) }
                .map(|_| ())
                .map_err(FluidError::from);
        };
        // The covered cells come first.
        let beside = &cover.stream;
        beside.wait(&cover.events.ready)?;
        let view = Argument(cover.view);
        let omega = 1.0 / 3.0_f64.mul_add(viscosity, 0.5);
        let (cells, loads) = (Argument(cover.covered), cover.loads.address(beside));
        let bodies = cover.bodies;
        // There are as many threads as cells, because only the GPU knows the number of covered cells; the other
        // threads do nothing.
        let of_all = launch_of(cover.covered.cells.div_ceil(BLOCK));
        let mut launch = beside.launch_builder(&cover.kernels.mixed);
        launch
            .arg(&numbers)
            .arg(&slab)
            .arg(&operator)
            .arg(&rates)
            .arg(&view)
            .arg(&omega)
            .arg(&cells)
            .arg(&loads)
            .arg(&bodies);
        // SAFETY: as above.
        unsafe { launch.launch(of_all) }?;
        let mut launch = beside.launch_builder(&cover.kernels.deep);
        launch
            .arg(&numbers)
            .arg(&slab)
            .arg(&view)
            .arg(&cells)
            .arg(&loads)
            .arg(&bodies);
        // SAFETY: as above.
        unsafe { launch.launch(of_all) }?;
        cover.events.passed.record(beside)?;
        self.wait_for(|there| &there.events.made)?;
        let mut launch = self.stream.launch_builder(&self.pass);
        launch
            .arg(&numbers)
            .arg(&slab)
            .arg(&operator)
            .arg(&rates)
            .arg(&view);
        // SAFETY: as above.
        unsafe { launch.launch(shape) }?;
        cover.done(&self.stream).map_err(FluidError::from)
    }

    /// Sends the cover of the cells to the GPU, before a pass or a check of the cells.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn send_cover(&mut self, cover: &mut Cover) -> Result<(), FluidError> {
        match &mut self.cover {
            Some(there) => {
                let done = there.update(cover, &self.program);
                done.map_err(FluidError::from)
            }
            None => Ok(()),
        }
    }

    /// Clears the forces on the bodies of the cover, before a pass.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn clear_loads(&mut self, cover: &Cover) -> Result<(), FluidError> {
        match &mut self.cover {
            Some(there) => {
                let cleared = there.clear_loads(cover.solids().len());
                cleared.map_err(FluidError::from)
            }
            None => Ok(()),
        }
    }

    /// Reads the fractions of the cells of a row in the last cover, from a position on.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn fractions(&self, first: usize, fractions: &mut [f32]) -> Result<(), FluidError> {
        match &self.cover {
            Some(there) => there.fractions(first, fractions).map_err(FluidError::from),
            None => Ok(()),
        }
    }

    /// Waits for the forces of a pass, but not for the open cells, and adds them to the sums of the cover.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn take_loads(&mut self, cover: &mut Cover) -> Result<(), FluidError> {
        match &mut self.cover {
            Some(there) => there.take_loads(cover).map_err(FluidError::from),
            None => Ok(()),
        }
    }

    /// Starts the copies after the pass that follows populations of a parity; `factor` is the velocity factor of a
    /// patch.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn copy(
        &mut self,
        before: Parity,
        factor: impl Fn(usize) -> f64,
    ) -> Result<(), FluidError> {
        let mut same = true;
        for (patch, held) in self.held.iter_mut().enumerate() {
            let now = factor(patch);
            same &= held.to_bits() == now.to_bits();
            *held = now;
        }
        if !same {
            self.stream.memcpy_htod(&self.held, &mut self.factors)?;
        }
        self.wait_for(|there| &there.events.passed)?;
        for list in &self.lists[usize::from(before == Parity::Reversed)] {
            let shape = LaunchConfig {
                grid_dim: (list.count, 1, 1),
                block_dim: (BLOCK, 1, 1),
                shared_mem_bytes: 0,
            };
            let mut launch = self.stream.launch_builder(&self.copy);
            launch
                .arg(&mut self.numbers)
                .arg(&list.rectangles)
                .arg(&self.factors);
            // SAFETY: as above; the rectangles are within the slab.
            unsafe { launch.launch(shape) }?;
        }
        self.record(|there| &there.events.ready)
    }
}

impl Drop for Gpu {
    /// Waits for the end of all work before memory is released.
    fn drop(&mut self) {
        let streams = [
            Some(&self.stream),
            self.cover.as_ref().map(|there| &there.stream),
        ];
        for stream in streams.into_iter().flatten() {
            if let Err(error) = stream.synchronize() {
                log::debug!("at the end of the fluid {}", FluidError::Gpu(error));
            }
        }
    }
}

/// Returns the launch configuration with this number of blocks.
fn launch_of(count: u32) -> LaunchConfig {
    LaunchConfig {
        grid_dim: (count, 1, 1),
        block_dim: (BLOCK, 1, 1),
        shared_mem_bytes: 0,
    }
}

impl Program {
    /// Returns the shape of a launch with one thread for each cell.
    fn launch(&self) -> LaunchConfig {
        let [planes, rows, length] = self.cells;
        let width = length.next_multiple_of(32).min(BLOCK);
        LaunchConfig {
            grid_dim: (length.div_ceil(width), rows, planes),
            block_dim: (width, 1, 1),
            shared_mem_bytes: 0,
        }
    }
}

/// Returns rectangles as the bytes that the GPU reads.
fn as_bytes(copies: &[Copies]) -> &[u8] {
    // SAFETY: the types consist of numbers with `repr(C)` without padding.
    unsafe { std::slice::from_raw_parts(copies.as_ptr().cast(), size_of_val(copies)) }
}

/// Converts bytes to gigabytes (10⁹ bytes).
fn giga(bytes: usize) -> f64 {
    base::number::real(bytes) * 1e-9
}

#[cfg(test)]
mod tests;
