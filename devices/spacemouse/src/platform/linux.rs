//! Linux: paths of hidraw devices, and the udev rule for access.

use hidapi::HidError;
use std::io::ErrorKind;

/// Help text of the parameter `path`.
pub(crate) const PATH_HELP: &str =
    "Path of the device, such as /dev/hidraw2 (default: the first device found)";
/// Example of the parameter `path`.
pub(crate) const PATH_EXAMPLE: &str = "/dev/hidraw2";
/// Remedy for a missing permission.
pub(crate) const ACCESS_REMEDY: &str = "put `KERNEL==\"hidraw*\", ATTRS{idVendor}==\"256f\", TAG+=\"uaccess\"` (for a \
    SpaceMouse of Logitech, 046d in place of 256f) into /etc/udev/rules.d/70-spacemouse.rules, run `sudo udevadm control --reload` and reconnect the device";

/// Returns whether an error is a missing permission.
pub(crate) fn is_refused(error: &HidError) -> bool {
    match error {
        HidError::IoError { error } => error.kind() == ErrorKind::PermissionDenied,
        // hidapi has only text for a path that cannot be opened.
        other => other.to_string().contains("ermission"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_user_may_not_is_told_from_what_is_not_there() {
        let of = |code| HidError::from(std::io::Error::from_raw_os_error(code));
        assert!(is_refused(&of(13)) && !is_refused(&of(2)));
        let message = |code: i32| std::io::Error::from_raw_os_error(code).to_string();
        assert!(is_refused(&HidError::HidApiError { message: message(13) }));
        assert!(!is_refused(&HidError::HidApiError { message: message(2) }));
    }
}
