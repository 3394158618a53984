//! What `flotor doctor` finds in the files of the kernel.

use crate::cli::doctor::Diagnosis;
use flotor_servo::watchdog_process::probe_shared_group;
use std::fs::read_to_string;

/// How a user gets real-time priority.
pub(crate) const PRIORITY_REMEDY: &str = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - rtprio 99` in \
                /etc/security/limits.conf; then log in again";
/// How a user gets locked memory.
pub(crate) const MEMORY_REMEDY: &str = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - memlock unlimited` \
                in /etc/security/limits.conf; then log in again";

/// How a user keeps the watchdog process alive when the run is killed with its group.
const SHARED_GROUP_REMEDY: &str = "start the run where systemd's user or system manager can be reached (`busctl --user status`), or in a \
                                   group with a writable outer group. In a service: `KillMode=mixed`, `OOMPolicy=continue`, \
                                   `ManagedOOMPreference=avoid`. In a container: end the run with a signal before the container";

/// What this system has to say beside its cores.
pub(crate) fn of_the_system() -> Vec<Diagnosis> {
    vec![isolated_cores(), kernel(), throttling(), governor(), killed_together()]
}

/// Whether a kill of all processes of a control group ends the watchdog process with the host.
fn killed_together() -> Diagnosis {
    match probe_shared_group() {
        Ok(None) => Diagnosis::good("watchdog process", "in a control group of its own"),
        Ok(Some(group)) => Diagnosis::bad(
            "watchdog process",
            format!("in the control group `{group}` of the run: a kill of the group leaves the force on"),
            SHARED_GROUP_REMEDY,
        ),
        Err(error) => Diagnosis::bad("watchdog process", error.to_string(), "run the `flotor` of one build"),
    }
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

/// Share of a core that real-time threads may take together.
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
