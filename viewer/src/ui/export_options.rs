//! Options for exported traces.

use crate::palette::Look;
use crate::ui::readout::title_of;
use flotor_history::History;
use std::path::Path;

/// File format of exported traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// Numbers as CSV.
    Csv,
    /// Vector graphics as SVG.
    Svg,
    /// Pixels as PNG.
    Png,
}

impl ExportFormat {
    /// Returns the extension of file names.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }

    /// Returns the format of a file, from the extension of its name.
    ///
    /// # Errors
    /// A message of one line if the extension is none of csv, svg and png.
    pub fn of_file(file: &Path) -> Result<Self, String> {
        let formats = [Self::Csv, Self::Svg, Self::Png];
        let named =
            formats.into_iter().find(|format| file.extension().is_some_and(|end| end == format.extension()));
        named.ok_or_else(|| format!("`{}` must end with .csv, .svg or .png", file.display()))
    }
}

/// Options for pictures of traces.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// Colour scheme of the picture, light or dark.
    pub look: Look,
    /// Width and height, pixels.
    pub size_px: [f64; 2],
    /// Title; empty: the title of the run.
    pub title: String,
}

impl Default for ExportOptions {
    /// Returns the options for paper: light, and as wide as a page at 300 dots per inch.
    fn default() -> Self {
        Self { look: Look::Light, size_px: [1800.0, 1000.0], title: String::new() }
    }
}

impl ExportOptions {
    /// Shows controls by which the user changes the options.
    pub fn choose(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.selectable_value(&mut self.look, Look::Light, "Light");
            ui.selectable_value(&mut self.look, Look::Dark, "Dark");
        });
        ui.horizontal(|ui| {
            let [width, height] = &mut self.size_px;
            for (length, name) in [(width, "Width"), (height, "Height")] {
                let value = egui::DragValue::new(length).range(400.0..=8000.0).max_decimals(0).suffix(" px");
                let value = ui.add(value.update_while_editing(false)).on_hover_text(name);
                value.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
            }
        });
        let title =
            egui::TextEdit::singleline(&mut self.title).hint_text("Title of the run").desired_width(180.0);
        ui.add(title);
    }

    /// Returns the title of a picture; `device` is the name of the device if there are several.
    pub(crate) fn title(&self, history: &History, device: Option<&str>) -> String {
        let title = if self.title.is_empty() { title_of(history.run()) } else { self.title.clone() };
        device.map_or_else(|| title.clone(), |device| format!("{title}: {device}"))
    }
}
