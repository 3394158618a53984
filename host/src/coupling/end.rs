//! One end of a coupling: pulls its handle to where the partner was when last heard of.

use super::{CouplingConfig, PassivityMode, Pull, Tank};
use crate::mapping::{Mapping, MappingConfig};
use crate::port_energy::{Controller, Expected, PortObserver};
use flotor_hal::{DVec3, DeviceState, Pose, Twist, Wrench, rotation_vector};

/// What one end tells the other in every tick, in the shared frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct News {
    /// Where the handle is, m and unit quaternion.
    pub pose: Pose,
    /// How it moves, m/s and rad/s.
    pub twist: Twist,
    /// All the energy this end has ever passed on to the other, J.
    pub told_j: f64,
}

/// Energy that is never counted on, J: what a surprise of 20 µm costs at 1 N. With it in hand, a hand that starts faster
/// than expected does not overdraw the account.
const KEPT_BACK_J: f64 = 2.0e-5;

/// One end.
pub struct End {
    config: CouplingConfig,
    mapping: Mapping,
    observer: PortObserver,
    controller: Controller,
    calm: Calm,
    tank: Tank,
    partner: Option<News>,
}

impl End {
    /// An end at rest that has not heard of its partner; until it has, it asks for nothing. Not real-time.
    ///
    /// `mapping` leads from the device's frame to the shared one; `period_s` is the time between ticks.
    #[must_use]
    pub fn new(config: &CouplingConfig, mapping: &MappingConfig, period_s: f64) -> Self {
        let mapping = Mapping::new(mapping);
        // The damping of the coupling, as the hand feels it: what the pair is built to stand.
        let controller = Controller {
            damping_ns_per_m: config.damping_ns_per_m * mapping.stiffness_scale(),
            damping_nms_per_rad: config.damping_nms_per_rad * mapping.energy_scale(),
            period_s,
        };
        Self {
            config: *config,
            mapping,
            observer: PortObserver::default(),
            controller,
            calm: Calm::new(period_s),
            tank: Tank::default(),
            partner: None,
        }
    }

    /// Books what has crossed the port since the last tick, while `held` was applied (both in the device frame).
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn observe(&mut self, state: &DeviceState, held: &Wrench) {
        let gone_in_j = self.observer.gone_in_j(&state.pose, held);
        self.tank.book(gone_in_j / self.mapping.energy_scale());
        self.calm.follow(&state.twist);
    }

    /// What the partner is to know, with a part of the energy that is here. Once a tick. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub fn tell(&mut self, state: &DeviceState) -> News {
        News {
            pose: self.mapping.pose_to_model(&state.pose),
            twist: self.mapping.twist_to_model(&state.twist),
            told_j: self.tank.pass_on(),
        }
    }

    /// Takes news in, the newest there is; that of ticks before may be missing. Real-time: bounded, no allocation.
    #[inline]
    pub fn hear(&mut self, news: &News) {
        self.tank.hear(news.told_j);
        self.partner = Some(*news);
    }

    /// What this end asks for. Real-time: bounded, no allocation.
    #[inline]
    pub fn pull(&mut self, state: &DeviceState) -> Pull {
        let Some(partner) = &self.partner else { return Pull::default() };
        let (pose, twist) =
            (self.mapping.pose_to_model(&state.pose), self.mapping.twist_to_model(&state.twist));
        let away = partner.pose.position() - pose.position();
        let turned: DVec3 = rotation_vector(partner.pose.orientation() * pose.orientation().conjugate());
        let config = &self.config;
        let force = away * config.stiffness_n_per_m
            + (partner.twist.linear() - twist.linear()) * config.damping_ns_per_m;
        let torque = turned * config.stiffness_nm_per_rad
            + (partner.twist.angular() - twist.angular()) * config.damping_nms_per_rad;
        let wrench = self.mapping.wrench_to_device(&Wrench::new(force, torque));
        let stored_j = 0.5
            * (config.stiffness_n_per_m * away.length_squared()
                + config.stiffness_nm_per_rad * turned.length_squared());
        self.tank.limit(stored_j + config.reserve_j);
        let scale = self.mapping.energy_scale();
        let less = match config.passivity {
            PassivityMode::Observe => None,
            PassivityMode::Control => {
                let available_j = (self.tank.level_j() - KEPT_BACK_J) * scale;
                self.controller.keep_within(available_j, &wrench, &state.twist, self.calm.expected())
            }
        };
        Pull { wrench: less.unwrap_or(wrench), energy_j: 0.5 * stored_j * scale, is_damped: less.is_some() }
    }

    /// The energy account.
    #[must_use]
    pub fn tank(&self) -> &Tank {
        &self.tank
    }
}

/// How steadily a handle has moved of late: what is to be expected of its next sample.
///
/// A hand that rests or draws slowly can only feel a coupling whose account is still empty if a small surprise is
/// expected of it; one that shakes is expected to go on.
struct Calm {
    period_s: f64,
    last: Option<Twist>,
    expected: Expected,
}

impl Calm {
    /// What is expected of the calmest handle: twice the acceleration of tremor, 0.1 mm at 10 Hz, and the same at a lever
    /// of a tenth of a metre.
    const CALMEST: Expected = Expected { acceleration_m_per_s2: 0.8, acceleration_rad_per_s2: 8.0 };
    /// How much more than of late may come at once.
    const MORE: f64 = 2.0;
    /// Time after which a third is left of what was seen, s.
    const MEMORY_S: f64 = 0.05;

    fn new(period_s: f64) -> Self {
        Self { period_s, last: None, expected: Self::CALMEST }
    }

    #[inline]
    fn follow(&mut self, twist: &Twist) {
        let Some(last) = self.last.replace(*twist) else { return };
        let Self { period_s, expected, .. } = self;
        let kept = 1.0 - (*period_s / Self::MEMORY_S).min(1.0);
        let after = |before: f64, change: DVec3, calmest: f64| {
            (before * kept).max(Self::MORE * change.length() / *period_s).max(calmest)
        };
        *expected = Expected {
            acceleration_m_per_s2: after(
                expected.acceleration_m_per_s2,
                twist.linear() - last.linear(),
                Self::CALMEST.acceleration_m_per_s2,
            ),
            acceleration_rad_per_s2: after(
                expected.acceleration_rad_per_s2,
                twist.angular() - last.angular(),
                Self::CALMEST.acceleration_rad_per_s2,
            ),
        };
    }

    #[inline]
    fn expected(&self) -> Expected {
        self.expected
    }
}
