//! Device of the SDK in the axes and units of the contract, with its errors and their remedies.

use crate::ffi::{
    ANGULAR_VELOCITY, FORCE, Functions, LAST_FORCE, LAST_TORQUE, MAX_FORCE, MAX_STIFFNESS, MAX_TORQUE,
    TORQUE, TRANSFORM, USABLE_WORKSPACE, VELOCITY, name_of,
};
use flotor_hal::{Conditions, DMat3, DQuat, DVec3, Fault, GripKind, GripState, Pose, Refusal, Twist, Wrench};
use flotor_vendor_sdk::{DropInPolicy, Library, LibraryProblem, Sample, Sdk, without_signals};
use std::ffi::{c_int, c_uint};

/// Library lookup of the SDK.
const SDK: Sdk = Sdk {
    name: "OpenHaptics",
    files: &["libHD.so.3.4", "libHD.so.3.0", "libHD.so"],
    files_on_windows: &["hd.dll"],
    variables: &["OH_SDK_BASE", "3DTOUCH_BASE"],
};
/// Oldest supported major version of the SDK.
const OLDEST: u32 = 3;
/// Text parameters: version of the interface, model, serial number.
const VERSION: c_uint = 0x2500;
const MODEL: c_uint = 0x2501;
const SERIAL: c_uint = 0x2504;
/// Integer parameters: buttons, sensed axes, driven axes.
const BUTTONS: c_uint = 0x2000;
const INPUT_DOF: c_uint = 0x2553;
const OUTPUT_DOF: c_uint = 0x2554;
const FORCE_OUTPUT: c_uint = 0x4000;
/// Invalid handle.
const NO_DEVICE: c_uint = 0xFFFF_FFFF;
/// Calibration states, and the parameter of the supported calibration styles.
const NEEDS_UPDATE: c_uint = 0x5001;
const NEEDS_MANUAL_INPUT: c_uint = 0x5002;
const CALIBRATION_STYLE: c_uint = 0x2555;
/// Millimetres in a metre, and mN·m in a N·m.
const MILLI: f64 = 1.0e3;

/// Failed call of the SDK.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Failed {
    code: c_uint,
    words: String,
    what: &'static str,
}

/// Maps an error code to the fault of the contract while the loop runs.
fn fault(code: c_uint) -> Fault {
    match code {
        0x0200 => Fault::OverTemperature,
        0x0201 | 0x0202 => Fault::OverCurrent,
        0x0203 => Fault::OverSpeed,
        0x0204 => Fault::EmergencyStop,
        0x0300 | 0x0302 | 0x0303 => Fault::Disconnected,
        0x0304 => Fault::Timeout,
        _ => Fault::Protocol,
    }
}

impl Failed {
    /// Returns the error for a failure before the loop runs, with the remedy.
    pub(crate) fn refusal(&self) -> Refusal {
        let remedy = match self.code {
            0x0300 => {
                "check that the device is connected, configured with the maker's setup program, and permitted for \
                 this user (on Linux, `flotor doctor --device openhaptics` checks this)"
            }
            0x0301 => "end the other program, or remove the other device of the scene, that uses this device",
            0x0302 | 0x0303 => "check cable, hub, power and configuration (on Linux the folder $GTDD_HOME)",
            _ => "test the device with the maker's own diagnostic program first",
        };
        Refusal::resource(format!(
            "{} failed (error 0x{:04x} of the SDK: {}); {remedy}",
            self.what, self.code, self.words
        ))
    }
}

/// Open device of the SDK; dropping it closes the device.
pub(crate) struct Hd {
    pub(crate) functions: Functions,
    handle: c_uint,
    pub(crate) facts: Facts,
}

/// Properties reported by a device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Facts {
    /// Centre of the usable workspace, device frame, m.
    pub(crate) centre_m: DVec3,
    /// Half-extents of the usable workspace along the contract's axes, m.
    pub(crate) range_m: DVec3,
    pub(crate) is_turned: bool,
    pub(crate) gives_torque: bool,
    pub(crate) force_n: f64,
    pub(crate) torque_nm: f64,
    pub(crate) stiffness_n_per_m: f64,
}

