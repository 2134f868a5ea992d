//! The cover of the cells on a GPU: fractions and owners are sent where cells have changed, bodies before each pass.
//!
//! All cells are sent, 8 bytes each: moving bodies change so many of them that a list of those, twelve bytes each from all over memory, takes
//! longer.

use super::Pinned;
use super::loads::BodyLoad;
use crate::lbm::saturation::Cover;
use crate::lbm::saturation::pass::View;
use crate::lbm::saturation::solid::{Share, Shares, Solid};
use crate::number::to_u32;
use cudarc::driver::{
    CudaFunction, CudaSlice, CudaStream, DevicePtr, DeviceRepr, DriverError, ValidAsZeroBits,
};
use std::mem::MaybeUninit;
use std::sync::Arc;

/// The cover on the GPU.
pub(super) struct OnGpu {
    /// The pass over the covered cells.
    pub(super) covered: CudaFunction,
    /// The cells on the host, held in place for transfers.
    _pinned: [Option<Pinned>; 2],
    /// The version of the cells on the GPU.
    version: u64,
    fraction: CudaSlice<f32>,
    owner: CudaSlice<u32>,
    solids: Room,
    shares: Room,
    parts: Room,
    /// One [`BodyLoad`] for each slot.
    pub(super) loads: CudaSlice<u64>,
    /// What the next pass sees.
    pub(super) view: View,
    /// Room on the host that is used again.
    work: Work,
}

/// Lists that are sent.
#[derive(Default)]
struct Work {
    parts: Vec<Share>,
    shares: Vec<[u64; 2]>,
}

/// An array on the GPU that grows.
struct Room(CudaSlice<Byte>);

/// A byte of a number, or of what lies between those of a struct.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Byte(MaybeUninit<u8>);

// SAFETY: a byte, and any.
unsafe impl DeviceRepr for Byte {}
// SAFETY: as above.
unsafe impl ValidAsZeroBits for Byte {}

impl Room {
    fn new(stream: &Arc<CudaStream>) -> Result<Self, DriverError> {
        stream.alloc_zeros(1 << 12).map(Self)
    }

    /// Sends a list; its address.
    fn send<T: Copy>(&mut self, stream: &Arc<CudaStream>, list: &[T]) -> Result<u64, DriverError> {
        // SAFETY: the bytes of the list, which may hold anything; kernels read numbers of the same layout (`repr(C)`).
        let bytes: &[Byte] =
            unsafe { std::slice::from_raw_parts(list.as_ptr().cast(), size_of_val(list)) };
        if bytes.len() > self.0.len() {
            self.0 = stream.alloc_zeros(bytes.len().next_power_of_two())?;
        }
        if !bytes.is_empty() {
            let mut there = self.0.slice_mut(..bytes.len());
            stream.memcpy_htod(bytes, &mut there)?;
        }
        Ok(self.0.device_ptr(stream).0)
    }
}

impl OnGpu {
    /// Sends the cells of a cover.
    ///
    /// # Safety
    /// It must be the cover of each update, and outlive this.
    pub(super) unsafe fn new(
        stream: &Arc<CudaStream>,
        covered: CudaFunction,
        cover: &Cover,
    ) -> Result<Self, DriverError> {
        let (owner, fraction) = cover.cells();
        // SAFETY: promised by the caller: lists of cells stay where they are.
        let pinned = unsafe {
            [
                Pinned::new(bytemuck::cast_slice(owner)),
                Pinned::new(bytemuck::cast_slice(fraction)),
            ]
        };
        Ok(Self {
            covered,
            _pinned: pinned,
            version: cover.version(),
            fraction: stream.clone_htod(fraction)?,
            owner: stream.clone_htod(owner)?,
            solids: Room::new(stream)?,
            shares: Room::new(stream)?,
            parts: Room::new(stream)?,
            loads: stream.alloc_zeros(1)?,
            view: View::NONE,
            work: Work::default(),
        })
    }

    /// Sends what has changed, and clears the forces.
    pub(super) fn update(
        &mut self,
        stream: &Arc<CudaStream>,
        cover: &mut Cover,
    ) -> Result<(), DriverError> {
        if self.version != cover.version() {
            let (owner, fraction) = cover.cells();
            stream.memcpy_htod(fraction, &mut self.fraction)?;
            stream.memcpy_htod(owner, &mut self.owner)?;
            self.version = cover.version();
        }
        let Work { parts, shares, .. } = &mut self.work;
        parts.clear();
        parts.extend(cover.shared().iter().flatten().copied());
        let mut at = self.parts.send(stream, parts)?;
        shares.clear();
        shares.extend(cover.shared().iter().map(|of_cell| {
            let here = Shares::words(at, of_cell.len());
            at += size_of_val(&of_cell[..]) as u64;
            here
        }));
        let addresses = [
            self.fraction.device_ptr(stream).0,
            self.owner.device_ptr(stream).0,
            self.solids.send(stream, cover.solids())?,
            self.shares.send(stream, shares)?,
        ];
        self.view = View::on_gpu(cover, addresses);
        let words = cover.solids().len() * size_of::<BodyLoad>() / size_of::<u64>();
        if self.loads.len() < words {
            self.loads = stream.alloc_zeros(words.next_power_of_two())?;
        } else {
            stream.memset_zeros(&mut self.loads)?;
        }
        Ok(())
    }

    /// Adds the forces to the sums of the cover.
    pub(super) fn take_loads(
        &mut self,
        stream: &Arc<CudaStream>,
        cover: &mut Cover,
    ) -> Result<(), DriverError> {
        let words = size_of::<BodyLoad>() / size_of::<u64>();
        let found = stream.clone_dtoh(&self.loads)?;
        stream.synchronize()?;
        let solids: Vec<Solid> = cover.solids().to_vec();
        for (slot, (load, solid)) in found.chunks_exact(words).zip(&solids).enumerate() {
            if load.iter().any(|&part| part != 0) {
                cover.receive(to_u32(slot), &BodyLoad::of(load).total(solid));
            }
        }
        Ok(())
    }
}
