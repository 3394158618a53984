//! `flotor lend`: runs an unmodified program, written for another maker's device, on a device of a scene; a drop-in library or a
//! service replaces the maker's.

use crate::api::Api;
use crate::arguments::LendArguments;
use crate::folder::Folder;
use crate::guard::{KILL_GROUP, ProgramEnd};
use crate::outcome::Runs;
use crate::program::Program;
use crate::service::{Service, ServiceEnd};
use crate::stop_request::{Early, Stage, StopRequest, has_ended};
use flotor_command::{CommandError, INTERRUPTED, note, write_json};
use flotor_servo::last_stop::spawn_unblocked;
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunError, check_plugins};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;
use std::ffi::OsString;
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};

/// Interface between a program and its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interface {
    /// Library that the program loads.
    Library(Api),
    /// Service that the program connects to.
    Service(Service),
}

impl Interface {
    /// Parses the value of `--api`.
    fn of_word(word: &str) -> Result<Self, CommandError> {
        let library = Api::ALL.into_iter().find(|api| api.word() == word).map(Self::Library);
        let service = || Service::ALL.into_iter().find(|api| api.word() == word).map(Self::Service);
        library.or_else(service).ok_or_else(|| {
            CommandError::Usage(format!(
                "unknown interface `--api {word}`; use one of the libraries {} or of the services {}. Without \
                 `--api` the program finds \
                 all libraries",
                Api::ALL.map(Api::word).join(", "),
                Service::ALL.map(Service::word).join(" and ")
            ))
        })
    }
}

pub(crate) fn run(arguments: LendArguments) -> Result<(), CommandError> {
    match lend(&arguments) {
        Ok(0) => Ok(()),
        // The service has ended and the folder is removed before `exit`, which runs no destructors.
        Ok(code) | Err(Early::Exit(code)) => std::process::exit(code),
        Err(Early::Failed(error)) => Err(error),
    }
}

/// Runs the program; returns the exit code of the program or of its runs.
fn lend(arguments: &LendArguments) -> Result<i32, Early> {
    let stop = StopRequest::by_signals()?;
    let [name, rest @ ..] = arguments.program.as_slice() else {
        let usage = "the program is missing; write `flotor lend [SCENE] -- PROGRAM ARGUMENTS`".to_owned();
        return Err(CommandError::Usage(usage).into());
    };
    let interface = arguments.api.as_deref().map(Interface::of_word).transpose()?;
    check_scene(arguments)?;
    let program = Program::find(name)?;
    let own = std::env::current_exe().map_err(|cause| {
        CommandError::Failed(format!("cannot determine the path of this program: {cause}"))
    })?;
    let flotor = own.with_file_name("flotor");
    let lending = Lending { arguments, program, rest, own, flotor, stop };
    match interface {
        Some(Interface::Service(service)) => lending.with_service(service),
        Some(Interface::Library(api)) => lending.with_library(Some(api)),
        None => lending.with_library(None),
    }
}

/// Program that is run on a device, and the request to stop it.
struct Lending<'a> {
    arguments: &'a LendArguments,
    program: Program,
    /// Arguments of the program.
    rest: &'a [OsString],
    /// Path of this program.
    own: PathBuf,
    /// Path of `flotor`, in the folder of this program.
    flotor: PathBuf,
    stop: StopRequest,
}

