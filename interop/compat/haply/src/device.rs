//! Emulated device: ids, nominal arm, and settings that belong to no session.

use flotor_hal::DVec3;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Returns the id of the arm of a device: four hexadecimal digits, as on the label of an Inverse3.
pub(crate) fn inverse_id(number: usize) -> String {
    format!("F{:03X}", number + 1)
}

/// Returns the id of the grip of a device.
pub(crate) fn grip_id(number: usize) -> String {
    format!("A{:03X}", number + 1)
}

/// Length of a nominal arm, m: a joint angle is a displacement divided by this length, a torque a force times this length.
pub(crate) const ARM_M: f64 = 0.2;

/// Returns the joint angles of the nominal arm for a displacement, degrees.
pub(crate) fn joint_angles(displacement_m: DVec3) -> DVec3 {
    displacement_m / ARM_M * (180.0 / std::f64::consts::PI)
}

/// Returns the initial values of the settings that a device keeps across sessions.
pub(crate) fn kept_at_first() -> BTreeMap<&'static str, Value> {
    BTreeMap::from([
        ("gravity_compensation", json!({ "enabled": true, "scaling_factor": 1.0 })),
        ("handedness", json!("right")),
        ("torque_scaling", json!({ "enabled": true })),
        ("home_return", json!({ "enabled": false })),
    ])
}
