//! Form for opening a recording: by path, or from the list of latest recordings.

use crate::palette::Palette;
use crate::ui::style::SMALL_PT;
use egui::{Button, Key, RichText, Role, TextEdit, Ui, WidgetInfo};
use std::path::{Path, PathBuf};

/// Largest number of latest recordings.
const MOST_LATEST: usize = 5;
/// Width of the field for a path, and of the button beside it, points.
const FIELD_PT: f32 = 340.0;
const BUTTON_PT: f32 = 70.0;
/// Height of a row with the gap beneath, points.
const ROW_PT: f32 = 26.0;
/// Accessible name of the field for a path.
const FIELD: &str = "Path of a recording";

/// Form for opening a recording.
#[derive(Clone, Debug, Default)]
pub(super) struct Opening {
    /// Text of the field.
    pub(super) typed: String,
    /// Recordings opened last, the newest first.
    latest: Vec<PathBuf>,
    /// Plugin files for drawing the bodies.
    pub(super) plugins: Vec<PathBuf>,
}

impl Opening {
    /// Creates a form for recordings whose bodies are drawn with the plugins of these files.
    pub(super) fn with_plugins(plugins: Vec<PathBuf>) -> Self {
        Self { plugins, ..Self::default() }
    }

    /// Returns the recordings opened last, the newest first.
    pub(super) fn latest(&self) -> &[PathBuf] {
        &self.latest
    }

    /// Appends the latest recordings of earlier windows.
    pub(super) fn restore(&mut self, earlier: &[PathBuf]) {
        let others: Vec<PathBuf> =
            earlier.iter().filter(|file| !self.latest.contains(file)).cloned().collect();
        self.latest.extend(others);
        self.latest.truncate(MOST_LATEST);
    }

    /// Moves a recording to the front of the latest recordings.
    pub(super) fn remember(&mut self, file: &Path) {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf());
        self.latest.retain(|known| *known != file);
        self.latest.insert(0, file);
        self.latest.truncate(MOST_LATEST);
    }

    /// Shows a field for a path and as many of the latest recordings as fit; returns the chosen file.
    pub(super) fn show(&mut self, ui: &mut Ui, palette: &Palette) -> Option<PathBuf> {
        let has_room = |ui: &Ui| ui.available_height() >= ROW_PT;
        let quiet = |text: String| RichText::new(text).size(SMALL_PT);
        let mut chosen = None;
        if !has_room(ui) {
            return None;
        }
        let row_pt = (FIELD_PT + BUTTON_PT).min(ui.available_width());
        ui.allocate_ui(egui::vec2(row_pt, ROW_PT), |ui| {
            ui.horizontal(|ui| {
                let width_pt = row_pt - BUTTON_PT;
                let field = TextEdit::singleline(&mut self.typed).hint_text(FIELD).desired_width(width_pt);
                let field = ui.add(field);
                field.widget_info(|| WidgetInfo::labeled(Role::TextInput, true, FIELD));
                let is_entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                let typed = self.typed.trim();
                if (ui.button("Open").clicked() || is_entered) && !typed.is_empty() {
                    chosen = Some(PathBuf::from(typed));
                }
            });
        });
        if has_room(ui) {
            ui.label(quiet("or drop a recording (.mcap) on this window".to_owned()).color(palette.faint));
        }
        for file in &self.latest {
            if !has_room(ui) {
                break;
            }
            let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
            let button = ui.add(Button::new(quiet(name)).frame(false).truncate());
            if button.on_hover_text(file.display().to_string()).clicked() {
                chosen = Some(file.clone());
            }
        }
        chosen
    }
}
