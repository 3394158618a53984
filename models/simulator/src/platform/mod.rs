//! Platform-specific code. Each system has one module with the same item: `Socket`, one end of a pair that keeps messages apart.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::Socket;
#[cfg(windows)]
pub(crate) use windows::Socket;
