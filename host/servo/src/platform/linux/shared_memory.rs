//! Shared memory of two processes: an anonymous file, mapped by both. The length of the file is sealed: a worker has the file as
//! its standard input, and truncating it would cause a bus error in the host.
#![allow(unsafe_code)] // a mapping cannot be made without; tests/tests/system/architecture.rs lists it

use crate::engine::process::SharedPage;
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fcntl_get_seals, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;
use rustix::time::Timespec;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// Mapping of a [`SharedPage`] that another process may have mapped too.
pub(crate) struct SharedMemory {
    page: NonNull<SharedPage>,
}

// SAFETY: the mapping lives until `drop`, and all that is in it is atomic.
unsafe impl Send for SharedMemory {}
// SAFETY: as above.
unsafe impl Sync for SharedMemory {}

/// Creates the anonymous file, with a sealed length. Not real-time.
///
/// # Errors
/// If a system call fails.
pub(crate) fn create_file() -> io::Result<OwnedFd> {
    let file = memfd_create("flotor-worker", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    ftruncate(&file, size_of::<SharedPage>() as u64)?;
    fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
    Ok(file)
}

impl SharedMemory {
    /// Maps the memory passed to this process as standard input. Not real-time.
    ///
    /// # Errors
    /// As for [`SharedMemory::map`].
    pub(crate) fn of_standard_input() -> io::Result<Self> {
        Self::map(io::stdin())
    }

    /// Maps a file created by [`create_file`]. Not real-time.
    ///
    /// # Errors
    /// If the file was not created by [`create_file`], or a system call fails.
    pub(crate) fn map(file: impl AsFd) -> io::Result<Self> {
        // The seal before the length: a length that was read first might be cut before the seal is there. Other files have no seals.
        let is_sealed = fcntl_get_seals(&file).is_ok_and(|seals| seals.contains(SealFlags::SHRINK));
        let held = rustix::fs::fstat(&file)?.st_size;
        if !is_sealed || usize::try_from(held).unwrap_or(0) < size_of::<SharedPage>() {
            return Err(io::Error::other("standard input is not the shared memory of a worker"));
        }
        let (length, protection) = (size_of::<SharedPage>(), ProtFlags::READ | ProtFlags::WRITE);
        // SAFETY: a new mapping at an address of the system's choice aliases nothing of this process. The file is at
        // least as long as the mapping and stays so, being sealed against shrinking: no seal is ever taken off.
        let address = unsafe { mmap(std::ptr::null_mut(), length, protection, MapFlags::SHARED, file, 0) }?;
        let page = NonNull::new(address.cast()).ok_or_else(|| io::Error::other("mapped nowhere"))?;
        Ok(Self { page })
    }
}

impl std::ops::Deref for SharedMemory {
    type Target = SharedPage;

    #[inline]
    fn deref(&self) -> &SharedPage {
        // SAFETY: mapped, page-aligned and long enough since `map`, until `drop`; only atomics, for which every bit
        // pattern is a value, whoever writes it.
        unsafe { self.page.as_ref() }
    }
}

impl Drop for SharedMemory {
    fn drop(&mut self) {
        // SAFETY: the address and length of the mapping made in `map`; no reference outlives `self`.
        let _ = unsafe { munmap(self.page.as_ptr().cast(), size_of::<SharedPage>()) };
    }
}

/// Sleeps until [`wake`], or for `timeout_ns`, if `word` is still `value`; may return earlier. Real-time: one system call.
pub(crate) fn wait_for_change(word: &AtomicU32, value: u32, timeout_ns: u64) {
    let timeout = Timespec::try_from(Duration::from_nanos(timeout_ns)).ok();
    // The caller reads the word again after any wake-up.
    let _ = futex::wait(word, futex::Flags::empty(), value, timeout.as_ref());
}

/// Wakes the other process if it sleeps on `word`. Real-time: one system call.
pub(crate) fn wake(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::empty(), 1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;
    use std::sync::atomic::Ordering;

    #[test]
    fn whoever_has_the_file_cannot_cut_it_from_under_a_mapping() {
        let file = create_file().expect("an anonymous file");
        let memory = SharedMemory::map(&file).expect("mapped");
        memory.request.store(7, Ordering::Relaxed);
        assert_eq!(ftruncate(&file, 0), Err(Errno::PERM));
        assert_eq!(ftruncate(&file, 2 * size_of::<SharedPage>() as u64), Err(Errno::PERM));
        // Would be a bus error if the file had been cut.
        assert_eq!(memory.request.load(Ordering::Relaxed), 7);
    }

    #[test]
    fn a_file_that_could_be_cut_is_not_mapped() {
        for flags in [MemfdFlags::CLOEXEC, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING] {
            let file = memfd_create("unsealed", flags).expect("an anonymous file");
            ftruncate(&file, size_of::<SharedPage>() as u64).expect("a length");
            assert!(SharedMemory::map(&file).is_err(), "{flags:?}");
        }
    }

    #[test]
    fn some_other_file_is_not_mapped() {
        let file = std::fs::File::open("/dev/null").expect("there is one");
        assert!(SharedMemory::map(file).is_err());
    }
}
