//! Proxy: the ball that touches the surface and never enters it.
//!
//! The centre `q` of the proxy is the point nearest to the centre `c` of the tool that the ball can reach without entering the
//! surface (god-object of Zilles and Salisbury 1995; for a ball Ruspini, Kolarov and Khatib 1997). The energy is `k/2 |q - c|^2`,
//! its gradient the force. With one contact `q` lies at a radius over the closest point of `c`, found by a walk from the last
//! one; with several, in a groove, Newton's method on the tangent planes of up to four contacts finds it. A new position is
//! accepted only if no other part of the surface lies inside the ball there, or between the old and the new centre.

use crate::closest::Foot;
use crate::planes::{Plane, project};
use crate::surface::{Place, Surface};
use flotor_hal::DVec3;

/// Maximum number of simultaneous contacts: three determine a position, a fourth can replace one of them.
pub(crate) const MOST_CONTACTS: usize = 4;
/// Penetration of a patch up to which it is not a new contact, m.
const TOLERANCE_M: f64 = 2.0e-10;
/// Length of a Newton step at which several contacts have converged, m.
const SETTLED_M: f64 = 1.0e-12;
/// Maximum number of Newton steps for several contacts.
const MOST_STEPS: usize = 40;
/// Maximum number of attempts to reach a goal; each adds a contact or halves the path.
const MOST_ROUNDS: usize = 24;
/// Maximum motion of the centre between two searches for contacts, as a fraction of the radius: no surface fits in between.
const SAFE_SHARE: f64 = 0.9;
/// Height of a lifted path above which its ascent and descent are tested as well, m.
const HIGH_M: f64 = 1.0e-6;
/// Gap above which a contact ends, m.
const SKIN_M: f64 = 1.0e-7;

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
    fn of(height: f64) -> Self {
        if height < 0.0 { Self::Back } else { Self::Front }
    }

    fn sign(self) -> f64 {
        if self == Self::Back { -1.0 } else { 1.0 }
    }
}

/// Patch in contact with the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Contact {
    pub(crate) place: Place,
    pub(crate) side: Side,
}

/// Contacts of a ball; the first `count` are in use.
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
    fn add(&mut self, contact: Contact) -> bool {
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
    (a.point_m - b.point_m).length() < 1.0e-9 && a.normal.dot(b.normal) > 1.0 - 1.0e-9
}

/// Position of a centre relative to a point of the surface: direction from the surface to the centre, and height above the
/// surface.
#[derive(Clone, Copy, Debug)]
struct Over {
    direction: DVec3,
    height_m: f64,
}

/// Ball and its contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ball {
    pub(crate) radius_m: f64,
    /// Centre, m.
    pub(crate) centre_m: DVec3,
    pub(crate) contacts: Contacts,
}

/// Obstacle on the path of a ball.
enum Obstacle {
    /// Patch inside the ball at the end of the path.
    Inside(Contact),
    /// Patch between the centres, and the position of the centre at contact, m.
    Between(Contact, DVec3),
}

impl Ball {
    /// Returns the direction and height of `x_m` above a point of the surface, on one side.
    fn over(&self, surface: &Surface, place: &Place, side: Side, x_m: DVec3) -> Over {
        let foot = &place.foot;
        let from_m = x_m - foot.point_m;
        let distance_m = from_m.length();
        let is_inner = foot.at.iter().all(|x| *x > 0.0);
        if is_inner {
            let direction = foot.normal * side.sign();
            let height_m = from_m.dot(direction);
            // The direction between the two points is accurate far from the surface, the normal near the surface.
            return match distance_m > 1.0e-6 && height_m > 0.0 {
                true => Over { direction: from_m / distance_m, height_m: distance_m },
                false => Over { direction, height_m },
            };
        }
        if distance_m < 1.0e-9 {
            // In a groove each wall is a separate contact of a point.
            let direction = foot.normal * side.sign();
            return Over { direction, height_m: from_m.dot(direction) };
        }
        let outward = surface.outward(place) * side.sign();
        let is_outside = surface.is_border(place) || from_m.dot(outward) >= 0.0;
        let sign = if is_outside { 1.0 } else { -1.0 };
        Over { direction: from_m * (sign / distance_m), height_m: sign * distance_m }
    }

