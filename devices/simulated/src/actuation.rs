//! Conversion of the commanded wrench to the delivered wrench: coils, amplifiers, field, heat.
//!
//! The flotor is driven by six flat coils in the field of magnets on the frame (Lorentz levitation). Each coil exerts a
//! force along one line, in proportion to its current:
//!
//! ```text
//! commanded wrench -> currents -> limit -> amplifiers -> wrench of the currents -> uneven field -> delivered
//! ```
//!
//! - [`coils`]: placement of the coils and their wrenches.
//! - [`thermal`]: temperatures of the coils, and thermal faults.
//! - [`field`]: error of the vertical force over the height.
//!
//! **Limit.** A coil carries 3.5 A at most. If a wrench needs more, *all six* currents are scaled by one factor: a
//! spring at its limit is then softer, but its force keeps its direction. Clipping each coil separately would give a
//! little more force, in a wrong direction, and would couple axes that are each stable alone.
//!
//! **Amplifiers** follow their command with a first-order lag. The plant takes a constant wrench for a tick, so each
//! coil gets its mean current over the tick: the momentum of the flotor is exact.

pub mod coils;
pub mod field;
pub mod thermal;

use crate::lag::Lag;
use crate::plant::Wrench;
use crate::validation::{Domain, InvalidParameter, number};
use coils::{COILS, CoilGeometry, Coils, Currents};
use field::FieldError;
use flotor_hal::{Fault, restorable};
use thermal::{Thermal, ThermalParameters};

/// Parameters of coils, amplifiers and field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuationParameters {
    /// Geometry of the coils, and the force of one coil at the current limit.
    pub geometry: CoilGeometry,
    /// Bandwidth of the current amplifiers, Hz.
    pub amplifier_bandwidth_hz: f64,
    /// Unevenness of the field.
    pub field: FieldError,
    /// Thermal parameters of the coils.
    pub thermal: ThermalParameters,
}

impl ActuationParameters {
    /// Geometry that meets the published force limits, with the thesis's field. The bandwidth is an estimate: switching
    /// amplifiers on coils of about a millihenry reach a few kHz.
    pub const MAGLEV: Self = Self {
        geometry: CoilGeometry::MAGLEV,
        amplifier_bandwidth_hz: 2000.0,
        field: FieldError::THESIS,
        thermal: ThermalParameters::MAGLEV,
    };
}

/// Wiring of the coils: intact, or with one open circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// All coils conduct.
    Intact,
    /// The coil of this index (0 to 5, ring A first) does not conduct.
    Open(usize),
}

/// Amplifiers, coils and field of a running device: currents, temperatures, saturation.
#[derive(Clone, Debug)]
pub struct Actuation {
    coils: Coils,
    lag: Lag,
    field: FieldError,
    thermal: Thermal,
    currents_a: Currents,
    is_saturated: bool,
}

restorable!(Actuation { thermal, currents_a, is_saturated } without { coils, lag, field });

impl Actuation {
    /// Creates cold coils without current. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not physical, or the wrenches of the six coils are linearly dependent, so that some forces or torques cannot
    /// be produced.
    pub fn new(parameters: &ActuationParameters) -> Result<Self, InvalidParameter> {
        number("amplifier_bandwidth_hz", parameters.amplifier_bandwidth_hz, Domain::Positive)?;
        parameters.field.check()?;
        parameters.thermal.check()?;
        Ok(Self {
            coils: Coils::new(&parameters.geometry)?,
            lag: Lag::of_bandwidth(parameters.amplifier_bandwidth_hz),
            field: parameters.field,
            thermal: Thermal::new(parameters.thermal),
            currents_a: [0.0; COILS],
            is_saturated: false,
        })
    }

    /// Advances currents and temperatures by `dt_s` (s) under a constant `commanded` (finite) wrench; returns the mean
    /// wrench on the flotor over that time, at a height of `z_m` above home.
    ///
    /// Real-time: bounded, no allocation.
    pub fn drive(&mut self, commanded: &Wrench, wiring: Wiring, z_m: f64, dt_s: f64) -> Wrench {
        let (mut asked_a, share) = self.coils.currents(commanded);
        self.is_saturated = share < 1.0;
        if let Wiring::Open(coil) = wiring
            && let Some(current) = asked_a.get_mut(coil)
        {
            *current = 0.0;
        }
        // i' = (asked - i) / lag: closed fraction of the gap at the end, and mean open fraction.
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

    /// Returns the thermal fault of the coils; `None` within the limits. Real-time: bounded, no allocation.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.thermal.fault()
    }

    /// Returns the thermal state of the coils. Real-time: bounded, no allocation.
    #[must_use]
    pub fn thermal(&self) -> &Thermal {
        &self.thermal
    }

    /// Returns true if the last wrench was scaled down to the current limit. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_saturated(&self) -> bool {
        self.is_saturated
    }
}

#[cfg(test)]
mod tests;
