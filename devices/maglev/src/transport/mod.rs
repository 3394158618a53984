//! Links for frames, behind one trait that hides the library of each transport.
//!
//! | | feature | carries |
//! |---|---|---|
//! | [`tcp`] | always | coded frames on a connection |
//! | [`serial`] | `serial` (default) | coded frames on a serial port, a USB CDC port or a pseudo terminal |
//! | `usb` | `usb` | packets on a pair of interrupt or bulk endpoints |
//! | `hid` | `hid` | packets as reports |
//!
//! In a tick a link never waits for data. At most one command is in transit; a busy link drops the new command, because
//! queued commands would arrive as outdated forces.

#[cfg(any(feature = "usb", feature = "hid"))]
pub mod address;
#[cfg(feature = "hid")]
pub mod hid;
#[cfg(feature = "serial")]
pub mod serial;
pub mod stream;
pub mod tcp;
#[cfg(feature = "usb")]
pub mod usb;

use crate::protocol::FRAME_BYTES;
use std::time::{Duration, Instant};

/// Poll interval of a link without a blocking wait.
const NAP: Duration = Duration::from_micros(250);

/// Result of one read of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Incoming {
    /// A packet of the right length.
    Packet([u8; FRAME_BYTES]),
    /// Data of a wrong length, or undecodable data.
    Malformed,
    /// No data available.
    Nothing,
}

/// Error: the other end is gone (closed, unplugged, or killed).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkLost;

/// Link for packets of one frame.
pub trait Transport: Send {
    /// Sends a frame, or drops the frame if the link is still busy with the previous one. Real-time: bounded, no
    /// allocation; one system call.
    ///
    /// # Errors
    /// [`LinkLost`] if the other end is gone.
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost>;

    /// Receives one packet; returns [`Incoming::Nothing`] if no packet is complete. Real-time: bounded by the received
    /// data, no allocation.
    ///
    /// # Errors
    /// [`LinkLost`] if the other end is gone.
    fn receive(&mut self) -> Result<Incoming, LinkLost>;

    /// Waits for one packet; returns [`Incoming::Nothing`] after the timeout `patience`. Not real-time.
    ///
    /// # Errors
    /// [`LinkLost`] if the other end is gone.
    fn wait(&mut self, patience: Duration) -> Result<Incoming, LinkLost> {
        let until = Instant::now() + patience;
        loop {
            let incoming = self.receive()?;
            let rest = until.saturating_duration_since(Instant::now());
            if incoming != Incoming::Nothing || rest.is_zero() {
                return Ok(incoming);
            }
            std::thread::sleep(rest.min(NAP));
        }
    }
}

/// Cause of a failure to open a link, with a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// No device or host at the address.
    #[error(
        "no controller at {address} ({cause}); check that the controller is connected and switched on, \
         and that the parameter `address` is right"
    )]
    Missing {
        /// The address given.
        address: String,
        /// Error text of the system.
        cause: String,
    },
    /// Another program uses the device.
    #[error("{address} is in use by another program; close that program first")]
    Busy {
        /// The address given.
        address: String,
    },
    /// The user has no permission for the device.
    #[error("no access to {address}; {remedy}")]
    Forbidden {
        /// The address given.
        address: String,
        /// Instructions for access.
        remedy: String,
    },
    /// The address has the wrong format for the transport.
    #[error("`address` = `{address}` is not valid; write {expected}")]
    Address {
        /// The address given.
        address: String,
        /// The expected format.
        expected: &'static str,
    },
    /// The host name is unknown.
    #[error("unknown host `{host}` (`address`); check the name or use the IP address")]
    UnknownHost {
        /// The host name given.
        host: String,
    },
    /// The transport is not available on this system.
    #[error("{why}")]
    NotOffered {
        /// Reason and alternative.
        why: &'static str,
    },
    /// The device has no driver with access for programs.
    #[error("{address} has no driver that programs can use; {remedy}")]
    NoDriver {
        /// The address given.
        address: String,
        /// Instructions for installing a driver.
        remedy: String,
    },
    /// The plugin was built without this transport.
    #[error(
        "this plugin was built without the transport `{feature}`; build the plugin with `cargo build \
         --release -p flotor-maglev --features {feature}`, or choose another `transport`"
    )]
    NotBuilt {
        /// Cargo feature of the transport.
        feature: &'static str,
    },
}

/// Kind of a transport, with its address format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// TCP at `host:port`.
    Tcp,
    /// A serial port or pseudo terminal, by its path.
    Serial,
    /// USB device, `vendor:product` in hex, optionally with `:serial`.
    Usb,
    /// HID device, `vendor:product` in hex, optionally with `:serial`.
    Hid,
}

/// Opens a link of this kind to an address. Not real-time.
///
/// # Errors
/// [`OpenError`] if the address is invalid or unreachable, or the transport is not available.
pub fn open(kind: Kind, address: &str) -> Result<Box<dyn Transport>, OpenError> {
    match kind {
        Kind::Tcp => Ok(Box::new(tcp::connect(address)?)),
        #[cfg(feature = "serial")]
        Kind::Serial => Ok(Box::new(serial::open(address)?)),
        #[cfg(not(feature = "serial"))]
        Kind::Serial => Err(OpenError::NotBuilt { feature: "serial" }),
        #[cfg(feature = "usb")]
        Kind::Usb => Ok(Box::new(usb::open(address)?)),
        #[cfg(not(feature = "usb"))]
        Kind::Usb => Err(OpenError::NotBuilt { feature: "usb" }),
        #[cfg(feature = "hid")]
        Kind::Hid => Ok(Box::new(hid::open(address)?)),
        #[cfg(not(feature = "hid"))]
        Kind::Hid => Err(OpenError::NotBuilt { feature: "hid" }),
    }
}
