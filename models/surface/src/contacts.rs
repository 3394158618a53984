//! Contacts of a ball: patches that hold it, each with a side.

use crate::closest::Foot;
use crate::surface::{Place, Surface};

/// Maximum number of simultaneous contacts: three determine a position, a fourth can replace one of them.
pub(crate) const MOST_CONTACTS: usize = 4;
/// Distance of two points that count as one, m.
const SAME_M: f64 = 1.0e-9;

/// Side of a surface on which the ball is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Side {
    /// Side of the normals.
    #[default]
    Front,
    /// Other side, of an open surface only.
    Back,
    /// Not determined: at the border of an open surface.
    Rim,
}

impl Side {
    pub(crate) fn of(height: f64) -> Self {
        if height < 0.0 { Self::Back } else { Self::Front }
    }

    pub(crate) fn sign(self) -> f64 {
        if self == Self::Back { -1.0 } else { 1.0 }
    }
}

/// Patch in contact with the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Contact {
    pub(crate) place: Place,
    pub(crate) side: Side,
}

/// Contacts of a ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Contacts {
    pub(crate) all: [Option<Contact>; MOST_CONTACTS],
}

impl Contacts {
    pub(crate) fn iter(&self) -> impl Iterator<Item = Contact> + '_ {
        self.all.iter().copied().flatten()
    }

    pub(crate) fn count(&self) -> usize {
        self.all.iter().flatten().count()
    }

    pub(crate) fn first(&self) -> Option<Contact> {
        self.iter().next()
    }

    /// Adds a contact; returns false if the contact exists already or the list is full.
    pub(crate) fn add(&mut self, contact: Contact) -> bool {
        let is_known = self.iter().any(|other| is_same(&other.place.foot, &contact.place.foot));
        match self.all.iter_mut().find(|place| place.is_none()) {
            Some(place) if !is_known => {
                *place = Some(contact);
                true
            }
            _ => false,
        }
    }
}

/// Returns true if two closest points coincide and have the same normal.
fn is_same(a: &Foot, b: &Foot) -> bool {
    (a.point_m - b.point_m).length() < SAME_M && a.normal.dot(b.normal) > 1.0 - 1.0e-9
}

/// Returns true if a place lies on the sheet of a nearer one, at the border of its own: bodies that touch have one surface there, and
/// the ball that slides over it is held by the nearer place alone.
pub(crate) fn leads_on(surface: &Surface, place: &Place, nearer: &Place) -> bool {
    let is_inner = place.foot.at.iter().all(|x| *x > 0.0);
    if is_inner || nearer.foot.distance_m >= place.foot.distance_m {
        return false;
    }
    surface.walk(place.foot.point_m, nearer.patch).foot.distance_m < SAME_M
}
