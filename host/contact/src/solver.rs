//! Wrench of a contact set in every tick: friction from tick to tick, and the change from a set to the next.

use crate::cap::{OffsetSpace, sticks};
use crate::contact::{Contact, ContactSet, MAX_CONTACTS, are_usable, is_usable_pose};
use crate::coupling::{Coupling, Limits, NotPositive, check};
use crate::law::{FrictionLaw, NormalLaw};
use crate::linear::{Vector6, dot};
use crate::newton::{MAX_STEPS, Minimum, Rows, Term, minimize};
use flotor_hal::{DVec3, Pose, Twist, Wrench};

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The wrench is that of the minimum, to rounding.
    Solved,
    /// The iterations ended before the minimum: the wrench is that of the best iterate. Normal forces still only push.
    BestIterate,
    /// Pose, twist or age were not finite: no wrench, and the friction is that of the tick before.
    InvalidInput,
}

/// Answer of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Wrench on the hand at the handle, scene frame, within the limits.
    pub wrench: Wrench,
    /// How the solve ended.
    pub outcome: Outcome,
    /// Number of Newton steps.
    pub steps: u32,
    /// True if the limits have shortened the wrench.
    pub is_limited: bool,
    /// True if pose and age are within the set's range of validity.
    pub is_in_range: bool,
}

/// State of the friction of a contact.
#[derive(Clone, Copy, Debug, Default)]
struct Grip {
    /// Point of the surface to which the tangential spring is fixed; none before the first solve.
    anchor_m: Option<DVec3>,
    /// Stretch of the tangential spring after the last solve.
    stretch_m: DVec3,
    /// Normal force in the last solve.
    normal_n: f64,
}

/// A contact as a solve needs it.
#[derive(Clone, Copy, Debug)]
struct Prepared {
    tool_point_m: DVec3,
    normal: DVec3,
    tangents: [DVec3; 2],
    /// Gap of a point of the tool at the origin of the scene.
    gap_at_origin_m: f64,
    surface_velocity_m_per_s: DVec3,
    stiffness_n_per_m: f64,
    /// 0 without friction.
    tangential_stiffness_n_per_m: f64,
    /// Damping over the period.
    damping_n_per_m: f64,
    friction: f64,
}

impl Prepared {
    const NONE: Self = Self {
        tool_point_m: DVec3::ZERO,
        normal: DVec3::Z,
        tangents: [DVec3::X, DVec3::Y],
        gap_at_origin_m: 0.0,
        surface_velocity_m_per_s: DVec3::ZERO,
        stiffness_n_per_m: 1.0,
        tangential_stiffness_n_per_m: 0.0,
        damping_n_per_m: 0.0,
        friction: 0.0,
    };
}

/// Contact set behind a coupling, with its friction.
pub struct Solver {
    coupling: Coupling,
    limits: Limits,
    period_s: f64,
    set: ContactSet,
    space: OffsetSpace,
    contacts: [Prepared; MAX_CONTACTS],
    rows: [Rows; MAX_CONTACTS],
    terms: [Term; MAX_CONTACTS],
    grips: [Grip; MAX_CONTACTS],
    /// Coordinates of the offset of the last solve.
    offset: Vector6,
    /// Force and torque of the last solve, before the limits.
    load: Wrench,
    last_pose: Pose,
    /// Age of the set in the last solve; none before the first with this set.
    last_age_s: Option<f64>,
}

impl Solver {
    /// Creates a solver without contacts; `period_s` is the time between solves. Not real-time.
    ///
    /// # Errors
    /// If the period is not above 0.
    pub fn new(coupling: Coupling, limits: Limits, period_s: f64) -> Result<Self, NotPositive> {
        check("period_s", period_s)?;
        Ok(Self {
            coupling,
            limits,
            period_s,
            set: ContactSet::empty(),
            space: OffsetSpace::RIGID,
            contacts: [Prepared::NONE; MAX_CONTACTS],
            rows: [Rows::ZERO; MAX_CONTACTS],
            terms: [Term::NONE; MAX_CONTACTS],
            grips: [Grip::default(); MAX_CONTACTS],
            offset: [0.0; 6],
            load: Wrench::ZERO,
            last_pose: Pose::HOME,
            last_age_s: None,
        })
    }

    /// Returns the set in use. Real-time: bounded, no allocation.
    #[must_use]
    pub fn set(&self) -> &ContactSet {
        &self.set
    }

