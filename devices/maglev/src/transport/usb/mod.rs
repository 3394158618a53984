//! USB: packets on a pair of interrupt (or bulk) endpoints, through libusb.
//!
//! The endpoints and their kind are read from the descriptors. Alternate settings other than 0 are tried first: with an
//! empty setting 0 the kernel notifies the device when this process dies.
//!
//! Several reads are always pending on the bus, and a write is submitted without a wait (`queue`): a tick only takes
//! packets already received.

mod claim;
mod queue;

use super::address::{UsbAddress, remedy};
use super::{Incoming, LinkLost, OpenError, Transport};
use crate::platform::driver_remedy;
use crate::protocol::FRAME_BYTES;
use claim::{Endpoints, find};
use queue::Queue;
use rusb::{Context, DeviceHandle, Error};
use std::sync::Arc;
use std::time::Duration;

/// Link over a claimed USB interface, which is released when dropped.
pub struct UsbLink {
    handle: Arc<DeviceHandle<Context>>,
    endpoints: Endpoints,
    /// `None` only while the link is dropped: no transfer may be in flight when the setting changes.
    queue: Option<Queue>,
}

/// Opens and claims the USB device at `vendor:product` or `vendor:product:serial`. Not real-time.
///
/// # Errors
/// [`OpenError`] if the address is invalid, or no device can be claimed there.
pub fn open(address: &str) -> Result<UsbLink, OpenError> {
    let wanted = UsbAddress::parse(address).ok_or_else(|| UsbAddress::misread(address))?;
    let refused = |error| refused(address, &wanted, error);
    let context = Context::new().map_err(refused)?;
    let (handle, endpoints) = find(&context, &wanted).map_err(refused)?;
    let handle = Arc::new(handle);
    let queue = Queue::start(Arc::clone(&handle), endpoints).map_err(refused)?;
    Ok(UsbLink { handle, endpoints, queue: Some(queue) })
}

impl Transport for UsbLink {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        self.queue.as_mut().ok_or(LinkLost)?.send(frame)
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        self.queue.as_ref().ok_or(LinkLost)?.receive()
    }

    fn wait(&mut self, patience: Duration) -> Result<Incoming, LinkLost> {
        self.queue.as_ref().ok_or(LinkLost)?.wait(patience)
    }
}

impl Drop for UsbLink {
    fn drop(&mut self) {
        self.queue = None;
        // Ends the use of the device explicitly, as the kernel would do anyway.
        let _ = self.handle.set_alternate_setting(self.endpoints.interface, 0);
        let _ = self.handle.release_interface(self.endpoints.interface);
    }
}

fn refused(address: &str, wanted: &UsbAddress, error: Error) -> OpenError {
    let address = address.to_owned();
    match error {
        Error::Access => OpenError::Forbidden { address, remedy: remedy("usb", wanted) },
        Error::Busy => OpenError::Busy { address },
        // libusb cannot open a device with an incompatible driver.
        Error::NotSupported => match driver_remedy(wanted.vendor, wanted.product) {
            Some(remedy) => OpenError::NoDriver { address, remedy },
            None => OpenError::Missing { address, cause: error.to_string() },
        },
        other => OpenError::Missing { address, cause: other.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_may_not_is_told_what_to_do() {
        let wanted = UsbAddress::parse("1209:f107").unwrap();
        let said = refused("1209:f107", &wanted, Error::Access).to_string();
        assert!(said.ends_with(&remedy("usb", &wanted)) && said.contains("f107"), "{said}");
        // Where the system has a driver for every device, it has another fault.
        let told = refused("1209:f107", &wanted, Error::NotSupported).to_string();
        let remedy = driver_remedy(wanted.vendor, wanted.product);
        assert!(remedy.map_or(told.contains("switched on"), |remedy| told.ends_with(&remedy)), "{told}");
        assert!(refused("1209:f107", &wanted, Error::Busy).to_string().contains("in use by another program"));
    }

    #[test]
    fn what_is_not_there_is_missing() {
        // 0000:0000 is no vendor's product.
        assert!(matches!(open("0000:0000"), Err(OpenError::Missing { .. })));
        assert!(matches!(open("nonsense"), Err(OpenError::Address { .. })));
    }
}
