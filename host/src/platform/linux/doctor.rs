//! Findings of `flotor doctor` from files of the kernel.

use crate::diagnosis::{Diagnosis, Grade};
use flotor_servo::platform::{GroupLimit, LimitValue, Use, group_limits, real_time_budget_advice};
use flotor_servo::watchdog_process::probe_shared_group;
use std::fs::read_to_string;
use std::path::Path;

/// Remedy for missing real-time priority, unless a control group refuses it.
const PRIORITY_REMEDY: &str = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - rtprio 99` in \
                /etc/security/limits.conf; then log in again";
/// Remedy for missing locked memory.
pub(crate) const MEMORY_REMEDY: &str = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - memlock unlimited` \
                in /etc/security/limits.conf; then log in again";

/// Remedy for a watchdog process that is killed with the control group of the run.
const SHARED_GROUP_REMEDY: &str = "start the run where systemd's user or system manager can be reached (`busctl --user status`), or in a \
                                   group with a writable outer group. In a service: `KillMode=mixed`, `OOMPolicy=continue`, \
                                   `ManagedOOMPreference=avoid`. In a container: end the run with a signal before the container";

/// Smallest sufficient fraction of a core for a loop with real-time priority: slightly below the kernel's default of 0.95.
const SOUND_SHARE: f64 = 0.9;
/// Number of threads and processes that a run starts, with a margin.
const NEEDED_THREADS: u64 = 32;

/// Returns the findings other than cores and privileges; reads the limits of control groups from the files below `root`.
pub(crate) fn of_the_system(root: &Path) -> Vec<Diagnosis> {
    let own = [isolated_cores(), kernel(), throttling(), governor(), killed_together(), supervision()];
    own.into_iter().chain(group_limits(root).iter().filter_map(of_limit)).collect()
}

/// Returns the remedy for missing real-time priority.
pub(crate) fn priority_remedy(root: &Path) -> String {
    let without = group_limits(root).into_iter().find(|limit| limit.value == LimitValue::RealTimeShare(0.0));
    without.map_or_else(|| PRIORITY_REMEDY.to_owned(), |limit| real_time_budget_advice(&limit.file))
}

/// Returns the remedy for a machine with one core, where the loop shares its core with all other programs.
pub(crate) fn core_remedy(root: &Path) -> String {
    let limits = group_limits(root);
    let is_one = |limit: &&GroupLimit| match limit.value {
        LimitValue::Cores(cores) => cores < 2.0,
        LimitValue::CoreCount(cores) => cores < 2,
        _ => false,
    };
    match limits.iter().find(is_one) {
        Some(limit) if !has_one_core() => {
            format!(
                "the control group allows no more cores, but the machine has more: raise `{}`",
                limit.file.display()
            )
        }
        None if !has_one_core() => {
            "the machine has more cores: start the program without `taskset`".to_owned()
        }
        _ => "use a machine with two cores or more".to_owned(),
    }
}

/// Returns true if this machine has one core.
fn has_one_core() -> bool {
    read_to_string("/sys/devices/system/cpu/online").is_ok_and(|list| list.trim() == "0")
}

/// Returns the finding on a limit of a control group, unless another finding covers it.
fn of_limit(limit: &GroupLimit) -> Option<Diagnosis> {
    let file = limit.file.display();
    Some(match limit.value {
        LimitValue::RealTimeShare(0.0) => {
            let found = format!("none in the control group (`{file}` is 0)");
            Diagnosis::bad("RT budget", found, real_time_budget_advice(&limit.file))
        }
        LimitValue::RealTimeShare(share) if share < SOUND_SHARE => Diagnosis::note(
            "RT budget",
            format!("{:.0} % of a core in the control group (`{file}`)", share * 100.0),
            "the kernel suspends a loop that needs more processor time: raise the budget",
        ),
        LimitValue::RealTimeShare(share) => {
            Diagnosis::good("RT budget", format!("{:.0} % of a core in the control group", share * 100.0))
        }
        LimitValue::Cores(cores) => {
            let found = format!("{cores:.2} cores in the control group (`{file}`)");
            let remedy = format!(
                "the kernel suspends the program whenever the quota of a period is used up, and ticks are missed; \
                 only a loop with real-time priority continues: `echo {} > {file}` as root, or without `docker run \
                 --cpus`, `CPUQuota=`",
                if limit.file.ends_with("cpu.max") { "max" } else { "-1" }
            );
            let grade = if cores < 1.0 { Grade::Bad } else { Grade::Note };
            Diagnosis::problem(grade, "CPU quota", found, remedy)
        }
        LimitValue::CoreCount(_) => return None,
        LimitValue::Memory(memory) => {
            let remedy = "the kernel ends the program when the limit is reached: raise it (`docker run --memory`, `MemoryMax=`)";
            of_memory("memory limit", memory, &limit.file, remedy)
        }
        LimitValue::DelayingMemory(memory) => {
            let remedy = "the kernel delays the program above the limit, and ticks are missed: raise it (`MemoryHigh=`)";
            of_memory("memory threshold", memory, &limit.file, remedy)
        }
        LimitValue::Threads(Use { most, now }) => {
            let found = format!("{most} in the control group (`{file}`), {now} in use");
            if most.saturating_sub(now) < NEEDED_THREADS {
                let remedy = format!(
                    "a run starts up to {NEEDED_THREADS}: raise the limit (`docker run --pids-limit`, `TasksMax=`)"
                );
                Diagnosis::bad("threads", found, remedy)
            } else {
                Diagnosis::good("threads", found)
            }
        }
    })
}

