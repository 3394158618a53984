//! Shared parts of device plugins over a vendor's SDK.
//!
//! Such a plugin contains nothing of the vendor: it opens the library that the user has installed. The device is driven
//! not by the loop, but by a thread that follows the SDK (the SDK's own scheduler, or a thread paced by blocking
//! calls):
//!
//! ```text
//!  user's library -> Library -> functions of the plugin -> thread -> Exchange -> LoopEnd -> loop
//! ```
//!
//! - [`Library`]: finds, checks and opens the file, looks up functions; [`LibraryProblem`] names the failed step and remedy.
//! - [`Exchange`]: newest sample one way, newest wrench the other, and removal of the force if either side fails.
//! - [`LoopEnd`]: the loop's side of an exchange, for the contract.
//! - [`parameters`]: parameters that the plugins have in common.
//! - [`without_signals`]: blocks signals of the host in the threads of a library.

mod exchange;
mod latest;
mod library;
mod loop_end;
pub mod parameters;
mod platform;
mod problem;
mod search;

pub use exchange::{Command, CommandCursor, Exchange, Pace, Sample, VALID};
pub use library::{DropInPolicy, Library, static_text};
pub use loop_end::{LoopEnd, StopSwitch};
pub use platform::without_signals;
pub use problem::LibraryProblem;
pub use search::Sdk;
