//! Memory for the fields of a slab: zeros directly from the operating system, in huge pages, also in programs and tests
//! with another allocator.
//!
//! A pass reads and writes dozens of rows at the same time. With pages of 4 KiB each row lies in a page of its own, and
//! the processor spends its time on address translation.

use super::error::FluidError;
use super::lanes::Stored;
use base::allocator;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

/// Zeroed memory obtained directly from the operating system.
pub(super) struct Pages<S> {
    start: *mut S,
    len: usize,
    kind: PhantomData<S>,
}

// SAFETY: `Pages` owns its memory; shared references only read it.
unsafe impl<S: Send> Send for Pages<S> {}
// SAFETY: as above.
unsafe impl<S: Sync> Sync for Pages<S> {}

impl<S: Stored> Pages<S> {
    /// Allocates `len` zeros.
    ///
    /// # Errors
    /// If the memory cannot be allocated.
    pub(super) fn new(len: usize) -> Result<Self, FluidError> {
        let bytes = len * size_of::<S>();
        let start = allocator::map(bytes);
        if start.is_null() {
            return Err(FluidError::Memory {
                bytes,
                error: std::io::Error::last_os_error(),
            });
        }
        Ok(Self {
            start: start.cast(),
            len,
            kind: PhantomData,
        })
    }

    /// Returns the address of the first number.
    pub(super) fn start(&mut self) -> *mut S {
        self.start
    }
}

impl<S: Stored> Deref for Pages<S> {
    type Target = [S];

    fn deref(&self) -> &[S] {
        // SAFETY: the mapping holds `len` initialised (zero) elements and lives as long as `self`.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }
}

impl<S: Stored> DerefMut for Pages<S> {
    fn deref_mut(&mut self) -> &mut [S] {
        // SAFETY: as for `deref`, and `self` is borrowed exclusively.
        unsafe { std::slice::from_raw_parts_mut(self.start, self.len) }
    }
}

impl<S> Drop for Pages<S> {
    fn drop(&mut self) {
        // SAFETY: the memory was allocated in `new` and is released once.
        unsafe {
            allocator::unmap(self.start.cast(), self.len * size_of::<S>());
        }
    }
}
