//! One step of the plant: the oscillator carried exactly, everything else by the classical Runge-Kutta
//! method.
//!
//! Let `s` be the displacement of the centre of mass since the start of the step, `d` that part of it that is
//! only the swing of the centre of mass about the origin, so that the origin moved by `s - d`. Then
//!
//! ```text
//! s'' = a + j t - beta s' - kappa s + n,      n = beta d' + kappa d
//! ```
//!
//! is the oscillator of `translation` plus a remainder `n` that vanishes when nothing rotates (`d = 0`) or
//! the centre of mass is at the origin. A change of variables to the constants of the oscillator's exact
//! solution leaves only `n` to integrate (Lawson 1967, SIAM J. Numer. Anal. 4:372); the Runge-Kutta method
//! integrates it together with quaternion and angular velocity. Undone, that change gives the steps below: a
//! velocity increment `h n` made at one stage reaches a later one through the oscillator's own response.
//!
//! The works are integrated along with the motion. What is a total differential is taken as such (a constant
//! force times a displacement, the hand's spring), the integral of velocity squared is exact for the
//! oscillator (`Gramian`), and only what rotation adds to that is integrated numerically, with the weights of
//! the method. Power is quadratic in the motion; its value halfway is taken from both middle stages at once,
//! as their symmetric product `P(2, 3)` instead of the mean of `P(2, 2)` and `P(3, 3)`. Both are of fourth
//! order, but for a linear motion the product errs as the method does (`y' = -y`: both lose `z^5 / 60`), so
//! that the energy books close one order better than either.

use super::body::Body;
use super::motion::{Contact, Motion, Swing};
use super::scheme::Grid;
use super::translation::Drive;
use super::{Wrench, rotation};
use crate::ledger::Work;
use flotor_hal::glam::{DQuat, DVec3};

/// Weight of the outer slopes in the classical Runge-Kutta method.
const SIXTH: f64 = 1.0 / 6.0;

/// One step: everything that is fixed during it.
pub(super) struct Step<'a> {
    body: &'a Body,
    grid: &'a Grid,
    coils: &'a Wrench,
    contact: &'a Contact,
    start: &'a Motion,
    swing: Swing,
    /// What drives the oscillator.
    drive: Drive,
    /// Force at the origin while nothing has moved and nothing moves, device frame, N. The lift, which acts
    /// at the flotor's centre of mass, is in it as the force at the origin that turns the body just as much
    /// (law of the lever).
    still_force: DVec3,
    /// Stiffness of the hand times the pace of its intention, N/s.
    yank: DVec3,
}

/// The unknowns at one stage.
#[derive(Clone, Copy)]
struct Stage {
    /// Time since the start of the step, s.
    time_s: f64,
    /// Displacement of the centre of mass and what it would be by the oscillator alone, m.
    displacement: DVec3,
    oscillator_displacement: DVec3,
    /// Velocity of the centre of mass and what it would be by the oscillator alone, m/s.
    velocity: DVec3,
    oscillator_velocity: DVec3,
    /// Flotor to device frame, of unit length only to the order of the step.
    orientation: DQuat,
    /// Angular velocity in the flotor frame, rad/s.
    spin: DVec3,
}

/// Derivatives at one stage, and what is at work there.
#[derive(Clone, Copy)]
struct Slope {
    /// Remainder `n`, m/s².
    kick: DVec3,
    orientation: DQuat,
    spin: DVec3,
    flow: Flow,
}

/// The velocities and forces at one stage that do work.
#[derive(Clone, Copy)]
struct Flow {
    /// Velocity of the origin and what it would be by the oscillator alone, m/s.
    velocity: DVec3,
    oscillator_velocity: DVec3,
    /// Displacement of the origin less that of the oscillator, m.
    sway: DVec3,
    /// Angular velocity in the flotor frame, rad/s.
    spin: DVec3,
    /// Torque of the hand's rotational spring in the flotor frame, N·m.
    hand_torque: DVec3,
    /// Power of the coils' torque, W.
    coils_w: f64,
}

