//! Plausibility checks of samples, between a device and all users of its samples.
//!
//! A finite pose may still be a kilometre away, be no rotation, have jumped farther than a hand can move, or be a
//! minute old; a model would respond with all the force that the envelope permits. An implausible sample is not used:
//! the last plausible sample stays in use, as if a sample were missing. [`Trust`] gives the consequence: a single
//! implausible sample is tolerated, several in a short time remove the force, more are a fault of the device.
//!
//! No real handle exceeds a bound: a sample within the bounds may still be wrong, and the envelope limits its effect.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{Axes, Capabilities, Conditions, DQuat, DVec3, DeviceState, Pose, Tick, Twist};

/// Tolerance of the length of a quaternion: a hundred times the error of six decimals.
const LENGTH_TOLERANCE: f64 = 1.0e-3;
/// Rounding error of the squared length of a unit quaternion: of its four numbers and of their sum.
const LENGTH_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Largest pose, as a multiple of the device's range: a device also reports handles that have left the range.
const RANGES: f64 = 2.0;
/// Largest position along an axis without a declared range, m: a room.
const ROOM_M: f64 = 10.0;
/// Largest velocity of a handle between samples: a throw leaves the hand at ten times the fastest reach (0.5
/// m/s is fast within a workspace of centimetres), a wrist turns at 30 rad/s.
const SPEED_M_PER_S: f64 = 5.0;
const SPIN_RAD_PER_S: f64 = 50.0;
/// Largest acceleration: 500 times that of gravity. A tap on a wall with a handle in the hand has a tenth of it.
const ACCELERATION_M_PER_S2: f64 = 5.0e3;
/// Largest reported velocity, as a multiple of the largest velocity: estimates from positions overshoot.
const TWIST_OVERSHOOT: f64 = 2.0;
/// Tolerance of a displacement for noise and for samples taken a little early or late: a tenth of a millimetre at each end, or
/// four steps of a coarser sensor; and a fifth of a degree.
const SLACK_M: f64 = 2.0e-4;
const SLACK_STEPS: f64 = 4.0;
const SLACK_RAD: f64 = 4.0e-3;
/// Tolerance of the time of a sample relative to the time of the loop, beyond periods and the device's latency, ns:
/// ahead, for a device that takes its timestamp when a late tick reads, and behind.
const AHEAD_NS: u64 = 10_000_000;
const BEHIND_NS: u64 = 100_000_000;
/// Tolerance of the time of a sample, in periods.
const AHEAD_PERIODS: u64 = 2;
const BEHIND_PERIODS: u64 = 40;
/// Time without a usable sample after which the force is zero, ns: the hand may have moved by 3 mm (10 Hz, amplitude 5 mm).
const STALE_LIMIT_NS: u64 = 10_000_000;
/// Smallest number of consecutive lost samples that is tolerated at any rate: one lost sample is normal.
const STALE_TICKS_BORNE: u64 = 2;
/// Timeout of a noisy pose without any changed bit, as a multiple of the sample timeout.
const STUCK_TIMES: u32 = 5;
/// Implausible samples until a device fault, as a multiple of those until the force is removed.
const FAULT_TIMES: u32 = 10;
/// Plausible samples that compensate for one implausible sample: a device that is wrong more often ends up as faulty.
const GOOD_FOR_A_BAD: u32 = 20;

/// Reason why a sample is implausible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Implausible {
    /// A number is NaN or infinite.
    NotFinite,
    /// The length of the orientation is not one.
    Quaternion,
    /// The pose is outside twice the range of the device, or more than 10 m away along an axis without a declared
    /// range.
    Range,
    /// The velocity, reported or since the last sample, is higher than a handle can have.
    Speed,
    /// The acceleration is higher than a handle can have.
    Acceleration,
    /// The sample was taken in the future, too long ago or before the last sample, or is repeated too often.
    Time,
    /// A noisy pose has not changed in any bit for many samples.
    Stuck,
}

impl Implausible {
    /// Names of the reasons, for reports.
    const NAMES: [&'static str; 7] =
        ["not finite", "quaternion", "range", "speed", "acceleration", "time", "stuck"];
}

/// Counts of the implausible samples of a device in a run, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImplausibleSamples {
    /// Counts in the order of [`Implausible::NAMES`].
    counts: [u64; Implausible::NAMES.len()],
    /// Tick of the first implausible sample.
    first_tick: Option<u64>,
}