/// Returns the finding on a memory limit: bad if less than a tenth is left.
fn of_memory(what: &'static str, Use { most, now }: Use, file: &Path, remedy: &str) -> Diagnosis {
    let mib = |bytes: u64| bytes >> 20;
    let found =
        format!("{} MiB in the control group (`{}`), {} MiB in use", mib(most), file.display(), mib(now));
    Diagnosis::problem(if now > most / 10 * 9 { Grade::Bad } else { Grade::Note }, what, found, remedy)
}

/// Returns the finding on the control group of the watchdog process: bad if a kill of all processes of the host's group also kills
/// the watchdog process.
fn killed_together() -> Diagnosis {
    match probe_shared_group() {
        Ok(None) => Diagnosis::good("watchdog process", "in a control group of its own"),
        Ok(Some(group)) => Diagnosis::bad(
            "watchdog process",
            format!("in the control group `{group}` of the run: a kill of the group leaves the force on"),
            SHARED_GROUP_REMEDY,
        ),
        Err(error) => Diagnosis::bad("watchdog process", error.to_string(), "use the programs of one build"),
    }
}

/// Returns the finding on the supervisor of the process that executes plugins: a note if this process is process 1 of a container and
/// has none.
fn supervision() -> Diagnosis {
    if std::process::id() != 1 {
        return Diagnosis::good(
            "supervisor",
            "present: it reports a run that ends without a result as failed",
        );
    }
    Diagnosis::note(
        "supervisor",
        "none: process 1 of a container runs the plugins itself, because a kill of the container closes the device of process 1 alone \
         before it kills the watchdog process",
        "`flotor validate` finds a plugin that ends the process; `docker run --init` starts a supervisor, but a \
         kill of the container may then leave the force on",
    )
}

fn isolated_cores() -> Diagnosis {
    let list = read_to_string("/sys/devices/system/cpu/isolated").unwrap_or_default();
    match list.trim() {
        "" => Diagnosis::note(
            "isolated cores",
            "none",
            "on a machine with other load, boot with `isolcpus=N nohz_full=N` and start with `flotor run --core N`",
        ),
        cores => Diagnosis::good("isolated cores", cores),
    }
}

/// Returns the finding on the fraction of a core that all real-time threads may use together.
fn throttling() -> Diagnosis {
    let number = |file: &str| read_to_string(file).ok()?.trim().parse::<f64>().ok();
    let [runtime, period] =
        ["sched_rt_runtime_us", "sched_rt_period_us"].map(|name| number(&format!("/proc/sys/kernel/{name}")));
    match (runtime, period) {
        (Some(runtime), _) if runtime < 0.0 => Diagnosis::good("RT throttling", "off"),
        (Some(runtime), Some(period)) if runtime >= 0.9 * period => {
            Diagnosis::good("RT throttling", format!("at {:.0} % of a core", runtime / period * 100.0))
        }
        (Some(runtime), Some(period)) => Diagnosis::note(
            "RT throttling",
            format!("at {:.0} % of a core", runtime / period * 100.0),
            "the kernel suspends a loop that needs more processor time: `sysctl kernel.sched_rt_runtime_us=950000`",
        ),
        _ => Diagnosis::good("RT throttling", "unknown"),
    }
}

fn kernel() -> Diagnosis {
    let version = read_to_string("/proc/version").unwrap_or_default();
    let version = version.split_whitespace().nth(2).unwrap_or("unknown").to_owned();
    if read_to_string("/sys/kernel/realtime").is_ok_and(|flag| flag.trim() == "1") {
        return Diagnosis::good("kernel", format!("{version}, PREEMPT_RT"));
    }
    let remedy =
        "sufficient for a first test; for bounded lateness install a PREEMPT_RT kernel (linux-image-rt)";
    Diagnosis::note("kernel", format!("{version}, not PREEMPT_RT"), remedy)
}

fn governor() -> Diagnosis {
    match read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor") {
        Ok(governor) if governor.trim() == "performance" => Diagnosis::good("clock governor", "performance"),
        Ok(governor) => Diagnosis::note(
            "clock governor",
            governor.trim(),
            "frequency changes delay ticks: `cpupower frequency-set -g performance`",
        ),
        Err(_) => Diagnosis::good("clock governor", "none (virtual machine or fixed clock)"),
    }
}
