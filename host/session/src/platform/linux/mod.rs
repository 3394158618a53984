//! Linux: owners and permissions of folders, identity of files, state of the process.

mod locale;
mod machine;
#[cfg(test)]
mod tests;
mod thread_clock;

pub(crate) use machine::MachineState;
pub use thread_clock::ThreadClock;

use rustix::process::geteuid;
use std::fs::Metadata;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Warning, for users, about ends of this process that stop no device; none on Linux.
pub(crate) const NOT_CAUGHT: Option<&str> = None;

/// Returns device and inode number, which together identify an existing file.
pub(crate) fn identity(file: &Metadata) -> [u64; 2] {
    [file.dev(), file.ino()]
}

/// Returns the time of the last change of contents or attributes (ctime), s and ns since 1970; programs cannot set this time back.
pub(crate) fn changed(file: &Metadata) -> (i64, i64) {
    (file.ctime(), file.ctime_nsec())
}

/// Returns true if two paths lead to the same existing file. Not real-time.
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    let of = |path: &Path| std::fs::metadata(path).map(|file| identity(&file));
    matches!((of(one), of(other)), (Ok(one), Ok(other)) if one == other)
}

/// Error text if the system does not report the path of this program.
pub(crate) const UNKNOWN_PROGRAM: &str = "the folder of this program is unknown, because /proc is not mounted: \
mount /proc, or give plugin folders with --plugin-path";

/// Returns the plugin folder of the user, shared by all installations (XDG base directory specification); `None` for root, because a
/// file in a home folder must not run with root privileges, and without `XDG_DATA_HOME` and `HOME`.
pub(crate) fn user_folder() -> Option<PathBuf> {
    if geteuid().is_root() {
        return None;
    }
    let absolute = |variable| std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let data = absolute("XDG_DATA_HOME").or_else(|| Some(absolute("HOME")?.join(".local/share")));
    Some(data?.join("flotor/plugins"))
}

/// Returns the reason why a folder is not searched, if another user could place a plugin there; `None` for a folder that is not
/// world-writable and belongs to root, the user or the owner of this program.
pub(crate) fn distrust(folder: &Path, attributes: &Metadata) -> Option<String> {
    let folder = folder.display();
    if attributes.permissions().mode() & 0o002 != 0 {
        return Some(format!(
            "every user may write into the folder, and loading a plugin runs its code; `chmod o-w {folder}`"
        ));
    }
    let owner = attributes.uid();
    let owns_program =
        || std::env::current_exe().and_then(std::fs::metadata).is_ok_and(|own| own.uid() == owner);
    (owner != 0 && owner != geteuid().as_raw() && !owns_program()).then(|| {
        format!("user {owner} owns the folder, and loading a plugin runs its code; `chown` the folder, or copy its \
        plugins to a folder of yours")
    })
}
