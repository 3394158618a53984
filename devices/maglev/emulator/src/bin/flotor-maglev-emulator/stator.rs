//! Additions to the simulated flotor: a stator and buttons.

use flotor_hal::{DVec3, Wrench, rotation_vector};
use flotor_maglev_emulator::Plant;
use flotor_maglev_emulator::controller::Sample;
use std::str::FromStr;

/// Height of the flotor at first contact with the lower stator, m.
const TOUCH_M: f64 = -9.0e-3;
/// Stiffness and damping of the stator's bowl along z, across, and of rotation. Stiff enough for a sinkage of half a
/// millimetre under the flotor's weight, damped enough for a fall without a bounce, stable at a cycle of 10 ms.
const STIFFNESS_N_PER_M: f64 = 10_000.0;
const DAMPING_NS_PER_M: f64 = 60.0;
const ACROSS_N_PER_M: f64 = 2000.0;
const ACROSS_NS_PER_M: f64 = 30.0;
const TURN_NM_PER_RAD: f64 = 2.0;
const TURN_NMS_PER_RAD: f64 = 0.03;

/// Settling time of the flotor on its stator before the emulation starts, in steps of 1 ms.
const SETTLING_MS: u64 = 500;

/// Plant with a stator below the flotor.
pub(crate) struct OnStator<P> {
    plant: P,
    sample: Sample,
}

impl<P: Plant> OnStator<P> {
    pub(crate) fn new(plant: P) -> Self {
        let mut settled = Self { plant, sample: Sample::HOME };
        settled.settle();
        settled
    }

    /// Lets the flotor come to rest on the stator.
    fn settle(&mut self) {
        self.sample = self.plant.advance(0, &Wrench::ZERO);
        for _ in 0..SETTLING_MS {
            self.advance(1000, &Wrench::ZERO);
        }
    }

    /// Returns the contact wrench of the stator on the flotor.
    fn contact(&self) -> Wrench {
        let (position, velocity) = (self.sample.pose.position(), self.sample.twist.linear());
        let depth_m = TOUCH_M - position.z;
        if depth_m <= 0.0 {
            return Wrench::ZERO;
        }
        let up = (STIFFNESS_N_PER_M * depth_m - DAMPING_NS_PER_M * velocity.z).max(0.0);
        let across = -position * ACROSS_N_PER_M - velocity * ACROSS_NS_PER_M;
        let turn = rotation_vector(self.sample.pose.orientation());
        let torque = -turn * TURN_NM_PER_RAD - self.sample.twist.angular() * TURN_NMS_PER_RAD;
        Wrench::new(DVec3::new(across.x, across.y, up), torque)
    }
}

impl<P: Plant> Plant for OnStator<P> {
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample {
        let wrench = *wrench + self.contact();
        self.sample = self.plant.advance(dt_us, &wrench);
        self.sample
    }

    fn restart(&mut self) {
        self.plant.restart();
        self.settle();
    }
}

/// Interval in which a button is pressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Press {
    bit: u32,
    from_s: f64,
    to_s: f64,
}

impl FromStr for Press {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (button, times) = text.split_once('@')?;
            let (from, to) = times.split_once('-')?;
            let bit = match button {
                "left" => 1,
                "right" => 2,
                _ => return None,
            };
            let time_s = |text: &str| text.trim().parse().ok().filter(|time_s: &f64| time_s.is_finite());
            Some(Self { bit, from_s: time_s(from)?, to_s: time_s(to)? })
        };
        parse().ok_or_else(|| {
            format!("`{text}` is not a button press: write left@1.5-2 or right@0-10, times in s")
        })
    }
}

/// A plant with scripted button presses.
pub(crate) struct Pressed<P> {
    plant: P,
    presses: Vec<Press>,
    time_us: u64,
}

impl<P: Plant> Pressed<P> {
    pub(crate) fn new(plant: P, presses: &[Press]) -> Self {
        Self { plant, presses: presses.to_vec(), time_us: 0 }
    }
}

impl<P: Plant> Plant for Pressed<P> {
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample {
        let sample = self.plant.advance(dt_us, wrench);
        self.time_us += dt_us;
        let now_s = self.time_us as f64 * 1.0e-6;
        let pressed = self.presses.iter().filter(|press| (press.from_s..press.to_s).contains(&now_s));
        Sample { buttons: pressed.fold(sample.buttons, |bits, press| bits | press.bit), ..sample }
    }

    fn restart(&mut self) {
        self.plant.restart();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_is_read_as_it_is_written() {
        assert_eq!("left@1.5-2".parse(), Ok(Press { bit: 1, from_s: 1.5, to_s: 2.0 }));
        for wrong in ["middle@0-1", "left", "left@1", "left@a-b", "left@nan-1", "left@0-inf"] {
            assert!(wrong.parse::<Press>().is_err(), "{wrong}");
        }
    }
}
