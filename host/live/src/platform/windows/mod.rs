//! Windows: a local port and a secret, both announced in a file in the user's profile.
//!
//! Every program on this machine can reach the port, but only programs that may read the file know the secret: by the permissions
//! of the profile, programs of the user and of administrators. A client that does not send the secret is rejected, and delays no
//! other client.
//! - `announced`: the file; `connections`: connections of clients; `datagrams`: datagrams of couplings.

mod announced;
mod connections;
mod datagrams;

pub(crate) use connections::{Listening, Stream, connect, connect_now, has_left};
pub(crate) use datagrams::Datagrams;

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::os::windows::fs::FileExt;
use std::path::{Path, PathBuf};

/// Returns the folder for the runs of this user if `XDG_RUNTIME_DIR` is not a folder.
pub(crate) fn run_folder() -> PathBuf {
    let local = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|path| path.is_absolute());
    local.unwrap_or_else(std::env::temp_dir).join("flotor").join("run")
}

/// Returns true if the process has no handle left.
pub(crate) fn is_out_of_descriptors(cause: &io::Error) -> bool {
    const TOO_MANY_OPEN_FILES: i32 = 4;
    cause.raw_os_error() == Some(TOO_MANY_OPEN_FILES)
}

/// Creates a folder, if necessary. The folder inherits the permissions of its parent: inside a user profile, other
/// users have no access.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    std::fs::create_dir_all(path)
}

/// Returns true for a folder that is not a link; its owner is not checked.
pub(crate) fn is_ours(attributes: &Metadata) -> bool {
    attributes.is_dir()
}

/// Returns true for a folder that is not a link; its permissions are not checked.
pub(crate) fn is_ours_alone(attributes: &Metadata) -> bool {
    is_ours(attributes)
}

/// Changes nothing: a file inherits the permissions of its folder.
pub(crate) fn private_file(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Removes the file of a run whose process has ended; returns true if the file is gone. The system prevents the removal while the
/// process is running.
pub(crate) fn remove_if_dead(path: &Path) -> bool {
    std::fs::remove_file(path).is_ok() || !path.exists()
}

/// Returns true: the system prevents the replacement of an open file.
pub(crate) fn is_same_file(_: &Metadata, _: &Metadata) -> bool {
    true
}

/// Reads from an offset of a file; `bytes` beyond the end of the file are not changed.
pub(crate) fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
    file.seek_read(bytes, offset)
}

/// Overwrites bytes at an offset of a file.
pub(crate) fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    let written = file.seek_write(bytes, offset)?;
    if written == bytes.len() { Ok(()) } else { Err(io::ErrorKind::WriteZero.into()) }
}
