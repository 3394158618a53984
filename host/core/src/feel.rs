//! Felt stiffness and settling time of a run, from its tick records.

use crate::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Pose, rotation_vector};

/// Shortest displacement over which stiffness is computed, and distance within which a handle is at rest, m: larger than the
/// resolution of a sensor, and much smaller than the movement of a press.
const WAY_M: f64 = 1.0e-4;
/// Rotation within which a handle is at rest, rad.
const TURN_RAD: f64 = 1.0e-3;
/// Time for which a handle that has moved must rest to be settled, ns: longer than a slow oscillation stays near its turning point.
const REST_NS: u64 = 500_000_000;

/// Felt stiffness and settling time of one device, from its records in order, in constant memory.
#[derive(Debug, Default)]
pub struct Feel {
    /// Position, m, and force, N, at the start of the current displacement; `None` after a tick with an event.
    before: Option<(DVec3, DVec3)>,
    /// Pose at the start of the current rest.
    rest: Option<Pose>,
    /// Largest stiffness felt, N/m: increase of the force against the handle per displacement, over displacements of at least
    /// 0.1 mm; 0 if the force never increased.
    peak_stiffness_n_per_m: f64,
    settled_ns: u64,
    newest_ns: u64,
}

impl Feel {
    /// Adds the next record of the device. Real-time: bounded, no allocation.
    pub fn observe(&mut self, record: &TickRecord) {
        self.observe_force(record);
        self.newest_ns = record.time_ns;
        let is_near = |rest: &Pose| {
            let turn = record.pose.orientation() * rest.orientation().conjugate();
            record.pose.position().distance(rest.position()) <= WAY_M
                && rotation_vector(turn).length() <= TURN_RAD
        };
        if !self.rest.as_ref().is_some_and(is_near) {
            self.settled_ns = if self.rest.is_some() { record.time_ns } else { 0 };
            self.rest = Some(record.pose);
        }
    }

    fn observe_force(&mut self, record: &TickRecord) {
        // A ramp, a limit or a change of a parameter changes the force without a displacement.
        if record.events != Events::NONE {
            self.before = None;
            return;
        }
        let (here_m, force_n) = (record.pose.position(), record.commanded.force());
        let (before_m, before_n) = *self.before.get_or_insert((here_m, force_n));
        let way_m = here_m - before_m;
        if way_m.length() >= WAY_M {
            let stiffness_n_per_m = -(force_n - before_n).dot(way_m) / way_m.length_squared();
            self.peak_stiffness_n_per_m = self.peak_stiffness_n_per_m.max(stiffness_n_per_m);
            self.before = Some((here_m, force_n));
        }
    }

    /// Returns the largest stiffness felt, N/m: increase of the force against the handle per displacement, over displacements of 0.1
    /// mm; 0 if the force never increased.
    #[must_use]
    pub fn peak_stiffness_n_per_m(&self) -> f64 {
        self.peak_stiffness_n_per_m
    }

    /// Returns the time from which on the handle stayed within 0.1 mm and 1 mrad of one pose, s; `None` for a handle that moved
    /// within the last half second.
    #[must_use]
    pub fn settled_after_s(&self) -> Option<f64> {
        let never_moved = self.settled_ns == 0;
        let rests = never_moved || self.newest_ns.saturating_sub(self.settled_ns) >= REST_NS;
        rests.then_some(self.settled_ns as f64 * 1.0e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ModelOutputs;
    use flotor_hal::{DQuat, Twist, Wrench};

    /// A handle that goes down a way within a number of ticks of 1 ms, in a spring, and then rests for as many.
    fn felt(stiffness_n_per_m: f64, way_m: f64, ticks: u16, events: Events) -> Feel {
        let mut feel = Feel::default();
        for tick in 0..2 * ticks {
            let depth_m = way_m * f64::from(tick.min(ticks)) / f64::from(ticks);
            let force = Wrench::from_force(DVec3::Z * (stiffness_n_per_m * depth_m));
            feel.observe(&TickRecord {
                tick: tick.into(),
                device: 0,
                time_ns: u64::from(tick) * 1_000_000,
                dt_ns: 1_000_000,
                pose: Pose::new(DVec3::Z * -depth_m, DQuat::IDENTITY),
                twist: Twist::ZERO,
                model: ModelOutputs::new(force, 0.0),
                commanded: force,
                delivered: force,
                port_energy_j: 0.0,
                grip: None,
                events,
                buttons: 0,
                lateness_ns: 0,
                compute_ns: 0,
            });
        }
        feel
    }

    #[test]
    fn a_spring_is_as_stiff_as_it_is_at_any_speed() {
        for (stiffness_n_per_m, way_m, ticks) in
            [(500.0, 4.0e-3, 400), (2000.0, 4.0e-3, 10), (0.0, 4.0e-3, 400)]
        {
            let felt_n_per_m = felt(stiffness_n_per_m, way_m, ticks, Events::NONE).peak_stiffness_n_per_m;
            // Digits of differences of forces.
            assert!((felt_n_per_m - stiffness_n_per_m).abs() <= 1.0e-9 * stiffness_n_per_m, "{felt_n_per_m}");
        }
        let pumped = felt(-500.0, 4.0e-3, 400, Events::NONE);
        assert_eq!(pumped.peak_stiffness_n_per_m, 0.0, "a force along the way is no stiffness");
        let ramped = felt(500.0, 4.0e-3, 400, Events::RAMPING);
        assert_eq!(ramped.peak_stiffness_n_per_m, 0.0, "the force of a ramp is not the model's");
    }

    #[test]
    fn a_handle_has_settled_within_the_last_tenth_of_a_millimetre() {
        // 4 mm in 600 ms are 0.1 mm in 15 ms.
        let settled_s = felt(500.0, 4.0e-3, 600, Events::NONE).settled_after_s();
        assert!(settled_s.is_some_and(|settled_s| (0.580..=0.600).contains(&settled_s)), "{settled_s:?}");
        assert_eq!(felt(500.0, 0.0, 400, Events::NONE).settled_after_s(), Some(0.0), "it never moved");
        assert_eq!(felt(500.0, 4.0e-3, 400, Events::NONE).settled_after_s(), None, "it moved 0.4 s ago");
    }
}
