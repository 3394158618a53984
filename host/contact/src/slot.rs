//! State of a contact in the loop: plane, friction, and withheld part of the depth.

use crate::cap::{OffsetSpace, Spring};
use crate::contact::Contact;
use crate::law::{FrictionLaw, NormalLaw};
use crate::linear::{Vector6, dot};
use crate::newton::{Rows, Term};
use flotor_hal::{DVec3, Pose, Twist};

/// Role of a slot in the newest set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Role {
    /// A contact of the set.
    Live,
    /// A contact of an earlier set, whose force fades.
    #[default]
    Fading,
}

/// Contact with its state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slot {
    pub(crate) role: Role,
    pub(crate) contact: Contact,
    tangents: [DVec3; 2],
    arm_at_anchor_m: DVec3,
    /// Gap of a point of the tool at the origin of the scene, m; changes as the surface moves.
    gap_at_origin_m: f64,
    /// Part of the depth without a force, m; below 0, force without depth.
    pub(crate) withheld_m: f64,
    /// Maximum change of the withheld part in a tick, m.
    pub(crate) rate_m: f64,
    /// Position of the point of the tool in the last solve, without the offset, m.
    pub(crate) last_m: DVec3,
    /// Motion of the surface since the last solve, m.
    travel_m: DVec3,
    /// Compression of the spring in the last solve, m.
    pub(crate) depth_m: f64,
    /// Normal force in the last solve, N.
    pub(crate) normal_n: f64,
    /// Force on the tool in the last solve, N.
    pub(crate) force: DVec3,
    /// Stretch of the tangential spring after the last solve, m.
    pub(crate) stretch_m: DVec3,
    /// Point of the surface to which the tangential spring is fixed; none before the first solve.
    pub(crate) anchor_m: Option<DVec3>,
}

impl Slot {
    /// Creates the slot of a contact, `age_s` after its set was published.
    pub(crate) fn new(contact: &Contact, anchor: &Pose, age_s: f64) -> Self {
        let arm_at_anchor_m = anchor.orientation() * contact.tool_point_m;
        let (first, second) = contact.normal.any_orthonormal_pair();
        let travelled = contact.surface_velocity_m_per_s * age_s;
        Self {
            role: Role::Live,
            contact: *contact,
            tangents: [first, second],
            arm_at_anchor_m,
            gap_at_origin_m: contact.gap_m
                - contact.normal.dot(anchor.position() + arm_at_anchor_m + travelled),
            ..Self::default()
        }
    }

    /// Returns the derivatives of gap and stretch with respect to the coordinates of the offset. The lever arm is constant, that
    /// at the anchor: the energy then depends on the pose through the gaps alone, and the wrench is its gradient.
    pub(crate) fn rows(&self, space: &OffsetSpace) -> Rows {
        let row = |direction: DVec3| space.coordinates(direction, self.arm_at_anchor_m.cross(direction));
        Rows { normal: row(self.contact.normal), tangents: self.tangents.map(row) }
    }

    /// Moves the surface by `travel_m`.
    #[inline]
    pub(crate) fn advance(&mut self, travel_m: DVec3) {
        self.travel_m = travel_m;
        self.gap_at_origin_m -= self.contact.normal.dot(travel_m);
        self.anchor_m = self.anchor_m.map(|anchor_m| anchor_m + travel_m);
    }

    /// Returns the depth of a point of the tool and the stretch of its tangential spring, m, without the offset and the withheld
    /// part.
    #[inline]
    pub(crate) fn reach(&self, point_m: DVec3) -> (f64, [f64; 2]) {
        let anchor_m = self.anchor_m.unwrap_or(point_m);
        let stretch_m = self.tangents.map(|tangent| tangent.dot(point_m - anchor_m));
        (-(self.gap_at_origin_m + self.contact.normal.dot(point_m)), stretch_m)
    }

    /// Returns the law along the normal at a twist.
    #[inline]
    pub(crate) fn normal_law(&self, arm_m: DVec3, twist: &Twist, period_s: f64) -> NormalLaw {
        let Contact { normal, surface_velocity_m_per_s, stiffness_n_per_m, damping_ns_per_m, .. } =
            self.contact;
        let velocity = twist.linear() + twist.angular().cross(arm_m);
        let approach_m = normal.dot(surface_velocity_m_per_s - velocity) * period_s;
        NormalLaw::new(stiffness_n_per_m, damping_ns_per_m / period_s, approach_m)
    }

    /// Returns the friction under a normal force.
    #[inline]
    pub(crate) fn friction_law(&self, normal_n: f64) -> FrictionLaw {
        FrictionLaw {
            stiffness_n_per_m: self.contact.sticking_n_per_m(),
            limit_n: self.contact.friction * normal_n,
        }
    }

