//! Second path of an emergency stop: datagrams to the UDP port with the number of the bridge's TCP or TLS port.
//!
//! A new connection waits for the handshakes of earlier connections, and anybody can begin a handshake. A datagram waits for no
//! handshake, and a sender without a key gets no reply.
//!
//! ```text
//! member -> Hello                   bridge -> Challenge
//! member -> Press the challenge     bridge presses, asks the hosts, -> Answer
//! ```
//!
//! A datagram is JSON and its HMAC-SHA256 under the stop key of the member. `nonce` binds a reply to its request; a challenge is valid
//! for one press, so that no press can be replayed.

mod client;

pub use client::press_both_ways;

use crate::keys::Name;
use crate::wall_clock::since_1970;
use flotor_hal::read_file;
use ring::hmac;
use ring::rand::{SecureRandom, SystemRandom};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, ErrorKind};
use std::path::Path;

/// Limit on a datagram, bytes; the system truncates a longer one, whose HMAC is then wrong.
pub(crate) const MOST_BYTES: usize = 2048;
/// Limit on the reason for a refusal, characters.
const MOST_REASON: usize = 200;
/// Maximum size of a file of stop keys, bytes: ten thousand members.
const MOST_KEY_BYTES: u64 = 1 << 20;
/// Length of a key and of an HMAC, bytes.
const KEY_BYTES: usize = 32;

/// Addresses and keys of one end of a stop channel.
#[derive(Clone, Debug)]
pub struct StopChannel {
    /// `host:port` of each endpoint.
    pub(crate) addresses: Vec<String>,
    pub(crate) member: Name,
    pub(crate) keys: StopKeys,
    /// End of the validity, s since 1970.
    pub(crate) expires_s: Option<u64>,
}

impl StopChannel {
    pub(crate) fn is_expired(&self) -> bool {
        self.expires_s.is_some_and(|end| end < since_1970().as_secs())
    }
}

/// Stop keys by member.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopKeys(BTreeMap<String, hmac::Key>);

impl StopKeys {
    /// Returns the empty HMAC key of the member `anyone`, for a network without keys.
    pub(crate) fn of_anyone() -> Self {
        Self(BTreeMap::from([(Name::anyone().to_string(), hmac::Key::new(hmac::HMAC_SHA256, &[]))]))
    }

    /// Reads a file with one line per member: name and key in hexadecimal digits.
    ///
    /// # Errors
    /// Errors of [`read_file`]; `InvalidData` for a malformed or empty file.
    pub(crate) fn read(path: &Path) -> io::Result<Self> {
        let malformed = || io::Error::new(ErrorKind::InvalidData, "not a file of stop keys");
        let text = String::from_utf8(read_file(path, MOST_KEY_BYTES)?).map_err(|_| malformed())?;
        let keys = text.lines().map(|line| {
            let (name, digits) = line.split_once(' ')?;
            Some((name.to_owned(), hmac::Key::new(hmac::HMAC_SHA256, &bytes_of(digits)?)))
        });
        let keys: BTreeMap<_, _> = keys.collect::<Option<_>>().ok_or_else(malformed)?;
        if keys.is_empty() { Err(malformed()) } else { Ok(Self(keys)) }
    }
}

fn bytes_of(digits: &str) -> Option<Vec<u8>> {
    let pairs = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).ok());
    let bytes = pairs.map(|pair| u8::from_str_radix(pair?, 16).ok()).collect::<Option<Vec<u8>>>()?;
    (bytes.len() == KEY_BYTES).then_some(bytes)
}

/// Returns a new line of a stop key file: name of the member and random key.
///
/// # Errors
/// If the system provides no random numbers.
pub(crate) fn new_key_line(member: &str) -> io::Result<String> {
    let mut line = format!("{member} ");
    for byte in random::<KEY_BYTES>()? {
        // Writing to a string cannot fail.
        let _ = write!(line, "{byte:02x}");
    }
    line.push('\n');
    Ok(line)
}

fn random<const COUNT: usize>() -> io::Result<[u8; COUNT]> {
    let mut bytes = [0; COUNT];
    SystemRandom::new()
        .fill(&mut bytes)
        .map_err(|_| io::Error::other("the system provides no random numbers"))?;
    Ok(bytes)
}

/// Nonce: unpredictable 128-bit number for a single use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Nonce([u8; 16]);

impl Nonce {
    pub(crate) fn new() -> io::Result<Self> {
        random().map(Self)
    }
}

