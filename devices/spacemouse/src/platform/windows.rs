//! Windows: HID devices by the paths of their interfaces.

/// What the parameter `path` is.
pub(crate) const PATH_HELP: &str =
    r"Which puck, as \\?\HID#VID_256F and what follows there; the first one found if not said";
/// What it may be.
pub(crate) const PATH_EXAMPLE: &str = r"\\?\HID#VID_256F and what follows there";
/// How a user is allowed to use it.
pub(crate) const ACCESS_REMEDY: &str = "close the program that uses it";
