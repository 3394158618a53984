//! Real-time privileges of threads: priority, pinning to a core and locked memory, with a report on refusals.

use crate::guest::is_guest;
use crate::platform::Duty;
use crate::platform::scheduling::{
    self, CORE_ADVICE, MAX_CORES, MEMORY_ADVICE, THREAD_ADVICE, priority_advice,
};

/// Processor core, by its number in the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Core(usize);

impl Core {
    /// Returns the core with this number; `None` for a number that the system cannot address. Pinning fails if the machine lacks
    /// the core.
    #[must_use]
    pub const fn new(number: usize) -> Option<Self> {
        if number < MAX_CORES { Some(Self(number)) } else { None }
    }
}

impl std::fmt::Display for Core {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Outcome of a request for a privilege.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Privilege {
    /// Granted by the system.
    Granted,
    /// Refused, with the system's reason.
    Refused(String),
    /// Not requested.
    #[default]
    NotRequested,
}

impl Privilege {
    fn of<E: std::fmt::Display>(result: Result<(), E>) -> Self {
        match result {
            Ok(()) => Self::Granted,
            Err(error) => Self::Refused(error.to_string()),
        }
    }
}

/// Outcomes of the loop's requests for real-time privileges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealTimeReport {
    /// Real-time scheduling, [`PRIORITY_NAME`](crate::PRIORITY_NAME).
    pub fifo: Privilege,
    /// Lock of the process's memory against paging.
    pub memory_lock: Privilege,
    /// Pinning of the loop thread to a core.
    pub core: Privilege,
}

impl RealTimeReport {
    /// Returns a report on a loop without requests, as on the virtual clock.
    #[must_use]
    pub fn not_requested() -> Self {
        Self::default()
    }

    /// Returns one line per refusal: privilege, reason and remedy.
    #[must_use]
    pub fn advice(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Privilege::Refused(reason) = &self.fifo {
            lines.push(format!("no real-time priority ({reason}): expect late ticks; {}", priority_advice()));
        }
        if let Privilege::Refused(reason) = &self.memory_lock {
            lines.push(format!("memory is not locked ({reason}): paging may delay a tick; {MEMORY_ADVICE}"));
        }
        if let Privilege::Refused(reason) = &self.core {
            lines.push(format!(
                "{reason}; the loop is not pinned to a core. Name a core that this process may use: {CORE_ADVICE}"
            ));
        }
        lines
    }
}

/// Requests real-time priority for the calling thread, pins the thread to `core` if given, and locks the memory of the process
/// except in a guest; returns the outcomes. Not real-time.
pub fn enter_real_time(core: Option<Core>) -> RealTimeReport {
    let memory_lock = lock_own_memory();
    let core = core.map_or(Privilege::NotRequested, |core| Privilege::of(pin(core)));
    RealTimeReport { fifo: enter_priority(Duty::Loop), memory_lock, core }
}

/// Pins the calling thread to one core; other threads of the process are not affected.
fn pin(Core(number): Core) -> Result<(), String> {
    scheduling::pin(number)
        .map_err(|_| format!("--core {number}: the machine lacks this core, or this process may not use it"))
}

/// Locks the memory of the process, except in a guest: its memory belongs to another program, whose next allocation might fail.
fn lock_own_memory() -> Privilege {
    match is_guest() {
        true => Privilege::NotRequested,
        false => scheduling::lock_memory().map_or(Privilege::NotRequested, Privilege::of),
    }
}

/// Locks the memory of the process as [`enter_real_time`] does, and requests the priority of a worker, just below the loop, for the
/// calling thread. Refusals are ignored: the worker is then only slower. Not real-time.
pub fn enter_worker_priority() {
    let _ = lock_own_memory();
    let _ = enter_priority(Duty::Worker);
}

/// Requests the priority of a watchdog, above the loop if possible, for the calling thread. A refusal is ignored. Not real-time.
pub fn enter_guard_priority() {
    let _ = enter_priority(Duty::Watchdog);
}

/// Requests a priority for the calling thread. Not real-time.
fn enter_priority(duty: Duty) -> Privilege {
    Privilege::of(scheduling::enter_priority(duty))
}

/// Requests the privileges of [`enter_real_time`] in a new thread, so that the caller's priority does not change; unlocks the
/// memory of the process and returns the outcomes. Not real-time.
pub fn probe_real_time() -> RealTimeReport {
    let asked = std::thread::Builder::new().spawn(|| {
        let report = enter_real_time(None);
        scheduling::unlock_memory();
        report
    });
    match asked {
        Ok(asked) => asked.join().unwrap_or_else(|_| RealTimeReport::not_requested()),
        Err(cause) => {
            let refused = || Privilege::Refused(format!("cannot start a thread: {cause}; {THREAD_ADVICE}"));
            RealTimeReport { fifo: refused(), memory_lock: refused(), core: Privilege::NotRequested }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_that_is_not_there_is_refused_aloud() {
        let core = Core::new(MAX_CORES - 1).expect("the last that can be named");
        let refused = std::thread::spawn(move || Privilege::of(pin(core))).join().expect("it does not panic");
        let report = RealTimeReport { core: refused, ..RealTimeReport::not_requested() };
        let told = format!(
            "--core {core}: the machine lacks this core, or this process may not use it; the loop is not pinned to a"
        );
        assert!(report.advice().concat().starts_with(&told), "{report:?}");
        assert_eq!(Core::new(MAX_CORES), None);
    }
}
