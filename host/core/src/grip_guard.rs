//! Limits of the effort at a grip, and the check of its samples.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::limits::Limits;
use crate::plausibility::Implausible;
use crate::trace::Events;
use flotor_hal::{GripAxis, GripKind, GripState};

/// Speeds of a grip above which a sample is implausible, m/s and rad/s: those of a handle.
const SPEED_M_PER_S: f64 = 10.0;
const SPEED_RAD_PER_S: f64 = 100.0;

/// Limits of a grip, of scene and device together, and the check of its samples.
#[derive(Clone, Copy, Debug)]
pub struct GripGuard {
    axis: GripAxis,
    /// Largest effort in both directions.
    most: f64,
    last: f64,
}

impl GripGuard {
    /// Creates the guard of a declared grip under the limits of a scene. Not real-time.
    #[must_use]
    pub fn new(axis: GripAxis, limits: &Limits) -> Self {
        let scene = match axis.kind() {
            GripKind::Linear => limits.grip_force_n,
            GripKind::Angular => limits.grip_torque_nm,
        };
        Self { axis, most: axis.max_effort.min(scene), last: 0.0 }
    }

    /// Returns the declared grip.
    pub const fn axis(&self) -> &GripAxis {
        &self.axis
    }

    /// Checks a sample of the grip; `None` if the plugin returned none.
    ///
    /// # Errors
    /// The reason, if the sample is implausible: not finite, farther outside the range than the range is long, or faster than
    /// a handle can be.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn check(&self, sample: Option<GripState>) -> Result<GripState, Implausible> {
        let finite = |state: &GripState| {
            state.opening.is_finite() && state.velocity.is_finite() && state.delivered.is_finite()
        };
        let state = sample.filter(finite).ok_or(Implausible::NotFinite)?;
        let [closed, open] = self.axis.range;
        let fastest = match self.axis.kind() {
            GripKind::Linear => SPEED_M_PER_S,
            GripKind::Angular => SPEED_RAD_PER_S,
        };
        if (state.opening - 0.5 * (closed + open)).abs() > 1.5 * (open - closed) {
            return Err(Implausible::Range);
        }
        if state.velocity.abs() > fastest { Err(Implausible::Speed) } else { Ok(state) }
    }

    /// Passes the requested effort through guard, gate, limit and slew limit, in this order; returns the effort to command and
    /// adds the events of the stages that acted. `open` is the part of the models' force that may pass, 0 to 1, `dt_s` the time
    /// for which the slew limit allows a change. Real-time: bounded, no allocation.
    #[inline]
    pub fn limit(&mut self, request: f64, open: f64, dt_s: f64, events: &mut Events) -> f64 {
        let is_finite = request.is_finite();
        let gated = if is_finite { request * open } else { 0.0 };
        let bounded = gated.clamp(-self.most, self.most);
        let step = self.axis.max_slew_per_s * dt_s;
        let sent = bounded.clamp(self.last - step, self.last + step);
        let limited = match self.axis.kind() {
            GripKind::Linear => Events::FORCE_LIMITED,
            GripKind::Angular => Events::TORQUE_LIMITED,
        };
        for (has_acted, event) in [
            (!is_finite, Events::NOT_FINITE),
            (bounded != gated && self.most > 0.0, limited),
            (sent != bounded, Events::SLEW_LIMITED),
        ] {
            if has_acted {
                events.insert(event);
            }
        }
        self.last = sent;
        sent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PINCERS: GripAxis = GripAxis::new(GripKind::Linear, [0.0, 0.02], 8.0).with_slew(1000.0);

    fn guard(limits: &Limits) -> GripGuard {
        GripGuard::new(PINCERS, limits)
    }

    #[test]
    fn the_tighter_limit_of_scene_and_device_of_the_same_kind_counts() {
        let sent = |limits: &Limits, request| {
            let (mut guard, mut events) = (guard(limits), Events::NONE);
            let sent = (0..100).map(|_| guard.limit(request, 1.0, 1.0e-3, &mut events)).last();
            (sent, events.intersects(Events::FORCE_LIMITED))
        };
        let soft = Limits { grip_force_n: 2.0, grip_torque_nm: 0.1, ..Limits::default() };
        assert_eq!(sent(&Limits::default(), 50.0), (Some(8.0), true));
        assert_eq!(sent(&soft, -50.0), (Some(-2.0), true));
        assert_eq!(sent(&soft, 1.5), (Some(1.5), false));
    }

    #[test]
    fn no_effort_jumps_and_a_closed_gate_or_a_number_that_is_none_takes_it_away() {
        let (mut guard, mut events) = (guard(&Limits::default()), Events::NONE);
        let mut last = 0.0;
        let requests =
            [(8.0, 1.0), (-8.0, 1.0), (f64::NAN, 1.0), (8.0, 1.0), (8.0, 0.0), (f64::INFINITY, 1.0)];
        for (request, open) in requests {
            for _ in 0..20 {
                let sent = guard.limit(request, open, 1.0e-3, &mut events);
                // A rounding of the sum of effort and step.
                assert!(
                    (sent - last).abs() <= 1.0 + 4.0 * f64::EPSILON && sent.abs() <= 8.0,
                    "{last} to {sent}"
                );
                last = sent;
            }
            let settled = if request.is_finite() { request * open } else { 0.0 };
            assert_eq!(last, settled, "after 16 steps of 1 N");
        }
        assert!(events.intersects(Events::NOT_FINITE) && events.intersects(Events::SLEW_LIMITED));
    }

    #[test]
    fn a_grip_that_is_only_sensed_gets_nothing_and_says_nothing() {
        let mut guard = GripGuard::new(GripAxis::new(GripKind::Angular, [0.0, 1.0], 0.0), &Limits::default());
        let mut events = Events::NONE;
        assert_eq!((guard.limit(3.0, 1.0, 1.0e-3, &mut events), events), (0.0, Events::NONE));
    }

    #[test]
    fn a_sample_that_cannot_be_true_is_named() {
        let guard = guard(&Limits::default());
        let check =
            |opening, velocity| guard.check(Some(GripState::new(GripKind::Linear, opening, velocity)));
        assert!(check(0.01, 0.3).is_ok() && check(-0.019, 0.0).is_ok() && check(0.039, 0.0).is_ok());
        assert_eq!(check(0.041, 0.0), Err(Implausible::Range));
        assert_eq!(check(-0.021, 0.0), Err(Implausible::Range));
        assert_eq!(check(0.01, -10.1), Err(Implausible::Speed));
        assert_eq!(check(f64::NAN, 0.0), Err(Implausible::NotFinite));
        assert_eq!(guard.check(None), Err(Implausible::NotFinite));
    }
}
