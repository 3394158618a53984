//! One step of the plant: the oscillator exactly, the remainder by a Runge-Kutta method.
//!
//! Let `s` be the displacement of the centre of mass since the start of the step, and `d` the part caused by its swing
//! about the origin, so that the origin moved by `s - d`. Then
//!
//! ```text
//! s'' = a + j t - beta s' - kappa s + n,      n = beta d' + kappa d
//! ```
//!
//! is the oscillator of `translation` plus a remainder `n` that vanishes when nothing rotates (`d = 0`) or the centre of
//! mass is at the origin. The effect of `n` is expressed as the initial displacement and velocity of an undisturbed
//! oscillator that reaches the same state: a change of variables after which only `n` is left to integrate (Lawson 1967,
//! SIAM J. Numer. Anal. 4:372). The Runge-Kutta method of `tableau` integrates these variables together with quaternion and
//! angular velocity.
//!
//! The works are integrated along with the motion. Total differentials are evaluated directly (a constant force times a
//! displacement, the hand's spring), the integral of velocity squared is exact for the oscillator (`Gramian`), and only the
//! contribution of rotation is integrated numerically, with the weights of the method.

use super::body::Body;
use super::grid::{Grid, Node};
use super::motion::{Motion, Swing};
use super::rotation;
use super::state::Wrench;
use super::tableau::{END, STAGES, TABLEAU, WEIGHTS};
use super::translation::Drive;
use crate::hand::Intention;
use crate::ledger::Work;
use flotor_hal::glam::{DQuat, DVec3};

/// Integration step of the plant: its inputs, start state and precomputed forces.
pub(super) struct Step<'a> {
    body: &'a Body,
    grid: &'a Grid,
    coils: &'a Wrench,
    intention: &'a Intention,
    start: &'a Motion,
    /// Force of coils and hand at the origin, at the start position and at rest, device frame, N.
    pull: DVec3,
    /// Stiffness of the hand times the intended velocity, N/s.
    yank: DVec3,
    /// Damping of the hand times the intended angular velocity, device frame, N·m.
    lead_nm: DVec3,
    /// Torque of coils and hand, at the start orientation and at rest, device frame, N·m.
    twist_nm: DVec3,
}

/// The unknowns of the Runge-Kutta method, or their derivatives.
#[derive(Clone, Copy)]
struct Unknowns {
    /// Initial displacement (m) and velocity (m/s) of the equivalent undisturbed oscillator.
    displacement: DVec3,
    velocity: DVec3,
    /// Orientation, flotor to device frame; of unit length only to the order of the step.
    orientation: DQuat,
    /// Angular velocity in the flotor frame, rad/s.
    spin: DVec3,
}

/// Power of coils, hand and drag caused by rotation, W.
#[derive(Clone, Copy)]
struct Power {
    coils_w: f64,
    hand_w: f64,
    drag_w: f64,
}

