//! Priorities, cores and locked memory.

use super::group_limits::file_without_real_time;
use crate::platform::Duty;
use rustix::fs::readlink;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_setaffinity};
use std::path::Path;
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{Error, ThreadPriority, ThreadPriorityValue};

/// Advice for users if the system refuses a thread or a process.
pub const THREAD_ADVICE: &str =
    "end other programs of this user, or raise its limit (`ulimit -u`, or `pids.max` of its control group)";

/// Returns advice for users to allow the priority of a loop. Not real-time.
pub(crate) fn priority_advice() -> String {
    file_without_real_time().map_or_else(|| PRIORITY_ADVICE.to_owned(), |file| real_time_budget_advice(&file))
}

/// Returns advice for users to get real-time priority if the control group of `file` leaves real-time threads no processor time.
#[must_use]
pub fn real_time_budget_advice(file: &Path) -> String {
    let file = file.display();
    format!(
        "the control group has no budget for real-time threads, which every other permission requires: as root \
         `echo 950000 > {file}`, then the same for each inner group (`docker run --cpu-rt-runtime=950000`), or \
         start the run outside the group"
    )
}

/// Exclusive upper limit of the core numbers that the system can address.
pub(crate) const MAX_CORES: usize = CpuSet::MAX_CPU;

/// System's name for the scheduling of the loop thread.
pub const PRIORITY_NAME: &str = "SCHED_FIFO";
/// Advice for users to allow real-time priority, for the case that no control group prevents it.
const PRIORITY_ADVICE: &str = "allow it with `@realtime - rtprio 99` in /etc/security/limits.conf, or `setcap \
                                   cap_sys_nice+ep` on the executable";
/// Advice for users to allow locked memory.
pub(crate) const MEMORY_ADVICE: &str =
    "allow it with `@realtime - memlock unlimited` in /etc/security/limits.conf";
/// Advice for users to find the cores that a process may use.
pub(crate) const CORE_ADVICE: &str = "`grep Cpus_allowed_list /proc/self/status` lists them";

/// Priority of the loop: below the kernel's own threads (99), above all ordinary threads.
const LOOP_PRIORITY: u8 = 80;

/// Name of the initial user namespace, a constant of the kernel's interface.
const FIRST_USER_NAMESPACE: &[u8] = b"user:[4026531837]";

/// Locks the current memory of the process, and future memory unless a limit could then make allocations fail. `None` on a system
/// that cannot lock a process. Not real-time.
///
/// # Errors
/// If the system call fails.
pub(crate) fn lock_memory() -> Option<Result<(), String>> {
    let future = if may_lock_any_memory() { MlockAllFlags::FUTURE } else { MlockAllFlags::empty() };
    Some(mlockall(MlockAllFlags::CURRENT | future).map_err(|error| error.to_string()))
}

/// Returns true if no limit on locked memory applies to this process. The capability `CAP_IPC_LOCK` lifts the limit in the initial
/// user namespace only.
fn may_lock_any_memory() -> bool {
    let is_first = || {
        readlink("/proc/self/ns/user", Vec::new()).is_ok_and(|name| name.as_bytes() == FIRST_USER_NAMESPACE)
    };
    let is_capable = || capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    getrlimit(Resource::Memlock).current.is_none() || is_capable() && is_first()
}

/// Unlocks the memory of the process. Not real-time.
pub(crate) fn unlock_memory() {
    let _ = rustix::mm::munlockall();
}

/// Pins the calling thread to the core with number `core`; other threads of the process are not affected. Not real-time.
///
/// # Errors
/// If there is no such core, or the process may not use it.
pub(crate) fn pin(core: usize) -> std::io::Result<()> {
    let mut set = CpuSet::new();
    set.set(core);
    Ok(sched_setaffinity(None, &set)?)
}

/// Requests the priority of a role for the calling thread. Not real-time.
///
/// # Errors
/// If the system refuses, with its reason.
pub(crate) fn enter_priority(duty: Duty) -> Result<(), String> {
    let priority = match duty {
        Duty::Worker => LOOP_PRIORITY - 1,
        Duty::Loop => LOOP_PRIORITY,
        Duty::Watchdog => LOOP_PRIORITY + 1,
    };
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let value = ThreadPriorityValue::try_from(priority)?;
    let entered =
        set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy);
    entered.map_err(|error| match error {
        Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
        other => other.to_string(),
    })
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
        let first = before.split([',', '-']).next().and_then(|number| number.parse::<usize>().ok());
        let core = first.expect("there is a core");
        let pinned =
            std::thread::spawn(move || (pin(core).is_ok(), allowed())).join().expect("it does not panic");
        assert_eq!((pinned, allowed()), ((true, core.to_string()), before));
    }
}
