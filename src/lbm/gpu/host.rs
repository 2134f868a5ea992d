//! Cover of the cells by balls, computed by the functions of the GPU kernels on the host.
//!
//! It is separate from the kernels because only tests use it: the kernels are compared with the cover of the processor
//! without a GPU. The threads of a launch run one after the other, from the last to the first.

use super::balls::{BLOCK, BallBox, Balls, Counters};
use crate::saturation::solid::{CoveringBody, NONE, Share, Shares};
use base::number::to_u32;
use core::sync::atomic::{AtomicU32, Ordering};

/// Cells that bodies cover.
#[derive(Clone, Debug, Default)]
pub struct CoveredPositions {
    /// Owner of each position.
    pub owner: Vec<u32>,
    /// Solid fraction of each position.
    pub fraction: Vec<f32>,
    /// Bodies with their fractions in each cell that several bodies cover.
    pub shared: Vec<Vec<Share>>,
}

/// Positions of the cells of a slab.
#[derive(Clone, Copy, Debug)]
pub struct SlabPositions {
    /// Position of the first cell.
    pub origin: u32,
    /// Distances in positions between neighbours along each axis.
    pub strides: [i32; 3],
    /// Number of cells along each axis.
    pub cells: [i32; 3],
    /// Axes from slowest to fastest.
    pub order: [u32; 3],
}

/// Returns the covered cells as a GPU computes them.
///
/// On entry, the owners of `before` mark the cells behind walls.
#[must_use]
pub fn cover(
    solids: &[CoveringBody],
    before: CoveredPositions,
    slab: &SlabPositions,
) -> CoveredPositions {
    let CoveredPositions {
        mut owner,
        mut fraction,
        ..
    } = before;
    let SlabPositions {
        origin,
        strides,
        cells,
        order,
    } = *slab;
    let (mut boxes, mut of_blocks) = (Vec::new(), Vec::new());
    let count_of_edges = BallBox::list_all(solids, cells, &mut boxes, &mut of_blocks);
    let most = of_blocks.len() * BLOCK as usize;
    let none = Share {
        slot: NONE,
        fraction: 0.0,
    };
    let mut edges = vec![0.0; count_of_edges as usize];
    let (mut parts, mut positions, mut next) = (vec![0.0; most], vec![0; most], vec![0; most]);
    let (mut shares, mut shared) = (vec![none; most], vec![Shares::from_parts(&[]); most]);
    let heads: Vec<AtomicU32> = owner.iter().map(|_| AtomicU32::new(7)).collect();
    let counters = Counters::default();
    let balls = Balls {
        solids: solids.as_ptr(),
        boxes: boxes.as_ptr(),
        of_blocks: of_blocks.as_ptr(),
        edges: edges.as_mut_ptr(),
        parts: parts.as_mut_ptr(),
        positions: positions.as_mut_ptr(),
        next: next.as_mut_ptr(),
        heads: heads.as_ptr(),
        fraction: fraction.as_mut_ptr(),
        owner: owner.as_mut_ptr(),
        shares: shares.as_mut_ptr(),
        shared: shared.as_mut_ptr(),
        counters: &raw const counters,
        cells_of_boxes: to_u32(most),
        count_of_positions: to_u32(heads.len()),
        origin,
        strides,
        cells,
        order,
    };
    // A launch has whole blocks and therefore more threads than items of work.
    let threads = |count: u32| (0..count + 50).rev();
    // SAFETY: the arrays are as described.
    unsafe {
        threads(balls.count_of_positions).for_each(|n| balls.clear(n));
        for n in (0..to_u32(boxes.len())).rev() {
            (0..BLOCK).rev().for_each(|thread| balls.edge(n, thread));
        }
        threads(balls.cells_of_boxes).for_each(|n| balls.cover(n));
        threads(balls.cells_of_boxes).for_each(|n| balls.settle(n));
    }
    let lists = counters.lists.load(Ordering::Relaxed) as usize;
    let shared = shared[..lists].iter();
    // SAFETY: `settle` set these lists to fractions in `shares`.
    let shared = shared.map(|list| unsafe { list.parts() }.to_vec());
    let shared = shared.collect();
    CoveredPositions {
        owner,
        fraction,
        shared,
    }
}
