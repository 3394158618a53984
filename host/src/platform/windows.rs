//! Windows: `flotor lend` and the diagnosis of USB devices are not supported yet.

use flotor_command::CommandError;
use std::io;
use std::path::{Path, PathBuf};

/// Command that builds a plugin in C: the compiler of MinGW-w64.
pub(crate) const C_COMPILER: Option<&str> =
    Some("gcc -std=c11 -O2 -Wall -Wextra -shared -o your_name.dll plugin.c");

/// Returns an absolute path without links, in a form for users and cargo: without the prefix `\\?\` of the system, and with slashes,
/// because backslashes are escapes in a manifest. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn canonical(path: &Path) -> io::Result<PathBuf> {
    let whole = path.canonicalize()?;
    let Some(text) = whole.to_str() else { return Ok(whole) };
    let text = match text.strip_prefix(r"\\?\UNC\") {
        Some(shared) => format!("//{shared}"),
        None => text.trim_start_matches(r"\\?\").to_owned(),
    };
    Ok(PathBuf::from(text.replace('\\', "/")))
}

/// Returns the limit on the number of open files of this process: `None`, unlimited.
pub(crate) fn most_open_files() -> Option<u64> {
    None
}

/// Checks that `flotor lend` is supported on this system.
///
/// # Errors
/// Always: not yet.
pub(crate) fn check_lend() -> Result<(), CommandError> {
    Err(CommandError::Usage(
        "`flotor lend` is not supported on Windows yet: its libraries are for Linux; use `flotor lend` on Linux".to_owned(),
    ))
}

/// Does nothing: only `flotor lend`, which is not supported on Windows, needs it.
pub(crate) fn end_with_parent() {}

pub(crate) mod doctor {
    //! Findings of `flotor doctor` about the operating system.

    use crate::diagnosis::Diagnosis;
    use std::path::Path;

    /// Returns the remedy for missing real-time priority.
    pub(crate) fn priority_remedy(_: &Path) -> String {
        "start the program with normal priority".to_owned()
    }

    /// Returns the remedy for a missing second core.
    pub(crate) fn core_remedy(_: &Path) -> String {
        "use a machine with two cores or more".to_owned()
    }

    /// Remedy for missing locked memory.
    pub(crate) const MEMORY_REMEDY: &str =
        "Windows cannot lock the whole memory of a program; keep some memory free";

    /// Returns the findings other than cores and privileges.
    pub(crate) fn of_the_system(_: &Path) -> Vec<Diagnosis> {
        vec![Diagnosis::note(
            "system",
            "Windows",
            "Windows has no bounded lateness: sufficient for a first test; for bounded lateness use Linux with PREEMPT_RT",
        )]
    }
}

pub(crate) mod usb {
    //! Diagnosis of a device's USB connection, not supported yet.

    use crate::diagnosis::Diagnosis;
    use flotor_hal::UsbKind;
    use std::path::Path;

    /// Placeholder: no files of the machine are read yet.
    pub(crate) struct Machine;

    impl Machine {
        /// Returns the placeholder.
        pub(crate) fn at(_: &Path) -> Self {
            Self
        }
    }

    /// Returns a note that the connection of a device of these kinds is not diagnosed; nothing if the device is open.
    pub(crate) fn connection(_: &Machine, kinds: &[UsbKind], is_open: bool) -> Vec<Diagnosis> {
        if kinds.is_empty() || is_open {
            return Vec::new();
        }
        vec![Diagnosis::note(
            "USB",
            "not checked on Windows yet",
            "the Device Manager lists the connected devices",
        )]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_can_stand_in_a_manifest() {
        let folder = std::env::temp_dir();
        let text = canonical(&folder).expect("it is there").display().to_string();
        assert!(!text.contains(['\\', '?']) && text.contains(":/"), "{text}");
        assert_eq!(canonical(Path::new(&text)).expect("it is the same").display().to_string(), text);
    }
}
