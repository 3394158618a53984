//! Unix: terminals.

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the board is, as /dev/ttyACM0 or a path below /dev/serial/by-id";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "/dev/ttyACM0";
/// How a user finds it.
pub(crate) const PORT_LIST: &str = "`ls /dev/serial/by-id` lists the ports";