/// What rotation adds to the power of coils, hand and drag, W.
#[derive(Clone, Copy)]
struct Power {
    coils_w: f64,
    hand_w: f64,
    drag_w: f64,
}

impl<'a> Step<'a> {
    /// Prepares a step. Real-time: bounded, no allocation.
    pub(super) fn new(
        body: &'a Body,
        grid: &'a Grid,
        coils: &'a Wrench,
        contact: &'a Contact,
        start: &'a Motion,
    ) -> Self {
        let swing = Swing::new(start.orientation, start.spin_rad_per_s, body.centre_of_mass_m);
        let hand = &body.hand;
        let pull = coils.force_n
            + hand.stiffness_n_per_m * (contact.intended_m - start.position_m)
            + hand.damping_ns_per_m * contact.pace_m_per_s;
        let drive = Drive {
            velocity: start.velocity_m_per_s + swing.velocity,
            acceleration: (pull + body.lift_n) * body.inverse_mass_per_kg,
            jerk: body.oscillator.stiffness_per_s2 * contact.pace_m_per_s,
        };
        let still_force = pull - body.lift_n * body.lift_lever;
        let yank = hand.stiffness_n_per_m * contact.pace_m_per_s;
        Self { body, grid, coils, contact, start, swing, drive, still_force, yank }
    }

    /// The motion at the end and the work done if nothing turns the flotor at the start, halfway and at the
    /// end (where the Runge-Kutta method would look): the oscillator's motion, exact however long the step.
    ///
    /// Real-time: bounded, no allocation.
    pub(super) fn straight(&self) -> Option<(Motion, Work)> {
        if self.start.spin_rad_per_s != DVec3::ZERO {
            return None;
        }
        let Grid { step_s: h, half, full, .. } = self.grid;
        let (displacement, velocity) = (full.displacement(&self.drive), full.velocity(&self.drive));
        let balanced = self.is_balanced(0.0, DVec3::ZERO, self.drive.velocity)
            && self.is_balanced(0.5 * h, half.displacement(&self.drive), half.velocity(&self.drive))
            && self.is_balanced(*h, displacement, velocity);
        balanced.then(|| {
            let motion = Motion {
                position_m: self.start.position_m + displacement,
                velocity_m_per_s: velocity,
                ..*self.start
            };
            (motion, self.work(&motion, displacement, DVec3::ZERO, &Power::NONE))
        })
    }

    /// True if no torque acts on the flotor at this displacement and velocity of the origin, without
    /// rotation.
    #[inline]
    fn is_balanced(&self, time_s: f64, moved: DVec3, velocity: DVec3) -> bool {
        let back = self.hand_spring_torque(self.start.orientation);
        let torque =
            self.coils.torque_nm - self.swing.arm.cross(self.force_at_origin(time_s, moved, velocity));
        torque == DVec3::ZERO && back == DVec3::ZERO
    }

    /// The motion at the end and the work done, whatever turns. Real-time: bounded, no allocation.
    pub(super) fn turning(&self) -> (Motion, Work) {
        let Grid { step_s: h, half, full, .. } = self.grid;
        let at_start = self.along_oscillator(0.0, DVec3::ZERO, self.drive.velocity);
        let k1 = self.slope(&at_start, &self.swing);
        let halfway =
            self.along_oscillator(0.5 * h, half.displacement(&self.drive), half.velocity(&self.drive));
        let k2 = self.slope_at(halfway.kicked(half.after_kick(k1.kick * (0.5 * h))).turned(&k1, 0.5 * h));
        let k3 = self.slope_at(halfway.kicked((DVec3::ZERO, k2.kick * (0.5 * h))).turned(&k2, 0.5 * h));
        let at_end = self.along_oscillator(*h, full.displacement(&self.drive), full.velocity(&self.drive));
        let k4 = self.slope_at(at_end.kicked(half.after_kick(k3.kick * *h)).turned(&k3, *h));

        let end = at_end
            .kicked(full.after_kick(k1.kick * (h * SIXTH)))
            .kicked(half.after_kick((k2.kick + k3.kick) * (2.0 * h * SIXTH)))
            .kicked((DVec3::ZERO, k4.kick * (h * SIXTH)))
            .turned(&k1, h * SIXTH)
            .turned(&k2, 2.0 * h * SIXTH)
            .turned(&k3, 2.0 * h * SIXTH)
            .turned(&k4, h * SIXTH);
        let mean = Power::mean(
            &self.power(&k1.flow, &k1.flow),
            &self.power(&k2.flow, &k3.flow),
            &self.power(&k4.flow, &k4.flow),
        );
        self.finish(&end, &mean)
    }

