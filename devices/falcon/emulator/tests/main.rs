//! The plugin against the emulated device: boot loader, exchange and the contract, and on a kernel's own USB.

mod attacks;
mod boot;
mod contract;
mod exchange;
mod findings;
#[cfg(target_os = "linux")]
mod kernel;
