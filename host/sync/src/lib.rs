//! Wait-free transfer of the newest value from one thread to others.
//!
//! The servo runs a thousand times a second or more and must not be delayed: not by a mutex that another thread holds,
//! not by the allocator, not by the kernel. [`latest`] creates a latest-value cell: a slow reader misses values, but
//! never the newest. Where every record counts (ticks for the recorder, commands for the servo) the host uses a bounded
//! queue of the crate `rtrb`.
//!
//! A *record* is any plain value that can be written as a fixed number of 64-bit words: see [`Words`].
//!
//! ```
//! use flotor_sync::{Words, latest};
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
//! let (mut state, viewer) = latest(Sample { tick: 0, force_n: 0.0 });
//! let servo = std::thread::spawn(move || {
//!     for tick in 1..=100 {
//!         state.publish(&Sample { tick, force_n: 0.5 });
//!     }
//! });
//! servo.join().expect("the servo ends in order");
//! assert_eq!(viewer.read(), Some((100, Sample { tick: 100, force_n: 0.5 })));
//! ```
//!
//! # Memory ordering
//!
//! One atomic word is never torn, but neither the compiler nor the processor promises that another core sees
//! *several* words change in the order in which they were written. Two tools restore just as much order as
//! is needed:
//!
//! - A **release** store publishes: a thread that sees the stored value with an **acquire** load also sees
//!   everything the writer wrote before it, and comes after everything the writer read before it.
//! - A release or acquire **fence** does the same for all relaxed accesses on its far side, not for one word.
//!
//! All other accesses are *relaxed*: atomic, and free. Each place where order matters has a comment with the
//! error that would occur without it. On x86-64 all of these are ordinary moves; on aarch64 they cost an acquire
//! load, a release store or a barrier. Nothing is sequentially consistent: no decision here rests on the
//! order of two words that different threads write.
//!
//! A test checks these comments: `tests/loom.rs` runs the cell under [loom],
//! which tries every interleaving, and every stale value a core may still see in each. Each ordering was
//! weakened in turn, and loom failed each time. Run it with
//!
//! ```text
//! RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
//! ```
//!
//! [loom]: https://github.com/tokio-rs/loom
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![forbid(unsafe_code)]

mod latest;
mod shim;
mod words;

pub use latest::{Observer, Publisher, latest};
pub use words::Words;
