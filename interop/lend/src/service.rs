//! Services of other makers, to which a program connects over the network: the service is a separate process.

use crate::arguments::{LendArguments, PaceOption};
use crate::folder::Folder;
use crate::stop_request::{Early, Stage, StopRequest, has_ended};
use flotor_command::separate::{Built, SeparateProgram};
use flotor_command::{CommandError, INTERRUPTED, note, say};
use flotor_servo::THREAD_ADVICE;
use flotor_servo::last_stop::spawn_unblocked;
use flotor_servo::platform::process_group::end_with_this_thread;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Scene with a simulated flotor, for a program of the ML API if no scene is given.
const SCENE: &str = include_str!("ml-api.toml");
/// Default address of the ML API, at which programs expect it.
const ML_API: &str = "127.0.0.1:5678";
/// Duration of the run, a year: longer than any program runs.
const LONGEST: &str = "8760h";

/// Service of another maker, emulated by Flotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Service {
    /// Haply's Inverse Service.
    Haply,
    /// Controller of the Maglev 200.
    MlApi,
}

impl Service {
    pub(crate) const ALL: [Self; 2] = [Self::Haply, Self::MlApi];

    /// Returns the name for `--api`.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Haply => "haply",
            Self::MlApi => "ml-api",
        }
    }

    /// Returns true if the service writes its summary to the folder of `flotor lend`; false for the ML API, a `flotor run` that
    /// writes the file itself.
    pub(crate) fn writes_summary(self) -> bool {
        self == Self::Haply
    }

    /// Starts the service and waits until it listens.
    pub(crate) fn start<'a>(
        self,
        arguments: &LendArguments,
        folder: &Folder,
        flotor: &Path,
        stop: &'a StopRequest,
    ) -> Result<Served<'a>, Early> {
        let mut command = match self {
            Self::Haply => {
                let program = SeparateProgram {
                    program: "flotor-haply-service-emulator",
                    built: Built::WithThis,
                    build: "cargo build --release -p flotor-haply-service",
                };
                let mut command = program.command()?;
                arguments.set_environment(&mut command, folder.path(), flotor)?;
                command.arg("--lent");
                if let Some(listen) = &arguments.listen {
                    command.args(["--listen", listen, "--events", "127.0.0.1:0"]);
                }
                command
            }
            Self::MlApi => run_with_ml_api(arguments, folder, flotor)?,
        };
        // In a process group of its own: Ctrl-C reaches only the program, and the service ends after the program.
        command.stdin(Stdio::null()).stdout(Stdio::piped()).process_group(0);
        end_with_this_thread(&mut command);
        let file = command.get_program().to_owned();
        let child = spawn_unblocked(&mut command)
            .map_err(|cause| CommandError::file(file.as_ref(), "cannot be started", cause))?;
        Served::wait(child, self, stop)
    }
}

/// Returns a `flotor run` command that adds the controller to the scene as a model.
fn run_with_ml_api(
    arguments: &LendArguments,
    folder: &Folder,
    flotor: &Path,
) -> Result<Command, CommandError> {
    if arguments.pace == PaceOption::Lockstep {
        return Err(CommandError::Usage(
            "`--pace lockstep` does not work with `--api ml-api`; use `flotor emulate maglev --protocol ml-api --pace lockstep`"
                .to_owned(),
        ));
    }
    let built_in = folder.path().join("ml-api.toml");
    let scene = match &arguments.scene {
        Some(scene) => scene,
        None => {
            std::fs::write(&built_in, SCENE)
                .map_err(|cause| CommandError::file(&built_in, "cannot be written", cause))?;
            &built_in
        }
    };
    let mut command = Command::new(flotor);
    command.arg("run").arg(scene).args(["--duration", LONGEST, "--seed", &arguments.seed.to_string()]);
    command.args(["--ml-api", arguments.listen.as_deref().unwrap_or(ML_API)]);
    command.args(arguments.options.plugin_path.arguments());
    command.args(arguments.options.control_group.arguments());
    for (option, file) in [("--record", &arguments.options.record), ("--json", &arguments.options.json)] {
        if let Some(file) = file {
            command.arg(option).arg(file);
        }
    }
    Ok(command)
}

