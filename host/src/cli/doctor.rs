//! `flotor doctor`: diagnosis of the real-time configuration of this machine or of a device that does not start, with remedies.

mod device;

use crate::diagnosis::{Diagnosis, Grade};
use crate::platform::doctor::{MEMORY_REMEDY, core_remedy, of_the_system, priority_remedy};
use crate::platform::usb;
use clap::Args;
use flotor_command::options::{KeyValue, PluginResultOptions};
use flotor_command::say;
use flotor_command::{CommandError, style};
use flotor_servo::{PRIORITY_NAME, Privilege, RealTimeReport, probe_real_time};
use flotor_session::registry::Registry;
use std::path::{Path, PathBuf};

/// Check this machine's real-time configuration, or why a device does not start, and suggest fixes.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  flotor doctor\n  flotor doctor --device openhaptics\n  flotor doctor --device force-dimension --set library=/opt/sdk/libdrd.so.3\n\n\
    The command changes nothing; with `--device` it opens the device, without force. Each finding names its remedy. The exit \
    code is 0, and with `--device` 1 if the device is not ready to start."
)]
pub(crate) struct DoctorArguments {
    /// Id of a device plugin, or path to its file: check why the device does not start (default: check the machine)
    #[arg(long, value_name = "ID")]
    device: Option<String>,
    /// Set a parameter of the device (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "device")]
    sets: Vec<KeyValue>,
    /// Folder used as the root of the machine's files
    #[arg(long, value_name = "DIR", default_value = "/", hide = true)]
    root: PathBuf,
    #[command(flatten)]
    options: PluginResultOptions,
}

pub(crate) fn run(arguments: &DoctorArguments) -> Result<(), CommandError> {
    let registry = arguments.options.plugin_path.registry();
    let diagnoses = match &arguments.device {
        Some(id) => device::diagnose(&registry, id, &arguments.sets, &usb::Machine::at(&arguments.root))?,
        None => machine(&registry, &arguments.root),
    };
    let is_text_wanted = arguments.options.json.write(&diagnoses)?;
    let bad = diagnoses.iter().filter(|diagnosis| diagnosis.grade == Grade::Bad).count();
    let verdict = match (&arguments.device, bad) {
        (Some(id), 1..) => {
            Err(CommandError::Failed(format!("`{id}` does not start; each finding names its remedy")))
        }
        _ => Ok(()),
    };
    if !is_text_wanted {
        return verdict;
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
    let words = match (&arguments.device, bad) {
        (_, 0) => "ready".to_owned(),
        (Some(_), _) => format!("not ready to start this device; bad findings: {bad}"),
        (None, _) => format!(
            "not ready for real time; bad findings: {bad}. Runs with `--clock virtual` do not need real time"
        ),
    };
    say!("{}", style::title(&words));
    verdict
}

/// Diagnoses the real-time configuration of this machine, with the plugins found.
fn machine(registry: &Registry, root: &Path) -> Vec<Diagnosis> {
    let privileges = privileges(&probe_real_time(), root);
    [cores(root)]
        .into_iter()
        .chain(of_the_system(root))
        .chain(privileges)
        .chain([plugins(registry)])
        .collect()
}

fn cores(root: &Path) -> Diagnosis {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    if cores > 1 {
        return Diagnosis::good("cores", cores.to_string());
    }
    let remedy = format!("the loop shares its core with all other programs; {}", core_remedy(root));
    Diagnosis::note("cores", "1", remedy)
}

fn privileges(report: &RealTimeReport, root: &Path) -> [Diagnosis; 2] {
    let diagnose = |what, privilege: &Privilege, remedy: String| match privilege {
        Privilege::Granted => Diagnosis::good(what, "granted"),
        Privilege::Refused(reason) => Diagnosis::bad(what, reason.clone(), remedy),
        Privilege::NotRequested => Diagnosis::note(what, "not requested", remedy),
    };
    [
        diagnose(PRIORITY_NAME, &report.fifo, priority_remedy(root)),
        diagnose("memory lock", &report.memory_lock, MEMORY_REMEDY.to_owned()),
    ]
}

fn plugins(registry: &Registry) -> Diagnosis {
    let ids: Vec<&str> = registry.found().iter().map(|plugin| plugin.id.as_str()).collect();
    let broken = registry.findings().broken.len();
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
            "`flotor plugins` lists the reasons",
        ),
    }
}
