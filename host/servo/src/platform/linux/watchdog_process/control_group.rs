//! The control groups of the watchdog process: an out-of-memory daemon, a container and a service manager kill all processes of a
//! group together, so this process leaves the groups of its host.
//!
//! Two ways lead out: systemd moves the process into a scope of its own, and the process writes its number into an outer group.
//! Whether one did is read from the kernel afterwards.

use rustix::process::{geteuid, getpid};
use std::fs::{create_dir, read_to_string, write};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How long systemd may take to move a process.
const SCOPE_PATIENCE: Duration = Duration::from_secs(1);
/// Poll interval while it does.
const SCOPE_POLL: Duration = Duration::from_millis(2);
/// Name of the group that is made inside an outer group whose own processes are not allowed.
const OWN_GROUP: &str = "flotor-watchdog";

/// Leaves the control groups of the host; returns one that both processes are still in. Not real-time.
pub(super) fn leave_those_of(host: i32) -> Option<String> {
    let processes = Processes::with(host);
    processes.shared_group()?;
    if !join_scope(&processes) {
        processes.own().iter().filter(|group| !group.is_root()).for_each(|group| {
            let _ = group.leave();
        });
    }
    processes.shared_group().map(|group| group.path)
}

/// The host and this process.
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
        groups(&read_to_string("/proc/self/cgroup").unwrap_or_default(), &self.mounts)
    }

    /// A group of the host that this process is in as well, itself or through a group inside.
    fn shared_group(&self) -> Option<Group> {
        let hosts = read_to_string(format!("/proc/{}/cgroup", self.host)).unwrap_or_default();
        let own = self.own();
        let is_shared = |group: &Group| own.iter().any(|inner| inner.is_inside(group));
        groups(&hosts, &self.mounts).into_iter().find(|group| !group.is_root() && is_shared(group))
    }
}

/// A control group of a process.
struct Group {
    /// The controllers, or the name of the hierarchy; empty for version 2.
    hierarchy: String,
    path: String,
    mount: Option<Mount>,
}

/// The groups in `/proc/PID/cgroup`. Those of the memory controller of version 1 stay: its killer ends single processes, and the
/// memory of this process counts where that of the host does.
fn groups(file: &str, mounts: &[Mount]) -> Vec<Group> {
    let group = |line: &str| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (hierarchy, path) = (fields.next()?.to_owned(), fields.next()?.to_owned());
        let mount = mounts.iter().find(|mount| mount.holds(&hierarchy)).cloned();
        Some(Group { hierarchy, path, mount })
    };
    let is_left = |group: &Group| !group.hierarchy.split(',').any(|controller| controller == "memory");
    file.lines().filter_map(group).filter(is_left).collect()
}

impl Group {
    /// Whether nothing is outside of it: nobody kills the root of a hierarchy. The root of a container's own view is none.
    fn is_root(&self) -> bool {
        self.path == "/" && self.mount.as_ref().is_none_or(Mount::is_whole)
    }

    fn is_inside(&self, outer: &Self) -> bool {
        self.hierarchy == outer.hierarchy && Path::new(&self.path).starts_with(&outer.path)
    }

    /// Moves this process to the outermost group that takes it.
    fn leave(&self) -> Option<()> {
        let mount = self.mount.as_ref()?;
        let inner = Path::new(&self.path).strip_prefix(&mount.root).ok()?;
        let outer: Vec<_> = inner.ancestors().skip(1).map(|outer| mount.folder.join(outer)).collect();
        outer.iter().rev().find_map(|outer| enter(outer).or_else(|| enter_inside(outer)))
    }
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

/// Lets systemd move this process into a scope of its own; whether it is out of the host's groups then.
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

/// Asks a manager of systemd over its bus; whether it has accepted in time.
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

/// Where a hierarchy of control groups is mounted.
#[derive(Clone)]
struct Mount {
    /// The group at the folder, as this process sees it.
    root: String,
    folder: PathBuf,
    /// As in [`Group::hierarchy`]: several, of which one is the hierarchy's.
    options: Vec<String>,
    is_second_version: bool,
}

impl Mount {
    /// A line of `/proc/self/mountinfo`.
    fn parse(line: &str) -> Option<Self> {
        let (mount, system) = line.split_once(" - ")?;
        let mut mount = mount.split(' ').skip(3);
        let (root, folder) = (mount.next()?.to_owned(), PathBuf::from(mount.next()?));
        let system: Vec<&str> = system.split(' ').collect();
        let is_second_version = match *system.first()? {
            "cgroup2" => true,
            "cgroup" => false,
            _ => return None,
        };
        let options = system.last()?.split(',').map(str::to_owned).collect();
        Some(Self { root, folder, options, is_second_version })
    }

    fn holds(&self, hierarchy: &str) -> bool {
        match hierarchy {
            "" => self.is_second_version,
            _ => {
                let mut controllers = hierarchy.split(',');
                !self.is_second_version
                    && controllers.all(|controller| self.options.iter().any(|option| option == controller))
            }
        }
    }

    /// Whether the folder is the root of the whole hierarchy, which has no events of its own in version 2 and the only agent in
    /// version 1.
    fn is_whole(&self) -> bool {
        match self.is_second_version {
            true => !self.folder.join("cgroup.events").exists(),
            false => self.folder.join("release_agent").exists(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOUNTS: &str = "\
        30 24 0:26 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw,nsdelegate\n\
        31 24 0:27 / /sys/fs/cgroup/cpu,cpuacct rw,relatime shared:9 - cgroup cgroup rw,cpu,cpuacct\n\
        32 24 0:28 / /sys/fs/cgroup/systemd rw,relatime shared:9 - cgroup cgroup rw,name=systemd\n\
        33 24 0:29 / /sys/fs/cgroup/memory rw,relatime shared:9 - cgroup cgroup rw,memory\n\
        34 24 0:30 / / rw,relatime - ext4 /dev/sda1 rw\n";

    fn of(file: &str) -> Vec<Group> {
        let mounts: Vec<_> = MOUNTS.lines().filter_map(Mount::parse).collect();
        groups(file, &mounts)
    }

    #[test]
    fn each_group_is_found_where_its_hierarchy_is_mounted() {
        let found =
            of("4:memory:/m\n3:name=systemd:/a.slice/b.scope\n2:cpu,cpuacct:/c\n0::/a.slice/b.scope\n");
        let folder = |group: &Group| group.mount.as_ref().map(|mount| mount.folder.display().to_string());
        let found: Vec<_> = found.iter().map(|group| (group.path.as_str(), folder(group))).collect();
        let folders = ["systemd", "cpu,cpuacct", "unified"].map(|name| format!("/sys/fs/cgroup/{name}"));
        let paths = ["/a.slice/b.scope", "/c", "/a.slice/b.scope"];
        assert_eq!(found, paths.into_iter().zip(folders.map(Some)).collect::<Vec<_>>());
    }

    #[test]
    fn a_group_inside_ends_with_its_outer_group_and_a_sibling_does_not() {
        let host = of("0::/a/b\n");
        for (own, is_inside) in
            [("0::/a/b", true), ("0::/a/b/c", true), ("0::/a/bc", false), ("0::/a", false)]
        {
            assert_eq!(of(own)[0].is_inside(&host[0]), is_inside, "{own}");
        }
        assert!(!of("2:cpu,cpuacct:/a/b\n")[0].is_inside(&host[0]), "another hierarchy");
    }
}
