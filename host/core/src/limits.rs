//! What a run allows: limits of force and motion, and the wall at the end of the device's range.

use crate::coupling::PassivityMode;

/// What a scene allows; the device's declaration applies too, whichever is tighter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest force along each axis, N.
    pub force_n: [f64; 3],
    /// Largest torque about each axis, N·m.
    pub torque_nm: [f64; 3],
    /// Fastest change of force, N/s.
    pub force_slew_n_per_s: f64,
    /// Fastest change of torque, N·m/s.
    pub torque_slew_nm_per_s: f64,
    /// Velocity along each axis above which nothing may drive the handle on, m/s.
    pub velocity_m_per_s: [f64; 3],
    /// Angular velocity about each axis above which nothing may drive the handle on, rad/s.
    pub angular_velocity_rad_per_s: [f64; 3],
    /// Time over which the force fades in at the start and out at an orderly end, s.
    pub ramp_s: f64,
    /// Time without a tick after which the watchdog stops the device, s (real clock).
    pub watchdog_s: f64,
    /// Buttons of the device that are emergency stops, one bit each.
    pub emergency_buttons: u32,
    /// What is done about energy that comes out of the port without having gone in.
    pub passivity: PassivityMode,
    /// A device that nothing stops when the host's process is gone is refused.
    pub require_independent_stop: bool,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            force_n: [f64::INFINITY; 3],
            torque_nm: [f64::INFINITY; 3],
            force_slew_n_per_s: f64::INFINITY,
            torque_slew_nm_per_s: f64::INFINITY,
            // Long enough not to startle a hand, short enough not to be waited for.
            ramp_s: 0.2,
            velocity_m_per_s: [f64::INFINITY; 3],
            angular_velocity_rad_per_s: [f64::INFINITY; 3],
            // A hundred periods at 1 kHz: a loaded machine without real-time priority is late by tens of
            // milliseconds, and a hand that holds a force for a tenth of a second has not gone far.
            watchdog_s: 0.1,
            emergency_buttons: 0,
            passivity: PassivityMode::Observe,
            require_independent_stop: false,
        }
    }
}

/// A spring-damper wall a little inside the device's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// How far inside the device's range the wall begins, m.
    pub margin_m: f64,
    /// How far inside the device's rotation range the wall begins, rad.
    pub margin_rad: f64,
    /// Stiffness of the wall, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping inside the wall, N·s/m.
    pub damping_ns_per_m: f64,
    /// Rotational stiffness, N·m/rad.
    pub stiffness_nm_per_rad: f64,
    /// Rotational damping, N·m·s/rad.
    pub damping_nms_per_rad: f64,
}

impl Default for Boundary {
    fn default() -> Self {
        // Half of (b + B) / (T / 2) at 1 kHz without plant damping (Gil et al. 2009): 15 / 0.0005 = 30 kN/m. The
        // gains 15 N s/m, 50 N m/rad and 0.15 N m s/rad are those of the device's own boundary mode (Utah client).
        Self {
            margin_m: 0.5e-3,
            margin_rad: 0.005,
            stiffness_n_per_m: 10_000.0,
            damping_ns_per_m: 15.0,
            stiffness_nm_per_rad: 50.0,
            damping_nms_per_rad: 0.15,
        }
    }
}