/// Message of a stop channel, in either direction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StopMessage {
    pub(crate) bridge: String,
    pub(crate) member: String,
    /// Nonce of the member, repeated in the reply.
    pub(crate) nonce: Nonce,
    pub(crate) content: Content,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Content {
    Hello,
    Challenge(Nonce),
    Press(Nonce),
    /// Reason for a refusal; `None` if all runs have confirmed the stop.
    Answer(Option<String>),
}

impl StopMessage {
    /// Encodes the datagram, JSON and its HMAC; `None` without a key of the member.
    pub(crate) fn sealed(&self, keys: &StopKeys) -> Option<Vec<u8>> {
        let key = keys.0.get(&self.member)?;
        let mut bytes = serde_json::to_vec(self).ok()?;
        let tag = hmac::sign(key, &bytes);
        bytes.extend_from_slice(tag.as_ref());
        Some(bytes)
    }

    /// Decodes a datagram; `None` if it is malformed, or its HMAC does not match the member's key.
    pub(crate) fn open(datagram: &[u8], keys: &StopKeys) -> Option<Self> {
        let (bytes, tag) = datagram.split_at_checked(datagram.len().checked_sub(KEY_BYTES)?)?;
        let message: Self = serde_json::from_slice(bytes).ok()?;
        hmac::verify(keys.0.get(&message.member)?, bytes, tag).ok()?;
        Some(message)
    }

    /// Returns the reply to this message.
    pub(crate) fn answer(&self, refused: Option<String>) -> Self {
        let reason = refused.map(|reason| reason.chars().take(MOST_REASON).collect());
        Self { content: Content::Answer(reason), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(text: &str) -> StopKeys {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.stop");
        std::fs::write(&file, text).unwrap();
        StopKeys::read(&file).unwrap()
    }

    fn message(member: &str, content: Content) -> StopMessage {
        let nonce = Nonce::new().unwrap();
        StopMessage { bridge: "lab".to_owned(), member: member.to_owned(), nonce, content }
    }

    #[test]
    fn only_a_member_is_read_and_only_under_its_own_name() {
        let lines = ["ada", "alan"].map(|name| new_key_line(name).unwrap());
        let (bridge, ada) = (keys(&lines.concat()), keys(&lines[0]));
        let hello = message("ada", Content::Hello);
        let datagram = hello.sealed(&ada).unwrap();
        assert_eq!(StopMessage::open(&datagram, &bridge), Some(hello));
        for at in 0..datagram.len() {
            let mut changed = datagram.clone();
            changed[at] ^= 1;
            assert_eq!(StopMessage::open(&changed, &bridge), None, "{at}");
            assert_eq!(StopMessage::open(&datagram[..at], &bridge), None, "{at}");
        }
        assert_eq!(message("alan", Content::Hello).sealed(&ada), None);
        // Another one's key under the name.
        let forged = message("alan", Content::Hello).sealed(&keys(&lines[0].replace("ada", "alan"))).unwrap();
        assert_eq!(StopMessage::open(&forged, &bridge), None);
        assert_eq!(
            StopMessage::open(
                &message("anyone", Content::Hello).sealed(&StopKeys::of_anyone()).unwrap(),
                &bridge
            ),
            None
        );
    }

    #[test]
    fn the_longest_answer_fits_a_datagram() {
        let hello = message(&"m".repeat(40), Content::Hello);
        let hello = StopMessage { bridge: "b".repeat(40), nonce: Nonce([255; 16]), ..hello };
        let key = new_key_line(&hello.member).unwrap();
        // Six bytes in JSON for each.
        let answer = hello.answer(Some("\u{7}".repeat(1000))).sealed(&keys(&key)).unwrap();
        assert!(answer.len() <= MOST_BYTES, "{}", answer.len());
    }

    #[test]
    fn what_is_no_file_of_stop_keys_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.stop");
        for text in [
            "",
            "ada\n",
            "ada 00\n",
            &format!("ada {}\n", "x".repeat(64)),
            &format!("ada {}é\n", "0".repeat(62)),
        ] {
            std::fs::write(&file, text).unwrap();
            assert_eq!(StopKeys::read(&file).unwrap_err().kind(), ErrorKind::InvalidData, "{text}");
        }
        // A pipe or a device file, which may have no end, is not read.
        assert_eq!(StopKeys::read("/dev/zero".as_ref()).unwrap_err().kind(), ErrorKind::InvalidInput);
    }
}
