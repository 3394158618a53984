//! Unix: terminals.

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the sensor is, as /dev/ttyACM0 or a path below /dev/serial/by-id";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "/dev/ttyACM0";
/// What a user who cannot open it should ask.
pub(crate) const ACCESS_QUESTION: &str = "is it connected, and may this user use it (group dialout)?";
