//! Bodies that cover cells, and their fractions in a cell.
//!
//! The types are separate from `cover`, which changes them, because they are also compiled for GPUs.

use crate::rigid::{Rigid, surface_velocity};

/// Stored fraction of a cell deep inside a body, that is, without fluid in any neighbouring cell.
pub const DEEP: f32 = 2.0;

/// Threshold between the fraction of a full cell and [`DEEP`].
pub(super) const BETWEEN: f32 = 1.5;

/// Owner of a cell without bodies.
pub(crate) const NONE: u32 = u32::MAX;
/// Owner of a ghost cell behind a stationary wall.
pub(crate) const STILL: u32 = u32::MAX - 1;
/// Bit that marks the owner of a cell of several bodies; the lower bits are the index of the list of its bodies.
pub(crate) const SHARED: u32 = 1 << 31;

/// Id and periodic image of a body; names are ordered by id, then by image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(C)]
pub struct Name {
    /// Id of the body.
    pub id: u64,
    /// Offset of the periodic image \[domain lengths\].
    pub image: [i32; 3],
}

impl From<(u64, [i32; 3])> for Name {
    fn from((id, image): (u64, [i32; 3])) -> Self {
        Self { id, image }
    }
}

/// Body that covers cells. The layout is the same on the host and on a GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct CoveringBody {
    /// Id and image, by which the bodies of a cell are ordered.
    pub name: Name,
    /// Motion in lattice units; the position is in the raw frame of the body.
    pub motion: Rigid,
    /// Offset from the raw frame of the body to the cells of the slab: local = raw + frame.
    pub frame: [i32; 3],
    /// `true` if the body is known to be so far from other bodies and from walls that none of its full cells is
    /// adjacent to one of theirs.
    pub alone: bool,
}

impl CoveringBody {
    /// Returns the coordinates of a local cell in the raw frame.
    #[inline(always)]
    pub(super) fn raw(&self, cell: [i32; 3]) -> [i32; 3] {
        [
            cell[0] - self.frame[0],
            cell[1] - self.frame[1],
            cell[2] - self.frame[2],
        ]
    }

    /// Returns the velocity of the body at the centre of a cell of its raw frame.
    #[inline(always)]
    pub(super) fn velocity<const D: usize>(&self, raw: [i32; 3]) -> [f64; 3] {
        let mut arm = [0.0; 3];
        for a in 0..D {
            arm[a] = f64::from(raw[a]) + 0.5 - self.motion.position[a];
        }
        surface_velocity::<D>(&self.motion, arm)
    }
}

/// Fraction of a cell that a body fills.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Share {
    /// Slot of the body.
    pub(crate) slot: u32,
    /// Fraction of the cell.
    pub(crate) fraction: f32,
}

/// List of the bodies of a cell with their fractions, by address.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Shares {
    first: *const Share,
    count: usize,
}

impl Shares {
    /// Returns the list of these fractions, which is valid until they are moved or dropped.
    pub(crate) fn from_parts(parts: &[Share]) -> Self {
        Self {
            first: parts.as_ptr(),
            count: parts.len(),
        }
    }

    /// Returns the words of a list of `count` fractions at an address on a GPU.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn words(first: u64, count: usize) -> [u64; 2] {
        [first, count as u64]
    }

    /// Returns the fractions.
    ///
    /// # Safety
    /// The fractions must still be at the address of the list.
    #[inline(always)]
    pub(crate) unsafe fn parts<'a>(self) -> &'a [Share] {
        // SAFETY: promised by the caller.
        unsafe { core::slice::from_raw_parts(self.first, self.count) }
    }
}

/// Returns the sum of the fractions of a cell, added in the order of the bodies.
#[inline(always)]
pub(crate) fn total(shares: &[Share]) -> f64 {
    let mut sum = 0.0;
    for share in shares {
        sum += f64::from(share.fraction);
    }
    sum
}
