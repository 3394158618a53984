//! Proxy: the ball that touches the surface and never enters it.
//!
//! The centre `q` of the proxy is the point nearest to the centre `c` of the tool that the ball can reach without entering the
//! surface (god-object of Zilles and Salisbury 1995; for a ball Ruspini, Kolarov and Khatib 1997). The energy is `k/2 |q - c|^2`,
//! its gradient the force. With one contact `q` lies at a radius over the closest point of `c`, found by a walk from the last
//! one; with several, in a groove, Newton's method on the tangent planes of up to four contacts finds it. A new position is
//! accepted only if no other part of the surface lies inside the ball there, or between the old and the new centre.

use crate::contacts::{Contact, Contacts, MOST_CONTACTS, Side, leads_on};
use crate::planes::{Plane, project};
use crate::surface::{Place, Surface};
use flotor_hal::DVec3;

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
/// Minimum radius of the moving ball, m, also for a point: a point has no side at an edge, and fits between two bodies that touch.
const LEAST_RADIUS_M: f64 = 1.0e-7;

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
    /// Excess of the radius over that of the tool, m.
    pub(crate) skin_m: f64,
    /// Centre, m.
    pub(crate) centre_m: DVec3,
    pub(crate) contacts: Contacts,
}

/// Straight path of the tool.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) from_m: DVec3,
    pub(crate) to_m: DVec3,
}

/// Obstacle on the path of a ball.
enum Obstacle {
    /// Patch inside the ball at the end of the path.
    Inside(Contact),
    /// Patch between the centres, and the position of the centre at contact, m.
    Between(Contact, DVec3),
}

impl Ball {
    /// Builds a free ball for a tool of radius `radius_m`.
    pub(crate) fn new(radius_m: f64, centre_m: DVec3) -> Self {
        Self { centre_m, ..Self::default() }.with_radius(radius_m)
    }

    /// Returns this ball for a tool of radius `radius_m`.
    pub(crate) fn with_radius(self, radius_m: f64) -> Self {
        let moving_m = radius_m.max(LEAST_RADIUS_M);
        Self { radius_m: moving_m, skin_m: moving_m - radius_m, ..self }
    }

