//! Messages between the two ends of a coupling, and their encoding for a network.

use crate::words::{Decoder, Encoder, MOTION_WORDS};
use flotor_hal::{Pose, Twist};
use flotor_sync::Words;

/// State that one end sends to the other in every tick, in the shared frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeerState {
    /// Pose of the handle, m and unit quaternion.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s.
    pub twist: Twist,
    /// Running total of energy that this end has passed on to the other end, J.
    pub passed_on_j: f64,
}

/// State of the energy tank of an end, in the shared frame, for reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TankState {
    /// Energy available, J; below zero if more energy has come out than had gone in.
    pub level_j: f64,
    /// Lowest level so far, J. With the controller on, the level is below zero only by the energy that came out while a
    /// force acted for longer than a period (late or missed ticks), or on a handle faster than expected.
    pub lowest_j: f64,
    /// Energy that the hand has put in so far, less the energy that has come out, J.
    pub gone_in_j: f64,
    /// Energy discarded from the tank so far, J.
    pub discarded_j: f64,
}

/// Peer state with the data for its transport to another host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dispatch {
    /// Sending run, identified by its start, ns since 1970. Each run counts its energy from zero.
    pub run: u64,
    /// Run of the sender's partner; 0: none. The message, with its energy, is for this run alone.
    pub partner: u64,
    /// First tick of the sender with this partner: energy passed on before belongs to another run.
    pub since: u64,
    /// Tick of the sender; of two dispatches of a run, the dispatch with the higher tick is newer.
    pub tick: u64,
    /// Pose and velocity of the sender's handle, and energy passed on, shared frame.
    pub state: PeerState,
    /// The energy tank of the sending end.
    pub tank: TankState,
}

/// Number of 64-bit words of a [`Dispatch`].
pub const DISPATCH_WORDS: usize = 4 + MOTION_WORDS + 5;
/// Length of an encoded [`Dispatch`], bytes: a mark with the version, then [`DISPATCH_WORDS`] words, all little-endian.
pub const DISPATCH_BYTES: usize = 8 * (1 + DISPATCH_WORDS);
/// First word of an encoded dispatch; the digit is the version.
const MARK: u64 = u64::from_le_bytes(*b"flotnew2");
/// Tolerance for the length of a unit quaternion: far above the error of arithmetic.
const UNIT_TOLERANCE: f64 = 1.0e-6;

/// Reason why bytes are not a valid dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidDispatch {
    /// Wrong length, bytes.
    #[error("the peer message has {0} bytes instead of {DISPATCH_BYTES}; run the same release on both hosts")]
    Length(usize),
    /// Wrong mark, or another version.
    #[error("the version of the peer message is not supported; run the same release on both hosts")]
    Mark,
    /// A number is not finite, the orientation has no unit length, or the energy passed on is negative.
    #[error(
        "invalid peer state: a number is not finite, the orientation has no unit length, or the energy is negative; \
         run the same release on both hosts"
    )]
    Numbers,
}

impl Dispatch {
    /// Encodes the dispatch. Not real-time.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; DISPATCH_BYTES] {
        let mut bytes = [0; DISPATCH_BYTES];
        let words = std::iter::once(MARK).chain(self.to_words());
        for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    /// Decodes and checks a dispatch. Not real-time.
    ///
    /// # Errors
    /// If the length, the mark or a number is invalid.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, InvalidDispatch> {
        if bytes.len() != DISPATCH_BYTES {
            return Err(InvalidDispatch::Length(bytes.len()));
        }
        let mut words =
            bytes.chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().unwrap_or_default()));
        if words.next() != Some(MARK) {
            return Err(InvalidDispatch::Mark);
        }
        let words: [u64; DISPATCH_WORDS] = std::array::from_fn(|_| words.next().unwrap_or_default());
        let dispatch = Self::from_words(&words);
        if dispatch.is_possible() { Ok(dispatch) } else { Err(InvalidDispatch::Numbers) }
    }

    fn is_possible(&self) -> bool {
        let Self { state: PeerState { pose, twist, passed_on_j }, tank, .. } = self;
        let TankState { level_j, lowest_j, gone_in_j, discarded_j } = tank;
        let length = pose.orientation().length();
        pose.is_finite()
            && (length - 1.0).abs() < UNIT_TOLERANCE
            && twist.is_finite()
            && [passed_on_j, level_j, lowest_j, gone_in_j, discarded_j]
                .iter()
                .all(|number| number.is_finite())
            && *passed_on_j >= 0.0
    }
}

