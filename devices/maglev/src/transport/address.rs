//! Devices on a USB bus by their ids, and what a user has to do once to be allowed to use one.

use super::OpenError;

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

/// The line for udev that lets whoever sits at the machine use the device; `subsystem` is `usb` or `hidraw`.
pub(super) fn udev_remedy(subsystem: &str, wanted: &UsbAddress) -> String {
    let UsbAddress { vendor, product, .. } = wanted;
    // A hidraw node has its ids on a parent.
    let key = if subsystem == "hidraw" { "ATTRS" } else { "ATTR" };
    format!(
        "put this line into /etc/udev/rules.d/70-flotor.rules, run `sudo udevadm control --reload` and plug it in \
         again: SUBSYSTEM==\"{subsystem}\", {key}{{idVendor}}==\"{vendor:04x}\", \
         {key}{{idProduct}}==\"{product:04x}\", TAG+=\"uaccess\""
    )
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

    #[test]
    fn the_rule_names_the_ids_where_the_subsystem_has_them() {
        let wanted = UsbAddress::parse("1209:f107").unwrap();
        let rule = |subsystem| udev_remedy(subsystem, &wanted);
        assert!(
            rule("usb").contains("ATTR{idVendor}==\"1209\", ATTR{idProduct}==\"f107\", TAG+=\"uaccess\"")
        );
        assert!(rule("hidraw").contains("SUBSYSTEM==\"hidraw\", ATTRS{idVendor}==\"1209\""));
    }
}