    /// A stage at which translation is where the oscillator alone would bring it, and rotation as at the
    /// start.
    #[inline]
    fn along_oscillator(&self, time_s: f64, displacement: DVec3, velocity: DVec3) -> Stage {
        Stage {
            time_s,
            displacement,
            oscillator_displacement: displacement,
            velocity,
            oscillator_velocity: velocity,
            orientation: self.start.orientation,
            spin: self.start.spin_rad_per_s,
        }
    }

    #[inline]
    fn slope_at(&self, stage: Stage) -> Slope {
        self.slope(&stage, &Swing::new(stage.orientation, stage.spin, self.body.centre_of_mass_m))
    }

    /// Derivatives at a stage.
    #[inline]
    fn slope(&self, stage: &Stage, swing: &Swing) -> Slope {
        let body = self.body;
        let swung = swing.arm - self.swing.arm;
        let moved = stage.displacement - swung;
        let velocity = stage.velocity - swing.velocity;

        let force = self.force_at_origin(stage.time_s, moved, velocity);
        let back = self.hand_spring_torque(stage.orientation);
        let torque = swing.attitude.transpose() * (self.coils.torque_nm - swing.arm.cross(force)) + back
            - stage.spin * body.rotational_damping_nms_per_rad;

        Slope {
            kick: body.oscillator.damping_per_s * swing.velocity + body.oscillator.stiffness_per_s2 * swung,
            orientation: rotation::quaternion_rate(stage.orientation, stage.spin),
            spin: rotation::angular_acceleration(
                &body.inertia_kg_m2,
                &body.inverse_inertia,
                stage.spin,
                torque,
            ),
            flow: Flow {
                velocity,
                oscillator_velocity: stage.oscillator_velocity,
                sway: moved - stage.oscillator_displacement,
                spin: stage.spin,
                hand_torque: back,
                coils_w: self.coils.torque_nm.dot(swing.turning),
            },
        }
    }

    /// Force at the origin (see [`Self::still_force`]) after a displacement of the origin, N.
    #[inline]
    fn force_at_origin(&self, time_s: f64, moved: DVec3, velocity: DVec3) -> DVec3 {
        self.still_force + self.yank * time_s
            - self.body.hand.stiffness_n_per_m * moved
            - self.body.damping_ns_per_m * velocity
    }

    /// Torque of the hand's rotational spring, flotor frame, N·m.
    #[inline]
    fn hand_spring_torque(&self, orientation: DQuat) -> DVec3 {
        rotation::misalignment_rad(orientation, self.contact.intended_orientation)
            * self.body.hand.rotational_stiffness_nm_per_rad
    }

    /// Symmetric product of two flows: the power of one if both are the same.
    #[inline]
    fn power(&self, a: &Flow, b: &Flow) -> Power {
        let (hand, drag) = (&self.body.hand, &self.body.drag);
        let velocity2 = a.velocity * b.velocity - a.oscillator_velocity * b.oscillator_velocity;
        let spin2 = a.spin.dot(b.spin);
        Power {
            coils_w: 0.5 * (a.coils_w + b.coils_w),
            hand_w: 0.5 * (a.hand_torque.dot(b.spin) + b.hand_torque.dot(a.spin))
                - hand.rotational_damping_nms_per_rad * spin2
                - hand.damping_ns_per_m.dot(velocity2)
                - 0.5 * self.yank.dot(a.sway + b.sway),
            drag_w: drag.rotational_nms_per_rad * spin2
                + drag.translational_ns_per_m * velocity2.element_sum(),
        }
    }

