//! `flotor lend`: runs an unmodified program on a Flotor device: a drop-in library replaces that of the maker of the program's
//! device.

pub(crate) mod guard;
mod outcome;
mod program;
mod service;
mod stop_request;

use clap::{Args, ValueEnum};
use flotor_command::options::{LendOptions, seed};
use flotor_command::{CommandError, INTERRUPTED, note, write_json};
use flotor_servo::last_stop::spawn_unblocked;
use flotor_session::registry::{PATH_VARIABLE, Registry};
use flotor_session::scene::Scene;
use flotor_session::{RunError, check_plugins};
use guard::{KILL_GROUP, ProgramEnd};
use outcome::Runs;
use program::Program;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;
use service::{Service, ServiceEnd};
use std::ffi::OsString;
use std::os::unix::fs::{DirBuilderExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use stop_request::{Stage, StopRequest};

/// Run an unmodified program, written for another maker's device, on the device of a scene, within the scene's limits.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor lend -- python3 my_openhaptics_script.py      on the simulated flotor, held by a hand\n  \
    flotor lend --api dhd maglev.toml -- ./surgery       on a scene's device, within the scene's limits\n  \
    flotor lend --api haply -- python3 my_haply_script.py       over the network: a service beside the program\n  \
    flotor lend --pace lockstep --record run.mcap -- ./my_test   one call, one tick: repeatable, fast\n\n\
    Environment variables: FLOTOR_SIGNALS=stop stops the devices before a signal ends the program. FLOTOR_DHD_TYPE,\n\
    FLOTOR_HD_MODEL and FLOTOR_PHANTOM_TYPE set the type of device that the program sees.\n\n\
    The exit code is that of the program; 4 if the program ended with 0 after its run had failed.")]
#[command(mut_arg("json", |json| json.help("Write the summary as JSON; standard output is for the program")))]
pub(crate) struct LendArguments {
    /// The interface that the program calls (default: the program finds the three libraries)
    #[arg(long, value_name = "dhd|openhaptics|chai3d|haply|ml-api")]
    api: Option<String>,
    /// Haply, ml-api: where the service listens (default: the address that programs expect, port 10001 or 5678)
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
    /// Source of the time of the run
    #[arg(long, value_enum, default_value_t = PaceOption::Real)]
    pace: PaceOption,
    /// Seed of all random numbers
    #[arg(long, value_parser = seed, default_value_t = 0, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    options: LendOptions,
    /// Scene file (TOML); without it, a simulated flotor held by a hand
    scene: Option<PathBuf>,
    /// The program and its arguments
    #[arg(last = true, required = true, value_name = "PROGRAM")]
    program: Vec<OsString>,
}

/// Source of the time of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PaceOption {
    /// The machine's clock: the program runs at its own rate
    Real,
    /// The program: each call that sets a force, or each callback of a scheduler, is one tick
    Lockstep,
}

/// Library interface of another maker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Api {
    /// Force Dimension's DHD and DRD
    Dhd,
    /// 3D Systems' OpenHaptics (HDAPI)
    Openhaptics,
    /// CHAI3D's interface to a Phantom
    Chai3d,
}

/// Interface between a program and its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interface {
    /// Library that the program loads.
    Library(Api),
    /// Service that the program connects to.
    Service(Service),
}

impl Api {
    const ALL: [Self; 3] = [Self::Dhd, Self::Openhaptics, Self::Chai3d];

    /// Parses the name of an interface.
    fn of_word(word: &str) -> Result<Interface, CommandError> {
        let library = Self::ALL.into_iter().find(|api| api.word() == word).map(Interface::Library);
        let service = || Service::ALL.into_iter().find(|api| api.word() == word).map(Interface::Service);
        library.or_else(service).ok_or_else(|| {
            CommandError::Usage(format!(
                "unknown interface `--api {word}`; use one of the libraries {} or of the services {}. Without \
                 `--api` the program finds \
                 all libraries",
                Self::ALL.map(Self::word).join(", "),
                Service::ALL.map(Service::word).join(" and ")
            ))
        })
    }

