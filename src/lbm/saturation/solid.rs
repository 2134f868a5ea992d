//! The bodies of a cell.

use crate::rigid::{Rigid, surface_velocity};

/// Fraction of a cell so deep inside a body that no water is next to it.
pub const DEEP: f32 = 2.0;

/// Between the fraction of a full cell and [`DEEP`].
pub(super) const BETWEEN: f32 = 1.5;

/// No body.
pub(crate) const NONE: u32 = u32::MAX;
/// A ghost cell behind a wall at rest.
pub(crate) const STILL: u32 = u32::MAX - 1;
/// Cells of several bodies are numbered from here.
pub(crate) const SHARED: u32 = 1 << 31;

/// Id and image of a body. Compared in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(C)]
pub struct Name {
    /// Id.
    pub id: u64,
    /// Image, in domains.
    pub image: [i32; 3],
}

impl From<(u64, [i32; 3])> for Name {
    fn from((id, image): (u64, [i32; 3])) -> Self {
        Self { id, image }
    }
}

/// A body as the cells know it. The same bytes on the host and on a GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct CoveringBody {
    /// Id and image: they order the bodies of a cell.
    pub name: Name,
    /// Its motion in lattice units; positions in its raw frame.
    pub motion: Rigid,
    /// From its raw frame to the cells of the slab: local = raw + frame.
    pub frame: [i32; 3],
    /// `true` if it is known to be so far from other bodies and from walls that no full cell of it is next to one of
    /// theirs.
    pub alone: bool,
}

impl CoveringBody {
    /// A local cell in the raw frame.
    #[inline(always)]
    pub(super) fn raw(&self, cell: [i32; 3]) -> [i32; 3] {
        [
            cell[0] - self.frame[0],
            cell[1] - self.frame[1],
            cell[2] - self.frame[2],
        ]
    }

    /// Velocity of the body at the centre of a cell of its raw frame.
    #[inline(always)]
    pub(super) fn velocity<const D: usize>(&self, raw: [i32; 3]) -> [f64; 3] {
        let mut arm = [0.0; 3];
        for a in 0..D {
            arm[a] = f64::from(raw[a]) + 0.5 - self.motion.position[a];
        }
        surface_velocity::<D>(&self.motion, arm)
    }
}

/// A body's part of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Share {
    /// Slot of the body.
    pub(crate) slot: u32,
    /// Part of the cell that it fills.
    pub(crate) fraction: f32,
}

/// The parts of a cell of several bodies.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Shares {
    first: *const Share,
    count: usize,
}

impl Shares {
    /// These parts, for as long as they stay where they are.
    pub(crate) fn from_parts(parts: &[Share]) -> Self {
        Self {
            first: parts.as_ptr(),
            count: parts.len(),
        }
    }

    /// The bytes of parts at an address elsewhere.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn words(first: u64, count: usize) -> [u64; 2] {
        [first, count as u64]
    }

    /// The parts.
    ///
    /// # Safety
    /// They must be where they were.
    #[inline(always)]
    pub(crate) unsafe fn parts<'a>(self) -> &'a [Share] {
        // SAFETY: promised by the caller.
        unsafe { core::slice::from_raw_parts(self.first, self.count) }
    }
}

/// ε of a cell: the sum in the order of the bodies.
#[inline(always)]
pub(crate) fn total(shares: &[Share]) -> f64 {
    let mut sum = 0.0;
    for share in shares {
        sum += f64::from(share.fraction);
    }
    sum
}
