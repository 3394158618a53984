//! Private folder of `flotor lend`: links to the drop-in libraries, and the files that the runs of a program write.

use crate::api::Api;
use flotor_command::CommandError;
use std::fs::Permissions;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Private folder with links to the libraries, removed when dropped.
pub(crate) struct Folder(TempDir);

impl Folder {
    /// Creates the folder under a random name, which no other user can predict and occupy.
    pub(crate) fn new() -> Result<Self, CommandError> {
        let private = Permissions::from_mode(0o700);
        let made = tempfile::Builder::new().prefix("flotor-lend-").permissions(private).tempdir();
        made.map(Self).map_err(|cause| {
            CommandError::file(&std::env::temp_dir(), "cannot create the temporary folder", cause)
        })
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Links a library under the file names of its interface, in the folders that the loader and the clients of an SDK search.
    pub(crate) fn put(&self, api: Api, library: &Path) -> Result<(), CommandError> {
        let library = library.canonicalize().unwrap_or_else(|_| library.to_path_buf());
        let sdk = self.path().join(format!("lib/release/lin-{}-gcc", std::env::consts::ARCH));
        // An old client searches the folder `lib` inside the folder of the libraries.
        let folders = match api {
            Api::Dhd => vec![self.path().to_path_buf(), sdk.clone(), sdk.join("lib")],
            Api::Openhaptics | Api::Chai3d => vec![self.path().to_path_buf()],
        };
        for folder in folders {
            let linked = std::fs::create_dir_all(&folder).and_then(|()| {
                api.library().names.iter().try_for_each(|name| symlink(&library, folder.join(name)))
            });
            linked.map_err(|cause| CommandError::file(&folder, "cannot link the libraries", cause))?;
        }
        Ok(())
    }

    /// Returns the path of the file to which the guard writes the end of the program.
    pub(crate) fn program_end(&self) -> PathBuf {
        self.path().join("program-end.json")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stranger_can_neither_predict_nor_enter_the_folder() {
        let (one, other) = (Folder::new().expect("a folder"), Folder::new().expect("a folder"));
        assert_ne!(one.path(), other.path(), "the number of the process is not the name");
        let mode = one.path().metadata().expect("it exists").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        let path = one.path().to_path_buf();
        drop(one);
        assert!(!path.exists() && other.path().exists());
    }
}
