//! Start of the bridge's scene at the request of a member with the right `own`.

use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// Starter of one scene file, chosen on this machine: a request over the network cannot name another.
#[derive(Debug)]
pub struct Launcher {
    program: PathBuf,
    scene: PathBuf,
    child: Option<Child>,
}

impl Launcher {
    /// Creates a launcher that runs `scene` with the `flotor` executable `program`.
    #[must_use]
    pub fn new(program: PathBuf, scene: PathBuf) -> Self {
        Self { program, scene, child: None }
    }

    /// Starts a process that runs the scene, without standard input and output.
    ///
    /// # Errors
    /// The cause as text: an earlier process still runs, or the system refuses.
    pub fn start(&mut self) -> Result<(), String> {
        if self.runs() {
            return Err("the process of an earlier start has not ended; try again in a few seconds".into());
        }
        let mut command = Command::new(&self.program);
        command.arg("run").arg(&self.scene).stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.spawn().map_err(|cause: io::Error| {
            format!("the bridge cannot start `{}`: {cause}; on its machine, install `flotor` in the folder of `flotor-bridge`", self.program.display())
        })?;
        self.child = Some(child);
        Ok(())
    }

    fn runs(&mut self) -> bool {
        self.child.as_mut().is_some_and(|child| matches!(child.try_wait(), Ok(None)))
    }
}
