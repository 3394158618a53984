//! Child processes of `flotor`.

use flotor_command::separate::{Built, SeparateProgram};
use flotor_command::{CommandError, PluginProcess};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::ffi::OsStr;
use std::io::{Read, Seek, SeekFrom, Write};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Program that executes the commands of the checks.
pub(crate) struct Flotor {
    /// Timeout of one process.
    pub(crate) limit: Duration,
}

/// Result of a process.
pub(crate) struct ProcessResult {
    /// Exit code; `None` if a signal ended the process.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    /// Last line of standard error that starts with `error: `, else the last line, else the end of the process.
    pub(crate) error: String,
}

impl ProcessResult {
    /// Parses the JSON on standard output; `None` if it is not valid.
    pub(crate) fn json(&self) -> Option<Value> {
        serde_json::from_str(&self.stdout).ok()
    }
}

impl Flotor {
    /// `flotor`, in the folder of this program.
    const PROGRAM: SeparateProgram<'static> =
        SeparateProgram { program: "flotor", built: Built::WithThis, build: "cargo build --release" };

    /// Creates a runner with a timeout per process. Checks that the program exists, so that a missing program is one
    /// error, not an error of every case.
    pub(crate) fn with_limit(limit: Duration) -> Result<Self, CommandError> {
        Self::PROGRAM.command().map(|_| Self { limit })
    }

    /// Runs `flotor` with `arguments`, and `input` on standard input; kills the process after the time limit.
    ///
    /// # Errors
    /// A message if the program could not be started, or timed out and was killed.
    pub(crate) fn run<I: AsRef<OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = I>,
        input: &str,
    ) -> Result<ProcessResult, String> {
        let mut command = Self::PROGRAM.command().map_err(|error| error.to_string())?;
        let ran = self
            .try_run(command.args(arguments), input)
            .map_err(|cause| format!("cannot run flotor, or keep its output in a temporary file: {cause}; check the permissions and the free disk space"))?;
        ran.ok_or_else(|| {
            format!(
                "the process did not end within {} s, and was killed; raise the limit with --timeout",
                self.limit.as_secs_f64()
            )
        })
    }

    /// Runs `flotor` with `arguments` and parses the JSON on its standard output.
    ///
    /// # Errors
    /// A message: see [`Flotor::run`], or the last line of standard error if there is no valid JSON.
    pub(crate) fn answer<T: DeserializeOwned, I: AsRef<OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = I>,
    ) -> Result<T, String> {
        let ran = self.run(arguments, "")?;
        serde_json::from_str(&ran.stdout).map_err(|_| ran.error)
    }

    /// Runs `command`, with `input` on standard input; returns nothing if the process was killed after the time limit.
    fn try_run(&self, command: &mut Command, input: &str) -> std::io::Result<Option<ProcessResult>> {
        // Files, not pipes: a grandchild process could hold a pipe open for ever.
        let [mut stdin, mut stdout, mut stderr] =
            [tempfile::tempfile()?, tempfile::tempfile()?, tempfile::tempfile()?];
        stdin.write_all(input.as_bytes())?;
        stdin.seek(SeekFrom::Start(0))?;
        command.env("NO_COLOR", "1").stdin(Stdio::from(stdin));
        command.stdout(stdout.try_clone()?).stderr(stderr.try_clone()?);
        let Some(status) = self.wait(command)? else { return Ok(None) };
        let code = status.code();
        let stdout = text(&mut stdout)?;
        let said = text(&mut stderr)?;
        let last = said.lines().rev().find(|line| line.starts_with("error: ")).or(said.lines().last());
        let silent =
            || code.map_or("a signal ended the process".to_owned(), |code| format!("exit code {code}"));
        let error = last.map_or_else(silent, |line| line.trim_start_matches("error: ").to_owned());
        let error = if code.is_none() { format!("a signal killed the process: {error}") } else { error };
        Ok(Some(ProcessResult { code, stdout, error }))
    }

    fn wait(&self, command: &mut Command) -> std::io::Result<Option<ExitStatus>> {
        let mut process = PluginProcess::start(command)?;
        let started = Instant::now();
        loop {
            if let Some(status) = process.try_wait()? {
                return Ok(Some(status));
            }
            if started.elapsed() > self.limit {
                process.kill()?;
                return Ok(None);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

fn text(file: &mut std::fs::File) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
