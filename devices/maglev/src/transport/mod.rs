//! Links that carry frames, behind one trait: nothing above knows which library moves the bytes.
//!
//! | | feature | carries |
//! |---|---|---|
//! | [`tcp`] | always | coded frames on a connection |
//! | [`serial`] | `serial` (default) | coded frames on a serial port, a USB CDC port or a pseudo terminal |
//! | `usb` | `usb` | packets on a pair of interrupt or bulk endpoints |
//! | `hid` | `hid` | packets as reports |
//!
//! In a tick a link never waits: what has not arrived is not there. At most one command is on its way; a link that is busy
//! drops the new one, because a queue of commands is a queue of old forces.

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

/// How long a link that cannot wait by itself sleeps between two looks.
const NAP: Duration = Duration::from_micros(250);

/// What a look at a link found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Incoming {
    /// A packet of the right length.
    Packet([u8; FRAME_BYTES]),
    /// Something of another length, or not decodable.
    Malformed,
    /// Nothing has arrived.
    Nothing,
}

/// The other side is gone: closed, unplugged, or killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkLost;

/// A link that carries packets of one frame.
pub trait Transport: Send {
    /// Sends a frame, or drops it if the link is still busy with the one before. Real-time: bounded, no
    /// allocation; one call of the system.
    ///
    /// # Errors
    /// [`LinkLost`] if there is no other side.
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost>;

    /// Takes what has arrived, one packet a call. Real-time: bounded, no allocation; one call of the system.
    ///
    /// # Errors
    /// [`LinkLost`] if there is no other side.
    fn receive(&mut self) -> Result<Incoming, LinkLost>;

    /// Likewise, waiting for it for at most `patience`. Not real-time.
    ///
    /// # Errors
    /// [`LinkLost`] if there is no other side.
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

/// Why a link cannot be opened: what, and what to do.
#[derive(Debug)]
#[non_exhaustive]
pub enum OpenError {
    /// Nothing is there under that address.
    Missing {
        /// What was looked for.
        address: String,
        /// What the system said.
        cause: String,
    },
    /// Somebody else uses it.
    Busy {
        /// What was looked for.
        address: String,
    },
    /// This user may not use it.
    Forbidden {
        /// What was looked for.
        address: String,
        /// What to do.
        remedy: String,
    },
    /// The address means nothing to this transport.
    Address {
        /// The address.
        address: String,
        /// What it should look like.
        expected: &'static str,
    },
    /// No host has that name.
    UnknownHost {
        /// The name.
        host: String,
    },
    /// This system cannot carry it.
    NotOffered {
        /// Why not, and what to do.
        why: &'static str,
    },
    /// The system has no driver for it that lets programs use it.
    NoDriver {
        /// What was looked for.
        address: String,
        /// What to do.
        remedy: String,
    },
    /// The plugin was built without this transport.
    NotBuilt {
        /// The feature it needs.
        feature: &'static str,
    },
}

impl std::fmt::Display for OpenError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Missing { address, cause } => {
                write!(
                    f,
                    "no controller at {address} ({cause}); is it connected and switched on? The parameter `address` must be its address"
                )
            }
            Self::Busy { address } => {
                write!(f, "{address} is in use by another program; close that one first")
            }
            Self::Forbidden { address, remedy } => write!(f, "this user may not use {address}; {remedy}"),
            Self::Address { address, expected } => write!(f, "`address` = `{address}` is not {expected}"),
            Self::UnknownHost { host } => {
                write!(f, "no host `{host}` is known (`address`); check the name or use its IP address")
            }
            Self::NotOffered { why } => f.write_str(why),
            Self::NoDriver { address, remedy } => {
                write!(f, "{address} has a driver that programs cannot use, or none; {remedy}")
            }
            Self::NotBuilt { feature } => write!(
                f,
                "this plugin was built without that transport; build it with `cargo build --release -p \
                 flotor-maglev --features {feature}`"
            ),
        }
    }
}

impl std::error::Error for OpenError {}

/// How a controller is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// TCP, `host:port`.
    Tcp,
    /// A serial port, by its path.
    Serial,
    /// USB, `vendor:product` in hex, with `:serial` behind it if there are several.
    Usb,
    /// HID, likewise.
    Hid,
}

/// Opens a link. Not real-time.
///
/// # Errors
/// [`OpenError`].
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
