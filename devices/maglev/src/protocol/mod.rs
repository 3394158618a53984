//! The wire protocol between host and controller: one frame of 64 bytes, one codec, every transport.
//!
//! - [`frame`]: requests and answers, and their encoding.
//! - [`description`]: description of a controller, on request.
//! - [`intake`]: replay protection; rejected frames are counted by reason.
//! - [`stream`]: frames on links without packets (serial, TCP), by COBS.
//!
//! The byte table and the rules are in the book, `docs/src/devices/maglev-protocol.md`.
//!
//! Real-time throughout: bounded, no allocation.

pub mod description;
pub mod frame;
pub mod intake;
pub mod stream;

#[cfg(test)]
mod tests;

pub use description::Description;
pub use frame::{
    Answer, AnswerFrame, Condition, FRAME_BYTES, Mode, Rejection, Request, RequestFrame, Status,
};
pub use intake::{Intake, Rejections};
