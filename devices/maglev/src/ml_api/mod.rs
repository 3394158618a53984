//! The ML API 1.5b: protocol of the controller of the Maglev 200, on TCP port 5678. One codec for both ends.
//!
//! ```text
//! request   length i32, function i32, arguments        client to controller, control connection
//! reply     length i32, status   i32, results          controller to client
//! event     length i32, event    i32, payload          controller to client, callback connection
//! ack       8      i32, value    i32                   client to controller, callback connection
//! ```
//!
//! Little endian, every number 4 bytes, no checksum and no sequence number: one call is outstanding on a connection at a time.
//! Metres, radians, seconds, newtons, amperes, degrees Celsius; axes x, y, z and the rotations about them, the device frame.
//!
//! - [`frame`]: encoding and decoding of one frame, of its fields in `field.rs`; [`intake`]: frames from a stream.
//! - [`values`]: types of the fields; [`angles`]: three angles as an orientation.
//! - [`request`], [`reply`], [`event`]: the messages and their encoding.
//!
//! Real-time throughout: bounded, no allocation.

pub mod angles;
pub mod event;
mod field;
pub mod frame;
pub mod function;
pub mod intake;
pub mod reply;
pub mod request;
pub mod values;

pub use event::{Acknowledgement, Event, EventKind};
pub use frame::Frame;
pub use function::Function;
pub use intake::{Intake, ReadResult};
pub use reply::{Reply, Results};
pub use request::{InvalidRequest, Request};
pub use values::{
    Axis, AxisMode, AxisValues, Buttons, Cell, CellOffset, FaultBits, Gain, GainSet, Pid, Status, Version,
    WirePose,
};

/// TCP port of a controller with the ML API.
pub const PORT: u16 = 5678;
