//! Source of the crate `flotor-hal` for a new plugin: the registry, the sources of this installation, or a copy.

use super::error::ScaffoldError;
use super::vendor::{write_copy, write_file};
use crate::platform::canonical;
use std::path::{Path, PathBuf};

/// Folder of the contract's sources when this program was built.
const BUILT_FROM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../hal");
/// Folder of the contract's sources in an installation, relative to its prefix.
const INSTALLED: &str = "share/flotor/hal";
/// Folder of the copied sources, relative to the folder of the plugin.
const COPY: &str = "flotor-hal";
/// Cargo configuration for one machine, which replaces the registry's crate by a folder; git ignores the file.
const CONFIG: &str = ".cargo/config.toml";

/// Source of the contract's crate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Contract {
    /// Crate of this version in the registry.
    Published,
    /// Folder on this machine, in place of the registry.
    Patched(ContractFolder),
    /// Copy in the plugin's folder, of the sources in this folder.
    Vendored(ContractFolder),
}

impl Contract {
    /// Selects the sources in the folder `named`, or else of this installation, in place of the registry; the registry if neither is
    /// given. Not real-time.
    ///
    /// # Errors
    /// [`ScaffoldError::NoContract`] if the named folder does not contain the contract.
    pub fn of_installation(named: Option<&Path>) -> Result<Self, ScaffoldError> {
        match ContractFolder::found(named) {
            Ok(folder) => Ok(Self::Patched(folder)),
            Err(_) if named.is_none() => Ok(Self::Published),
            Err(error) => Err(error),
        }
    }

    /// Selects a copy of the sources in the folder `named`, or else of this installation. Not real-time.
    ///
    /// # Errors
    /// [`ScaffoldError::NoContract`] if the sources are not found.
    pub fn copied(named: Option<&Path>) -> Result<Self, ScaffoldError> {
        ContractFolder::found(named).map(Self::Vendored)
    }

    /// Returns the dependency on the contract, for a manifest.
    pub(super) fn dependency(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        match self {
            Self::Vendored(_) => format!("{{ path = \"{COPY}\", version = \"{version}\" }}"),
            Self::Published | Self::Patched(_) => format!("\"{version}\""),
        }
    }

    /// Returns the additional option of `cargo build` on a forge, where an archive of Flotor is unpacked in `flotor/`; empty if none
    /// is needed.
    pub(super) fn option_on_a_forge(&self) -> &'static str {
        match self {
            Self::Patched(_) => r#" --config "patch.crates-io.flotor-hal.path='flotor/share/flotor/hal'""#,
            Self::Published | Self::Vendored(_) => "",
        }
    }

    /// Writes the configuration or copy of the contract, and the lock file, into the folder of the plugin; returns the paths to list.
    pub(super) fn write_beside(&self, plugin: &Path) -> Result<Vec<String>, ScaffoldError> {
        match self {
            Self::Published => Ok(Vec::new()),
            Self::Patched(folder) => {
                let path = folder.as_text()?;
                let text = format!(
                    "# Sources of flotor-hal on this machine, until the registry has the crate. Git ignores this file.\n\
                     [patch.crates-io]\nflotor-hal = {{ path = \"{path}\" }}\n"
                );
                write_file(&plugin.join(CONFIG), &text)?;
                folder.copy_lock_file(plugin)?;
                Ok(vec![CONFIG.to_owned()])
            }
            Self::Vendored(folder) => {
                write_copy(&folder.0, &plugin.join(COPY))?;
                folder.copy_lock_file(plugin)?;
                Ok(vec![COPY.to_owned()])
            }
        }
    }

    /// Returns true if the workspace of the contract would include every new folder in `parent` as a member.
    pub(super) fn has_as_member(&self, parent: &Path) -> bool {
        let (Self::Patched(folder) | Self::Vendored(folder)) = self else { return false };
        let (Some(workspace), Ok(parent)) = (folder.0.parent(), canonical(parent)) else { return false };
        ["devices", "models"].iter().any(|members| parent == workspace.join(members))
    }
}

/// Folder with the sources of `flotor-hal`: manifest, code and C header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContractFolder(PathBuf);

impl ContractFolder {
    /// Finds the sources: in the folder that the user names; else in `hal/` or `share/flotor/hal/` of a folder above the program;
    /// else in their folder at build time.
    fn found(named: Option<&Path>) -> Result<Self, ScaffoldError> {
        let own = std::env::current_exe().unwrap_or_default();
        let above = own.ancestors().skip(1).flat_map(|folder| [folder.join("hal"), folder.join(INSTALLED)]);
        let candidates: Vec<PathBuf> = match named {
            Some(named) => vec![named.into()],
            None => above.chain([BUILT_FROM.into()]).collect(),
        };
        let is_contract = |folder: &&PathBuf| {
            let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
            manifest.contains("name = \"flotor-hal\"") && folder.join("src/lib.rs").is_file()
        };
        let found = candidates.iter().find(is_contract).and_then(|folder| canonical(folder).ok());
        found.map(Self).ok_or_else(|| {
            let missing = named.map_or_else(|| own.join("../..").join(INSTALLED), Path::to_path_buf);
            ScaffoldError::NoContract(plain(&missing))
        })
    }

    /// Returns the path as text for cargo's configuration.
    fn as_text(&self) -> Result<&str, ScaffoldError> {
        // Quotes and backslashes would end the string in cargo's configuration.
        let text = self.0.to_str().filter(|text| !text.contains(['"', '\\', '\n']));
        text.ok_or_else(|| ScaffoldError::NotText(self.0.clone()))
    }

    /// Copies the lock file of the contract's package or workspace to the plugin, so that the plugin builds with the same locked
    /// versions of dependencies. Does nothing if there is no lock file.
    fn copy_lock_file(&self, plugin: &Path) -> Result<(), ScaffoldError> {
        let places = [Some(self.0.as_path()), self.0.parent()].into_iter().flatten();
        let lock = places
            .map(|folder| folder.join("Cargo.lock"))
            .find_map(|file| std::fs::read_to_string(file).ok());
        lock.map_or(Ok(()), |lock| write_file(&plugin.join("Cargo.lock"), &lock))
    }
}

/// Resolves `..` in a path for an error message, without access to the file system.
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
