//! Linux: anonymous files, signals, processor time of threads, seccomp.

pub(crate) mod locked;
pub(crate) mod state;

use super::process::Used;
use rustix::fs::{MemfdFlags, memfd_create};
use rustix::process::{Signal, getpid, kill_process};
use rustix::time::{ClockId, clock_gettime};
use std::fs::File;
use std::io;
use std::os::fd::AsFd;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Duration;

/// Unit of processor times under /proc: `USER_HZ` is 100 on every Linux.
const CLOCK_TICK: Duration = Duration::from_millis(10);

/// Creates an anonymous file in memory.
pub(crate) fn anonymous_file(name: &str) -> io::Result<File> {
    Ok(File::from(memfd_create(name, MemfdFlags::CLOEXEC)?))
}

/// Returns standard input as a file.
pub(crate) fn standard_input() -> io::Result<File> {
    Ok(File::from(io::stdin().as_fd().try_clone_to_owned()?))
}

/// Returns the signal that ended a process, if any.
pub(crate) fn ending_signal(end: ExitStatus) -> Option<i32> {
    end.signal()
}

/// Ends this process at once, by a signal that cannot be caught.
pub(crate) fn end_at_once() {
    kill_process(getpid(), Signal::KILL).ok();
}

/// Returns the processor time of this thread; time of other threads does not count.
pub(crate) fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    Duration::try_from(now).unwrap_or_default()
}

/// Returns the processor time of a process, with the state of its threads: running, runnable, or waiting for a disk or a
/// page.
pub(crate) fn used(process: u32) -> Used {
    let fields_of = |path: String| -> Vec<String> {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        text.rsplit(')').next().unwrap_or_default().split_whitespace().map(str::to_owned).collect()
    };
    // Fields 14 and 15 of proc(5), user and system time; after the name comes the state, field 3.
    let fields = fields_of(format!("/proc/{process}/stat"));
    let ticks = |field: usize| fields.get(field - 3).and_then(|text| text.parse::<u32>().ok()).unwrap_or(0);
    let mut threads = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let wants = threads.any(|thread| {
        let state = fields_of(thread.path().join("stat").display().to_string());
        // Running or runnable; waiting for a disk or a page.
        state.first().is_some_and(|state| matches!(state.as_str(), "R" | "D"))
    });
    Used { ran: CLOCK_TICK * ticks(14).saturating_add(ticks(15)), wants }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::patience::wait;
    use flotor_session::PluginProcess;
    use std::process::Command;

    fn shell(script: &str) -> PluginProcess {
        PluginProcess::start(Command::new("sh").args(["-c", script])).expect("there is a shell")
    }

    #[test]
    fn one_that_runs_and_one_that_sleeps_for_ever_are_ended() {
        for endless in ["while :; do :; done", "exec sleep 600", "kill -STOP $$"] {
            let mut child = shell(endless);
            let outcome = wait(&mut child, Duration::from_millis(100)).expect("it can be ended");
            assert!(outcome.is_none(), "{endless}: {outcome:?}");
        }
    }

    #[test]
    fn one_that_ends_is_waited_for() {
        let outcome = wait(&mut shell("exit 7"), Duration::from_secs(60)).expect("it can be waited for");
        assert_eq!(outcome.and_then(|end| end.status.code()), Some(7));
    }

    #[test]
    fn the_time_of_the_processor_is_told() {
        let script = "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done";
        let outcome = wait(&mut shell(script), Duration::from_secs(60)).expect("it can be waited for");
        let ran = outcome.expect("it ends").ran;
        assert!(ran > Duration::ZERO && ran < Duration::from_secs(60), "{ran:?}");
    }
}