    /// Returns the name for `--api`.
    fn word(self) -> &'static str {
        match self {
            Self::Dhd => "dhd",
            Self::Openhaptics => "openhaptics",
            Self::Chai3d => "chai3d",
        }
    }

    /// Returns the library that cargo builds, and its crate.
    fn built(self) -> (&'static str, &'static str) {
        match self {
            Self::Dhd => ("libdrd.so", "flotor-dhd"),
            Self::Openhaptics => ("libHD.so", "flotor-openhaptics"),
            Self::Chai3d => ("libhdPhantom.so", "flotor-chai3d"),
        }
    }

    /// Returns the file names by which programs load the library; the last one is used by an installation.
    fn names(self) -> &'static [&'static str] {
        match self {
            Self::Dhd => &[
                "libdhd.so",
                "libdhd.so.3",
                "libdhd.so.3.17.6",
                "libdrd.so",
                "libdrd.so.3",
                "libdrd.so.3.17.6",
            ],
            // Programs that are linked with the higher layer load it, and call none of its functions.
            Self::Openhaptics => {
                &["libHL.so", "libHL.so.3.4", "libHD.so.3.0", "libHD.so.3.4", "libHD.so.3.4.0", "libHD.so"]
            }
            Self::Chai3d => &["libhdPhantom.so"],
        }
    }

    /// Returns strings in a program that is linked with the library, or loads it.
    fn marks(self) -> &'static [&'static str] {
        match self {
            Self::Dhd => &["libdhd.so", "libdrd.so"],
            Self::Openhaptics => &["libHD.so"],
            Self::Chai3d => &["libhdPhantom.so"],
        }
    }

    /// Finds the library, in the installation or the build folder of this program.
    fn library(self, own: &Path) -> Result<PathBuf, CommandError> {
        let folder = own.parent().unwrap_or(Path::new("."));
        let (built, package) = self.built();
        let installed = folder.join("../lib/flotor/compat").join(self.word());
        let installed = self.names().iter().rev().map(|name| installed.join(name));
        let beside = [folder.join(built), folder.join("deps").join(built)];
        installed.chain(beside).find(|file| file.is_file()).ok_or_else(|| {
            let release = if folder.ends_with("debug") { "" } else { " --release" };
            CommandError::Usage(format!(
                "the drop-in library for `--api {}` is missing: neither `{}` nor `../lib/flotor/compat/{}`; `cargo build{release} \
                 -p {package}` builds it",
                self.word(),
                folder.join(built).display(),
                self.word()
            ))
        })
    }
}

/// Private folder with links to the libraries, removed when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self, CommandError> {
        let path = std::env::temp_dir().join(format!("flotor-lend-{}", std::process::id()));
        // From a killed process with the same id.
        let _ = std::fs::remove_dir_all(&path);
        let made = std::fs::DirBuilder::new().mode(0o700).create(&path);
        made.map_err(|cause| CommandError::file(&path, "cannot make a folder for the libraries", cause))?;
        Ok(Self(path))
    }

    /// Links a library under the names of its interface, in the folders that loader and SDK variables search.
    fn put(&self, api: Api, library: &Path) -> Result<(), CommandError> {
        let library = library.canonicalize().unwrap_or_else(|_| library.to_path_buf());
        let sdk = self.0.join(format!("lib/release/lin-{}-gcc", std::env::consts::ARCH));
        // One old client searches a folder `lib` in the folder of the libraries.
        let folders = match api {
            Api::Dhd => vec![self.0.clone(), sdk.clone(), sdk.join("lib")],
            Api::Openhaptics | Api::Chai3d => vec![self.0.clone()],
        };
        for folder in folders {
            let linked = std::fs::create_dir_all(&folder)
                .and_then(|()| api.names().iter().try_for_each(|name| symlink(&library, folder.join(name))));
            linked.map_err(|cause| CommandError::file(&folder, "cannot link the libraries", cause))?;
        }
        Ok(())
    }
}

