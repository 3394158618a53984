//! The controller as an emulated USB device: the kernel of this machine enumerates the device, binds drivers and offers it
//! to programs like any other.
//!
//! ```text
//! plugin -> libusb, hidraw or tty -> kernel -> vhci_hcd ~ USB/IP on a socket ~ bus -> link -> emulator
//! ```
//!
//! - [`personality`]: kinds of the device: interrupt or bulk endpoints, HID, a serial port.
//! - `bus`: replies to the kernel: descriptors, settings, transfers; a transfer without data waits.
//! - `link`: the emulator's access to the bus.
//!
//! The messages between kernel and bus are encoded by `flotor-usbip`.
//!
//! Needs Linux with the module `vhci_hcd`, and permission to attach a device. Not real-time.

mod bus;
mod link;
pub mod personality;

#[cfg(test)]
mod tests;

pub use personality::Personality;

use bus::Bus;
use flotor_maglev::transport::Transport;
use flotor_usbip::vhci::{Speed, attach};
use std::io;
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Emulated USB device, plugged into this machine; dropping unplugs the device.
pub struct Gadget {
    bus: Arc<Bus>,
    socket: UnixStream,
    server: Option<JoinHandle<()>>,
}

impl Gadget {
    /// Plugs an emulated device with this serial number into a virtual USB port of this machine.
    ///
    /// # Errors
    /// Errors of the system: usually the module `vhci_hcd` is not loaded, or this user lacks permission.
    pub fn plug_in(personality: Personality, serial: &str) -> io::Result<Self> {
        let (ours, kernels) = UnixStream::pair()?;
        let gadget = Self::serve(personality, serial, ours)?;
        attach(&kernels, Speed::High)?;
        Ok(gadget)
    }

    /// Serves a device at the end of a stream for USB/IP.
    fn serve(personality: Personality, serial: &str, stream: UnixStream) -> io::Result<Self> {
        let bus = Arc::new(Bus::new(personality, serial, stream.try_clone()?));
        let (serving, mut requests) = (Arc::clone(&bus), stream.try_clone()?);
        let server = std::thread::Builder::new().name("flotor-gadget".to_owned());
        let server = server.spawn(move || serving.serve(&mut requests))?;
        Ok(Self { bus, socket: stream, server: Some(server) })
    }

    /// Returns true until the kernel detaches the device.
    #[must_use]
    pub fn is_plugged_in(&self) -> bool {
        self.bus.is_plugged_in()
    }

    /// Waits until a host program uses the device and returns the link to the program; `None` on timeout or when
    /// unplugged.
    #[must_use]
    pub fn wait_for_host(&self, patience: Duration) -> Option<Box<dyn Transport>> {
        let attachment = self.bus.wait_for_host(patience)?;
        Some(link::open(Arc::clone(&self.bus), attachment))
    }
}

impl Drop for Gadget {
    fn drop(&mut self) {
        let _ = self.socket.shutdown(Shutdown::Both);
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}
