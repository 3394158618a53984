//! USB/IP connection between an emulated device and the kernel of this machine.
//!
//! ```text
//! program -> libusb, hidraw or tty -> kernel -> vhci_hcd ~ USB/IP on a socket ~ emulator
//! ```
//!
//! - [`wire`]: encoding of the messages; [`descriptor`]: of the descriptors in them.
//! - [`vhci`]: attachment of a device; needs the module `vhci_hcd` and the permission to attach.
//!
//! Not real-time.
#![cfg(target_os = "linux")]

pub mod descriptor;
pub mod vhci;
pub mod wire;
