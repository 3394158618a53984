//! Reads MCAP files: the messages of chosen channels, in the order of the file.
//!
//! A crate of its own because host and simulated device read recordings by the same rules: a chunk counts only whole and
//! with the right checksum, the data section has to match its own checksum, and a file without its end is reported as
//! [`Ending::CutOff`].
//!
//! Not real-time.

mod reader;

pub use reader::{ChannelInfo, Damage, Ending, Message, MessageReader, OpenError};