impl Words<DISPATCH_WORDS> for Dispatch {
    #[inline]
    fn to_words(&self) -> [u64; DISPATCH_WORDS] {
        let Self { run, partner, since, tick, state: PeerState { pose, twist, passed_on_j }, tank } = self;
        let TankState { level_j, lowest_j, gone_in_j, discarded_j } = *tank;
        Encoder::of_zeros()
            .words([*run, *partner, *since, *tick])
            .motion(pose, twist)
            .numbers([*passed_on_j, level_j, lowest_j, gone_in_j, discarded_j])
            .finish()
    }

    #[inline]
    fn from_words(words: &[u64; DISPATCH_WORDS]) -> Self {
        let mut words = Decoder::of(words);
        let (run, partner, since, tick) = (words.word(), words.word(), words.word(), words.word());
        let (pose, twist) = words.motion();
        let [passed_on_j, level_j, lowest_j, gone_in_j, discarded_j] = words.numbers();
        let tank = TankState { level_j, lowest_j, gone_in_j, discarded_j };
        Self { run, partner, since, tick, state: PeerState { pose, twist, passed_on_j }, tank }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dispatch() -> Dispatch {
        let pose = Pose { position_m: [1.0e-3, -2.0e-3, 3.0e-3], orientation_xyzw: [0.6, 0.0, 0.0, 0.8] };
        let twist = Twist { linear_m_per_s: [0.1, 0.2, 0.3], angular_rad_per_s: [1.0, 2.0, 3.0] };
        let tank = TankState { level_j: 4.0e-3, lowest_j: -1.0e-3, gone_in_j: -0.5, discarded_j: 0.25 };
        Dispatch {
            run: 7,
            partner: 5,
            since: 3,
            tick: 9,
            state: PeerState { pose, twist, passed_on_j: 0.125 },
            tank,
        }
    }

    #[test]
    fn what_is_sent_is_what_arrives() {
        assert_eq!(Dispatch::from_bytes(&dispatch().to_bytes()), Ok(dispatch()));
        // Every word has its place: none is read as another.
        let words: [u64; DISPATCH_WORDS] = std::array::from_fn(|i| 0x3ff0_0000_0000_0000 + i as u64);
        assert_eq!(Dispatch::from_words(&words).to_words(), words);
    }

    #[test]
    fn what_is_none_is_not_taken_for_one() {
        let bytes = dispatch().to_bytes();
        for length in [0, 1, DISPATCH_BYTES - 1] {
            assert_eq!(Dispatch::from_bytes(&bytes[..length]), Err(InvalidDispatch::Length(length)));
        }
        let long = [bytes.as_slice(), &[0]].concat();
        assert_eq!(Dispatch::from_bytes(&long), Err(InvalidDispatch::Length(DISPATCH_BYTES + 1)));
        let mut other = bytes;
        other[7] += 1;
        assert_eq!(Dispatch::from_bytes(&other), Err(InvalidDispatch::Mark));
        for word in 4..DISPATCH_WORDS {
            for number in [f64::NAN, f64::INFINITY] {
                let mut wrong = bytes;
                wrong[8 * (1 + word)..8 * (2 + word)].copy_from_slice(&number.to_le_bytes());
                assert_eq!(
                    Dispatch::from_bytes(&wrong),
                    Err(InvalidDispatch::Numbers),
                    "{number} in word {word}"
                );
            }
        }
        let longer = Pose { orientation_xyzw: [0.6, 0.0, 0.0, 0.9], ..dispatch().state.pose };
        let owing = PeerState { passed_on_j: -1.0e-9, ..dispatch().state };
        for state in [PeerState { pose: longer, ..dispatch().state }, owing] {
            let wrong = Dispatch { state, ..dispatch() };
            assert_eq!(Dispatch::from_bytes(&wrong.to_bytes()), Err(InvalidDispatch::Numbers));
        }
    }
}
