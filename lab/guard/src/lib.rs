//! Guarding allocator for the process in which `flotor validate` detects accesses outside a block.
//!
//! ```text
//!  a page boundary                                        a page boundary
//!  |      head | block of `size` bytes | edge (0 to 15 bytes) |  guard page without any access |
//! ```
//!
//! Every block ends at a guard, so that a read or write of the guard ends the process there. Head and edge contain
//! known bytes, which are checked when the block is freed; freed memory becomes a guard itself and is never reused. The
//! library replaces the C library's functions through `LD_PRELOAD`. It has no lists and no locks.
#![allow(unsafe_code)]

use rustix::mm::{MapFlags, ProtFlags, mmap_anonymous};
use std::ffi::{c_int, c_void};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Size of a guard, and rounding unit of lengths: a multiple of every page size.
const PAGE: usize = 64 * 1024;
/// Default alignment of a block.
const ALIGNMENT: usize = 16;
/// Fill byte of the edge behind a block.
const EDGE: u8 = 0xa5;
const MAGIC: usize = 0x464c_4f54_4755_4152;
/// Maximum number of guarded blocks at a time: each is two mappings, and Linux allows a process 65530. Further blocks have no guard.
const MOST_GUARDED: usize = 20_000;

static GUARDED: AtomicUsize = AtomicUsize::new(0);

/// Header before a block.
#[repr(C)]
struct Head {
    start: usize,
    length: usize,
    size: usize,
    magic: usize,
}

const HEAD: usize = size_of::<Head>();

/// Maps zeroed memory of the system, at `place` or anywhere; null on failure.
///
/// # Safety
/// `place` is 0, or the `length` bytes there belong to the caller and are in use nowhere.
unsafe fn map(place: usize, length: usize, access: ProtFlags) -> *mut u8 {
    let place_flag = if place == 0 { MapFlags::empty() } else { MapFlags::FIXED };
    let flags = MapFlags::PRIVATE | MapFlags::NORESERVE | place_flag;
    // SAFETY: new memory, or the caller's own, as this function demands.
    let mapped = unsafe { mmap_anonymous(place as *mut c_void, length, access, flags) };
    mapped.map_or(null_mut(), <*mut c_void>::cast)
}

/// Allocates a zeroed block that ends at a guard, or without one beyond [`MOST_GUARDED`] blocks; null on failure or for
/// an impossible size.
fn allocate(size: usize, alignment: usize) -> *mut c_void {
    let needed = size.checked_add(HEAD + alignment).and_then(|bytes| bytes.checked_next_multiple_of(PAGE));
    let Some((length, whole)) = needed.and_then(|bytes| Some((bytes, bytes.checked_add(PAGE)?))) else {
        return null_mut();
    };
    // SAFETY: new memory, wherever the system likes.
    let start = unsafe { map(0, whole, ProtFlags::READ | ProtFlags::WRITE) };
    if start.is_null() {
        return null_mut();
    }
    let end = start as usize + length;
    if GUARDED.fetch_add(1, Ordering::Relaxed) < MOST_GUARDED {
        // SAFETY: the last page of what was just mapped; nobody knows it yet.
        let _ = unsafe { map(end, PAGE, ProtFlags::empty()) };
    }
    let block = (end - size) & !(alignment - 1);
    let head = Head { start: start as usize, length: whole, size, magic: MAGIC ^ block };
    // SAFETY: `length` has room for head and block with any alignment; both are inside what was just mapped, and `block`
    // is a multiple of 16, hence aligned for a head.
    unsafe {
        ((block - HEAD) as *mut Head).write(head);
        ((block + size) as *mut u8).write_bytes(EDGE, end - block - size);
    }
    block as *mut c_void
}

/// Returns the head of a block; ends the process if head or edge are damaged.
///
/// # Safety
/// `block` came from [`allocate`] and is not freed; otherwise this may end the process by a signal, which is the purpose.
unsafe fn head_of(block: *mut c_void) -> Head {
    let place = block as usize;
    // SAFETY: every block has its head before it.
    let head = unsafe { (place.wrapping_sub(HEAD) as *const Head).read() };
    if head.magic != MAGIC ^ place {
        std::process::abort();
    }
    // SAFETY: the edge reaches from the block to its guard, the last page of the mapping.
    let is_edge = |at: usize| unsafe { (at as *const u8).read() } == EDGE;
    let is_whole = (place + head.size..head.start + head.length - PAGE).all(is_edge);
    if !is_whole {
        std::process::abort();
    }
    head
}

/// Replaces the C library's `malloc`.
#[unsafe(no_mangle)]
pub extern "C" fn malloc(size: usize) -> *mut c_void {
    allocate(size, ALIGNMENT)
}

/// Replaces the C library's `calloc`.
#[unsafe(no_mangle)]
pub extern "C" fn calloc(count: usize, size: usize) -> *mut c_void {
    count.checked_mul(size).map_or(null_mut(), |bytes| allocate(bytes, ALIGNMENT))
}

/// Replaces the C library's `free`.
///
/// # Safety
/// As in C: null, or a block that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn free(block: *mut c_void) {
    if block.is_null() {
        return;
    }
    // SAFETY: as this function demands.
    let head = unsafe { head_of(block) };
    GUARDED.fetch_sub(1, Ordering::Relaxed);
    // SAFETY: the whole mapping of the block, which nobody uses any more.
    let _ = unsafe { map(head.start, head.length, ProtFlags::empty()) };
}

/// Replaces the C library's `realloc`.
///
/// # Safety
/// As in C: null, or a block that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn realloc(block: *mut c_void, size: usize) -> *mut c_void {
    let moved = allocate(size, ALIGNMENT);
    if block.is_null() || moved.is_null() {
        return moved;
    }
    // SAFETY: as this function demands; the new block is as large as it says, and nobody has it yet.
    unsafe {
        let kept = head_of(block).size.min(size);
        moved.cast::<u8>().copy_from_nonoverlapping(block.cast::<u8>(), kept);
        free(block);
    }
    moved
}

/// Replaces the C library's `aligned_alloc`.
#[unsafe(no_mangle)]
pub extern "C" fn aligned_alloc(alignment: usize, size: usize) -> *mut c_void {
    if alignment.is_power_of_two() { allocate(size, alignment.max(ALIGNMENT)) } else { null_mut() }
}

/// Replaces the C library's `memalign`.
#[unsafe(no_mangle)]
pub extern "C" fn memalign(alignment: usize, size: usize) -> *mut c_void {
    aligned_alloc(alignment, size)
}

/// Replaces the C library's `posix_memalign`.
///
/// # Safety
/// As in C: `out` has room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn posix_memalign(out: *mut *mut c_void, alignment: usize, size: usize) -> c_int {
    const NO_MEMORY: c_int = 12;
    let block = aligned_alloc(alignment, size);
    if block.is_null() {
        return NO_MEMORY;
    }
    // SAFETY: as this function demands.
    unsafe { out.write(block) };
    0
}

/// Replaces the C library's `malloc_usable_size`.
///
/// # Safety
/// As in C: null, or a block that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn malloc_usable_size(block: *mut c_void) -> usize {
    if block.is_null() {
        return 0;
    }
    // SAFETY: as this function demands.
    unsafe { head_of(block) }.size
}
