//! FTDI chip on the USB bus, accessed with libusb.

use crate::chip::{Chip, ChipLost, PRODUCT, Request, VENDOR};
use crate::platform::{OTHER_REMEDY, access_remedy, has_bus};
use rusb::{Context, Device, DeviceHandle, Direction, Error, TransferType, UsbContext};
use std::time::{Duration, Instant};

/// Timeout and retry interval of a claim: a device node exists before the kernel has configured the device and udev has set
/// its permissions.
const CLAIM_PATIENCE: Duration = Duration::from_secs(2);
const CLAIM_NAP: Duration = Duration::from_millis(10);
/// Timeout of a write; a device that accepts nothing for so long is gone.
const WRITE_PATIENCE: Duration = Duration::from_millis(200);
/// Request type: to the device, vendor-specific.
const VENDOR_OUT: u8 = 0x40;

/// Open chip with its claimed interface.
pub(crate) struct UsbChip {
    handle: DeviceHandle<Context>,
    interface: u8,
    input: u8,
    output: u8,
}

/// Opens the device with the serial number `serial`, or the first device that can be opened, and claims its interface. Not
/// real-time.
///
/// # Errors
/// One sentence with the cause and the remedy.
pub(crate) fn open(serial: Option<&str>) -> Result<UsbChip, String> {
    let context = Context::new().map_err(refused)?;
    let mut problem = Error::NotFound;
    for device in context.devices().map_err(refused)?.iter() {
        let Ok(descriptor) = device.device_descriptor() else { continue };
        if (descriptor.vendor_id(), descriptor.product_id()) != (VENDOR, PRODUCT) {
            continue;
        }
        match claim(&device, serial) {
            Ok(chip) => return Ok(chip),
            Err(Error::NoDevice) if problem != Error::NotFound => {} // no other device hides the problem
            Err(error) => problem = error,
        }
    }
    Err(refused(problem))
}

fn claim(device: &Device<Context>, serial: Option<&str>) -> Result<UsbChip, Error> {
    let started = Instant::now();
    loop {
        match try_claim(device, serial) {
            // Retry: the device may not be configured yet.
            Err(Error::NotFound | Error::Busy | Error::Access) if started.elapsed() < CLAIM_PATIENCE => {
                std::thread::sleep(CLAIM_NAP);
            }
            settled => return settled,
        }
    }
}

fn try_claim(device: &Device<Context>, serial: Option<&str>) -> Result<UsbChip, Error> {
    let handle = device.open()?;
    if let Some(wanted) = serial
        && handle.read_serial_number_string_ascii(&device.device_descriptor()?)? != wanted
    {
        return Err(Error::NoDevice);
    }
    let configuration = device.active_config_descriptor()?;
    let settings = configuration.interfaces().flat_map(|interface| interface.descriptors());
    let (interface, input, output) = settings
        .filter_map(|setting| {
            let bulk = |direction| {
                let mut all = setting.endpoint_descriptors();
                let is_it = |endpoint: &rusb::EndpointDescriptor<'_>| {
                    endpoint.direction() == direction && endpoint.transfer_type() == TransferType::Bulk
                };
                all.find(is_it).map(|endpoint| endpoint.address())
            };
            Some((setting.interface_number(), bulk(Direction::In)?, bulk(Direction::Out)?))
        })
        .next()
        .ok_or(Error::NotSupported)?;
    // Detaches the kernel's ftdi_sio; systems without support have no such driver.
    let _ = handle.set_auto_detach_kernel_driver(true);
    handle.claim_interface(interface)?;
    Ok(UsbChip { handle, interface, input, output })
}

impl Chip for UsbChip {
    fn request(&self, request: Request, value: u16) -> Result<(), ChipLost> {
        let sent = self.handle.write_control(VENDOR_OUT, request as u8, value, 0, &[], WRITE_PATIENCE);
        sent.map(drop).map_err(|_| ChipLost)
    }

    fn write(&self, bytes: &[u8]) -> Result<(), ChipLost> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.handle.write_bulk(self.output, rest, WRITE_PATIENCE).map_err(|_| ChipLost)?;
            rest = rest.get(taken..).unwrap_or_default();
        }
        Ok(())
    }

    fn read(&self, packets: &mut [u8], patience: Duration) -> Result<usize, ChipLost> {
        // For libusb, a timeout of zero means no timeout.
        match self.handle.read_bulk(self.input, packets, patience.max(Duration::from_millis(1))) {
            Ok(length) => Ok(length),
            Err(Error::Timeout | Error::Interrupted) => Ok(0),
            Err(_) => Err(ChipLost),
        }
    }
}

impl Drop for UsbChip {
    fn drop(&mut self) {
        let _ = self.handle.release_interface(self.interface);
    }
}

fn refused(error: Error) -> String {
    match error {
        Error::NotFound => "no Falcon is plugged in (USB 0403:cb48); check cable and power. Without a Falcon, start \
        the emulator with `flotor emulate falcon` (on Linux), for `address = \"tcp:127.0.0.1:4108\"`"
            .to_owned(),
        Error::Access => format!("no access to the Falcon; {}", access_remedy(VENDOR, PRODUCT)),
        Error::Busy => "the Falcon is in use by another program; close that program first".to_owned(),
        Error::NoDevice => "no Falcon has the serial number in `address`, or the Falcon was unplugged; set `address` to usb, or to usb: and a serial number"
            .to_owned(),
        Error::Other if !has_bus() => "no USB bus can be reached here, as in most containers; start the container with `--device \
                                       /dev/bus/usb`. Without a Falcon, start the emulator with `flotor emulate falcon`"
            .to_owned(),
        other => format!("the Falcon cannot be used ({other}); {OTHER_REMEDY}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_refusal_says_what_to_do() {
        for (error, words) in [
            (Error::NotFound, "check cable and power"),
            (Error::Access, &access_remedy(VENDOR, PRODUCT)),
            (Error::Busy, "close that program first"),
            (Error::NoDevice, "serial number"),
            (Error::Io, OTHER_REMEDY),
            (Error::Other, if has_bus() { OTHER_REMEDY } else { "--device /dev/bus/usb" }),
        ] {
            let said = refused(error);
            assert!(said.contains(words) && said.lines().count() == 1, "{said}");
        }
    }
}
