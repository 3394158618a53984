//! Measured quantities, with the unit and the minimum range of an axis.
//!
//! Without a minimum range, an automatic axis would enlarge rounding errors to an apparent signal.

/// Quantity that a run or an experiment measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Position or length; axis in mm.
    Length,
    /// Angle or rotation; axis in degrees.
    Angle,
    /// Linear velocity; axis in mm/s.
    Velocity,
    /// Angular velocity; axis in degrees per second.
    AngularVelocity,
    /// Linear acceleration; axis in m/s².
    Acceleration,
    /// Force; axis in N.
    Force,
    /// Torque; axis in mN·m.
    Torque,
    /// Energy; axis in mJ.
    Energy,
    /// Stiffness; axis in N/mm.
    Stiffness,
    /// Lateness or duration of a tick; axis in µs.
    Lateness,
    /// Ratio; axis in per cent.
    Percent,
}

impl Quantity {
    /// Returns the unit of an axis, and the factor from SI units to this unit.
    #[must_use]
    pub const fn unit(self) -> (&'static str, f64) {
        let (symbol, per_si, _) = self.entry();
        (symbol, per_si)
    }

    /// Formats a value, given in the unit of the axis, with this unit.
    pub(super) fn text(self, value: f64) -> String {
        match self {
            Self::Angle | Self::AngularVelocity => format!("{value}{}", self.unit().0),
            _ => format!("{value} {}", self.unit().0),
        }
    }

    /// Returns the minimum range of an axis, in SI units.
    #[must_use]
    pub const fn least_range_si(self) -> f64 {
        self.entry().2
    }

    /// Returns unit, factor from SI units, and minimum range in SI units. The ranges are far below the resolution of
    /// hands and devices, and far above rounding errors.
    const fn entry(self) -> (&'static str, f64, f64) {
        const DEGREE: f64 = std::f64::consts::PI / 180.0;
        match self {
            Self::Length => ("mm", 1.0e3, 1.0e-6),
            Self::Angle => ("°", 1.0 / DEGREE, 0.01 * DEGREE),
            Self::Velocity => ("mm/s", 1.0e3, 1.0e-4),
            Self::AngularVelocity => ("°/s", 1.0 / DEGREE, 0.1 * DEGREE),
            Self::Acceleration => ("m/s²", 1.0, 1.0e-3),
            Self::Force => ("N", 1.0, 1.0e-3),
            Self::Torque => ("mN·m", 1.0e3, 1.0e-5),
            Self::Energy => ("mJ", 1.0e3, 1.0e-6),
            Self::Stiffness => ("N/mm", 1.0e-3, 1.0),
            Self::Lateness => ("µs", 1.0e6, 1.0e-7),
            Self::Percent => ("%", 1.0e2, 1.0e-3),
        }
    }
}
