//! Arguments of `flotor lend`, and the environment variables that pass the arguments to the run in a drop-in library or service.

use crate::outcome::Runs;
use clap::{Args, ValueEnum};
use flotor_command::CommandError;
use flotor_command::options::{LendOptions, seed};
use flotor_session::registry::PATH_VARIABLE;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Run an unmodified program, written for another maker's device, on the device of a scene, within the scene's limits.
#[derive(Args)]
#[command(
    version,
    after_help = "Examples:\n  \
    flotor lend -- python3 my_openhaptics_script.py      on the simulated flotor, held by a hand\n  \
    flotor lend --api dhd maglev.toml -- ./surgery       on a scene's device, within the scene's limits\n  \
    flotor lend --api haply -- python3 my_haply_script.py       over the network: a service beside the program\n  \
    flotor lend --pace lockstep --record run.mcap -- ./my_test   one call, one tick: repeatable, fast\n\n\
    Environment variables: FLOTOR_SIGNALS=stop stops the devices before a signal ends the program. FLOTOR_DHD_TYPE,\n\
    FLOTOR_HD_MODEL and FLOTOR_PHANTOM_TYPE set the type of device that the program sees.\n\n\
    The exit code is that of the program; 4 if the program ended with 0 after its run had failed."
)]
#[command(mut_arg("json", |json| json.help("Write the summary as JSON; standard output is for the program")))]
pub(crate) struct LendArguments {
    /// The interface that the program calls (default: the program finds the libraries dhd, openhaptics and chai3d)
    #[arg(long, value_name = "dhd|openhaptics|chai3d|haply|ml-api")]
    pub(crate) api: Option<String>,
    /// With --api haply or ml-api: address of the service (default: where programs expect it, 127.0.0.1:10001 or 127.0.0.1:5678)
    #[arg(long, value_name = "HOST:PORT")]
    pub(crate) listen: Option<String>,
    /// Source of the time of the run
    #[arg(long, value_enum, default_value_t = PaceOption::Real)]
    pub(crate) pace: PaceOption,
    /// Seed of all random numbers
    #[arg(long, value_parser = seed, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) options: LendOptions,
    /// Scene file in TOML (default: a simulated flotor held by a hand)
    pub(crate) scene: Option<PathBuf>,
    /// The program and its arguments
    #[arg(last = true, required = true, value_name = "PROGRAM")]
    pub(crate) program: Vec<OsString>,
}

/// Source of the time of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PaceOption {
    /// The machine's clock: the program runs at its own rate
    Real,
    /// The program: each call or message that sets a force, or each callback of a scheduler, is one tick; not with --api ml-api
    Lockstep,
}

impl LendArguments {
    /// Sets the environment variables for the run in a drop-in library or service.
    pub(crate) fn set_environment(
        &self,
        command: &mut Command,
        folder: &Path,
        flotor: &Path,
    ) -> Result<(), CommandError> {
        let absolute = |path: &Path| {
            std::path::absolute(path).map_err(|cause| {
                let path = path.display();
                CommandError::Failed(format!(
                    "`{path}`: cannot determine the current folder: {cause}; give the absolute path"
                ))
            })
        };
        for (variable, file) in [("FLOTOR_SCENE", &self.scene), ("FLOTOR_RECORD", &self.options.record)] {
            match file {
                Some(file) => command.env(variable, absolute(file)?),
                None => command.env_remove(variable),
            };
        }
        if !self.options.plugin_path.folders().is_empty() {
            let before = std::env::var_os(PATH_VARIABLE);
            let before =
                before.iter().flat_map(std::env::split_paths).filter(|folder| !folder.as_os_str().is_empty());
            let folders = self.options.plugin_path.folders().iter().map(|folder| absolute(folder));
            let folders = folders.chain(before.map(Ok)).collect::<Result<Vec<_>, CommandError>>()?;
            let folders = std::env::join_paths(folders)
                .map_err(|error| CommandError::Usage(format!("--plugin-path: {error}; rename the folder")))?;
            command.env(PATH_VARIABLE, folders);
        }
        command.env("FLOTOR_PACE", if self.pace == PaceOption::Real { "real" } else { "lockstep" });
        command.env("FLOTOR_SEED", self.seed.to_string());
        if self.options.control_group.is_accepted() {
            command.env("FLOTOR_SHARED_CONTROL_GROUP", "accept");
        }
        let [report, summary] = Runs::files(folder);
        command.env("FLOTOR_REPORT", report).env("FLOTOR_JSON", summary);
        command.env("FLOTOR_PROCESSES", folder).env("FLOTOR_PROGRAM", flotor);
        Ok(())
    }
}
