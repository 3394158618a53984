//! Heating of the coils: an I²t model with the two faults reported by the device.
//!
//! The mean square current `L` (load, A²) and the temperature `T` (°C) follow the square of the current with a first-order lag:
//!
//! ```text
//! load:         L' = (i^2 - L) / 60 s                   over-current when the square root of L exceeds 2 A
//! temperature:  T' = (T_ambient + r i^2 - T) / tau      over-temperature above 250 °C
//! ```
//!
//! The limits (about 2 A over a minute, 250 °C) are published in the interface of the device. The steady-state temperature rise
//! `r` (K/A²) and the time constant `tau` (s) were never published; with the values here, a constant 2 A leads to 180 °C after
//! some minutes. So a cool device reaches the current limit first; the temperature limit needs a hot room, or badly cooled coils.

use super::coils::{COILS, Currents};
use crate::lag::Lag;
use crate::validation::{Check, Domain, number};
use flotor_hal::{Fault, restorable};

/// Limit of the root mean square current over a minute, A.
pub const MEAN_CURRENT_LIMIT_A: f64 = 2.0;

/// Time constant of the mean current, s.
const CURRENT_LAG_S: f64 = 60.0;

/// Largest allowed temperature of a coil, °C.
pub const TEMPERATURE_LIMIT_C: f64 = 250.0;

/// Thermal parameters of a coil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalParameters {
    /// Temperature around the device, °C.
    pub ambient_c: f64,
    /// Steady-state temperature rise per square of the current, K/A².
    pub rise_k_per_a2: f64,
    /// Time constant of the rise, s.
    pub lag_s: f64,
}

impl ThermalParameters {
    /// Estimate (see the module documentation).
    pub const MAGLEV: Self = Self { ambient_c: 20.0, rise_k_per_a2: 40.0, lag_s: 120.0 };

    pub(super) fn check(&self) -> Check {
        number("coil_ambient_c", self.ambient_c, Domain::Finite)?;
        number("coil_rise_k_per_a2", self.rise_k_per_a2, Domain::NotNegative)?;
        number("coil_lag_s", self.lag_s, Domain::Positive)
    }
}

/// Thermal state of all coils.
#[derive(Clone, Copy, Debug)]
pub struct Thermal {
    parameters: ThermalParameters,
    minute: Lag,
    warming: Lag,
    load_a2: Currents,
    temperature_c: Currents,
}

restorable!(Thermal { load_a2, temperature_c } without { parameters, minute, warming });

impl Thermal {
    /// Creates coils at ambient temperature. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(parameters: ThermalParameters) -> Self {
        Self {
            parameters,
            minute: Lag::new(CURRENT_LAG_S),
            warming: Lag::new(parameters.lag_s),
            load_a2: [0.0; COILS],
            temperature_c: [parameters.ambient_c; COILS],
        }
    }

    /// Advances loads and temperatures by `dt_s` (s) with constant `currents_a` (A). Real-time: bounded, no allocation.
    pub fn heat(&mut self, currents_a: &Currents, dt_s: f64) {
        let ThermalParameters { ambient_c, rise_k_per_a2, .. } = self.parameters;
        let (load_share, heat_share) = (self.minute.closed(dt_s), self.warming.closed(dt_s));
        for ((current, load), temperature) in
            currents_a.iter().zip(&mut self.load_a2).zip(&mut self.temperature_c)
        {
            let square_a2 = current * current;
            *load += (square_a2 - *load) * load_share;
            *temperature += (ambient_c + rise_k_per_a2 * square_a2 - *temperature) * heat_share;
        }
    }

    /// Returns the root mean square current of the most loaded coil, A, weighted exponentially over the past with a
    /// time constant of a minute. Real-time: bounded, no allocation.
    #[must_use]
    pub fn mean_current_a(&self) -> f64 {
        self.load_a2.iter().copied().fold(0.0, f64::max).sqrt()
    }

    /// Returns the temperature of each coil, °C. Real-time: bounded, no allocation.
    #[must_use]
    pub fn temperatures_c(&self) -> Currents {
        self.temperature_c
    }

    /// Returns the temperature of the hottest coil, °C. Real-time: bounded, no allocation.
    #[must_use]
    pub fn hottest_c(&self) -> f64 {
        self.temperature_c.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the thermal fault: over-temperature before over-current; `None` within both limits. Real-time: bounded,
    /// no allocation.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        if self.hottest_c() > TEMPERATURE_LIMIT_C {
            Some(Fault::OverTemperature)
        } else if self.mean_current_a() > MEAN_CURRENT_LIMIT_A {
            Some(Fault::OverCurrent)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds_to_fault(parameters: ThermalParameters, current_a: f64, tick_s: f64) -> (f64, Option<Fault>) {
        let mut thermal = Thermal::new(parameters);
        let mut elapsed_s = 0.0;
        while thermal.fault().is_none() && elapsed_s < 600.0 {
            thermal.heat(&[0.0, current_a, 0.0, 0.0, 0.0, 0.0], tick_s);
            elapsed_s += tick_s;
        }
        (elapsed_s, thermal.fault())
    }

    #[test]
    fn full_current_faults_when_the_exponential_says_and_two_amperes_never_do() {
        let (elapsed_s, fault) = seconds_to_fault(ThermalParameters::MAGLEV, 3.5, 0.01);
        // 12.25 (1 - e^(-t / 60)) = 4.
        let expected_s = -60.0 * (1.0_f64 - 4.0 / 12.25).ln();
        assert!((elapsed_s - expected_s).abs() < 0.02, "one tick: {elapsed_s} {expected_s}");
        assert_eq!(fault, Some(Fault::OverCurrent));
        assert_eq!(seconds_to_fault(ThermalParameters::MAGLEV, 1.99, 0.01).1, None);
    }

    #[test]
    fn coils_that_cool_badly_run_hot_first() {
        let badly_cooled =
            ThermalParameters { rise_k_per_a2: 100.0, lag_s: 20.0, ..ThermalParameters::MAGLEV };
        assert_eq!(seconds_to_fault(badly_cooled, 3.5, 0.01).1, Some(Fault::OverTemperature));
    }

    #[test]
    fn the_length_of_a_tick_does_not_matter() {
        let run = |tick_s: f64, ticks: u32| {
            let mut thermal = Thermal::new(ThermalParameters::MAGLEV);
            (0..ticks).for_each(|_| thermal.heat(&[1.5; COILS], tick_s));
            (thermal.hottest_c(), thermal.mean_current_a())
        };
        let ((coarse_c, coarse_a), (fine_c, fine_a)) = (run(1.0, 10), run(1.0e-3, 10_000));
        // Rounding of ten thousand additions.
        assert!((coarse_c - fine_c).abs() < 1.0e-9 && (coarse_a - fine_a).abs() < 1.0e-10);
    }
}
