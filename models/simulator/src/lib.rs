//! Contacts computed by a program of one's own: any simulator, asynchronously.
//!
//! `flotor run` starts the program with a socket as its standard input, and sends it the pose of the handle; the program answers with
//! sets of contacts, when and as often as it likes (`include/flotor_simulator.h`). A set ages from the moment of its pose. Once it is older
//! than it is valid, its force fades within 20 ms, whatever the program does meanwhile.
//!
//! - [`messages`]: poses and sets as bytes. [`link`](mod@link): the program, its socket and its end.
//! - [`answers`]: the newest set with its age, and the checks of a set.
//! - [`program`]: the other side, for programs in Rust.
//! - `plugin`: the contract. `platform`: sockets of the system.

pub mod answers;
pub mod link;
pub mod messages;
mod platform;
mod plugin;
pub mod program;

pub use plugin::{FLOTOR_ENTRY, Simulator};
