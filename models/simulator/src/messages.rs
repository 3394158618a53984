//! Messages between Flotor and a simulator, as bytes: those of `include/flotor_simulator.h`.

use flotor_hal::{Contact, Input, MAX_CONTACTS, Pose, Twist};

/// Version of the interface.
pub const VERSION: u32 = 1;
/// Size of a pose, bytes.
pub const POSE_BYTES: usize = 136;
/// Size of a set without contacts, bytes.
pub const HEAD_BYTES: usize = 40;
/// Size of a contact, bytes.
pub const CONTACT_BYTES: usize = 136;
/// Size of the largest set, bytes.
pub const MOST_BYTES: usize = HEAD_BYTES + MAX_CONTACTS * CONTACT_BYTES;

/// Pose of the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseMessage {
    /// Number, from 1.
    pub number: u64,
    /// Time since the loop started, ns.
    pub time_ns: u64,
    /// Nominal time between two poses, ns.
    pub period_ns: u64,
    /// Buttons, one bit each.
    pub buttons: u32,
    /// Pose in the frame of the model.
    pub pose: Pose,
    /// Velocity in the frame of the model.
    pub twist: Twist,
}

/// Contacts near a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct SetMessage {
    /// Number of the pose.
    pub number: u64,
    /// Largest displacement for which the planes hold, m.
    pub valid_m: f64,
    /// Largest rotation, rad.
    pub valid_rad: f64,
    /// Longest age, s; 0: that of the host.
    pub valid_s: f64,
    /// Contacts, at most [`MAX_CONTACTS`].
    pub contacts: Vec<Contact>,
}

/// Error of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// The size fits no message.
    Size {
        /// Number of bytes.
        bytes: usize,
    },
    /// The version is another one.
    Version {
        /// Version of the message.
        version: u32,
    },
}

impl std::fmt::Display for Malformed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Size { bytes } => write!(
                f,
                "a message of {bytes} bytes is no set: send {HEAD_BYTES} bytes and {CONTACT_BYTES} for each of `count` contacts, at most \
                 {MAX_CONTACTS}"
            ),
            Self::Version { version } => {
                write!(f, "a message has version {version}: send version {VERSION} (flotor_simulator.h)")
            }
        }
    }
}

impl std::error::Error for Malformed {}

impl PoseMessage {
    /// Builds the message of an input.
    #[must_use]
    pub fn of(input: &Input, number: u64, period_ns: u64) -> Self {
        let Input { pose, twist, time_ns, buttons, .. } = *input;
        Self { number, time_ns, period_ns, buttons, pose, twist }
    }

    /// Returns the bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; POSE_BYTES] {
        let mut bytes = [0; POSE_BYTES];
        let mut writer = Writer { bytes: &mut bytes, at: 0 };
        writer.put(&VERSION.to_ne_bytes());
        writer.put(&self.buttons.to_ne_bytes());
        writer.put(&self.number.to_ne_bytes());
        writer.put(&self.time_ns.to_ne_bytes());
        writer.put(&self.period_ns.to_ne_bytes());
        writer.put_all(&self.pose.position_m);
        writer.put_all(&self.pose.orientation_xyzw);
        writer.put_all(&self.twist.linear_m_per_s);
        writer.put_all(&self.twist.angular_rad_per_s);
        bytes
    }

    /// Reads a message.
    ///
    /// # Errors
    /// [`Malformed`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Malformed> {
        if bytes.len() != POSE_BYTES {
            return Err(Malformed::Size { bytes: bytes.len() });
        }
        let mut reader = Reader { bytes };
        reader.version()?;
        let buttons = reader.u32();
        let [number, time_ns, period_ns] = [reader.u64(), reader.u64(), reader.u64()];
        let pose = Pose { position_m: reader.all(), orientation_xyzw: reader.all() };
        let twist = Twist { linear_m_per_s: reader.all(), angular_rad_per_s: reader.all() };
        Ok(Self { number, time_ns, period_ns, buttons, pose, twist })
    }
}

impl SetMessage {
    /// Builds a set without contacts for a pose, valid everywhere.
    #[must_use]
    pub fn at(pose: &PoseMessage) -> Self {
        let (valid_m, valid_rad) = (f64::INFINITY, f64::INFINITY);
        Self { number: pose.number, valid_m, valid_rad, valid_s: 0.0, contacts: Vec::new() }
    }

