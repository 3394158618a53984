//! Shared-memory page between host and worker.
//!
//! All fields are atomics, and every bit pattern is a valid value: neither process can make the other read invalid data.

pub(super) use crate::platform::shared_memory::{SharedMemory, create_file};
use flotor_core::grip::GRIP_WORDS;
use flotor_core::sent::INPUT_WORDS;
use flotor_core::words::CONTACT_SET_WORDS;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};

/// Number of 64-bit words in the reply to a step: wrench (6), energy, status.
const OUTPUT_WORDS: usize = 8;
/// Number of words of an active region: shape, centre, half extents.
const REGION_WORDS: usize = 7;
/// Number of words of workspace bounds: lower and upper corner.
const BOUNDS_WORDS: usize = 6;
/// Capacity of a message, bytes.
pub(super) const MESSAGE_BYTES: usize = 508;

/// Layout of the shared page, with one request and one reply at a time.
#[repr(C)]
pub(crate) struct SharedPage {
    /// Number of the newest request; the worker sleeps until the number changes.
    pub(crate) request: AtomicU32,
    /// Number of the newest request with a reply; the host sleeps until the number changes.
    pub(super) reply: AtomicU32,
    /// Code of the requested operation.
    pub(super) operation: AtomicU32,
    /// Status of the reply.
    pub(super) status: AtomicU32,
    /// Index of the parameter to change.
    pub(super) parameter: AtomicU64,
    /// Bits of the new value of the parameter.
    pub(super) value: AtomicU64,
    pub(super) input: [AtomicU64; INPUT_WORDS],
    pub(super) output: [AtomicU64; OUTPUT_WORDS],
    pub(super) grip: [AtomicU64; GRIP_WORDS],
    pub(super) region: [AtomicU64; REGION_WORDS],
    pub(super) bounds: [AtomicU64; BOUNDS_WORDS],
    pub(super) contact_set: [AtomicU64; CONTACT_SET_WORDS],
    pub(super) message_len: AtomicU32,
    pub(super) message: [AtomicU8; MESSAGE_BYTES],
}

/// Maps the same memory `TIMES` times; prints a note and returns `None` if the system has no shared memory.
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
