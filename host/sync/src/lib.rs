//! How the servo talks to the rest of the program without ever waiting for it.
//!
//! The servo runs a thousand times a second or more and may not be held up: not by a mutex another thread
//! holds, not by the allocator, not by the kernel. This crate is the whole of what it shares with others.
//!
//! | from -> to | carried by | if the reader is slow |
//! |---|---|---|
//! | servo -> viewer: the state now | [`latest`] | it misses values, never the newest |
//! | servo -> recorder, plot, digest: every tick | [`ring`] | records that find no room are counted |
//! | panels, experiment -> servo: commands | [`inbox`] | the sender is told that there is no room |
//!
//! [`latest`] makes a latest-value cell, [`ring`] a first-in-first-out queue of fixed size, [`inbox`] a ring with
//! any number of senders, which wait for each other but never make the servo wait. The servo drains its commands
//! at tick boundaries, which is bounded by the number of slots; what was sent together arrives together.
//!
//! A *record* is any plain value that can be written as a fixed number of 64-bit words: see [`Words`].
//!
//! ```
//! use flotor_sync::{Words, latest, ring};
//! use std::time::Duration;
//!
//! #[derive(Clone, Copy, Debug, PartialEq)]
//! struct Sample {
//!     tick: u64,
//!     force_n: f64,
//! }
//!
//! impl Words<2> for Sample {
//!     fn to_words(&self) -> [u64; 2] {
//!         [self.tick, self.force_n.to_bits()]
//!     }
//!     fn from_words(&[tick, force_n]: &[u64; 2]) -> Self {
//!         Self { tick, force_n: f64::from_bits(force_n) }
//!     }
//! }
//!
//! let home = Sample { tick: 0, force_n: 0.0 };
//! let (mut state, viewer) = latest(home);
//! let (mut trace, mut recorder) = ring(1024);
//!
//! let servo = std::thread::spawn(move || {
//!     for tick in 1..=100 {
//!         let sample = Sample { tick, force_n: 0.5 };
//!         state.publish(&sample);
//!         let _ = trace.push(&sample); // a full ring counts the loss itself
//!     }
//! });
//!
//! let mut recorded = Vec::new();
//! while !recorder.is_abandoned() {
//!     recorder.drain(|sample| recorded.push(sample));
//!     std::thread::sleep(Duration::from_millis(1)); // polling would take cache lines from the servo
//! }
//! recorder.drain(|sample| recorded.push(sample)); // what came in just before the sender went
//! servo.join().expect("the servo ends in order");
//!
//! assert_eq!(recorded.len(), 100);
//! assert_eq!(recorder.dropped(), 0);
//! assert_eq!(viewer.read(), Some((100, Sample { tick: 100, force_n: 0.5 })));
//! ```
//!
//! # Why it is right
//!
//! One atomic word is never torn, but neither the compiler nor the processor promises that another core sees
//! *several* words change in the order in which they were written. Two tools restore just as much order as
//! is needed:
//!
//! - A **release** store is a signature: whoever sees the signed value with an **acquire** load also sees
//!   everything the signer wrote before it, and comes after everything the signer read before it.
//! - A release or acquire **fence** does the same for all relaxed accesses on its far side, not for one word.
//!
//! Everything else is *relaxed*: atomic, and free. Each place where order matters says in a comment what
//! would go wrong without it. On x86-64 all of these are ordinary moves; on aarch64 they cost an acquire
//! load, a release store or a barrier. Nothing is sequentially consistent: no decision here rests on the
//! order of two words that different threads write.
//!
//! That the comments are true is not left to reading: `tests/loom.rs` runs them all under [loom],
//! which tries every interleaving, and every stale value a core may still see in each. Each ordering was
//! weakened in turn, and loom objected each time. Run it with
//!
//! ```text
//! RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
//! ```
//!
//! [loom]: https://github.com/tokio-rs/loom
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![forbid(unsafe_code)]

mod inbox;
mod latest;
mod ring;
mod shim;
mod words;

pub use inbox::{InboxSender, inbox};
pub use latest::{Observer, Publisher, latest};
pub use ring::{Full, Receiver, Sender, ring};
pub use words::Words;
