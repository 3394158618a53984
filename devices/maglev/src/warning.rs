//! Warning of excess force: the thesis's beep (Varadharajan 2007, appendix A), once per event instead of once per tick.
//!
//! Real-time: bounded, no allocation.

use flotor_hal::DVec3;

/// Force along each axis above which the thesis's program beeps, N.
const LIMIT_N: DVec3 = DVec3::new(10.0, 10.0, 50.0);
/// Fraction of the limit below which the warning ends: a force that trembles about the limit gives one warning.
const RELEASE: f64 = 0.9;

/// Detector of a force above the device's recommended limits, with hysteresis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExcessForce {
    active: bool,
}

impl ExcessForce {
    /// Updates the warning from a commanded force, N; a component that is NaN counts as zero.
    pub fn update(&mut self, force_n: DVec3) {
        let limit_n = if self.active { LIMIT_N * RELEASE } else { LIMIT_N };
        self.active = force_n.abs().cmpgt(limit_n).any();
    }

    /// Returns true from the tick that exceeds the limit until the force is below 90 % of the limit.
    #[must_use]
    pub fn is_active(self) -> bool {
        self.active
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_trembles_about_the_limit_is_one_warning() {
        let mut warning = ExcessForce::default();
        let seen = [49.0, 50.5, 49.5, 50.5, 45.5, 44.5, 49.9, -51.0].map(|z| {
            warning.update(DVec3::Z * z);
            warning.is_active()
        });
        assert_eq!(seen, [false, true, true, true, true, false, false, true]);
    }

    #[test]
    fn sideways_the_limit_is_lower_and_nan_is_no_force() {
        let mut warning = ExcessForce::default();
        for (force_n, active) in [(DVec3::X * -10.5, true), (DVec3::Y * 9.5, true), (DVec3::NAN, false)] {
            warning.update(force_n);
            assert_eq!(warning.is_active(), active, "{force_n}");
        }
    }
}