impl ImplausibleSamples {
    /// Returns the number of samples that were implausible for this reason. Real-time: bounded, no allocation.
    #[must_use]
    pub fn count(&self, why: Implausible) -> u64 {
        self.counts.get(why as usize).copied().unwrap_or(0)
    }

    /// Returns the tick of the first implausible sample; `None` if all were plausible. Real-time: bounded, no allocation.
    #[must_use]
    pub fn first_tick(&self) -> Option<u64> {
        self.first_tick
    }

    fn add(&mut self, why: Implausible, tick: &Tick) {
        if let Some(count) = self.counts.get_mut(why as usize) {
            *count = count.saturating_add(1);
        }
        self.first_tick.get_or_insert(tick.index);
    }
}

impl std::fmt::Display for ImplausibleSamples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let total: u64 = self.counts.iter().sum();
        let found = Implausible::NAMES.into_iter().zip(self.counts).filter(|(_, count)| *count > 0);
        let plural = if total == 1 { "" } else { "s" };
        write!(f, "{total} implausible sample{plural} (")?;
        for (place, (name, count)) in found.enumerate() {
            let comma = if place == 0 { "" } else { ", " };
            write!(f, "{comma}{name} {count}")?;
        }
        write!(f, "), the first at tick {}", self.first_tick.unwrap_or(0))
    }
}

/// Trust in the samples of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// Samples are plausible, or implausible ones are tolerated.
    Full,
    /// Too many samples were implausible: no force for a while.
    Withdrawn,
    /// Implausible samples continue: the device is faulty.
    Lost,
}

/// An accepted sample and its time.
#[derive(Clone, Copy)]
struct Believed {
    pose: Pose,
    time_ns: u64,
    sampled_ns: u64,
    /// Displacement since the sample before, m, and its time, s; zero before there were two.
    way: DVec3,
    over_s: f64,
}

/// Bounds of the poses that a device may report: two ellipsoids, of twice its range in position and in rotation.
#[derive(Clone, Copy, Debug)]
pub struct PoseBounds {
    /// Reciprocal bounds, per m from home and per sine of half a rotation: a scaled vector longer than one is outside.
    per_reach: DVec3,
    per_turn: DVec3,
}

impl PoseBounds {
    /// Returns the bounds of a device; an axis without a declared range has 10 m, or no bound of rotation. Not
    /// real-time.
    #[must_use]
    pub fn of(device: &Capabilities) -> Self {
        let reach_m = device.range_m.map(|range_m| if range_m > 0.0 { RANGES * range_m } else { ROOM_M });
        // Twice the sine of half an angle is never more than the angle.
        let per_turn = device.range_rad.map(|range| if range > 0.0 { 2.0 / (RANGES * range) } else { 0.0 });
        Self { per_reach: DVec3::from_array(reach_m).recip(), per_turn: DVec3::from_array(per_turn) }
    }

    /// Returns true if a pose is within the bounds; false for NaN. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn contain(&self, pose: &Pose) -> bool {
        let (out, turned) = (pose.position() * self.per_reach, pose.orientation().xyz() * self.per_turn);
        out.length_squared() <= 1.0 && turned.length_squared() <= 1.0
    }
}

/// Plausibility check of the samples of one device.
#[derive(Clone)]
pub struct PlausibilityCheck {
    /// False for a device that senses no pose and may report any.
    has_pose: bool,
    bounds: PoseBounds,
    slack_m: f64,
    ahead_ns: u64,
    behind_ns: u64,
    stale_ticks: u32,
    last: Option<Believed>,
    /// Number of consecutive samples with the time of their predecessor.
    repeated: u32,
    /// Number of consecutive samples of a noisy sensor with exactly the pose of their predecessor.
    unmoved: u32,
    /// Counter that grows by [`GOOD_FOR_A_BAD`] with each implausible sample and falls by one with each plausible one.
    distrust: u32,
    found: ImplausibleSamples,
}

impl PlausibilityCheck {
    /// Creates the check for a device with the capabilities `device`, in a loop with the period `period_ns`. Not
    /// real-time.
    #[must_use]
    pub fn new(device: &Capabilities, period_ns: u64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some seconds
        let latency_ns = (device.latency_s * 1.0e9) as u64;
        let period_ns = period_ns.max(1);
        Self {
            has_pose: device.sensed != Axes::NONE,
            bounds: PoseBounds::of(device),
            slack_m: SLACK_M.max(SLACK_STEPS * device.resolution_m),
            ahead_ns: AHEAD_NS + AHEAD_PERIODS * period_ns,
            behind_ns: BEHIND_NS.max(BEHIND_PERIODS * period_ns) + latency_ns,
            stale_ticks: stale_ticks_limit(period_ns),
            last: None,
            repeated: 0,
            unmoved: 0,
            distrust: 0,
            found: ImplausibleSamples::default(),
        }
    }

