//! From the commanded wrench to the one the flotor feels: coils, amplifiers, field, heat.
//!
//! The flotor is driven by six flat coils in the field of magnets on the frame (Lorentz levitation). Each
//! pushes along one line, in proportion to its current:
//!
//! ```text
//! commanded wrench -> currents -> limit -> amplifiers -> wrench of the currents -> uneven field -> delivered
//! ```
//!
//! - [`coils`]: where the coils sit and what a current does.
//! - [`thermal`]: how hot they get, and when that is a fault.
//! - [`field`]: how much the vertical force is off at a height.
//!
//! **Limit.** A coil carries 3.5 A at most. Where a wrench asks for more, *all six* currents are scaled alike:
//! a spring at its limit then feels softer, but pulls in the right direction. Clipping each coil for itself
//! would give a little more force and turn it, which couples the axes of a loop that was stable in each.
//!
//! **Amplifiers** follow their command with a first-order lag. The plant takes a constant wrench for a tick,
//! so each coil is given its mean current over the tick: the momentum that goes into the flotor is exact.

pub mod coils;
pub mod field;
pub mod thermal;

use crate::lag::Lag;
use crate::plant::Wrench;
use crate::validation::{Check, Domain, InvalidParameter, number};
use coils::{COILS, CoilGeometry, Coils, Currents};
use field::FieldError;
use flotor_hal::Fault;
use thermal::{Thermal, ThermalParameters};

/// What the actuation is built from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuationParameters {
    /// Where the coils sit.
    pub geometry: CoilGeometry,
    /// Bandwidth of the current amplifiers, Hz.
    pub amplifier_bandwidth_hz: f64,
    /// Unevenness of the field.
    pub field: FieldError,
    /// Heat.
    pub thermal: ThermalParameters,
}

impl ActuationParameters {
    /// The geometry that meets the published force limits, the thesis's field. The bandwidth is an estimate:
    /// switching amplifiers on coils of about a millihenry reach a few kHz.
    pub const MAGLEV: Self = Self {
        geometry: CoilGeometry::MAGLEV,
        amplifier_bandwidth_hz: 2000.0,
        field: FieldError::THESIS,
        thermal: ThermalParameters::MAGLEV,
    };

    fn check(&self) -> Check {
        number("amplifier_bandwidth_hz", self.amplifier_bandwidth_hz, Domain::Positive)?;
        self.field.check()?;
        self.thermal.check()
    }
}

/// Whether every coil conducts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// All do.
    Intact,
    /// This one (0 to 5) does not.
    Open(usize),
}

/// Coils and amplifiers in operation.
#[derive(Clone, Debug)]
pub struct Actuation {
    coils: Coils,
    lag: Lag,
    field: FieldError,
    thermal: Thermal,
    currents_a: Currents,
    is_saturated: bool,
    saturated_ticks: u64,
}

impl Actuation {
    /// Cold coils without current. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not physical, or the coils cannot push in all six directions.
    pub fn new(parameters: &ActuationParameters) -> Result<Self, InvalidParameter> {
        parameters.check()?;
        Ok(Self {
            coils: Coils::new(&parameters.geometry)?,
            lag: Lag::of_bandwidth(parameters.amplifier_bandwidth_hz),
            field: parameters.field,
            thermal: Thermal::new(parameters.thermal),
            currents_a: [0.0; COILS],
            is_saturated: false,
            saturated_ticks: 0,
        })
    }

    /// The mean wrench on the flotor over the next `dt_s` (s) while `commanded` (finite) is asked for, at a
    /// height of `z_m` above home.
    ///
    /// Real-time: bounded, no allocation.
    pub fn drive(&mut self, commanded: &Wrench, wiring: Wiring, z_m: f64, dt_s: f64) -> Wrench {
        let (mut asked_a, share) = self.coils.currents(commanded);
        self.is_saturated = share < 1.0;
        self.saturated_ticks += u64::from(self.is_saturated);
        if let Wiring::Open(coil) = wiring
            && let Some(current) = asked_a.get_mut(coil)
        {
            *current = 0.0;
        }
        // i' = (asked - i) / lag: what is closed of the gap at the end, and what is open of it on average.
        let (closed, open) = (self.lag.closed(dt_s), self.lag.mean_open(dt_s));
        let mut mean_a = [0.0; COILS];
        for ((current, asked), mean_current) in self.currents_a.iter_mut().zip(asked_a).zip(&mut mean_a) {
            let behind = *current - asked;
            *mean_current = asked + behind * open;
            *current -= behind * closed;
        }
        if let Wiring::Open(coil) = wiring
            && let (Some(now), Some(mean)) = (self.currents_a.get_mut(coil), mean_a.get_mut(coil))
        {
            (*now, *mean) = (0.0, 0.0);
        }
        self.thermal.heat(&mean_a, dt_s);
        let mut delivered = self.coils.wrench(&mean_a);
        delivered.force_n.z *= self.field.delivered_share(z_m);
        delivered
    }

    /// The coils' own fault, if they have one. Real-time: bounded, no allocation.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.thermal.fault()
    }

    /// Temperature and load of the coils. Real-time: bounded, no allocation.
    #[must_use]
    pub fn thermal(&self) -> &Thermal {
        &self.thermal
    }

    /// True if the last wrench was scaled down to the current limit. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.is_saturated
    }

    /// Ticks so far in which the wrench was scaled down to the current limit. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn saturated_ticks(&self) -> u64 {
        self.saturated_ticks
    }
}

#[cfg(test)]
mod tests;
