//! The grip of the simulated hand: a mass at the fingers, between the effort of the device and a spring and damper of the hand.
//!
//! ```text
//! m q'' = K (q_intended - q) + B (q_intended' - q') + F
//! ```
//!
//! with opening `q` between the stops of the grip and effort `F`, positive when the effort opens the grip. The hand intends to close
//! and open the grip between its open stop and an opening `c`, as a cosine. The parameters are estimates.

use crate::simulation::MAX_ADVANCE_NS;
use crate::units::{MM, seconds};
use flotor_hal::{GripAxis, GripKind, GripState, Settings, math, restorable};
use std::f64::consts::TAU;

/// Opening of the open grip, m.
const OPEN_M: f64 = 0.025;
/// Largest effort, N.
const EFFORT_N: f64 = 8.0;
/// Slew rate of the effort, N/s: full scale in a millisecond.
const SLEW_N_PER_S: f64 = 8.0e3;
/// Longest integration step, ns: less than half the shortest time constant that the schema allows, mass over damping.
const STEP_NS: u64 = 100_000;

/// The grip as it is declared.
pub(crate) const AXIS: GripAxis =
    GripAxis::new(GripKind::Linear, [0.0, OPEN_M], EFFORT_N).with_slew(SLEW_N_PER_S);

/// Mass of the fingers, impedance and intended motion of the hand at the grip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FingerParameters {
    mass_kg: f64,
    stiffness_n_per_m: f64,
    damping_ns_per_m: f64,
    /// Opening at which the intended motion turns, m.
    closed_m: f64,
    frequency_hz: f64,
}

impl FingerParameters {
    /// Returns the parameters; `None` for a hand without a grip.
    pub(crate) fn of(settings: &Settings<'_>) -> Option<Self> {
        let value = |id| settings.number_or_default(id);
        (settings.choice_or_default("fingers") == 1).then(|| Self {
            mass_kg: value("fingers_mass_kg"),
            stiffness_n_per_m: value("fingers_stiffness_n_per_m"),
            damping_ns_per_m: value("fingers_damping_ns_per_m"),
            closed_m: value("fingers_closed_mm") * MM,
            frequency_hz: value("fingers_frequency_hz"),
        })
    }

    /// Returns the intended opening, m, and its velocity, m/s, at a time, s.
    fn intended(&self, time_s: f64) -> (f64, f64) {
        let (half_m, angle) = (0.5 * (OPEN_M - self.closed_m), TAU * self.frequency_hz * time_s);
        let opening_m = OPEN_M - half_m * (1.0 - math::cos(angle));
        (opening_m, -half_m * math::sin(angle) * TAU * self.frequency_hz)
    }
}

/// Moving fingers at the grip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fingers {
    parameters: FingerParameters,
    opening_m: f64,
    velocity_m_per_s: f64,
    time_ns: u64,
    /// Effort of the last write, N, constant until the next one.
    held_n: f64,
    /// Effort delivered in the last tick, N.
    delivered_n: f64,
}

restorable!(Fingers { opening_m, velocity_m_per_s, time_ns, held_n, delivered_n } without { parameters });

impl Fingers {
    /// Creates fingers at rest at the open stop.
    pub(crate) fn new(parameters: FingerParameters) -> Self {
        let (opening_m, velocity_m_per_s) = parameters.intended(0.0);
        Self { parameters, opening_m, velocity_m_per_s, time_ns: 0, held_n: 0.0, delivered_n: 0.0 }
    }

    /// Sets the effort until the next call, N; a number that is not finite counts as 0. Real-time: bounded, no allocation.
    pub(crate) fn hold(&mut self, effort_n: f64) {
        self.held_n = if effort_n.is_finite() { effort_n.clamp(-EFFORT_N, EFFORT_N) } else { 0.0 };
    }

