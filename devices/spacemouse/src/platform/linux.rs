//! Linux: hidraw, and udev, which says who may use it.

/// What the parameter `path` is.
pub(crate) const PATH_HELP: &str = "Which puck, as /dev/hidraw2; the first one found if not said";
/// What it may be.
pub(crate) const PATH_EXAMPLE: &str = "/dev/hidraw2";
/// How a user is allowed to use it.
pub(crate) const ACCESS_REMEDY: &str = "put `KERNEL==\"hidraw*\", ATTRS{idVendor}==\"256f\", TAG+=\"uaccess\"` into \
    /etc/udev/rules.d/70-spacemouse.rules, run `sudo udevadm control --reload` and plug it in again";
