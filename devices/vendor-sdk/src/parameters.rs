//! Parameters that plugins over an SDK have in common.

use flotor_hal::{Choices, Parameter, choices};

const NO_YES: Choices = choices!["false", "true"];
const PACES: Choices = choices!["real", "lockstep"];

/// Choice of the [`DropInPolicy`](crate::DropInPolicy), in its sequence.
pub const STAND_IN: Parameter =
    Parameter::choice("stand_in", NO_YES, 0, "Accept Flotor's own drop-in library, which simulates a device");
/// Choice of the [`Pace`](crate::Pace), in its sequence.
pub const PACE: Parameter = Parameter::choice(
    "pace",
    PACES,
    0,
    "real: each tick uses the newest sample; lockstep: each tick waits for its sample (virtual clock, simulated device)",
);
/// Timeout of the samples.
pub const TIMEOUT: Parameter =
    Parameter::real("timeout_ms", "ms", 5.0, 10_000.0, 200.0, "Timeout for samples of the device");

/// Declares the largest force, with its upper limit, N.
pub const fn max_force(most_n: f64) -> Parameter {
    let doc = "Largest force on the hand; 0: the limit of the device";
    Parameter::real("max_force_n", "N", 0.0, most_n, 0.0, doc)
}

/// Declares the largest torque, with its upper limit, N·m.
pub const fn max_torque(most_nm: f64) -> Parameter {
    let doc = "Largest torque on the hand; 0: the limit of the device";
    Parameter::real("max_torque_nm", "N·m", 0.0, most_nm, 0.0, doc)
}
