//! Windows: a file that goes when it is closed. What only a kernel of Linux tells is not checked.

use super::Used;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::AsHandle;
use std::process::ExitStatus;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// `FILE_FLAG_DELETE_ON_CLOSE`, and no other program may open it.
const REMOVE_AT_END: u32 = 0x0400_0000;

/// A file in the folder for temporary ones, which goes when nobody has it any more.
pub(crate) fn anonymous_file(name: &str) -> io::Result<File> {
    static FILES: AtomicU32 = AtomicU32::new(0);
    let number = FILES.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("{name}-{}-{number}", std::process::id()));
    let mut options = OpenOptions::new();
    options.read(true).write(true).create_new(true).share_mode(0).custom_flags(REMOVE_AT_END).open(path)
}

/// Standard input, as the file that it is.
pub(crate) fn standard_input() -> io::Result<File> {
    Ok(File::from(io::stdin().as_handle().try_clone_to_owned()?))
}

/// The signal that ended a process: none ever does; the exit code says which exception did.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}

/// Ends this process at once.
pub(crate) fn end_at_once() {
    std::process::abort()
}

/// Time since the first question: the system counts a thread's own in steps of 16 ms, which are longer than a tick.
pub(crate) fn processor_time() -> Duration {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed()
}

/// What a process did so far: not known, so all time counts as time in which it did not want to run.
pub(crate) fn used(_: u32) -> Used {
    Used { ran: Duration::ZERO, wants: false }
}

/// What the system tells of this process and thread: nothing that is asked for yet.
pub(crate) mod state {
    use crate::validate::Seen;
    use crate::validate::untouched::Part;

    /// Says that it is not known.
    pub(crate) fn of_the_system() -> Result<Vec<Part>, Seen> {
        let looked_at =
            "of this process only environment, folder and floating-point mode are looked at on Windows";
        Err(Seen::NotOnThisSystem(looked_at.to_owned()))
    }

    /// Says that they are not counted.
    pub(crate) fn threads() -> Result<usize, Seen> {
        Err(Seen::NotOnThisSystem("threads are not counted on Windows".to_owned()))
    }

    /// Says that there is no such library.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn is_loaded_first(_: &str) -> Result<(), Seen> {
        Err(Seen::NotOnThisSystem("only Linux gives a process another allocator (LD_PRELOAD)".to_owned()))
    }
}

/// Whether a step computes and does nothing else: only a kernel of Linux can lock a thread in.
pub(crate) mod locked {
    use crate::validate::Seen;
    use flotor_hal::abi::loader::Model;
    use std::process::Command;

    /// Prepares the process of the check.
    pub(crate) fn prepare(_: &mut Command) {}

    /// Whether a process ended because a step called the system.
    pub(crate) fn has_caught(_: i32) -> bool {
        false
    }

    /// Says that it cannot be checked.
    pub(crate) fn system_calls(_: Model) -> Result<(), Seen> {
        Err(Seen::NotOnThisSystem("only Linux can tell (seccomp)".to_owned()))
    }
}