    /// Returns the side of an open surface on which the proxy is, at a point of the surface.
    fn side(&self, surface: &Surface, place: &Place, before: Side) -> Side {
        if surface.is_closed(place) {
            return Side::Front;
        }
        if surface.is_border(place) {
            return Side::Rim;
        }
        let height_m = (self.centre_m - place.foot.point_m).dot(place.foot.normal);
        let is_clear = height_m.abs() > 0.5 * self.radius_m && height_m.abs() > 1.0e-9;
        if before == Side::Rim || is_clear { Side::of(height_m) } else { before }
    }

    /// Returns the ball nearest to `goal_m` on its contacts; at the goal if it has none.
    fn target(&self, surface: &Surface, goal_m: DVec3) -> Self {
        match (self.contacts.count(), self.contacts.first()) {
            (1, Some(contact)) => self.over_one(surface, goal_m, contact),
            (0, _) | (_, None) => Self { centre_m: goal_m, ..*self },
            _ => self.over_several(surface, goal_m),
        }
    }

    /// Returns the ball nearest to `goal_m` on its only contact; `None` if it has several contacts or loses its contact.
    pub(crate) fn over_its_contact(&self, surface: &Surface, goal_m: DVec3) -> Option<Self> {
        let contact = self.contacts.first().filter(|_| self.contacts.count() == 1)?;
        Some(self.over_one(surface, goal_m, contact)).filter(|ball| ball.contacts.count() == 1)
    }

    fn over_one(&self, surface: &Surface, goal_m: DVec3, contact: Contact) -> Self {
        let place = surface.walk(goal_m, contact.place.patch);
        let side = self.side(surface, &place, contact.side);
        let over = self.over(surface, &place, side, goal_m);
        if over.height_m >= self.radius_m {
            return Self { centre_m: goal_m, contacts: Contacts::default(), ..*self };
        }
        let mut contacts = Contacts::default();
        contacts.add(Contact { place, side });
        Self { centre_m: place.foot.point_m + over.direction * self.radius_m, contacts, ..*self }
    }

    fn over_several(&self, surface: &Surface, goal_m: DVec3) -> Self {
        let mut ball = *self;
        let mut touching = [false; MOST_CONTACTS];
        for _ in 0..MOST_STEPS {
            let mut planes = [Plane::default(); MOST_CONTACTS];
            let (mut contacts, mut kept) = (Contacts::default(), 0);
            for contact in ball.contacts.iter() {
                let place = surface.follow(ball.centre_m, &contact.place, 0.0);
                let side = self.side(surface, &place, contact.side);
                let over = ball.over(surface, &place, side, ball.centre_m);
                if contacts.add(Contact { place, side }) {
                    planes[kept] = Plane { normal: over.direction, least_m: self.radius_m - over.height_m };
                    kept += 1;
                }
            }
            ball.contacts = contacts;
            let (step_m, active) = project(&planes[..kept], goal_m - ball.centre_m);
            touching = active;
            ball.centre_m += step_m;
            if step_m.length() <= SETTLED_M {
                break;
            }
        }
        let mut left = Contacts::default();
        for (contact, _) in ball.contacts.iter().zip(touching).filter(|(_, touches)| *touches) {
            left.add(contact);
        }
        ball.contacts = left;
        match (ball.contacts.count(), ball.contacts.first()) {
            // For one contact the walk is exact.
            (1, Some(contact)) => self.over_one(surface, goal_m, contact),
            _ => ball,
        }
    }

