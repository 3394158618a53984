//! Check that calls stay inside their own memory and the memory passed to them.
//!
//! The process of this rule is started with its own allocator (`lab/guard`), in which every block ends at an
//! inaccessible page: a read or write past its end ends the process there, and a damaged edge is found when the block
//! is freed. Input and output of a call are blocks too.

use super::life::live;
use super::outcome::Outcome;
use super::subject::Subject;
use crate::platform::state;
use std::path::{Path, PathBuf};
use std::process::Command;

/// File name of the allocator: beside this program, where cargo and the installation put libraries.
const LIBRARY: &str = "libflotor_guard.so";

/// Adds the allocator to a command's environment, if the file exists.
pub(super) fn with_guard(command: &mut Command) {
    if let Some(library) = Path::new(command.get_program()).parent().and_then(beside) {
        command.env("LD_PRELOAD", library);
    }
}

fn beside(folder: &Path) -> Option<PathBuf> {
    // `deps` first, as for plugins: cargo updates only that copy.
    let folders = ["deps", ".", "../lib/flotor"];
    folders.map(|place| folder.join(place).join(LIBRARY)).into_iter().find(|file| file.is_file())
}

/// Runs the life of an instance under the allocator.
pub(super) fn inside_memory(subject: &Subject) -> Result<(), Outcome> {
    state::is_loaded_first(LIBRARY)?;
    live(subject, &mut |_, _| Ok(()))
}
