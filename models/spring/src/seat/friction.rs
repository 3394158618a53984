//! Friction between the base and the ground, and how far a base slides.

use flotor_hal::glam::DVec3;

use super::base::Lengths;
use crate::rigidity::Spring;

/// Friction by the height over that by the force, at most. Tables of a base that sticks ask for half of both together; from
/// 0.9 on slender springs jam.
const BY_HEIGHT: f64 = 0.8;
/// Share of the friction by which the force along the ground may exceed it: no coefficient is known as well.
pub(super) const TOLERANCE: f64 = 1e-6;
/// A sliding base is moved by what the stiffness makes of the excess; as observed, but within this factor of that at rest.
const STIFFNESS_RANGE: f64 = 8.0;
/// Longest slide between evaluations, in free lengths.
const LONGEST_SLIDE: f64 = 0.05;

/// Friction between the base and the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Force along the ground per force onto it at which the base slides; of more than `D/L0`, see [`crate::seat`].
    pub coefficient: f64,
}

impl Friction {
    /// As much as any holds.
    pub const STICKING: Self = Self { coefficient: 10.0 };
}

/// What holds one base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grip {
    /// Shares of the force onto the ground, and of the force of a straight spring that is shortened as far.
    by_force: f64,
    by_height: f64,
    axial_n_per_m: f64,
    longest_m: f64,
    /// Stiffness along the ground, and about the base's normal over the square of the radius, at rest (N/m).
    lateral_n_per_m: f64,
    turning_n_per_m: f64,
    /// Stiffness as observed, of that at rest.
    observed: f64,
}

impl Grip {
    /// Coulomb's law up to `D/L0`. Beyond that a bent spring whose rim slides loses force onto the ground faster than it is
    /// relieved: what such a coefficient holds beyond is taken by the height.
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

    /// Forgets what was observed.
    pub(super) fn restart(&mut self) {
        self.observed = 1.0;
    }

    /// What it holds (N), of a force onto the ground and a hanging rim so high above it.
    pub(super) fn holds_n(&self, pressed_n: f64, height_m: f64) -> f64 {
        let straight_n = -height_m * self.axial_n_per_m;
        self.by_force * pressed_n + self.by_height * straight_n
    }

    /// How far a base slides that is pulled that way by so much more (m).
    pub(super) fn slide_m(&self, excess_n: f64, way: DVec3) -> f64 {
        (excess_n / (self.observed * self.at_rest_n_per_m(way))).min(self.longest_m)
    }

    /// Learns from a slide that way, of a length, that relieved the base by so much.
    pub(super) fn observe(&mut self, relieved_n: f64, distance_m: f64, way: DVec3) {
        let observed = relieved_n / (distance_m * self.at_rest_n_per_m(way));
        if observed.is_finite() {
            self.observed = observed.clamp(1.0 / STIFFNESS_RANGE, STIFFNESS_RANGE);
        }
    }

    /// Stiffness that a base at rest meets on a way: along the ground, and as it turns.
    fn at_rest_n_per_m(&self, way: DVec3) -> f64 {
        self.lateral_n_per_m * way.truncate().length_squared() + self.turning_n_per_m * way.z * way.z
    }
}