    /// Returns the bytes of the first [`MAX_CONTACTS`] contacts.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let count = self.contacts.len().min(MAX_CONTACTS);
        let mut bytes = vec![0; HEAD_BYTES + count * CONTACT_BYTES];
        let mut writer = Writer { bytes: &mut bytes, at: 0 };
        writer.put(&VERSION.to_ne_bytes());
        #[allow(clippy::cast_possible_truncation)] // at most 16
        writer.put(&(count as u32).to_ne_bytes());
        writer.put(&self.number.to_ne_bytes());
        writer.put_all(&[self.valid_m, self.valid_rad, self.valid_s]);
        for contact in self.contacts.iter().take(count) {
            writer.put_all(&contact.tool_point_m);
            writer.put_all(&contact.surface_point_m);
            writer.put_all(&contact.normal);
            writer.put_all(&[contact.gap_m]);
            writer.put_all(&contact.surface_velocity_m_per_s);
            writer.put_all(&[
                contact.stiffness_n_per_m,
                contact.tangential_stiffness_n_per_m,
                contact.damping_ns_per_m,
                contact.friction,
            ]);
        }
        bytes
    }

    /// Reads a message; the numbers of contacts are as they are.
    ///
    /// # Errors
    /// [`Malformed`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Malformed> {
        let wrong_size = Malformed::Size { bytes: bytes.len() };
        if bytes.len() < HEAD_BYTES {
            return Err(wrong_size);
        }
        let mut reader = Reader { bytes };
        reader.version()?;
        let count = reader.u32() as usize;
        if count > MAX_CONTACTS || bytes.len() != HEAD_BYTES + count * CONTACT_BYTES {
            return Err(wrong_size);
        }
        let number = reader.u64();
        let [valid_m, valid_rad, valid_s] = reader.all();
        let mut contact = || Contact {
            tool_point_m: reader.all(),
            surface_point_m: reader.all(),
            normal: reader.all(),
            gap_m: reader.f64(),
            surface_velocity_m_per_s: reader.all(),
            stiffness_n_per_m: reader.f64(),
            tangential_stiffness_n_per_m: reader.f64(),
            damping_ns_per_m: reader.f64(),
            friction: reader.f64(),
        };
        let contacts = (0..count).map(|_| contact()).collect();
        Ok(Self { number, valid_m, valid_rad, valid_s, contacts })
    }
}

struct Writer<'a> {
    bytes: &'a mut [u8],
    at: usize,
}

impl Writer<'_> {
    fn put(&mut self, part: &[u8]) {
        let end = self.at + part.len();
        self.bytes[self.at..end].copy_from_slice(part);
        self.at = end;
    }

    fn put_all(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.put(&number.to_ne_bytes()));
    }
}

/// Reader of bytes whose number has been checked.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let Some((first, rest)) = self.bytes.split_first_chunk() else { return [0; N] };
        self.bytes = rest;
        *first
    }

    fn u32(&mut self) -> u32 {
        u32::from_ne_bytes(self.take())
    }

    fn u64(&mut self) -> u64 {
        u64::from_ne_bytes(self.take())
    }

    fn f64(&mut self) -> f64 {
        f64::from_ne_bytes(self.take())
    }

    fn all<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.f64())
    }

    fn version(&mut self) -> Result<(), Malformed> {
        match self.u32() {
            VERSION => Ok(()),
            version => Err(Malformed::Version { version }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DQuat, DVec3};

    #[test]
    fn messages_come_back_as_they_went() {
        let input = Input { time_ns: 7, ..Input::at_rest(Pose::new(DVec3::X, DQuat::IDENTITY)) };
        let pose = PoseMessage::of(&input, 3, 4_000_000);
        assert_eq!(PoseMessage::from_bytes(&pose.to_bytes()), Ok(pose));
        let mut set = SetMessage::at(&pose);
        let contact =
            Contact::of_handle(&input, DVec3::Z, 0.1, 500.0).with_damping(2.0).with_friction(0.3, 400.0);
        set.contacts = vec![contact; MAX_CONTACTS];
        assert_eq!(SetMessage::from_bytes(&set.to_bytes()), Ok(set.clone()));
        assert_eq!(set.to_bytes().len(), MOST_BYTES);
    }

    #[test]
    fn a_set_with_other_bytes_than_it_says_is_refused() {
        let pose = PoseMessage::of(&Input::at_rest(Pose::HOME), 1, 1);
        let mut bytes = SetMessage::at(&pose).to_bytes();
        assert_eq!(SetMessage::from_bytes(&bytes[1..]), Err(Malformed::Size { bytes: HEAD_BYTES - 1 }));
        for count in [1_u32, 17, u32::MAX] {
            bytes[4..8].copy_from_slice(&count.to_ne_bytes());
            assert_eq!(SetMessage::from_bytes(&bytes), Err(Malformed::Size { bytes: HEAD_BYTES }));
        }
        bytes[..4].copy_from_slice(&2_u32.to_ne_bytes());
        assert_eq!(SetMessage::from_bytes(&bytes), Err(Malformed::Version { version: 2 }));
        assert_eq!(SetMessage::from_bytes(&[]), Err(Malformed::Size { bytes: 0 }));
    }
}
