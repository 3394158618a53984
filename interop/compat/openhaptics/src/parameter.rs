//! HDAPI parameter codes, with the number and type of each parameter's values.

use crate::error::Code;
use std::ffi::c_uint;

pub(crate) const BUTTONS: [c_uint; 2] = [0x2000, 0x2200];
pub(crate) const SAFETY_SWITCH: [c_uint; 2] = [0x2001, 0x2201];
pub(crate) const INKWELL_SWITCH: [c_uint; 2] = [0x2002, 0x2202];
pub(crate) const ENCODERS: [c_uint; 2] = [0x2010, 0x2210];
pub(crate) const PINCH: [c_uint; 2] = [0x2011, 0x2012];
pub(crate) const POSITION: [c_uint; 2] = [0x2050, 0x2250];
pub(crate) const VELOCITY: [c_uint; 2] = [0x2051, 0x2251];
pub(crate) const TRANSFORM: [c_uint; 2] = [0x2052, 0x2252];
pub(crate) const ANGULAR_VELOCITY: [c_uint; 2] = [0x2053, 0x2253];
pub(crate) const JOINT_ANGLES: [c_uint; 2] = [0x2100, 0x2300];
pub(crate) const GIMBAL_ANGLES: [c_uint; 2] = [0x2150, 0x2350];
pub(crate) const VERSION: c_uint = 0x2500;
pub(crate) const MODEL_TYPE: c_uint = 0x2501;
pub(crate) const DRIVER_VERSION: c_uint = 0x2502;
pub(crate) const VENDOR: c_uint = 0x2503;
pub(crate) const SERIAL_NUMBER: c_uint = 0x2504;
pub(crate) const FIRMWARE_VERSION: c_uint = 0x2505;
pub(crate) const WORKSPACES: [c_uint; 2] = [0x2550, 0x2551];
pub(crate) const TABLETOP_OFFSET: c_uint = 0x2552;
pub(crate) const INPUT_DOF: c_uint = 0x2553;
pub(crate) const OUTPUT_DOF: c_uint = 0x2554;
pub(crate) const CALIBRATION_STYLE: c_uint = 0x2555;
pub(crate) const UPDATE_RATE: c_uint = 0x2600;
pub(crate) const INSTANTANEOUS_RATE: c_uint = 0x2601;
pub(crate) const MAX_STIFFNESS: c_uint = 0x2602;
pub(crate) const MAX_FORCE: c_uint = 0x2603;
pub(crate) const MAX_CONTINUOUS_FORCE: c_uint = 0x2604;
pub(crate) const MOTOR_TEMPERATURE: c_uint = 0x2605;
pub(crate) const VELOCITY_LIMIT: c_uint = 0x2606;
pub(crate) const IMPULSE_LIMIT: c_uint = 0x2607;
pub(crate) const RAMPING_RATE: c_uint = 0x2608;
pub(crate) const MAX_DAMPING: c_uint = 0x2609;
pub(crate) const MAX_TORQUE_STIFFNESS: c_uint = 0x2620;
pub(crate) const MAX_TORQUE_DAMPING: c_uint = 0x2621;
pub(crate) const MAX_TORQUE: c_uint = 0x2622;
pub(crate) const MAX_CONTINUOUS_TORQUE: c_uint = 0x2623;
pub(crate) const FORCE: [c_uint; 2] = [0x2700, 0x2800];
pub(crate) const TORQUE: [c_uint; 2] = [0x2701, 0x2801];
pub(crate) const JOINT_TORQUE: [c_uint; 2] = [0x2703, 0x2802];
pub(crate) const GIMBAL_TORQUE: [c_uint; 2] = [0x2704, 0x2803];
pub(crate) const STATUS_LIGHT: c_uint = 0x2900;
pub(crate) const FORCE_OUTPUT: c_uint = 0x4000;
pub(crate) const FORCE_CLAMPING: c_uint = 0x4001;
pub(crate) const ONE_FRAME_LIMIT: c_uint = 0x4004;

/// Type of a parameter's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Boolean,
    Integer,
    Long,
    /// Float and double, which convert freely.
    Real,
}

/// Values of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Values {
    kind: Kind,
    count: usize,
    numbers: [f64; 16],
}

impl Values {
    pub(crate) fn new(kind: Kind, values: &[f64]) -> Self {
        let mut numbers = [0.0; 16];
        let count = values.len().min(numbers.len());
        numbers.iter_mut().zip(values).for_each(|(place, value)| *place = *value);
        Self { kind, count, numbers }
    }

    pub(crate) fn real(values: impl AsRef<[f64]>) -> Self {
        Self::new(Kind::Real, values.as_ref())
    }

    pub(crate) fn integer(value: u32) -> Self {
        Self::new(Kind::Integer, &[f64::from(value)])
    }

    pub(crate) fn boolean(value: bool) -> Self {
        Self::new(Kind::Boolean, &[f64::from(u8::from(value))])
    }

    /// Returns the values and their count; `None` if they are of another type.
    pub(crate) fn of_kind(&self, kind: Kind) -> Option<([f64; 16], usize)> {
        (kind == self.kind).then_some((self.numbers, self.count))
    }
}

/// Returns the number of values that a parameter accepts; an error for a read-only parameter or another type.
pub(crate) fn settable(parameter: c_uint, kind: Kind) -> Result<usize, Code> {
    let (legal, count) = match parameter {
        0x2700..=0x2704 => (Kind::Real, 3),
        VELOCITY_LIMIT | IMPULSE_LIMIT | RAMPING_RATE => (Kind::Real, 1),
        STATUS_LIGHT => (Kind::Integer, 1),
        _ => return Err(Code::InvalidEnum),
    };
    if legal == kind { Ok(count) } else { Err(Code::InvalidInputType) }
}
