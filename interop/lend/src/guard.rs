//! Guard process between `flotor lend` and the program: starts the program, reports its end, and kills the rest of its process group
//! when the program or `flotor lend` ends, for any reason.
//!
//! The guard is a subreaper: it becomes the parent of orphaned descendants, so that it finds them all. A descendant that has moved to
//! a process group of its own, as a daemon does, keeps running and is reported.

use clap::Args;
use flotor_command::{CommandError, note, stopping};
use flotor_servo::platform::process_group::end_with_this_thread;
use flotor_servo::platform::{block_signals, wait_for_signal};
use rustix::process::{
    Pid, Signal, WaitOptions, getpgrp, getpid, getppid, kill_process, set_child_subreaper,
    set_parent_process_death_signal, wait,
};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fmt::{self, Display, Formatter};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::time::{Duration, Instant};

/// Signal that requests the guard to kill the process group; the system sends it when `flotor lend` ends.
pub(crate) const KILL_GROUP: Signal = Signal::USR1;
/// Poll interval; signals and the end of a child wake the guard at once.
const POLL: Duration = Duration::from_secs(1);
/// Pause between two attempts to kill the group.
const KILL_PAUSE: Duration = Duration::from_millis(2);
/// Timeout for killing the group; surviving processes are left running.
const KILL_PATIENCE: Duration = Duration::from_secs(5);
/// Grace period for processes outside the group to end by themselves, such as those of a run that has ended.
const GRACE: Duration = Duration::from_millis(500);

/// Command line arguments of the guard process started by `flotor lend`.
#[derive(Args)]
pub(crate) struct GuardArguments {
    /// Process id of `flotor lend`
    #[arg(long)]
    parent: i32,
    /// File for the end of the program
    #[arg(long)]
    end: PathBuf,
    /// The program and its arguments
    #[arg(last = true, required = true)]
    program: Vec<OsString>,
}

/// End of a program, as reported by its guard in a file.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct ProgramEnd {
    /// Wait status of the program.
    status: i32,
    /// Descendants of the program that have left its process group.
    pub(crate) left_running: Vec<Descendant>,
}

impl ProgramEnd {
    /// Reads the file of a guard that has ended; `None` if the guard has written none.
    pub(crate) fn read(file: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(file).ok()?).ok()
    }

    /// Creates the end of a program that was killed together with its guard; `status` is the exit status of the guard.
    pub(crate) fn of(status: ExitStatus) -> Self {
        Self { status: status.into_raw(), left_running: Vec::new() }
    }

    /// Returns the exit status of the program.
    pub(crate) fn status(&self) -> ExitStatus {
        ExitStatus::from_raw(self.status)
    }

    /// Prints a note on each process that keeps running.
    pub(crate) fn tell(&self) {
        for process in &self.left_running {
            note(format_args!("{process} has left the process group of the program, and still runs"));
        }
    }
}

/// Process that is a descendant of the guard.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Descendant {
    process: i32,
    name: String,
    #[serde(skip)]
    group: i32,
}

impl Display for Descendant {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "`{}` (process {})", self.name, self.process)
    }
}

