//! Errors of `flotor new`.

use super::name::NameError;
use std::path::PathBuf;

/// Reason why a plugin was not created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScaffoldError {
    /// The name is not valid.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The plugin's type would have the name of a type of the contract that the template uses.
    #[error("type `{type_name}` of plugin `{id}` clashes with a name that the template uses; use `my-{id}`")]
    Clash {
        /// Id of the plugin.
        id: String,
        /// Name of the type.
        type_name: String,
    },
    /// A file or folder of this name exists.
    #[error("{} exists; move it or choose another name", .0.display())]
    Exists(PathBuf),
    /// The folder belongs to Flotor's own workspace, which would include the plugin as a member.
    #[error(
        "{} belongs to Flotor's own workspace, whose plugins use `flotor-hal.workspace = true` (see \
         ARCHITECTURE.md, Adding a plugin); change to a folder outside it",
        .0.display()
    )]
    InsideWorkspace(PathBuf),
    /// The contract's sources were not found; the path is the named folder, or else that of an installation.
    #[error(
        "the sources of the contract (manifest and `src/` of flotor-hal) are not at {}; give their folder, such as \
         `share/flotor/hal` of an installation, with --hal PATH",
        .0.display()
    )]
    NoContract(PathBuf),
    /// The manifest of the contract cannot be copied.
    #[error("{}: {reason}; give the folder of complete sources with --hal PATH", path.display())]
    Manifest {
        /// Path of the manifest.
        path: PathBuf,
        /// Reason as text.
        reason: String,
    },
    /// A path is not valid UTF-8, or has characters that cargo's configuration cannot hold.
    #[error("{}: the path is not valid UTF-8, or has a double quote, a backslash or a line break; move the sources to another folder, or copy them with --vendor", .0.display())]
    NotText(PathBuf),
    /// A file or folder of the contract cannot be read.
    #[error("{}: cannot read: {cause}; check its permissions, or give the folder of complete sources with --hal PATH", path.display())]
    Read {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// A file or folder cannot be written.
    #[error("{}: cannot write: {cause}; choose a folder where you may write", path.display())]
    Write {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the system.
        cause: std::io::Error,
    },
}
