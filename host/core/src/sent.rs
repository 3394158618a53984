//! Inputs and contact sets as arrays of words, which two threads or two processes share.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::words::{CONTACT_SET_WORDS, Decoder, Encoder, MOTION_WORDS};
use flotor_hal::{ContactSet, Demand, Input};
use flotor_sync::Words;

/// Number of words of an input: motion, time, period, tick, and one for buttons and demand.
pub const INPUT_WORDS: usize = MOTION_WORDS + 4;

/// Demands in the order of their bits in a record.
pub const DEMANDS: [Demand; 3] = [Demand::FORCE, Demand::TORQUE, Demand::ENERGY];

const NO_DEMAND: Demand = Demand::FORCE.limited_to(Demand::TORQUE);

/// Returns the sum of the flagged demands; flags in the order of [`DEMANDS`]. Real-time: bounded, no allocation.
pub fn demand_of(flags: [bool; 3]) -> Demand {
    let demands = DEMANDS.iter().zip(flags).filter_map(|(demand, flag)| flag.then_some(*demand));
    demands.fold(NO_DEMAND, Demand::with)
}

/// Input sent from one thread or process to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SentInput(pub Input);

impl Words<INPUT_WORDS> for SentInput {
    #[inline]
    fn to_words(&self) -> [u64; INPUT_WORDS] {
        let Self(Input { pose, twist, time_ns, dt_ns, tick, buttons, demand }) = self;
        let [force, torque, energy] = DEMANDS.map(|one| u64::from(demand.contains(one)));
        let flags = u64::from(*buttons) | (force | torque << 1 | energy << 2) << 32;
        Encoder::of_zeros().motion(pose, twist).words([*time_ns, *dt_ns, *tick, flags]).finish()
    }

    #[inline]
    fn from_words(words: &[u64; INPUT_WORDS]) -> Self {
        let mut words = Decoder::of(words);
        let (pose, twist) = words.motion();
        let (time_ns, dt_ns, tick, flags) = (words.word(), words.word(), words.word(), words.word());
        let demand = demand_of([32, 33, 34].map(|bit| flags >> bit & 1 == 1));
        #[allow(clippy::cast_possible_truncation)] // the lower half
        Self(Input { pose, twist, time_ns, dt_ns, tick, buttons: flags as u32, demand })
    }
}

/// Contact set sent from one thread or process to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SentSet(pub ContactSet);

impl Words<CONTACT_SET_WORDS> for SentSet {
    #[inline]
    fn to_words(&self) -> [u64; CONTACT_SET_WORDS] {
        Encoder::of_zeros().contact_set(&self.0).finish()
    }

    #[inline]
    fn from_words(words: &[u64; CONTACT_SET_WORDS]) -> Self {
        Self(Decoder::of(words).contact_set())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{Contact, LinearField, Pose, Twist, Wrench};

    #[test]
    fn inputs_and_contact_sets_cross_bit_for_bit() {
        let mut number = 0.0;
        let mut next = || {
            number += 0.1;
            number
        };
        let pose = Pose {
            position_m: std::array::from_fn(|_| next()),
            orientation_xyzw: std::array::from_fn(|_| next()),
        };
        let twist = Twist {
            linear_m_per_s: std::array::from_fn(|_| next()),
            angular_rad_per_s: std::array::from_fn(|_| next()),
        };
        for demand in [Demand::FORCE, Demand::WRENCH, Demand::FORCE.with(Demand::ENERGY), Demand::ALL] {
            let input =
                Input { pose, twist, time_ns: u64::MAX, dt_ns: 3, tick: 7, buttons: u32::MAX, demand };
            assert_eq!(SentInput::from_words(&SentInput(input).to_words()), SentInput(input));
        }
        let field = LinearField {
            anchor: pose,
            wrench: Wrench {
                force_n: std::array::from_fn(|_| next()),
                torque_nm: std::array::from_fn(|_| next()),
            },
            stiffness: std::array::from_fn(|_| std::array::from_fn(|_| next())),
            valid_m: f64::INFINITY,
            valid_rad: next(),
            time_ns: 12_345,
        };
        let contacts = std::array::from_fn(|_| Contact {
            tool_point_m: std::array::from_fn(|_| next()),
            surface_point_m: std::array::from_fn(|_| next()),
            normal: std::array::from_fn(|_| next()),
            gap_m: next(),
            surface_velocity_m_per_s: std::array::from_fn(|_| next()),
            stiffness_n_per_m: next(),
            tangential_stiffness_n_per_m: next(),
            damping_ns_per_m: next(),
            friction: next(),
        });
        let (valid_m, valid_rad, valid_s) = (next(), next(), next());
        let (anchor, count, has_field, time_ns) = (pose, 16, 1, 67_890);
        let set =
            ContactSet { anchor, contacts, count, has_field, valid_m, valid_rad, valid_s, field, time_ns };
        assert_eq!(SentSet::from_words(&SentSet(set).to_words()), SentSet(set));
    }
}
