//! USB: packets on a pair of interrupt (or bulk) endpoints, through libusb.
//!
//! Where the endpoints are, and what kind they are, is read from the descriptors. They are looked for in alternate
//! settings other than 0 first: a device that keeps setting 0 empty is told by the kernel when this process dies.
//!
//! Reading waits in a thread of its own and hands packets over through a bounded channel, so that a tick only ever
//! takes what is there. Writing is one short transfer at a time.

use super::address::{UsbAddress, udev_remedy};
use super::{Incoming, LinkLost, OpenError, Transport};
use crate::protocol::FRAME_BYTES;
use rusb::{Context, Device, DeviceHandle, Direction, Error, TransferType, UsbContext};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest a write may take: half a period at 1 kHz would do, but libusb counts whole milliseconds.
const WRITE_TIMEOUT: Duration = Duration::from_millis(1);
/// How often the reader looks whether it is still wanted.
const READ_TIMEOUT: Duration = Duration::from_millis(50);
/// Packets between reader and tick: a few periods.
const WAITING_PACKETS: usize = 16;
/// A device node is there before the kernel has configured the device (seen: up to 14 ms; udev rules take longer).
const CLAIM_PATIENCE: Duration = Duration::from_secs(2);
const CLAIM_NAP: Duration = Duration::from_millis(10);
/// A multiple of every packet size, or a longer packet would be lost to an overflow.
const BUFFER_BYTES: usize = 512;

/// A pair of endpoints and how to select them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Endpoints {
    interface: u8,
    alternate: u8,
    input: u8,
    output: u8,
    transfer: TransferType,
}

/// A claimed USB interface.
pub struct UsbLink {
    handle: Arc<DeviceHandle<Context>>,
    endpoints: Endpoints,
    packets: Receiver<Incoming>,
    wanted: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

/// Opens and claims a device. Not real-time.
///
/// # Errors
/// [`OpenError`].
pub fn open(address: &str) -> Result<UsbLink, OpenError> {
    let wanted = UsbAddress::parse(address).ok_or_else(|| UsbAddress::misread(address))?;
    let refused = |error| refused(address, &wanted, error);
    let context = Context::new().map_err(refused)?;
    let (handle, endpoints) = find(&context, &wanted).map_err(refused)?;
    let handle = Arc::new(handle);
    let (sender, packets) = sync_channel(WAITING_PACKETS);
    let still_wanted = Arc::new(AtomicBool::new(true));
    let (reading, reading_wanted) = (Arc::clone(&handle), Arc::clone(&still_wanted));
    let thread = std::thread::Builder::new().name("flotor-usb-read".to_owned());
    let reader = thread.spawn(move || read(&reading, endpoints, &sender, &reading_wanted));
    let reader = reader
        .map_err(|error| OpenError::Missing { address: address.to_owned(), cause: error.to_string() })?;
    Ok(UsbLink { handle, endpoints, packets, wanted: still_wanted, reader: Some(reader) })
}

fn find(context: &Context, wanted: &UsbAddress) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let mut problem = Error::NotFound;
    for device in context.devices()?.iter() {
        let descriptor = device.device_descriptor()?;
        if (descriptor.vendor_id(), descriptor.product_id()) != (wanted.vendor, wanted.product) {
            continue;
        }
        match claim(&device, wanted) {
            Ok(found) => return Ok(found),
            Err(error) => problem = error,
        }
    }
    Err(problem)
}

fn claim(device: &Device<Context>, wanted: &UsbAddress) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let started = Instant::now();
    loop {
        let tried = try_claim(device, wanted);
        match tried {
            // Too early, or really so: time tells.
            Err(Error::NotFound | Error::Busy | Error::Access) if started.elapsed() < CLAIM_PATIENCE => {
                std::thread::sleep(CLAIM_NAP);
            }
            settled => return settled,
        }
    }
}

fn try_claim(
    device: &Device<Context>,
    wanted: &UsbAddress,
) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let handle = device.open()?;
    if let Some(serial) = &wanted.serial {
        let found = handle.read_serial_number_string_ascii(&device.device_descriptor()?)?;
        if found != *serial {
            return Err(Error::NoDevice);
        }
    }
    let endpoints = endpoints(device)?.ok_or(Error::NotSupported)?;
    // A generic driver of the kernel steps aside; where that is not supported there is none.
    let _ = handle.set_auto_detach_kernel_driver(true);
    handle.claim_interface(endpoints.interface)?;
    handle.set_alternate_setting(endpoints.interface, endpoints.alternate)?;
    Ok((handle, endpoints))
}

