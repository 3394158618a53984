//! The `flotor` program as a user meets it: arguments in; exit code, standard output and standard error out.

use crate::library::build_folder;
use crate::process::Owned;
use crate::scratch::Scratch;
use std::ffi::OsStr;
use std::io::Write;
use std::ops::{Deref, DerefMut};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

/// Exit codes of the command line, a contract with scripts.
pub mod exit_code {
    /// All went well.
    pub const OK: i32 = 0;
    /// Anything that is none of the others.
    pub const OTHER: i32 = 1;
    /// Usage or configuration.
    pub const CONFIGURATION: i32 = 2;
    /// A plugin was refused.
    pub const PLUGIN_REFUSED: i32 = 3;
    /// The device faulted.
    pub const DEVICE_FAULT: i32 = 4;
}

/// One call of the program, being put together.
pub struct Flotor {
    command: Command,
    input: String,
    /// Where its runs are found and its emergency stops stay: no test meets those of another, or of who runs the tests.
    runtime: Scratch,
}

/// What came of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ran {
    /// Exit code; `None` if a signal ended the program.
    pub code: Option<i32>,
    /// Everything on standard output.
    pub stdout: String,
    /// Everything on standard error.
    pub stderr: String,
}

impl Flotor {
    /// The program with these arguments, no plugin folders but its own, and no colours. `FLOTOR_RUNNER` is a command that runs
    /// it, as an emulator of another processor does: `FLOTOR_RUNNER="qemu-x86_64 -cpu qemu64"`.
    ///
    /// # Panics
    /// If the program is not built, or older than a source it is made of.
    #[must_use]
    pub fn with<I: AsRef<OsStr>>(arguments: impl IntoIterator<Item = I>) -> Self {
        let mut command = match std::env::var("FLOTOR_RUNNER") {
            Ok(runner) => {
                let mut command = Command::new("sh");
                command.args(["-c", &format!("exec {runner} \"$@\""), "sh"]).arg(program());
                command
            }
            Err(_) => Command::new(program()),
        };
        command.args(arguments).env_remove(flotor_session::registry::PATH_VARIABLE).env("NO_COLOR", "1");
        // What a plugin's panic would do to a terminal must not depend on how the tests were started.
        command.env("RUST_BACKTRACE", "1");
        let runtime = Scratch::default();
        command.env("XDG_RUNTIME_DIR", runtime.path());
        Self { command, input: String::new(), runtime }
    }

    /// Searches these folders for plugins, first to last, before the program's own.
    ///
    /// # Panics
    /// If a folder's name holds the separator of paths.
    #[must_use]
    pub fn searching(mut self, folders: &[&Path]) -> Self {
        let path = std::env::join_paths(folders).expect("a scratch folder has a plain name");
        self.command.env(flotor_session::registry::PATH_VARIABLE, path);
        self
    }

    /// Sets an environment variable.
    #[must_use]
    pub fn env(mut self, name: &str, value: &str) -> Self {
        self.command.env(name, value);
        self
    }

    /// Runs it in this folder.
    #[must_use]
    pub fn inside(mut self, folder: &Path) -> Self {
        self.command.current_dir(folder);
        self
    }

    /// Runs it through `sh`: `script` gets the program and its arguments as `"$@"`.
    #[must_use]
    pub fn through_shell(mut self, script: &str) -> Self {
        let mut shell = Command::new("sh");
        shell.args(["-c", script, "sh"]).arg(self.command.get_program()).args(self.command.get_args());
        for (name, value) in self.command.get_envs() {
            match value {
                Some(value) => shell.env(name, value),
                None => shell.env_remove(name),
            };
        }
        if let Some(folder) = self.command.get_current_dir() {
            shell.current_dir(folder);
        }
        self.command = shell;
        self
    }

    /// Runs it as the leader of a process group, as a shell does: what its terminal sends reaches the group.
    #[must_use]
    pub fn leading_a_group(mut self) -> Self {
        self.command.process_group(0);
        self
    }

    /// Text for standard input.
    #[must_use]
    pub fn reading(mut self, input: impl Into<String>) -> Self {
        self.input = input.into();
        self
    }

    /// Runs the program to its end.
    ///
    /// # Panics
    /// If it cannot be started, or its output is not text.
    #[must_use]
    pub fn run(self) -> Ran {
        self.start().wait()
    }

    /// Starts the program.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start(mut self) -> Running {
        self.command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut process = Owned::start(&mut self.command);
        let (mut pipe, input) = (process.stdin.take().expect("a pipe was requested"), self.input);
        // On a thread of its own: neither side waits for the other to empty a full pipe.
        let writer = std::thread::spawn(move || pipe.write_all(input.as_bytes()));
        Running { process, writer, _runtime: self.runtime }
    }
}

/// A call that has been started: an [`Owned`] process.
pub struct Running {
    process: Owned,
    writer: JoinHandle<std::io::Result<()>>,
    _runtime: Scratch,
}

