//! Runs of the `flotor` program as a user starts it: arguments in; exit code, standard output and standard error out.

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
use std::time::SystemTime;

/// Exit codes of the command line, on which scripts rely.
pub mod exit_code {
    /// Success.
    pub const OK: i32 = 0;
    /// Error without an exit code of its own.
    pub const OTHER: i32 = 1;
    /// Error in arguments or configuration.
    pub const CONFIGURATION: i32 = 2;
    /// Refused plugin.
    pub const PLUGIN_REFUSED: i32 = 3;
    /// Fault of the device.
    pub const DEVICE_FAULT: i32 = 4;
}

/// Runs a program and writes its peak memory, with its processes', as the last line of standard error. A shell starts the program and ends,
/// so that the program becomes a child of the script (`PR_SET_CHILD_SUBREAPER`): a direct child would count the memory of Python,
/// more than that of many commands, as its own before it starts.
const PEAK: &str = "
import ctypes, os, sys
assert ctypes.CDLL(None).prctl(36, 1, 0, 0, 0) == 0
numbers, number = os.pipe()
os.set_inheritable(number, True)
shell = ['sh', '-c', f'\"$@\" {number}>&- & echo $! >&{number}', 'sh']
os.posix_spawnp('sh', shell + sys.argv[1:], os.environ)
os.close(number)
program = int(os.read(numbers, 20))
while True:
    ended, status, usage = os.wait4(-1, 0)
    if ended == program:
        print(usage.ru_maxrss, file=sys.stderr)
        sys.exit(os.waitstatus_to_exitcode(status))
";

/// Builder for a run of the program.
pub struct Flotor {
    command: Command,
    input: String,
    /// Runtime folder of the program's runs and emergency stops, separate from other tests and from the user.
    runtime: Scratch,
}

/// Exit code and output of a finished run of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ran {
    /// Exit code; `None` if a signal ended the program.
    pub code: Option<i32>,
    /// Complete standard output.
    pub stdout: String,
    /// Complete standard error.
    pub stderr: String,
}

impl Flotor {
    /// Prepares a run of the program with these arguments, only its own plugin folders, no colours, and a separate runtime folder.
    /// The environment variable `FLOTOR_RUNNER` is a command that runs the program, such as an emulator of another processor:
    /// `FLOTOR_RUNNER="qemu-x86_64 -cpu qemu64"`.
    ///
    /// # Panics
    /// If the program or one of its separate programs is not built, or older than one of its sources.
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
        // The output of a plugin's panic must not depend on the environment of the tests.
        command.env("RUST_BACKTRACE", "1");
        let runtime = Scratch::default();
        command.env("XDG_RUNTIME_DIR", runtime.path());
        Self { command, input: String::new(), runtime }
    }

    /// Sets the folders that the program searches for plugins, first to last, before its own folders.
    ///
    /// # Panics
    /// If the path of a folder contains the separator of path lists.
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

    /// Sets the working folder of the program.
    #[must_use]
    pub fn inside(mut self, folder: &Path) -> Self {
        self.command.current_dir(folder);
        self
    }

    /// Runs the shell script `script` with `sh` instead of the program; the script gets the program and its arguments as `"$@"`.
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

    /// Makes the program the leader of a process group, as an interactive shell does: signals of a terminal reach the group.
    #[must_use]
    pub fn leading_a_group(mut self) -> Self {
        self.command.process_group(0);
        self
    }

    /// Sets the text of standard input.
    #[must_use]
    pub fn reading(mut self, input: impl Into<String>) -> Self {
        self.input = input.into();
        self
    }

    /// Runs the program to its end.
    ///
    /// # Panics
    /// If the program cannot be started, or its output is not UTF-8.
    #[must_use]
    pub fn run(self) -> Ran {
        self.start().wait()
    }

    /// Runs the program to its end with Python; also returns the peak resident memory of the largest of its processes, KiB. The
    /// kernel measures it: samples of a test would miss the last moments of a short run on a busy machine.
    ///
    /// # Panics
    /// As [`Self::run`], or if the memory is no number.
    #[must_use]
    pub fn run_with_peak_kib(self) -> (Ran, u64) {
        let mut ran = self.through_shell(r#"exec python3 -c "$PEAK" "$@""#).env("PEAK", PEAK).run();
        let (stderr, peak_kib) =
            ran.stderr.trim_end().rsplit_once('\n').unwrap_or(("", ran.stderr.trim_end()));
        let peak_kib = peak_kib.parse().expect("the last line is the peak");
        ran.stderr = stderr.to_owned();
        (ran, peak_kib)
    }

    /// Starts the program, and a thread that writes its standard input.
    ///
    /// # Panics
    /// If the program cannot be started.
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

/// Running program: an [`Owned`] process.
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
    /// Waits for the end of the program; returns its exit code and output.
    ///
    /// # Panics
    /// If waiting fails, or the output is not UTF-8.
    #[must_use]
    pub fn wait(self) -> Ran {
        let output = self.process.output();
        // A program that ends early, as with wrong arguments, closes the pipe; a write error is then expected.
        let _ = self.writer.join().expect("the writer only writes");
        let text = |bytes| String::from_utf8(bytes).expect("the program writes text");
        Ran { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

impl Ran {
    /// Returns the text after `error: ` on standard error.
    ///
    /// # Panics
    /// If standard error is not a single line `error: ...`.
    #[must_use]
    pub fn error(&self) -> &str {
        let mut lines = self.stderr.lines();
        match (lines.next().and_then(|line| line.strip_prefix("error: ")), lines.next()) {
            (Some(error), None) => error,
            _ => panic!("one line `error: ...` was expected on standard error: {self:#?}"),
        }
    }
}

/// Separate programs that `flotor` starts for some commands. `cargo test` builds them, because each has an integration test.
const SEPARATE: [&str; 6] =
    ["flotor-lab", "flotor-study", "flotor-calibration", "flotor-identify", "flotor-test", "flotor-lend"];

/// Returns the path of `flotor` in the build folder; panics if it or a separate program is missing or not up to date.
fn program() -> PathBuf {
    for name in SEPARATE {
        current(name);
    }
    current("flotor")
}

/// Returns the path of a program in the build folder; panics if the program is missing or older than one of its sources.
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

/// Returns the sources of a program, from cargo's dependency file beside it: `cargo test -p flotor-tests` does not rebuild the
/// program, so a test could run an old version.
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

    /// Asserts that a process is killed by a panic in the test that started it.
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
