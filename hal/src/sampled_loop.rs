//! Largest stiffness that a sampled loop renders stably: one rule for every wall and spring of hosts and devices.

/// Timing of a sampled force loop: period and latency.
///
/// The rule is the linear one of Gil, Sanchez, Hulin, Preusche and Hirzinger (2009, J. Comput. Inf. Sci. Eng. 9:011005),
/// `K < (b + B) / (T / 2 + latency)`, with the damping `b` of the device and `B` of the wall. It assumes
/// - a spring and a damper that are sampled once a period, and a force that is constant until the next sample;
/// - a rigid handle, and a hand that adds no energy;
/// - a period and a latency that are short for handle and damper: `(b + B) (T + latency)` is at most a tenth of the mass.
///   The rule exceeds the exact limit by less than this ratio.
///
/// Rotation follows the same rule, with N·m/rad, N·m·s/rad and kg·m².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLoop {
    /// Time between two samples, s.
    pub period_s: f64,
    /// Time from a sample to the resulting force, s: [`Capabilities::latency_s`](crate::Capabilities::latency_s).
    pub latency_s: f64,
}

/// Damper in parallel with a spring, N·s/m or N·m·s/rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damper {
    /// Damper that resists motion in both directions.
    BothWays(f64),
    /// Damper that resists motion in one direction, as in a wall that never pulls. It acts during half of an oscillation,
    /// so half of its damping counts.
    OneWay(f64),
}

impl Damper {
    /// Returns the mean damping over an oscillation.
    fn mean(self) -> f64 {
        match self {
            Self::BothWays(damping) => damping,
            Self::OneWay(damping) => 0.5 * damping,
        }
    }
}

impl SampledLoop {
    /// Fraction of the stability limit that a wall may use. The other half covers effects outside the rule: filters of
    /// the velocity, quantisation, and handles lighter than assumed.
    pub const STABILITY_MARGIN: f64 = 0.5;

    /// Returns the stiffness, N/m or N·m/rad, at which the loop becomes unstable on a device with the viscous damping
    /// `device_damping`, N·s/m or N·m·s/rad; 0 without any damping. Real-time: bounded, no allocation.
    #[must_use]
    pub fn stability_limit(&self, device_damping: f64, damper: Damper) -> f64 {
        (device_damping + damper.mean()) / (0.5 * self.period_s + self.latency_s)
    }

    /// Returns the largest stiffness to render, N/m or N·m/rad: [half](Self::STABILITY_MARGIN) of the
    /// [stability limit](Self::stability_limit). Real-time: bounded, no allocation.
    #[must_use]
    pub fn largest_stiffness(&self, device_damping: f64, damper: Damper) -> f64 {
        Self::STABILITY_MARGIN * self.stability_limit(device_damping, damper)
    }
}

#[cfg(test)]
mod tests;
