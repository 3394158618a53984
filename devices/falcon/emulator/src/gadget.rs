//! Emulated Falcon on a virtual USB port of this machine (USB/IP): the kernel enumerates the device like a real one, so
//! libusb and every program for the Falcon find the device.
//!
//! A transfer towards the host stays pending until a packet is due. Needs Linux with the module `vhci_hcd`, and the
//! permission to attach a device.

use crate::in_process::InProcess;
use crate::machine::STATUS;
use flotor_falcon::chip::{PACKET_BYTES, PRODUCT, VENDOR};
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

/// Types of descriptors (USB 2.0, chapter 9).
const DEVICE: u8 = 1;
const CONFIGURATION: u8 = 2;
const STRING: u8 = 3;
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
                let waiting = bus.fetches.iter().position(|waiting| waiting.number == transfer);
                let in_time = waiting.and_then(|place| bus.fetches.remove(place)).is_some();
                wire::unlinked(&mut bus.socket, number, in_time)
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
                endpoint if endpoint & !INPUT == 0 => match self.control(&transfer) {
                    Some(mut data) => {
                        data.truncate(transfer.length);
                        wire::complete(&mut bus.socket, &transfer, &data)
                    }
                    None => wire::stall(&mut bus.socket, &transfer),
                },
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
                STRING => string_descriptor(value_low),
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
    let (usb_1_1, class, packet, release, strings, configurations) =
        ([0x10, 0x01], [0, 0, 0], 8, [0x00, 0x04], [1, 2, 3], 1);
    let mut bytes = vec![18, DEVICE];
    bytes.extend(usb_1_1);
    bytes.extend(class);
    bytes.push(packet);
    bytes.extend(VENDOR.to_le_bytes());
    bytes.extend(PRODUCT.to_le_bytes());
    bytes.extend(release);
    bytes.extend(strings);
    bytes.push(configurations);
    bytes
}

fn configuration_descriptor() -> Vec<u8> {
    let [packet_low, packet_high] = u16::try_from(PACKET_BYTES).unwrap_or(0).to_le_bytes();
    let (own_class, bulk) = (0xff, 2);
    let mut body = vec![9, 4, 0, 0, 2, own_class, own_class, own_class, 2];
    for address in [IN, OUT] {
        body.extend([7, 5, address, bulk, packet_low, packet_high, 0]);
    }
    let (self_powered, twice_milliampere) = (0xc0, 45);
    let total = u8::try_from(9 + body.len()).unwrap_or(0);
    let mut bytes = vec![9, CONFIGURATION, total, 0, 1, 1, 0, self_powered, twice_milliampere];
    bytes.extend(body);
    bytes
}

/// Returns a string descriptor; number 0 lists the languages.
fn string_descriptor(number: u8) -> Option<Vec<u8>> {
    let text = match number {
        0 => return Some(vec![4, STRING, 0x09, 0x04]), // American English
        1 => "Flotor",
        2 => "Falcon, emulated",
        3 => "FLOTOR01",
        _ => return None,
    };
    let mut bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    bytes.splice(0..0, [u8::try_from(bytes.len() + 2).unwrap_or(u8::MAX), STRING]);
    Some(bytes)
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
            let string = string_descriptor(number).expect("there is one");
            assert_eq!(usize::from(string[0]), string.len());
        }
        assert!(string_descriptor(4).is_none());
    }
}
