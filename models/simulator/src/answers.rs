//! Newest set of a simulator, with its age.

use crate::messages::{PoseMessage, SetMessage};
use flotor_hal::{Contact, ContactSet, DVec3, Input, MAX_CONTACTS};
use std::collections::VecDeque;
use std::fmt;

/// Number of poses whose answers count; the answer to an older one comes too late.
const POSES: usize = 1024;
/// Longest validity of a set, s.
pub const LONGEST_VALID_S: f64 = 1.0;

/// Set that contradicts the order of poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutOfOrder {
    /// For an earlier pose than the set before.
    Backwards {
        /// Number of the set.
        number: u64,
        /// Number of the set before.
        before: u64,
    },
    /// For a pose that was not sent.
    NotSent {
        /// Number of the set.
        number: u64,
        /// Number of the newest pose.
        newest: u64,
    },
}

impl fmt::Display for OutOfOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Backwards { number, before } => write!(
                f,
                "a set for pose {number} after one for pose {before}: answer poses in their order, and skip those that are too old"
            ),
            Self::NotSent { number, newest } => write!(
                f,
                "a set for pose {number}, which was not sent (the newest is {newest}): give the set the number of its pose"
            ),
        }
    }
}

impl std::error::Error for OutOfOrder {}

/// Poses sent, and the newest set.
#[derive(Debug, Default)]
pub struct Answers {
    poses: VecDeque<PoseMessage>,
    newest: Option<(PoseMessage, SetMessage)>,
}

impl Answers {
    /// Notes a pose that is sent.
    pub fn sent(&mut self, pose: PoseMessage) {
        if self.poses.len() == POSES {
            self.poses.pop_front();
        }
        self.poses.push_back(pose);
    }

    /// Returns true if the newest set is for this pose.
    #[must_use]
    pub fn has(&self, number: u64) -> bool {
        self.newest.as_ref().is_some_and(|(pose, _)| pose.number == number)
    }

    /// Takes a set; one for a pose that was sent long ago is dropped.
    ///
    /// # Errors
    /// [`OutOfOrder`]; the set before stays.
    pub fn take(&mut self, set: SetMessage) -> Result<(), OutOfOrder> {
        let (number, newest) = (set.number, self.poses.back().map_or(0, |pose| pose.number));
        if number == 0 || number > newest {
            return Err(OutOfOrder::NotSent { number, newest });
        }
        if let Some((before, _)) = &self.newest
            && number < before.number
        {
            return Err(OutOfOrder::Backwards { number, before: before.number });
        }
        let found = self.poses.binary_search_by_key(&number, |pose| pose.number);
        if let Some(pose) = found.ok().and_then(|index| self.poses.get(index)) {
            self.newest = Some((*pose, set));
        }
        Ok(())
    }

    /// Returns the newest set as it is at an input: surfaces have moved on with their velocity, and as much of the validity is left as
    /// its age leaves; without contacts before the first set and after the validity. A set without a validity of its own is valid
    /// for `valid_s`.
    #[must_use]
    pub fn at(&self, input: &Input, valid_s: f64) -> ContactSet {
        let Some((pose, set)) = &self.newest else { return ContactSet::at(input) };
        let age_s = input.time_ns.saturating_sub(pose.time_ns) as f64 * 1.0e-9;
        let whole_s = if set.valid_s == 0.0 { valid_s } else { set.valid_s };
        // A validity that is not a number is for the host to refuse.
        let left_s = if whole_s > LONGEST_VALID_S { LONGEST_VALID_S } else { whole_s } - age_s;
        if left_s <= 0.0 && whole_s > 0.0 {
            return ContactSet::at(input);
        }
        let mut aged = ContactSet {
            anchor: pose.pose,
            valid_m: set.valid_m,
            valid_rad: set.valid_rad,
            valid_s: left_s,
            ..ContactSet::at(input)
        };
        for (place, contact) in aged.contacts.iter_mut().zip(&set.contacts) {
            *place = moved(contact, age_s);
        }
        #[allow(clippy::cast_possible_truncation)] // at most 16
        (aged.count = set.contacts.len().min(MAX_CONTACTS) as u32);
        aged
    }

    /// Forgets all poses and sets.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Returns a contact whose surface has moved for a time.
fn moved(contact: &Contact, time_s: f64) -> Contact {
    let way_m = DVec3::from_array(contact.surface_velocity_m_per_s) * time_s;
    let normal = DVec3::from_array(contact.normal);
    let point_m = DVec3::from_array(contact.surface_point_m) + way_m;
    Contact { surface_point_m: point_m.to_array(), gap_m: contact.gap_m - normal.dot(way_m), ..*contact }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::Pose;

    fn input(time_ms: u64) -> Input {
        Input { time_ns: time_ms * 1_000_000, ..Input::at_rest(Pose::HOME) }
    }

    fn answers() -> (Answers, PoseMessage) {
        let (mut answers, pose) = (Answers::default(), PoseMessage::of(&input(10), 1, 1));
        answers.sent(pose);
        (answers, pose)
    }

    #[test]
    fn a_set_moves_with_its_surface_and_ends_with_its_validity() {
        let (mut answers, pose) = answers();
        assert_eq!(answers.at(&input(10), 0.05).contacts(), &[]);
        let contact = Contact::of_handle(&input(10), DVec3::Z, 0.001, 500.0).moving([0.0, 0.0, 0.1]);
        answers
            .take(SetMessage { contacts: vec![contact], ..SetMessage::at(&pose) })
            .expect("it is for a pose");
        let set = answers.at(&input(30), 0.05);
        assert!((set.contacts()[0].gap_m + 0.001).abs() < 1.0e-15);
        assert!((set.contacts()[0].surface_point_m[2] - 0.001).abs() < 1.0e-15);
        assert!((set.valid_s - 0.03).abs() < 1.0e-12);
        assert_eq!(answers.at(&input(60), 0.05).contacts(), &[]);
        answers.take(SetMessage { valid_s: 1.0e9, ..SetMessage::at(&pose) }).expect("the same pose again");
        assert!(answers.at(&input(10), 0.05).valid_s <= LONGEST_VALID_S);
        answers
            .take(SetMessage { valid_s: f64::NAN, ..SetMessage::at(&pose) })
            .expect("for the host to refuse");
        assert!(answers.at(&input(10), 0.05).valid_s.is_nan());
    }

    #[test]
    fn a_set_that_goes_back_or_is_for_no_pose_is_refused() {
        let (mut answers, first) = answers();
        let second = PoseMessage { number: 2, ..first };
        answers.sent(second);
        let not_sent = |number| Err(OutOfOrder::NotSent { number, newest: 2 });
        assert_eq!(answers.take(SetMessage { number: 3, ..SetMessage::at(&first) }), not_sent(3));
        assert_eq!(answers.take(SetMessage { number: 0, ..SetMessage::at(&first) }), not_sent(0));
        assert_eq!(answers.take(SetMessage::at(&second)), Ok(()));
        let backwards = Err(OutOfOrder::Backwards { number: 1, before: 2 });
        assert_eq!(answers.take(SetMessage::at(&first)), backwards);
        assert!(answers.has(2));
    }
}
