//! Resource limits of the control groups (cgroups) of this process, each from the group with the tightest limit.

use super::control_group::{Group, Mount, groups};
use std::fs::read_to_string;
use std::path::{Path, PathBuf};

/// Resource limit of a control group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupLimit {
    /// File of the group that sets the limit.
    pub file: PathBuf,
    /// Kind and value of the limit.
    pub value: LimitValue,
}

/// Kind and value of a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimitValue {
    /// Fraction of the processor time that real-time threads of the group may use; at zero the system refuses real-time priority.
    RealTimeShare(f64),
    /// Processor time that the group may use per time, in cores.
    Cores(f64),
    /// Number of cores that the group may use.
    CoreCount(usize),
    /// Memory, bytes, above which the system kills processes of the group.
    Memory(Use),
    /// Memory, bytes, above which the system delays processes of the group.
    DelayingMemory(Use),
    /// Number of threads of the group.
    Threads(Use),
}

/// Limit with its current use, bytes of memory or number of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Use {
    /// Limit, bytes or threads.
    pub most: u64,
    /// Current use, bytes or threads.
    pub now: u64,
}

/// Smallest value, bytes, that means no limit in version 1, for any page size.
const NO_MEMORY_LIMIT: u64 = 1 << 62;

/// Returns the limits that bind this process through its control groups, from the files below `root`. Not real-time.
#[must_use]
pub fn group_limits(root: &Path) -> Vec<GroupLimit> {
    let file = |name: &str| read_to_string(root.join("proc/self").join(name)).unwrap_or_default();
    let mounts: Vec<Mount> = file("mountinfo").lines().filter_map(Mount::parse).collect();
    let below_root = |folder: PathBuf| root.join(folder.strip_prefix("/").unwrap_or(&folder));
    let groups = groups(&file("cgroup"), &mounts);
    let folders: Vec<PathBuf> = groups.iter().flat_map(Group::folders).map(below_root).collect();
    let readers: [Reader; 6] = [real_time_share, cores, core_count, memory, delaying_memory, threads];
    readers.into_iter().filter_map(|read| tightest(&folders, read)).collect()
}

/// Returns the file of a control group whose budget for real-time threads of this process is zero, so that the system refuses
/// real-time priority; `None` if there is no such group. Not real-time.
pub(crate) fn file_without_real_time() -> Option<PathBuf> {
    let is_none = |limit: &GroupLimit| limit.value == LimitValue::RealTimeShare(0.0);
    group_limits(Path::new("/")).into_iter().find(is_none).map(|limit| limit.file)
}

/// Reader of a limit of the group in a folder: returns the name of the file that sets the limit, and the value.
type Reader = fn(&Path) -> Option<(&'static str, LimitValue)>;

/// Returns the limit with the least unused part; of equal limits the outermost, because raising only an inner limit would have no effect.
fn tightest(folders: &[PathBuf], read: Reader) -> Option<GroupLimit> {
    let limits = folders.iter().rev().filter_map(|folder| {
        let (file, value) = read(folder)?;
        Some(GroupLimit { file: folder.join(file), value })
    });
    limits.min_by(|a, b| a.value.room().total_cmp(&b.value.room()))
}

impl LimitValue {
    /// Returns the unused part of a limit with a current use, else the limit itself; only for comparing limits of one kind.
    #[allow(clippy::cast_precision_loss)] // only compared
    fn room(&self) -> f64 {
        match *self {
            Self::RealTimeShare(share) | Self::Cores(share) => share,
            Self::CoreCount(cores) => cores as f64,
            Self::Memory(Use { most, now })
            | Self::DelayingMemory(Use { most, now })
            | Self::Threads(Use { most, now }) => most.saturating_sub(now) as f64,
        }
    }
}

fn text(folder: &Path, name: &str) -> Option<String> {
    read_to_string(folder.join(name)).ok().map(|text| text.trim().to_owned())
}

fn number<T: std::str::FromStr>(folder: &Path, name: &str) -> Option<T> {
    text(folder, name)?.parse().ok()
}

fn real_time_share(folder: &Path) -> Option<(&'static str, LimitValue)> {
    let file = "cpu.rt_runtime_us";
    let (runtime_us, period_us): (f64, f64) = (number(folder, file)?, number(folder, "cpu.rt_period_us")?);
    (runtime_us >= 0.0).then_some((file, LimitValue::RealTimeShare(runtime_us / period_us)))
}

fn cores(folder: &Path) -> Option<(&'static str, LimitValue)> {
    if let Some(both) = text(folder, "cpu.max") {
        let (quota_us, period_us) = both.split_once(' ')?;
        let cores = quota_us.parse::<f64>().ok()? / period_us.parse::<f64>().ok()?;
        return Some(("cpu.max", LimitValue::Cores(cores)));
    }
    let file = "cpu.cfs_quota_us";
    let (quota_us, period_us): (f64, f64) = (number(folder, file)?, number(folder, "cpu.cfs_period_us")?);
    (quota_us > 0.0).then_some((file, LimitValue::Cores(quota_us / period_us)))
}

fn core_count(folder: &Path) -> Option<(&'static str, LimitValue)> {
    let files = [("cpuset.cpus", "cpuset.cpus.effective"), ("cpuset.cpus", "cpuset.effective_cpus")];
    let (file, list) =
        files.into_iter().find_map(|(file, effective)| Some((file, text(folder, effective)?)))?;
    let count = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(last.parse::<usize>().ok()?.checked_sub(first.parse().ok()?)? + 1)
    };
    Some((file, LimitValue::CoreCount(list.split(',').map(count).sum::<Option<usize>>()?)))
}

fn memory(folder: &Path) -> Option<(&'static str, LimitValue)> {
    if let Some(most) = number(folder, "memory.max") {
        let now = number(folder, "memory.current")?;
        return Some(("memory.max", LimitValue::Memory(Use { most, now })));
    }
    let file = "memory.limit_in_bytes";
    let most: u64 = number(folder, file)?;
    let now = number(folder, "memory.usage_in_bytes")?;
    (most < NO_MEMORY_LIMIT).then_some((file, LimitValue::Memory(Use { most, now })))
}

fn delaying_memory(folder: &Path) -> Option<(&'static str, LimitValue)> {
    let most = number(folder, "memory.high")?;
    let now = number(folder, "memory.current")?;
    Some(("memory.high", LimitValue::DelayingMemory(Use { most, now })))
}

fn threads(folder: &Path) -> Option<(&'static str, LimitValue)> {
    let most = number(folder, "pids.max")?;
    Some(("pids.max", LimitValue::Threads(Use { most, now: number(folder, "pids.current")? })))
}
