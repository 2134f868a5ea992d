//! The kernels that run on GPUs: the root of a crate of its own for the target `nvptx64-nvidia-cuda`, made of files of
//! the models.
//!
//! Velocity sets, operators and the pass over a cell are the very files that the processor runs; only the functions
//! below, each a kernel by name, are of the GPU alone. `gpu/build.sh` compiles this root to PTX, which
//! `gpu/kernels.ptx.gz` keeps and the host loads (the module `gpu`). All operations are rounded as on the processor,
//! none are fused that the source does not fuse, so that the bits are the same.

#![no_std]
#![allow(
    internal_features,
    reason = "square roots of the core library are not stable yet"
)]
#![feature(
    abi_ptx,
    stdarch_nvptx,
    asm_experimental_arch,
    core_float_math,
    core_intrinsics
)]
#![allow(
    dead_code,
    private_interfaces,
    unused_imports,
    unused_macros,
    reason = "the files of the models hold more than a GPU needs"
)]

// The files name the package below theirs, whose parts that a GPU needs are modules here.
extern crate self as base;

#[path = "../base/ball.rs"]
pub(crate) mod ball;
#[path = "../base/number.rs"]
pub(crate) mod number;

pub(crate) mod lanes;
pub(crate) mod lattice;
pub(crate) mod quanta;
pub(crate) mod rigid;
pub(crate) mod saturation;

pub(crate) mod collision {
    pub(crate) mod kernel;
    pub(crate) mod products;
    pub(crate) mod second_order;

    pub(crate) use kernel::{Collision, Site, along};

    pub(crate) mod bgk {
        pub(crate) mod kernel;
    }
    pub(crate) mod mrt {
        pub(crate) mod kernel;
    }
    pub(crate) mod trt {
        pub(crate) mod kernel;
        pub(crate) use kernel::AntisymmetricRate;
    }
}

pub(crate) mod gpu {
    pub(crate) mod balls;
    pub(crate) mod cell;
    pub(crate) mod copies;
    pub(crate) mod covered;
    pub(crate) mod lists;
    pub(crate) mod loads;
    pub(crate) mod moments;
    pub(crate) mod sums;
    pub(crate) mod warp;
}

use collision::bgk::kernel::Bgk;
use collision::kernel::Collision;
use collision::mrt::kernel::Mrt;
use collision::second_order::SecondOrder;
use collision::trt::kernel::Trt;
use core::arch::nvptx::{
    _block_dim_x, _block_idx_x, _block_idx_y, _block_idx_z, _grid_dim_y, _thread_idx_x,
};
use gpu::balls::{Balls, WARP};
use gpu::cell::{self, Place, Slab};
use gpu::copies::Copies;
use gpu::covered;
use gpu::lists::CoveredCells;
use gpu::loads::BodyLoad;
use gpu::moments::{self, HalfForce, RowExtremes};
use gpu::sums::Sums;
use lattice::{D2Q9, D3Q19, D3Q27, Lattice};
use saturation::pass::View;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// This thread's number along the first axis of the grid.
#[inline(always)]
fn thread() -> u32 {
    // SAFETY: registers of the thread.
    unsafe { _block_idx_x() * _block_dim_x() + _thread_idx_x() }
}

/// Kernels of one velocity set, operator and storage: one thread for each cell, rows and planes along the other axes of
/// the grid.
macro_rules! passes {
    ($($name:ident: $lattice:ty, $q:literal, $operator:ty, $stored:ty, $again:literal;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $name(
                numbers: *mut $stored,
                slab: Slab,
                operator: $operator,
                rates: <$operator as Collision>::Rates<f64>,
            ) {
                let place = thread();
                if place < slab.cells {
                    let place = Place {
                        // SAFETY: registers of the thread.
                        plane: unsafe { _block_idx_z() },
                        // SAFETY: registers of the thread.
                        row: unsafe { _block_idx_y() },
                        place,
                    };
                    // SAFETY: the host starts one thread for each cell.
                    unsafe {
                        cell::collide::<$lattice, _, _, $again, $q>(numbers, &slab, place, &operator, &rates);
                    }
                }
            }
        )*
    };
}

#[cfg(kernels = "bgk")]
passes! {
    bgk_d3q27_f64: D3Q27, 27, Bgk<false>, f64, true;
    bgk_d3q27_f32: D3Q27, 27, Bgk<false>, f32, false;
    forced_bgk_d3q27_f64: D3Q27, 27, Bgk<true>, f64, true;
    forced_bgk_d3q27_f32: D3Q27, 27, Bgk<true>, f32, true;
    bgk_d3q19_f64: D3Q19, 19, Bgk<false>, f64, true;
    bgk_d2q9_f64: D2Q9, 9, Bgk<false>, f64, true;
}

