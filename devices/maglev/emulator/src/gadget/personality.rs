//! USB descriptors of the device by kind (USB 2.0, chapter 9; HID 1.11; CDC PSTN 1.2).

use flotor_maglev::protocol::FRAME_BYTES;
use flotor_usbip::descriptor::{BULK, Device, INTERRUPT, Supply, configuration, endpoint, interface, string};

/// Vendor id of all kinds: pid.codes, with its first sixteen products reserved for tests.
pub const VENDOR: u16 = 0x1209;

/// Kind of the emulated USB device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Personality {
    /// A pair of interrupt endpoints in alternate setting 1; setting 0 is empty.
    Interrupt,
    /// A pair of bulk endpoints in alternate setting 1; setting 0 is empty.
    Bulk,
    /// A HID device with reports of one frame each way.
    Hid,
    /// A serial port (CDC ACM).
    Serial,
}

/// Addresses of the endpoints from the host and to the host.
pub(super) const OUT: u8 = 0x01;
pub(super) const IN: u8 = 0x81;
/// Address of the serial port's notification endpoint, which never sends.
pub(super) const NOTIFY: u8 = 0x82;

/// Types of descriptors of classes.
const HID: u8 = 0x21;
pub(super) const REPORT: u8 = 0x22;
const CLASS_SPECIFIC: u8 = 0x24;

/// Largest packet of a bulk endpoint at high speed, the only size that USB 2.0 allows.
const BULK_BYTES: u16 = 512;
const INTERRUPT_BYTES: u16 = 64;
const _: () = assert!(INTERRUPT_BYTES as usize == FRAME_BYTES);

/// Vendor-defined collection of 64 bytes in and 64 bytes out, without report numbers.
pub(super) const REPORT_DESCRIPTOR: [u8; 27] = [
    0x06, 0x00, 0xff, // usage page: vendor
    0x09, 0x01, // usage 1
    0xa1, 0x01, // collection: application
    0x15, 0x00, 0x26, 0xff, 0x00, // each 0 to 255
    0x75, 0x08, 0x95, 0x40, // 64 of 8 bits
    0x09, 0x01, 0x81, 0x02, // in
    0x95, 0x40, 0x09, 0x01, 0x91, 0x02, // out
    0xc0,
];

impl Personality {
    /// Returns the product id: a different id for each kind, so that no system binds the driver of another kind.
    #[must_use]
    pub const fn product(self) -> u16 {
        match self {
            Self::Interrupt => 1,
            Self::Bulk => 2,
            Self::Hid => 3,
            Self::Serial => 4,
        }
    }

    /// Returns the address for the plugin's parameter `address` (transports `usb`, `hid`).
    #[must_use]
    pub fn address(self) -> String {
        format!("{VENDOR:04x}:{:04x}", self.product())
    }

    pub(super) fn device(self) -> Vec<u8> {
        // A serial port has its class in the device descriptor, the others in the interface descriptor.
        let class = if self == Self::Serial { 2 } else { 0 };
        let (usb, release) = (0x0200, 0x0100);
        Device { usb, class, packet_bytes: 64, vendor: VENDOR, product: self.product(), release }.bytes()
    }

    pub(super) fn configuration(self) -> Vec<u8> {
        let mut body = Vec::new();
        let pair = |kind, bytes, interval| {
            [endpoint(OUT, kind, bytes, interval), endpoint(IN, kind, bytes, interval)].concat()
        };
        match self {
            Self::Interrupt => {
                body.extend(interface(0, 0, 0, [0xff, 0, 0], 0));
                body.extend(interface(0, 1, 2, [0xff, 0, 0], 0));
                body.extend(pair(INTERRUPT, INTERRUPT_BYTES, EVERY_MICROFRAME));
            }
            Self::Bulk => {
                body.extend(interface(0, 0, 0, [0xff, 0, 0], 0));
                body.extend(interface(0, 1, 2, [0xff, 0, 0], 0));
                body.extend(pair(BULK, BULK_BYTES, 0));
            }
            Self::Hid => {
                body.extend(interface(0, 0, 2, [3, 0, 0], 0));
                #[allow(clippy::cast_possible_truncation)] // 27
                let report_bytes = REPORT_DESCRIPTOR.len() as u8;
                body.extend([9, HID, 0x11, 0x01, 0, 1, REPORT, report_bytes, 0]);
                body.extend(pair(INTERRUPT, INTERRUPT_BYTES, EVERY_MICROFRAME));
            }
            Self::Serial => {
                body.extend(interface(0, 0, 1, [2, 2, 1], 0));
                // Header 1.10; calls as data on interface 1; line coding and state are supported; union of 0 and 1.
                body.extend([5, CLASS_SPECIFIC, 0, 0x10, 0x01, 5, CLASS_SPECIFIC, 1, 0, 1]);
                body.extend([4, CLASS_SPECIFIC, 2, 2, 5, CLASS_SPECIFIC, 6, 0, 1]);
                body.extend(endpoint(NOTIFY, INTERRUPT, 8, EVERY_16_MILLISECONDS));
                body.extend(interface(1, 0, 2, [10, 0, 0], 0));
                body.extend(pair(BULK, BULK_BYTES, 0));
            }
        }
        configuration(if self == Self::Serial { 2 } else { 1 }, Supply::Bus, 50, &body)
    }

    /// Returns the string descriptor `number`; 0 lists the languages, `None` for an unknown number.
    pub(super) fn string(self, number: u8, serial: &str) -> Option<Vec<u8>> {
        string(number, ["Flotor", "Maglev controller, emulated", serial])
    }
}

/// Values of `bInterval` at high speed: 2^(n-1) microframes of 125 µs.
const EVERY_MICROFRAME: u8 = 1;
const EVERY_16_MILLISECONDS: u8 = 8;
