//! Primitives of concurrency: those of the standard library, or those of loom, which runs a model through all orders of
//! events that the memory model of Rust allows (`RUSTFLAGS="--cfg loom"`).

#[cfg(not(loom))]
pub(super) use std::{
    hint::spin_loop,
    sync::atomic::{AtomicBool, AtomicU64, Ordering, fence},
    sync::{Arc, Mutex},
    thread::{Thread, current, park, yield_now},
};

#[cfg(loom)]
pub(super) use loom::{
    hint::spin_loop,
    sync::atomic::{AtomicBool, AtomicU64, Ordering, fence},
    sync::{Arc, Mutex},
    thread::{Thread, current, park, yield_now},
};

/// Value that threads access in turn.
#[cfg(not(loom))]
#[derive(Debug)]
pub(super) struct TurnCell<T>(std::cell::UnsafeCell<T>);

/// Value that threads access in turn, checked by loom.
#[cfg(loom)]
#[derive(Debug)]
pub(super) struct TurnCell<T>(loom::cell::UnsafeCell<T>);

impl<T: Copy> TurnCell<T> {
    #[cfg(not(loom))]
    pub(super) fn new(value: T) -> Self {
        Self(std::cell::UnsafeCell::new(value))
    }

    #[cfg(loom)]
    pub(super) fn new(value: T) -> Self {
        Self(loom::cell::UnsafeCell::new(value))
    }

    /// Returns a copy of the value.
    ///
    /// # Safety
    /// No other thread may write it at the same time.
    pub(super) unsafe fn get(&self) -> T {
        // SAFETY: promised by the caller.
        #[cfg(not(loom))]
        return unsafe { *self.0.get() };
        // SAFETY: promised by the caller; loom checks it.
        #[cfg(loom)]
        return self.0.with(|value| unsafe { *value });
    }

    /// Writes the value.
    ///
    /// # Safety
    /// No other thread may access it at the same time.
    pub(super) unsafe fn set(&self, value: T) {
        // SAFETY: promised by the caller.
        #[cfg(not(loom))]
        unsafe {
            *self.0.get() = value;
        }
        // SAFETY: promised by the caller; loom checks it.
        #[cfg(loom)]
        self.0.with_mut(|place| unsafe { *place = value });
    }
}