    /// Returns the largest ratio of the set's stiffness, all contacts touching, to the coupling's; at least 1. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn excess(&self) -> f64 {
        self.space.excess()
    }

    /// Returns the normal forces of the last solve, N, in the order of the set. Real-time: bounded, no allocation.
    pub fn normal_forces_n(&self) -> impl Iterator<Item = f64> {
        self.grips.iter().take(self.set.contacts().len()).map(|grip| grip.normal_n)
    }

    /// Replaces the set. A contact takes over the friction of the closest one of the last set. Real-time: bounded, no allocation.
    pub fn replace(&mut self, set: &ContactSet) {
        let mut old = Old { contacts: self.contacts, grips: self.grips, count: self.set.contacts().len() };
        self.set = *set;
        self.space = OffsetSpace::new(set, &self.coupling);
        self.offset = self.space.coordinates(self.load.force(), self.load.torque());
        self.last_age_s = None;
        let slots = self.contacts.iter_mut().zip(&mut self.rows).zip(&mut self.grips);
        for (((prepared, rows), grip), contact) in slots.zip(set.contacts()) {
            *prepared = Prepared::new(contact, set.anchor(), self.period_s);
            *rows = prepared.rows(set.anchor(), &self.space);
            *grip = old.take_closest(prepared).map_or(Grip::default(), |(stiffness_n_per_m, grip)| {
                let point_m =
                    self.last_pose.position() + self.last_pose.orientation() * prepared.tool_point_m;
                let tool_m = prepared.with_offset(point_m, rows, &self.offset);
                grip.moved(prepared, stiffness_n_per_m, tool_m)
            });
        }
    }

    /// Returns the wrench at a pose and twist of the handle; `age_s` is the time since the set was published. Real-time: bounded,
    /// no allocation.
    pub fn solve(&mut self, pose: &Pose, twist: &Twist, age_s: f64) -> Solution {
        let is_usable = is_usable_pose(pose)
            && are_usable(&twist.linear_m_per_s)
            && are_usable(&twist.angular_rad_per_s)
            && are_usable(&[age_s]);
        if !is_usable {
            return Solution {
                wrench: Wrench::ZERO,
                outcome: Outcome::InvalidInput,
                steps: 0,
                is_limited: false,
                is_in_range: false,
            };
        }
        let elapsed_s = self.last_age_s.map_or(self.period_s, |last_s| (age_s - last_s).max(0.0));
        self.last_age_s = Some(age_s);
        self.last_pose = *pose;
        let count = self.set.contacts().len();
        let tick = Tick { pose, twist, age_s, elapsed_s, period_s: self.period_s };
        let is_rigid = self.space.is_rigid();
        for ((term, contact), grip) in
            self.terms.iter_mut().zip(&self.contacts).zip(&mut self.grips).take(count)
        {
            *term = tick.term(contact, grip);
            // Without an offset the normal force of this tick is known before the friction; else that of the last solve is used.
            let normal_n = if is_rigid { term.normal.at(term.depth_m).0 } else { grip.normal_n };
            term.friction.limit_n = contact.friction * normal_n;
        }
        let minimum = if is_rigid {
            Minimum { offset: [0.0; 6], outcome: Outcome::Solved, steps: 0 }
        } else {
            let (rows, terms) = (self.rows.get(..count), self.terms.get(..count));
            minimize(rows.unwrap_or_default(), terms.unwrap_or_default(), &self.offset, MAX_STEPS)
        };
        self.offset = minimum.offset;
        self.load = Wrench::ZERO;
        let slots = self.contacts.iter().zip(&self.rows).zip(&self.terms).zip(&mut self.grips);
        for (((contact, rows), term), grip) in slots.take(count) {
            let arm_m = pose.orientation() * contact.tool_point_m;
            let tool_m = contact.with_offset(pose.position() + arm_m, rows, &self.offset);
            let force = grip.slip(contact, term, rows, &self.offset, tool_m);
            self.load = self.load + Wrench::new(force, arm_m.cross(force));
        }
        let wrench = self.limits.limit(self.load);
        Solution {
            wrench,
            outcome: minimum.outcome,
            steps: minimum.steps,
            is_limited: wrench != self.load,
            is_in_range: self.set.is_valid_at(pose, age_s),
        }
    }
}

/// Pose, twist and times of a solve.
struct Tick<'a> {
    pose: &'a Pose,
    twist: &'a Twist,
    age_s: f64,
    elapsed_s: f64,
    period_s: f64,
}

impl Tick<'_> {
    /// Returns the contact at the pose of the handle, still without a limit of friction.
    #[inline]
    fn term(&self, contact: &Prepared, grip: &mut Grip) -> Term {
        let arm_m = self.pose.orientation() * contact.tool_point_m;
        let point_m = self.pose.position() + arm_m;
        let velocity = self.twist.linear() + self.twist.angular().cross(arm_m);
        let surface_velocity = contact.surface_velocity_m_per_s;
        let approach_m_per_s = contact.normal.dot(surface_velocity - velocity);
        let travel_m = contact.normal.dot(surface_velocity) * self.age_s;
        let gap_m = contact.gap_at_origin_m + contact.normal.dot(point_m) - travel_m;
        let anchor_m = grip.anchor_m.map_or(point_m, |anchor_m| anchor_m + surface_velocity * self.elapsed_s);
        grip.anchor_m = Some(anchor_m);
        let approach_m = approach_m_per_s * self.period_s;
        Term {
            depth_m: -gap_m,
            stretch_m: contact.tangents.map(|tangent| tangent.dot(point_m - anchor_m)),
            normal: NormalLaw::new(contact.stiffness_n_per_m, contact.damping_n_per_m, approach_m),
            friction: FrictionLaw { stiffness_n_per_m: contact.tangential_stiffness_n_per_m, limit_n: 0.0 },
        }
    }
}