    /// From the unknowns at the end back to the motion of the origin, with the works.
    #[inline]
    fn finish(&self, end: &Stage, mean: &Power) -> (Motion, Work) {
        let orientation = end.orientation.normalize();
        let swing = Swing::new(orientation, end.spin, self.body.centre_of_mass_m);
        let swung = swing.arm - self.swing.arm;
        let moved = end.displacement - swung;
        let motion = Motion {
            position_m: self.start.position_m + moved,
            orientation,
            velocity_m_per_s: end.velocity - swing.velocity,
            spin_rad_per_s: end.spin,
        };
        (motion, self.work(&motion, moved, swung, mean))
    }

    /// Work of a step in which the origin was displaced by `moved` and the centre of mass by `swung` more, m.
    #[inline]
    fn work(&self, end: &Motion, moved: DVec3, swung: DVec3, mean: &Power) -> Work {
        let (body, hand, h) = (self.body, &self.body.hand, self.grid.step_s);
        // Of the oscillator alone; what rotation adds is in `mean`.
        let velocity2 = self.grid.gramian.squared_velocity(&self.drive);
        let displacement_integral = self.grid.full.displacement_integral(&self.drive);

        let pace = self.contact.pace_m_per_s;
        let before = self.contact.intended_m - self.start.position_m;
        let after = before + pace * h - moved;
        let stretch_integral = before * h + pace * (0.5 * h * h) - displacement_integral;
        // Spring: K e x' = K e x_h' - K e e', with e the stretch; the second part is a total differential.
        let spring_j = self.yank.dot(stretch_integral)
            - 0.5 * hand.stiffness_n_per_m.dot(after * after - before * before);
        let damper_j = hand.damping_ns_per_m.dot(pace * moved - velocity2);
        let inertia_j = 0.5
            * hand.mass_kg
            * (end.velocity_m_per_s.length_squared() - self.start.velocity_m_per_s.length_squared());
        // The flotor's centre of mass swings farther than the common one, in proportion.
        let lifted_m = moved.z + swung.z * (1.0 + body.lift_lever);
        Work {
            coils_j: self.coils.force_n.dot(moved) + mean.coils_w * h,
            feed_forward_j: body.feed_forward_n * lifted_m,
            hand_j: spring_j + damper_j - inertia_j + mean.hand_w * h,
            dissipated_j: body.drag.translational_ns_per_m * velocity2.element_sum() + mean.drag_w * h,
        }
    }
}

impl Stage {
    /// With the traces (displacement, velocity) of an earlier velocity increment added.
    #[inline]
    fn kicked(self, (displacement, velocity): (DVec3, DVec3)) -> Self {
        Self { displacement: self.displacement + displacement, velocity: self.velocity + velocity, ..self }
    }

    /// Turned on for `time_s` with the rates of a slope.
    #[inline]
    fn turned(self, slope: &Slope, time_s: f64) -> Self {
        Self {
            orientation: self.orientation + slope.orientation * time_s,
            spin: self.spin + slope.spin * time_s,
            ..self
        }
    }
}

impl Power {
    const NONE: Self = Self { coils_w: 0.0, hand_w: 0.0, drag_w: 0.0 };

    /// Mean over a step from start, middle and end: 1, 4, 1 sixths.
    #[inline]
    fn mean(start: &Self, middle: &Self, end: &Self) -> Self {
        let mean = |start: f64, middle: f64, end: f64| (start + 4.0 * middle + end) * SIXTH;
        Self {
            coils_w: mean(start.coils_w, middle.coils_w, end.coils_w),
            hand_w: mean(start.hand_w, middle.hand_w, end.hand_w),
            drag_w: mean(start.drag_w, middle.drag_w, end.drag_w),
        }
    }
}
