//! The wire protocol between host and controller: one frame of 64 bytes, one codec, every transport.
//!
//! - [`frame`]: requests and replies, and their encoding.
//! - [`description`]: description of a controller, on request.
//! - [`intake`]: replay protection; [`rejection`]: reasons of rejected frames, and their counts.
//! - [`stream`]: frames on links without packets (serial, TCP), by COBS.
//!
//! The byte table and the rules are in the book, `docs/src/devices/maglev-protocol.md`.
//!
//! Real-time throughout: bounded, no allocation.

mod codec;
pub mod description;
pub mod frame;
pub mod intake;
pub mod rejection;
pub mod stream;

#[cfg(test)]
mod tests;

pub use codec::{FRAME_BYTES, VERSION};
pub use description::Description;
pub use frame::{Answer, AnswerFrame, Condition, Mode, Request, RequestFrame, Status};
pub use intake::Intake;
pub use rejection::{Rejection, Rejections};