impl<'a> Step<'a> {
    /// Computes the constants of a step. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn new(
        body: &'a Body,
        grid: &'a Grid,
        coils: &'a Wrench,
        intention: &'a Intention,
        start: &'a Motion,
    ) -> Self {
        let hand = &body.hand;
        let pull = coils.force_n
            + intention.force_n
            + hand.stiffness_n_per_m * (intention.position_m - start.position_m)
            + hand.damping_ns_per_m * intention.velocity_m_per_s;
        let yank = hand.stiffness_n_per_m * intention.velocity_m_per_s;
        let lead_nm = intention.angular_velocity_rad_per_s * hand.rotational_damping_nms_per_rad;
        let twist_nm = coils.torque_nm + lead_nm;
        Self { body, grid, coils, intention, start, pull, yank, lead_nm, twist_nm }
    }

    /// Returns the motion at the end and the work done by the exact solution of the oscillator, for any step length; `None`
    /// if a torque rotates the flotor.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn straight(&self) -> Option<(Motion, Work)> {
        let drive = self.drive(self.start.velocity_m_per_s);
        if !self.is_balanced(&drive) {
            return None;
        }
        let Node { later, .. } = self.grid.end();
        let displacement = later.displacement(&drive);
        let motion = Motion {
            position_m: self.start.position_m + displacement,
            velocity_m_per_s: later.velocity(&drive),
            ..*self.start
        };
        Some((motion, self.work(&drive, &motion, displacement)))
    }

    /// Returns true if the flotor does not rotate during the step and no torque acts on it: none of coils or hand, and
    /// none of a force off the centre of mass.
    #[inline]
    fn is_balanced(&self, drive: &Drive) -> bool {
        let (body, start) = (self.body, self.start);
        let twisted = body.hand.rotational_stiffness_nm_per_rad != 0.0
            && start.orientation != self.intention.orientation;
        if twisted
            || axes([start.spin_rad_per_s, self.coils.torque_nm, self.intention.angular_velocity_rad_per_s])
                != 0
        {
            return false;
        }
        // Forces pass through a centre of mass that lies at the origin, or on one device axis together with the forces. (On
        // a slanted line, rounding would hide that anyhow.)
        let arm = start.turned(body.centre_of_mass_m);
        let forces = [self.still_force(), drive.velocity, drive.acceleration, drive.jerk];
        arm == DVec3::ZERO || (axes([arm]) | axes(forces)).count_ones() <= 1
    }

    /// Returns the motion at the end and the work done with rotation. Real-time: bounded, no allocation.
    #[inline(never)] // keeps the straight step, which would inline this, small
    pub(super) fn turning(&self) -> (Motion, Work) {
        let swing = Swing::new(self.start.orientation, self.start.spin_rad_per_s, self.body.centre_of_mass_m);
        let drive = self.drive(self.start.velocity_m_per_s + swing.velocity);
        let mut slopes = [Unknowns::ZERO; STAGES];
        let mut power = Power::NONE;
        for (index, stage) in TABLEAU.iter().enumerate() {
            let at = self.moved_on(&slopes, stage.along);
            let (slope, at_work) = self.slope(&drive, &swing, self.grid.node(stage.node), &at);
            power.add(&at_work, WEIGHTS[index]);
            slopes[index] = slope;
        }
        let end = self.moved_on(&slopes, &WEIGHTS);
        self.finish(&drive, &swing, &end, &power)
    }

    /// Returns the initial unknowns, advanced along each slope by a fraction of the step.
    #[inline]
    fn moved_on(&self, slopes: &[Unknowns; STAGES], shares: &[f64]) -> Unknowns {
        let mut at = Unknowns {
            orientation: self.start.orientation,
            spin: self.start.spin_rad_per_s,
            ..Unknowns::ZERO
        };
        for (slope, share) in slopes.iter().zip(shares) {
            if *share != 0.0 {
                at.add(slope, share * self.grid.step_s);
            }
        }
        at
    }

    /// Returns the drive of the oscillator for an initial velocity of the centre of mass (m/s).
    #[inline]
    fn drive(&self, velocity: DVec3) -> Drive {
        let body = self.body;
        Drive {
            velocity,
            acceleration: (self.pull + body.lift_n) * body.inverse_mass_per_kg,
            jerk: body.oscillator.stiffness_per_s2 * self.intention.velocity_m_per_s,
        }
    }

    /// Returns the force at the origin, at the start position and at rest, device frame, N. The lift, which acts at the
    /// flotor's centre of mass, is included as the force at the origin of equal torque on the body (law of the lever).
    #[inline]
    fn still_force(&self) -> DVec3 {
        self.pull - self.body.lift_n * self.body.lift_lever
    }

    /// Returns the derivatives at a stage, and the power of rotation there.
    #[inline]
    fn slope(&self, drive: &Drive, start: &Swing, node: &Node, at: &Unknowns) -> (Unknowns, Power) {
        let body = self.body;
        let Node { time_s, later, earlier } = node;
        let swing = Swing::new(at.orientation, at.spin, body.centre_of_mass_m);
        let swung = swing.arm - start.arm;
        let (undisturbed, undisturbed_velocity) = (later.displacement(drive), later.velocity(drive));
        let (disturbance, disturbance_velocity) = later.carry(&body.oscillator, at.displacement, at.velocity);
        // Displacement of the origin, minus that of the undisturbed oscillator.
        let sway = disturbance - swung;
        let moved = undisturbed + sway;
        let velocity = undisturbed_velocity + disturbance_velocity - swing.velocity;

        let force = self.still_force() + self.yank * *time_s
            - body.hand.stiffness_n_per_m * moved
            - body.damping_ns_per_m * velocity;
        let back = rotation::misalignment_rad(at.orientation, self.intention.orientation)
            * body.hand.rotational_stiffness_nm_per_rad;
        let torque = swing.attitude.transpose() * (self.twist_nm - swing.arm.cross(force)) + back
            - at.spin * body.rotational_damping_nms_per_rad;
        let remainder =
            body.oscillator.damping_per_s * swing.velocity + body.oscillator.stiffness_per_s2 * swung;
        let (displacement, velocity_at_start) = earlier.after_kick(remainder);
        let slope = Unknowns {
            displacement,
            velocity: velocity_at_start,
            orientation: rotation::quaternion_rate(at.orientation, at.spin),
            spin: rotation::angular_acceleration(&body.inertia_kg_m2, &body.inverse_inertia, at.spin, torque),
        };

        let spin2 = at.spin.length_squared();
        let velocity2 = velocity * velocity - undisturbed_velocity * undisturbed_velocity;
        let power = Power {
            coils_w: self.coils.torque_nm.dot(swing.turning),
            hand_w: self.lead_nm.dot(swing.turning) + back.dot(at.spin)
                - body.hand.rotational_damping_nms_per_rad * spin2
                - body.hand.damping_ns_per_m.dot(velocity2)
                - self.yank.dot(sway),
            drag_w: body.drag.rotational_nms_per_rad * spin2
                + body.drag.translational_ns_per_m * velocity2.element_sum(),
        };
        (slope, power)
    }

    /// Converts the final unknowns to the motion of the origin, with the works.
    #[inline]
    fn finish(&self, drive: &Drive, start: &Swing, end: &Unknowns, power: &Power) -> (Motion, Work) {
        let body = self.body;
        let orientation = end.orientation.normalize();
        let swing = Swing::new(orientation, end.spin, body.centre_of_mass_m);
        let swung = swing.arm - start.arm;
        let Node { later, .. } = self.grid.node(END);
        let (disturbance, disturbance_velocity) =
            later.carry(&body.oscillator, end.displacement, end.velocity);
        let moved = later.displacement(drive) + (disturbance - swung);
        let motion = Motion {
            position_m: self.start.position_m + moved,
            orientation,
            velocity_m_per_s: later.velocity(drive) + disturbance_velocity - swing.velocity,
            spin_rad_per_s: end.spin,
        };
        (motion, self.work_of_turning(self.work(drive, &motion, moved), moved, swung, power))
    }

    /// Returns the work of a step that displaces origin and centre of mass by `moved` (m).
    #[inline(always)] // in the middle of a tick
    fn work(&self, drive: &Drive, end: &Motion, moved: DVec3) -> Work {
        let body = self.body;
        let velocity2 = self.grid.gramian.squared_velocity(drive);
        Work {
            coils_j: self.coils.force_n.dot(moved),
            feed_forward_j: body.feed_forward_n * moved.z,
            hand_j: self.hand_work_j(drive, end, moved, velocity2),
            dissipated_j: body.drag.translational_ns_per_m * velocity2.element_sum(),
        }
    }

    /// Returns the work if the centre of mass is displaced by a further `swung` (m), with the `mean` power of rotation.
    #[inline]
    fn work_of_turning(&self, straight: Work, moved: DVec3, swung: DVec3, mean: &Power) -> Work {
        let (body, h) = (self.body, self.grid.step_s);
        // The flotor's centre of mass swings farther than the common one, in proportion to the lever.
        let lifted_m = moved.z + swung.z * (1.0 + body.lift_lever);
        Work {
            coils_j: straight.coils_j + mean.coils_w * h,
            feed_forward_j: body.feed_forward_n * lifted_m,
            hand_j: straight.hand_j + mean.hand_w * h,
            dissipated_j: straight.dissipated_j + mean.drag_w * h,
        }
    }

    /// Returns the work of the hand's force, spring, damper and mass on a translation, J.
    #[inline]
    fn hand_work_j(&self, drive: &Drive, end: &Motion, moved: DVec3, velocity2: DVec3) -> f64 {
        let (hand, h) = (&self.body.hand, self.grid.step_s);
        let displacement_integral = self.grid.end().later.displacement_integral(drive);
        let pace = self.intention.velocity_m_per_s;
        let before = self.intention.position_m - self.start.position_m;
        let after = before + pace * h - moved;
        let stretch_integral = before * h + pace * (0.5 * h * h) - displacement_integral;
        // Spring: K e x' = K e x_h' - K e e', with e the stretch; the second term is a total differential.
        let spring_j = self.yank.dot(stretch_integral)
            - 0.5 * hand.stiffness_n_per_m.dot(after * after - before * before);
        let damper_j = hand.damping_ns_per_m.dot(pace * moved - velocity2);
        let inertia_j = 0.5
            * hand.mass_kg
            * (end.velocity_m_per_s.length_squared() - self.start.velocity_m_per_s.length_squared());
        spring_j + damper_j - inertia_j + self.intention.force_n.dot(moved)
    }
}

