//! Linux: hidraw, and udev, which says who may use it.

use hidapi::HidError;
use std::io::ErrorKind;

/// What the parameter `path` is.
pub(crate) const PATH_HELP: &str = "Which puck, as /dev/hidraw2; the first one found if not said";
/// What it may be.
pub(crate) const PATH_EXAMPLE: &str = "/dev/hidraw2";
/// How a user is allowed to use it.
pub(crate) const ACCESS_REMEDY: &str = "put `KERNEL==\"hidraw*\", ATTRS{idVendor}==\"256f\", TAG+=\"uaccess\"` into \
    /etc/udev/rules.d/70-spacemouse.rules, run `sudo udevadm control --reload` and plug it in again";

/// Whether this user may not use a device.
pub(crate) fn is_refused(error: &HidError) -> bool {
    match error {
        HidError::IoError { error } => error.kind() == ErrorKind::PermissionDenied,
        // It has only words for a path that it cannot open.
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