impl Prepared {
    fn new(contact: &Contact, anchor: &Pose, period_s: f64) -> Self {
        let at_anchor_m = anchor.position() + anchor.orientation() * contact.tool_point_m;
        let tangents = contact.normal.any_orthonormal_pair();
        Self {
            tool_point_m: contact.tool_point_m,
            normal: contact.normal,
            tangents: [tangents.0, tangents.1],
            gap_at_origin_m: contact.gap_m - contact.normal.dot(at_anchor_m),
            surface_velocity_m_per_s: contact.surface_velocity_m_per_s,
            stiffness_n_per_m: contact.stiffness_n_per_m,
            tangential_stiffness_n_per_m: if sticks(contact) {
                contact.tangential_stiffness_n_per_m
            } else {
                0.0
            },
            damping_n_per_m: contact.damping_ns_per_m / period_s,
            friction: contact.friction,
        }
    }

    /// Returns the derivatives by the coordinates of the offset, with the arm that the tool has at the anchor: so the energy
    /// depends on the pose through the gaps alone, and the wrench is its gradient.
    fn rows(&self, anchor: &Pose, space: &OffsetSpace) -> Rows {
        let arm = anchor.orientation() * self.tool_point_m;
        let row = |direction: DVec3| space.coordinates(direction, arm.cross(direction));
        Rows { normal: row(self.normal), tangents: self.tangents.map(row) }
    }

    /// Returns the place of a point of the tool whose place without the offset is `point_m`, as far as it is tangential.
    fn with_offset(&self, point_m: DVec3, rows: &Rows, offset: &Vector6) -> DVec3 {
        let [first, second] = rows.tangents.each_ref().map(|tangent| dot(tangent, offset));
        let [along_first, along_second] = self.tangents;
        point_m + along_first * first + along_second * second
    }
}

impl Grip {
    /// Returns the force on the tool, and moves the anchor as far as the contact slides: the stretch that is left has no more
    /// energy than before.
    #[inline]
    fn slip(
        &mut self,
        contact: &Prepared,
        term: &Term,
        rows: &Rows,
        offset: &Vector6,
        tool_m: DVec3,
    ) -> DVec3 {
        let (depth_m, [first, second]) = term.at(rows, offset);
        let [along_first, along_second] = contact.tangents;
        let friction = term.friction.at([first, second]);
        self.normal_n = term.normal.at(depth_m).0;
        self.stretch_m = (along_first * first + along_second * second) * friction.held;
        if friction.sliding.is_some() {
            self.anchor_m = Some(tool_m - self.stretch_m);
        }
        contact.normal * self.normal_n - self.stretch_m * contact.tangential_stiffness_n_per_m
    }

    /// Returns the friction of a contact that takes the place of another: the same force, but no more energy.
    fn moved(&self, contact: &Prepared, stiffness_n_per_m: f64, tool_m: DVec3) -> Self {
        let across = self.stretch_m - contact.normal * contact.normal.dot(self.stretch_m);
        let is_stiffer = contact.tangential_stiffness_n_per_m > stiffness_n_per_m;
        let factor = if is_stiffer { stiffness_n_per_m / contact.tangential_stiffness_n_per_m } else { 1.0 };
        let stretch_m = across * factor;
        Self { anchor_m: self.anchor_m.map(|_| tool_m - stretch_m), stretch_m, normal_n: self.normal_n }
    }
}

/// Contacts of the set before.
struct Old {
    contacts: [Prepared; MAX_CONTACTS],
    grips: [Grip; MAX_CONTACTS],
    count: usize,
}

/// Farthest point of the tool, m, and smallest cosine between normals, at which two contacts count as one.
const SAME_POINT_M: f64 = 0.01;
const SAME_NORMAL: f64 = 0.7;

impl Old {
    /// Returns tangential stiffness and friction of the closest contact, each only once.
    fn take_closest(&mut self, contact: &Prepared) -> Option<(f64, Grip)> {
        let mut least = 1.0;
        let mut closest = None;
        for (old, grip) in self.contacts.iter().zip(&mut self.grips).take(self.count) {
            let cosine = old.normal.dot(contact.normal);
            let distance = (old.tool_point_m - contact.tool_point_m) / SAME_POINT_M;
            let difference = distance.length_squared() + (1.0 - cosine);
            if grip.anchor_m.is_some() && cosine >= SAME_NORMAL && difference < least {
                least = difference;
                closest = Some((old.tangential_stiffness_n_per_m, grip));
            }
        }
        closest.map(|(stiffness_n_per_m, grip)| (stiffness_n_per_m, std::mem::take(grip)))
    }
}
