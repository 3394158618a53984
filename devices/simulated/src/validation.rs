//! Validation of physical parameters before the simulation starts.
//!
//! A negative mass or a stiffness of NaN is rejected by name when the device is opened, so that the equations of motion
//! never contain an unphysical number.

use flotor_hal::glam::DVec3;
use std::fmt;

/// Reason for the rejection of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InvalidParameter {
    /// NaN or infinite number.
    NotFinite {
        /// Name of the parameter, unit included.
        name: &'static str,
    },
    /// Zero or negative number where only positive numbers are valid.
    NotPositive {
        /// Name of the parameter, unit included.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// Negative number where zero is the minimum.
    Negative {
        /// Name of the parameter, unit included.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// A principal moment of inertia above the sum of the other two, impossible for any body.
    ImpossibleInertia {
        /// The principal moments given, kg m^2.
        principal_kg_m2: DVec3,
    },
    /// A quaternion that is not of unit length.
    NotARotation {
        /// Name of the parameter.
        name: &'static str,
        /// Length of the quaternion.
        length: f64,
    },
    /// Linearly dependent wrenches of the six coils: some wrenches cannot be produced.
    DependentCoils,
    /// Three diodes that do not determine all six coordinates of a pose.
    DiodesInALine,
    /// Rates of flotor and hand too fast for the integrator.
    TooStiff {
        /// Required steps per millisecond.
        steps_per_ms: f64,
        /// Largest number of steps per millisecond.
        limit: f64,
    },
}

impl fmt::Display for InvalidParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { name } => write!(f, "{name} must be finite, but is NaN or infinite"),
            Self::NotPositive { name, value } => write!(f, "{name} is {value}, but must be above zero"),
            Self::Negative { name, value } => write!(f, "{name} is {value}, but must not be negative"),
            Self::ImpossibleInertia { principal_kg_m2: i } => write!(
                f,
                "no body has the moments of inertia {}, {}, {} kg m²: each may be at most the sum of the other two; change \
                 inertia_x_kg_m2, inertia_y_kg_m2 or inertia_z_kg_m2",
                i.x, i.y, i.z
            ),
            Self::NotARotation { name, length } => {
                write!(
                    f,
                    "{name} has length {length}, but a rotation is a quaternion of length 1; divide the quaternion by its length"
                )
            }
            Self::DependentCoils => f.write_str(
                "the wrenches of the six coils are linearly dependent, so the coils cannot produce every \
                 force and torque; set coil_ring_a_deg and coil_ring_b_deg to different angles, both away \
                 from 0° (the pole)",
            ),
            Self::DiodesInALine => f.write_str(
                "the three LEDs do not span a plane, so the sensors cannot measure all six coordinates; set \
                 led_2_deg and led_3_deg to angles that differ from each other and from 0° (360° equals 0°)",
            ),
            Self::TooStiff { steps_per_ms, limit } => write!(
                f,
                "the simulation of flotor and hand would need {:.0} steps per millisecond, above the limit of \
                 {limit:.0}: lower the stiffness and damping of the hand or the drag (damping_ns_per_m, damping_nms_per_rad), or raise mass_kg, hand_mass_kg or the moments of inertia",
                steps_per_ms.ceil()
            ),
        }
    }
}

impl std::error::Error for InvalidParameter {}

/// Result of a check.
pub(crate) type Check = Result<(), InvalidParameter>;

/// Valid range of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Domain {
    /// Any finite number.
    Finite,
    /// Finite and at least zero.
    NotNegative,
    /// Finite and above zero.
    Positive,
}

/// Checks one number against its domain. Real-time: bounded, no allocation.
///
/// # Errors
/// If the value is outside its domain; the error contains the name.
pub(crate) fn number(name: &'static str, value: f64, domain: Domain) -> Check {
    match domain {
        _ if !value.is_finite() => Err(InvalidParameter::NotFinite { name }),
        Domain::NotNegative if value < 0.0 => Err(InvalidParameter::Negative { name, value }),
        Domain::Positive if value <= 0.0 => Err(InvalidParameter::NotPositive { name, value }),
        _ => Ok(()),
    }
}

/// Checks every component of a vector against one domain. Real-time: bounded, no allocation.
///
/// # Errors
/// If a component is outside its domain; the error contains the name.
pub(crate) fn vector(name: &'static str, value: DVec3, domain: Domain) -> Check {
    value.to_array().into_iter().try_for_each(|component| number(name, component, domain))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_domain_refuses_what_lies_outside_and_nothing_else() {
        for (domain, smallest) in
            [(Domain::Finite, -1.0), (Domain::NotNegative, 0.0), (Domain::Positive, f64::MIN_POSITIVE)]
        {
            assert_eq!(number("x", smallest, domain), Ok(()));
            assert_eq!(number("x", f64::NAN, domain), Err(InvalidParameter::NotFinite { name: "x" }));
            assert_eq!(number("x", f64::INFINITY, domain), Err(InvalidParameter::NotFinite { name: "x" }));
        }
        let negative = InvalidParameter::Negative { name: "x", value: -1.0 };
        assert_eq!(number("x", -1.0, Domain::NotNegative), Err(negative));
        let zero = InvalidParameter::NotPositive { name: "x", value: 0.0 };
        assert_eq!(number("x", 0.0, Domain::Positive), Err(zero));
        assert_eq!(vector("x", DVec3::new(1.0, 0.0, 1.0), Domain::Positive), Err(zero));
    }

    #[test]
    fn a_refusal_names_the_parameter_and_the_value() {
        let text = InvalidParameter::NotPositive { name: "mass_kg", value: -0.58 }.to_string();
        assert!(text.contains("mass_kg") && text.contains("-0.58"), "{text}");
    }
}
