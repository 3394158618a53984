//! Windows: processor time and working set of the process, and the user's settings folder.
#![allow(unsafe_code)] // two system calls; listed in tests/tests/system/architecture.rs

use std::path::PathBuf;
use std::time::Duration;
use windows_sys::Win32::Foundation::FILETIME;
use windows_sys::Win32::System::ProcessStatus::{GetProcessMemoryInfo, PROCESS_MEMORY_COUNTERS};
use windows_sys::Win32::System::Threading::{GetCurrentProcess, GetProcessTimes};

/// Returns the processor time of this process so far.
pub(crate) fn processor() -> Duration {
    let [mut made, mut ended, mut kernel, mut user] = [FILETIME { dwLowDateTime: 0, dwHighDateTime: 0 }; 4];
    // SAFETY: the pseudo-handle of this process is always valid, and the four times are written during the call.
    unsafe {
        GetProcessTimes(GetCurrentProcess(), &raw mut made, &raw mut ended, &raw mut kernel, &raw mut user)
    };
    // `FILETIME` counts units of 100 ns.
    let of = |time: FILETIME| {
        let units = u64::from(time.dwHighDateTime) << 32 | u64::from(time.dwLowDateTime);
        Duration::from_nanos(units.saturating_mul(100))
    };
    of(kernel) + of(user)
}

/// Returns the resident memory of this process, MiB; `None` if the system does not report it.
pub(crate) fn resident_mib() -> Option<u64> {
    let size = u32::try_from(size_of::<PROCESS_MEMORY_COUNTERS>()).ok()?;
    let mut memory = PROCESS_MEMORY_COUNTERS { cb: size, ..Default::default() };
    // SAFETY: the pseudo-handle of this process is always valid, and the call writes at most `size` bytes to `memory`.
    let told = unsafe { GetProcessMemoryInfo(GetCurrentProcess(), &raw mut memory, size) };
    (told != 0).then(|| u64::try_from(memory.WorkingSetSize >> 20).unwrap_or(u64::MAX))
}

/// Returns the folder for the settings of this user; `None` without an absolute path in `APPDATA`.
pub(crate) fn settings_folder() -> Option<PathBuf> {
    std::env::var_os("APPDATA").map(PathBuf::from).filter(|path| path.is_absolute())
}
