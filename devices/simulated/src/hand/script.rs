//! Scripts: the intended movements of a hand in sequence, as a TOML file.
//!
//! ```toml
//! title = "Press, feel, let go"
//! grip = "firm"          # or "relaxed"; hand_grip and the numbers of the scene override the grip
//!
//! [[step]]
//! move = { to_mm = [0, 0, -4], to_deg = [0, 0, 0], duration_s = 0.5 }
//!
//! [[step]]
//! oscillate = { amplitude_mm = [0, 0, 1.5], frequency_hz = 1.5, duration_s = 3 }
//!
//! [[step]]
//! push = { force_n = [0, 0, -5], frequency_hz = 1.5, pulses = 4 }
//!
//! [[step]]
//! hold = { duration_s = 1 }
//!
//! [[step]]
//! release = {}
//! ```
//!
//! A script starts at home. `move` goes to a place along a minimum-jerk curve (rotations as a rotation vector in the
//! device frame) and `hold` stays there. `oscillate` moves about the place along a sine that fades in and out within a
//! period, as people explore softness. `push` sets a force instead of a place: pulses (raised cosines) along which the
//! hand has no stiffness; start `push` where the spring of the hand is relaxed, because its force ends at once.
//! `release` opens the hand permanently, so it must be the last step. After the last step the hand holds its place.

mod reader;

pub use reader::ScriptError;

use super::{Aim, Grip, Pose, minimum_jerk};
use crate::units::seconds;
use flotor_hal::glam::{BVec3, DVec3};
use flotor_hal::{math, orientation_from_rotation_vector};
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// The built-in scripts: name and text.
const BUILT_IN: [(&str, &str); Script::NAMES.len()] = [
    (Script::NAMES[0], include_str!("../../scripts/press.toml")),
    (Script::NAMES[1], include_str!("../../scripts/hold.toml")),
    (Script::NAMES[2], include_str!("../../scripts/release.toml")),
    (Script::NAMES[3], include_str!("../../scripts/shear.toml")),
    (Script::NAMES[4], include_str!("../../scripts/tilt.toml")),
    (Script::NAMES[5], include_str!("../../scripts/tap.toml")),
    (Script::NAMES[6], include_str!("../../scripts/push.toml")),
];

/// A validated sequence of movements.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    grip: Option<Grip>,
    legs: Arc<[Leg]>,
    release_ns: Option<u64>,
}

/// Movement with its start, duration and initial place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    start_ns: u64,
    duration_ns: u64,
    from: Place,
    movement: Movement,
}

/// Kind of a movement.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Movement {
    /// Rest at the start.
    Hold,
    /// Motion to a place, along a minimum-jerk curve.
    Move { to: Place },
    /// Oscillation about the start.
    Oscillate { amplitude: Place, frequency_hz: f64 },
    /// Pulses of force.
    Push { force_n: DVec3, frequency_hz: f64 },
}

/// Position and orientation, or a change of both, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    position_m: DVec3,
    /// Rotation vector, rad.
    rotation_rad: DVec3,
}

impl Script {
    /// Names of the built-in scripts.
    pub const NAMES: [&'static str; 7] = ["press", "hold", "release", "shear", "tilt", "tap", "push"];

    /// Loads a built-in script or a file. Not real-time.
    ///
    /// # Errors
    /// [`ScriptError`] with file, line, key, and the expected content.
    pub fn load(name_or_path: &str) -> Result<Self, ScriptError> {
        match BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            Some((name, text)) => reader::read(name, text),
            None => reader::read_file(Path::new(name_or_path)),
        }
    }

