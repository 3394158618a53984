//! Zenoh keys and the messages on each.
//!
//! | key | content | transport |
//! |---|---|---|
//! | `flotor/NAME/alive` | presence of a bridge | liveliness token |
//! | `flotor/NAME/status` | JSON [`crate::status::Status`] | published on change, and on query |
//! | `flotor/NAME/greeting` | JSON [`flotor_live::Greeting`]: plugins, parameters, limits | on query |
//! | `flotor/NAME/run` | protobuf `flotor.Run` | on query, for late joiners |
//! | `flotor/NAME/tf` | protobuf `foxglove.FrameTransform` | published once per tick |
//! | `flotor/NAME/tick` | protobuf `flotor.Tick` | published once per tick, after its pose |
//! | `flotor/NAME/change` | protobuf `flotor.Change` | published |
//! | `flotor/NAME/end` | JSON [`flotor_live::End`] | published |
//! | `flotor/NAME/news/COUPLING` | [`flotor_core::peer::Dispatch`] of this end of a coupling | published, best effort |
//! | `flotor/NAME/couple/COUPLING` | [`flotor_core::peer::Dispatch`] of the other end | put by the peer, best effort |
//! | `flotor/NAME/ask/REQUEST/MEMBER` | JSON [`crate::request::NumberedRequest`] | request with a reply |
//!
//! The protobuf messages are those of a recording. Each kind of request has a key of its own, so that Zenoh's access control
//! decides by key which member may send it: see [`crate::request::Request::key`].

use std::fmt;

/// First part of all keys of this program.
pub const ROOT: &str = "flotor";

/// Name of a bridge or a member: one part of a key.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[must_use]
pub struct Name(String);

/// Error of a text that is not a valid name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid name `{0}`: use 1 to 40 letters a to z, digits or hyphens")]
pub struct NoName(String);

impl Name {
    /// Creates a name from 1 to 40 lower-case ASCII letters, digits and hyphens.
    ///
    /// # Errors
    /// [`NoName`] for any other text.
    pub fn new(text: &str) -> Result<Self, NoName> {
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        match text.len() {
            1..=40 if text.chars().all(legal) => Ok(Self(text.to_owned())),
            _ => Err(NoName(text.to_owned())),
        }
    }

    /// Returns the member name of all peers of a bridge without keys.
    pub fn anyone() -> Self {
        Self(crate::request::ANYONE.to_owned())
    }

    /// Returns the host name of this machine in lower case, other characters replaced by hyphens, truncated to 40; `host` if there
    /// is none.
    pub fn of_this_machine() -> Self {
        let system = rustix::system::uname();
        let host = system.nodename().to_string_lossy().to_lowercase();
        let text: String =
            host.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(40).collect();
        Self::new(&text).unwrap_or_else(|_| Self("host".to_owned()))
    }

    /// Returns this bridge's key for `what`: `flotor/NAME/what`.
    #[must_use]
    pub fn key(&self, what: &str) -> String {
        format!("{ROOT}/{self}/{what}")
    }

    /// Returns the name of the bridge in a key; `None` if the key does not begin with `flotor/NAME`.
    #[must_use]
    pub fn of_key(key: &str) -> Option<Self> {
        let name = key.strip_prefix(ROOT)?.strip_prefix('/')?.split('/').next()?;
        Self::new(name).ok()
    }
}

impl fmt::Display for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(&self.0)
    }
}

impl std::str::FromStr for Name {
    type Err = NoName;

    /// Parses `NAME`, or `zenoh/NAME` as the other commands write it.
    fn from_str(text: &str) -> Result<Self, NoName> {
        Self::new(text.strip_prefix("zenoh/").unwrap_or(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_part_of_a_key() {
        let name: Name = "zenoh/lab-2".parse().unwrap();
        assert_eq!(name.key("tick"), "flotor/lab-2/tick");
        assert_eq!(Name::of_key("flotor/lab-2/ask/set"), Some(name));
        for wrong in ["", "a/b", "*", "Lab", "$", "a b", &"x".repeat(41)] {
            assert_eq!(Name::new(wrong), Err(NoName(wrong.to_owned())));
        }
        assert_eq!(Name::of_key("other/lab-2/tick"), None);
    }
}
