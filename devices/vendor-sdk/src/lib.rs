//! What device plugins over a vendor's SDK share.
//!
//! Such a plugin brings nothing of the vendor: it opens the library that the user has installed. Devices are then driven by a
//! thread that follows the SDK (its own scheduler, or one that its blocking calls pace), and not by the loop:
//!
//! ```text
//!  user's library -> Library -> functions of the plugin -> thread -> Exchange -> LoopEnd -> loop
//! ```
//!
//! - [`Library`]: finds the file, checks processor and kind, opens it, looks up functions; [`LibraryProblem`] says which of
//!   these failed and what to do.
//! - [`Exchange`]: the newest sample one way, the newest wrench the other, and how force goes if either side fails.
//! - [`LoopEnd`]: the loop's side of it, as the contract wants it.
//! - [`without_signals`]: threads of a library must not take signals of the host.

mod exchange;
mod latest;
mod library;
mod loop_end;
mod platform;
mod problem;
mod search;

pub use exchange::{Exchange, Orders, Pace, Sample, VALID};
pub use library::{Library, StandIn};
pub use loop_end::{LoopEnd, StopSwitch};
pub use platform::without_signals;
pub use problem::LibraryProblem;
pub use search::Sdk;
