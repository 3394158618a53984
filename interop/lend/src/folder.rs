//! Private folder of `flotor lend`: links to the drop-in libraries, and the files that the runs of a program write.

use crate::api::Api;
use flotor_command::CommandError;
use std::os::unix::fs::{DirBuilderExt, symlink};
use std::path::{Path, PathBuf};

/// Private folder with links to the libraries, removed when dropped.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Result<Self, CommandError> {
        let path = std::env::temp_dir().join(format!("flotor-lend-{}", std::process::id()));
        // Left by a killed process with the same id.
        let _ = std::fs::remove_dir_all(&path);
        let made = std::fs::DirBuilder::new().mode(0o700).create(&path);
        made.map_err(|cause| CommandError::file(&path, "cannot create the temporary folder", cause))?;
        Ok(Self(path))
    }

    /// Links a library under the file names of its interface, in the folders that the loader and the clients of an SDK search.
    pub(crate) fn put(&self, api: Api, library: &Path) -> Result<(), CommandError> {
        let library = library.canonicalize().unwrap_or_else(|_| library.to_path_buf());
        let sdk = self.0.join(format!("lib/release/lin-{}-gcc", std::env::consts::ARCH));
        // An old client searches the folder `lib` inside the folder of the libraries.
        let folders = match api {
            Api::Dhd => vec![self.0.clone(), sdk.clone(), sdk.join("lib")],
            Api::Openhaptics | Api::Chai3d => vec![self.0.clone()],
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
        self.0.join("program-end.json")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
