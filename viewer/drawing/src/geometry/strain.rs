//! Local strain of the wire, shown by the colour of a body.
//!
//! Only the centreline is known, so the measure is geometric: the local change of length of the body at the place
//! of the wire. With axial strain `e` of the centreline, shear `g` and curvature `k` (per length at rest, in the
//! section's frame), a fibre at `(x, y)` of the section is strained by
//!
//! ```text
//! e + k_x y - k_y x        along the axis, and by |g| across it
//! ```
//!
//! The twist of a coil's wire, and thus its shear stress, is proportional to this strain. The scale ends
//! where the turns of a coil touch: there the distance of two turns has become the wire's diameter.

use super::{Body, Curve};
use flotor_hal::glam::DVec2;
use flotor_hal::{DVec3, rotation_vector};

/// Strain of the pieces between reported sections.
#[derive(Clone, Debug, PartialEq)]
pub struct Strain {
    pieces: Vec<Piece>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    axial: f64,
    shear: f64,
    curvature_per_m: DVec2,
}

/// Strain at a place of the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalStrain {
    /// Relative change of length along the axis; negative where turns come closer.
    pub axial: f64,
    /// Shear: displacement across the axis per length, 0 or more.
    pub shear: f64,
}

impl LocalStrain {
    /// Returns the norm of both components, for a colour scale.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        self.axial.hypot(self.shear)
    }
}

impl Strain {
    /// Compares the centreline of a body with its centreline at rest; both need the same number of sections.
    #[must_use]
    pub fn between(rest: &Curve, now: &Curve) -> Self {
        let count = rest.sections().min(now.sections());
        let place = |i: usize| i as f64 / (count - 1) as f64;
        let piece = |i: usize| {
            let of = |curve: &Curve| {
                let (a, b) = (curve.section(place(i)), curve.section(place(i + 1)));
                let middle = curve.section(0.5 * (place(i) + place(i + 1)));
                let step = middle.orientation.conjugate() * (b.center_m - a.center_m);
                let turn = middle.orientation.conjugate()
                    * b.orientation
                    * a.orientation.conjugate()
                    * middle.orientation;
                (step, rotation_vector(turn))
            };
            let ((step_rest, turn_rest), (step, turn)) = (of(rest), of(now));
            let length_m = step_rest.length();
            let shift: DVec3 = (step - step_rest) / length_m;
            Piece {
                axial: shift.z,
                shear: shift.truncate().length(),
                curvature_per_m: (turn - turn_rest).truncate() / length_m,
            }
        };
        Self { pieces: (0..count - 1).map(piece).collect() }
    }

    /// Returns the strain at the fraction `s` of the length, for a fibre at `(x, y)` of the section, m.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few pieces
    pub fn at(&self, s: f64, fibre_m: DVec2) -> LocalStrain {
        // The values of the pieces apply at their middles; linear interpolation in between.
        let place = (s * self.pieces.len() as f64 - 0.5).clamp(0.0, (self.pieces.len() - 1) as f64);
        let i = (place as usize).min(self.pieces.len().saturating_sub(2));
        let u = place - i as f64;
        let (a, b) = (self.pieces[i], self.pieces[(i + 1).min(self.pieces.len() - 1)]);
        let mix = |a: f64, b: f64| a + u * (b - a);
        let curvature = a.curvature_per_m.lerp(b.curvature_per_m, u);
        LocalStrain {
            axial: mix(a.axial, b.axial) + curvature.x * fibre_m.y - curvature.y * fibre_m.x,
            shear: mix(a.shear, b.shear),
        }
    }
}

/// Returns the axial strain at which neighbouring turns of a coil touch (negative); `None` for a plain tube or a coil whose
/// turns touch at rest.
#[must_use]
pub fn contact_strain(body: &Body) -> Option<f64> {
    let pitch_m = body.rest_length_m / body.info.helix_turns;
    let gap = 2.0 * body.info.tube_radius_m / pitch_m - 1.0;
    (body.is_coil() && gap < 0.0).then_some(gap)
}
