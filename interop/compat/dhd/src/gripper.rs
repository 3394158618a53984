//! Gripper of a device: its gap and angle, and the force that a program commands.
//!
//! The interface has a gap, m, and an angle, rad, of the same gripper. A grip of one kind is converted to the other with the length
//! of a finger, which is assumed.

use flotor_compat::Station;
use flotor_hal::GripKind;

/// Length of a finger, m: a gap of 25 mm is an angle of 29°, as of the maker's grippers.
const FINGER_M: f64 = 0.05;

/// State of a gripper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gripper {
    pub(crate) gap_m: f64,
    pub(crate) velocity_m_per_s: f64,
    /// Force after all limits, N; positive: it opens the gripper.
    pub(crate) applied_n: f64,
}

impl Gripper {
    /// Returns the gripper of a device; `None` without one.
    pub(crate) fn of(station: &Station) -> Option<Self> {
        let (state, effort) = station.state().grip?;
        let gap_m = gap_per_opening(state.kind());
        Some(Self {
            gap_m: state.opening * gap_m,
            velocity_m_per_s: state.velocity * gap_m,
            applied_n: effort / gap_m,
        })
    }

    pub(crate) fn angle_rad(&self) -> f64 {
        self.gap_m / FINGER_M
    }

    pub(crate) fn velocity_rad_per_s(&self) -> f64 {
        self.velocity_m_per_s / FINGER_M
    }
}

/// Returns the effort at the grip of a device for a force of the gripper, N; 0 without a gripper.
pub(crate) fn effort(station: &Station, force_n: f64) -> f64 {
    station.grip().map_or(0.0, |grip| force_n * gap_per_opening(grip.kind()))
}

/// Returns whether the gripper of a device has a motor.
pub(crate) fn is_driven(station: &Station) -> bool {
    station.grip().is_some_and(|grip| grip.max_effort > 0.0)
}

/// Returns the gap for each unit of the opening of a grip: 1, or m for each rad.
fn gap_per_opening(kind: GripKind) -> f64 {
    match kind {
        GripKind::Linear => 1.0,
        GripKind::Angular => FINGER_M,
    }
}
