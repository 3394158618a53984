//! Devices on a USB bus by their ids, and what a user has to do once to be allowed to use one.

use super::OpenError;
use crate::platform::access_remedy;

/// A device by vendor, product and, if there are several, serial number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbAddress {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Serial number; any if absent.
    pub serial: Option<String>,
}

impl UsbAddress {
    /// Reads `vendor:product` or `vendor:product:serial`, ids in hex.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, ':');
        let mut id = || u16::from_str_radix(parts.next()?, 16).ok();
        let (vendor, product) = (id()?, id()?);
        Some(Self { vendor, product, serial: parts.next().map(str::to_owned) })
    }

    /// What is said to an address that is none.
    pub(super) fn misread(address: &str) -> OpenError {
        OpenError::Address {
            address: address.to_owned(),
            expected: "vendor:product or vendor:product:serial, ids in hex like 1209:f107",
        }
    }
}

/// What a user has to do to be allowed to use it; `subsystem` is `usb` or `hidraw`.
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
