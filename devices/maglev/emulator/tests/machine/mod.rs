//! Capabilities of the device of the thesis.

use flotor_hal::{Axes, Capabilities};

pub(crate) const CAPABILITIES: Capabilities = Capabilities {
    resolution_m: 2.0e-6,
    max_force_n: [55.0, 55.0, 140.0],
    max_torque_nm: [6.3, 6.3, 12.2],
    ..Capabilities::driving(Axes::ALL).with_range(0.012, 0.12).with_slew(55.0e3, 6.3e3).with_stiffness(25.0e3)
};
