//! Colours, light and dark, distinguishable with any kind of colour vision.
//!
//! Lines and plates: after Okabe and Ito, "Color Universal Design" (2008), with a darker green and a lighter blue (on white:
//! darker); the original green and blue, equal in lightness, are indistinguishable without blue cones (tritanopia). Strain: viridis
//! (van der Walt and Smith, 2015), whose lightness increases monotonically, so that it is readable in greyscale as well.

use clap::builder::Resettable;
use egui::Color32;
use flotor_drawing::geometry::Color;
use flotor_drawing::raster::Backdrop;
use serde::{Deserialize, Serialize};

/// Colour scheme, light or dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Look {
    /// Dark background.
    #[default]
    #[value(help = Resettable::Reset)] // the name is enough, and help has one line per option
    Dark,
    /// Light background.
    #[value(help = Resettable::Reset)]
    Light,
}

/// All colours of a colour scheme.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Background of the 3D view.
    pub backdrop: Backdrop,
    /// Background of plots and panels.
    pub panel: Color32,
    /// Normal text.
    pub text: Color32,
    /// Less important text.
    pub faint: Color32,
    /// Grid lines of plots.
    pub grid: Color32,
    /// Traces of the components x, y, z.
    pub components: [Color32; 3],
    /// Cursor at the displayed time.
    pub cursor: Color32,
    /// Surface and grid lines of the ground.
    pub ground: [Color; 2],
    /// Plate at the handle, also for tools; plate at the fixed end, also for handles of a second recording.
    pub plates: [Color; 2],
    /// Bodies other than springs.
    pub body: Color,
    /// Force arrows.
    pub force: Color,
    /// Torque arrows.
    pub torque: Color,
    /// Touching turns of a coil, and marks of contacts.
    pub contact: Color,
    /// Warnings, and limits on the time axis.
    pub warning: Color32,
    /// Faults and emergency stops.
    pub fault: Color32,
    /// Normal operation.
    pub well: Color32,
    /// Darkness of shadows, 0 to 1.
    pub shadow: f64,
}

impl Look {
    /// Returns the other colour scheme.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Dark => Self::Light,
            Self::Light => Self::Dark,
        }
    }
}

impl Palette {
    /// Returns the colours of a colour scheme.
    #[must_use]
    pub const fn of(look: Look) -> Self {
        const fn rgb(r: u8, g: u8, b: u8) -> Color32 {
            Color32::from_rgb(r, g, b)
        }
        match look {
            Look::Dark => Self {
                backdrop: Backdrop { top: [38, 44, 54], bottom: [17, 20, 26] },
                panel: rgb(20, 23, 29),
                text: rgb(228, 232, 238),
                faint: rgb(146, 154, 166),
                grid: rgb(72, 80, 92),
                components: [rgb(230, 159, 0), rgb(0, 158, 118), rgb(150, 208, 255)],
                cursor: rgb(240, 244, 250),
                ground: [[58, 66, 80, 255], [98, 110, 130, 255]],
                plates: [[232, 118, 48, 255], [62, 122, 188, 255]],
                body: [118, 128, 144, 255],
                force: [250, 224, 92, 255],
                torque: [222, 142, 190, 255],
                contact: [255, 84, 96, 255],
                warning: rgb(255, 232, 110),
                fault: rgb(255, 96, 130),
                well: rgb(0, 190, 140),
                shadow: 0.62,
            },
            Look::Light => Self {
                backdrop: Backdrop { top: [252, 253, 255], bottom: [222, 228, 236] },
                panel: rgb(250, 251, 253),
                text: rgb(26, 31, 40),
                faint: rgb(90, 98, 112),
                grid: rgb(186, 194, 206),
                components: [rgb(213, 94, 0), rgb(0, 140, 105), rgb(20, 74, 155)],
                cursor: rgb(30, 36, 46),
                ground: [[206, 213, 223, 255], [176, 186, 200, 255]],
                plates: [[222, 104, 32, 255], [38, 104, 172, 255]],
                body: [168, 178, 192, 255],
                force: [236, 174, 16, 255],
                torque: [196, 96, 158, 255],
                contact: [226, 42, 62, 255],
                warning: rgb(96, 52, 0),
                fault: rgb(196, 0, 60),
                well: rgb(0, 134, 100),
                shadow: 0.34,
            },
        }
    }
}

/// Nine colours of viridis from 0.12 to 1 of its scale; below, shapes would be too dark to see.
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

