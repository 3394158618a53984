//! Flotor's own scenes, built into the program and selected by name.

use super::{Scene, SceneError, did_you_mean};
use std::path::Path;

/// Scene that is built into the program.
#[derive(Clone, Copy, Debug)]
pub struct OwnScene {
    /// Name of the scene: its file name without extension.
    pub name: &'static str,
    /// TOML text.
    pub text: &'static str,
}

macro_rules! own {
    ($($name:literal),*) => {
        &[$(OwnScene { name: $name, text: include_str!(concat!("../../scenes/", $name, ".toml")) }),*]
    };
}

/// Flotor's own scenes, in alphabetical order.
pub const OWN_SCENES: &[OwnScene] = own![
    "balls",
    "demo",
    "drawer",
    "falcon",
    "force-dimension",
    "haply",
    "inverse3",
    "membrane",
    "membrane-200hz",
    "openhaptics",
    "solid",
    "spacemouse",
    "stack",
    "study",
    "teleoperation",
    "teleoperation-apart",
    "two-hands",
    "wall"
];

impl OwnScene {
    /// Returns the built-in scene with this name; `None` if no scene has the name, or if a file exists at this path. Not real-time.
    #[must_use]
    pub fn named(path: &Path) -> Option<Self> {
        if path.exists() && !path.is_dir() {
            return None;
        }
        OWN_SCENES.iter().copied().find(|scene| Path::new(scene.name) == path)
    }

    /// Parses the scene. Not real-time.
    ///
    /// # Errors
    /// Never in practice: a test parses every built-in scene.
    pub fn read(&self) -> Result<Scene, SceneError> {
        Scene::parse(Path::new(self.name), self.text)
    }
}

/// Returns advice for a missing scene: the closest name, and the command that lists all. Not real-time.
pub(super) fn advice(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let near = did_you_mean(&stem, OWN_SCENES.iter().map(|scene| scene.name));
    format!("{near} (`flotor scenes` lists Flotor's own scenes)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_of_the_folder_is_here_and_is_read() {
        let folder =
            std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")).expect("a folder");
        let files = folder.map(|entry| entry.expect("a file").file_name().into_string().expect("UTF-8"));
        let mut names: Vec<String> =
            files.filter_map(|file| file.strip_suffix(".toml").map(str::to_owned)).collect();
        names.retain(|name| !name.ends_with(".test"));
        names.sort();
        assert_eq!(names, OWN_SCENES.iter().map(|scene| scene.name).collect::<Vec<_>>());
        for scene in OWN_SCENES {
            let read = scene.read().unwrap_or_else(|error| panic!("{error}"));
            assert!(!read.title.is_empty(), "{}", scene.name);
        }
    }

    #[test]
    fn a_name_that_is_unknown_gets_the_nearest() {
        let error = Scene::load(Path::new("scenes/wal.toml")).expect_err("no such file").problem;
        assert!(error.ends_with("`wall`? (`flotor scenes` lists Flotor's own scenes)"), "{error}");
        assert!(Scene::load(Path::new("wall")).is_ok());
    }
}
