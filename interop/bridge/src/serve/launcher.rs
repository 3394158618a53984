//! Start of the bridge's scene on request of its owner.

use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// Starter of a scene that was named on this machine, never of one from the network.
#[derive(Debug)]
pub struct Launcher {
    program: PathBuf,
    scene: PathBuf,
    child: Option<Child>,
}

impl Launcher {
    /// Creates a launcher of a scene, run by this `flotor` program.
    #[must_use]
    pub fn new(program: PathBuf, scene: PathBuf) -> Self {
        Self { program, scene, child: None }
    }

    /// Starts the scene.
    ///
    /// # Errors
    /// The cause as text: the scene is running already, or the system refuses.
    pub fn start(&mut self) -> Result<(), String> {
        if self.runs() {
            return Err("the scene is running already; stop the run first".to_owned());
        }
        let mut command = Command::new(&self.program);
        command.arg("run").arg(&self.scene).stdin(Stdio::null()).stdout(Stdio::null());
        let child = command
            .spawn()
            .map_err(|cause: io::Error| format!("`{}` cannot be started: {cause}", self.program.display()))?;
        self.child = Some(child);
        Ok(())
    }

    fn runs(&mut self) -> bool {
        self.child.as_mut().is_some_and(|child| matches!(child.try_wait(), Ok(None)))
    }
}
