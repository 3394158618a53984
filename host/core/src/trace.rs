//! Record of one tick, for all observers: recorder, plot, digest, viewer.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::ModelOutputs;
use crate::grip::{self, GripRecord};
use crate::words::Decoder;
use flotor_hal::{Demand, Pose, Twist, Wrench};
use flotor_sync::Words;

/// Events of a tick, as a bit set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Events {
    bits: u32,
}

/// Defines a constant for each event, with its bit and its name, lowest bit first.
macro_rules! events {
    ($($(#[$doc:meta])+ $event:ident = $bit:literal $name:literal,)+) => {
        impl Events {
            $($(#[$doc])+ pub const $event: Events = Events { bits: 1 << $bit };)+

            /// Names of the bits, lowest first: for reports and recordings.
            pub const NAMES: [&'static str; [$($bit),+].len()] = [$($name),+];
        }
    };
}

events! {
    /// The device had no new sample.
    STALE_SAMPLE = 0 "stale_sample",
    /// A requested wrench was not finite and was replaced by zero, or a sample was not finite and was not used.
    NOT_FINITE = 1 "not_finite",
    /// The force was limited.
    FORCE_LIMITED = 2 "force_limited",
    /// The torque was limited.
    TORQUE_LIMITED = 3 "torque_limited",
    /// The slew rate was limited.
    SLEW_LIMITED = 4 "slew_limited",
    /// The handle was outside the boundary and was pushed back.
    BOUNDARY = 5 "boundary",
    /// A model failed and contributes nothing any more.
    MODEL_FAULT = 6 "model_fault",
    /// The device reported a fault.
    DEVICE_FAULT = 7 "device_fault",
    /// The force was fading in.
    RAMPING = 8 "ramping",
    /// A model left its domain, saturated its output, or did not converge.
    MODEL_DEGRADED = 9 "model_degraded",
    /// One or more ticks were missed before this one.
    MISSED = 10 "missed",
    /// The device's actuators were at their limit and delivered less than commanded.
    SATURATED = 11 "saturated",
    /// No usable sample arrived for a while: no force.
    HOLDING = 12 "holding",
    /// The force was fading out, on the way to an orderly end.
    RELEASING = 13 "releasing",
    /// The emergency stop was pressed.
    EMERGENCY_STOP = 14 "emergency_stop",
    /// The handle was faster than allowed: the force component along the velocity was removed.
    VELOCITY_LIMITED = 15 "velocity_limited",
    /// A change to a plugin was applied or rejected before this tick.
    PARAMETER_CHANGED = 16 "parameter_changed",
    /// The port would have generated energy; the passivity controller removed it.
    PASSIVITY_DAMPED = 17 "passivity_damped",
    /// A model took longer than its budget.
    MODEL_OVERRUN = 18 "model_overrun",
    /// The force requested of the device exceeds its recommended force.
    EXCESS_FORCE = 19 "excess_force",
    /// No message of the remote end of a coupling arrives: the coupling exerts no force.
    PARTNER_SILENT = 20 "partner_silent",
    /// A device or a remote end sent an implausible state, which was not used.
    IMPLAUSIBLE_SAMPLE = 21 "implausible_sample",
    /// A plugin changed rounding mode, flush-to-zero or traps of the loop's thread; the host restored them at once.
    FLOAT_ENVIRONMENT = 22 "float_environment",
    /// The remote end of a coupling claimed too much motion or energy: the excess was ignored.
    PARTNER_LIMITED = 23 "partner_limited",
    /// The force alternated between its limits: it was reduced.
    OSCILLATION_DAMPED = 24 "oscillation_damped",
}

impl Events {
    /// No events.
    pub const NONE: Events = Events { bits: 0 };

    /// Events that end the run, disable a model, or reduce the force after an oscillation.
    pub const FAULTS: Events =
        Self::EMERGENCY_STOP.with(Self::DEVICE_FAULT).with(Self::MODEL_FAULT).with(Self::OSCILLATION_DAMPED);

    /// Events that restrict a tick, such as limits and missing data.
    pub const LIMITS: Events = Self::FORCE_LIMITED
        .with(Self::TORQUE_LIMITED)
        .with(Self::BOUNDARY)
        .with(Self::MISSED)
        .with(Self::HOLDING)
        .with(Self::VELOCITY_LIMITED)
        .with(Self::NOT_FINITE)
        .with(Self::IMPLAUSIBLE_SAMPLE)
        .with(Self::MODEL_DEGRADED)
        .with(Self::PARTNER_SILENT);

    /// Returns the union of both sets. Real-time: bounded, no allocation.
    #[inline]
    pub const fn with(self, other: Events) -> Self {
        Self { bits: self.bits | other.bits }
    }

    /// Returns each event of the set with its human-readable name. Not real-time.
    pub fn named(self) -> impl Iterator<Item = (Events, String)> {
        let each = (0..).zip(Self::NAMES).map(|(bit, name)| (Self::from_bits(1 << bit), name));
        each.filter(move |(event, _)| self.intersects(*event))
            .map(|(event, name)| (event, name.replace('_', " ")))
    }

    /// Adds events. Real-time: bounded, no allocation.
    #[inline]
    pub fn insert(&mut self, other: Events) {
        self.bits |= other.bits;
    }

    /// Returns true if the sets have an event in common. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn intersects(self, other: Events) -> bool {
        self.bits & other.bits != 0
    }

    /// Returns the set as a bit mask, in the order of [`Self::NAMES`].
    #[inline]
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.bits
    }

    /// Creates the set from a bit mask.
    #[inline]
    pub const fn from_bits(bits: u32) -> Self {
        Self { bits }
    }
}

/// Record of one tick at one device, in the device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRecord {
    /// Number of the tick, below 2^46: 2200 years at 1 kHz.
    pub tick: u64,
    /// Index of the device in the scene: each tick yields one record per device, in the order of the devices.
    pub device: u16,
    /// Scheduled time since the loop started, ns.
    pub time_ns: u64,
    /// Scheduled time since the previous tick, ns.
    pub dt_ns: u64,
    /// Pose of the handle, m and unit quaternion.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s.
    pub twist: Twist,
    /// Sum of the outputs of models and couplings, in the device frame and scaled to the device.
    pub model: ModelOutputs,
    /// Wrench sent to the device after the envelope, N and N·m.
    pub commanded: Wrench,
    /// Wrench delivered since the previous tick, as the device reports it, N and N·m.
    pub delivered: Wrench,
    /// Energy that the hand has put into the device's port so far, less the energy that has come out, J.
    pub port_energy_j: f64,
    /// Grip of the device; `None` without one.
    pub grip: Option<GripRecord>,
    /// Events of the tick.
    pub events: Events,
    /// Buttons of the device, one bit each.
    pub buttons: u32,
    /// Delay of the start of the tick, ns; 0 on the virtual clock. Not part of the digest.
    pub lateness_ns: u64,
    /// Duration of the tick, ns. Not part of the digest.
    pub compute_ns: u64,
}

/// Number of 64-bit words of a record. The last [`TIMING_WORDS`] depend on the machine and are excluded from digests; the words of
/// the [grip](grip::GRIP_WORDS) come before them.
pub const RECORD_WORDS: usize = 45;
/// Number of words with measured times, at the end of a record.
pub const TIMING_WORDS: usize = 2;

/// Bits of the first word that hold the number of the tick; the flags of absent outputs come next, then the device.
const TICK_BITS: u32 = 46;
const TICK_MASK: u64 = (1 << TICK_BITS) - 1;
/// Outputs of the models, each with the bit of the first word that marks it as absent.
const ABSENT: [(Demand, u64); 2] = [(Demand::TORQUE, 1 << TICK_BITS), (Demand::ENERGY, 1 << (TICK_BITS + 1))];
/// First bit of the number of the device.
const DEVICE_BIT: u32 = TICK_BITS + 2;

impl Words<RECORD_WORDS> for TickRecord {
    /// Unrolled: this runs in every tick, and a loop over the parts takes three times as long.
    #[inline]
    fn to_words(&self) -> [u64; RECORD_WORDS] {
        let Pose { position_m: [x, y, z], orientation_xyzw: [qx, qy, qz, qw] } = self.pose;
        let Twist { linear_m_per_s: [vx, vy, vz], angular_rad_per_s: [wx, wy, wz] } = self.twist;
        let six = |wrench: &Wrench| {
            let Wrench { force_n: [fx, fy, fz], torque_nm: [tx, ty, tz] } = *wrench;
            [fx, fy, fz, tx, ty, tz].map(f64::to_bits)
        };
        let (model, energy_j) = self.model.numbers();
        let [m0, m1, m2, m3, m4, m5] = six(model);
        let [c0, c1, c2, c3, c4, c5] = six(&self.commanded);
        let [d0, d1, d2, d3, d4, d5] = six(&self.delivered);
        let [x, y, z, qx, qy, qz, qw] = [x, y, z, qx, qy, qz, qw].map(f64::to_bits);
        let [vx, vy, vz, wx, wy, wz] = [vx, vy, vz, wx, wy, wz].map(f64::to_bits);
        let computed = self.model.computed();
        let absent = |(output, bit): (Demand, u64)| if computed.contains(output) { 0 } else { bit };
        let [torque, energy_bit] = ABSENT.map(absent);
        let number = self.tick & TICK_MASK | torque | energy_bit | u64::from(self.device) << DEVICE_BIT;
        let flags = u64::from(self.events.bits) | u64::from(self.buttons) << 32;
        let [energy, port_energy] = [energy_j, self.port_energy_j].map(f64::to_bits);
        let [g0, g1, g2, g3, g4, g5] = grip::to_words(self.grip);
        #[rustfmt::skip] // a line for each part of a record
        let words = [
            number, self.time_ns, self.dt_ns,
            x, y, z, qx, qy, qz, qw,
            vx, vy, vz, wx, wy, wz,
            m0, m1, m2, m3, m4, m5,
            c0, c1, c2, c3, c4, c5,
            d0, d1, d2, d3, d4, d5,
            energy, port_energy, flags,
            g0, g1, g2, g3, g4, g5,
            self.lateness_ns, self.compute_ns,
        ];
        words
    }

    #[inline]
    fn from_words(words: &[u64; RECORD_WORDS]) -> Self {
        let mut words = Decoder::of(words);
        let (number, time_ns, dt_ns) = (words.word(), words.word(), words.word());
        #[allow(clippy::cast_possible_truncation)] // two parts of one word
        let (tick, device) = (number & TICK_MASK, (number >> DEVICE_BIT) as u16);
        let computed = ABSENT.iter().fold(Demand::FORCE, |computed, (output, bit)| {
            if number & bit == 0 { computed.with(*output) } else { computed }
        });
        let (pose, twist) = words.motion();
        let (model, commanded, delivered) = (words.wrench(), words.wrench(), words.wrench());
        let [energy_j, port_energy_j] = words.numbers();
        let model = ModelOutputs::new(model, energy_j).limited_to(computed);
        let flags = words.word();
        #[allow(clippy::cast_possible_truncation)] // two halves of one word
        let (events, buttons) = (Events::from_bits(flags as u32), (flags >> 32) as u32);
        let grip = grip::from_words(std::array::from_fn(|_| words.word()));
        let (lateness_ns, compute_ns) = (words.word(), words.word());
        Self {
            tick,
            device,
            time_ns,
            dt_ns,
            pose,
            twist,
            model,
            commanded,
            delivered,
            port_energy_j,
            grip,
            events,
            buttons,
            lateness_ns,
            compute_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grip::GRIP_WORDS;
    use flotor_hal::GripKind;

    #[test]
    fn every_word_of_a_record_survives_the_ring() {
        let mut words: [u64; RECORD_WORDS] =
            std::array::from_fn(|i| 0x3ff0_0000_0000_0000 + i as u64 * 0x101);
        let code = RECORD_WORDS - TIMING_WORDS - 1;
        for (kind, number) in [(GripKind::Linear, 1), (GripKind::Angular, 2)] {
            words[code] = number;
            let record = TickRecord::from_words(&words);
            assert_eq!(record.to_words(), words);
            assert_eq!(record.grip.map(|grip| grip.state.kind()), Some(kind));
        }
        words[code] = 3;
        assert_eq!(TickRecord::from_words(&words).grip, None);
        words[code + 1 - GRIP_WORDS..=code].fill(0);
        assert_eq!(TickRecord::from_words(&words).to_words(), words, "without a grip");
    }

    #[test]
    fn an_absent_output_stays_absent_and_leaves_no_number() {
        let all = TickRecord::from_words(&std::array::from_fn(|i| i as u64 + 1));
        for demand in [Demand::FORCE, Demand::WRENCH, Demand::FORCE.with(Demand::ENERGY), Demand::ALL] {
            let record = TickRecord { model: all.model.limited_to(demand), ..all };
            let back = TickRecord::from_words(&record.to_words());
            assert_eq!((back, back.model.computed()), (record, demand));
            assert_eq!(back.model.torque().is_some(), demand.contains(Demand::TORQUE));
            assert_eq!(back.model.energy_j().is_some(), demand.contains(Demand::ENERGY));
            assert_eq!((back.tick, back.device), (all.tick, all.device));
        }
    }
}