    /// Returns the obstacle between this ball and `next`, or inside `next`.
    fn obstacle(&self, surface: &Surface, next: &Self) -> Option<Obstacle> {
        let way_m = next.centre_m - self.centre_m;
        if way_m.length() > SAFE_SHARE * self.radius_m {
            // In a groove the normal of one wall points into the other wall: use their sum.
            let normal = |ball: &Self| {
                let up = |c: Contact| surface.outward(&c.place).normalize_or_zero() * c.side.sign();
                ball.contacts.iter().map(up).sum::<DVec3>().normalize_or_zero()
            };
            let (here, there) = (normal(self), normal(next));
            // The chord over a curved surface crosses the surface: lift the path by more than the sagitta.
            let lift_m = way_m.length() * ((here - there).length() * 0.25).min(0.25) + 1.0e-9;
            let (from_m, to_m) = (self.centre_m + here * lift_m, next.centre_m + there * lift_m);
            let skin = 1.0e-9;
            let up = (self.centre_m + here * skin, from_m);
            let down = (to_m, next.centre_m + there * skin);
            let is_high = lift_m > HIGH_M;
            let segments = [Some((from_m, to_m)), is_high.then_some(up), is_high.then_some(down)];
            for (from_m, to_m) in segments.into_iter().flatten() {
                let Some(crossing) = surface.first_crossing(from_m, to_m) else { continue };
                let place = surface.place(crossing.patch, crossing.at);
                let side = match surface.is_closed(&place) {
                    true => Side::Front,
                    false => Side::of(-(to_m - from_m).dot(place.foot.normal)),
                };
                let met_m = place.foot.point_m + place.foot.normal * (side.sign() * self.radius_m);
                return Some(Obstacle::Between(Contact { place, side }, met_m));
            }
        }
        if self.radius_m == 0.0 {
            return None;
        }
        let in_front = |place: &Place| {
            !surface.is_closed(place)
                || (next.centre_m - place.foot.point_m).dot(surface.outward(place)) > 0.0
        };
        // Skip the patches in contact: their distance is the radius.
        let is_touched = |patch| next.contacts.iter().any(|contact| contact.place.patch == patch);
        let bound_m = self.radius_m - TOLERANCE_M;
        let place = surface.nearest_besides(next.centre_m, bound_m, is_touched, in_front)?;
        let side = self.side(surface, &place, Side::Rim);
        Some(Obstacle::Inside(Contact { place, side }))
    }

    /// Moves the ball towards `goal_m` as far as the surface permits; returns false if the attempts are used up before the ball
    /// is at rest (its position is free of obstacles in that case, too). Real-time: bounded, no allocation.
    pub(crate) fn settle(&mut self, surface: &Surface, goal_m: DVec3) -> bool {
        let (mut share, mut blocked) = (1.0, 0);
        for _ in 0..MOST_ROUNDS {
            let to_m = self.centre_m + (goal_m - self.centre_m) * share;
            let next = self.target(surface, if share == 1.0 { goal_m } else { to_m });
            let contact = match self.obstacle(surface, &next) {
                None => {
                    *self = next;
                    if share == 1.0 {
                        return true;
                    }
                    (share, blocked) = (1.0, 0);
                    continue;
                }
                Some(Obstacle::Inside(contact)) => contact,
                Some(Obstacle::Between(contact, met_m)) => {
                    if self.contacts.count() == 0 {
                        self.centre_m = met_m;
                    }
                    contact
                }
            };
            let mut is_new = self.contacts.add(contact);
            if !is_new {
                // Remove contacts that the ball does not touch, to make room.
                self.drop_idle(surface);
                is_new = self.contacts.add(contact);
            }
            // If a new contact does not change the path, try a shorter one.
            blocked += 1;
            if !is_new || blocked > 2 {
                share *= 0.5;
            }
        }
        false
    }

    /// Removes contacts that the ball does not touch.
    fn drop_idle(&mut self, surface: &Surface) {
        let mut left = Contacts::default();
        for contact in self.contacts.iter() {
            let place = surface.follow(self.centre_m, &contact.place, 0.0);
            let over = self.over(surface, &place, contact.side, self.centre_m);
            if over.height_m - self.radius_m <= SKIN_M {
                left.add(Contact { place, ..contact });
            }
        }
        self.contacts = left;
    }

    /// Returns the direction of the surface under the ball, from the surface outwards; of several contacts, their sum.
    pub(crate) fn normal(&self, surface: &Surface) -> Option<DVec3> {
        let sum: DVec3 =
            self.contacts.iter().map(|c| self.over(surface, &c.place, c.side, self.centre_m).direction).sum();
        sum.try_normalize()
    }

    /// Returns this ball on the surface below `near_m`: with one contact, on the side of this contact; with several contacts,
    /// nearest to `near_m`.
    pub(crate) fn placed_under(&self, surface: &Surface, near_m: DVec3) -> Self {
        let Some(contact) = self.contacts.first().filter(|_| self.contacts.count() == 1) else {
            return self.target(surface, near_m);
        };
        let place = surface.follow(near_m, &contact.place, (near_m - self.centre_m).length());
        let direction = self.over(surface, &place, contact.side, near_m).direction;
        let mut contacts = Contacts::default();
        contacts.add(Contact { place, ..contact });
        Self { centre_m: place.foot.point_m + direction * self.radius_m, contacts, ..*self }
    }

    /// Returns true if there is no obstacle inside the ball `next` or between the two balls.
    pub(crate) fn can_move_to(&self, surface: &Surface, next: &Self) -> bool {
        self.obstacle(surface, next).is_none()
    }
}
