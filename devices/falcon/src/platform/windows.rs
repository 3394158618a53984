//! Windows: a driver says who may use a device; libusb needs WinUSB.

/// What helps where no other advice does.
pub(crate) const OTHER_REMEDY: &str =
    "give it the driver WinUSB with the program Zadig, connect it without a hub, and try again";

/// How a user is allowed to use the device.
pub(crate) fn access_remedy(vendor: u16, product: u16) -> String {
    format!(
        "close the program that uses {vendor:04x}:{product:04x}, or give it the driver WinUSB with the program Zadig"
    )
}
