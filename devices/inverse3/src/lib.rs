//! Haply's Inverse3 and VerseGrip, through the WebSocket that Haply's Inverse Service documents.
//!
//! The service answers each message with one state, so that a thread of its own keeps one message in flight:
//!
//! ```text
//! tick: write -> newest force --> thread: message -> service -> state --> newest sample -> tick: read
//! ```
//!
//! - [`json`]: reads JSON in place, without allocation.
//! - [`socket`]: a WebSocket as frames in two buffers that never grow.
//! - [`message`]: what is said to the service, and what its states say.
//! - [`session`]: opens a session, sets its filters and reads them back; then one force for one sample.
//! - [`foreign`]: finds force that no command of this session explains.
//! - `exchange`: the thread.
//! - `plugin`: parameters and the contract.
//! - [`stand_in`]: a service of a few lines that answers what a test wants.
//!
//! `flotor emulate haply-service` is a whole service without hardware.

mod exchange;
pub mod foreign;
pub mod json;
pub mod message;
mod plugin;
pub mod session;
pub mod socket;
pub mod stand_in;
mod trouble;

pub use plugin::{FLOTOR_ENTRY, Inverse3Device};
pub use trouble::Trouble;
