//! Memory that two processes see: an anonymous file, mapped by both.
//!
//! Everything in it is an atomic, so that neither side can bring the other to read what it must not: whatever the
//! other process writes, every bit pattern is a value.
#![allow(unsafe_code)] // a mapping cannot be made without; tests/architecture.rs lists it

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};

/// Words of a step's input: 14 numbers of pose and twist's 6 with them, three times, buttons and demand.
pub(super) const INPUT_WORDS: usize = 17;
/// Words of a step's answer: six of the wrench, the energy, the status.
pub(super) const OUTPUT_WORDS: usize = 8;
/// Bytes of a model's last words.
pub(super) const MESSAGE_BYTES: usize = 508;

/// One request and one answer at a time.
#[repr(C)]
pub(super) struct Exchange {
    /// Number of the newest request; the worker sleeps on it.
    pub(super) request: AtomicU32,
    /// Number of the newest request that is answered; the host sleeps on it.
    pub(super) reply: AtomicU32,
    /// What is asked for.
    pub(super) order: AtomicU32,
    /// How it went.
    pub(super) status: AtomicU32,
    /// Parameter to be changed, and its new value's bits.
    pub(super) parameter: AtomicU64,
    pub(super) value: AtomicU64,
    pub(super) input: [AtomicU64; INPUT_WORDS],
    pub(super) output: [AtomicU64; OUTPUT_WORDS],
    pub(super) message_len: AtomicU32,
    pub(super) message: [AtomicU8; MESSAGE_BYTES],
}

/// An [`Exchange`] that another process may have mapped too.
pub(super) struct SharedMemory {
    exchange: NonNull<Exchange>,
}

// SAFETY: the mapping lives until `drop`, and all that is in it is atomic.
unsafe impl Send for SharedMemory {}
// SAFETY: as above.
unsafe impl Sync for SharedMemory {}

/// Makes the anonymous file. Not real-time.
///
/// # Errors
/// What the system says.
pub(super) fn create_file() -> io::Result<OwnedFd> {
    let file = memfd_create("flotor-worker", MemfdFlags::CLOEXEC)?;
    ftruncate(&file, size_of::<Exchange>() as u64)?;
    Ok(file)
}

impl SharedMemory {
    /// Maps a file made by [`create_file`]. Not real-time.
    ///
    /// # Errors
    /// The file is no such file, or what the system says.
    pub(super) fn map(file: impl AsFd) -> io::Result<Self> {
        let held = rustix::fs::fstat(&file)?.st_size;
        if usize::try_from(held).unwrap_or(0) < size_of::<Exchange>() {
            return Err(io::Error::other("this is not the memory of a worker"));
        }
        let (length, protection) = (size_of::<Exchange>(), ProtFlags::READ | ProtFlags::WRITE);
        // SAFETY: a new mapping at an address of the system's choice aliases nothing of this process. The file is at
        // least as long as the mapping; it is anonymous, and nobody who has it makes it shorter.
        let address = unsafe { mmap(std::ptr::null_mut(), length, protection, MapFlags::SHARED, file, 0) }?;
        let exchange = NonNull::new(address.cast()).ok_or_else(|| io::Error::other("mapped nowhere"))?;
        Ok(Self { exchange })
    }
}

impl std::ops::Deref for SharedMemory {
    type Target = Exchange;

    #[inline]
    fn deref(&self) -> &Exchange {
        // SAFETY: mapped, page-aligned and long enough since `map`, until `drop`; only atomics, for which every bit
        // pattern is a value, whoever writes it.
        unsafe { self.exchange.as_ref() }
    }
}

impl Drop for SharedMemory {
    fn drop(&mut self) {
        // SAFETY: the address and length of the mapping made in `map`; no reference outlives `self`.
        let _ = unsafe { munmap(self.exchange.as_ptr().cast(), size_of::<Exchange>()) };
    }
}
