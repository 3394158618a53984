//! Windows: the performance counter, thread priorities, what is done at the end of a process. A model in a process of its own and the
//! watchdog process are not there yet.

pub(crate) mod clock;
pub(crate) mod last_stop;
pub(crate) mod processes;
pub(crate) mod scheduling;
pub(crate) mod shared_memory;
pub(crate) mod watchdog_process;

/// What a part answers that is not on this system yet.
fn not_yet(what: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::Unsupported, format!("{what} is not on Windows yet"))
}
