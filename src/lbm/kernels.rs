//! GPU kernels: the root of a separate crate for the target `nvptx64-nvidia-cuda`.
//!
//! It is a separate crate because `gpu/build.sh` compiles it to PTX, which is stored in `gpu/kernels.ptx.gz` and loaded
//! by the host (the module `gpu`). Velocity sets, operators and the pass over a cell are the source files that are also
//! compiled for the processor; only the entry points below exist on GPUs alone. All operations are rounded as on the
//! processor, and only those are fused that the source fuses, so that the bits are the same.

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

// The files import from the package `base`; the parts of it that a GPU needs are modules of this crate.
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
use gpu::cell::{self, CellIndex, Slab};
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

/// Returns the index of this thread along the x axis of the grid.
#[inline(always)]
fn thread() -> u32 {
    // SAFETY: registers of the thread.
    unsafe { _block_idx_x() * _block_dim_x() + _thread_idx_x() }
}

/// Defines the passes for a velocity set, operator and storage type. There is one thread for each cell: the x axis of
/// the grid runs along a row, y over the rows of a plane, and z over the planes.
macro_rules! passes {
    ($($name:ident: $lattice:ty, $q:literal, $operator:ty, $stored:ty, $recompute:literal;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $name(
                numbers: *mut $stored,
                slab: Slab,
                operator: $operator,
                rates: <$operator as Collision>::Rates<f64>,
            ) {
                let column = thread();
                if column < slab.cells {
                    let cell = CellIndex {
                        // SAFETY: registers of the thread.
                        plane: unsafe { _block_idx_z() },
                        // SAFETY: registers of the thread.
                        row: unsafe { _block_idx_y() },
                        column,
                    };
                    // SAFETY: the host starts one thread for each cell.
                    unsafe {
                        cell::collide::<$lattice, _, _, $recompute, $q>(numbers, &slab, cell, &operator, &rates);
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

/// Returns the cell that has a number in the list of covered cells.
#[inline(always)]
fn cell_of(number: u32, slab: &Slab, cells: &CoveredCells) -> CellIndex {
    // A divisor of at least 1 keeps the compiler from adding a panic for division by zero, which GPUs cannot link.
    let (length, rows) = (slab.cells.max(1), cells.rows.max(1));
    CellIndex {
        plane: number / length / rows,
        row: number / length % rows,
        column: number % length,
    }
}

/// Defines the passes for a velocity set, operator and storage type if solids may cover cells. The first kernel updates
/// the open cells, the second those deep inside bodies, the third the other covered cells; one thread updates one cell.
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
                let column = thread();
                if column < slab.cells {
                    // SAFETY: registers of the thread.
                    let [plane, row] = unsafe { [_block_idx_z(), _block_idx_y()] };
                    let at = CellIndex { plane, row, column };
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
                // SAFETY: the host starts one thread for each cell, and allocates a sum for each body. No thread of a
                // warp returns before `finish`.
                unsafe {
                    if let Some(number) = cells.get(thread(), true) {
                        let at = cell_of(number, &slab, &cells);
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
                // SAFETY: as for the kernel above.
                unsafe {
                    if let Some(number) = cells.get(thread(), false) {
                        let at = cell_of(number, &slab, &cells);
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

/// Lists the covered cells, with one warp for each row.
#[cfg(kernels = "balls")]
#[unsafe(no_mangle)]
pub unsafe extern "ptx-kernel" fn list_covered(slab: Slab, view: View, cells: CoveredCells) {
    // All threads of a warp have the same row.
    let row = thread() / WARP;
    if row < cells.rows * cells.planes {
        let kind = |column: u32| {
            let at = CellIndex {
                plane: row / cells.rows.max(1),
                row: row % cells.rows.max(1),
                column,
            };
            // SAFETY: the cell is one of the slab.
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

/// Defines the kernels that map balls, with one thread for each item of work.
macro_rules! balls {
    ($($name:ident: $work:ident;)*) => {
        $(
            #[cfg(kernels = "balls")]
            #[unsafe(no_mangle)]
            pub unsafe extern "ptx-kernel" fn $name(balls: Balls) {
                // SAFETY: the host starts at least one thread for each item, with arrays as described in `Balls`.
                unsafe { balls.$work(thread()) };
            }
        )*
    };
}

/// Computes the edges of the boxes, with one block for each box.
#[cfg(kernels = "balls")]
#[unsafe(no_mangle)]
pub unsafe extern "ptx-kernel" fn ball_edges(balls: Balls) {
    // SAFETY: the host starts one block for each box, with arrays as described in `Balls`.
    unsafe { balls.edge(_block_idx_x(), _thread_idx_x()) };
}

balls! {
    ball_clear: clear;
    ball_cover: cover;
    ball_settle: settle;
}

/// Defines the kernels that check cells, for a velocity set and storage type: the extreme values of all rows, and the
/// moments of the cells of one row; one thread reads one cell.
macro_rules! checks {
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
                let column = thread();
                if column < slab.cells {
                    // SAFETY: registers of the thread.
                    let [plane, row, rows_of_plane] = unsafe { [_block_idx_z(), _block_idx_y(), _grid_dim_y()] };
                    let at = CellIndex { plane, row, column };
                    // SAFETY: the host starts one thread for each cell, and allocates an entry for each row.
                    unsafe {
                        let (drho, m) = moments::moments::<$lattice, $stored, $q>(numbers, &slab, at);
                        let water = fraction.is_null() || fraction.add(covered::position(&slab, at)).read() < 0.5;
                        (*rows.add((plane * rows_of_plane + row) as usize)).include(drho, m, half, water);
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
                let column = thread();
                if column < slab.cells {
                    let at = CellIndex { plane, row, column };
                    // SAFETY: the host starts one thread for each cell of a row of the slab, and allocates four
                    // numbers for each.
                    unsafe {
                        let (drho, m) = moments::moments::<$lattice, $stored, $q>(numbers, &slab, at);
                        found.add(column as usize).write(drho);
                        found.add((slab.cells + column) as usize).write(m[0]);
                        found.add((2 * slab.cells + column) as usize).write(m[1]);
                        found.add((3 * slab.cells + column) as usize).write(m[2]);
                    }
                }
            }
        )*
    };
}

#[cfg(kernels = "checks")]
checks! {
    extremes_d3q27_f64 moments_d3q27_f64: D3Q27, 27, f64;
    extremes_d3q27_f32 moments_d3q27_f32: D3Q27, 27, f32;
    extremes_d3q19_f64 moments_d3q19_f64: D3Q19, 19, f64;
    extremes_d3q19_f32 moments_d3q19_f32: D3Q19, 19, f32;
    extremes_d2q9_f64 moments_d2q9_f64: D2Q9, 9, f64;
}

/// Defines the kernel that copies numbers, for a storage type: one block for each rectangle, one thread for each copy.
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
                // SAFETY: the host starts one block for each rectangle, whose factor is one of `factors`; no other
                // thread makes this copy.
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
