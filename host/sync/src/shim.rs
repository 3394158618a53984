//! The atomics: the standard library's, or loom's when the interleavings are checked (`--cfg loom`).
#![allow(clippy::disallowed_types, clippy::expect_used)] // the lock is for senders of an inbox, and for loom

#[cfg(not(loom))]
pub(crate) use std::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering, fence},
};

#[cfg(loom)]
pub(crate) use loom::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering, fence},
};

/// Tells loom that a place belongs to one side at a time. In a normal build it is nothing.
///
/// The words of a ring slot are atomic only so that this crate needs no `unsafe`: the protocol gives a slot
/// to one side at a time, and it would be as right with plain memory. Loom could not see a breach of that,
/// because it never lets an atomic load return a store that runs later, as real hardware may. It does watch
/// its own `UnsafeCell`: two accesses, one of them a write, with nothing that orders them, fail the model.
#[cfg(not(loom))]
#[derive(Debug)]
pub(crate) struct Exclusive;

#[cfg(not(loom))]
impl Exclusive {
    pub(crate) fn new() -> Self {
        Self
    }

    #[inline]
    pub(crate) fn assert_readable(&self) {}

    #[inline]
    pub(crate) fn assert_writable(&self) {}
}

/// The watched place. The standard mutex is only there to make the cell `Sync` without `unsafe`: loom does
/// not know it, so it orders nothing in the model, and it is never held across a switch of threads.
#[cfg(loom)]
#[derive(Debug)]
pub(crate) struct Exclusive(std::sync::Mutex<loom::cell::UnsafeCell<()>>);

#[cfg(loom)]
impl Exclusive {
    pub(crate) fn new() -> Self {
        Self(std::sync::Mutex::new(loom::cell::UnsafeCell::new(())))
    }

    pub(crate) fn assert_readable(&self) {
        self.0.lock().expect("no model goes on after a failure").with(|_| ());
    }

    pub(crate) fn assert_writable(&self) {
        self.0.lock().expect("no model goes on after a failure").with_mut(|_| ());
    }
}
