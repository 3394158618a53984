//! Emulated Falcon on a virtual USB port of this machine (USB/IP): the kernel enumerates the device like a real one, so
//! libusb and every program for the Falcon find the device.
//!
//! A transfer towards the host stays pending until a packet is due. Needs Linux with the module `vhci_hcd`, and the
//! permission to attach a device.

use crate::in_process::InProcess;
use crate::machine::STATUS;
use flotor_falcon::chip::{PACKET_BYTES, PRODUCT, VENDOR};
use flotor_usbip::descriptor::{
    BULK, CONFIGURATION, DEVICE, Device, STRING, Supply, configuration, endpoint, interface, string,
};
use flotor_usbip::vhci::{Speed, attach};
use flotor_usbip::wire::{self, INPUT, Message, Transfer};
use std::collections::VecDeque;
use std::io;
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Addresses of the bulk endpoints.
const OUT: u8 = 0x02;
const IN: u8 = 0x81;
/// Poll interval for due packets: a quarter of the shortest latency timer.
const LOOK: Duration = Duration::from_micros(250);

/// Maker, product and serial number.
const STRINGS: [&str; 3] = ["Flotor", "Falcon, emulated", "FLOTOR01"];
/// Request types of the vendor, to and from the device.
const VENDOR_OUT: u8 = 0x40;
const VENDOR_IN: u8 = 0xc0;

/// Emulated device attached to a virtual USB port; dropping it detaches the device.
pub struct Gadget {
    socket: UnixStream,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    device: InProcess,
    bus: Mutex<Bus>,
    is_over: AtomicBool,
}

struct Bus {
    socket: UnixStream,
    /// Pending transfers towards the host, oldest first.
    fetches: VecDeque<Transfer>,
}

impl Gadget {
    /// Attaches the device to a virtual USB port of this machine, and starts the threads that serve it.
    ///
    /// # Errors
    /// Errors of the system: usually the module `vhci_hcd` is not loaded, or the user has no permission.
    pub fn plug_in(device: InProcess) -> io::Result<Self> {
        let (ours, kernels) = UnixStream::pair()?;
        let bus = Bus { socket: ours.try_clone()?, fetches: VecDeque::new() };
        let shared = Arc::new(Shared { device, bus: Mutex::new(bus), is_over: AtomicBool::new(false) });
        let (serving, pacing) = (Arc::clone(&shared), Arc::clone(&shared));
        let mut requests = ours.try_clone()?;
        let thread = |name: &str| std::thread::Builder::new().name(name.to_owned());
        let mut gadget = Self { socket: ours, shared, threads: Vec::new() };
        gadget.threads.push(thread("flotor-gadget").spawn(move || {
            while let Ok(message) = Message::read(&mut requests) {
                if serving.answer(message).is_err() {
                    break;
                }
            }
            serving.is_over.store(true, Ordering::Release);
        })?);
        gadget.threads.push(thread("flotor-latency").spawn(move || pacing.pace())?);
        attach(&kernels, Speed::Full)?;
        Ok(gadget)
    }

    /// Returns false once the connection to the kernel has ended.
    #[must_use]
    pub fn is_plugged_in(&self) -> bool {
        !self.shared.is_over.load(Ordering::Acquire)
    }
}

