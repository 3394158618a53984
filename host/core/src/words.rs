//! Encoding of poses, twists, wrenches and contact sets in the words of a record that threads or processes share ([`Words`]).
//!
//! [`Words`]: flotor_sync::Words
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{Contact, ContactSet, LinearField, MAX_CONTACTS, Pose, Twist, Wrench};

/// Number of words of a pose and a twist.
pub const MOTION_WORDS: usize = 7 + 6;
/// Number of words of a linear field: pose, wrench, stiffness, two radii and a time.
pub const FIELD_WORDS: usize = 7 + 6 + 36 + 3;
/// Number of words of a contact set: pose, contacts, counts, three limits, field and a time.
pub const CONTACT_SET_WORDS: usize = 7 + MAX_CONTACTS * 17 + 1 + 3 + FIELD_WORDS + 1;

/// Encoder of a record of `N` words. Real-time: bounded, no allocation.
pub struct Encoder<const N: usize> {
    words: [u64; N],
    count: usize,
}

impl<const N: usize> Encoder<N> {
    /// Creates an encoder of a record that is zero so far.
    pub const fn of_zeros() -> Self {
        Self { words: [0; N], count: 0 }
    }

    /// Appends words; drops words beyond the end of the record.
    pub fn words<const M: usize>(&mut self, words: [u64; M]) -> &mut Self {
        let rest = self.words.iter_mut().skip(self.count);
        rest.zip(words).for_each(|(place, word)| *place = word);
        self.count += M;
        self
    }

    /// Appends numbers as their bit patterns.
    pub fn numbers<const M: usize>(&mut self, numbers: [f64; M]) -> &mut Self {
        self.words(numbers.map(f64::to_bits))
    }

    /// Appends pose and twist, m, unit quaternion, m/s and rad/s.
    pub fn motion(&mut self, pose: &Pose, twist: &Twist) -> &mut Self {
        self.pose(pose).numbers(twist.linear_m_per_s).numbers(twist.angular_rad_per_s)
    }

    /// Appends a wrench, N and N·m.
    pub fn wrench(&mut self, wrench: &Wrench) -> &mut Self {
        self.numbers(wrench.force_n).numbers(wrench.torque_nm)
    }

    /// Appends a linear field.
    pub fn field(&mut self, field: &LinearField) -> &mut Self {
        self.pose(&field.anchor).wrench(&field.wrench);
        for row in field.stiffness {
            self.numbers(row);
        }
        self.numbers([field.valid_m, field.valid_rad]).words([field.time_ns])
    }

    /// Appends a contact set.
    pub fn contact_set(&mut self, set: &ContactSet) -> &mut Self {
        self.pose(&set.anchor);
        for contact in set.contacts {
            let Contact { gap_m, stiffness_n_per_m, tangential_stiffness_n_per_m, .. } = contact;
            let vectors = [contact.tool_point_m, contact.surface_point_m, contact.normal];
            vectors.into_iter().chain([contact.surface_velocity_m_per_s]).for_each(|vector| {
                self.numbers(vector);
            });
            let laws = [gap_m, stiffness_n_per_m, tangential_stiffness_n_per_m];
            self.numbers(laws).numbers([contact.damping_ns_per_m, contact.friction]);
        }
        self.words([u64::from(set.count) | u64::from(set.has_field) << 32]).numbers([
            set.valid_m,
            set.valid_rad,
            set.valid_s,
        ]);
        self.field(&set.field).words([set.time_ns])
    }

    /// Returns the words of the record; zero where nothing was appended.
    pub const fn finish(&self) -> [u64; N] {
        self.words
    }

    fn pose(&mut self, pose: &Pose) -> &mut Self {
        self.numbers(pose.position_m).numbers(pose.orientation_xyzw)
    }
}

/// Decoder of the words of a record, in order; returns zeros after the end of the record. Real-time: bounded, no
/// allocation.
pub struct Decoder<'a> {
    words: std::slice::Iter<'a, u64>,
}

impl<'a> Decoder<'a> {
    /// Creates a decoder of a record.
    #[inline]
    pub fn of(words: &'a [u64]) -> Self {
        Self { words: words.iter() }
    }

    /// Returns the next word.
    #[inline]
    pub fn word(&mut self) -> u64 {
        self.words.next().copied().unwrap_or(0)
    }

    /// Returns the next `M` numbers.
    #[inline]
    pub fn numbers<const M: usize>(&mut self) -> [f64; M] {
        std::array::from_fn(|_| f64::from_bits(self.word()))
    }

    /// Returns the next pose and twist.
    #[inline]
    pub fn motion(&mut self) -> (Pose, Twist) {
        (self.pose(), Twist { linear_m_per_s: self.numbers(), angular_rad_per_s: self.numbers() })
    }

    /// Returns the next wrench.
    #[inline]
    pub fn wrench(&mut self) -> Wrench {
        Wrench { force_n: self.numbers(), torque_nm: self.numbers() }
    }

    /// Returns the next linear field.
    #[inline]
    pub fn field(&mut self) -> LinearField {
        let (anchor, wrench) = (self.pose(), self.wrench());
        let stiffness = std::array::from_fn(|_| self.numbers());
        let [valid_m, valid_rad] = self.numbers();
        LinearField { anchor, wrench, stiffness, valid_m, valid_rad, time_ns: self.word() }
    }

    /// Returns the next contact set.
    pub fn contact_set(&mut self) -> ContactSet {
        let anchor = self.pose();
        let contacts = std::array::from_fn(|_| self.contact());
        let counts = self.word();
        #[allow(clippy::cast_possible_truncation)] // the two halves
        let (count, has_field) = (counts as u32, (counts >> 32) as u32);
        let [valid_m, valid_rad, valid_s] = self.numbers();
        let field = self.field();
        let time_ns = self.word();
        ContactSet { anchor, contacts, count, has_field, valid_m, valid_rad, valid_s, field, time_ns }
    }

    fn contact(&mut self) -> Contact {
        let [tool_point_m, surface_point_m, normal, surface_velocity_m_per_s] =
            std::array::from_fn(|_| self.numbers());
        let [gap_m, stiffness_n_per_m, tangential_stiffness_n_per_m, damping_ns_per_m, friction] =
            self.numbers();
        Contact {
            tool_point_m,
            surface_point_m,
            normal,
            gap_m,
            surface_velocity_m_per_s,
            stiffness_n_per_m,
            tangential_stiffness_n_per_m,
            damping_ns_per_m,
            friction,
        }
    }

    #[inline]
    fn pose(&mut self) -> Pose {
        Pose { position_m: self.numbers(), orientation_xyzw: self.numbers() }
    }
}
