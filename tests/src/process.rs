//! Child process of a test, killed at the end of the test, also after a panic.
//!
//! The file uses no other module of this crate: the viewer and the bridge include it with `#[path]`.

use rustix::process::{Pid, Signal, kill_process};
use std::ops::{Deref, DerefMut};
use std::process::{Child, Command, Output};
use std::time::Duration;

/// Child process of a test. Dropping it, also by a panic, kills the process if it still runs: otherwise a hanging host would
/// continue after a failed test. Only the process itself is killed, so shell scripts `exec` a program that may hang.
pub struct Owned(Option<Child>);

impl Owned {
    /// Starts a process.
    ///
    /// # Panics
    /// If the process cannot be started.
    #[must_use]
    pub fn start(command: &mut Command) -> Self {
        Self(Some(command.spawn().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"))))
    }

    /// Sends the process a signal.
    ///
    /// # Panics
    /// If the signal cannot be sent, as to a process whose exit code has been read.
    pub fn signal(&self, signal: Signal) {
        kill_process(self.pid(), signal).expect("it is ours");
    }

    /// Returns the process id. No other process gets this id before the value is dropped or its exit code is read.
    #[must_use]
    pub fn pid(&self) -> Pid {
        Pid::from_child(self)
    }

    /// Waits for the process that carries out the command, the only child of the started process, which supervises it; returns
    /// its process id.
    ///
    /// # Panics
    /// If there is no child within five seconds, or there are several children.
    #[must_use]
    pub fn host(&self) -> Pid {
        let number = self.pid().as_raw_nonzero();
        let list = format!("/proc/{number}/task/{number}/children");
        // The child starts soon after its supervisor.
        for _ in 0..1000 {
            let children = std::fs::read_to_string(&list).unwrap_or_default();
            if !children.is_empty() {
                let host = children.trim().parse().expect("one process");
                return Pid::from_raw(host).expect("a number");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("no process under {number}");
    }

    /// Kills the process that carries out the command, the only child of the started process, if it runs.
    pub fn kill_host(&self) {
        let number = self.pid().as_raw_nonzero();
        let children = std::fs::read_to_string(format!("/proc/{number}/task/{number}/children"));
        if let Some(host) = children.unwrap_or_default().trim().parse().ok().and_then(Pid::from_raw) {
            let _ = kill_process(host, Signal::KILL);
        }
    }

    /// Sends a signal to the process that carries out the command, see [`Owned::host`].
    ///
    /// # Panics
    /// As [`Owned::host`], or if the signal cannot be sent.
    pub fn signal_host(&self, signal: Signal) {
        kill_process(self.host(), signal).expect("it is ours");
    }

    /// Waits for the end of the process; returns its exit status, and all its output if it was started with pipes.
    ///
    /// # Panics
    /// If waiting or reading fails.
    #[must_use]
    pub fn output(mut self) -> Output {
        self.0.take().expect(OURS).wait_with_output().expect("it ends")
    }
}

const OURS: &str = "only `output`, which consumes this, takes it away";

impl Deref for Owned {
    type Target = Child;

    fn deref(&self) -> &Child {
        self.0.as_ref().expect(OURS)
    }
}

impl DerefMut for Owned {
    fn deref_mut(&mut self) -> &mut Child {
        self.0.as_mut().expect(OURS)
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
