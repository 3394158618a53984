//! Addresses of USB devices, and instructions for access.

use super::OpenError;
use crate::platform::access_remedy;

/// Address of a USB device: vendor, product and, if there are several devices, serial number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbAddress {
    /// Vendor id, `idVendor` of the device descriptor.
    pub vendor: u16,
    /// Product id, `idProduct` of the device descriptor.
    pub product: u16,
    /// Serial number; `None`: any.
    pub serial: Option<String>,
}

impl UsbAddress {
    /// Parses `vendor:product` or `vendor:product:serial`, ids in hex; `None` for any other text.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, ':');
        let mut id = || u16::from_str_radix(parts.next()?, 16).ok();
        let (vendor, product) = (id()?, id()?);
        Some(Self { vendor, product, serial: parts.next().map(str::to_owned) })
    }

    /// Builds the error of an invalid address.
    pub(super) fn misread(address: &str) -> OpenError {
        OpenError::Address {
            address: address.to_owned(),
            expected: "vendor:product or vendor:product:serial, ids in hex like 1209:f107",
        }
    }
}

/// Returns instructions for access to the device; `subsystem` is `usb` or `hidraw`.
pub(super) fn remedy(subsystem: &str, wanted: &UsbAddress) -> String {
    access_remedy(subsystem, wanted.vendor, wanted.product)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_ids_in_hex() {
        let plain = UsbAddress { vendor: 0x1209, product: 0xf107, serial: None };
        assert_eq!(UsbAddress::parse("1209:f107"), Some(plain.clone()));
        assert_eq!(
            UsbAddress::parse("1209:f107:a:b"),
            Some(UsbAddress { serial: Some("a:b".to_owned()), ..plain })
        );
        for wrong in ["", "1209", "1209:", "1209:xyz", "12345:1"] {
            assert_eq!(UsbAddress::parse(wrong), None, "{wrong}");
        }
    }
}