impl Hd {
    /// Opens the library, and the device with a name or the default one. Causes no motion. Not real-time.
    pub(crate) fn open(
        path: Option<&str>,
        policy: DropInPolicy,
        name: Option<&str>,
    ) -> Result<Self, Refusal> {
        let library = Library::open(&SDK, path, policy).map_err(Refusal::resource)?;
        let functions = Functions::load(&library).map_err(Refusal::resource)?;
        let version = functions.text(VERSION);
        if version
            .split('.')
            .next()
            .and_then(|major| major.trim().parse().ok())
            .is_none_or(|major: u32| major < OLDEST)
        {
            return Err(Refusal::resource(LibraryProblem::TooOld {
                path: library.path().to_path_buf(),
                found: if version.is_empty() { "unknown".to_owned() } else { version },
                needed: format!("{OLDEST}.0"),
            }));
        }
        let told = name.map(|name| {
            name_of(name).ok_or_else(|| {
                Refusal::parameter("`name` has a null character, which no device name has; correct the name")
            })
        });
        let told = told.transpose()?;
        // Discards errors of earlier calls.
        while functions.take_error() != 0 {}
        let handle = without_signals(|| functions.init(told.as_deref()));
        let code = functions.take_error();
        if handle == NO_DEVICE || code != 0 {
            let what = "opening the device";
            return Err(Failed { code, words: functions.words(code), what }.refusal());
        }
        let mut hd = Self { functions, handle, facts: Facts::default() };
        hd.facts = hd.query()?;
        Ok(hd)
    }

    fn query(&self) -> Result<Facts, Refusal> {
        let functions = &self.functions;
        functions.make_current(self.handle);
        let [least_x, least_y, least_z, x, y, z] = functions.numbers(USABLE_WORKSPACE);
        let [least, most] = [[least_x, least_y, least_z], [x, y, z]].map(|corner| from_hd(corner) / MILLI);
        let whole = |parameter| functions.whole(parameter);
        let (input, output): (c_int, c_int) = (whole(INPUT_DOF), whole(OUTPUT_DOF));
        let [force_n] = functions.numbers(MAX_FORCE);
        let [torque_mnm] = if output >= 6 { functions.numbers(MAX_TORQUE) } else { [0.0] };
        let [stiffness_n_per_mm] = functions.numbers(MAX_STIFFNESS);
        self.check("reading the capabilities of the device").map_err(|failed| failed.refusal())?;
        Ok(Facts {
            centre_m: (least + most) / 2.0,
            range_m: (most - least).abs() / 2.0,
            is_turned: input >= 6,
            gives_torque: output >= 6 && torque_mnm > 0.0,
            force_n,
            torque_nm: torque_mnm / MILLI,
            stiffness_n_per_m: stiffness_n_per_mm * MILLI,
        })
    }

    /// Checks the error stack of this thread: pops the last error and returns it as a failure of `what`.
    pub(crate) fn check(&self, what: &'static str) -> Result<(), Failed> {
        match self.functions.take_error() {
            0 => Ok(()),
            code => Err(Failed { code, words: self.functions.words(code), what }),
        }
    }

    /// Pops the last error of this thread and returns it as a failure of `what`, also for code 0.
    pub(crate) fn failure(&self, what: &'static str) -> Failed {
        let code = self.functions.take_error();
        Failed { code, words: self.functions.words(code), what }
    }

    /// Returns the maker's name of the model and the serial number.
    pub(crate) fn name(&self) -> String {
        self.functions.make_current(self.handle);
        format!("{} {}", self.functions.text(MODEL), self.functions.text(SERIAL))
    }

    /// Updates the calibration automatically if the device requests it, and checks the calibration. Not real-time.
    pub(crate) fn calibrate(&self) -> Result<(), Refusal> {
        self.functions.make_current(self.handle);
        if self.functions.check_calibration() == NEEDS_UPDATE {
            #[allow(clippy::cast_sign_loss)] // bits
            let styles = self.functions.whole(CALIBRATION_STYLE) as c_uint;
            self.functions.update_calibration(styles);
        }
        let state = self.functions.check_calibration();
        self.check("reading the calibration").map_err(|failed| failed.refusal())?;
        if state != NEEDS_UPDATE && state != NEEDS_MANUAL_INPUT {
            return Ok(());
        }
        let by_hand = state == NEEDS_MANUAL_INPUT;
        Err(Refusal::resource(format!(
            "the {} is not calibrated: {}, and start again",
            self.name(),
            if by_hand {
                "put the stylus into its inkwell or the arm into its reset position"
            } else {
                "move the arm through its range"
            }
        )))
    }

