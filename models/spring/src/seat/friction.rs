//! Friction between the base and the ground, and distance of a slide.

use flotor_hal::glam::DVec3;

use super::base::Lengths;
use crate::rigidity::Spring;

/// Largest ratio of the friction by height to that by force. Tables with a sticking base need half of both together;
/// from 0.9 on slender springs jam.
const BY_HEIGHT: f64 = 0.8;
/// Tolerated excess of the force along the ground, relative to the friction limit: no coefficient is known as accurately.
pub(super) const TOLERANCE: f64 = 1e-6;
/// Largest factor between the observed stiffness of a sliding base and that at rest.
const STIFFNESS_RANGE: f64 = 8.0;
/// Longest slide between evaluations, in free lengths.
const LONGEST_SLIDE: f64 = 0.05;

/// Friction between the base and the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Coefficient of friction: ratio of the force along the ground to the force onto the ground at which the base slides; above
    /// `D/L0`, see [`crate::seat`].
    pub coefficient: f64,
}

impl Friction {
    /// Coefficient at which a base hardly ever slides.
    pub const STICKING: Self = Self { coefficient: 10.0 };
}

/// Friction limit of one base, with its observed stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrictionLimit {
    /// Coefficients of the force onto the ground, and of the force of a straight spring of the same shortening.
    by_force: f64,
    by_height: f64,
    axial_n_per_m: f64,
    longest_m: f64,
    /// Stiffness along the ground, and about the base's normal over the square of the radius, at rest (N/m).
    lateral_n_per_m: f64,
    turning_n_per_m: f64,
    /// Observed stiffness, relative to that at rest.
    observed: f64,
}

flotor_hal::restorable!(FrictionLimit { observed }
    without { by_force, by_height, axial_n_per_m, longest_m, lateral_n_per_m, turning_n_per_m });

impl FrictionLimit {
    /// Prepares Coulomb's law up to `D/L0`. Beyond, a bent spring whose rim slides loses force onto the ground faster
    /// than its pull is relieved: the rest of the coefficient acts by the height.
    pub(super) fn new(spring: &Spring, friction: Friction) -> Self {
        let Lengths { rim_radius_m, free_length_m } = Lengths::of(spring);
        let gentle = 2.0 * rim_radius_m / free_length_m;
        let by_force = friction.coefficient.min(gentle);
        Self {
            by_force,
            by_height: (friction.coefficient - by_force).min(BY_HEIGHT * gentle),
            axial_n_per_m: spring.axial_stiffness_n_per_m(),
            longest_m: LONGEST_SLIDE * free_length_m,
            lateral_n_per_m: spring.lateral_stiffness_n_per_m(),
            turning_n_per_m: spring.rigidities().tau_n_m2 / (free_length_m * rim_radius_m * rim_radius_m),
            observed: 1.0,
        }
    }

    /// Resets the observed stiffness.
    pub(super) fn restart(&mut self) {
        self.observed = 1.0;
    }

    /// Returns the friction limit (N) for a force onto the ground and the height of the hanging rim.
    pub(super) fn holds_n(&self, pressed_n: f64, height_m: f64) -> f64 {
        let straight_n = -height_m * self.axial_n_per_m;
        self.by_force * pressed_n + self.by_height * straight_n
    }

    /// Returns the distance of a slide (m) for an excess of the pull in a direction.
    pub(super) fn slide_m(&self, excess_n: f64, way: DVec3) -> f64 {
        (excess_n / (self.observed * self.at_rest_n_per_m(way))).min(self.longest_m)
    }

    /// Updates the observed stiffness from the relief of the pull by a slide.
    pub(super) fn observe(&mut self, relieved_n: f64, distance_m: f64, way: DVec3) {
        let observed = relieved_n / (distance_m * self.at_rest_n_per_m(way));
        if observed.is_finite() {
            self.observed = observed.clamp(1.0 / STIFFNESS_RANGE, STIFFNESS_RANGE);
        }
    }

    /// Returns the stiffness at rest in a direction of slide and turn.
    fn at_rest_n_per_m(&self, way: DVec3) -> f64 {
        self.lateral_n_per_m * way.truncate().length_squared() + self.turning_n_per_m * way.z * way.z
    }
}
