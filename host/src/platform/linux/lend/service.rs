//! Interfaces that a program reaches by the network: the service is a process of its own beside the program.

use super::{Folder, LendArguments, PaceOption, told};
use flotor_command::separate::{Built, SeparateProgram};
use flotor_command::{CommandError, note, say};
use flotor_servo::last_stop::spawn_unblocked;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

/// The simulated flotor that a program of the ML API finds without a scene.
const SCENE: &str = include_str!("ml-api.toml");
/// Longest run: longer than anybody waits.
const LONGEST: &str = "8760h";

/// A service of another maker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Service {
    /// Haply's Inverse Service.
    Haply,
    /// The controller of the Maglev 200.
    MlApi,
}

impl Service {
    pub(super) const ALL: [Self; 2] = [Self::Haply, Self::MlApi];

    /// What `--api` says.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Haply => "haply",
            Self::MlApi => "ml-api",
        }
    }

    /// Whether its summary appears in the folder of `flotor lend`; the other is a `flotor run` with a file of its own.
    pub(super) fn leaves_its_summary_here(self) -> bool {
        self == Self::Haply
    }

    /// Where it listens unless another place is wanted.
    fn usual(self) -> &'static str {
        match self {
            Self::Haply => "127.0.0.1:10001",
            Self::MlApi => "127.0.0.1:5678",
        }
    }

    /// Starts it and waits until it listens.
    pub(super) fn start(
        self,
        arguments: &LendArguments,
        folder: &Folder,
        own: &Path,
    ) -> Result<Served, CommandError> {
        let mut command = match self {
            Self::Haply => {
                let program = SeparateProgram {
                    program: "flotor-haply-service-emulator",
                    built: Built::WithThis,
                    build: "cargo build --release -p flotor-haply-service",
                };
                let mut command = program.command()?;
                told(&mut command, arguments, &folder.0, own)?;
                command.arg("--lent");
                if let Some(listen) = &arguments.listen {
                    command.args(["--listen", listen, "--events", "127.0.0.1:0"]);
                }
                command
            }
            Self::MlApi => self.run(arguments, folder, own)?,
        };
        // Ctrl-C is for the program: the service ends after it.
        command.stdin(Stdio::null()).stdout(Stdio::piped()).process_group(0);
        let file = command.get_program().to_owned();
        let child = spawn_unblocked(&mut command)
            .map_err(|cause| CommandError::file(file.as_ref(), "cannot be started", cause))?;
        Served::wait(child, self)
    }

    /// `flotor run` with the controller as one more model of the scene.
    fn run(self, arguments: &LendArguments, folder: &Folder, own: &Path) -> Result<Command, CommandError> {
        if arguments.pace == PaceOption::Lockstep {
            return Err(CommandError::Usage(
                "`--pace lockstep` is not for `--api ml-api`; `flotor emulate maglev --protocol ml-api --pace lockstep` has it"
                    .to_owned(),
            ));
        }
        let built_in = folder.0.join("ml-api.toml");
        let scene = match &arguments.scene {
            Some(scene) => scene,
            None => {
                std::fs::write(&built_in, SCENE)
                    .map_err(|cause| CommandError::file(&built_in, "cannot be written", cause))?;
                &built_in
            }
        };
        let mut command = Command::new(own);
        command.arg("run").arg(scene).args(["--duration", LONGEST, "--seed", &arguments.seed.to_string()]);
        command.args(["--ml-api", arguments.listen.as_deref().unwrap_or(self.usual())]);
        command.args(arguments.plugin_path.arguments()).args(arguments.control_group.arguments());
        for (option, file) in [("--record", &arguments.record), ("--json", &arguments.json)] {
            if let Some(file) = file {
                command.arg(option).arg(file);
            }
        }
        Ok(command)
    }
}

/// A service that listens. Dropped, it is told to end, and waited for.
pub(super) struct Served {
    child: Child,
    /// What it says after it has said where it listens.
    said: Option<JoinHandle<String>>,
}

impl Served {
    fn wait(mut child: Child, service: Service) -> Result<Self, CommandError> {
        let mut output = child.stdout.take().map(BufReader::new);
        let address = output.as_mut().and_then(listening);
        let said = output.and_then(|mut output| {
            // Without the thread the output of the service is lost; the service continues.
            let thread = std::thread::Builder::new().name("flotor-service".to_owned());
            let read = move || {
                let mut rest = String::new();
                let _ = output.read_to_string(&mut rest);
                rest
            };
            thread.spawn(read).ok()
        });
        let mut served = Self { child, said };
        let Some(address) = address else {
            // It has said why.
            let code = served.child.wait().ok().and_then(|status| status.code());
            drop(served);
            std::process::exit(code.unwrap_or(1));
        };
        note(format_args!(
            "`--api {}` is served at {address}: the program has to connect there",
            service.word()
        ));
        Ok(served)
    }

    /// Ends it, prints what it said of the run, and returns its exit code; that is not 0 where its run has failed.
    pub(super) fn finish(mut self) -> i32 {
        let said = self.end();
        if !said.trim().is_empty() {
            say!("{}", said.trim_end());
        }
        self.child.wait().ok().and_then(|status| status.code()).unwrap_or_default()
    }

    /// Ends it; what it said of the run.
    fn end(&mut self) -> String {
        if self.child.try_wait().ok().flatten().is_none() {
            let process = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
            let _ = process.map(|process| kill_process(process, Signal::TERM));
        }
        let _ = self.child.wait();
        self.said.take().and_then(|said| said.join().ok()).unwrap_or_default()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.end();
    }
}

/// Where a service says that it listens; nothing if it ends before.
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
