//! Resolution of meshes, limited to visible detail.

use super::Body;
use std::f64::consts::PI;

/// Mesh resolution of a tube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detail {
    /// Number of rings along the whole tube.
    pub rings: usize,
    /// Number of vertices of a ring.
    pub sides: usize,
}

/// Largest distance of a chord from its arc, in pixels: below the resolution of anti-aliasing.
const SAG_PX: f64 = 0.12;
/// Range of the number of rings per turn: at the lower limit a coil still looks round; above the upper limit no difference is
/// visible.
const RINGS_PER_TURN: std::ops::RangeInclusive<f64> = 16.0..=96.0;
/// Range of the number of vertices of a ring.
const SIDES: std::ops::RangeInclusive<f64> = 8.0..=40.0;
/// Number of rings of a plain tube, which may bend anywhere.
const RINGS_OF_A_TUBE: usize = 129;
/// Largest number of rings of a tube: with a hundred turns, full resolution would not be visible.
const MOST_RINGS: f64 = 6000.0;

impl Detail {
    /// Returns the resolution for a body drawn at this many pixels per millimetre.
    ///
    /// The middle of one of `n` chords of a circle of radius r lies `r (pi / n)² / 2` inside the arc.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the ranges above
    pub fn for_size(body: &Body, pixels_per_mm: f64) -> Self {
        let parts = |radius_m: f64, range: &std::ops::RangeInclusive<f64>| {
            let radius_px = radius_m * super::MM_PER_M * pixels_per_mm.max(0.0);
            // Steps of eight, so that zooming does not change the mesh in every picture.
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
