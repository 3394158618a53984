//! Windows: temporary files that are deleted on close. Checks that need a Linux kernel are omitted.

use super::process::Used;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::AsHandle;
use std::process::ExitStatus;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Flag `FILE_FLAG_DELETE_ON_CLOSE`.
const REMOVE_AT_END: u32 = 0x0400_0000;

/// Creates a temporary file that is deleted after its last handle is closed; no other program can open it.
pub(crate) fn anonymous_file(name: &str) -> io::Result<File> {
    static FILES: AtomicU32 = AtomicU32::new(0);
    let number = FILES.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("{name}-{}-{number}", std::process::id()));
    let mut options = OpenOptions::new();
    options.read(true).write(true).create_new(true).share_mode(0).custom_flags(REMOVE_AT_END).open(path)
}

/// Returns standard input as a file.
pub(crate) fn standard_input() -> io::Result<File> {
    Ok(File::from(io::stdin().as_handle().try_clone_to_owned()?))
}

/// Returns `None`: on Windows no signal ends a process; an exception is in the exit code.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}

/// Ends this process at once.
pub(crate) fn end_at_once() {
    std::process::abort()
}

/// Returns the time since the first call: Windows counts a thread's own time in steps of 16 ms, longer than a tick.
pub(crate) fn processor_time() -> Duration {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed()
}

/// Returns zero: the processor time of another process is not read on Windows, so all its time counts as idle.
pub(crate) fn used(_: u32) -> Used {
    Used { ran: Duration::ZERO, wants: false }
}

/// State of this process and thread: not read on Windows.
pub(crate) mod state {
    use crate::platform::process::Part;
    use crate::validate::Outcome;

    /// Reports that the state is unknown.
    pub(crate) fn of_the_system() -> Result<Vec<Part>, Outcome> {
        let looked_at =
            "on Windows only environment, folder and floating-point mode of the process are checked";
        Err(Outcome::UnsupportedSystem(looked_at.to_owned()))
    }

    /// Reports that threads are not counted.
    pub(crate) fn threads() -> Result<usize, Outcome> {
        Err(Outcome::UnsupportedSystem("threads are not counted on Windows".to_owned()))
    }

    /// Reports that Windows cannot preload a library.
    ///
    /// # Errors
    /// [`Outcome::UnsupportedSystem`] always.
    pub(crate) fn is_loaded_first(_: &str) -> Result<(), Outcome> {
        Err(Outcome::UnsupportedSystem(
            "only Linux can replace the allocator of a process (LD_PRELOAD)".to_owned(),
        ))
    }
}

/// Check that a step only computes: not possible on Windows, which has no seccomp.
pub(crate) mod locked {
    use crate::validate::Outcome;
    use flotor_loader::Model;
    use std::process::Command;

    /// Does nothing: no preparation needed.
    pub(crate) fn prepare(_: &mut Command) {}

    /// Returns false: no signal ends a process here.
    pub(crate) fn has_caught(_: i32) -> bool {
        false
    }

    /// Reports that the check is not possible.
    pub(crate) fn system_calls(_: Model) -> Result<(), Outcome> {
        Err(Outcome::UnsupportedSystem("only Linux can detect system calls (seccomp)".to_owned()))
    }
}
