//! Recordings: everything a run leaves behind, in one file that other people's tools open.
//!
//! A crate of its own because two programs need it: the host writes it, the viewer reads it.
//!
//! A recording is an [MCAP](https://mcap.dev/spec) file of protobuf messages. It carries its own schemas, so
//! Foxglove and Rerun draw it, Python's `mcap-protobuf-support` decodes it, and none of them needs this program:
//!
//! | topic | message | when |
//! |---|---|---|
//! | `/flotor/run` | `flotor.Run` | once, first: all that is needed to repeat the run |
//! | `/tf` | `foxglove.FrameTransform` | every tick and device: pose of frame `handle` in frame `device`; with several devices of `NAME/handle` in `NAME` |
//! | `/flotor/tick` | `flotor.Tick` | every tick and device: twist, wrenches, energy, events, timing |
//! | `/flotor/change` | `flotor.Change` | when a parameter changed: before the tick that saw it first |
//! | `/flotor/log` | `foxglove.Log` | when something happened that needs words: faults |
//!
//! [`RunDescription`] goes in first (and once more as the metadata record `flotor.run`, for tools that list
//! those), then [`Recorder::record`] appends ticks; [`Recording`] gives them back, bit for bit. [`TraceDigest`]
//! is a run in one line: equal digests, equal runs.
//!
//! **Time** is time since the loop started, in nanoseconds, also as MCAP's `log_time` and `publish_time`: a
//! recording begins at 0 (viewers show 1 January 1970), so that equal runs leave equal times.
//!
//! **A killed process** loses at most 250 ms: messages go out in chunks, and a chunk reaches the file whole. A
//! file without its end is read up to its last whole chunk and says so ([`Ending::CutOff`]).
//!
//! **Schemas** are written in `host/proto`; `schema` mirrors them in Rust and carries them compiled, so that no
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
pub use messages::{NoMessage, TickMessages, change_from_bytes, change_to_bytes, tick_from_messages};
pub use reader::{Damage, ReadError, Recording};
pub use repair::{RepairError, Repaired, repair};
pub use run::{NoRun, PluginDescription, Role, RunDescription};
pub use writer::{RecordError, Recorder};

/// How bad it is, what a [`Note`] tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Good to know.
    Info,
    /// The run goes on, not as asked for.
    Warning,
    /// Something failed.
    Error,
}

/// Something that happened in a run, in words: a fault, a model that was switched off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Time since the loop started, ns.
    pub time_ns: u64,
    /// How bad it is.
    pub severity: Severity,
    /// What it happened to: "device" or the name of a model.
    pub source: String,
    /// What happened, for people.
    pub text: String,
}
