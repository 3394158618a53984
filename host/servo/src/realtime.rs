//! Asks the system for a quiet place for the loop, and says aloud what it refused.

use crate::guest::is_guest;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{Error, ThreadPriority, ThreadPriorityValue};

/// Priority of the loop: below the kernel's own threads (99), above everything ordinary.
const LOOP_PRIORITY: u8 = 80;
/// Priority of a model in a process of its own: below the loop, which waits for it but not for ever.
const WORKER_PRIORITY: u8 = 79;
/// Priority of the watchdog: above the loop, which it has to interrupt.
pub(super) const WATCHDOG_PRIORITY: u8 = 81;

/// A core of the machine, by the number the system gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Core(usize);

impl Core {
    /// The core of this number; `None` beyond what the system can name. Whether the machine has it shows when it is asked for.
    #[must_use]
    pub const fn new(number: usize) -> Option<Self> {
        if number < CpuSet::MAX_CPU { Some(Self(number)) } else { None }
    }
}

impl std::fmt::Display for Core {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Whether the system granted something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Privilege {
    /// Granted.
    Granted,
    /// Refused: the system's reason.
    Refused(String),
    /// Not asked for.
    NotAsked,
}

impl Privilege {
    fn of<E: std::fmt::Display>(result: Result<(), E>) -> Self {
        match result {
            Ok(()) => Self::Granted,
            Err(error) => Self::Refused(error.to_string()),
        }
    }
}

/// What the loop runs with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RealTimeReport {
    /// Real-time scheduling (`SCHED_FIFO`).
    pub fifo: Privilege,
    /// Memory locked against paging.
    pub memory_lock: Privilege,
    /// The core that was named for the loop.
    pub core: Privilege,
}

impl RealTimeReport {
    /// A loop that asks for nothing: on the virtual clock there is no time to keep.
    #[must_use]
    pub fn not_asked() -> Self {
        Self { fifo: Privilege::NotAsked, memory_lock: Privilege::NotAsked, core: Privilege::NotAsked }
    }

    /// One line per refusal: what, why, and how to allow it.
    #[must_use]
    pub fn advice(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Privilege::Refused(reason) = &self.fifo {
            lines.push(format!(
                "no real-time priority ({reason}): expect late ticks; allow it with `@realtime - rtprio 99` in \
                 /etc/security/limits.conf, or `setcap cap_sys_nice+ep` on the executable"
            ));
        }
        if let Privilege::Refused(reason) = &self.memory_lock {
            lines.push(format!(
                "memory is not locked ({reason}): paging may delay a tick; allow it with \
                 `@realtime - memlock unlimited` in /etc/security/limits.conf"
            ));
        }
        if let Privilege::Refused(reason) = &self.core {
            lines.push(format!(
                "{reason}; the loop is not pinned to a core. Name one that this process may use: `grep Cpus_allowed_list \
                 /proc/self/status` lists them"
            ));
        }
        lines
    }
}

/// Asks for real-time priority for the calling thread, and for a core if one is named, and locks the process's memory. Not
/// real-time.
pub fn enter_real_time(core: Option<Core>) -> RealTimeReport {
    // The memory of another program is its own: locked, its next allocation might fail.
    let memory_lock = match is_guest() {
        true => Privilege::NotAsked,
        false => Privilege::of(mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)),
    };
    let core = core.map_or(Privilege::NotAsked, |core| Privilege::of(pin(core)));
    RealTimeReport { fifo: enter_priority(LOOP_PRIORITY), memory_lock, core }
}

/// Keeps the calling thread on one core; the process's other threads go where they did.
fn pin(Core(number): Core) -> Result<(), String> {
    let mut set = CpuSet::new();
    set.set(number);
    // Of the calling thread: the system refuses nothing else.
    sched_setaffinity(None, &set)
        .map_err(|_| format!("--core {number}: there is no such core, or this process may not use it"))
}

/// Asks for the priority of a worker for the calling thread. Not real-time; without it the worker is only slower.
pub fn enter_worker_priority() {
    let _ = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
    let _ = enter_priority(WORKER_PRIORITY);
}

/// Asks for the priority of who stops devices in the end, for the calling thread. Not real-time; without it, best effort.
pub fn enter_guard_priority() {
    let _ = enter_priority(WATCHDOG_PRIORITY);
}

/// Asks for a real-time priority for the calling thread. Not real-time.
pub(super) fn enter_priority(priority: u8) -> Privilege {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let granted =
        ThreadPriorityValue::try_from(priority).map_err(|error| error.to_string()).and_then(|value| {
            set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
                .map_err(|error| match error {
                    Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
                    other => other.to_string(),
                })
        });
    Privilege::of(granted)
}

/// Asks on a thread of its own, so that the caller's priority stays what it is. Not real-time.
pub fn probe_real_time() -> RealTimeReport {
    let asked = std::thread::spawn(|| {
        let report = enter_real_time(None);
        let _ = rustix::mm::munlockall();
        report
    });
    asked.join().unwrap_or_else(|_| RealTimeReport::not_asked())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cores the calling thread may use, as the system lists them.
    fn allowed() -> String {
        let status = std::fs::read_to_string("/proc/thread-self/status").expect("Linux has it");
        let line = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
        line.expect("it is in there").trim().to_owned()
    }

    #[test]
    fn a_thread_goes_to_the_core_that_is_named_and_no_other_thread_with_it() {
        let before = allowed();
        let first = before.split([',', '-']).next().and_then(|number| number.parse().ok());
        let core = first.and_then(Core::new).expect("there is a core");
        let pinned = std::thread::spawn(move || (pin(core), allowed())).join().expect("it does not panic");
        assert_eq!((pinned, allowed()), ((Ok(()), core.to_string()), before));
    }

    #[test]
    fn a_core_that_is_not_there_is_refused_aloud() {
        let core = Core::new(CpuSet::MAX_CPU - 1).expect("the last that can be named");
        let refused = std::thread::spawn(move || Privilege::of(pin(core))).join().expect("it does not panic");
        let report = RealTimeReport { core: refused, ..RealTimeReport::not_asked() };
        let told = format!(
            "--core {core}: there is no such core, or this process may not use it; the loop is not pinned to a"
        );
        assert!(report.advice().concat().starts_with(&told), "{report:?}");
        assert_eq!(Core::new(CpuSet::MAX_CPU), None);
    }
}
