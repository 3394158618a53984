//! Windows: performance counter, thread priorities, handlers of exceptions and `exit`. Worker processes and the watchdog process
//! are not available yet.

pub(crate) mod clock;
pub(crate) mod last_stop;
pub mod process_group;
pub(crate) mod processes;
pub(crate) mod scheduling;
pub(crate) mod shared_memory;
pub(crate) mod watchdog_process;

/// Returns the error of a worker process, which is not available on this system yet.
fn no_workers() -> std::io::Error {
    let problem = "models in worker processes are not supported on Windows yet; set `isolation = \"none\"` for the model";
    std::io::Error::new(std::io::ErrorKind::Unsupported, problem)
}

/// Returns the error of a feature that is not available on this system yet.
fn not_yet(what: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::Unsupported, format!("{what} is not supported on Windows yet"))
}
