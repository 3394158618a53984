//! `flotor doctor`: the real-time configuration of this machine, or why a device does not start, and how to improve it.

mod device;
mod usb;

use clap::Args;
use flotor_command::options::{JsonOption, KeyValue, PluginPathOption};
use flotor_command::say;
use flotor_command::{CommandError, style, write_json};
use flotor_servo::{Privilege, RealTimeReport, probe_real_time};
use flotor_session::registry::Registry;
use serde::Serialize;
use std::fs::read_to_string;
use std::path::PathBuf;

/// Check this machine's real-time configuration, or why a device does not start, and suggest fixes.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  flotor doctor\n  flotor doctor --device openhaptics\n  flotor doctor --device force-dimension --set library=/opt/sdk/libdrd.so.3\n\n\
    The command changes nothing; with `--device` it opens the device, without force. Each finding names its remedy. The exit \
    code is 0 whatever it finds."
)]
pub(crate) struct DoctorArguments {
    /// Id of a device: check why it does not start
    #[arg(long, value_name = "ID")]
    device: Option<String>,
    /// Parameter with which the device is opened (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "device")]
    sets: Vec<KeyValue>,
    /// Folder that is looked at as the root of the machine's files
    #[arg(long, value_name = "DIR", default_value = "/", hide = true)]
    root: PathBuf,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    plugin_path: PluginPathOption,
}

/// How serious a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Grade {
    Good,
    Note,
    Bad,
}

/// One finding.
#[derive(Debug, Serialize)]
struct Diagnosis {
    what: &'static str,
    grade: Grade,
    found: String,
    remedy: Option<String>,
}

impl Diagnosis {
    fn good(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, grade: Grade::Good, found: found.into(), remedy: None }
    }

    fn note(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { what, grade: Grade::Note, found: found.into(), remedy: Some(remedy.into()) }
    }

    /// Bad, and what was found says what to do.
    fn told(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, grade: Grade::Bad, found: found.into(), remedy: None }
    }

    fn bad(what: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { what, grade: Grade::Bad, found: found.into(), remedy: Some(remedy.into()) }
    }
}

pub(crate) fn run(arguments: &DoctorArguments) -> Result<(), CommandError> {
    let registry = arguments.plugin_path.registry();
    let (diagnoses, subject) = match &arguments.device {
        Some(id) => (
            device::diagnose(&registry, id, &arguments.sets, &usb::Machine::at(&arguments.root))?,
            "to start this device",
        ),
        None => (machine(&registry), "for real time"),
    };
    if let Some(file) = arguments.json.file() {
        write_json(file, &diagnoses)?;
    }
    if arguments.json.is_on_standard_output() {
        return Ok(());
    }
    for diagnosis in &diagnoses {
        let grade = match diagnosis.grade {
            Grade::Good => "good",
            Grade::Note => "note",
            Grade::Bad => "bad",
        };
        say!("  {grade:<5} {:<18} {}", diagnosis.what, diagnosis.found);
        if let Some(remedy) = &diagnosis.remedy {
            say!("  {:<5} {:<18} -> {remedy}", "", "");
        }
    }
    let bad = diagnoses.iter().filter(|diagnosis| diagnosis.grade == Grade::Bad).count();
    let verdict = match bad {
        0 => "ready".to_owned(),
        bad if arguments.device.is_some() => format!("not ready {subject}; bad findings: {bad}"),
        bad => format!(
            "not ready {subject}; bad findings: {bad}. Runs with `--clock virtual` do not need real time"
        ),
    };
    say!("{}", style::title(&verdict));
    Ok(())
}

/// The real-time configuration.
fn machine(registry: &Registry) -> Vec<Diagnosis> {
    let mut diagnoses = vec![cores(), isolated_cores(), kernel(), throttling(), governor()];
    diagnoses.extend(privileges(&probe_real_time()));
    diagnoses.push(plugins(registry));
    diagnoses
}

fn cores() -> Diagnosis {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    match cores {
        1 => Diagnosis::note(
            "cores",
            "1",
            "the loop shares its core with all other programs; use a machine with two cores or more",
        ),
        _ => Diagnosis::good("cores", cores.to_string()),
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

fn privileges(report: &RealTimeReport) -> [Diagnosis; 2] {
    let diagnose = |what, privilege: &Privilege, remedy: &'static str| match privilege {
        Privilege::Granted => Diagnosis::good(what, "granted"),
        Privilege::Refused(reason) => Diagnosis::bad(what, reason.clone(), remedy),
        Privilege::NotAsked => Diagnosis::note(what, "not requested", remedy),
    };
    let fifo = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - rtprio 99` in \
                /etc/security/limits.conf; then log in again";
    let lock = "as root: `groupadd -f realtime`, `usermod -aG realtime USER`, and a line `@realtime - memlock unlimited` \
                in /etc/security/limits.conf; then log in again";
    [diagnose("SCHED_FIFO", &report.fifo, fifo), diagnose("memory lock", &report.memory_lock, lock)]
}

fn plugins(registry: &Registry) -> Diagnosis {
    let ids: Vec<&str> = registry.found().iter().map(|plugin| plugin.id.as_str()).collect();
    let broken = registry.broken().len();
    match (ids.is_empty(), broken) {
        (true, _) => Diagnosis::bad(
            "plugins",
            "none found",
            "build with `cargo build --release`; `flotor plugins` lists the folders that are searched",
        ),
        (false, 0) => Diagnosis::good("plugins", ids.join(", ")),
        (false, _) => Diagnosis::note(
            "plugins",
            format!("{}; {broken} files are unreadable", ids.join(", ")),
            "`flotor plugins` gives the reasons",
        ),
    }
}