/// End of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ServiceEnd {
    /// The service ended with this exit code; nonzero after a failed run.
    Exited(i32),
    /// `flotor lend` killed the service at the end of the schedule.
    Killed,
}

impl ServiceEnd {
    /// Explanation of [`ServiceEnd::Killed`].
    pub(crate) const KILLED: &str =
        "the service did not end in time after the request to stop, and was killed without a summary";

    /// Returns the exit code of the command for this end.
    pub(crate) fn exit_code(self) -> i32 {
        match self {
            Self::Exited(code) => code,
            Self::Killed => 1,
        }
    }
}

/// Running service. Dropping it requests the end of the service and waits for the end.
pub(crate) struct Served<'a> {
    child: Child,
    stop: &'a StopRequest,
    /// Output of the service: first its address, then the rest, sent when the output has ended.
    output: Receiver<String>,
}

impl<'a> Served<'a> {
    fn wait(mut child: Child, service: Service, stop: &'a StopRequest) -> Result<Self, Early> {
        let (sender, output) = channel();
        let pipe = child.stdout.take();
        let served = Self { child, stop, output };
        let read = move || {
            let Some(mut pipe) = pipe.map(BufReader::new) else { return };
            let Some(address) = listening(&mut pipe) else { return };
            let _ = sender.send(address);
            let mut rest = String::new();
            let _ = pipe.read_to_string(&mut rest);
            let _ = sender.send(rest);
        };
        let thread = std::thread::Builder::new().name("flotor-service".to_owned()).spawn(read);
        thread.map_err(|cause| {
            CommandError::Failed(format!(
                "cannot start a thread for the output of the service: {cause}; {THREAD_ADVICE}"
            ))
        })?;
        let address = stop.poll(|stage| match served.output.try_recv() {
            Ok(address) => Some(Ok(address)),
            // The service has printed the cause.
            Err(TryRecvError::Disconnected) => Some(Err(None)),
            Err(TryRecvError::Empty) => (stage > Stage::Running).then_some(Err(Some(INTERRUPTED))),
        });
        match address.unwrap_or(Err(Some(INTERRUPTED))) {
            Ok(address) => {
                note(format_args!(
                    "`--api {}` is served at {address}: the program has to connect there",
                    service.word()
                ));
                Ok(served)
            }
            Err(code) => {
                let end = served.finish();
                Err(Early::Exit(code.unwrap_or_else(|| end.exit_code().max(1))))
            }
        }
    }

    /// Ends the service, prints its remaining output, and returns its end.
    pub(crate) fn finish(mut self) -> ServiceEnd {
        let end = self.end();
        if end == ServiceEnd::Killed {
            note(ServiceEnd::KILLED);
        }
        let output = self.stop.poll(|_| match self.output.try_recv() {
            Err(TryRecvError::Empty) => None,
            complete => Some(complete.unwrap_or_default()),
        });
        let output = output.unwrap_or_default();
        if !output.trim().is_empty() {
            say!("{}", output.trim_end());
        }
        end
    }

    /// Requests the end of the service by SIGTERM, and waits for it. At the end of the schedule kills its process group; the watchdog
    /// process then stops the devices.
    fn end(&mut self) -> ServiceEnd {
        let process = Pid::from_child(&self.child);
        if has_ended(&mut self.child).is_none() {
            let _ = kill_process(process, Signal::TERM);
        }
        let status = self.stop.poll(|_| has_ended(&mut self.child));
        if status.is_none() {
            let _ = kill_process_group(process, Signal::KILL);
            let _ = self.child.wait();
        }
        status.map_or(ServiceEnd::Killed, |status| ServiceEnd::Exited(status.code().unwrap_or(1)))
    }
}

impl Drop for Served<'_> {
    fn drop(&mut self) {
        self.end();
    }
}

/// Reads the address at which a service listens from its output; `None` if the output ends before.
fn listening(output: &mut BufReader<ChildStdout>) -> Option<String> {
    loop {
        let mut line = String::new();
        if output.read_line(&mut line).ok()? == 0 {
            return None;
        }
        if let Some(place) = line.trim_end().strip_prefix("listening ") {
            return Some(place.trim_start_matches("tcp ").to_owned());
        }
    }
}
