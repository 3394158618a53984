//! Colours, light and dark, that people with any kind of colour vision can tell apart.
//!
//! Lines and plates: Okabe and Ito, "Color Universal Design" (2008). Strain: viridis (van der Walt and Smith, 2015),
//! whose lightness rises all the way, so that it reads in grey as well.

use crate::geometry::Color;
use crate::raster::solid::Backdrop;
use egui::Color32;
use serde::{Deserialize, Serialize};

/// Light or dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Look {
    /// Dark background.
    #[default]
    Dark,
    /// Light background.
    Light,
}

/// All colours of a look.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Behind the 3D view.
    pub backdrop: Backdrop,
    /// Behind plots and panels.
    pub panel: Color32,
    /// Text.
    pub text: Color32,
    /// Less important text.
    pub faint: Color32,
    /// Grid lines of plots.
    pub grid: Color32,
    /// Components x, y, z of a trace.
    pub components: [Color32; 3],
    /// Where the time is.
    pub cursor: Color32,
    /// Ground and its lines.
    pub ground: [Color; 2],
    /// Plate at the handle, plate at the fixed end.
    pub plates: [Color; 2],
    /// Force and torque arrows.
    pub force: Color,
    /// Torque arrows.
    pub torque: Color,
    /// Where turns of a coil touch.
    pub contact: Color,
    /// Something is wrong.
    pub warning: Color32,
    /// All is well.
    pub well: Color32,
    /// How dark shadows are, 0 to 1.
    pub shadow: f64,
}

impl Look {
    /// The other one.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Dark => Self::Light,
            Self::Light => Self::Dark,
        }
    }
}

impl Palette {
    /// The colours of a look.
    #[must_use]
    pub const fn of(look: Look) -> Self {
        match look {
            Look::Dark => Self {
                backdrop: Backdrop { top: [38, 44, 54], bottom: [17, 20, 26] },
                panel: Color32::from_rgb(20, 23, 29),
                text: Color32::from_rgb(228, 232, 238),
                faint: Color32::from_rgb(146, 154, 166),
                grid: Color32::from_rgb(72, 80, 92),
                components: [
                    Color32::from_rgb(230, 159, 0),
                    Color32::from_rgb(0, 190, 140),
                    Color32::from_rgb(86, 180, 233),
                ],
                cursor: Color32::from_rgb(240, 244, 250),
                ground: [[58, 66, 80, 255], [98, 110, 130, 255]],
                plates: [[232, 118, 48, 255], [62, 122, 188, 255]],
                force: [250, 224, 92, 255],
                torque: [222, 142, 190, 255],
                contact: [255, 84, 96, 255],
                warning: Color32::from_rgb(255, 138, 96),
                well: Color32::from_rgb(0, 190, 140),
                shadow: 0.62,
            },
            Look::Light => Self {
                backdrop: Backdrop { top: [252, 253, 255], bottom: [222, 228, 236] },
                panel: Color32::from_rgb(250, 251, 253),
                text: Color32::from_rgb(26, 31, 40),
                faint: Color32::from_rgb(98, 106, 120),
                grid: Color32::from_rgb(186, 194, 206),
                components: [
                    Color32::from_rgb(213, 94, 0),
                    Color32::from_rgb(0, 134, 100),
                    Color32::from_rgb(0, 114, 178),
                ],
                cursor: Color32::from_rgb(30, 36, 46),
                ground: [[206, 213, 223, 255], [176, 186, 200, 255]],
                plates: [[222, 104, 32, 255], [38, 104, 172, 255]],
                force: [236, 174, 16, 255],
                torque: [196, 96, 158, 255],
                contact: [226, 42, 62, 255],
                warning: Color32::from_rgb(176, 54, 10),
                well: Color32::from_rgb(0, 134, 100),
                shadow: 0.34,
            },
        }
    }
}

/// Nine colours of viridis between its parts 0.12 and 1, below which it is too dark to see a shape in.
const VIRIDIS: [[f64; 3]; 9] = [
    [72.0, 33.0, 115.0],
    [67.0, 61.0, 132.0],
    [56.0, 88.0, 140.0],
    [45.0, 112.0, 142.0],
    [37.0, 133.0, 142.0],
    [38.0, 155.0, 137.0],
    [81.0, 197.0, 106.0],
    [165.0, 219.0, 54.0],
    [253.0, 231.0, 37.0],
];

/// Colour of a part of the scale of strain, 0 to 1; what lies outside has the colour of the end.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // nine colours
pub fn strain_color(part: f64) -> Color {
    let last = VIRIDIS.len() - 1;
    let place = part.clamp(0.0, 1.0) * last as f64;
    let i = (place as usize).min(last - 1);
    let u = place - i as f64;
    let [r, g, b] =
        std::array::from_fn(|k| (VIRIDIS[i][k] + u * (VIRIDIS[i + 1][k] - VIRIDIS[i][k]) + 0.5) as u8);
    [r, g, b, 255]
}