/// The best pair of endpoints: interrupt before bulk, alternate settings before setting 0.
fn endpoints(device: &Device<Context>) -> Result<Option<Endpoints>, Error> {
    let configuration = device.active_config_descriptor()?;
    let mut found = Vec::new();
    for interface in configuration.interfaces() {
        for setting in interface.descriptors() {
            for transfer in [TransferType::Interrupt, TransferType::Bulk] {
                let first = |direction| {
                    let mut all = setting.endpoint_descriptors();
                    all.find(|endpoint| {
                        endpoint.direction() == direction
                            && endpoint.transfer_type() == transfer
                            && usize::from(endpoint.max_packet_size()) >= FRAME_BYTES
                    })
                };
                if let (Some(input), Some(output)) = (first(Direction::In), first(Direction::Out)) {
                    found.push(Endpoints {
                        interface: interface.number(),
                        alternate: setting.setting_number(),
                        input: input.address(),
                        output: output.address(),
                        transfer,
                    });
                }
            }
        }
    }
    found.sort_by_key(|pair| (pair.transfer != TransferType::Interrupt, pair.alternate == 0));
    Ok(found.first().copied())
}

fn read(
    handle: &DeviceHandle<Context>,
    endpoints: Endpoints,
    packets: &SyncSender<Incoming>,
    wanted: &AtomicBool,
) {
    let mut buffer = [0; BUFFER_BYTES];
    while wanted.load(Ordering::Relaxed) {
        let read = match endpoints.transfer {
            TransferType::Interrupt => handle.read_interrupt(endpoints.input, &mut buffer, READ_TIMEOUT),
            _ => handle.read_bulk(endpoints.input, &mut buffer, READ_TIMEOUT),
        };
        let packet = match read {
            Ok(length) => buffer.get(..length).and_then(|bytes| bytes.try_into().ok()),
            Err(Error::Timeout | Error::Interrupted) => continue,
            Err(Error::Overflow) => None,
            // Ending the thread ends the channel, which is how the tick learns of it.
            Err(_) => return,
        };
        // A tick that does not take them loses the newest ones, and learns so from the sequence numbers.
        let _ = packets.try_send(packet.map_or(Incoming::Malformed, Incoming::Packet));
    }
}

impl Transport for UsbLink {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        let written = match self.endpoints.transfer {
            TransferType::Interrupt => {
                self.handle.write_interrupt(self.endpoints.output, frame, WRITE_TIMEOUT)
            }
            _ => self.handle.write_bulk(self.endpoints.output, frame, WRITE_TIMEOUT),
        };
        match written {
            // Not taken in time: dropped, the next one is newer.
            Ok(_) | Err(Error::Timeout | Error::Interrupted) => Ok(()),
            Err(_) => Err(LinkLost),
        }
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        match self.packets.try_recv() {
            Ok(incoming) => Ok(incoming),
            Err(TryRecvError::Empty) => Ok(Incoming::Nothing),
            Err(TryRecvError::Disconnected) => Err(LinkLost),
        }
    }
}

impl Drop for UsbLink {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        // Told in so many words; the kernel would say it too.
        let _ = self.handle.set_alternate_setting(self.endpoints.interface, 0);
        let _ = self.handle.release_interface(self.endpoints.interface);
    }
}

fn refused(address: &str, wanted: &UsbAddress, error: Error) -> OpenError {
    let address = address.to_owned();
    match error {
        Error::Access => OpenError::Forbidden { address, remedy: udev_remedy("usb", wanted) },
        Error::Busy => OpenError::Busy { address },
        other => OpenError::Missing { address, cause: other.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_may_not_is_told_the_rule() {
        let wanted = UsbAddress::parse("1209:f107").unwrap();
        let said = refused("1209:f107", &wanted, Error::Access).to_string();
        assert!(
            said.contains("ATTR{idVendor}==\"1209\", ATTR{idProduct}==\"f107\", TAG+=\"uaccess\""),
            "{said}"
        );
        assert!(refused("1209:f107", &wanted, Error::Busy).to_string().contains("in use by another program"));
    }

    #[test]
    fn what_is_not_there_is_missing() {
        // 0000:0000 is no vendor's product.
        assert!(matches!(open("0000:0000"), Err(OpenError::Missing { .. })));
        assert!(matches!(open("nonsense"), Err(OpenError::Address { .. })));
    }
}
