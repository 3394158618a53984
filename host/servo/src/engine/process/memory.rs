//! What two processes see of each other: one page of memory, mapped by both.
//!
//! Everything in it is an atomic, so that neither side can bring the other to read what it must not: whatever the
//! other process writes, every bit pattern is a value.

pub(super) use crate::platform::shared_memory::{SharedMemory, create_file};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};

/// Words of a step's input: 7 of the pose, 6 of the twist, time, period, tick, buttons and demand in one.
pub(super) const INPUT_WORDS: usize = 17;
/// Words of a step's answer: six of the wrench, the energy, the status.
pub(super) const OUTPUT_WORDS: usize = 8;
/// Words of where a model can act: shape, centre, half the sides.
pub(super) const REGION_WORDS: usize = 7;
/// Words of where it ends: lower and upper.
pub(super) const BOUNDS_WORDS: usize = 6;
/// Words of a linear field: pose, wrench, stiffness, validity, time.
pub(super) const FIELD_WORDS: usize = 7 + 6 + 36 + 3;
/// Bytes of a model's last words.
pub(super) const MESSAGE_BYTES: usize = 508;

/// One request and one answer at a time.
#[repr(C)]
pub(crate) struct SharedPage {
    /// Number of the newest request; the worker sleeps on it.
    pub(crate) request: AtomicU32,
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
    pub(super) region: [AtomicU64; REGION_WORDS],
    pub(super) bounds: [AtomicU64; BOUNDS_WORDS],
    pub(super) field: [AtomicU64; FIELD_WORDS],
    pub(super) message_len: AtomicU32,
    pub(super) message: [AtomicU8; MESSAGE_BYTES],
}

/// The same memory mapped so many times; `None`, and said so, where the system has none to share.
#[cfg(test)]
pub(super) fn mapped<const TIMES: usize>() -> Option<[SharedMemory; TIMES]> {
    match create_file() {
        Err(error) if error.kind() == std::io::ErrorKind::Unsupported => {
            println!("skipped: {error}");
            None
        }
        file => {
            let file = file.expect("an anonymous file");
            Some([(); TIMES].map(|()| SharedMemory::map(&file).expect("mapped")))
        }
    }
}