impl Lending<'_> {
    /// Runs the program with the drop-in libraries of one interface, or of all interfaces; returns the exit code of the program or of
    /// its runs.
    fn with_library(&self, api: Option<Api>) -> Result<i32, Early> {
        let Self { arguments, program, own, .. } = self;
        if arguments.listen.is_some() {
            let usage = "--listen is for `--api haply` and `--api ml-api` only; omit the option".to_owned();
            return Err(CommandError::Usage(usage).into());
        }
        program.check(api)?;
        let folder = folder_of_libraries(api, program, own)?;
        let mut command = self.guarded(&folder);
        self.set_environment(&mut command, folder.path())?;
        let end = self.carry_out(&mut command, &folder)?;
        let runs = Runs::read(folder.path(), &end);
        if !runs.tell(&program.path, arguments.options.record.as_deref()) {
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

    /// Starts the service, then runs the program, which connects to the service. Returns the exit code of the program and its runs;
    /// if this is 0, the exit code of the service, whose run may have failed.
    fn with_service(&self, service: Service) -> Result<i32, Early> {
        let Self { arguments, program, flotor, stop, .. } = self;
        let folder = Folder::new()?;
        let served = service.start(arguments, &folder, flotor, stop)?;
        let end = self.carry_out(&mut self.guarded(&folder), &folder)?;
        let served = served.finish();
        let runs = Runs::read(folder.path(), &end);
        runs.tell(&program.path, arguments.options.record.as_deref());
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

    /// Returns the command that starts the program under its [`guard`](crate::guard).
    fn guarded(&self, folder: &Folder) -> Command {
        let mut command = Command::new(&self.own);
        command.args(["program-guard", "--parent", &std::process::id().to_string(), "--end"]);
        command.arg(folder.program_end()).arg("--").arg(&self.program.path).args(self.rest);
        command
    }

    /// Runs the program under its guard and returns the program's end. If the guard cannot start the program, it prints the cause,
    /// and its exit code is returned as error.
    fn carry_out(&self, command: &mut Command, folder: &Folder) -> Result<ProgramEnd, Early> {
        if self.stop.stage() > Stage::Running {
            return Err(Early::Exit(INTERRUPTED));
        }
        let guard = spawn_unblocked(command).map_err(|cause| {
            CommandError::file(&self.own, "cannot start the guard process of the program", cause)
        })?;
        let status = wait(guard, &self.stop);
        let end = match (ProgramEnd::read(&folder.program_end()), status.code()) {
            (Some(end), _) => end,
            (None, Some(code)) => return Err(Early::Exit(code)),
            (None, None) => ProgramEnd::of(status),
        };
        end.tell();
        Ok(end)
    }

    /// Sets the environment variables with which the program finds the drop-in libraries, and those for the run in a library.
    fn set_environment(&self, command: &mut Command, folder: &Path) -> Result<(), CommandError> {
        let before = std::env::var_os("LD_LIBRARY_PATH").filter(|path| !path.is_empty());
        let before = before.iter().flat_map(std::env::split_paths);
        let path = std::env::join_paths([folder.to_path_buf()].into_iter().chain(before));
        // Fails only for a colon in the new folder: the others come from such a list.
        let path = path.map_err(|_| {
            CommandError::Failed(format!(
                "TMPDIR: `{}` contains a colon, which separates the folders in LD_LIBRARY_PATH; set TMPDIR to another \
                 folder",
                folder.display()
            ))
        })?;
        command.env("LD_LIBRARY_PATH", path);
        if folder.join("lib").is_dir() {
            command.env("FDSDK", folder).env("FORCEDIM_SDK", folder);
        }
        self.arguments.set_environment(command, folder, &self.flotor)
    }
}

/// Creates the folder with the libraries of one interface, or of all interfaces.
fn folder_of_libraries(api: Option<Api>, program: &Program, own: &Path) -> Result<Folder, CommandError> {
    let folder = Folder::new()?;
    for wanted in api.map_or(Api::ALL.to_vec(), |api| vec![api]) {
        match wanted.find(own) {
            Ok(library) => folder.put(wanted, &library)?,
            // Without `--api`, the libraries that the program does not call may be missing.
            Err(missing) if api.is_some() || program.calls(wanted) => return Err(missing),
            Err(_) => {}
        }
    }
    // CHAI3D searches for this file first, but calls none of its functions.
    let (beside, phantom) = (folder.path().join("libHD.so"), folder.path().join("libhdPhantom.so"));
    if !beside.exists() && phantom.exists() {
        let _ = symlink(&phantom, &beside);
    }
    if !folder.path().join("lib").exists() && !beside.exists() {
        let missing = Api::Dhd.find(own).err();
        return Err(missing.unwrap_or_else(|| {
            let missing = "no drop-in library was found; build the libraries or reinstall Flotor";
            CommandError::Failed(missing.to_owned())
        }));
    }
    Ok(folder)
}

/// Checks the scene and its plugins before the program starts; otherwise the program would report a missing device.
fn check_scene(arguments: &LendArguments) -> Result<(), CommandError> {
    let Some(file) = &arguments.scene else { return Ok(()) };
    if file.is_dir() || !file.exists() {
        let why = if file.is_dir() { "the path is a folder" } else { "the file does not exist" };
        return Err(CommandError::Usage(format!(
            "`{}` is not a scene file: {why}; correct the path (`flotor scenes NAME` prints one of Flotor's own scenes), or \
             write the program after `--`",
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

/// Waits for the guard of the program and returns its exit status. After a request to stop, sends SIGTERM to the guard, then the
/// signal to kill the process group of the program. At the end of the schedule returns as for a killed guard, which keeps running. A
/// terminal sends its own signal to the program.
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
