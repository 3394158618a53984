//! Control groups of the watchdog process. An out-of-memory daemon, a container and a service manager kill all processes of a group
//! together, so this process leaves the groups of its host.
//!
//! There are two ways to leave: systemd moves the process into a scope of its own, or the process writes its id into an outer
//! group. The result is read from the kernel afterwards.

use super::super::control_group::{Group, Mount, groups};
use rustix::process::{geteuid, getpid};
use std::fs::{create_dir, read_to_string, write};
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Timeout for systemd to move a process.
const SCOPE_PATIENCE: Duration = Duration::from_secs(1);
/// Poll interval while systemd moves a process.
const SCOPE_POLL: Duration = Duration::from_millis(2);
/// Name of the group created inside an outer group that may not hold processes itself.
const OWN_GROUP: &str = "flotor-watchdog";

/// Leaves the control groups of the host; returns the path of a group that both processes still share, or `None`. Not real-time.
pub(super) fn join_separate_group(host: i32) -> Option<String> {
    let processes = Processes::with(host);
    processes.shared_group()?;
    if !join_scope(&processes) {
        processes.own().iter().filter(|group| !group.is_root()).for_each(|group| {
            let _ = move_outward(group);
        });
    }
    processes.shared_group().map(|group| group.path)
}

/// Host's process id, with the mounted hierarchies of control groups.
struct Processes {
    host: i32,
    mounts: Vec<Mount>,
}

impl Processes {
    fn with(host: i32) -> Self {
        let mounts = read_to_string("/proc/self/mountinfo").unwrap_or_default();
        Self { host, mounts: mounts.lines().filter_map(Mount::parse).collect() }
    }

    fn own(&self) -> Vec<Group> {
        left_groups(&read_to_string("/proc/self/cgroup").unwrap_or_default(), &self.mounts)
    }

    /// Returns a group of the host to which this process also belongs, directly or through an inner group.
    fn shared_group(&self) -> Option<Group> {
        let hosts = read_to_string(format!("/proc/{}/cgroup", self.host)).unwrap_or_default();
        let own = self.own();
        let is_shared = |group: &Group| own.iter().any(|inner| inner.is_inside(group));
        left_groups(&hosts, &self.mounts).into_iter().find(|group| !group.is_root() && is_shared(group))
    }
}

/// Returns the groups to leave, without those of the memory controller of version 1: its out-of-memory killer kills single
/// processes, and the memory of this process stays charged to the host's group.
fn left_groups(file: &str, mounts: &[Mount]) -> Vec<Group> {
    groups(file, mounts).into_iter().filter(|group| !group.is_of("memory")).collect()
}

/// Moves this process to the outermost enclosing group that accepts it.
fn move_outward(group: &Group) -> Option<()> {
    group.folders().iter().skip(1).rev().find_map(|outer| enter(outer).or_else(|| enter_inside(outer)))
}

/// Moves this process to a group.
fn enter(group: &Path) -> Option<()> {
    write(group.join("cgroup.procs"), "0").ok()
}

/// Moves this process to a group of its own inside another one: in version 2 a group that distributes resources has no processes.
fn enter_inside(group: &Path) -> Option<()> {
    let own = group.join(OWN_GROUP);
    match create_dir(&own) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => None,
        _ => enter(&own),
    }
}

/// Moves this process into a systemd scope of its own; returns true once it has left the host's groups.
fn join_scope(processes: &Processes) -> bool {
    let managers = if geteuid().is_root() { ["--system", "--user"] } else { ["--user", "--system"] };
    managers.iter().any(|manager| {
        let started = Instant::now();
        if !ask_for_scope(manager, started) {
            return false;
        }
        while processes.shared_group().is_some() {
            if started.elapsed() > SCOPE_PATIENCE {
                return false;
            }
            std::thread::sleep(SCOPE_POLL);
        }
        true
    })
}

/// Requests a scope from a systemd manager (`--system` or `--user`) over D-Bus; returns true if accepted in time.
fn ask_for_scope(manager: &str, started: Instant) -> bool {
    let process = getpid().as_raw_nonzero().to_string();
    let scope = format!("flotor-watchdog-{process}.scope");
    let mut command = Command::new("busctl");
    command.args([manager, "--quiet", "--allow-interactive-authorization=false", "call"]);
    command.args(["org.freedesktop.systemd1", "/org/freedesktop/systemd1"]);
    command.args(["org.freedesktop.systemd1.Manager", "StartTransientUnit", "ssa(sv)a(sa(sv))"]);
    command.args([&scope, "fail", "2", "PIDs", "au", "1", &process]);
    command.args(["CollectMode", "s", "inactive-or-failed", "0"]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let Ok(mut asking) = command.spawn() else { return false };
    loop {
        match asking.try_wait() {
            Ok(Some(status)) => return status.success(),
            Ok(None) if started.elapsed() < SCOPE_PATIENCE => std::thread::sleep(SCOPE_POLL),
            _ => {
                let _ = asking.kill();
                let _ = asking.wait();
                return false;
            }
        }
    }
}