impl Deref for Running {
    type Target = Owned;

    fn deref(&self) -> &Owned {
        &self.process
    }
}

impl DerefMut for Running {
    fn deref_mut(&mut self) -> &mut Owned {
        &mut self.process
    }
}

impl Running {
    /// Waits for its end; returns the largest resident memory of the process that carries out the command as well, KiB.
    /// For programs that write less than a pipe holds.
    ///
    /// # Panics
    /// As [`Self::wait`].
    #[must_use]
    pub fn wait_with_peak_kib(self) -> (Ran, u64) {
        let status = format!("/proc/{}/status", self.host().as_raw_nonzero());
        let mut peak_kib = 0;
        while let Ok(text) = std::fs::read_to_string(&status) {
            let Some(line) = text.lines().find_map(|line| line.strip_prefix("VmHWM:")) else { break };
            peak_kib = peak_kib.max(line.trim().trim_end_matches("kB").trim().parse().unwrap_or(0));
            std::thread::sleep(Duration::from_millis(2));
        }
        (self.wait(), peak_kib)
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// If its output is not text.
    #[must_use]
    pub fn wait(self) -> Ran {
        let output = self.process.output();
        // A program that stops reading because its arguments are wrong closes the pipe: its business.
        let _ = self.writer.join().expect("the writer only writes");
        let text = |bytes| String::from_utf8(bytes).expect("the program writes text");
        Ran { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

impl Ran {
    /// The one line on standard error, after `error: `.
    ///
    /// # Panics
    /// If there is more or less than that one line.
    #[must_use]
    pub fn error(&self) -> &str {
        let mut lines = self.stderr.lines();
        match (lines.next().and_then(|line| line.strip_prefix("error: ")), lines.next()) {
            (Some(error), None) => error,
            _ => panic!("one line `error: ...` was expected on standard error: {self:#?}"),
        }
    }
}

/// What `flotor` starts for its commands. Built, as itself, by the same `cargo test`, because each has an integration test.
const SEPARATE: [&str; 4] = ["flotor-lab", "flotor-study", "flotor-calibration", "flotor-test"];

/// The program beside the tests.
fn program() -> PathBuf {
    for name in SEPARATE {
        current(name);
    }
    current("flotor")
}

/// A program beside the tests, which must be as new as its sources.
fn current(name: &str) -> PathBuf {
    let file = build_folder().join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    let build = if cfg!(debug_assertions) { "cargo build" } else { "cargo build --release" };
    let Ok(built) = std::fs::metadata(&file).and_then(|attributes| attributes.modified()) else {
        panic!("{} is missing: run `{build}`, or all tests with `cargo test`", file.display());
    };
    if let Some(source) = sources(name).into_iter().find(|source| changed_since(source, built)) {
        panic!(
            "{} is older than {}: run `{build}`, or all tests with `cargo test`",
            file.display(),
            source.display()
        );
    }
    file
}

/// What a program was made of, as cargo noted it beside the program: `cargo test -p flotor-tests` does not build it
/// again, so a test could meet the program of yesterday.
fn sources(name: &str) -> Vec<PathBuf> {
    let notes = std::fs::read_to_string(build_folder().join(format!("{name}.d"))).unwrap_or_default();
    let files = notes.lines().next().and_then(|line| line.split_once(": ")).map_or("", |(_, files)| files);
    // A space within a name is written `\ `.
    let files = files.replace("\\ ", "\0");
    files.split_whitespace().map(|file| PathBuf::from(file.replace('\0', " "))).collect()
}

fn changed_since(source: &Path, built: SystemTime) -> bool {
    std::fs::metadata(source)
        .and_then(|attributes| attributes.modified())
        .is_ok_and(|changed| changed > built)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Scratch;
    use rustix::io::Errno;
    use rustix::process::{Pid, test_kill_process};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// Fails as a test does that has started something, which has to be gone then.
    fn assert_gone_after_a_failure<T>(start: impl FnOnce() -> T, pid: impl Fn(&T) -> Pid) {
        let mut number = None;
        let failed = catch_unwind(AssertUnwindSafe(|| {
            let started = start();
            number = Some(pid(&started));
            assert_eq!(test_kill_process(pid(&started)), Ok(()), "it is there");
            panic!("as a test does");
        }));
        assert!(failed.is_err());
        assert_eq!(test_kill_process(number.expect("it was started")), Err(Errno::SRCH), "it is gone");
    }

    #[test]
    fn a_process_is_gone_when_its_test_fails() {
        assert_gone_after_a_failure(|| Owned::start(Command::new("sleep").arg("600")), Owned::pid);
    }

    #[test]
    fn a_host_is_gone_when_its_test_fails() {
        let scratch = Scratch::default();
        let scene = scratch.patient_scene(flotor_session::scene::DEMO).display().to_string();
        let start = || Flotor::with(["run", &scene, "--duration", "600s"]).start();
        assert_gone_after_a_failure(start, |running| running.pid());
    }
}
