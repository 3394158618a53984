//! Observation and control of a running host by other programs on the same machine: viewer, bridges, scripts.
//!
//! A running host listens on a Unix socket in a folder that only its user may enter ([`Directory`]); on Windows, on a local port
//! announced with a secret in a file in the user's profile. Every program that may open the socket, or read the file, may observe
//! and change the run. [`Publication`] is the host's end, [`Client`] the end of the other program:
//!
//! ```no_run
//! use flotor_live::{Ask, Client, Directory, Event};
//! use std::time::Duration;
//!
//! let mut client = Client::find(&Directory::of_this_user())?;
//! client.request_client().ask(Ask::Watch { every: 10 })?; // one record in ten, with the events of the skipped ticks
//! while let Some(event) = client.next(Duration::from_secs(1))? {
//!     if let Event::Ticks { records, .. } = event {
//!         println!("{} ticks, up to {:?}", records.len(), records.last().map(|record| record.time_ns));
//!     }
//! }
//! # Ok::<(), flotor_live::LiveError>(())
//! ```
//!
//! # Protocol 2
//!
//! Both directions are a sequence of frames: length of the payload (4 bytes, little endian), kind (1 byte), payload. A client
//! ignores unknown kinds, and unknown keys of JSON objects, so that the protocol can be extended; [`PROTOCOL`] changes for
//! incompatible extensions.
//!
//! | kind | from | payload |
//! |---|---|---|
//! | 1 greeting | host | JSON [`Greeting`]: plugins, with the ranges and present values of their parameters. First, once |
//! | 2 run | host | protobuf `flotor.Run`, as in a recording (`host/proto`). Second, once |
//! | 3 ticks | host | records dropped so far (8 bytes), then records of 45 words of 8 bytes, see below |
//! | 4 change | host | JSON [`ChangeMessage`]: a change to a plugin, before the first tick that uses it |
//! | 5 answer | host | JSON [`Answer`] to a request |
//! | 6 end | host | JSON [`End`]: outcome of the run. Last |
//! | 16 request | client | JSON [`Request`] |
//!
//! A record has the words of [`flotor_core::trace::TickRecord`], as in the digest of a run, which excludes the last two: tick (low
//! 46 bits), absence flags of torque and energy (1 bit each) and device (high 16 bits); time (ns), time since the last tick (ns) as
//! integers; position (3), quaternion xyzw (4), velocity (3), angular velocity (3), model's force and torque (6), commanded (6),
//! delivered (6), stored energy, energy of the port as IEEE doubles; events (low half) and buttons (high half); grip: opening, velocity, efforts delivered, of the models and commanded as doubles, kind (0 none, 1 linear, 2 angular); lateness
//! and
//! compute time (ns). SI units, device frame, little endian.
//!
//! **No client can delay the loop.** A host sends only the first two frames until a client requests more, and does nothing per tick
//! without a client. Each client has a queue of fixed length between loop and socket; ticks that find the queue full are dropped
//! and counted. Requests are answered at most a thousand times a second for each client.
//!
//! # The latch
//!
//! An emergency stop of any run stops every run of the folder, and prevents new runs until the stop is released. Two
//! means transport the stop: the [`Latch`], a file beside the sockets, and a request to each socket, which the run
//! confirms.
//!
//! # Couplings
//!
//! A run with a coupling whose other end is on another host has a second socket, for datagrams: [`PeerSocket`] sends
//! and receives the messages between the ends ([`flotor_core::peer`]).
//!
//! Not real-time.

mod client;
mod directory;
mod frame;
mod latch;
mod message;
mod pairing;
mod peer_socket;
mod platform;
mod server;
mod stop;

pub use client::{Client, Event, LiveError, RequestClient};
pub use directory::{Directory, DirectoryError, FoundRun, Listener, process_number, set_process_number};
pub use flotor_core::{Change as ChangeMessage, ChangeOutcome as Outcome, ChangeSubject as Subject};
pub use frame::{Frames, Kind, LongFrame, MAX_PAYLOAD, frame, ticks_from_payload, ticks_to_payload};
pub use latch::{Latch, LatchState, Pressed};
pub use message::{
    Answer, Ask, End, EndKind, Greeting, PanelParameter, PanelPlugin, ParameterShape, RefusalCause, Request,
    SetValue, SoftLimits, WrenchLimits,
};
pub use pairing::{LinkCounts, Pairing};
pub use peer_socket::{CALL_PERIOD, FoundCoupling, PeerSocket};
pub use server::{Publication, PublishError, Serve};

/// Version of the protocol, the same in host and client.
pub const PROTOCOL: u32 = 2;
