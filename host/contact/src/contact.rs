//! Contacts, and sets of them that have passed all checks.

use flotor_hal::{DVec3, MAX_CONTACTS, Pose};
use std::fmt;

/// Largest magnitude of a number in a set, in a pose and in a twist. Products of five such numbers are still finite.
pub(crate) const LARGEST: f64 = 1.0e9;
/// Largest deviation of the length of a normal, or of the orientation of the anchor, from 1: ten roundings of `f32`.
const UNIT_TOLERANCE: f64 = 1.0e-6;
/// Largest difference between a gap and the distance of its two points along the normal, m: ten roundings of `f32` at 1 m,
/// and below the resolution of any device.
const GAP_TOLERANCE_M: f64 = 1.0e-6;

/// Contact between a point of the tool and a plane that stands for the surface nearby.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Point on the tool, tool frame, m.
    pub tool_point_m: DVec3,
    /// Closest point on the surface at publication, scene frame, m.
    pub surface_point_m: DVec3,
    /// Unit normal of the surface, scene frame, towards the tool.
    pub normal: DVec3,
    /// Distance of the point on the tool from the surface at publication, along the normal, m; below 0 inside.
    pub gap_m: f64,
    /// Velocity of the surface, scene frame, m/s.
    pub surface_velocity_m_per_s: DVec3,
    /// Stiffness along the normal, N/m; above 0.
    pub stiffness_n_per_m: f64,
    /// Stiffness across the normal while the contact sticks, N/m; 0: no friction.
    pub tangential_stiffness_n_per_m: f64,
    /// Damping along the normal, N·s/m.
    pub damping_ns_per_m: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

impl Contact {
    /// Converts a published contact, without checks.
    fn unchecked(contact: &flotor_hal::Contact) -> Self {
        Self {
            tool_point_m: DVec3::from_array(contact.tool_point_m),
            surface_point_m: DVec3::from_array(contact.surface_point_m),
            normal: DVec3::from_array(contact.normal),
            gap_m: contact.gap_m,
            surface_velocity_m_per_s: DVec3::from_array(contact.surface_velocity_m_per_s),
            stiffness_n_per_m: contact.stiffness_n_per_m,
            tangential_stiffness_n_per_m: contact.tangential_stiffness_n_per_m,
            damping_ns_per_m: contact.damping_ns_per_m,
            friction: contact.friction,
        }
    }

    /// Returns the stiffness across the normal, 0 without friction.
    pub(crate) fn sticking_n_per_m(&self) -> f64 {
        if self.friction > 0.0 { self.tangential_stiffness_n_per_m } else { 0.0 }
    }

    /// Returns the contact with its normal scaled to length 1, or the first invalid field.
    fn checked(&self, anchor: &Pose) -> Result<Self, (&'static str, Fault)> {
        let vectors = [
            ("tool_point_m", self.tool_point_m),
            ("surface_point_m", self.surface_point_m),
            ("normal", self.normal),
            ("surface_velocity_m_per_s", self.surface_velocity_m_per_s),
        ];
        let numbers = [
            ("gap_m", self.gap_m, -LARGEST),
            ("stiffness_n_per_m", self.stiffness_n_per_m, f64::MIN_POSITIVE),
            ("tangential_stiffness_n_per_m", self.tangential_stiffness_n_per_m, 0.0),
            ("damping_ns_per_m", self.damping_ns_per_m, 0.0),
            ("friction", self.friction, 0.0),
        ];
        for (field, vector) in vectors {
            accept(are_usable(&vector.to_array()), field, Fault::NotFinite)?;
        }
        for (field, number, least) in numbers {
            accept(are_usable(&[number]), field, Fault::NotFinite)?;
            accept(number >= least, field, Fault::TooSmall)?;
        }
        accept(is_unit(self.normal.length()), "normal", Fault::NotUnit)?;
        let normal = self.normal.normalize();
        let tool_point_m = anchor.position() + anchor.orientation() * self.tool_point_m;
        let distance_m = normal.dot(tool_point_m - self.surface_point_m);
        accept((distance_m - self.gap_m).abs() <= GAP_TOLERANCE_M, "gap_m", Fault::Inconsistent)?;
        Ok(Self { normal, ..*self })
    }
}

fn accept(is_right: bool, field: &'static str, fault: Fault) -> Result<(), (&'static str, Fault)> {
    if is_right { Ok(()) } else { Err((field, fault)) }
}

/// Range of motion from the anchor and time from publication within which a set describes the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Largest displacement of the tool, m; may be infinite.
    pub displacement_m: f64,
    /// Largest rotation of the tool, rad, as the chord `2 sin(angle / 2)`; may be infinite.
    pub rotation_rad: f64,
    /// Longest time, s; may be infinite.
    pub duration_s: f64,
}

impl Validity {
    /// Unlimited motion and time.
    pub const UNLIMITED: Self =
        Self { displacement_m: f64::INFINITY, rotation_rad: f64::INFINITY, duration_s: f64::INFINITY };
}

/// Checked set of contacts: every number is finite and within its range, normals have length 1, gaps agree with the points.
#[derive(Clone, Copy, Debug)]
pub struct ContactSet {
    anchor: Pose,
    contacts: [Contact; MAX_CONTACTS],
    count: usize,
    validity: Validity,
}

