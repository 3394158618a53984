//! Sample of a run for display: a tick in reduced precision.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Pose, rotation_vector};

/// Tick for display. Less than half the size of a tick record: most values are `f32`, which is enough for pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Scheduled time since the loop started, ns.
    pub time_ns: u64,
    /// Number of the tick.
    pub tick: u64,
    /// Pose of the handle in the device frame.
    pub pose: Pose,
    /// Velocity, m/s, and angular velocity of the handle, rad/s.
    pub twist: [f32; 6],
    /// Wrench sent to the device: force, N, and torque, N·m.
    pub commanded: [f32; 6],
    /// Energy stored in the models, J; NaN if not computed.
    pub energy_j: f32,
    /// Start delay of the tick, s.
    pub lateness_s: f32,
    /// Stiffness felt along the motion, N/m; NaN while the handle rests.
    pub stiffness_n_per_m: f32,
    /// Computing time of the tick, s.
    pub compute_s: f32,
    /// Events of the tick.
    pub events: Events,
}

impl Sample {
    /// Returns the time since the loop started, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        seconds(self.time_ns)
    }

    /// Returns the force sent to the device, N.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        let [x, y, z, ..] = self.commanded.map(f64::from);
        DVec3::new(x, y, z)
    }

    /// Returns the torque sent to the device, N·m.
    #[must_use]
    pub fn torque_nm(&self) -> DVec3 {
        let [.., x, y, z] = self.commanded.map(f64::from);
        DVec3::new(x, y, z)
    }

    /// Returns the rotation of the handle as a rotation vector, rad.
    #[must_use]
    pub fn rotation_rad(&self) -> DVec3 {
        rotation_vector(self.pose.orientation())
    }
}

impl From<&TickRecord> for Sample {
    #[allow(clippy::cast_possible_truncation)] // for pictures
    fn from(record: &TickRecord) -> Self {
        let six = |a: [f64; 3], b: [f64; 3]| [a[0], a[1], a[2], b[0], b[1], b[2]].map(|value| value as f32);
        Self {
            time_ns: record.time_ns,
            tick: record.tick,
            pose: record.pose,
            twist: six(record.twist.linear_m_per_s, record.twist.angular_rad_per_s),
            commanded: six(record.commanded.force_n, record.commanded.torque_nm),
            energy_j: record.model.energy_j().map_or(f32::NAN, |joule| joule as f32),
            lateness_s: record.lateness_ns as f32 * 1.0e-9,
            stiffness_n_per_m: f32::NAN,
            compute_s: record.compute_ns as f32 * 1.0e-9,
            events: record.events,
        }
    }
}

/// Converts ns to s.
#[must_use]
pub fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}