impl Drop for Gadget {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Release);
        let _ = self.socket.shutdown(Shutdown::Both);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Bus> {
        self.bus.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Completes pending transfers as packets become due, until the device is detached.
    fn pace(&self) {
        while !self.is_over.load(Ordering::Acquire) {
            std::thread::sleep(LOOK);
            let mut bus = self.lock();
            if self.device.machine().is_gone() {
                // A reset of the hub unplugs the device for the kernel.
                let _ = bus.socket.shutdown(Shutdown::Both);
                return;
            }
            if self.deliver(&mut bus).is_err() {
                return;
            }
        }
    }

    fn deliver(&self, bus: &mut Bus) -> io::Result<()> {
        while let Some(transfer) = bus.fetches.front() {
            let Some(mut data) = self.device.machine().packet(self.device.now()) else { break };
            // A short packet or the last byte completes a transfer.
            while data.len().is_multiple_of(PACKET_BYTES) && data.len() + PACKET_BYTES <= transfer.length {
                let next = self.device.machine().packet(self.device.now());
                data.extend(next.unwrap_or_else(|| STATUS.to_vec()));
            }
            data.truncate(transfer.length);
            wire::complete(&mut bus.socket, transfer, &data)?;
            bus.fetches.pop_front();
        }
        Ok(())
    }

    fn answer(&self, message: Message) -> io::Result<()> {
        let mut bus = self.lock();
        match message {
            Message::Unlink { number, transfer } => {
                let Bus { socket, fetches } = &mut *bus;
                wire::unlink(socket, fetches, number, transfer)
            }
            Message::Submit(transfer) => match transfer.endpoint {
                IN => {
                    bus.fetches.push_back(transfer);
                    self.deliver(&mut bus)
                }
                OUT => {
                    self.device.machine().output(&transfer.data, self.device.now());
                    wire::complete(&mut bus.socket, &transfer, &[])
                }
                endpoint if endpoint & !INPUT == 0 => {
                    wire::answer(&mut bus.socket, &transfer, self.control(&transfer))
                }
                _ => wire::stall(&mut bus.socket, &transfer),
            },
        }
    }

    /// Answers a control transfer; `None` stalls the endpoint.
    fn control(&self, transfer: &Transfer) -> Option<Vec<u8>> {
        let [kind, request, value_low, value_high, ..] = transfer.setup;
        let value = u16::from_le_bytes([value_low, value_high]);
        match (kind, request) {
            (VENDOR_OUT, _) => self.device.machine().request(request, value),
            (VENDOR_IN, _) => self.device.machine().question(request),
            (0x80, 6) => match value_high {
                DEVICE => Some(device_descriptor()),
                CONFIGURATION => Some(configuration_descriptor()),
                STRING => string(value_low, STRINGS),
                _ => None,
            },
            // Get and set configuration, get and set interface, get status, clear feature: the device has one of each, and no
            // endpoint is ever halted.
            (0x80, 8) => Some(vec![1]),
            (0x81, 10) => Some(vec![0]),
            (0x00, 9) | (0x01, 11) | (0x02, 1) => Some(Vec::new()),
            (0x80..=0x82, 0) => Some(vec![0, 0]),
            _ => None,
        }
    }
}

/// Returns the descriptor of an FT232BM with the vendor and product of a Falcon.
fn device_descriptor() -> Vec<u8> {
    let (usb, release) = (0x0110, 0x0400);
    Device { usb, class: 0, packet_bytes: 8, vendor: VENDOR, product: PRODUCT, release }.bytes()
}

fn configuration_descriptor() -> Vec<u8> {
    let own_class = [0xff; 3];
    let packet_bytes = u16::try_from(PACKET_BYTES).unwrap_or(0);
    let bulk = |address| endpoint(address, BULK, packet_bytes, 0);
    let body = [&interface(0, 0, 2, own_class, 2)[..], &bulk(IN), &bulk(OUT)].concat();
    configuration(1, Supply::Own, 45, &body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptors_have_the_lengths_they_say() {
        let (device, configuration) = (device_descriptor(), configuration_descriptor());
        assert_eq!((device.len(), usize::from(device[0])), (18, 18));
        assert_eq!(&device[8..12], [0x03, 0x04, 0x48, 0xcb], "0403:cb48");
        assert_eq!((configuration.len(), usize::from(configuration[2])), (32, 32));
        for number in 0..4 {
            let string = string(number, STRINGS).expect("there is one");
            assert_eq!(usize::from(string[0]), string.len());
        }
        assert!(string(4, STRINGS).is_none());
    }
}
