//! Separate programs in the folder of this one, with dependencies too large to be built with the core.
//!
//! A program with its own workspace is built into its own folder below the core's `target`: file names of plugin libraries have no
//! hash, so two workspaces with the same target folder would overwrite each other's plugins.

use crate::CommandError;
use crate::platform::{ask_to_end, become_program};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

/// Workspace in which a separate program is built.
pub enum Built {
    /// Built in the workspace of this program.
    WithThis,
    /// Built in its own workspace, with the target folder of this name below `target`.
    OwnWorkspace(&'static str),
}

/// Separate program in the folder of this one, which executes commands of `flotor`.
pub struct SeparateProgram<'a> {
    /// File name, without the suffix of executables.
    pub program: &'a str,
    /// Workspace, which determines the folder of the executable.
    pub built: Built,
    /// Command line that builds the program, for the error about a missing program.
    pub build: &'a str,
}

impl SeparateProgram<'_> {
    /// Viewer, not part of the default build because of its graphics dependencies.
    pub const VIEWER: SeparateProgram<'static> = SeparateProgram {
        program: "flotor-viewer",
        built: Built::WithThis,
        build: "cargo build --release -p flotor-viewer",
    };

    /// Finds the executable and returns a command that starts it.
    ///
    /// # Errors
    /// [`CommandError::Usage`] with the command line that builds the program, if the program is missing; [`CommandError::Failed`]
    /// if the path of this program is unknown.
    pub fn command(&self) -> Result<Command, CommandError> {
        let own = std::env::current_exe().map_err(|cause| CommandError::Failed(cause.to_string()))?;
        let (beside, own_build) = self.places(&own);
        if let Some(file) = [&beside].into_iter().chain(&own_build).find(|file| file.is_file()) {
            return Ok(Command::new(file));
        }
        Err(CommandError::Usage(self.missing(&own)))
    }

    /// Returns the message for a missing program, with the remedy: a build in Flotor's sources, or a copy to the installation.
    fn missing(&self, own: &Path) -> String {
        let (beside, own_build) = self.places(own);
        let build = match (&own_build, profile_of(own)) {
            (None, Some("debug")) => self.build.replace(" --release", ""),
            _ => self.build.to_owned(),
        };
        let file = own_build.unwrap_or(beside);
        match profile_of(own) {
            Some(_) => format!("`{}` does not exist; build it with `{build}`", file.display()),
            None => format!(
                "`{}` does not exist: this installation lacks it; build it in Flotor's sources with `{build}`, and copy it there",
                file.display()
            ),
        }
    }

    /// Returns the possible paths of the executable: in the folder of this program, and in the target folder of the program's own
    /// workspace, if this program is in a target folder.
    fn places(&self, own: &Path) -> (PathBuf, Option<PathBuf>) {
        let name = format!("{}{}", self.program, std::env::consts::EXE_SUFFIX);
        let target = profile_of(own).and(own.parent()).and_then(Path::parent);
        let own_build = match (&self.built, target) {
            (Built::OwnWorkspace(folder), Some(target)) => {
                Some(target.join(folder).join("release").join(&name))
            }
            _ => None,
        };
        (own.with_file_name(name), own_build)
    }

    /// Replaces this process with the separate program, with a command and its arguments, as [`Self::become_with`] does; returns
    /// only on an error.
    ///
    /// # Errors
    /// If the program is missing or cannot be started.
    pub fn carry_out(&self, command: &str, arguments: &[OsString]) -> Result<(), CommandError> {
        self.become_with(&[&[command.into()], arguments].concat())
    }

    /// Replaces this process with the separate program, which then determines output and exit code (on Windows, runs the program
    /// and exits with its exit code); returns only on an error.
    ///
    /// # Errors
    /// If the program is missing or cannot be started.
    pub fn become_with(&self, arguments: &[OsString]) -> Result<(), CommandError> {
        let mut command = self.command()?;
        let cause = become_program(command.args(arguments));
        Err(CommandError::file(command.get_program().as_ref(), "cannot be started", cause))
    }
}

/// Returns the profile with which cargo has built a program; `None` if the program is not in a target folder.
fn profile_of(program: &Path) -> Option<&'static str> {
    let folder = program.parent()?;
    ["debug", "release"].into_iter().find(|profile| folder.ends_with(profile))
}

/// Running separate program. Dropping the value sends SIGTERM, so that the program removes its socket (on Windows kills the
/// program), and waits for the end of the program.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // The id of a process that has ended and been waited for may have been reused for another process.
        if self.0.try_wait().ok().flatten().is_none() {
            ask_to_end(&mut self.0);
        }
        let _ = self.0.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_with_its_own_workspace_is_found_from_both_profiles() {
        let sweeper =
            SeparateProgram { program: "flotor-sweep", built: Built::OwnWorkspace("sweep"), build: "" };
        let name = format!("flotor-sweep{}", std::env::consts::EXE_SUFFIX);
        for profile in ["debug", "release"] {
            let (beside, own_build) = sweeper.places(&Path::new("/f/target").join(profile).join("flotor"));
            assert_eq!(beside, Path::new("/f/target").join(profile).join(&name));
            assert_eq!(own_build, Some(Path::new("/f/target/sweep/release").join(&name)));
        }
        let viewer = SeparateProgram { program: "flotor-viewer", built: Built::WithThis, build: "" };
        assert_eq!(viewer.places(Path::new("/f/target/release/flotor")).1, None);
    }

    #[test]
    fn an_installation_without_a_program_names_its_own_folder() {
        let (built, build) =
            (Built::OwnWorkspace("sweep"), "cargo build --manifest-path interop/sweep/Cargo.toml");
        let sweep = SeparateProgram { program: "flotor-sweep", built, build };
        let name = format!("flotor-sweep{}", std::env::consts::EXE_SUFFIX);
        let missing = sweep.missing(Path::new("/opt/flotor/bin/flotor"));
        assert!(
            missing.contains(&Path::new("/opt/flotor/bin").join(name).display().to_string()),
            "{missing}"
        );
        assert!(missing.contains("installation lacks it") && missing.contains(build), "{missing}");
        let missing = sweep.missing(Path::new("/f/target/debug/flotor"));
        let folder: PathBuf = ["/f/target", "sweep", "release"].iter().collect();
        assert!(missing.contains(&folder.display().to_string()), "{missing}");
        assert!(!missing.contains("installation"), "{missing}");
    }
}
