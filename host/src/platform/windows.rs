//! Windows: neither programs of other makers nor the state of devices on USB yet.

use std::io;
use std::path::{Path, PathBuf};

/// What builds a plugin in C: the compiler of MinGW-w64.
pub(crate) const C_COMPILER: Option<&str> =
    Some("gcc -std=c11 -O2 -Wall -Wextra -shared -o your_name.dll plugin.c");

/// A path from the root, without links; as people and cargo write it: without the prefix that the system puts before it, and with
/// slashes instead of backslashes, which would begin something else in a manifest. Not real-time.
///
/// # Errors
/// What the system says.
pub(crate) fn canonical(path: &Path) -> io::Result<PathBuf> {
    let whole = path.canonicalize()?;
    let Some(text) = whole.to_str() else { return Ok(whole) };
    let text = match text.strip_prefix(r"\\?\UNC\") {
        Some(shared) => format!("//{shared}"),
        None => text.trim_start_matches(r"\\?\").to_owned(),
    };
    Ok(PathBuf::from(text.replace('\\', "/")))
}

/// How many files this process may have open: as many as it likes.
pub(crate) fn most_open_files() -> Option<u64> {
    None
}

/// From now on this process ends with the one that started it: only `flotor lend` needs that.
pub(crate) fn end_with_parent() {}

pub(crate) mod doctor {
    //! What `flotor doctor` finds in the system.

    use crate::cli::doctor::Diagnosis;
    use std::path::Path;

    /// Returns how a user gets a priority.
    pub(crate) fn priority_remedy(_: &Path) -> String {
        "start the program with normal priority".to_owned()
    }

    /// Returns how a user gets a second core.
    pub(crate) fn core_remedy(_: &Path) -> String {
        "use a machine with two cores or more".to_owned()
    }

    /// How a user gets locked memory.
    pub(crate) const MEMORY_REMEDY: &str =
        "Windows locks the memory of no whole program; keep some memory free";

    /// Returns the findings beside cores and privileges.
    pub(crate) fn of_the_system(_: &Path) -> Vec<Diagnosis> {
        vec![Diagnosis::note(
            "system",
            "Windows",
            "it promises no time: sufficient for a first test; for bounded lateness use Linux with PREEMPT_RT",
        )]
    }
}

pub(crate) mod usb {
    //! The connection of a device on USB.

    use crate::cli::doctor::Diagnosis;
    use flotor_hal::UsbKind;
    use std::path::Path;

    /// What the machine says of its devices: it is not asked yet.
    pub(crate) struct Machine;

    impl Machine {
        /// Of the machine itself.
        pub(crate) fn at(_: &Path) -> Self {
            Self
        }
    }

    /// What is known of the connection of a device of these kinds.
    pub(crate) fn connection(_: &Machine, kinds: &[UsbKind], is_open: bool) -> Vec<Diagnosis> {
        if kinds.is_empty() || is_open {
            return Vec::new();
        }
        vec![Diagnosis::note(
            "USB",
            "not looked at on Windows yet",
            "the Device Manager lists what is connected",
        )]
    }
}

pub(crate) mod lend {
    //! `flotor lend`.

    use clap::Args;
    use flotor_command::CommandError;
    use std::ffi::OsString;

    /// Run an unmodified program, written for another maker's device (on Linux only)
    #[derive(Args)]
    pub(crate) struct LendArguments {
        /// What is given on Linux
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
        _arguments: Vec<OsString>,
    }

    #[allow(clippy::needless_pass_by_value)] // as elsewhere
    pub(crate) fn run(_: LendArguments) -> Result<(), CommandError> {
        Err(CommandError::Usage("`flotor lend` is not on Windows yet: its libraries are Linux's".to_owned()))
    }

    pub(crate) mod guard {
        //! The guard of a program of `flotor lend`.

        use flotor_command::CommandError;

        /// Arguments of the guard
        #[derive(clap::Args)]
        pub(crate) struct GuardArguments {}

        pub(crate) fn run(_: &GuardArguments) -> Result<(), CommandError> {
            Ok(())
        }
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