    /// Enables or disables the force of the device with the open frame; on the thread of the scheduler. Errors stay on
    /// the error stack, which is checked at the end of the frame.
    pub(crate) fn switch_here(&self, force: Force) {
        match force {
            Force::On => self.functions.enable(FORCE_OUTPUT),
            Force::Off => self.functions.disable(FORCE_OUTPUT),
        }
    }

    /// Begins a frame and reads a sample; on the thread of the scheduler.
    pub(crate) fn begin(&self) -> Result<Sample, Fault> {
        let functions = &self.functions;
        functions.begin_frame(self.handle);
        let transform = functions.numbers(TRANSFORM);
        let velocity = from_hd(functions.numbers(VELOCITY)) / MILLI;
        let (angular, torque) = if self.facts.is_turned {
            (from_hd(functions.numbers(ANGULAR_VELOCITY)), self.facts.gives_torque)
        } else {
            (DVec3::ZERO, false)
        };
        let force_n = from_hd(functions.numbers(LAST_FORCE));
        let torque_nm = if torque { from_hd(functions.numbers(LAST_TORQUE)) / MILLI } else { DVec3::ZERO };
        #[allow(clippy::cast_sign_loss)] // bits
        let buttons = functions.whole(BUTTONS) as u32;
        self.faultless()?;
        Ok(Sample {
            pose: pose(&transform, self.facts.centre_m),
            twist: Twist::new(velocity, angular),
            delivered: Wrench::new(force_n, torque_nm),
            grip: GripState::new(GripKind::Linear, 0.0, 0.0), // none
            buttons,
            conditions: Conditions::NONE,
        })
    }

    /// Sets the wrench of the frame and ends the frame; on the thread of the scheduler.
    pub(crate) fn finish(&self, wrench: &Wrench) -> Result<(), Fault> {
        self.functions.set(FORCE, to_hd(wrench.force()));
        if self.facts.gives_torque {
            self.functions.set(TORQUE, to_hd(wrench.torque() * MILLI));
        }
        self.functions.end_frame(self.handle);
        self.faultless()
    }

    fn faultless(&self) -> Result<(), Fault> {
        match self.functions.take_error() {
            0 => Ok(()),
            code => Err(fault(code)),
        }
    }
}

impl Drop for Hd {
    fn drop(&mut self) {
        self.functions.close(self.handle);
    }
}

/// Force output of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Force {
    On,
    Off,
}

/// Transforms a vector from the SDK's axes (x right, y up, z towards the user) to the host's (x right, y away, z up).
fn from_hd([x, y, z]: [f64; 3]) -> DVec3 {
    DVec3::new(x, -z, y)
}

fn to_hd(vector: DVec3) -> [f64; 3] {
    [vector.x, vector.z, -vector.y]
}

/// Converts a transform of the SDK, by columns, lengths in mm, to a pose relative to the workspace's centre.
fn pose(transform: &[f64; 16], centre_m: DVec3) -> Pose {
    let [a, b, c, _, d, e, f, _, g, h, i, _, x, y, z, _] = *transform;
    let theirs = DMat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]);
    let [x_axis, y_axis, z_axis] = [DVec3::X, DVec3::Y, DVec3::Z]
        .map(|axis| from_hd((theirs * DVec3::from_array(to_hd(axis))).to_array()));
    let orientation = DQuat::from_mat3(&DMat3::from_cols(x_axis, y_axis, z_axis)).normalize();
    Pose::new(from_hd([x, y, z]) / MILLI - centre_m, orientation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_of_the_contract() {
        let [right, up, towards] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(from_hd);
        assert_eq!([right, -towards, up], [DVec3::X, DVec3::Y, DVec3::Z]);
        let vector = DVec3::new(1.0, -2.0, 3.0);
        assert_eq!(from_hd(to_hd(vector)), vector);
    }

    #[test]
    fn a_matrix_by_columns_gives_place_and_turn() {
        // A quarter turn about up (their y): what pointed to the user points to the right. 10 mm right, 20 up, 30 to the user.
        let transform = [0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 10.0, 20.0, 30.0, 1.0];
        let pose = pose(&transform, DVec3::new(0.0, 0.0, 0.005));
        assert!((pose.position() - DVec3::new(0.01, -0.03, 0.015)).length() < 1.0e-15, "{pose:?}");
        let turned = pose.orientation() * DVec3::NEG_Y;
        assert!((turned - DVec3::X).length() < 1.0e-15, "{turned}");
    }
}
