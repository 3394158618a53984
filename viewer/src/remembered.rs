//! What a person has chosen about the window, from one time to the next: a small file of their own.
//!
//! It lies where programs keep such things (`$XDG_CONFIG_HOME/flotor/viewer.toml`, else `~/.config/flotor/viewer.toml`; `%APPDATA%` on Windows). A file
//! that is missing, damaged or of another version costs the choices in it and nothing else. Pictures without a window and
//! sittings do not read it: they look the same for everybody.

use crate::palette::Look;
use crate::platform::settings_folder;
use crate::ui::plot_stack::FIRST_TRACES;
use flotor_history::quantity::{Quantity, Units};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The choices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Remembered {
    /// Light or dark.
    pub look: Look,
    /// Units of all numbers.
    pub units: Units,
    /// Traces shown.
    pub traces: Vec<Quantity>,
    /// Whether the panel is to be in sight; not chosen: where there is room for it.
    pub shows_panel: Option<bool>,
    /// Its width, points.
    pub side_pt: f32,
    /// Part of the height that the 3D view gets; not chosen: as the window is high.
    pub view_part: Option<f32>,
    /// Width and height of the window, points without the zoom.
    pub size_pt: [f32; 2],
    /// Size of text and lines: pixels per point over those of the display.
    pub zoom: f32,
    /// The recordings opened last, the newest first.
    pub latest: Vec<PathBuf>,
}

impl Default for Remembered {
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

impl Remembered {
    /// Where it is kept; none where there is no home.
    #[must_use]
    pub fn file() -> Option<PathBuf> {
        settings_folder().map(|folder| folder.join("flotor").join("viewer.toml"))
    }

    /// What was chosen the last time; what cannot be read is as if nothing was chosen.
    #[must_use]
    pub fn load(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let mut found: Self = toml::from_str(&text).unwrap_or_default();
        // No window smaller than it can be used, none that is all text.
        found.size_pt =
            found.size_pt.map(|length| if length.is_finite() { length.clamp(480.0, 8192.0) } else { 800.0 });
        found.view_part = found.view_part.filter(|part| part.is_finite());
        found.zoom = if found.zoom.is_finite() { found.zoom.clamp(0.5, 3.0) } else { 1.0 };
        found
    }

    /// Keeps it for the next time.
    ///
    /// # Errors
    /// What the system said.
    pub fn save(&self, file: &Path) -> std::io::Result<()> {
        let text = toml::to_string(self).map_err(std::io::Error::other)?;
        file.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        // As a whole or not at all: another window may read it just now.
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
        assert_eq!(Remembered::load(&file), Remembered::default());
        let chosen = Remembered {
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
        assert_eq!(Remembered::load(&file), chosen);
        std::fs::write(&file, "look = \"light\"\nfrom_the_future = 3\n").unwrap();
        assert_eq!(Remembered::load(&file), Remembered { look: Look::Light, ..Remembered::default() });
        for damaged in ["look = ", "look = 7\n", "zoom = 1e9\nsize_pt = [1.0, nan]\n"] {
            std::fs::write(&file, damaged).unwrap();
            let found = Remembered::load(&file);
            assert!((0.5..=3.0).contains(&found.zoom) && found.size_pt.iter().all(|length| *length >= 480.0));
        }
    }
}
