//! Programs of their own that lie beside this one: what is too heavy to be built with the core.

use super::CommandError;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// A program beside this one.
pub(super) struct Companion<'a> {
    /// Its file, without the suffix of executables.
    pub(super) program: &'a str,
    /// The command that builds it.
    pub(super) build: &'a str,
}

impl Companion<'_> {
    /// A command that starts it.
    ///
    /// # Errors
    /// [`CommandError::Usage`] with the command that builds it, if it is not there.
    pub(super) fn command(&self) -> Result<Command, CommandError> {
        let own = std::env::current_exe().map_err(|cause| CommandError::Failed(cause.to_string()))?;
        let file = own.with_file_name(format!("{}{}", self.program, std::env::consts::EXE_SUFFIX));
        if file.is_file() {
            return Ok(Command::new(file));
        }
        Err(CommandError::Usage(format!("there is no `{}`; `{}` builds it", file.display(), self.build)))
    }

    /// Becomes the companion: its words and its exit code are those of this command.
    pub(super) fn become_with(&self, arguments: &[OsString]) -> Result<(), CommandError> {
        let cause = self.command()?.args(arguments).exec();
        Err(CommandError::file(self.program.as_ref(), "cannot be started", cause))
    }
}