    /// Checks a new sample against the bounds and the last plausible sample, and updates the trust; a plausible sample
    /// becomes the last plausible sample.
    ///
    /// # Errors
    /// The reason, if the sample is implausible.
    ///
    /// Real-time: bounded, no allocation.
    #[inline(always)] // in the middle of a tick
    pub fn check(&mut self, tick: &Tick, sample: &DeviceState) -> Result<(), Implausible> {
        self.check_both(tick, sample, Ok(()))
    }

    /// Checks a new sample as [`Self::check`] does, together with the result of the check of its grip.
    ///
    /// # Errors
    /// The reason, if one of both is implausible.
    ///
    /// Real-time: bounded, no allocation.
    #[inline(always)] // in the middle of a tick
    pub fn check_both(
        &mut self,
        tick: &Tick,
        sample: &DeviceState,
        grip: Result<(), Implausible>,
    ) -> Result<(), Implausible> {
        let checked = self.look(tick, sample).and(grip);
        match checked {
            Ok(()) => self.distrust = self.distrust.saturating_sub(1),
            Err(why) => {
                self.distrust = self.distrust.saturating_add(GOOD_FOR_A_BAD).min(self.fault_limit() + 1);
                self.found.add(why, tick);
            }
        }
        checked
    }

    /// Returns the present trust in the device. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn trust(&self) -> Trust {
        if self.distrust <= GOOD_FOR_A_BAD * self.stale_ticks {
            Trust::Full
        } else if self.distrust <= self.fault_limit() {
            Trust::Withdrawn
        } else {
            Trust::Lost
        }
    }

    /// Returns the counts of implausible samples so far. Real-time: bounded, no allocation.
    #[must_use]
    pub fn found(&self) -> ImplausibleSamples {
        self.found
    }

    fn fault_limit(&self) -> u32 {
        GOOD_FOR_A_BAD * FAULT_TIMES * self.stale_ticks
    }

    #[inline]
    fn look(&mut self, tick: &Tick, sample: &DeviceState) -> Result<(), Implausible> {
        if !self.has_pose {
            return if sample.is_finite() { Ok(()) } else { Err(Implausible::NotFinite) };
        }
        // Each comparison fails for a number that is not finite.
        let looked = self.within_bounds(tick, sample).and_then(|()| self.after_last(tick, sample));
        looked.map_err(|why| if sample.is_finite() { why } else { Implausible::NotFinite })
    }

    /// Checks pose, velocity and time of a sample against their bounds.
    #[inline]
    fn within_bounds(&self, tick: &Tick, sample: &DeviceState) -> Result<(), Implausible> {
        let DeviceState { pose, twist, sampled_ns, .. } = sample;
        if !is_rotation(pose.orientation()) {
            return Err(Implausible::Quaternion);
        }
        if !self.bounds.contain(pose) {
            return Err(Implausible::Range);
        }
        if is_too_fast(twist) {
            return Err(Implausible::Speed);
        }
        if *sampled_ns > tick.time_ns.saturating_add(self.ahead_ns)
            || sampled_ns.saturating_add(self.behind_ns) < tick.time_ns
        {
            return Err(Implausible::Time);
        }
        Ok(())
    }

    /// Checks a sample against the last plausible one, and stores it as the last.
    #[inline]
    fn after_last(&mut self, tick: &Tick, sample: &DeviceState) -> Result<(), Implausible> {
        let DeviceState { pose, sampled_ns, .. } = *sample;
        let mut believed =
            Believed { pose, time_ns: tick.time_ns, sampled_ns, way: DVec3::ZERO, over_s: 0.0 };
        if let Some(last) = self.last {
            self.follow(&last, sample)?;
            let over_s = tick.time_ns.saturating_sub(last.time_ns) as f64 * 1.0e-9;
            (believed.way, believed.over_s) = self.moved(&last, &pose, over_s)?;
        }
        self.last = Some(believed);
        Ok(())
    }

    /// Checks that a sample is newer than the last one, not repeated and not stuck.
    #[inline]
    fn follow(&mut self, last: &Believed, sample: &DeviceState) -> Result<(), Implausible> {
        if sample.sampled_ns < last.sampled_ns {
            return Err(Implausible::Time);
        }
        // Until the first sample has passed the latency of a device, it repeats the initial one.
        let is_repeated = sample.sampled_ns == last.sampled_ns && last.sampled_ns > 0;
        self.repeated = if is_repeated { self.repeated.saturating_add(1) } else { 0 };
        if self.repeated > self.stale_ticks {
            return Err(Implausible::Time);
        }
        let is_unmoved = sample.conditions.contains(Conditions::NOISY) && sample.pose == last.pose;
        self.unmoved = if is_unmoved { self.unmoved.saturating_add(1) } else { 0 };
        if self.unmoved > STUCK_TIMES * self.stale_ticks {
            return Err(Implausible::Stuck);
        }
        Ok(())
    }

    /// Checks velocity and acceleration since the last sample, `over_s` (s) ago; returns displacement, m, and time, s.
    #[inline]
    fn moved(&self, last: &Believed, pose: &Pose, over_s: f64) -> Result<(DVec3, f64), Implausible> {
        let way = pose.position() - last.pose.position();
        // The nearer of two quaternions of one rotation: twice their distance is the angle between, if it is small.
        let (now, before) = (pose.orientation(), last.pose.orientation());
        let nearer = if now.dot(before) < 0.0 { -now } else { now };
        let turn = (nearer - before) * 2.0;
        let most_m = SPEED_M_PER_S * over_s + self.slack_m;
        let most_rad = SPIN_RAD_PER_S * over_s + SLACK_RAD;
        if way.length_squared() > most_m * most_m || turn.length_squared() > most_rad * most_rad {
            return Err(Implausible::Speed);
        }
        if over_s <= 0.0 {
            return Ok((last.way, last.over_s)); // a repeated first tick: not from our loops
        }
        if last.over_s > 0.0 {
            // Mean velocities over two intervals lie half of both apart in time; their change times the later interval is a displacement.
            let ratio = over_s / last.over_s;
            let most_m =
                ACCELERATION_M_PER_S2 * 0.5 * (over_s + last.over_s) * over_s + self.slack_m * (1.0 + ratio);
            if (way - last.way * ratio).length_squared() > most_m * most_m {
                return Err(Implausible::Acceleration);
            }
        }
        Ok((way, over_s))
    }
}

