//! Device plugin for Haply's Inverse3 and VerseGrip, through the documented WebSocket of Haply's Inverse Service.
//!
//! The service replies to each message with one state; a thread of the plugin keeps one message in flight:
//!
//! ```text
//! tick: write -> newest force --> thread: message -> service -> state --> newest sample -> tick: read
//! ```
//!
//! - [`json`]: reads JSON in place, without allocation.
//! - [`socket`]: a WebSocket as frames in two buffers that never grow.
//! - [`message`]: messages to the service, and its states.
//! - [`session`]: opens a session, sets its filters and reads them back; then one force for one sample.
//! - [`foreign`]: detects force that no command of this session explains.
//! - `exchange`: the thread and its data exchange with the tick.
//! - `plugin`: parameters and the contract.
//!
//! `flotor emulate haply-service` is a complete service without hardware.

mod exchange;
pub mod foreign;
pub mod json;
pub mod message;
mod plugin;
pub mod session;
mod session_error;
pub mod socket;

pub use plugin::{FLOTOR_ENTRY, Inverse3Device};
pub use session_error::SessionError;

#[cfg(test)]
#[path = "../tests/stand_in/texts.rs"]
mod stand_in;
