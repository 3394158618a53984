//! Saved settings of the window, in a small file of the user.
//!
//! Path: `$XDG_CONFIG_HOME/flotor/viewer.toml`, else `~/.config/flotor/viewer.toml`; below `%APPDATA%` on Windows. If the file
//! is missing, damaged or of another version, the defaults apply. Pictures without a window and
//! sittings do not read the file: they look the same for all users.

use crate::palette::Look;
use crate::platform::settings_folder;
use crate::ui::plot_stack::FIRST_TRACES;
use flotor_hal::read_text;
use flotor_history::quantity::{Quantity, Units};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Settings of the window that a user can change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SavedSettings {
    /// Colour scheme.
    pub look: Look,
    /// Units of all numbers.
    pub units: Units,
    /// Shown traces.
    pub traces: Vec<Quantity>,
    /// True to show the panel; `None`: depends on the width of the window.
    pub shows_panel: Option<bool>,
    /// Width of the panel, points.
    pub side_pt: f32,
    /// Fraction of the height for the 3D view; `None`: depends on the height of the window.
    pub view_part: Option<f32>,
    /// Width and height of the window without its frame, points at zoom 1.
    pub size_pt: [f32; 2],
    /// Size of text and lines, as a factor on the pixels per point of the display.
    pub zoom: f32,
    /// Recordings opened last, the newest first.
    pub latest: Vec<PathBuf>,
}

impl Default for SavedSettings {
    fn default() -> Self {
        Self {
            look: Look::default(),
            units: Units::Handy,
            traces: FIRST_TRACES.to_vec(),
            shows_panel: None,
            side_pt: 300.0,
            view_part: None,
            size_pt: [1280.0, 800.0],
            zoom: 1.0,
            latest: Vec::new(),
        }
    }
}

impl SavedSettings {
    /// Returns the path of the settings file; `None` without a settings folder.
    #[must_use]
    pub fn file() -> Option<PathBuf> {
        settings_folder().map(|folder| folder.join("flotor").join("viewer.toml"))
    }

    /// Reads the settings and limits size and zoom to usable values; returns the defaults if the file is missing or invalid.
    #[must_use]
    pub fn load(file: &Path) -> Self {
        let text = read_text(file, "the settings").unwrap_or_default();
        let mut found: Self = toml::from_str(&text).unwrap_or_default();
        // The window must have a usable size, and the text must fit into it.
        found.size_pt =
            found.size_pt.map(|length| if length.is_finite() { length.clamp(480.0, 8192.0) } else { 800.0 });
        found.view_part = found.view_part.filter(|part| part.is_finite());
        found.zoom = if found.zoom.is_finite() { found.zoom.clamp(0.5, 3.0) } else { 1.0 };
        found
    }

    /// Saves the settings to a file atomically; creates its folder if absent.
    ///
    /// # Errors
    /// If the folder or the file cannot be written.
    pub fn save(&self, file: &Path) -> std::io::Result<()> {
        let text = toml::to_string(self).map_err(std::io::Error::other)?;
        file.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        // Replace the file atomically: another window may be reading it.
        let new = file.with_extension("new");
        std::fs::write(&new, text)?;
        std::fs::rename(&new, file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_chosen_comes_back_and_a_damaged_file_costs_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("made/for/it/viewer.toml");
        assert_eq!(SavedSettings::load(&file), SavedSettings::default());
        let chosen = SavedSettings {
            look: Look::Light,
            units: Units::Si,
            traces: vec![Quantity::Energy, Quantity::AngularVelocity],
            shows_panel: Some(false),
            side_pt: 360.0,
            view_part: Some(0.5),
            size_pt: [1600.0, 900.0],
            zoom: 1.5,
            latest: vec![PathBuf::from("/data/run.mcap")],
        };
        chosen.save(&file).unwrap();
        assert_eq!(SavedSettings::load(&file), chosen);
        std::fs::write(&file, "look = \"light\"\nfrom_the_future = 3\n").unwrap();
        assert_eq!(
            SavedSettings::load(&file),
            SavedSettings { look: Look::Light, ..SavedSettings::default() }
        );
        for damaged in ["look = ", "look = 7\n", "zoom = 1e9\nsize_pt = [1.0, nan]\n"] {
            std::fs::write(&file, damaged).unwrap();
            let found = SavedSettings::load(&file);
            assert!((0.5..=3.0).contains(&found.zoom) && found.size_pt.iter().all(|length| *length >= 480.0));
        }
    }
}
