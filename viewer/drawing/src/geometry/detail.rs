//! How finely to mesh: as finely as can be seen, and no finer.

use super::Body;
use std::f64::consts::PI;

/// Rings and sides of a tube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detail {
    /// Rings along the whole tube.
    pub rings: usize,
    /// Corners of a ring.
    pub sides: usize,
}

/// How far a chord may lie inside its arc, in pixels: below what anti-aliasing resolves.
const SAG_PX: f64 = 0.12;
/// Rings of one turn: a coil still looks round, and never costs more than it shows.
const RINGS_PER_TURN: std::ops::RangeInclusive<f64> = 16.0..=96.0;
/// Corners of a ring.
const SIDES: std::ops::RangeInclusive<f64> = 8.0..=40.0;
/// Rings of a plain tube, which may bend anywhere.
const RINGS_OF_A_TUBE: usize = 129;
/// Rings of any tube at most: a hundred turns at full size would be more than anybody sees.
const MOST_RINGS: f64 = 6000.0;

impl Detail {
    /// For a body drawn at so many pixels per millimetre.
    ///
    /// A chord of `n` on a circle of radius r lies `r (pi / n)² / 2` inside it.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the ranges above
    pub fn for_size(body: &Body, pixels_per_mm: f64) -> Self {
        let parts = |radius_m: f64, range: &std::ops::RangeInclusive<f64>| {
            let radius_px = radius_m * super::MM_PER_M * pixels_per_mm.max(0.0);
            // Even steps, so that zooming does not remesh every frame.
            let wanted = (PI * (radius_px / (2.0 * SAG_PX)).sqrt() / 8.0).ceil() * 8.0;
            wanted.max(*range.start()).min(*range.end())
        };
        let sides = parts(body.info.tube_radius_m, &SIDES) as usize;
        let rings = if body.is_coil() {
            let per_turn = parts(body.info.helix_radius_m, &RINGS_PER_TURN);
            (per_turn * body.info.helix_turns).ceil().min(MOST_RINGS) as usize + 1
        } else {
            RINGS_OF_A_TUBE
        };
        Self { rings: rings.max(2), sides }
    }
}
