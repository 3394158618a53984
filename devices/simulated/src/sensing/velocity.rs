//! Velocity from a sequence of poses: three estimators with their trade-offs.
//!
//! - **Difference**: difference quotient of successive poses. A lag of only half a tick; noise and quantisation steps of the
//!   sensor are divided by the tick, so 2 µm at 1 kHz are 2 mm/s. (A public client of the device rejects this method:
//!   "calculating velocity this way causes instability".)
//! - **Low-pass**: the difference quotient behind a first-order filter. Less noise, with the lag of the filter's time constant.
//! - **Kalman**: position and velocity estimated together, under the assumption that acceleration is noise of known
//!   strength. In the steady state this is the alpha-beta filter with the gains of Kalata (1984, IEEE Trans. Aerosp.
//!   Electron. Syst. 20:174), the best trade-off of noise and lag. Needs the noise of the sensor and the acceleration of the
//!   hand.

use crate::hand::Pose;
use crate::lag::Lag;
use crate::validation::{Check, Domain, number};
use flotor_hal::glam::DVec3;
use flotor_hal::orientation_from_rotation_vector;

/// Method of velocity estimation, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EstimatorKind {
    /// Difference quotient.
    Difference,
    /// Difference quotient behind a first-order low-pass.
    LowPass {
        /// Corner frequency of the filter, Hz.
        bandwidth_hz: f64,
    },
    /// Steady-state Kalman filter.
    Kalman {
        /// Standard deviation of a measured position, m (of a rotation: over the arm of the sensor's diodes).
        noise_m: f64,
        /// Standard deviation of the acceleration, m/s².
        acceleration_m_per_s2: f64,
    },
}

impl EstimatorKind {
    /// The low-pass filter of the University of Utah's control program, 200 Hz.
    pub const UTAH: Self = Self::LowPass { bandwidth_hz: 200.0 };

    pub(super) fn check(&self) -> Check {
        match *self {
            Self::Difference => Ok(()),
            Self::LowPass { bandwidth_hz } => number("velocity_bandwidth_hz", bandwidth_hz, Domain::Positive),
            Self::Kalman { noise_m, acceleration_m_per_s2 } => {
                number("sensor_noise_um", noise_m, Domain::Positive)?;
                number("velocity_acceleration_m_per_s2", acceleration_m_per_s2, Domain::Positive)
            }
        }
    }
}

/// Linear and angular velocity, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity {
    /// Linear velocity, m/s.
    pub linear_m_per_s: DVec3,
    /// Angular velocity, rad/s.
    pub angular_rad_per_s: DVec3,
}

flotor_hal::restorable!(Velocity { linear_m_per_s, angular_rad_per_s });

impl Velocity {
    /// Zero velocity.
    pub const ZERO: Self = Self { linear_m_per_s: DVec3::ZERO, angular_rad_per_s: DVec3::ZERO };
}

/// Velocity estimator with its state.
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    kind: EstimatorKind,
    /// Filter of the low-pass method; `None` for the others.
    lag: Option<Lag>,
    /// Last pose: measured, or estimated by the Kalman filter; `None` before the first.
    last: Option<Pose>,
    velocity: Velocity,
}

flotor_hal::restorable!(Estimator { last, velocity } without { kind, lag });

impl Estimator {
    /// Creates an estimator before its first pose, with zero velocity. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(kind: EstimatorKind) -> Self {
        let lag = match kind {
            EstimatorKind::LowPass { bandwidth_hz } => Some(Lag::of_bandwidth(bandwidth_hz)),
            EstimatorKind::Difference | EstimatorKind::Kalman { .. } => None,
        };
        Self { kind, lag, last: None, velocity: Velocity::ZERO }
    }

    /// Resets the estimator after the flotor has left the range of the sensors; returns the velocity from now on: zero.
    /// Real-time: bounded, no allocation.
    pub fn restart(&mut self) -> Velocity {
        *self = Self::new(self.kind);
        self.velocity
    }

    /// Updates the estimate with a pose measured `dt_s` (s) after the previous pose; returns the velocity: zero after
    /// the first pose, unchanged if `dt_s` is 0. Real-time: bounded, no allocation.
    pub fn update(&mut self, pose: &Pose, dt_s: f64) -> Velocity {
        let Some(last) = self.last.filter(|_| dt_s > 0.0) else {
            self.last = Some(*pose);
            return self.velocity;
        };
        match self.kind {
            EstimatorKind::Difference | EstimatorKind::LowPass { .. } => {
                let share = self.lag.as_mut().map_or(1.0, |lag| lag.closed(dt_s));
                self.blend(&last, pose, dt_s, share);
            }
            EstimatorKind::Kalman { noise_m, acceleration_m_per_s2 } => {
                self.track(&last, pose, dt_s, acceleration_m_per_s2 * dt_s * dt_s / noise_m);
            }
        }
        self.velocity
    }

    /// Moves the estimate by a fraction of the way to the difference quotient.
    fn blend(&mut self, last: &Pose, pose: &Pose, dt_s: f64, share: f64) {
        let linear = (pose.position_m - last.position_m) / dt_s;
        let angular = last.rotation_to(pose) / dt_s;
        self.velocity.linear_m_per_s += (linear - self.velocity.linear_m_per_s) * share;
        self.velocity.angular_rad_per_s += (angular - self.velocity.angular_rad_per_s) * share;
        self.last = Some(*pose);
    }

    /// Updates the alpha-beta filter: predicts and corrects. `tracking_index` is the displacement by the acceleration in a
    /// tick over the noise of the sensor; the gains are the steady state of the Kalman filter for this index.
    fn track(&mut self, last: &Pose, pose: &Pose, dt_s: f64, tracking_index: f64) {
        // Gains of the alpha-beta filter from the tracking index (Kalata 1984).
        let damping = 0.25 * (4.0 + tracking_index - (tracking_index * (8.0 + tracking_index)).sqrt());
        let alpha = 1.0 - damping * damping;
        let beta = 2.0 * (2.0 - alpha) - 4.0 * damping;
        let Velocity { linear_m_per_s, angular_rad_per_s } = self.velocity;
        let turned = |orientation, rotation_rad| orientation_from_rotation_vector(rotation_rad) * orientation;
        let predicted = Pose {
            position_m: last.position_m + linear_m_per_s * dt_s,
            orientation: turned(last.orientation, angular_rad_per_s * dt_s),
        };
        let (off_m, off_rad) = (pose.position_m - predicted.position_m, predicted.rotation_to(pose));
        self.last = Some(Pose {
            position_m: predicted.position_m + off_m * alpha,
            orientation: turned(predicted.orientation, off_rad * alpha).normalize(),
        });
        self.velocity = Velocity {
            linear_m_per_s: linear_m_per_s + off_m * (beta / dt_s),
            angular_rad_per_s: angular_rad_per_s + off_rad * (beta / dt_s),
        };
    }
}
