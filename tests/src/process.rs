//! A process a test has started: it ends with the test, however the test ends.
//!
//! Needs nothing of this crate: the viewer and the bridge include this file with `#[path]`.

use rustix::process::{Pid, Signal, kill_process};
use std::ops::{Deref, DerefMut};
use std::process::{Child, Command, Output};
use std::time::Duration;

/// A process of the test's own. What has not ended when this is dropped, also by a panic, is killed: a host that hangs would else
/// outlive the test that failed. Of a shell that is the shell, so that scripts `exec` what may hang.
pub struct Owned(Option<Child>);

impl Owned {
    /// Starts it.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start(command: &mut Command) -> Self {
        Self(Some(command.spawn().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"))))
    }

    /// Sends it a signal.
    ///
    /// # Panics
    /// If it was waited for.
    pub fn signal(&self, signal: Signal) {
        kill_process(self.pid(), signal).expect("it is ours");
    }

    /// Its number. Nobody else has it until this value is gone.
    #[must_use]
    pub fn pid(&self) -> Pid {
        Pid::from_child(self)
    }

    /// The process that carries out the command: the one that was started supervises it, its only child.
    ///
    /// # Panics
    /// If there is none, or there are several.
    #[must_use]
    pub fn host(&self) -> Pid {
        let number = self.pid().as_raw_nonzero();
        let list = format!("/proc/{number}/task/{number}/children");
        // It starts right after the supervisor.
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

    /// Kills the process that carries out the command, unless it has ended.
    pub fn kill_host(&self) {
        let number = self.pid().as_raw_nonzero();
        let children = std::fs::read_to_string(format!("/proc/{number}/task/{number}/children"));
        if let Some(host) = children.unwrap_or_default().trim().parse().ok().and_then(Pid::from_raw) {
            let _ = kill_process(host, Signal::KILL);
        }
    }

    /// Sends a signal to the process that carries out the command.
    ///
    /// # Panics
    /// As [`Owned::host`].
    pub fn signal_host(&self, signal: Signal) {
        kill_process(self.host(), signal).expect("it is ours");
    }

    /// Waits for its end, and for all it writes until then.
    ///
    /// # Panics
    /// If it cannot be waited for.
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