impl ContactSet {
    /// Checks a set that was computed for the tool at the pose `anchor`. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If there are more than [`MAX_CONTACTS`], or a number is not finite, out of its range or inconsistent with another one.
    pub fn new(anchor: &Pose, contacts: &[Contact], validity: Validity) -> Result<Self, ContactSetError> {
        if contacts.len() > MAX_CONTACTS {
            return Err(ContactSetError::TooMany { count: contacts.len() });
        }
        if !is_usable_pose(anchor) {
            return Err(ContactSetError::Anchor);
        }
        let Validity { displacement_m, rotation_rad, duration_s } = validity;
        if ![displacement_m, rotation_rad, duration_s].iter().all(|limit| *limit > 0.0) {
            return Err(ContactSetError::Validity);
        }
        let anchor = Pose::new(anchor.position(), anchor.orientation().normalize());
        let mut set = Self { anchor, count: contacts.len(), validity, ..Self::empty() };
        for (index, (slot, contact)) in set.contacts.iter_mut().zip(contacts).enumerate() {
            let checked = contact.checked(&anchor);
            *slot = checked.map_err(|(field, fault)| ContactSetError::Contact { index, field, fault })?;
        }
        Ok(set)
    }

    /// Checks a published set; a set that declares no validity time is valid for `valid_s`. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn published(set: &flotor_hal::ContactSet, valid_s: f64) -> Result<Self, ContactSetError> {
        let mut contacts = [Contact::default(); MAX_CONTACTS];
        contacts
            .iter_mut()
            .zip(&set.contacts)
            .for_each(|(place, contact)| *place = Contact::unchecked(contact));
        let count = set.count as usize;
        let contacts = contacts.get(..count).ok_or(ContactSetError::TooMany { count })?;
        let duration_s = if set.valid_s == 0.0 { valid_s } else { set.valid_s };
        let validity = Validity { displacement_m: set.valid_m, rotation_rad: set.valid_rad, duration_s };
        Self::new(&set.anchor, contacts, validity)
    }

    /// Returns the set with each contact transformed by `exchange`.
    pub(crate) fn map(mut self, mut exchange: impl FnMut(Contact) -> Contact) -> Self {
        self.contacts.iter_mut().take(self.count).for_each(|contact| *contact = exchange(*contact));
        self
    }

    /// Returns the set without contacts, always valid. Real-time: bounded, no allocation.
    #[must_use]
    pub fn empty() -> Self {
        let contacts = [Contact::default(); MAX_CONTACTS];
        Self { anchor: Pose::HOME, contacts, count: 0, validity: Validity::UNLIMITED }
    }

    /// Returns the pose of the tool for which the set was computed. Real-time: bounded, no allocation.
    pub fn anchor(&self) -> &Pose {
        &self.anchor
    }

    /// Returns the contacts. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contacts(&self) -> &[Contact] {
        self.contacts.get(..self.count).unwrap_or_default()
    }

    /// Returns true if the set is not too old.
    pub(crate) fn is_valid_for(&self, age_s: f64) -> bool {
        age_s <= self.validity.duration_s
    }

    /// Returns true if the set still describes the surface. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_valid_at(&self, pose: &Pose, age_s: f64) -> bool {
        let turn = pose.orientation() * self.anchor.orientation().conjugate();
        let displacement_m = (pose.position() - self.anchor.position()).length();
        displacement_m <= self.validity.displacement_m
            && 2.0 * turn.xyz().length() <= self.validity.rotation_rad
            && self.is_valid_for(age_s)
    }
}

/// Error of a set of contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactSetError {
    /// More contacts than a set can have.
    TooMany {
        /// Number of contacts given.
        count: usize,
    },
    /// The anchor is not finite, or its orientation not a unit quaternion.
    Anchor,
    /// A limit of the range of validity is not above 0.
    Validity,
    /// A contact with an invalid number.
    Contact {
        /// Index of the contact.
        index: usize,
        /// Name of its field.
        field: &'static str,
        /// Reason of the refusal.
        fault: Fault,
    },
}

/// Reason why a field of a contact is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Not finite, or larger than 1e9.
    NotFinite,
    /// Not of length 1.
    NotUnit,
    /// Below 0, or a stiffness along the normal of 0.
    TooSmall,
    /// Not the distance between the two points along the normal.
    Inconsistent,
}

impl fmt::Display for ContactSetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany { count } => {
                write!(
                    f,
                    "the set has {count} contacts, above the limit of {MAX_CONTACTS}; send the deepest ones"
                )
            }
            Self::Anchor => {
                write!(f, "the anchor is not a pose: send finite numbers and a unit quaternion")
            }
            Self::Validity => {
                write!(f, "a limit of the validity is not above 0: send metres, radians and seconds above 0")
            }
            Self::Contact { index, field, fault } => write!(f, "contact {index}: `{field}` {fault}"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "is not finite, or larger than 1e9",
            Self::NotUnit => "does not have length 1: normalize it",
            Self::TooSmall => "is too small: a stiffness is above 0, damping and friction are not below 0",
            Self::Inconsistent => {
                "is not the distance between the points of surface and tool along the normal: \
                 compute all three at the pose of the anchor"
            }
        })
    }
}

impl std::error::Error for ContactSetError {}

/// Returns true for a finite pose with a unit quaternion.
pub(crate) fn is_usable_pose(pose: &Pose) -> bool {
    are_usable(&pose.position_m) && are_usable(&pose.orientation_xyzw) && is_unit(pose.orientation().length())
}

/// Returns true if all numbers are finite and at most [`LARGEST`] in magnitude.
pub(crate) fn are_usable(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.abs() <= LARGEST)
}

fn is_unit(length: f64) -> bool {
    (length - 1.0).abs() <= UNIT_TOLERANCE
}
