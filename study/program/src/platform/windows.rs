//! Windows: free space of a volume, within the user's quota.
#![allow(unsafe_code)] // one system call; tests/tests/system/architecture.rs lists it

use std::os::windows::ffi::OsStrExt;
use std::path::Path;
use windows_sys::Win32::Storage::FileSystem::GetDiskFreeSpaceExW;

/// Returns the disk space available to this user on the volume of an existing folder, bytes; `None` if unknown. Not real-time.
pub(crate) fn free_bytes(folder: &Path) -> Option<f64> {
    let name: Vec<u16> = folder.as_os_str().encode_wide().chain([0]).collect();
    let mut free = 0;
    let (all, unreserved) = (std::ptr::null_mut(), std::ptr::null_mut());
    // SAFETY: the name ends in a zero, and `free` is written during the call; null pointers omit the other two results.
    let told = unsafe { GetDiskFreeSpaceExW(name.as_ptr(), &raw mut free, all, unreserved) };
    (told != 0).then_some(free as f64)
}
