//! The controller's end of a USB cable, in software: a device that the kernel of this machine enumerates, binds its
//! drivers to and hands to programs like any other.
//!
//! ```text
//! plugin -> libusb, hidraw or tty -> kernel -> vhci_hcd ~ USB/IP on a socket ~ bus -> link -> emulator
//! ```
//!
//! - [`personality`]: what the device claims to be: interrupt or bulk endpoints, HID, a serial port.
//! - `bus`: answers what the kernel asks: descriptors, settings, transfers; nothing to say is a transfer that waits.
//! - `link`: what the emulator sees of it.
//!
//! The messages between kernel and bus are `flotor-usbip`'s.
//!
//! Needs Linux with the module `vhci_hcd`, and the right to plug something in. Not real-time.

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

/// A device that is plugged in; dropping it pulls the cable.
pub struct Gadget {
    bus: Arc<Bus>,
    socket: UnixStream,
    server: Option<JoinHandle<()>>,
}

impl Gadget {
    /// Plugs a device into this machine.
    ///
    /// # Errors
    /// What the system says: usually that the module `vhci_hcd` is not loaded, or that this user may not.
    pub fn plug_in(personality: Personality, serial: &str) -> io::Result<Self> {
        let (ours, kernels) = UnixStream::pair()?;
        let gadget = Self::serve(personality, serial, ours)?;
        attach(&kernels, Speed::High)?;
        Ok(gadget)
    }

    /// A device at the end of a stream on which somebody speaks USB/IP.
    fn serve(personality: Personality, serial: &str, stream: UnixStream) -> io::Result<Self> {
        let bus = Arc::new(Bus::new(personality, serial, stream.try_clone()?));
        let (serving, mut requests) = (Arc::clone(&bus), stream.try_clone()?);
        let server = std::thread::Builder::new().name("flotor-gadget".to_owned());
        let server = server.spawn(move || serving.serve(&mut requests))?;
        Ok(Self { bus, socket: stream, server: Some(server) })
    }

    /// False once the other end of the cable is gone.
    #[must_use]
    pub fn is_plugged_in(&self) -> bool {
        self.bus.is_plugged_in()
    }

    /// Waits until a host uses the device, and gives the link to it; nothing if none came in time.
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
