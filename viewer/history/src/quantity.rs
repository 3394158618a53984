//! Quantities of plots, and their units.

use crate::Sample;
use flotor_hal::DVec3;
use flotor_plot::Quantity as Measured;
use serde::{Deserialize, Serialize};

/// Units of axes and readouts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Units {
    /// Millimetres, degrees, newtons, millinewton metres.
    #[default]
    Handy,
    /// Metres, radians, newtons, newton metres.
    Si,
}

/// Measured quantity with one to three components, in the order of menus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Force sent to the device.
    Force,
    /// Torque sent to the device.
    Torque,
    /// Position of the handle.
    Position,
    /// Rotation vector of the handle.
    Rotation,
    /// Velocity of the handle.
    Velocity,
    /// Angular velocity of the handle.
    AngularVelocity,
    /// Energy stored in the models.
    Energy,
    /// Stiffness felt along the motion.
    Stiffness,
    /// Start delay and computing time of ticks.
    Lateness,
}

/// Name, names of components, quantity of `flotor_plot`, SI unit, and handy unit with its factor from SI.
type Entry = (&'static str, &'static [&'static str], Measured, &'static str, (&'static str, f64));

impl Quantity {
    /// Returns the name for menus and axes.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().0
    }

    /// Returns the names of the components.
    #[must_use]
    pub const fn components(self) -> &'static [&'static str] {
        self.entry().1
    }

    /// Returns the unit, and the factor that converts an SI value to it.
    #[must_use]
    pub const fn unit(self, units: Units) -> (&'static str, f64) {
        let (_, _, _, si, handy) = self.entry();
        match units {
            Units::Si => (si, 1.0),
            Units::Handy => handy,
        }
    }

    /// Returns the smallest range of an axis, in the unit of [`Self::unit`].
    #[must_use]
    pub fn least_range(self, units: Units) -> f64 {
        self.entry().2.least_range_si() * self.unit(units).1
    }

    /// Returns the entry of the table of quantities.
    const fn entry(self) -> Entry {
        const DEGREES_PER_RAD: f64 = 180.0 / std::f64::consts::PI;
        match self {
            Self::Force => ("Force", &["Fx", "Fy", "Fz"], Measured::Force, "N", ("N", 1.0)),
            Self::Torque => ("Torque", &["Mx", "My", "Mz"], Measured::Torque, "N·m", ("mN·m", 1.0e3)),
            Self::Position => ("Position", &["x", "y", "z"], Measured::Length, "m", ("mm", 1.0e3)),
            Self::Rotation => {
                ("Rotation", &["rx", "ry", "rz"], Measured::Angle, "rad", ("°", DEGREES_PER_RAD))
            }
            Self::Velocity => ("Velocity", &["vx", "vy", "vz"], Measured::Velocity, "m/s", ("mm/s", 1.0e3)),
            Self::AngularVelocity => {
                let turn = Measured::AngularVelocity;
                ("Angular velocity", &["wx", "wy", "wz"], turn, "rad/s", ("°/s", DEGREES_PER_RAD))
            }
            Self::Energy => ("Energy", &["stored"], Measured::Energy, "J", ("mJ", 1.0e3)),
            Self::Stiffness => ("Stiffness", &["-dF/dx"], Measured::Stiffness, "N/m", ("N/mm", 1.0e-3)),
            Self::Lateness => {
                ("Lateness", &["late start", "computing"], Measured::Lateness, "s", ("µs", 1.0e6))
            }
        }
    }

    /// Returns a component in a sample, SI; NaN for a component that the quantity does not have.
    #[must_use]
    pub fn value(self, sample: &Sample, component: usize) -> f64 {
        let of = |values: &[f32], offset: usize| {
            values.get(offset + component).map_or(f64::NAN, |v| f64::from(*v))
        };
        let vector = |vector: DVec3| vector.to_array().get(component).copied().unwrap_or(f64::NAN);
        match self {
            Self::Force => of(&sample.commanded[..3], 0),
            Self::Torque => of(&sample.commanded, 3),
            Self::Position => vector(sample.pose.position()),
            Self::Rotation => vector(sample.rotation_rad()),
            Self::Velocity => of(&sample.twist[..3], 0),
            Self::AngularVelocity => of(&sample.twist, 3),
            Self::Energy => of(&[sample.energy_j], 0),
            Self::Stiffness => of(&[sample.stiffness_n_per_m], 0),
            Self::Lateness => of(&[sample.lateness_s, sample.compute_s], 0),
        }
    }
}
