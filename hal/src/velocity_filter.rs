//! Velocity estimation for devices that measure positions or orientations only.

use crate::{DVec3, math};
use std::f64::consts::TAU;

/// Velocity estimator: finite difference of positions or orientations, smoothed by a first-order low-pass filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityFilter {
    cutoff_hz: f64,
    velocity: DVec3,
    /// Time of the previous sample, ns.
    sampled_ns: Option<u64>,
}

impl VelocityFilter {
    /// Creates a filter with the cutoff frequency `cutoff_hz`, at velocity zero, before its first sample.
    #[must_use]
    pub const fn new(cutoff_hz: f64) -> Self {
        Self { cutoff_hz, velocity: DVec3::ZERO, sampled_ns: None }
    }

    /// Updates the filter with the displacement since the previous sample and returns the velocity, in the unit of the
    /// displacement per second; zero at the first sample and if the time has not advanced. Real-time: bounded, no
    /// allocation.
    pub fn update(&mut self, displacement: DVec3, time_ns: u64) -> DVec3 {
        self.velocity = match self.sampled_ns {
            Some(before_ns) if time_ns > before_ns => {
                let dt_s = (time_ns - before_ns) as f64 * 1.0e-9;
                // Exact for a difference that is constant over the interval.
                let share = 1.0 - math::exp(-TAU * self.cutoff_hz * dt_s);
                self.velocity.lerp(displacement / dt_s, share)
            }
            _ => DVec3::ZERO,
        };
        self.sampled_ns = Some(time_ns);
        self.velocity
    }
}
