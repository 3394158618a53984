//! Windows: a port of this machine alone and a secret, both in a file of the user's profile.
//!
//! Every program of this machine can reach the port, but only who can read the file knows the secret: by the rights of the
//! profile that is its user, and administrators. A client that does not send it is rejected, and delays no other.
//! - `announced`: the file; `connections`: those of clients; `datagrams`: those of couplings.

mod announced;
mod connections;
mod datagrams;

pub(crate) use connections::{Listening, Stream, connect, connect_now, has_left};
pub(crate) use datagrams::Datagrams;

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::os::windows::fs::FileExt;
use std::path::{Path, PathBuf};

/// The folder of the runs of this user.
pub(crate) fn run_folder() -> PathBuf {
    let local = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|path| path.is_absolute());
    local.unwrap_or_else(std::env::temp_dir).join("flotor").join("run")
}

/// Returns true if the process has no handle left.
pub(crate) fn is_out_of_descriptors(cause: &io::Error) -> bool {
    const TOO_MANY_OPEN_FILES: i32 = 4;
    cause.raw_os_error() == Some(TOO_MANY_OPEN_FILES)
}

/// Makes a folder, if it is not there. It has the rights of the one above it: in a profile, those of its user.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    std::fs::create_dir_all(path)
}

/// Whether this is a folder, and no link to one.
pub(crate) fn is_ours(attributes: &Metadata) -> bool {
    attributes.is_dir()
}

/// The same: the rights of a folder are not looked at.
pub(crate) fn is_ours_alone(attributes: &Metadata) -> bool {
    is_ours(attributes)
}

/// A file has the rights of its folder.
pub(crate) fn private_file(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Removes the file of a run whose process is no more; true if that is so. The file of one that lives cannot be removed.
pub(crate) fn remove_if_dead(path: &Path) -> bool {
    std::fs::remove_file(path).is_ok() || !path.exists()
}

/// True: the system keeps a file that is open from being replaced.
pub(crate) fn is_same_file(_: &Metadata, _: &Metadata) -> bool {
    true
}

/// Reads from a place of a file; what is beyond its end stays as it was.
pub(crate) fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
    file.seek_read(bytes, offset)
}

/// Overwrites a place of a file.
pub(crate) fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    let written = file.seek_write(bytes, offset)?;
    if written == bytes.len() { Ok(()) } else { Err(io::ErrorKind::WriteZero.into()) }
}
