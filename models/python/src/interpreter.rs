//! Interpreter in a separate process, which answers requests over pipes.

use crate::message::{Answer, Kind, VALUES, anchored, question, read_answer};
use flotor_hal::{ContactSet, Input, Pose};
use std::io::{self, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Program of the other end, embedded in the plugin file.
const RUNNER: &str = include_str!("runner.py");
/// Environment variable with the path of the interpreter; `python3` without it.
pub const INTERPRETER: &str = "FLOTOR_PYTHON";
/// Timeout of the start, imports of the file included; shorter than the host's timeout for `prepare`.
const START: Duration = Duration::from_secs(8);
/// Timeout of an answer. An interpreter that hangs must not keep the thread of the model.
const PATIENCE: Duration = Duration::from_millis(500);

/// Interpreter that has loaded a model file. Dropping it ends the process.
pub struct Interpreter {
    process: Child,
    questions: ChildStdin,
    answers: Receiver<io::Result<Answer>>,
}

impl Interpreter {
    /// Starts an interpreter, which loads `file` and passes `argument` to its function `create`, if it has one. Not real-time.
    ///
    /// # Errors
    /// Why it did not start, or the message of the exception with which the file was not loaded.
    pub fn start(file: &Path, argument: &str) -> Result<Self, String> {
        let program = std::env::var_os(INTERPRETER).unwrap_or_else(|| "python3".into());
        let program = program.to_string_lossy();
        let failed = |error: io::Error| {
            format!("cannot start `{program}`: {error}; install Python, or set {INTERPRETER} to its path")
        };
        let mut python = Command::new(&*program);
        python.args(["-c", RUNNER]).arg(file).arg(argument);
        // The runner sends what the file prints to the standard error, which is the host's.
        let mut process = python.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map_err(failed)?;
        let pipes = process.stdin.take().zip(process.stdout.take());
        let (questions, answers) = pipes.ok_or_else(|| failed(io::ErrorKind::BrokenPipe.into()))?;
        let answers = receive(answers).map_err(failed)?;
        let interpreter = Self { process, questions, answers };
        match interpreter.answer(START) {
            Ok(Ok(_)) => Ok(interpreter),
            Ok(Err(exception)) => Err(format!("{}: {exception}", file.display())),
            Err(error) => Err(format!("`{program}` did not load {}: {error}", file.display())),
        }
    }

    /// Returns the contacts at an input. Not real-time: waits up to 0.5 s.
    ///
    /// # Errors
    /// If the interpreter has ended, hangs, or sends no answer: a later answer could be that of an earlier question, so it gets no
    /// further questions. An exception of the function is an error too; the interpreter has shown it.
    pub fn contacts(&mut self, input: &Input, values: &[f64; VALUES]) -> io::Result<Box<ContactSet>> {
        self.ask(Kind::Contacts, input, values).map(|set| anchored(set, input))
    }

    /// Resets the history of the model. Not real-time: waits up to 0.5 s.
    ///
    /// # Errors
    /// As of [`Self::contacts`].
    pub fn reset(&mut self) -> io::Result<()> {
        self.ask(Kind::Reset, &Input::at_rest(Pose::HOME), &[0.0; VALUES]).map(drop)
    }

    fn ask(&mut self, kind: Kind, input: &Input, values: &[f64; VALUES]) -> io::Result<Box<ContactSet>> {
        self.questions.write_all(&question(kind, input, values))?;
        self.answer(PATIENCE)?.map_err(io::Error::other)
    }

    fn answer(&self, patience: Duration) -> io::Result<Answer> {
        match self.answers.recv_timeout(patience) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => Err(io::ErrorKind::TimedOut.into()),
            Err(RecvTimeoutError::Disconnected) => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }

    /// Returns the number of the process.
    #[must_use]
    pub fn process(&self) -> u32 {
        self.process.id()
    }
}

impl Drop for Interpreter {
    fn drop(&mut self) {
        let _ = self.process.kill(); // it may have ended already
        let _ = self.process.wait();
    }
}

/// Starts the thread that reads the answers of a process, because a pipe has no timeout; it ends with the process.
fn receive(answers: ChildStdout) -> io::Result<Receiver<io::Result<Answer>>> {
    let (sender, receiver) = sync_channel(1);
    let mut answers = BufReader::new(answers);
    let body = move || {
        loop {
            let answer = read_answer(&mut answers);
            let is_last = answer.is_err();
            if sender.send(answer).is_err() || is_last {
                return;
            }
        }
    };
    std::thread::Builder::new().name("flotor-python".to_owned()).spawn(body)?;
    Ok(receiver)
}
