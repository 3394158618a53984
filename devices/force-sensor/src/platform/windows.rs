//! Windows: communication ports.

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the sensor is, as COM3";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "COM3";
/// What a user who cannot open it should ask.
pub(crate) const ACCESS_QUESTION: &str = "is it connected, and does no other program use it?";
