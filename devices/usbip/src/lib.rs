//! USB/IP between a device in software and the kernel of this machine, for emulators of devices.
//!
//! ```text
//! program -> libusb, hidraw or tty -> kernel -> vhci_hcd ~ USB/IP on a socket ~ emulator
//! ```
//!
//! - [`wire`]: the messages.
//! - [`vhci`]: where a device is plugged in; needs the module `vhci_hcd` and the right to plug something in.
//!
//! Not real-time.
#![cfg(target_os = "linux")]

pub mod vhci;
pub mod wire;
