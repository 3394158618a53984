//! Plugin with the emulated device: boot loader, exchange, device contract, and the USB of a kernel.

mod attacks;
mod boot;
mod contract;
mod exchange;
mod findings;
#[cfg(target_os = "linux")]
mod kernel;