/// Starts a program and guards it until its end; must be called while the process has only one thread.
pub(crate) fn run(arguments: &GuardArguments) -> Result<(), CommandError> {
    let failed = |cause: std::io::Error| CommandError::Failed(format!("cannot guard the program: {cause}"));
    let [program, rest @ ..] = arguments.program.as_slice() else {
        return Err(CommandError::Usage("the program to guard is missing".to_owned()));
    };
    stopping::outlive_signals();
    let signals = [Signal::TERM, Signal::CHILD, KILL_GROUP].map(Signal::as_raw);
    block_signals(&signals).map_err(failed)?;
    set_child_subreaper(Some(getpid())).map_err(|cause| failed(cause.into()))?;
    set_parent_process_death_signal(Some(KILL_GROUP)).map_err(|cause| failed(cause.into()))?;
    let is_orphaned = || getppid() != Pid::from_raw(arguments.parent);
    if is_orphaned() {
        return Ok(());
    }
    let mut command = Command::new(program);
    end_with_this_thread(command.args(rest));
    // This process always blocks these signals: a pending signal would end it.
    let child = command.spawn().map_err(|cause| {
        let name = program.display();
        CommandError::Failed(format!(
            "`{name}` cannot be started: {cause}; check its processor architecture, and that its interpreter exists"
        ))
    })?;
    let program = Pid::from_child(&child);
    let mut status = None;
    while status.is_none() && !is_orphaned() {
        match wait_for_signal(&signals, POLL) {
            Some(signal) if signal == KILL_GROUP.as_raw() => break,
            // Only `collect` reaps the program, so its process id is still valid here.
            Some(signal) if signal == Signal::TERM.as_raw() => drop(kill_process(program, Signal::TERM)),
            _ => {}
        }
        status = collect(program);
    }
    let left_running = kill_group(program, &mut status);
    let end = ProgramEnd { status: status.unwrap_or(Signal::KILL.as_raw()), left_running };
    if is_orphaned() {
        end.tell();
    }
    let text = serde_json::to_vec(&end).map_err(|error| CommandError::Failed(error.to_string()))?;
    std::fs::write(&arguments.end, text)
        .map_err(|cause| CommandError::file(&arguments.end, "cannot be written", cause))
}

/// Reaps the children that have ended; returns the wait status of the program if it is among them.
fn collect(program: Pid) -> Option<i32> {
    let ended = std::iter::from_fn(|| wait(WaitOptions::NOHANG).ok().flatten());
    ended.filter(|(child, _)| *child == program).map(|(_, status)| status.as_raw()).last()
}

/// Kills all descendants in the process group of this process, and returns the descendants in other groups, after a grace period for
/// their end.
fn kill_group(program: Pid, status: &mut Option<i32>) -> Vec<Descendant> {
    let (group, since) = (getpgrp().as_raw_nonzero().get(), Instant::now());
    loop {
        *status = status.take().or(collect(program));
        let (members, others): (Vec<_>, Vec<_>) =
            descendants().into_iter().partition(|process| process.group == group);
        let limit = if others.is_empty() { Duration::ZERO } else { GRACE };
        if members.is_empty() && since.elapsed() >= limit || since.elapsed() > KILL_PATIENCE {
            return others;
        }
        for member in members.iter().filter_map(|member| Pid::from_raw(member.process)) {
            let _ = kill_process(member, Signal::KILL);
        }
        std::thread::sleep(KILL_PAUSE);
    }
}

/// Returns the descendants of this process that have not ended.
fn descendants() -> Vec<Descendant> {
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let stats = entries.filter_map(|entry| std::fs::read_to_string(entry.path().join("stat")).ok());
    let mut others: Vec<(i32, Descendant)> = stats.filter_map(|stat| parse(&stat)).collect();
    let mut parents = vec![getpid().as_raw_nonzero().get()];
    let mut found = Vec::new();
    while let Some(parent) = parents.pop() {
        let (children, rest): (Vec<_>, Vec<_>) = others.into_iter().partition(|(of, _)| *of == parent);
        others = rest;
        parents.extend(children.iter().map(|(_, child)| child.process));
        found.extend(children.into_iter().map(|(_, child)| child));
    }
    found
}

/// Parses `/proc/PID/stat` and returns the id of the parent and the process; `None` for a process that has ended.
fn parse(stat: &str) -> Option<(i32, Descendant)> {
    let (process, rest) = stat.split_once(" (")?;
    // The name may contain parentheses.
    let (name, rest) = rest.rsplit_once(") ")?;
    let mut fields = rest.split(' ');
    let is_running = !matches!(fields.next()?, "Z" | "X");
    let (parent, group) = (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
    is_running
        .then_some((parent, Descendant { process: process.parse().ok()?, name: name.to_owned(), group }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_a_process_is_read_whatever_its_name() {
        let (parent, process) = parse("123 (a) b (c)) S 45 67 67 0 -1").expect("it is one");
        assert_eq!(
            (parent, process.process, process.group, process.name.as_str()),
            (45, 123, 67, "a) b (c)")
        );
        assert!(parse("123 (a) Z 45 67 67 0 -1").is_none(), "it has ended");
        assert!(parse("123 (a").is_none());
    }
}