#[cfg(kernels = "trt")]
passes! {
    trt_d3q27_f64: D3Q27, 27, Trt<false>, f64, false;
    trt_d3q27_f32: D3Q27, 27, Trt<false>, f32, false;
    forced_trt_d3q27_f64: D3Q27, 27, Trt<true>, f64, false;
    forced_trt_d3q27_f32: D3Q27, 27, Trt<true>, f32, false;
    trt_d3q19_f64: D3Q19, 19, Trt<false>, f64, false;
    trt_d3q19_f32: D3Q19, 19, Trt<false>, f32, false;
    forced_trt_d3q19_f64: D3Q19, 19, Trt<true>, f64, false;
    forced_trt_d3q19_f32: D3Q19, 19, Trt<true>, f32, false;
}

#[cfg(kernels = "mrt")]
passes! {
    mrt_d3q27_f64: D3Q27, 27, Mrt<false>, f64, false;
    mrt_d3q27_f32: D3Q27, 27, Mrt<false>, f32, false;
    forced_mrt_d3q27_f64: D3Q27, 27, Mrt<true>, f64, false;
    forced_mrt_d3q27_f32: D3Q27, 27, Mrt<true>, f32, false;
    second_order_d3q27_f64: D3Q27, 27, SecondOrder<false>, f64, false;
    second_order_d3q27_f32: D3Q27, 27, SecondOrder<false>, f32, false;
    forced_second_order_d3q27_f64: D3Q27, 27, SecondOrder<true>, f64, false;
    forced_second_order_d3q27_f32: D3Q27, 27, SecondOrder<true>, f32, false;
}

/// Cell of a number in a list of covered cells.
#[inline(always)]
fn place_of(number: u32, slab: &Slab, cells: &CoveredCells) -> Place {
    // Never zero: without this the divisions could panic, for which a GPU has no function.
    let (length, rows) = (slab.cells.max(1), cells.rows.max(1));
    Place {
        plane: number / length / rows,
        row: number / length % rows,
        place: number % length,
    }
}

