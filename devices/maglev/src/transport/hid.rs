//! HID: packets as reports of 64 bytes without a report number, through the kernel's hidraw. Not on Windows, where a write
//! blocks until the device has received it.

use super::address::{UsbAddress, remedy};
use super::{Incoming, LinkLost, OpenError, Transport};
use crate::platform::hid_is_offered;
use crate::protocol::FRAME_BYTES;
use hidapi::{HidApi, HidDevice, HidError};
use std::time::Duration;

/// Size of the receive buffer: one byte more than a frame, to detect longer reports.
const BUFFER_BYTES: usize = FRAME_BYTES + 1;

/// Link over an open HID device.
pub struct HidLink {
    device: HidDevice,
}

/// Opens the HID device at `vendor:product` or `vendor:product:serial`. Not real-time.
///
/// # Errors
/// [`OpenError`] if the address is invalid, or no device can be opened there.
pub fn open(address: &str) -> Result<HidLink, OpenError> {
    hid_is_offered().map_err(|why| OpenError::NotOffered { why })?;
    let wanted = UsbAddress::parse(address).ok_or_else(|| UsbAddress::misread(address))?;
    let refused = |error: HidError| refused(address, &wanted, &error);
    let api = HidApi::new().map_err(refused)?;
    let device = match &wanted.serial {
        Some(serial) => api.open_serial(wanted.vendor, wanted.product, serial),
        None => api.open(wanted.vendor, wanted.product),
    };
    let device = device.map_err(refused)?;
    device.set_blocking_mode(false).map_err(refused)?;
    Ok(HidLink { device })
}

impl Transport for HidLink {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        let mut report = [0; FRAME_BYTES + 1];
        // First byte: HID report number 0, as there is only one report.
        if let Some(room) = report.get_mut(1..) {
            room.copy_from_slice(frame);
        }
        self.device.write(&report).map(|_| ()).map_err(|_| LinkLost)
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        self.wait(Duration::ZERO)
    }

    fn wait(&mut self, patience: Duration) -> Result<Incoming, LinkLost> {
        let mut buffer = [0; BUFFER_BYTES];
        // Rounded up: a timeout below a millisecond would be no wait at all.
        let patience_ms = i32::try_from(patience.as_nanos().div_ceil(1_000_000)).unwrap_or(i32::MAX);
        // Every read error counts as a lost device: hidapi returns only a text.
        let length = self.device.read_timeout(&mut buffer, patience_ms).map_err(|_| LinkLost)?;
        let packet = buffer.get(..length).and_then(|bytes| bytes.try_into().ok());
        Ok(match (length, packet) {
            (0, _) => Incoming::Nothing,
            (_, Some(packet)) => Incoming::Packet(packet),
            (_, None) => Incoming::Malformed,
        })
    }
}

fn refused(address: &str, wanted: &UsbAddress, error: &HidError) -> OpenError {
    let (address, cause) = (address.to_owned(), error.to_string());
    let forbidden = match error {
        HidError::IoError { error } => error.kind() == std::io::ErrorKind::PermissionDenied,
        _ => cause.contains("ermission"),
    };
    match forbidden {
        true => OpenError::Forbidden { address, remedy: remedy("hidraw", wanted) },
        false => OpenError::Missing { address, cause },
    }
}