impl Folder {
    /// Returns the file for the end of the program.
    fn program_end(&self) -> PathBuf {
        self.0.join("program-end.json")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Reason why `flotor lend` ends without an end of its program.
enum Early {
    Failed(CommandError),
    /// The exit code, after a request to stop or an error that another process has printed.
    Exit(i32),
}

impl From<CommandError> for Early {
    fn from(error: CommandError) -> Self {
        Self::Failed(error)
    }
}

pub(crate) fn run(arguments: LendArguments) -> Result<(), CommandError> {
    match lend(&arguments) {
        Ok(0) => Ok(()),
        // The service has ended and the folder is removed: `exit` would skip that.
        Ok(code) | Err(Early::Exit(code)) => std::process::exit(code),
        Err(Early::Failed(error)) => Err(error),
    }
}

/// Runs the program; returns its exit code, or that of its runs.
fn lend(arguments: &LendArguments) -> Result<i32, Early> {
    let stop = StopRequest::by_signals()?;
    let [name, rest @ ..] = arguments.program.as_slice() else {
        let usage = "the program is missing; write `flotor lend [SCENE] -- PROGRAM ARGUMENTS`".to_owned();
        return Err(CommandError::Usage(usage).into());
    };
    let api = arguments.api.as_deref().map(Api::of_word).transpose()?;
    check_scene(arguments)?;
    let program = Program::find(name)?;
    let own = std::env::current_exe().map_err(|cause| CommandError::Failed(cause.to_string()))?;
    let api = match api {
        Some(Interface::Service(service)) => return serve(arguments, service, &program, rest, &own, &stop),
        Some(Interface::Library(api)) => Some(api),
        None => None,
    };
    if arguments.listen.is_some() {
        let usage = "--listen is for `--api haply` and `--api ml-api`".to_owned();
        return Err(CommandError::Usage(usage).into());
    }
    program.check(api)?;
    let folder = folder_of_libraries(api, &program, &own)?;
    let mut command = guarded(&program, rest, &folder, &own);
    environment(&mut command, arguments, &folder.0, &own)?;
    let end = carry_out(&mut command, &program, &folder, &stop)?;
    let runs = Runs::read(&folder.0, &end);
    if !runs.tell(&program, arguments.options.record.as_deref()) {
        let which = api.map_or_else(
            || "none of dhd, openhaptics and chai3d".to_owned(),
            |api| format!("nothing of `--api {}`", api.word()),
        );
        note(format_args!(
            "`{}` opened no device: it called {which}, was linked statically with the maker's library (link it with \
             the library of `flotor lend`), or lost `LD_LIBRARY_PATH` (a script that sets the variable has to \
             append the old value; `env -i` removes the variable)",
            program.path.display()
        ));
    }
    arguments.options.json.as_deref().map_or(Ok(()), |json| runs.write(json))?;
    Ok(runs.exit_code())
}

/// Creates the folder with the libraries of one interface, or of all.
fn folder_of_libraries(api: Option<Api>, program: &Program, own: &Path) -> Result<Folder, CommandError> {
    let folder = Folder::new()?;
    for wanted in api.map_or(Api::ALL.to_vec(), |api| vec![api]) {
        match wanted.library(own) {
            Ok(library) => folder.put(wanted, &library)?,
            // Without `--api`, the libraries that the program does not call may be missing.
            Err(missing) if api.is_some() || program.calls(wanted) => return Err(missing),
            Err(_) => {}
        }
    }
    // CHAI3D searches for this file first, and calls none of its functions.
    let (beside, phantom) = (folder.0.join("libHD.so"), folder.0.join("libhdPhantom.so"));
    if !beside.exists() && phantom.exists() {
        let _ = symlink(&phantom, &beside);
    }
    if !folder.0.join("lib").exists() && !beside.exists() {
        let missing = Api::Dhd.library(own).err();
        return Err(missing.unwrap_or_else(|| {
            CommandError::Failed(
                "no drop-in library was found; build the libraries or reinstall Flotor".to_owned(),
            )
        }));
    }
    Ok(folder)
}

/// Returns the command that starts the program under its [`guard`].
fn guarded(program: &Program, rest: &[OsString], folder: &Folder, own: &Path) -> Command {
    let mut command = Command::new(own);
    command.args(["program-guard", "--parent", &std::process::id().to_string(), "--end"]);
    command.arg(folder.program_end()).arg("--").arg(&program.path).args(rest);
    command
}

/// Runs the guarded program; returns its end. A guard that cannot start the program has printed the cause.
fn carry_out(
    command: &mut Command,
    program: &Program,
    folder: &Folder,
    stop: &StopRequest,
) -> Result<ProgramEnd, Early> {
    if stop.stage() > Stage::Running {
        return Err(Early::Exit(INTERRUPTED));
    }
    let guard = spawn_unblocked(command)
        .map_err(|cause| CommandError::file(&program.path, "cannot be started", cause))?;
    let status = wait(guard, stop);
    let end = match (ProgramEnd::read(&folder.program_end()), status.code()) {
        (Some(end), _) => end,
        (None, Some(code)) => return Err(Early::Exit(code)),
        (None, None) => ProgramEnd::of(status),
    };
    end.tell();
    Ok(end)
}

/// Serves a program over the network; returns the exit code of the program and its runs, or if that is 0, of the service, whose run
/// may have been rejected.
fn serve(
    arguments: &LendArguments,
    service: Service,
    program: &Program,
    rest: &[OsString],
    own: &Path,
    stop: &StopRequest,
) -> Result<i32, Early> {
    let folder = Folder::new()?;
    let served = service.start(arguments, &folder, own, stop)?;
    let end = carry_out(&mut guarded(program, rest, &folder, own), program, &folder, stop)?;
    let served = served.finish();
    let runs = Runs::read(&folder.0, &end);
    runs.tell(program, arguments.options.record.as_deref());
    if let Some(json) = &arguments.options.json {
        match served {
            _ if service.writes_summary() => runs.write(json)?,
            ServiceEnd::Killed => write_json(json, &json!({ "end": ServiceEnd::KILLED }))?,
            // The service has written the file.
            ServiceEnd::Exited(_) => {}
        }
    }
    Ok(match runs.exit_code() {
        0 => served.exit_code(),
        code => code,
    })
}

/// Checks the scene and its plugins before the program starts, which would otherwise see a missing device.
fn check_scene(arguments: &LendArguments) -> Result<(), CommandError> {
    let Some(file) = &arguments.scene else { return Ok(()) };
    if file.is_dir() || !file.exists() {
        return Err(CommandError::Usage(format!(
            "`{}` is not a scene: the file does not exist; write the program after `--`",
            file.display()
        )));
    }
    let mut scene = Scene::load(file).map_err(RunError::Scene)?;
    arguments.options.plugin_path.put_before_those_of(&mut scene);
    check_plugins(&scene, &Registry::search(&scene.plugin_folders))?;
    if scene.duration_s != Scene::DURATION_S {
        note(format_args!(
            "`{}`: `duration_s` does not apply; the run lasts as long as the program",
            file.display()
        ));
    }
    Ok(())
}

/// Sets the environment variables of a drop-in library.
fn environment(
    command: &mut Command,
    arguments: &LendArguments,
    folder: &Path,
    own: &Path,
) -> Result<(), CommandError> {
    let before = std::env::var_os("LD_LIBRARY_PATH").filter(|path| !path.is_empty());
    let folders = std::iter::once(folder.to_path_buf())
        .chain(before.iter().flat_map(std::env::split_paths).collect::<Vec<_>>());
    let path = std::env::join_paths(folders).map_err(|error| CommandError::Failed(error.to_string()))?;
    command.env("LD_LIBRARY_PATH", path);
    if folder.join("lib").is_dir() {
        for variable in ["FDSDK", "FORCEDIM_SDK"] {
            command.env(variable, folder);
        }
    }
    set_environment(command, arguments, folder, own)
}

/// Sets the environment variables of a run behind a program, in a library or a service.
fn set_environment(
    command: &mut Command,
    arguments: &LendArguments,
    folder: &Path,
    own: &Path,
) -> Result<(), CommandError> {
    let absolute = |path: &Path| {
        std::path::absolute(path).map_err(|cause| CommandError::file(path, "cannot be found", cause))
    };
    if let Some(scene) = &arguments.scene {
        command.env("FLOTOR_SCENE", absolute(scene)?);
    }
    if let Some(record) = &arguments.options.record {
        command.env("FLOTOR_RECORD", absolute(record)?);
    }
    if !arguments.options.plugin_path.folders().is_empty() {
        let before = std::env::var_os(PATH_VARIABLE);
        let before =
            before.iter().flat_map(std::env::split_paths).filter(|folder| !folder.as_os_str().is_empty());
        let folders = arguments.options.plugin_path.folders().iter().map(|folder| absolute(folder));
        let folders = folders.chain(before.map(Ok)).collect::<Result<Vec<_>, CommandError>>()?;
        let folders = std::env::join_paths(folders)
            .map_err(|error| CommandError::Usage(format!("--plugin-path: {error}")))?;
        command.env(PATH_VARIABLE, folders);
    }
    command.env("FLOTOR_PACE", if arguments.pace == PaceOption::Real { "real" } else { "lockstep" });
    command.env("FLOTOR_SEED", arguments.seed.to_string());
    if arguments.options.control_group.is_accepted() {
        command.env("FLOTOR_SHARED_CONTROL_GROUP", "accept");
    }
    let [report, summary] = Runs::files(folder);
    command.env("FLOTOR_REPORT", report).env("FLOTOR_JSON", summary);
    command.env("FLOTOR_PROCESSES", folder).env("FLOTOR_PROGRAM", own);
    Ok(())
}

/// Waits for the guard of the program. After a request to stop, sends SIGTERM to the guard, then the request to kill the group. At the
/// end of the schedule the guard goes on alone. A terminal sends its own signal to the program.
fn wait(mut guard: Child, stop: &StopRequest) -> ExitStatus {
    let process = Pid::from_child(&guard);
    let mut asked = Stage::Running;
    let status = stop.poll(|stage| {
        let status = has_ended(&mut guard);
        if status.is_none() && (asked < stage || stage >= Stage::ProgramKilled) {
            let _ = match stage {
                Stage::Running | Stage::Requested => Ok(()),
                Stage::ProgramAsked => kill_process(process, Signal::TERM),
                Stage::ProgramKilled | Stage::Over => kill_process(process, KILL_GROUP),
            };
            asked = stage;
        }
        status
    });
    status.unwrap_or_else(|| ExitStatus::from_raw(Signal::KILL.as_raw()))
}

/// Returns the exit status of a process once it has ended.
fn has_ended(child: &mut Child) -> Option<ExitStatus> {
    child.try_wait().unwrap_or_else(|_| Some(ExitStatus::default()))
}
