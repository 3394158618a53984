//! Calibration of the vertical force: ratio of delivered to commanded force as a function of height.
//!
//! Extension `flotor.calibration/1`. The host measures, fits and stores the calibration; the device receives the numbers and
//! divides its **total** vertical command by the ratio, gravity compensation included, because the uneven field acts on the sum
//! (Varadharajan 2007, section 3.4, corrected only the spring force).

use crate::abi::instance::{fill, refusable};
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{DeviceAdapter, Instance, Message, not_opened};
use crate::{Device, Refusal};

/// Maximum number of coefficients of a calibration: a polynomial of degree seven.
pub const CALIBRATION_COEFFICIENTS: usize = 8;

/// Smallest and largest plausible ratio of delivered to commanded force. An uneven field is off by tens of percent at
/// most; a ratio outside these limits is an error of the measurement, and a division by the ratio would carry the error
/// into the command.
const PLAUSIBLE_SHARE: [f64; 2] = [0.5, 2.0];
/// Largest distance from the centre in a calibration, m.
const MOST_RANGE_M: f64 = 1.0;

/// Number of heights at which a calibration is checked: enough for a polynomial of degree seven.
const CHECKED_HEIGHTS: u32 = 256;

/// Ratio of delivered to commanded vertical force, as a polynomial of the height in m. 80 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct VerticalCalibration {
    pub(crate) range_m: [f64; 2],
    pub(crate) coefficients: [f64; CALIBRATION_COEFFICIENTS],
}

/// Reason why a calibration is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InvalidCalibration {
    /// Range of heights that is not finite, empty, reversed or beyond 1 m from the centre, m.
    Range([f64; 2]),
    /// Number of coefficients: none, or more than [`CALIBRATION_COEFFICIENTS`].
    Count(usize),
    /// Ratio that is NaN or not between a half and two.
    Share {
        /// Height, m.
        height_m: f64,
        /// Ratio of delivered to commanded force at this height.
        share: f64,
    },
}

impl std::fmt::Display for InvalidCalibration {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Range([from, to]) => write!(
                f,
                "the range {from:?} m to {to:?} m is invalid; give two heights within 1 m of the centre, the lower first"
            ),
            Self::Count(count) => {
                write!(f, "the polynomial has {count} coefficients; give 1 to {CALIBRATION_COEFFICIENTS}")
            }
            Self::Share { height_m, share } => write!(
                f,
                "the ratio of delivered to commanded force is {share:?} at {:.3} mm, but must be between {} \
                 and {}; calibrate again",
                height_m * 1.0e3,
                PLAUSIBLE_SHARE[0],
                PLAUSIBLE_SHARE[1]
            ),
        }
    }
}

impl std::error::Error for InvalidCalibration {}

impl VerticalCalibration {
    /// Identity: the delivered force equals the commanded force.
    pub const NONE: Self =
        Self { range_m: [-1.0, 1.0], coefficients: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };

    /// Builds a polynomial `c0 + c1 z + c2 z² ...` with z in m (so `ck` in 1/mᵏ), measured over `range_m`.
    ///
    /// # Errors
    /// [`InvalidCalibration`] for an invalid range, an invalid number of coefficients, or a ratio that is not between 0.5 and 2 at
    /// one of 257 heights over the range.
    pub fn new(range_m: [f64; 2], coefficients: &[f64]) -> Result<Self, InvalidCalibration> {
        let mut calibration = Self { range_m, coefficients: [0.0; CALIBRATION_COEFFICIENTS] };
        match calibration.coefficients.get_mut(..coefficients.len()) {
            Some(room) if !room.is_empty() => room.copy_from_slice(coefficients),
            _ => return Err(InvalidCalibration::Count(coefficients.len())),
        }
        calibration.check()?;
        Ok(calibration)
    }

    /// Checks the numbers of a calibration from another source.
    ///
    /// # Errors
    /// [`InvalidCalibration`] for an invalid range, or a ratio that is not between 0.5 and 2 at one of 257 heights over the range.
    pub fn check(&self) -> Result<(), InvalidCalibration> {
        let [from, to] = self.range_m;
        if !(from.abs() <= MOST_RANGE_M && to.abs() <= MOST_RANGE_M && from < to) {
            return Err(InvalidCalibration::Range(self.range_m));
        }
        let [least, most] = PLAUSIBLE_SHARE;
        for step in 0..=CHECKED_HEIGHTS {
            let height_m = from + (to - from) * f64::from(step) / f64::from(CHECKED_HEIGHTS);
            let share = self.share(height_m);
            if !(least..=most).contains(&share) {
                return Err(InvalidCalibration::Share { height_m, share });
            }
        }
        Ok(())
    }

    /// Returns the measured range of heights, lowest and highest, m.
    #[must_use]
    pub const fn range_m(&self) -> [f64; 2] {
        self.range_m
    }

    /// Returns the coefficients of the powers of the height in m; unused coefficients are 0.
    #[must_use]
    pub const fn coefficients(&self) -> &[f64; CALIBRATION_COEFFICIENTS] {
        &self.coefficients
    }

    /// Returns the ratio of delivered to commanded vertical force at height `z_m`; constant beyond the range, and 1 for
    /// a NaN height. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn share(&self, z_m: f64) -> f64 {
        if z_m.is_nan() {
            return 1.0;
        }
        let [from, to] = self.range_m;
        let z_m = z_m.max(from).min(to);
        self.coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * z_m + coefficient)
    }

    /// Returns the vertical command, N, that delivers `total_n` at height `z_m`. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn command_n(&self, total_n: f64, z_m: f64) -> f64 {
        total_n / self.share(z_m)
    }
}

