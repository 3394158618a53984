//! Reader of MCAP files: messages of chosen channels, in the order of the file.
//!
//! A separate crate because host and simulated device read recordings by the same rules: a chunk counts only if it is complete
//! and has the right checksum, the data section must match its own checksum, and a file without its end is reported as
//! [`Ending::CutOff`].
//!
//! Not real-time.

mod reader;

pub use reader::{ChannelInfo, Damage, Ending, Message, MessageReader, OpenError};
