//! Closed motions of a hand in time, with the velocity that damping and friction depend on.
//!
//! A hand moves fast on one part of a lap and slowly on another: energy lost on the fast part of a law with friction
//! and damping need not return on the slow one, and a faulty law may confuse the two.

use super::lap::{CONSERVATIVE, Dissipation, Lap, MOST_STEPS};
use crate::sampling::Random;
use crate::subject::Subject;
use crate::trajectory::Trajectory;
use flotor_hal::{DVec3, Memory, Pose, Twist, math};
use std::f64::consts::TAU;

/// Shortest time of a lap, s, and ratio of the longest to the shortest.
const SHORTEST_LAP_S: f64 = 0.05;
const LAP_RATIO: f64 = 20.0;
/// Largest unevenness: 39 times faster at one end of the lap than at the other.
const MOST_UNEVEN: f64 = 0.95;
/// Maximum number of laps after the first, which starts with another history.
const MOST_LATER_LAPS: usize = 64;

/// Closed path with its speed profile.
pub(super) struct Motion {
    path: Trajectory,
    lap_s: f64,
    /// Unevenness of the speed, from 0 for a constant one to 1 for a stop.
    unevenness: f64,
    /// Position of the fastest point in the lap, as an angle, rad.
    phase_rad: f64,
}

impl Motion {
    pub(super) fn random(path: Trajectory, random: &mut Random) -> Self {
        let lap_s = SHORTEST_LAP_S * math::pow(LAP_RATIO, random.unit());
        Self { path, lap_s, unevenness: MOST_UNEVEN * random.unit(), phase_rad: TAU * random.unit() }
    }

    /// Returns pose, translation and rotation per lap, at a fraction of the lap's time.
    fn at(&self, part: f64) -> (Pose, DVec3, DVec3) {
        let angle = TAU * part + self.phase_rad;
        let place = part + self.unevenness / TAU * math::sin(angle);
        let pace = 1.0 + self.unevenness * math::cos(angle);
        let (pose, motion_m, turn_rad) = self.path.at(place);
        (pose, motion_m * pace, turn_rad * pace)
    }

    /// Measures the work of a lap, after the model has settled into the motion; `None` if the model gives no answer.
    pub(super) fn lap(&self, subject: &mut Subject<'_>, samples: usize) -> Option<Lap> {
        subject.restart();
        if subject.memory() == Memory::PathDependent {
            subject.answer_at(self.at(0.0).0).ok()?;
        }
        let even: Vec<f64> = (0..samples).map(|index| index as f64 / samples as f64).collect();
        let lap = least_of_later_laps(|| Some(Lap::from_powers(&self.powers(subject, &even)?)))?;
        lap.or_resolved(Dissipation::Allowed, |parts| self.powers(subject, parts))
    }

    /// Returns the powers on the hand at increasing fractions of the lap's time, J per lap.
    fn powers(&self, subject: &mut Subject<'_>, parts: &[f64]) -> Option<Vec<f64>> {
        let mut before = parts.last()? - 1.0;
        let power = |part: &f64| {
            let dt_ns = flotor_core::to_ns((part - std::mem::replace(&mut before, *part)) * self.lap_s);
            let (pose, motion_m, turn_rad) = self.at(*part);
            let twist = Twist::new(motion_m / self.lap_s, turn_rad / self.lap_s);
            let wrench = subject.advance(pose, twist, dt_ns).ok()?.wrench;
            Some(wrench.force().dot(motion_m) + wrench.torque().dot(turn_rad))
        };
        parts.iter().map(power).collect()
    }
}

/// Returns the lap, after the first, that generates the least energy. A model in motion may return in one lap energy
/// that it stored in an earlier one, or, held by friction, a part of it in each of many laps. So laps follow until one
/// generates no less than all before.
fn least_of_later_laps(mut lap: impl FnMut() -> Option<Lap>) -> Option<Lap> {
    lap()?;
    let mut least = lap()?;
    for _ in 1..MOST_LATER_LAPS {
        let other = lap()?;
        let less_j = least.net_j - other.net_j;
        if less_j > 0.0 {
            least = other;
        }
        if less_j <= CONSERVATIVE * other.gross_j {
            break;
        }
    }
    Some(least)
}

/// Closed path of three straight edges, each at its own speed.
pub(super) struct Triangle {
    pub(super) start: Pose,
    /// Edges of the triangle, m; their sum is zero.
    pub(super) ways_m: [DVec3; 3],
    pub(super) speeds_m_per_s: [f64; 3],
}

impl Triangle {
    /// Measures the work of a lap, with half of the samples of each edge and with all: the difference bounds the error
    /// of a smooth force. `None` if the model gives no answer.
    pub(super) fn lap(&self, subject: &mut Subject<'_>, samples: usize) -> Option<Lap> {
        let coarse = self.sampled(subject, samples / 2)?;
        let fine = self.sampled(subject, samples)?;
        let change_j = (fine.net_j - coarse.net_j).abs();
        Some(Lap { uncertain_j: fine.uncertain_j.max(2.0 * change_j), ..fine })
    }

    /// Returns the work of a lap, uncertain by [`MOST_STEPS`] steps of the force between two samples.
    fn sampled(&self, subject: &mut Subject<'_>, samples: usize) -> Option<Lap> {
        subject.restart();
        if subject.memory() == Memory::PathDependent {
            subject.answer_at(self.start).ok()?;
        }
        least_of_later_laps(|| {
            let (mut corner_m, mut net_j, mut gross_j, mut highest_j) =
                (self.start.position(), 0.0, 0.0, 0.0);
            for (way_m, speed_m_per_s) in self.ways_m.into_iter().zip(self.speeds_m_per_s) {
                for [work_j, step_j] in self.edge(subject, corner_m, way_m, speed_m_per_s, samples)? {
                    (net_j, gross_j, highest_j) =
                        (net_j + work_j, gross_j + work_j.abs(), f64::max(highest_j, step_j));
                }
                corner_m += way_m;
            }
            Some(Lap { net_j, gross_j, uncertain_j: MOST_STEPS * highest_j, mismatch: 0.0 })
        })
    }

    /// Returns the work on the hand between the samples of an edge by the trapezoidal rule, and its largest error where the force has
    /// a step there, J.
    fn edge(
        &self,
        subject: &mut Subject<'_>,
        from_m: DVec3,
        way_m: DVec3,
        speed_m_per_s: f64,
        samples: usize,
    ) -> Option<Vec<[f64; 2]>> {
        let duration_s = way_m.length() / speed_m_per_s;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a second
        let dt_ns = (duration_s * 1.0e9 / samples as f64).round() as u64;
        let twist = Twist::new(way_m / duration_s, DVec3::ZERO);
        let mut force_n = |index: usize| {
            let position_m = from_m + way_m * (index as f64 / samples as f64);
            let pose = Pose::new(position_m, self.start.orientation());
            Some(subject.advance(pose, twist, dt_ns).ok()?.wrench.force())
        };
        let mut before_n = force_n(0)?;
        let step_m = way_m / samples as f64;
        let work_j = |index: usize| {
            let here_n = force_n(index)?;
            let there_n = std::mem::replace(&mut before_n, here_n);
            Some([(there_n + here_n).dot(step_m) * 0.5, (here_n - there_n).dot(step_m).abs() * 0.5])
        };
        (1..=samples).map(work_j).collect()
    }
}
