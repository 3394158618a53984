//! Random sets of contacts, and a slow generic solver of the same problem.
#![allow(dead_code)] // each test uses a part

pub(crate) mod reference;

use flotor_contact::{Contact, ContactSet, Coupling, Limits, Validity};
use flotor_core::Random;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{MAX_CONTACTS, Pose, Twist};

pub(crate) const PERIOD_S: f64 = 1.0e-3;

/// The number of cases for the size of this run (`FLOTOR_TEST_SIZE`).
pub(crate) fn cases(quick: usize, full: usize) -> usize {
    if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { full } else { quick }
}

/// Limits that no case reaches.
pub(crate) fn unlimited() -> Limits {
    Limits::new(f64::INFINITY, f64::INFINITY).expect("above 0")
}

/// Contact of a tool's origin with the plane z = 0, 1 kN/m, at a gap.
pub(crate) fn floor(gap_m: f64) -> Contact {
    Contact {
        tool_point_m: DVec3::ZERO,
        surface_point_m: DVec3::ZERO,
        normal: DVec3::Z,
        gap_m,
        surface_velocity_m_per_s: DVec3::ZERO,
        stiffness_n_per_m: 1000.0,
        tangential_stiffness_n_per_m: 0.0,
        damping_ns_per_m: 0.0,
        friction: 0.0,
    }
}

/// Set of contacts with the gaps that their points have at the anchor.
pub(crate) fn set(anchor: &Pose, contacts: &[Contact]) -> ContactSet {
    let consistent: Vec<_> = contacts.iter().map(|contact| with_gap(anchor, contact)).collect();
    ContactSet::new(anchor, &consistent, Validity::UNLIMITED).expect("the set is consistent")
}

fn with_gap(anchor: &Pose, contact: &Contact) -> Contact {
    let point = anchor.position() + anchor.orientation() * contact.tool_point_m;
    Contact { gap_m: contact.normal.dot(point - contact.surface_point_m), ..*contact }
}

/// Pose without rotation.
pub(crate) fn at(position_m: DVec3) -> Pose {
    Pose::new(position_m, DQuat::IDENTITY)
}

/// Number between two bounds, uniform in its logarithm.
pub(crate) fn logarithmic(random: &mut Random, from: f64, to: f64) -> f64 {
    from * (to / from).powf(random.unit())
}

pub(crate) fn small_turn(random: &mut Random, rad: f64) -> DQuat {
    let half = random.vector() * (0.5 * rad);
    DQuat::from_xyzw(half.x, half.y, half.z, 1.0).normalize()
}

/// One random problem: a coupling, a set and the ticks with it.
pub(crate) struct Case {
    pub(crate) coupling: Coupling,
    /// Stiffnesses of the coupling, N/m and N·m/rad.
    pub(crate) stiffness: [f64; 2],
    pub(crate) anchor: Pose,
    pub(crate) contacts: Vec<Contact>,
    pub(crate) ticks: Vec<(Pose, Twist, f64)>,
}

impl Case {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Random::new(49, seed);
        let random = &mut random;
        let stiffness = match random.bits() % 8 {
            0 => [f64::INFINITY; 2],
            1 => [logarithmic(random, 500.0, 2.0e4), f64::INFINITY],
            _ => [logarithmic(random, 500.0, 2.0e4), logarithmic(random, 0.3, 50.0)],
        };
        let coupling = Coupling::new(stiffness[0], stiffness[1]).expect("above 0");
        let turn = small_turn(random, 1.0);
        let anchor = Pose::new(random.vector() * 0.02, turn);
        let contacts = contacts(random, &anchor);
        let (mut pose, mut ticks) = (anchor, Vec::new());
        for tick in 0..4_u32 {
            let linear = random.vector() * 0.2;
            let angular = random.vector() * 2.0;
            ticks.push((pose, Twist::new(linear, angular), f64::from(tick) * PERIOD_S));
            let step = DQuat::from_xyzw(0.5e-3 * angular.x, 0.5e-3 * angular.y, 0.5e-3 * angular.z, 1.0);
            pose = Pose::new(pose.position() + linear * PERIOD_S, step.normalize() * pose.orientation());
        }
        Self { coupling, stiffness, anchor, contacts, ticks }
    }

    pub(crate) fn set(&self) -> ContactSet {
        ContactSet::new(&self.anchor, &self.contacts, Validity::UNLIMITED).expect("the case is consistent")
    }
}

/// 0 to 16 contacts, some of them equal, opposed or the sides of a wedge.
pub(crate) fn contacts(random: &mut Random, anchor: &Pose) -> Vec<Contact> {
    let count = usize::try_from(random.bits() % 17).expect("small");
    let shape = random.bits() % 4;
    let (softest, stiffest) = if random.bits().is_multiple_of(4) { (2.0e4, 2.0e5) } else { (100.0, 2.0e4) };
    let mut contacts: Vec<Contact> = Vec::new();
    let (edge, first) = (random.direction(), random.direction());
    while contacts.len() < count.min(MAX_CONTACTS) {
        let normal = match shape {
            // All in one half-space, as of a convex body on a surface.
            0 => (first + random.vector() * 0.3).normalize(),
            // Opposed.
            1 => contacts.last().map_or(first, |last| -last.normal),
            // Wedge: all across one edge.
            2 => random.direction().reject_from_normalized(edge).normalize(),
            _ => random.direction(),
        };
        if let (Some(last), 0) = (contacts.last().copied(), random.bits() % 6) {
            contacts.push(last); // redundant
            continue;
        }
        let tool_point_m = random.vector() * 0.03;
        let gap_m = 1.0e-3 * (random.unit() * 3.0 - 2.0);
        let across = random.vector().reject_from_normalized(normal) * 1.0e-3;
        let point = anchor.position() + anchor.orientation() * tool_point_m;
        let contact = Contact {
            tool_point_m,
            surface_point_m: point - normal * gap_m + across,
            normal,
            gap_m,
            surface_velocity_m_per_s: if random.bits().is_multiple_of(3) {
                random.vector() * 0.1
            } else {
                DVec3::ZERO
            },
            stiffness_n_per_m: logarithmic(random, softest, stiffest),
            tangential_stiffness_n_per_m: logarithmic(random, softest, stiffest),
            damping_ns_per_m: if random.bits().is_multiple_of(2) { random.unit() * 5.0 } else { 0.0 },
            friction: if random.bits().is_multiple_of(3) { 0.0 } else { random.unit() * 1.5 },
        };
        contacts.push(contact);
    }
    contacts
}