/// Returns the number of consecutive ticks without a usable sample that is tolerated in a loop with the period
/// `period_ns`. Not real-time.
#[must_use]
pub fn stale_ticks_limit(period_ns: u64) -> u32 {
    let ticks = (STALE_LIMIT_NS / period_ns.max(1)).max(STALE_TICKS_BORNE);
    u32::try_from(ticks).unwrap_or(u32::MAX)
}

/// Returns true if the length of a quaternion is 1 within 1e-3, the tolerance for orientations of devices, peers and
/// scenes. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn is_rotation(quaternion: DQuat) -> bool {
    (quaternion.length_squared() - 1.0).abs() <= 2.0 * LENGTH_TOLERANCE // false for NaN
}

/// Normalises the orientation of a pose, as a model may reject an orientation of another length. An orientation of
/// length 1 within rounding, and one that [`is_rotation`] rejects, is returned unchanged. Real-time: bounded, no
/// allocation.
#[inline]
pub fn normalised(pose: &Pose) -> Pose {
    let orientation = pose.orientation();
    let squared = orientation.length_squared();
    if (squared - 1.0).abs() <= LENGTH_ROUNDING || !is_rotation(orientation) {
        return *pose;
    }
    Pose::new(pose.position(), orientation / squared.sqrt())
}

/// Returns true if a twist is faster than a device may report (10 m/s or 100 rad/s), or a number is NaN. Real-time:
/// bounded, no allocation.
#[inline]
#[must_use]
pub fn is_too_fast(twist: &Twist) -> bool {
    let per_speed = TWIST_OVERSHOOT * SPEED_M_PER_S;
    let per_spin = TWIST_OVERSHOOT * SPIN_RAD_PER_S;
    let is_possible = twist.linear().length_squared() <= per_speed * per_speed
        && twist.angular().length_squared() <= per_spin * per_spin;
    !is_possible
}

#[cfg(test)]
mod tests;
