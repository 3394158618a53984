//! Library interfaces of other makers, and the drop-in libraries with these interfaces.

use flotor_command::CommandError;
use std::path::{Path, PathBuf};

/// Library interface of another maker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Api {
    /// Force Dimension's DHD and DRD
    Dhd,
    /// 3D Systems' OpenHaptics (HDAPI)
    Openhaptics,
    /// CHAI3D's interface to a Phantom
    Chai3d,
}

/// Drop-in library for an interface.
pub(crate) struct Library {
    word: &'static str,
    /// Name of the library file that cargo builds.
    built: &'static str,
    package: &'static str,
    /// File names under which programs load the library; an installation has the file under the last name.
    pub(crate) names: &'static [&'static str],
    /// Strings that the file of a program contains if the program is linked with the library or loads it.
    pub(crate) marks: &'static [&'static str],
}

impl Api {
    pub(crate) const ALL: [Self; 3] = [Self::Dhd, Self::Openhaptics, Self::Chai3d];

    /// Returns the name for `--api`.
    pub(crate) fn word(self) -> &'static str {
        self.library().word
    }

    pub(crate) fn library(self) -> Library {
        match self {
            Self::Dhd => Library {
                word: "dhd",
                built: "libdrd.so",
                package: "flotor-dhd",
                names: &[
                    "libdhd.so",
                    "libdhd.so.3",
                    "libdhd.so.3.17.6",
                    "libdrd.so",
                    "libdrd.so.3",
                    "libdrd.so.3.17.6",
                ],
                marks: &["libdhd.so", "libdrd.so"],
            },
            Self::Openhaptics => Library {
                word: "openhaptics",
                built: "libHD.so",
                package: "flotor-openhaptics",
                // Includes HL, the higher layer: programs that are linked with it load it, even if they call none of its functions.
                names: &[
                    "libHL.so",
                    "libHL.so.3.4",
                    "libHD.so.3.0",
                    "libHD.so.3.4",
                    "libHD.so.3.4.0",
                    "libHD.so",
                ],
                marks: &["libHD.so"],
            },
            Self::Chai3d => Library {
                word: "chai3d",
                built: "libhdPhantom.so",
                package: "flotor-chai3d",
                names: &["libhdPhantom.so"],
                marks: &["libhdPhantom.so"],
            },
        }
    }

    /// Finds the drop-in library, in the installation or in the build folder of the program `own`.
    pub(crate) fn find(self, own: &Path) -> Result<PathBuf, CommandError> {
        let folder = own.parent().unwrap_or(Path::new("."));
        let Library { built, package, names, .. } = self.library();
        let compat = folder.join("../lib/flotor/compat").join(self.word());
        let installed = names.iter().rev().map(|name| compat.join(name));
        let beside = [folder.join(built), folder.join("deps").join(built)];
        installed.chain(beside).find(|file| file.is_file()).ok_or_else(|| {
            let release = if folder.ends_with("debug") { "" } else { " --release" };
            CommandError::Usage(format!(
                "the drop-in library for `--api {}` was found neither at `{}` nor in `{}`; build it with \
                 `cargo build{release} -p {package}` in Flotor's sources",
                self.word(),
                folder.join(built).display(),
                compat.display()
            ))
        })
    }
}