/// Device with a correctable vertical force.
///
/// ```
/// # use flotor_hal::*;
/// # struct Crank { samples: u64, ledger: EnergyLedger }
/// # impl Device for Crank {
/// #     const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that turns");
/// #     type Active = Crank;
/// #     type Stop = NothingToStop;
/// #     fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Crank { samples: 0, ledger: EnergyLedger::default() })
/// #     }
/// #     fn capabilities(&self) -> Capabilities { Capabilities::UNDRIVEN }
/// #     fn stopper(&self) -> NothingToStop { NothingToStop }
/// #     fn activate(self, _: &LoopConfig) -> Result<Crank, (Self, Refusal)> { Ok(self) }
/// # }
/// # impl ActiveDevice for Crank {
/// #     type Opened = Crank;
/// #     fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle { Cycle::Fresh }
/// #     fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle { Cycle::Fresh }
/// #     fn deactivate(self) -> Crank { self }
/// # }
/// /// `export_device!(Crank, calibration)`
/// impl CalibrationDevice for Crank {
///     fn serial(&self) -> String {
///         "0042".to_owned()
///     }
///
///     fn calibrate_vertical(&mut self, _: &VerticalCalibration) -> Result<(), Refusal> {
///         Err(Refusal::unsupported("a crank has no vertical force to correct"))
///     }
/// }
/// ```
pub trait CalibrationDevice: Device {
    /// Returns the serial number of the hardware; empty if none. Not real-time.
    fn serial(&self) -> String;

    /// Corrects the total vertical command, gravity compensation included, from the next activation on. The
    /// numbers are already checked. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the device has no vertical force to correct.
    fn calibrate_vertical(&mut self, calibration: &VerticalCalibration) -> Result<(), Refusal>;
}

/// Function table `flotor.calibration/1`: see [`CalibrationDevice`]. Both calls are valid in the opened phase only.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CalibrationTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the serial number of the hardware, empty if none; returns a [`crate::abi::CallStatus`] code. Not real-time.
    pub serial: Option<unsafe extern "C" fn(instance: Instance, serial: *mut Message) -> u32>,
    /// Corrects the total vertical command from the next activation on; returns 0, or a [`crate::RefusalKind`] with the
    /// reason in the message. Not real-time.
    pub calibrate_vertical: Option<
        unsafe extern "C" fn(
            instance: Instance,
            calibration: *const VerticalCalibration,
            message: *mut Message,
        ) -> u32,
    >,
}

layout! {
    VerticalCalibration { range_m, coefficients }
    CalibrationTable { size, reserved, serial, calibrate_vertical }
}
unsafe extern "C" fn serial<D: CalibrationDevice>(instance: Instance, serial: *mut Message) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe {
        fill::<DeviceAdapter<D>, _>(instance, serial, |phase| {
            let mut text = Message::default();
            text.set(&phase.opened()?.serial());
            Ok(text)
        })
    }
}

unsafe extern "C" fn calibrate_vertical<D: CalibrationDevice>(
    instance: Instance,
    calibration: *const VerticalCalibration,
    message: *mut Message,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe {
        refusable::<DeviceAdapter<D>>(instance, message, |phase| {
            (*calibration).check().map_err(Refusal::parameter)?;
            phase.opened().map_err(|_| not_opened())?.calibrate_vertical(&*calibration)
        })
    }
}

table!(CalibrationTable: "flotor.calibration/1", D: [CalibrationDevice] {
    reserved: 0,
    serial: Some(serial::<D>),
    calibrate_vertical: Some(calibrate_vertical::<D>),
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_delivers_the_total() {
        let calibration = VerticalCalibration::new([-7.0e-3, 7.0e-3], &[1.05, -6.0, -1100.0]).unwrap();
        let z_m = 3.0e-3;
        let share = 1.05 - 6.0 * z_m - 1100.0 * z_m * z_m;
        assert!((calibration.share(z_m) - share).abs() < 1.0e-15);
        assert!((calibration.command_n(10.0, z_m) * share - 10.0).abs() < 1.0e-14);
        assert_eq!(calibration.share(0.5), calibration.share(7.0e-3), "no extrapolation");
        assert_eq!(calibration.share(f64::NAN), 1.0);
        assert_eq!(VerticalCalibration::NONE.command_n(10.0, z_m), 10.0);
    }

    #[test]
    fn numbers_that_would_multiply_a_force_are_refused() {
        let range = [-7.0e-3, 7.0e-3];
        assert_eq!(VerticalCalibration::new(range, &[]), Err(InvalidCalibration::Count(0)));
        assert_eq!(VerticalCalibration::new(range, &[1.0; 9]), Err(InvalidCalibration::Count(9)));
        assert!(matches!(VerticalCalibration::new([0.0, 0.0], &[1.0]), Err(InvalidCalibration::Range(_))));
        assert!(matches!(
            VerticalCalibration::new([0.0, f64::NAN], &[1.0]),
            Err(InvalidCalibration::Range(_))
        ));
        let room = VerticalCalibration::new([-1.0e300, 7.0], &[1.0]);
        assert!(matches!(room, Err(InvalidCalibration::Range(_))));
        for coefficients in [&[0.0][..], &[f64::NAN], &[1.0, 1.0e3], &[-1.0], &[f64::INFINITY]] {
            let refused = VerticalCalibration::new(range, coefficients);
            assert!(matches!(refused, Err(InvalidCalibration::Share { .. })), "{coefficients:?}");
        }
    }
}
