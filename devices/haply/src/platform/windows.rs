//! Windows: communication ports.

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the board is, as COM3";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "COM3";
/// How a user finds it.
pub(crate) const PORT_LIST: &str = "the Device Manager lists the ports";
