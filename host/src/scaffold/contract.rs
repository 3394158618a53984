//! Where the sources of the contract are that a new plugin is built with: those of the running program.

use super::ScaffoldError;
use std::path::{Path, PathBuf};

/// Where this program's own sources were when it was built.
const BUILT_FROM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../hal");

/// The folder of `flotor-hal`: manifest, sources and C header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContractFolder(PathBuf);

impl ContractFolder {
    /// The folder a user names, else `hal/` in a folder above the program, else where the program was built.
    /// Not real-time.
    ///
    /// # Errors
    /// [`ScaffoldError::NoContract`] if it is in none of these places.
    pub fn found_by(named: Option<&Path>) -> Result<Self, ScaffoldError> {
        let own = std::env::current_exe().unwrap_or_default();
        let above = own.ancestors().skip(1).map(|folder| folder.join("hal"));
        let candidates: Vec<PathBuf> = match named {
            Some(named) => vec![named.into()],
            None => above.chain([BUILT_FROM.into()]).collect(),
        };
        let is_contract = |folder: &&PathBuf| {
            let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
            manifest.contains("name = \"flotor-hal\"") && folder.join("include/flotor.h").is_file()
        };
        let found = candidates.iter().find(is_contract).and_then(|folder| folder.canonicalize().ok());
        found.map(Self).ok_or_else(|| {
            ScaffoldError::NoContract(candidates.last().map_or_else(PathBuf::new, |last| plain(last)))
        })
    }

    /// The path, for a manifest.
    pub(super) fn as_text(&self) -> Result<String, ScaffoldError> {
        // Quotes and backslashes would end the text a manifest has it in; `$` and backquotes mean something to a shell.
        let text = self.0.to_str().filter(|text| !text.contains(['"', '\\', '$', '`', '\n']));
        text.map(str::to_owned).ok_or_else(|| ScaffoldError::NotText(self.0.clone()))
    }

    /// Whether the workspace of the contract would take every new folder in `parent` as a member.
    pub(super) fn has_as_member(&self, parent: &Path) -> bool {
        let (Some(workspace), Ok(parent)) = (self.0.parent(), parent.canonicalize()) else { return false };
        ["devices", "models"].iter().any(|members| parent == workspace.join(members))
    }

    /// The versions the contract was built with, so that a plugin needs nothing that is not there already.
    pub(super) fn lock_file(&self) -> Option<String> {
        std::fs::read_to_string(self.0.parent()?.join("Cargo.lock")).ok()
    }
}

/// Without `..`, for people.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}
