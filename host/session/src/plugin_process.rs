//! Process for the code of plugins: it ends with the thread that started it, for any reason, and takes all processes of its process
//! group with it.
//!
//! A plugin may hang, ignore signals or start processes; none of them outlives the thread that waits for an answer. On Windows only
//! the process itself is killed, and it outlives a killed host: a remedy is a job object, which Flotor does not use yet.

use crate::platform::process_group;
use std::io;
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::Duration;

/// Poll interval of [`PluginProcess::wait`].
const POLL: Duration = Duration::from_millis(2);

/// A running process for the code of plugins. Dropping it kills the whole process group.
pub struct PluginProcess {
    pub(crate) child: Child,
    status: Option<ExitStatus>,
}

impl PluginProcess {
    /// Starts a command in a process group of its own; the system kills it when the calling thread ends. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start the process.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        process_group::lead_until_parent_ends(command);
        Ok(Self { child: command.spawn()?, status: None })
    }

    /// Returns the process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns the status of a process that has ended, and kills the rest of its group. Does not wait. Not real-time.
    ///
    /// # Errors
    /// If a system call fails.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        // The id of the group is free once its leader was waited for.
        if self.status.is_none() && process_group::has_ended(&mut self.child)? {
            process_group::kill(&mut self.child);
            self.status = Some(self.child.wait()?);
        }
        Ok(self.status)
    }

    /// Waits for the end of the process, and kills the rest of its group. Not real-time.
    ///
    /// # Errors
    /// If a system call fails.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        loop {
            if let Some(status) = self.try_wait()? {
                return Ok(status);
            }
            sleep(POLL);
        }
    }

    /// Kills the process group and waits for its end. Not real-time.
    ///
    /// # Errors
    /// If a system call fails.
    pub fn kill(&mut self) -> io::Result<()> {
        if self.status.is_none() {
            process_group::kill(&mut self.child);
            self.status = Some(self.child.wait()?);
        }
        Ok(())
    }
}

impl Drop for PluginProcess {
    fn drop(&mut self) {
        let _ = self.kill();
    }
}
