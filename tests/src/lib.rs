//! Shared code of the cross-crate tests: files of the workspace, programs under test, and size of the tests.
//!
//! The end of this file lists the documents whose Rust code is compiled and run as doctests.

pub mod asynchronous_error;
pub mod commands;
pub mod library;
pub mod printed;
pub mod process;
pub mod program;
pub mod random;
pub mod scratch;
pub mod side_by_side;
pub mod stand_in;
pub mod tables;
pub mod thesis_poses;
pub mod tools;
pub mod watched;

use flotor_record::Recording;
use std::path::{Path, PathBuf};

/// Returns the root of the workspace: the folder with the README.
#[must_use]
pub fn workspace_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().map(Path::to_path_buf).unwrap_or_default()
}

/// Returns all files with the extension `extension` in a folder of the workspace and its subfolders, as sorted paths relative
/// to the root. Skips hidden folders and folders named `target`.
///
/// # Errors
/// The system's error if a folder cannot be read.
pub fn files_under(folder: &str, extension: &str) -> std::io::Result<Vec<PathBuf>> {
    let root = workspace_root();
    let mut found = Vec::new();
    let mut folders = vec![root.join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let (entry, root) = (entry?, &root);
            let (path, name) = (entry.path(), entry.file_name());
            if entry.file_type()?.is_dir() {
                let skipped = name == "target" || name.to_string_lossy().starts_with('.');
                folders.extend((!skipped).then_some(path));
            } else if path.extension().is_some_and(|found| found == extension) {
                found.push(path.strip_prefix(root).unwrap_or(&path).to_path_buf());
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Returns the folders of all plugins of the workspace, as sorted paths relative to its root.
///
/// # Panics
/// If the workspace cannot be read.
#[must_use]
pub fn plugin_folders() -> Vec<String> {
    let kinds = ["devices", "models"];
    let entries = kinds.into_iter().flat_map(|kind| {
        let folder = workspace_root().join(kind).read_dir().expect("the workspace has its folders");
        folder.map(move |entry| {
            format!("{kind}/{}", entry.expect("a folder can be read").file_name().to_string_lossy())
        })
    });
    let is_plugin = |folder: &String| manifest(folder).is_some_and(|text| text.contains("\"cdylib\""));
    let mut folders: Vec<String> = entries.filter(is_plugin).collect();
    folders.sort();
    folders
}

/// Returns the text of a folder's `Cargo.toml`; `None` without a readable one.
fn manifest(folder: &str) -> Option<String> {
    std::fs::read_to_string(workspace_root().join(folder).join("Cargo.toml")).ok()
}

/// Returns the name of the crate in a plugin's folder. It may differ from the folder's name, which a drop-in library may have.
///
/// # Panics
/// If the folder has no manifest, or its manifest has no name.
#[must_use]
pub fn crate_name_of(plugin_folder: &str) -> String {
    let text = manifest(plugin_folder).expect("a plugin's folder has a manifest");
    let name = text.lines().find_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"'));
    name.expect("a manifest names its crate").to_owned()
}

/// Returns true if a recording, also one that is being written, contains a tick: its loop then runs.
#[must_use]
pub fn holds_ticks(recording: &Path) -> bool {
    Recording::open(recording).is_ok_and(|mut recording| matches!(recording.next(), Some(Ok(_))))
}

/// Size of the tests that scale, from the environment variable [`TestSize::VARIABLE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TestSize {
    /// Few cases, without the longest tests; the default of `cargo test`.
    Quick,
    /// Few cases, with the longest tests; the size of `.ci/run`.
    Daily,
    /// All cases; the size of `.ci/full`.
    Full,
}

impl TestSize {
    /// Name of the environment variable of the size: `quick` (the default), `daily` or `full`.
    pub const VARIABLE: &str = "FLOTOR_TEST_SIZE";

    /// Returns the size of this test run, from [`Self::VARIABLE`].
    ///
    /// # Panics
    /// If the variable has another value: a typing error must not turn a long test into a short one.
    #[must_use]
    pub fn of_this_run() -> Self {
        match std::env::var(Self::VARIABLE) {
            Err(_) => Self::Quick,
            Ok(word) => match Self::from_word(&word) {
                Some(size) => size,
                None => panic!("{}={word}: quick, daily or full is expected", Self::VARIABLE),
            },
        }
    }

    /// Returns the number of cases (poses, ticks, seeds) for this size: `quick` also for [`Self::Daily`].
    #[must_use]
    pub const fn pick(self, quick: usize, full: usize) -> usize {
        match self {
            Self::Quick | Self::Daily => quick,
            Self::Full => full,
        }
    }

    /// Returns true if the longest tests are skipped at this size, and then reports the calling test as skipped.
    #[must_use]
    pub fn leaves_out_long_tests(self) -> bool {
        let is_quick = self == Self::Quick;
        if is_quick {
            tools::skipped("takes longer than others: `FLOTOR_TEST_SIZE=daily`, as in `.ci/run`, has it");
        }
        is_quick
    }

    fn from_word(word: &str) -> Option<Self> {
        match word {
            "quick" => Some(Self::Quick),
            "daily" => Some(Self::Daily),
            "full" => Some(Self::Full),
            _ => None,
        }
    }
}

/// Documents with Rust code: `cargo test` compiles and runs the code, so the examples stay valid.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../README.md")]
    struct Readme;

    #[doc = include_str!("../../docs/src/write-a-model.md")]
    struct WriteAModel;

    #[doc = include_str!("../../docs/src/write-a-device.md")]
    struct WriteADevice;

    #[doc = include_str!("../../docs/src/bring-your-solver.md")]
    struct BringYourSolver;

    #[doc = include_str!("../../docs/src/slow-model.md")]
    struct AsynchronousModel;

    #[doc = include_str!("../../docs/src/cable.md")]
    struct Cable;

    #[doc = include_str!("../../docs/src/concepts.md")]
    struct Concepts;

    #[doc = include_str!("../../docs/src/grip.md")]
    struct Grip;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_found() {
        assert!(workspace_root().join("README.md").is_file());
        assert!(files_under("tests", "rs").unwrap().contains(&PathBuf::from("tests/src/lib.rs")));
    }

    #[test]
    fn build_output_is_not_ours() {
        let sources = files_under("", "rs").unwrap();
        assert!(!sources.iter().any(|file| file.components().any(|part| part.as_os_str() == "target")));
    }

    #[test]
    fn a_mistyped_size_is_no_size() {
        assert_eq!(TestSize::from_word("full"), Some(TestSize::Full));
        assert_eq!(TestSize::from_word("ful"), None);
        assert_eq!(TestSize::from_word("daily"), Some(TestSize::Daily));
        assert_eq!((TestSize::Quick.pick(10, 1000), TestSize::Daily.pick(10, 1000)), (10, 10));
        assert_eq!(TestSize::Full.pick(10, 1000), 1000);
    }
}