    /// Moves the fingers for `dt_ns`, at most [`MAX_ADVANCE_NS`], under the held effort, or under none after a stop. Semi-implicit Euler.
    /// Real-time: bounded, no allocation.
    pub(crate) fn advance(&mut self, dt_ns: u64, is_stopped: bool) {
        self.delivered_n = if is_stopped { 0.0 } else { self.held_n };
        let FingerParameters { mass_kg, stiffness_n_per_m, damping_ns_per_m, .. } = self.parameters;
        let (start_s, length_ns) = (seconds(self.time_ns), dt_ns.min(MAX_ADVANCE_NS));
        self.time_ns = self.time_ns.saturating_add(dt_ns);
        let steps = length_ns.div_ceil(STEP_NS).max(1);
        let step_s = seconds(length_ns) / steps as f64;
        for step in 0..steps {
            let (aim_m, aim_m_per_s) = self.parameters.intended(start_s + step as f64 * step_s);
            let hand_n = stiffness_n_per_m * (aim_m - self.opening_m)
                + damping_ns_per_m * (aim_m_per_s - self.velocity_m_per_s);
            self.velocity_m_per_s += (hand_n + self.delivered_n) / mass_kg * step_s;
            let opening_m = self.opening_m + self.velocity_m_per_s * step_s;
            self.opening_m = opening_m.clamp(0.0, OPEN_M);
            if self.opening_m != opening_m {
                self.velocity_m_per_s = 0.0; // a stop without rebound
            }
        }
    }

    /// Returns the sample of the grip. Real-time: bounded, no allocation.
    pub(crate) fn state(&self) -> GripState {
        GripState::new(GripKind::Linear, self.opening_m, self.velocity_m_per_s)
            .with_delivered(self.delivered_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: FingerParameters = FingerParameters {
        mass_kg: 0.02,
        stiffness_n_per_m: 400.0,
        damping_ns_per_m: 4.0,
        closed_m: 0.005,
        frequency_hz: 0.0,
    };

    fn moved(parameters: FingerParameters, effort_n: f64, ticks: u32) -> Fingers {
        let mut fingers = Fingers::new(parameters);
        for _ in 0..ticks {
            fingers.hold(effort_n);
            fingers.advance(1_000_000, false);
        }
        fingers
    }

    #[test]
    fn a_constant_effort_is_held_by_the_spring_of_the_hand() {
        let settled = moved(SLOW, -2.0, 1000);
        // Ten time constants of 2 m / B = 10 ms leave e^-100 of the way.
        assert!((settled.opening_m - (OPEN_M - 2.0 / 400.0)).abs() < 1.0e-12, "{settled:?}");
        assert_eq!(settled.state().delivered, -2.0);
        assert_eq!(moved(SLOW, f64::NAN, 1000).opening_m, OPEN_M, "no effort");
        assert_eq!(moved(SLOW, 50.0, 1000).opening_m, OPEN_M, "the open stop");
        let strong = FingerParameters { stiffness_n_per_m: 100.0, ..SLOW };
        assert_eq!(moved(strong, -50.0, 1000).opening_m, 0.0, "the closed stop, under 8 N");
    }

    #[test]
    fn fingers_without_damping_swing_at_the_frequency_of_mass_and_spring() {
        let free = FingerParameters { damping_ns_per_m: 0.0, ..SLOW };
        let mut fingers = moved(free, -2.0, 1);
        fingers.hold(-2.0);
        let centre_m = OPEN_M - 2.0 / 400.0;
        let (mut crossings, mut last) = (0, fingers.opening_m - centre_m);
        for _ in 0..10_000 {
            fingers.advance(1_000_000, false);
            let now = fingers.opening_m - centre_m;
            crossings += i32::from(now * last < 0.0);
            last = now;
        }
        let expected_hz = (400.0_f64 / 0.02).sqrt() / TAU;
        // Two crossings a period; one at each end of 10 s may be missed.
        assert!((f64::from(crossings) / 20.0 - expected_hz).abs() <= 0.1, "{crossings} for {expected_hz} Hz");
    }

    #[test]
    fn the_fingers_follow_their_intention_and_a_stop_takes_the_effort_away() {
        let closing = FingerParameters { frequency_hz: 0.5, ..SLOW };
        let closed = moved(closing, 0.0, 1000);
        // Slow against the 22 Hz of the fingers: the error is the inertia's, below 1 % of the way.
        assert!((closed.opening_m - 0.005).abs() < 0.01 * 0.02, "{closed:?}");
        let mut stopped = moved(SLOW, -2.0, 1000);
        stopped.advance(1_000_000, true);
        assert_eq!(stopped.state().delivered, 0.0);
        assert!(stopped.velocity_m_per_s > 0.0, "{stopped:?}");
    }
}