    /// Returns the motion of the point of the tool relative to the surface since the last solve, m.
    #[inline]
    pub(crate) fn motion_m(&self, point_m: DVec3) -> DVec3 {
        point_m - self.last_m - self.travel_m
    }

    /// Stores the force at a solved offset, and moves the anchor as far as the contact slides, which never increases the energy
    /// of the stretch. Returns true if the contact slides.
    #[inline]
    pub(crate) fn settle(&mut self, term: &Term, offset: &Vector6, point_m: DVec3) -> bool {
        let (depth_m, [first, second]) = term.at(offset);
        self.last_m = point_m;
        let [along_first, along_second] = self.tangents;
        let friction = term.friction.at([first, second]);
        self.normal_n = term.normal.at(depth_m).0;
        self.depth_m = if depth_m > 0.0 { depth_m } else { 0.0 };
        if depth_m < 0.0 && self.withheld_m > 0.0 {
            // No contact: reduce the withheld part by the gap, which needs no energy.
            self.withheld_m = (self.withheld_m + depth_m).max(0.0);
        }
        self.stretch_m = (along_first * first + along_second * second) * friction.held;
        if friction.sliding.is_some() || self.anchor_m.is_none() {
            self.fix(&term.rows, offset, point_m);
        }
        self.force = self.contact.normal * self.normal_n - self.stretch_m * self.contact.sticking_n_per_m();
        friction.sliding.is_some()
    }

    /// Places the anchor of the tangential spring so that its stretch is that of this slot.
    pub(crate) fn fix(&mut self, rows: &Rows, offset: &Vector6, point_m: DVec3) {
        let [first, second] = rows.tangents.each_ref().map(|tangent| dot(tangent, offset));
        let [along_first, along_second] = self.tangents;
        self.anchor_m = Some(point_m + along_first * first + along_second * second - self.stretch_m);
    }

    /// Takes over the springs of the contact that this one replaces: equal forces, without more energy.
    pub(crate) fn inherit(&mut self, old: &Slot) {
        let ratio = old.contact.stiffness_n_per_m / self.contact.stiffness_n_per_m;
        self.depth_m = old.depth_m * if ratio < 1.0 { ratio } else { ratio.sqrt() };
        let across = old.stretch_m - self.contact.normal * self.contact.normal.dot(old.stretch_m);
        let is_stiffer = self.contact.sticking_n_per_m() > old.contact.sticking_n_per_m();
        let share = old.contact.sticking_n_per_m() / self.contact.sticking_n_per_m();
        self.stretch_m = if is_stiffer { across * share } else { across };
        self.normal_n = old.normal_n;
        self.force = self.spring_force();
        self.anchor_m = old.anchor_m;
    }

    /// Withholds the part of a depth beyond the compression of the spring; this part fades over `ticks`.
    pub(crate) fn withhold(&mut self, whole_m: f64, ticks: f64) {
        let depth_m = whole_m - self.depth_m;
        self.withheld_m = if self.depth_m > 0.0 { depth_m } else { depth_m.max(0.0) };
        let change_m = if self.role == Role::Live { self.withheld_m.abs() } else { self.depth_m };
        self.rate_m = self.rate_m.max(change_m / ticks);
    }

    /// Returns true for an old contact whose force has faded.
    pub(crate) fn has_faded(&self) -> bool {
        self.role == Role::Fading && self.depth_m <= 0.0
    }

    /// Returns the springs along and across the normal.
    #[inline]
    pub(crate) fn springs(&self) -> [Spring; 3] {
        let [first, second] = self.tangents;
        let across = self.contact.sticking_n_per_m();
        let spring = |direction: DVec3, stiffness_n_per_m: f64| Spring {
            arm_m: self.arm_at_anchor_m,
            direction,
            stiffness_n_per_m,
        };
        let along = self.contact.stiffness_n_per_m;
        [spring(self.contact.normal, along), spring(first, across), spring(second, across)]
    }

    /// Returns the force of both springs on the tool.
    pub(crate) fn spring_force(&self) -> DVec3 {
        self.contact.normal * (self.contact.stiffness_n_per_m * self.depth_m)
            - self.stretch_m * self.contact.sticking_n_per_m()
    }

    /// Returns the energy of both springs, J.
    #[inline]
    pub(crate) fn stored_j(&self) -> f64 {
        0.5 * self.contact.stiffness_n_per_m * self.depth_m * self.depth_m
            + 0.5 * self.contact.sticking_n_per_m() * self.stretch_m.length_squared()
    }
}