    /// Parses a script; `file` is its name in errors. Not real-time.
    ///
    /// # Errors
    /// [`ScriptError`] with file, line, key, and the expected content.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScriptError> {
        reader::read(file, text)
    }

    /// Returns the grip set by the script; `None` if unset. Real-time: bounded, no allocation.
    #[must_use]
    pub fn grip(&self) -> Option<Grip> {
        self.grip
    }

    /// Returns the end of the last movement, ns since the start of the run. Real-time: bounded, no allocation.
    #[must_use]
    pub fn end_ns(&self) -> u64 {
        self.legs.last().map_or(0, |leg| leg.start_ns + leg.duration_ns)
    }

    /// Returns the time of the planned release, ns; `None` without one. Real-time: bounded, no allocation.
    pub(super) fn release_ns(&self) -> Option<u64> {
        self.release_ns
    }

    /// Returns the aim at a time since the start of the run; `None` after the release. Real-time: bounded, no allocation.
    pub(super) fn aim(&self, time_ns: u64) -> Option<Aim> {
        if self.release_ns.is_some_and(|release_ns| time_ns >= release_ns) {
            return None;
        }
        // The last leg that has started; the first starts at 0.
        let started = self.legs.partition_point(|leg| leg.start_ns <= time_ns);
        let leg = self.legs.get(started.saturating_sub(1));
        Some(leg.map_or(Aim::at(Pose::HOME), |leg| leg.aim(time_ns)))
    }

    /// Returns the sets of axes along which a movement intends a force instead of a position, and the empty set. Not
    /// real-time.
    pub(super) fn yieldings(&self) -> Vec<BVec3> {
        let mut found = vec![BVec3::FALSE];
        for yielding in self.legs.iter().map(Leg::yielding) {
            if !found.contains(&yielding) {
                found.push(yielding);
            }
        }
        found
    }
}

impl Leg {
    fn aim(&self, time_ns: u64) -> Aim {
        let elapsed_ns = (time_ns - self.start_ns).min(self.duration_ns);
        let (elapsed_s, duration_s) = (seconds(elapsed_ns), seconds(self.duration_ns));
        let is_over = elapsed_ns == self.duration_ns;
        match self.movement {
            Movement::Hold => Aim::at(self.from.pose()),
            Movement::Move { to } if is_over => Aim::at(to.pose()),
            Movement::Move { to } => {
                let share = minimum_jerk(elapsed_s, duration_s);
                Aim::at(self.from.moved(&to.less(&self.from), share).pose())
            }
            Movement::Oscillate { amplitude, frequency_hz } => {
                let fade_s = (1.0 / frequency_hz).min(0.5 * duration_s);
                let share = minimum_jerk(elapsed_s, fade_s) * minimum_jerk(duration_s - elapsed_s, fade_s);
                let swing = share * math::sin(TAU * frequency_hz * elapsed_s);
                Aim::at(self.from.moved(&amplitude, swing).pose())
            }
            Movement::Push { .. } if is_over => Aim::at(self.from.pose()),
            Movement::Push { force_n, frequency_hz } => {
                let pulse = 0.5 - 0.5 * math::cos(TAU * frequency_hz * elapsed_s);
                let yielding = self.yielding();
                Aim { force_n: force_n * pulse, yielding, ..Aim::at(self.from.pose()) }
            }
        }
    }

    fn end(&self) -> Place {
        match self.movement {
            Movement::Move { to } => to,
            Movement::Hold | Movement::Oscillate { .. } | Movement::Push { .. } => self.from,
        }
    }

    fn yielding(&self) -> BVec3 {
        match self.movement {
            Movement::Push { force_n, .. } => force_n.cmpne(DVec3::ZERO),
            Movement::Hold | Movement::Move { .. } | Movement::Oscillate { .. } => BVec3::FALSE,
        }
    }
}

impl Place {
    const HOME: Self = Self { position_m: DVec3::ZERO, rotation_rad: DVec3::ZERO };

    fn less(&self, other: &Self) -> Self {
        Self {
            position_m: self.position_m - other.position_m,
            rotation_rad: self.rotation_rad - other.rotation_rad,
        }
    }

    fn moved(&self, change: &Self, share: f64) -> Self {
        Self {
            position_m: self.position_m + change.position_m * share,
            rotation_rad: self.rotation_rad + change.rotation_rad * share,
        }
    }

    fn pose(&self) -> Pose {
        Pose { position_m: self.position_m, orientation: orientation_from_rotation_vector(self.rotation_rad) }
    }
}

#[cfg(test)]
mod tests;
