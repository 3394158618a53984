//! Windows: HID devices by the paths of their interfaces.

use hidapi::HidError;
use std::io::ErrorKind;

/// `ERROR_SHARING_VIOLATION`: another program has the device open.
const SHARING_VIOLATION: i32 = 32;

/// Help text of the parameter `path`.
pub(crate) const PATH_HELP: &str =
    r"Path of the device, such as \\?\HID#VID_256F... (default: the first device found)";
/// Example of the parameter `path`.
pub(crate) const PATH_EXAMPLE: &str = r"\\?\HID#VID_256F...";
/// Remedy for denied access.
pub(crate) const ACCESS_REMEDY: &str = "close the program that uses the device";

/// Returns whether an error is denied access, because another program has the device open.
pub(crate) fn is_refused(error: &HidError) -> bool {
    let HidError::IoError { error } = error else { return false };
    error.kind() == ErrorKind::PermissionDenied || error.raw_os_error() == Some(SHARING_VIOLATION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    #[test]
    fn what_the_system_does_not_give_is_told_from_what_is_not_there() {
        let of = |path| HidError::from(File::open(path).expect_err("it cannot be opened"));
        assert!(is_refused(&of(r"C:\windows")), "a folder is refused as a device is");
        assert!(!is_refused(&of(r"C:\windows\nowhere")));
        assert!(is_refused(&HidError::from(std::io::Error::from_raw_os_error(SHARING_VIOLATION))));
    }
}
