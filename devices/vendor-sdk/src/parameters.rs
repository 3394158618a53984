//! Parameters that plugins over an SDK have in common.

use flotor_hal::{Choices, Parameter, choices};

const NO_YES: Choices = choices!["false", "true"];
const PACES: Choices = choices!["real", "lockstep"];

/// Parameter for the [`DropInPolicy`](crate::DropInPolicy), with choices in the order of its variants.
pub const STAND_IN: Parameter =
    Parameter::choice("stand_in", NO_YES, 0, "Accept Flotor's own drop-in library, which simulates a device");
/// Parameter for the [`Pace`](crate::Pace), with choices in the order of its variants.
pub const PACE: Parameter = Parameter::choice(
    "pace",
    PACES,
    0,
    "real: each tick uses the newest sample; lockstep: each tick waits for its sample (virtual clock, simulated device)",
);
/// Parameter for the timeout of samples, ms.
pub const TIMEOUT: Parameter =
    Parameter::real("timeout_ms", "ms", 5.0, 10_000.0, 200.0, "Timeout for samples of the device");

/// Declares the parameter `max_force_n`, N, with the range 0 to `most_n`; 0: the limit of the device.
pub const fn max_force(most_n: f64) -> Parameter {
    let doc = "Largest force on the hand; 0: the limit of the device";
    Parameter::real("max_force_n", "N", 0.0, most_n, 0.0, doc)
}

/// Declares the parameter `max_torque_nm`, N·m, with the range 0 to `most_nm`; 0: the limit of the device.
pub const fn max_torque(most_nm: f64) -> Parameter {
    let doc = "Largest torque on the hand; 0: the limit of the device, if known; no effect without driven rotational axes";
    Parameter::real("max_torque_nm", "N·m", 0.0, most_nm, 0.0, doc)
}
