//! Process for plugin code, in a process group of its own. The whole group is killed when its handle is dropped, and when the thread
//! that started it ends, for any reason.
//!
//! A plugin may hang, ignore signals or start processes. On Windows only the process itself is killed, and the process outlives a
//! killed host: a remedy is a job object, which Flotor does not use yet.

use flotor_servo::platform::process_group;
use std::io;
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::Duration;

/// Poll interval of [`PluginProcess::wait`].
const POLL: Duration = Duration::from_millis(2);

/// Process for plugin code, with its exit status once it has ended. Dropping the handle kills the whole process group.
pub struct PluginProcess {
    pub(crate) child: Child,
    status: Option<ExitStatus>,
}

impl PluginProcess {
    /// Starts a command in a process group of its own; the whole group is killed when the calling thread ends. Not real-time.
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

    /// Returns the exit status if the process has ended, and kills the rest of its group; `None` while the process runs. Does not
    /// wait. Not real-time.
    ///
    /// # Errors
    /// If a system call fails.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        // Killed before the leader is reaped: afterwards the system may reuse the id of the group.
        if self.status.is_none() && process_group::has_ended(&mut self.child)? {
            process_group::kill(&mut self.child);
            self.status = Some(self.child.wait()?);
        }
        Ok(self.status)
    }

    /// Waits for the end of the process, kills the rest of its group, and returns the exit status. Not real-time.
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

    /// Kills the process group and waits for the end of the process. Not real-time.
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
