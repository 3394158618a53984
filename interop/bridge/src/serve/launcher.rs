//! Starting the scene of a bridge when its owner asks for it.

use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// A scene that may be started from the network: one that somebody on this machine named, never one that comes from there.
#[derive(Debug)]
pub struct Launcher {
    program: PathBuf,
    scene: PathBuf,
    child: Option<Child>,
}

impl Launcher {
    /// Of a scene, run by this `flotor` program.
    #[must_use]
    pub fn new(program: PathBuf, scene: PathBuf) -> Self {
        Self { program, scene, child: None }
    }

    /// Starts it.
    ///
    /// # Errors
    /// In words: it runs already, or the system says no.
    pub fn start(&mut self) -> Result<(), String> {
        if self.runs() {
            return Err("the scene runs already".to_owned());
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
