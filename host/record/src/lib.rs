//! Recordings: all results of a run in one file, in a format that common tools open.
//!
//! A separate crate because two programs need it: the host writes recordings, the viewer reads them.
//!
//! A recording is an [MCAP](https://mcap.dev/spec) file of protobuf messages. It contains its own schemas, so Foxglove
//! and Rerun draw it and Python's `mcap-protobuf-support` decodes it, without any part of this program:
//!
//! | topic | message | when |
//! |---|---|---|
//! | `/flotor/run` | `flotor.Run` | once, first: all data needed to repeat the run |
//! | `/tf` | `foxglove.FrameTransform` | each tick and device: pose of `handle` in `device`, with several devices `NAME/handle` in `NAME` |
//! | `/flotor/tick` | `flotor.Tick` | every tick and device: twist, wrenches, energy, events, timing |
//! | `/flotor/change` | `flotor.Change` | at a change of a parameter, weight or plugin, applied or rejected: before its tick |
//! | `/flotor/log` | `foxglove.Log` | on text events, such as faults |
//!
//! [`RunDescription`] is written first (and once more as the metadata record `flotor.run`, for tools that list
//! metadata), then [`Recorder::record`] appends ticks; [`Recording`] reads them back, bit for bit. [`TraceDigest`]
//! is a digest of a run: equal digests, equal runs.
//!
//! **Time** is time since the loop started, in nanoseconds, also as MCAP's `log_time` and `publish_time`: a recording
//! begins at 0 (viewers show 1 January 1970), so that equal runs have equal times.
//!
//! **A killed process** loses at most 250 ms: messages are written in chunks, and a chunk is written as a whole. A
//! truncated file is read up to its last complete chunk, and marked ([`Ending::CutOff`]).
//!
//! **Schemas** are written in `host/proto`; `schema` mirrors them in Rust and includes them in compiled form, so that no
//! build needs a protobuf compiler. After a change of `host/proto`, one command compiles them again:
//!
//! ```text
//! FLOTOR_WRITE_SCHEMA=1 cargo test -p flotor-tests --features formats recording_schema::
//! ```
//!
//! Not real-time: records reach the recorder through the queue of the trace.

mod chunked;
mod coupling;
mod digest;
mod file;
mod files;
mod messages;
mod reader;
mod repair;
mod run;
mod schema;
mod writer;

#[cfg(test)]
mod tests;

pub use digest::{Coverage, TraceDigest};
pub use file::FileError;
pub use files::NamedFile;
pub use flotor_mcap::Ending;
pub use messages::{InvalidMessage, TickMessages, change_from_bytes, change_to_bytes, tick_from_messages};
pub use reader::{Damage, ReadError, Recording};
pub use repair::{RepairError, Repaired, repair};
pub use run::{InvalidRun, PluginDescription, Role, RunDescription};
pub use writer::{RecordError, Recorder};

/// Severity of a [`Note`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Information.
    Info,
    /// The run continues, but not as requested.
    Warning,
    /// A part of the run failed.
    Error,
}

/// Text event of a run, such as a fault or a disabled model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Time since the loop started, ns.
    pub time_ns: u64,
    /// Severity of the event.
    pub severity: Severity,
    /// Source of the event: "device" or the name of a model.
    pub source: String,
    /// Human-readable description of the event.
    pub text: String,
}