/// Kernels of one velocity set, operator and storage where solids may cover cells: a thread for each open cell, for
/// each that is deep inside bodies, and for each other one.
macro_rules! covers {
    ($($open:ident $deep:ident $mixed:ident: $lattice:ty, $q:literal, $operator:ty, $stored:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $open(
                numbers: *mut $stored,
                slab: Slab,
                operator: $operator,
                rates: <$operator as Collision>::Rates<f64>,
                view: View,
            ) {
                let place = thread();
                if place < slab.cells {
                    // SAFETY: registers of the thread.
                    let [plane, row] = unsafe { [_block_idx_z(), _block_idx_y()] };
                    let at = Place { plane, row, place };
                    // SAFETY: the host starts one thread for each cell.
                    unsafe {
                        covered::collide_open::<$lattice, _, _, $q>(numbers, &slab, at, (&operator, &rates), &view);
                    }
                }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $deep(
                numbers: *mut $stored,
                slab: Slab,
                view: View,
                cells: CoveredCells,
                loads: *const BodyLoad,
                bodies: u32,
            ) {
                let mut sums = Sums::new(loads, view.solids(), bodies, thread() / WARP);
                // SAFETY: the host starts one thread for each cell, and has a sum for each body. No thread returns
                // before the others.
                unsafe {
                    if let Some(number) = cells.get(thread(), true) {
                        let at = place_of(number, &slab, &cells);
                        covered::fill::<$lattice, _, $q>(numbers, &slab, at, (&view, &raw mut sums));
                    }
                    sums.finish::<{ <$lattice>::DIMENSION }>();
                }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $mixed(
                numbers: *mut $stored,
                slab: Slab,
                operator: $operator,
                rates: <$operator as Collision>::Rates<f64>,
                view: View,
                omega: f64,
                cells: CoveredCells,
                loads: *const BodyLoad,
                bodies: u32,
            ) {
                let mut sums = Sums::new(loads, view.solids(), bodies, thread() / WARP);
                // SAFETY: as above.
                unsafe {
                    if let Some(number) = cells.get(thread(), false) {
                        let at = place_of(number, &slab, &cells);
                        covered::mix::<$lattice, _, _, $q>(
                            numbers, &slab, at, (&operator, &rates), (&view, &raw mut sums, omega),
                        );
                    }
                    sums.finish::<{ <$lattice>::DIMENSION }>();
                }
            }
        )*
    };
}

#[cfg(kernels = "covers_mrt_d3q27")]
covers! {
    open_mrt_d3q27_f64 deep_mrt_d3q27_f64 mixed_mrt_d3q27_f64: D3Q27, 27, Mrt<true>, f64;
    open_mrt_d3q27_f32 deep_mrt_d3q27_f32 mixed_mrt_d3q27_f32: D3Q27, 27, Mrt<true>, f32;
}

/// The covered cells in lists: one warp for each row.
#[cfg(kernels = "balls")]
#[unsafe(no_mangle)]
pub unsafe extern "ptx-kernel" fn list_covered(slab: Slab, view: View, cells: CoveredCells) {
    // The same for all threads of a warp.
    let row = thread() / WARP;
    if row < cells.rows * cells.planes {
        let kind = |place: u32| {
            let at = Place {
                plane: row / cells.rows.max(1),
                row: row % cells.rows.max(1),
                place,
            };
            // SAFETY: a cell of the slab.
            unsafe { covered::kind(&slab, at, &view) }
        };
        // SAFETY: the host starts whole warps, one for each row.
        unsafe { cells.add_row(row * slab.cells, slab.cells, kind) };
    }
}

#[cfg(kernels = "covers_trt_d3q27")]
covers! {
    open_trt_d3q27_f64 deep_trt_d3q27_f64 mixed_trt_d3q27_f64: D3Q27, 27, Trt<true>, f64;
    open_trt_d3q27_f32 deep_trt_d3q27_f32 mixed_trt_d3q27_f32: D3Q27, 27, Trt<true>, f32;
}

/// Kernels of the cover by balls.
macro_rules! balls {
    ($($name:ident: $work:ident;)*) => {
        $(
            #[cfg(kernels = "balls")]
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $name(balls: Balls) {
                // SAFETY: the host starts as many threads as there is work, with the arrays as described.
                unsafe { balls.$work(thread()) };
            }
        )*
    };
}

/// A block for each box.
#[cfg(kernels = "balls")]
#[unsafe(no_mangle)]
pub unsafe extern "ptx-kernel" fn ball_edges(balls: Balls) {
    // SAFETY: as above.
    unsafe { balls.edge(_block_idx_x(), _thread_idx_x()) };
}

balls! {
    ball_clear: clear;
    ball_cover: cover;
    ball_settle: settle;
}

/// Kernels of one velocity set and storage: the extreme values of all rows, one thread for each cell, and the moments
/// of one row.
macro_rules! looks {
    ($($extremes:ident $row_moments:ident: $lattice:ty, $q:literal, $stored:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $extremes(
                numbers: *const $stored,
                slab: Slab,
                half: HalfForce,
                fraction: *const f32,
                rows: *const RowExtremes,
            ) {
                let place = thread();
                if place < slab.cells {
                    // SAFETY: registers of the thread.
                    let [plane, row, of_plane] = unsafe { [_block_idx_z(), _block_idx_y(), _grid_dim_y()] };
                    let at = Place { plane, row, place };
                    // SAFETY: the host starts one thread for each cell, and has an entry for each row.
                    unsafe {
                        let (drho, m) = moments::moments::<$lattice, $stored, $q>(numbers, &slab, at);
                        let water = fraction.is_null() || fraction.add(covered::position(&slab, at)).read() < 0.5;
                        (*rows.add((plane * of_plane + row) as usize)).note(drho, m, half, water);
                    }
                }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $row_moments(
                numbers: *const $stored,
                slab: Slab,
                plane: u32,
                row: u32,
                found: *mut f64,
            ) {
                let place = thread();
                if place < slab.cells {
                    let at = Place { plane, row, place };
                    // SAFETY: the host starts one thread for each cell of a row of the slab, and has memory for four
                    // numbers of each.
                    unsafe {
                        let (drho, m) = moments::moments::<$lattice, $stored, $q>(numbers, &slab, at);
                        found.add(place as usize).write(drho);
                        found.add((slab.cells + place) as usize).write(m[0]);
                        found.add((2 * slab.cells + place) as usize).write(m[1]);
                        found.add((3 * slab.cells + place) as usize).write(m[2]);
                    }
                }
            }
        )*
    };
}

#[cfg(kernels = "looks")]
looks! {
    extremes_d3q27_f64 moments_d3q27_f64: D3Q27, 27, f64;
    extremes_d3q27_f32 moments_d3q27_f32: D3Q27, 27, f32;
    extremes_d3q19_f64 moments_d3q19_f64: D3Q19, 19, f64;
    extremes_d3q19_f32 moments_d3q19_f32: D3Q19, 19, f32;
    extremes_d2q9_f64 moments_d2q9_f64: D2Q9, 9, f64;
}

/// Kernels of one storage: a block of the grid for each rectangle, a thread for each of its copies.
macro_rules! copies {
    ($($name:ident: $stored:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $name(
                numbers: *mut $stored,
                rectangles: *const Copies,
                factors: *const f64,
            ) {
                // SAFETY: registers of the thread.
                let [block, n] = unsafe { [_block_idx_x(), _thread_idx_x()] };
                // SAFETY: the host starts a block for each rectangle, and each names one of the factors; one thread has
                // this number.
                unsafe {
                    let copies = rectangles.add(block as usize).read();
                    let factor = factors.add(copies.factor as usize).read();
                    if n < copies.count() {
                        copies.copy(n, factor, numbers);
                    }
                }
            }
        )*
    };
}

#[cfg(kernels = "copies")]
copies! {
    copies_f64: f64;
    copies_f32: f32;
}