/// Returns the axes with a nonzero component in any of the vectors, as bits.
#[inline]
fn axes<const N: usize>(vectors: [DVec3; N]) -> u32 {
    let [mut x, mut y, mut z] = [0; 3];
    for vector in vectors {
        x |= vector.x.to_bits();
        y |= vector.y.to_bits();
        z |= vector.z.to_bits();
    }
    // The shift drops the sign bit: -0 counts as zero.
    let reaches = |bits: u64| u32::from(bits << 1 != 0);
    reaches(x) | reaches(y) << 1 | reaches(z) << 2
}

impl Unknowns {
    const ZERO: Self = Self {
        displacement: DVec3::ZERO,
        velocity: DVec3::ZERO,
        orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        spin: DVec3::ZERO,
    };

    /// Adds a multiple of a slope.
    #[inline]
    fn add(&mut self, slope: &Self, time_s: f64) {
        self.displacement += slope.displacement * time_s;
        self.velocity += slope.velocity * time_s;
        self.orientation += slope.orientation * time_s;
        self.spin += slope.spin * time_s;
    }
}

impl Power {
    const NONE: Self = Self { coils_w: 0.0, hand_w: 0.0, drag_w: 0.0 };

    /// Adds a fraction of another power.
    #[inline]
    fn add(&mut self, other: &Self, share: f64) {
        self.coils_w += other.coils_w * share;
        self.hand_w += other.hand_w * share;
        self.drag_w += other.drag_w * share;
    }
}