/// Returns the colour of a strain as a fraction of the scale, clamped to 0 to 1.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // nine colours
pub fn strain_color(part: f64) -> Color {
    let last = VIRIDIS.len() - 1;
    let place = part.clamp(0.0, 1.0) * last as f64;
    let i = (place as usize).min(last - 1);
    let u = place - i as f64;
    let [r, g, b] =
        std::array::from_fn(|k| (VIRIDIS[i][k] + u * (VIRIDIS[i + 1][k] - VIRIDIS[i][k]) + 0.5) as u8);
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::glam::{DMat3, DVec3};

    /// What is left of linear red, green and blue to who has no red, green or blue cones: Machado, Oliveira and Fernandes,
    /// "A physiologically-based model for simulation of color vision deficiency" (2009), severity 1. Rows.
    const VISIONS: [(&str, [[f64; 3]; 3]); 4] = [
        ("all cones", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        (
            "no red",
            [
                [0.152286, 1.052583, -0.204868],
                [0.114503, 0.786281, 0.099216],
                [-0.003882, -0.048116, 1.051998],
            ],
        ),
        (
            "no green",
            [
                [0.367322, 0.860646, -0.227968],
                [0.280085, 0.672501, 0.047413],
                [-0.011820, 0.042940, 0.968881],
            ],
        ),
        (
            "no blue",
            [
                [1.255528, -0.076749, -0.178779],
                [-0.078411, 0.930809, 0.147602],
                [0.004733, 0.691367, 0.303900],
            ],
        ),
    ];

    /// sRGB to linear light (IEC 61966-2-1).
    fn linear([r, g, b]: [u8; 3]) -> DVec3 {
        DVec3::from([r, g, b].map(|value| {
            let value = f64::from(value) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        }))
    }

    /// Place in CIE L*a*b* (D65) of linear light.
    fn lab(linear: DVec3) -> DVec3 {
        let to_xyz = DMat3::from_cols_array_2d(&[
            [0.4124 / 0.9505, 0.2126, 0.0193 / 1.089],
            [0.3576 / 0.9505, 0.7152, 0.1192 / 1.089],
            [0.1805 / 0.9505, 0.0722, 0.9505 / 1.089],
        ]);
        let [x, y, z] = (to_xyz * linear)
            .to_array()
            .map(|part| if part > 216.0 / 24389.0 { part.cbrt() } else { part * 841.0 / 108.0 + 4.0 / 29.0 });
        DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
    }

    fn rgb(color: Color32) -> [u8; 3] {
        [color.r(), color.g(), color.b()]
    }

    fn solid([r, g, b, _]: Color) -> [u8; 3] {
        [r, g, b]
    }

    /// Contrast of WCAG 2.1, 1 to 21.
    fn contrast(a: [u8; 3], b: [u8; 3]) -> f64 {
        let [a, b] = [a, b].map(|color| linear(color).dot(DVec3::new(0.2126, 0.7152, 0.0722)) + 0.05);
        a.max(b) / a.min(b)
    }

    #[test]
    fn what_must_be_distinguished_is_distinguished_by_every_eye() {
        /// Distance in L*a*b*: 2.3 is just seen side by side (Mahy 1994), ten times that from one glance to the next.
        const APART: f64 = 23.0;
        for look in [Look::Dark, Look::Light] {
            let palette = Palette::of(look);
            let [x, y, z] = palette.components.map(rgb);
            let coil = [0.0, 1.0].map(|part| solid(strain_color(part)));
            let pairs = [
                ("x and y", x, y),
                ("y and z", y, z),
                ("z and x", z, x),
                ("plates", solid(palette.plates[0]), solid(palette.plates[1])),
                ("force and torque", solid(palette.force), solid(palette.torque)),
                ("slack and strained", coil[0], coil[1]),
                ("strained and touching", coil[1], solid(palette.contact)),
            ];
            for (vision, rows) in VISIONS {
                let seen = |color| {
                    let matrix = DMat3::from_cols_array_2d(&rows).transpose();
                    lab((matrix * linear(color)).clamp(DVec3::ZERO, DVec3::ONE))
                };
                for (what, a, b) in pairs {
                    let distance = seen(a).distance(seen(b));
                    assert!(distance > APART, "{look:?}, {vision}: {what} are {distance} apart");
                }
            }
        }
    }

    /// The bounds of WCAG 2.1: 4.5 for text, 3 for lines and signs.
    #[test]
    fn text_and_lines_stand_out_from_what_is_behind_them() {
        for look in [Look::Dark, Look::Light] {
            let palette = Palette::of(look);
            for behind in [rgb(palette.panel), palette.backdrop.top, palette.backdrop.bottom] {
                for text in [palette.text, palette.faint, palette.warning, palette.fault] {
                    let contrast = contrast(rgb(text), behind);
                    assert!(contrast >= 4.5, "{look:?}: {text:?} on {behind:?} has {contrast}");
                }
                for line in palette.components.into_iter().chain([palette.well, palette.cursor]) {
                    let contrast = contrast(rgb(line), behind);
                    assert!(contrast >= 3.0, "{look:?}: {line:?} on {behind:?} has {contrast}");
                }
            }
        }
    }

    #[test]
    fn the_scale_of_strain_reads_in_grey() {
        let lightness = (0..=64).map(|i| lab(linear(solid(strain_color(f64::from(i) / 64.0)))).x);
        let lightness: Vec<f64> = lightness.collect();
        assert!(lightness.is_sorted_by(|a, b| a < b), "{lightness:?}");
    }

    /// Colour difference by CIEDE2000 (CIE 142-2001; Sharma, Wu and Dalal, 2005).
    fn ciede2000(one: DVec3, other: DVec3) -> f64 {
        let chroma_of = |color: DVec3| color.y.hypot(color.z);
        let seventh = |chroma: f64| (chroma.powi(7) / (chroma.powi(7) + 25.0_f64.powi(7))).sqrt();
        let stretch = 1.5 - 0.5 * seventh(0.5 * (chroma_of(one) + chroma_of(other)));
        let [one, other] = [one, other].map(|color| DVec3::new(color.x, stretch * color.y, color.z));
        let [chroma, other_chroma] = [one, other].map(chroma_of);
        let hue = |color: DVec3| color.z.atan2(color.y).to_degrees().rem_euclid(360.0);
        let is_grey = chroma * other_chroma == 0.0;
        // The shorter way around the circle of hues, and its middle.
        let turn = if is_grey { 0.0 } else { (hue(other) - hue(one) + 180.0).rem_euclid(360.0) - 180.0 };
        let mean_hue = if is_grey { hue(one) + hue(other) } else { hue(one) + 0.5 * turn };
        let (lightness, mean_chroma) = (0.5 * (one.x + other.x), 0.5 * (chroma + other_chroma));
        let cos = |degrees: f64| degrees.to_radians().cos();
        let weight =
            1.0 - 0.17 * cos(mean_hue - 30.0) + 0.24 * cos(2.0 * mean_hue) + 0.32 * cos(3.0 * mean_hue + 6.0)
                - 0.2 * cos(4.0 * mean_hue - 63.0);
        let bright = (lightness - 50.0).powi(2);
        let lightness = (other.x - one.x) / (1.0 + 0.015 * bright / (20.0 + bright).sqrt());
        let chromatic = (other_chroma - chroma) / (1.0 + 0.045 * mean_chroma);
        let hue_part = 2.0 * (chroma * other_chroma).sqrt() * (0.5 * turn).to_radians().sin()
            / (1.0 + 0.015 * mean_chroma * weight);
        let blue = (-((mean_hue.rem_euclid(360.0) - 275.0) / 25.0).powi(2)).exp();
        let rotation = -(60.0 * blue).to_radians().sin() * 2.0 * seventh(mean_chroma);
        (lightness.powi(2) + chromatic.powi(2) + hue_part.powi(2) + rotation * chromatic * hue_part).sqrt()
    }

    /// Pairs of Sharma, Wu and Dalal, "The CIEDE2000 color-difference formula" (2005), table 1, printed to four decimals.
    #[test]
    fn colour_differences_are_those_of_the_published_table() {
        for (one, other, expected) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, -1.0, 2.0], [50.0, 0.0, 0.0], 2.3669),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
            ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
            ([2.0776, 0.0795, -1.135], [0.9033, -0.0636, -0.5514], 0.9082),
        ] {
            let found = ciede2000(DVec3::from(one), DVec3::from(other));
            assert!((found - expected).abs() <= 0.5e-4, "{one:?} {other:?}: {found}");
        }
    }

    /// Every pair of what is drawn over traces, for who has all cones, no red and no green ones. A limit has the colour of warnings.
    #[test]
    fn warnings_faults_the_cursor_and_the_traces_differ_to_every_eye() {
        const LEAST: f64 = 10.0;
        let mut compared = 0;
        for look in [Look::Dark, Look::Light] {
            let palette = Palette::of(look);
            let [x, y, z] = palette.components;
            let colors = [
                ("warning", palette.warning),
                ("fault", palette.fault),
                ("cursor", palette.cursor),
                ("x", x),
                ("y", y),
                ("z", z),
            ];
            for (vision, rows) in VISIONS.into_iter().filter(|(vision, _)| *vision != "no blue") {
                let matrix = DMat3::from_cols_array_2d(&rows).transpose();
                let seen = |color: Color32| lab((matrix * linear(rgb(color))).clamp(DVec3::ZERO, DVec3::ONE));
                for (index, (name, color)) in colors.iter().enumerate() {
                    for (other_name, other) in &colors[..index] {
                        let difference = ciede2000(seen(*color), seen(*other));
                        assert!(
                            difference >= LEAST,
                            "{look:?}, {vision}: {name}, {other_name}: {difference}"
                        );
                        compared += 1;
                    }
                }
            }
        }
        assert_eq!(compared, 2 * 3 * 15);
    }

    /// A component, a fault and a limit have one colour in the window, in pictures of the command line and in the book.
    #[test]
    fn components_faults_and_limits_have_the_colours_of_pictures() {
        let written = |color: Color32| format!("#{:02x}{:02x}{:02x}", color.r(), color.g(), color.b());
        for (color, of) in [
            (flotor_plot::FAULT_COLORS, (|palette: Palette| palette.fault) as fn(Palette) -> Color32),
            (flotor_plot::LIMIT_COLORS, |palette| palette.warning),
        ] {
            assert_eq!(
                (written(of(Palette::of(Look::Light))), written(of(Palette::of(Look::Dark)))),
                (color.0.to_owned(), color.1.to_owned())
            );
        }
        for (axis, (light, dark)) in flotor_plot::AXIS_COLORS.into_iter().enumerate() {
            assert_eq!(written(Palette::of(Look::Light).components[axis]), light);
            assert_eq!(written(Palette::of(Look::Dark).components[axis]), dark);
        }
    }
}
