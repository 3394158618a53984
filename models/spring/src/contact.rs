//! Contact of the coils: a spring cannot be shorter than its solid length.
//!
//! For the law `energy`, which depends on the length alone: `W += (k/2) <n d - L>²`, a stiff spring along the chord
//! from the length at which all `n` coils of the thickness `d` touch. The rod has contact along its bulge as well, in
//! [`crate::rod`].

use crate::pose::Pose;
use crate::response::Response;
use crate::rigidity::Spring;
use crate::rod::contact::STIFFNESS_N_PER_M;

/// Contact of all coils at once, as a stiff spring along the chord.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialContact {
    free_length_m: f64,
    /// Shortening at which all coils touch (m), `L0 - n d`.
    gap_m: f64,
}

impl AxialContact {
    /// Prepares the contact of a spring. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(spring: &Spring) -> Self {
        let geometry = spring.geometry();
        Self {
            free_length_m: geometry.free_length_m,
            gap_m: geometry.free_length_m - geometry.solid_length_m(),
        }
    }

    /// Returns the response at a pose with the force and energy of the contact added; unchanged without contact or at a pose
    /// without a chord. Real-time: bounded, no allocation.
    pub fn added_to(&self, response: &Response, pose: &Pose) -> Response {
        let Ok(chord) = pose.chord(self.free_length_m) else { return *response };
        let overlap_m = chord.shortening_m - self.gap_m;
        if overlap_m <= 0.0 {
            return *response;
        }
        let force_n = STIFFNESS_N_PER_M * overlap_m;
        Response {
            force_n: response.force_n + chord.vector_m * (force_n / chord.length_m),
            energy_j: response.energy_j.map(|stored_j| stored_j + 0.5 * force_n * overlap_m),
            ..*response
        }
    }
}