    /// Returns the centre of the proxy of the tool, nearest to a tool at `tool_m`: this ball has the same contacts and perhaps a
    /// larger radius.
    pub(crate) fn proxy_m(&self, tool_m: DVec3) -> DVec3 {
        if self.skin_m == 0.0 {
            return self.centre_m;
        }
        let mut planes = [Plane::default(); MOST_CONTACTS];
        let mut count = 0;
        for contact in self.contacts.iter() {
            let normal = (self.centre_m - contact.place.foot.point_m).normalize_or_zero();
            planes[count] = Plane { normal, least_m: -self.skin_m };
            count += 1;
        }
        match count {
            0 => self.centre_m,
            1 => {
                let proxy_m = self.centre_m - planes[0].normal * self.skin_m;
                if (proxy_m - tool_m).dot(planes[0].normal) > 0.0 { proxy_m } else { tool_m }
            }
            _ => {
                self.centre_m
                    + project(&planes[..count], tool_m - self.centre_m).map_or(DVec3::ZERO, |(y_m, _)| y_m)
            }
        }
    }

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
        // On a curved sheet a place that is farther on sees the old centre from behind: only a ball that comes from the rim changes
        // its side.
        if before == Side::Rim { Side::of(height_m) } else { before }
    }

    /// Returns the ball nearest to a tool after its path, on its contacts; at the tool if it has none. The second value is false if
    /// the ball is not at rest there.
    fn target(&self, surface: &Surface, way: Way) -> (Self, bool) {
        match (self.contacts.count(), self.contacts.first()) {
            (1, Some(contact)) => (self.over_entered(surface, way, contact), true),
            (0, _) | (_, None) => (Self { centre_m: way.to_m, ..*self }, true),
            _ => self.over_several(surface, way.to_m),
        }
    }

    /// Returns the ball nearest to a tool after its path, on its only contact; `None` if it has several contacts or loses its contact.
    pub(crate) fn over_its_contact(&self, surface: &Surface, way: Way) -> Option<Self> {
        let contact = self.contacts.first().filter(|_| self.contacts.count() == 1)?;
        Some(self.over_entered(surface, way, contact)).filter(|ball| ball.contacts.count() == 1)
    }

    fn over_one(&self, surface: &Surface, goal_m: DVec3, contact: Contact) -> Self {
        self.over_place(surface, goal_m, surface.walk(goal_m, contact.place.patch), contact.side)
    }

    /// Returns the ball over its one contact; at an edge, over the one of two faces through which the tool enters.
    fn over_entered(&self, surface: &Surface, way: Way, contact: Contact) -> Self {
        let goal_m = way.to_m;
        let place = surface.walk(goal_m, contact.place.patch);
        let is_above = |place, at_m| self.over(surface, place, contact.side, at_m).height_m >= 0.0;
        let enters = is_above(&contact.place, way.from_m) && !is_above(&place, goal_m);
        let crossing = enters.then(|| surface.first_crossing(way.from_m, goal_m)).flatten();
        let entry = crossing.map(|crossing| surface.down_from(goal_m, crossing.patch, crossing.at));
        self.over_place(surface, goal_m, entry.unwrap_or(place), contact.side)
    }

    fn over_place(&self, surface: &Surface, goal_m: DVec3, place: Place, before: Side) -> Self {
        let side = self.side(surface, &place, before);
        let over = self.over(surface, &place, side, goal_m);
        if over.height_m >= self.radius_m {
            return Self { centre_m: goal_m, contacts: Contacts::default(), ..*self };
        }
        let mut contacts = Contacts::default();
        contacts.add(Contact { place, side });
        Self { centre_m: place.foot.point_m + over.direction * self.radius_m, contacts, ..*self }
    }

    fn over_several(&self, surface: &Surface, goal_m: DVec3) -> (Self, bool) {
        let mut ball = *self;
        let (mut touching, mut is_done) = ([true; MOST_CONTACTS], false);
        for _ in 0..MOST_STEPS {
            let mut planes = [Plane::default(); MOST_CONTACTS];
            let (mut contacts, mut kept) = (Contacts::default(), 0);
            let mut places = [None; MOST_CONTACTS];
            for (place, contact) in places.iter_mut().zip(ball.contacts.iter()) {
                *place = Some((surface.follow(ball.centre_m, &contact.place, 0.0), contact.side));
            }
            for (place, before) in places.iter().flatten() {
                let side = self.side(surface, place, *before);
                let over = ball.over(surface, place, side, ball.centre_m);
                if contacts.add(Contact { place: *place, side }) {
                    let is_held_by = |(other, _): &(Place, Side)| leads_on(surface, place, other);
                    // A place without a plane may hold the ball after the next step.
                    if !places.iter().flatten().any(is_held_by) {
                        planes[kept] =
                            Plane { normal: over.direction, least_m: self.radius_m - over.height_m };
                    }
                    kept += 1;
                }
            }
            ball.contacts = contacts;
            let Some((step_m, active)) = project(&planes[..kept], goal_m - ball.centre_m) else { break };
            touching = active;
            ball.centre_m += step_m;
            is_done = step_m.length() <= SETTLED_M;
            if is_done {
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
            (1, Some(contact)) => (self.over_one(surface, goal_m, contact), true),
            _ => (ball, is_done),
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

    /// Moves the ball after a tool as far as the surface permits; returns false if the attempts are used up before the ball is at
    /// rest (its position is free of obstacles in that case, too). Real-time: bounded, no allocation.
    pub(crate) fn settle(&mut self, surface: &Surface, way: Way) -> bool {
        let (mut share, mut blocked) = (1.0, 0);
        for _ in 0..MOST_ROUNDS {
            let to_m = self.centre_m + (way.to_m - self.centre_m) * share;
            let part = if share == 1.0 { way } else { Way { from_m: to_m, to_m } };
            let (next, is_at_rest) = self.target(surface, part);
            let contact = match self.obstacle(surface, &next) {
                None => {
                    *self = next;
                    if share == 1.0 && is_at_rest {
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
                    if next.contacts.count() == 0 && self.move_to_rim(surface, way.to_m) {
                        continue;
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

    /// Moves a ball that leaves its contact over an edge, where the straight way runs through the body: to that edge, or where another
    /// body is in the way there, along the tangent plane; returns false if it can do neither.
    fn move_to_rim(&mut self, surface: &Surface, goal_m: DVec3) -> bool {
        let Some(contact) = self.contacts.first().filter(|_| self.contacts.count() == 1) else {
            return false;
        };
        let normal = self.over(surface, &contact.place, contact.side, self.centre_m).direction;
        let to_m = goal_m - self.centre_m;
        let along_m = self.centre_m + to_m - normal * to_m.dot(normal);
        let rim = self.placed_under(surface, goal_m);
        let found = [rim, Self { centre_m: along_m, ..*self }].into_iter().find(|next| {
            (next.centre_m - self.centre_m).length() > SETTLED_M && self.can_move_to(surface, next)
        });
        if let Some(next) = found {
            *self = next;
        }
        found.is_some()
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
            return self.over_several(surface, near_m).0;
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
