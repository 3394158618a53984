//! Device of the SDK in the axes of the contract, with its errors and their remedies.

use crate::ffi::Functions;
use flotor_hal::{DMat3, DQuat, DVec3, Fault, GripKind, GripState, Pose, Refusal, Twist, Wrench};
use flotor_vendor_sdk::{Command, DropInPolicy, Library, LibraryProblem, Sdk, without_signals};
use std::ffi::c_int;

/// Library lookup of the SDK. `libdrd` has the functions of both libraries; `libdhd` cannot initialise.
const SDK: Sdk = Sdk {
    name: "the Force Dimension SDK",
    files: &["libdrd.so.3", "libdrd.so", "libdhd.so.3", "libdhd.so"],
    files_on_windows: &["drdms64.dll", "drd64.dll", "dhdms64.dll", "dhd64.dll"],
    variables: &["FDSDK", "FORCEDIM_SDK", "FD_SDK_DIR", "ForceDimensionSDK_DIR"],
};
/// Oldest supported version of the SDK, major and minor.
const OLDEST: [c_int; 2] = [3, 14];
/// Indices of a status: calibrated, error, cause of disabled force.
const CALIBRATED: usize = 3;
const ERROR: usize = 9;
const FORCE_OFF_CAUSE: usize = 14;
/// Error codes of the SDK: link lost, no driver, no device, feature not available, late reply, call not implemented, device in
/// use by another program.
const COM: c_int = 2;
const NO_DRIVER: c_int = 4;
const NO_DEVICE: c_int = 5;
const NOT_AVAILABLE: c_int = 6;
const TIMEOUT: c_int = 7;
const NOT_IMPLEMENTED: c_int = 10;
const IN_USE: c_int = 20;

/// Failed call of the SDK.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Failed {
    code: c_int,
    words: String,
    what: &'static str,
}

impl Failed {
    /// Returns the corresponding fault of the device contract, for a failure while the loop runs.
    pub(crate) fn fault(&self) -> Fault {
        match self.code {
            COM | NO_DRIVER | NO_DEVICE => Fault::Disconnected,
            TIMEOUT => Fault::Timeout,
            _ => Fault::Protocol,
        }
    }

    /// Returns the error for a failure before the loop runs, with the remedy.
    pub(crate) fn refusal(&self) -> Refusal {
        let remedy = match self.code {
            NO_DRIVER => {
                "no driver lets this user open the USB device: on Linux, `flotor doctor --device force-dimension` prints the udev rule; on Windows, install the driver of the SDK"
            }
            NO_DEVICE => "connect the device and switch it on; on Linux, `lsusb -d 1451:` lists it",
            IN_USE => "end the other program that uses the device",
            COM | TIMEOUT => "check cable, hub and power, and switch the device off and on",
            _ => "test the device with the maker's own programs first",
        };
        Refusal::resource(format!(
            "{} failed (error {} of the SDK: {}); {remedy}",
            self.what, self.code, self.words
        ))
    }
}

/// Open device of the SDK; dropping it disables force, applies the brakes and closes the device.
pub(crate) struct Dhd {
    functions: Box<Functions>,
    id: i8,
    pub(crate) wrist: Wrist,
    pub(crate) gripper: Gripper,
}

/// Gripper of a device: none, sensed, or sensed and driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gripper {
    None,
    Sensed,
    Driven,
}

/// Rotational axes of a device: none, sensed, or sensed and driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wrist {
    None,
    Sensed,
    Driven,
}

impl Dhd {
    /// Opens the library, and the first device or the one with a serial number. Causes no motion. Not real-time.
    pub(crate) fn open(path: Option<&str>, policy: DropInPolicy, which: Which) -> Result<Self, Refusal> {
        let library = Library::open(&SDK, path, policy).map_err(Refusal::resource)?;
        let functions = Functions::load(&library).map_err(Refusal::resource)?;
        let [major, minor, release, revision] = functions.version();
        if [major, minor] < OLDEST {
            return Err(Refusal::resource(LibraryProblem::TooOld {
                path: library.path().to_path_buf(),
                found: format!("{major}.{minor}.{release}.{revision}"),
                needed: format!("{}.{}", OLDEST[0], OLDEST[1]),
            }));
        }
        let count = functions.device_count();
        let indices = (0..).take(usize::try_from(count).unwrap_or(0));
        match which {
            Which::First => Self::opened(functions, 0),
            // Devices in use are skipped, not opened a second time.
            Which::Serial(wanted) => {
                let mut found = Vec::new();
                for index in indices {
                    let Ok(dhd) = Self::opened(functions, index) else { continue };
                    match dhd.serial() {
                        serial if serial == wanted => return Ok(dhd),
                        other => found.push(other.to_string()),
                    }
                }
                Err(Refusal::resource(format!(
                    "no free device has the serial number {wanted} (serial numbers found: {}); correct \
                     `serial`, connect the device, or end the program that uses it; without `serial` the error of the first device is shown",
                    if found.is_empty() { "none".to_owned() } else { found.join(", ") }
                )))
            }
        }
    }

    fn opened(functions: Functions, index: i8) -> Result<Self, Refusal> {
        let id = without_signals(|| functions.open(index));
        let id = checked(&functions, id, "opening the device").map_err(|failed| failed.refusal())?;
        let id = i8::try_from(id).map_err(|_| {
            Refusal::resource(format!(
                "the SDK returned the invalid device number {id}; install another version of the SDK"
            ))
        })?;
        let wrist = match (functions.has_wrist(id), functions.has_active_wrist(id)) {
            (_, true) => Wrist::Driven,
            (true, false) => Wrist::Sensed,
            (false, false) => Wrist::None,
        };
        let gripper = match (functions.has_gripper(id), functions.has_active_gripper(id)) {
            (_, true) => Gripper::Driven,
            (true, false) => Gripper::Sensed,
            (false, false) => Gripper::None,
        };
        Ok(Self { functions: Box::new(functions), id, wrist, gripper })
    }

    fn check(&self, code: c_int, what: &'static str) -> Result<c_int, Failed> {
        checked(&self.functions, code, what)
    }

    /// Returns the maker's name of the device.
    pub(crate) fn name(&self) -> String {
        self.functions.system_name(self.id)
    }

    /// Returns the number of the device type.
    pub(crate) fn kind(&self) -> i32 {
        self.functions.system_type(self.id)
    }

    /// Returns the serial number; 0 if the device reports none.
    pub(crate) fn serial(&self) -> u16 {
        match self.functions.serial_number(self.id) {
            (0, serial) => serial,
            _ => 0,
        }
    }

    /// Returns whether the device is initialised, so that its positions are valid.
    pub(crate) fn is_initialized(&self) -> bool {
        let (code, status) = self.functions.status(self.id);
        let is_calibrated = code >= 0 && status.get(CALIBRATED) == Some(&1);
        self.functions.is_initialized(self.id).unwrap_or(is_calibrated)
    }

    /// Finds the reference position by moving the arm, then ends the SDK's position control. Not real-time: seconds.
    pub(crate) fn initialize(&self) -> Result<(), Refusal> {
        let Some(code) = without_signals(|| self.functions.auto_init(self.id)) else {
            return Err(Refusal::resource(
                "this library cannot initialise a device: name libdrd.so.3 (on Windows drdms64.dll) of the same SDK with `library`",
            ));
        };
        let done = self.check(code, "the automatic initialisation").map_err(|failed| failed.refusal());
        let stopped = self.check(self.functions.stop_regulation(self.id), "ending the position control");
        done?;
        stopped.map(drop).map_err(|failed| failed.refusal())
    }

    /// Sets gravity compensation, limits, velocity windows and watchdog, releases the brakes, enables force and sends
    /// a zero wrench.
    pub(crate) fn energize(&self, setup: &Setup) -> Result<(), Failed> {
        let Self { functions, id, wrist, .. } = self;
        let [most_n, most_nm] = setup.most;
        match self.check(functions.set_gravity_compensation(true, *id), "enabling gravity compensation") {
            // Optional: some devices have none.
            Err(failed) if [NOT_AVAILABLE, NOT_IMPLEMENTED].contains(&failed.code) => {}
            done => drop(done?),
        }
        self.check(functions.set_most_force(most_n, *id), "setting the force limit")?;
        self.check(functions.config_velocity(setup.window_ms, *id), "velocity estimation")?;
        if *wrist != Wrist::None {
            self.check(functions.config_angular_velocity(setup.window_ms, *id), "velocity estimation")?;
        }
        if *wrist == Wrist::Driven {
            self.check(functions.set_most_torque(most_nm, *id), "setting the torque limit")?;
        }
        self.check(functions.set_watchdog(setup.watchdog_units, *id), "setting the watchdog of the device")?;
        self.check(functions.set_brakes(false, *id), "releasing the brakes")?;
        self.check(functions.enable_force(true, *id), "enabling force")?;
        self.send(&Command::ZERO).map(drop)
    }

    /// Sends a zero wrench, disables force and applies the brakes; a failed call does not skip the next calls.
    pub(crate) fn relax(&self) {
        let Self { functions, id, .. } = self;
        let _ = functions.set_forces([0.0; 3], [0.0; 3], 0.0, *id);
        let _ = functions.stop(*id);
        let _ = functions.set_brakes(true, *id);
    }

    /// Reads the pose, m and unit quaternion.
    pub(crate) fn pose(&self) -> Result<Pose, Failed> {
        let (code, position, rows) = self.functions.pose(self.id);
        self.check(code, "reading the pose")?;
        Ok(Pose::new(from_dhd(position), orientation(&rows)))
    }

    /// Reads the velocity, m/s and rad/s; zero until the window is filled.
    pub(crate) fn twist(&self) -> Result<Twist, Failed> {
        let vector = |(code, vector): (c_int, [f64; 3])| match self.check(code, "reading the velocity") {
            Ok(_) => Ok(from_dhd(vector)),
            Err(failed) if failed.code == TIMEOUT => Ok(DVec3::ZERO),
            Err(failed) => Err(failed),
        };
        let linear = vector(self.functions.linear_velocity(self.id))?;
        let angular = match self.wrist {
            Wrist::None => DVec3::ZERO,
            Wrist::Sensed | Wrist::Driven => vector(self.functions.angular_velocity(self.id))?,
        };
        Ok(Twist::new(linear, angular))
    }

    /// Reads the wrench that the device reports, N and N·m, and the grip.
    pub(crate) fn delivered(&self) -> Result<(Wrench, GripState), Failed> {
        let (code, force, torque, effort) = self.functions.forces(self.id);
        self.check(code, "reading the force")?;
        let wrench = Wrench::new(from_dhd(force), from_dhd(torque));
        if self.gripper == Gripper::None {
            return Ok((wrench, GripState::new(GripKind::Linear, 0.0, 0.0)));
        }
        let (code, gap) = self.functions.gripper_gap(self.id);
        self.check(code, "reading the gripper")?;
        let (code, velocity) = self.functions.gripper_velocity(self.id);
        let velocity = match self.check(code, "reading the velocity of the gripper") {
            Ok(_) => velocity,
            Err(failed) if failed.code == TIMEOUT => 0.0, // the window is not filled yet
            Err(failed) => return Err(failed),
        };
        Ok((wrench, GripState::new(GripKind::Linear, gap, velocity).with_delivered(effort)))
    }

    pub(crate) fn buttons(&self) -> u32 {
        self.functions.buttons(self.id)
    }

    /// Sends a command and waits for the exchange with the device; returns whether the motors saturate. A positive force of
    /// the gripper opens it.
    pub(crate) fn send(&self, Command { wrench, effort }: &Command) -> Result<Given, Failed> {
        const SATURATED: c_int = 2;
        let (force, torque) = (to_dhd(wrench.force()), to_dhd(wrench.torque()));
        let code = self.functions.set_forces(force, torque, *effort, self.id);
        let code = self.check(code, "sending the force")?;
        Ok(if code == SATURATED { Given::Saturated } else { Given::All })
    }

    /// Reads the status and returns the fault for an error of the device, or for the cause of disabled force; `None` while force is
    /// enabled, and for causes without a corresponding fault.
    pub(crate) fn force_off(&self) -> Result<Option<Fault>, Failed> {
        let (code, status) = self.functions.status(self.id);
        self.check(code, "reading the status")?;
        if status[ERROR] == 1 {
            return Ok(Some(Fault::Protocol));
        }
        Ok(match status[FORCE_OFF_CAUSE] {
            // A button at the device, or a released handle.
            1 | 6 => Some(Fault::EmergencyStop),
            2 => Some(Fault::OverSpeed),
            3 => Some(Fault::Timeout),
            5 => Some(Fault::Disconnected),
            _ => None,
        })
    }
}

impl Drop for Dhd {
    fn drop(&mut self) {
        self.relax();
        let _ = self.functions.close(self.id);
    }
}

/// Device selection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Which {
    /// First device in the SDK's list.
    First,
    /// Device with this serial number.
    Serial(u16),
}

/// Saturation of the motors: none, or at least one motor at its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    All,
    Saturated,
}

/// Settings for enabling force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    /// Largest force, N, and torque, N·m.
    pub(crate) most: [f64; 2],
    /// Window of the SDK's velocity estimate, ms.
    pub(crate) window_ms: c_int,
    /// Timeout of the device's watchdog, in units of 125 µs.
    pub(crate) watchdog_units: u8,
}

fn checked(functions: &Functions, code: c_int, what: &'static str) -> Result<c_int, Failed> {
    if code >= 0 {
        return Ok(code);
    }
    let (code, words) = functions.last_error();
    Err(Failed { code, words, what })
}

/// Transforms a vector from the SDK's axes (x towards the user, y right, z up) to the host's (x right, y away, z up).
fn from_dhd([x, y, z]: [f64; 3]) -> DVec3 {
    DVec3::new(y, -x, z)
}

fn to_dhd(vector: DVec3) -> [f64; 3] {
    [-vector.y, vector.x, vector.z]
}

/// Converts a rotation matrix of the SDK, given by rows, to a quaternion in the host's axes.
fn orientation(rows: &[[f64; 3]; 3]) -> DQuat {
    let theirs = DMat3::from_cols_array_2d(rows).transpose();
    let columns = [DVec3::X, DVec3::Y, DVec3::Z]
        .map(|axis| from_dhd((theirs * DVec3::from_array(to_dhd(axis))).to_array()));
    let [x, y, z] = columns;
    DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_of_the_contract() {
        // Towards the user, right, up.
        let [towards, right, up] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(from_dhd);
        assert_eq!([right, -towards, up], [DVec3::X, DVec3::Y, DVec3::Z]);
        let vector = DVec3::new(1.0, -2.0, 3.0);
        assert_eq!(from_dhd(to_dhd(vector)), vector);
    }

    #[test]
    fn a_turn_about_their_axis_is_one_about_ours() {
        // A quarter turn about up: what pointed towards the user points to the right.
        let quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let turned = orientation(&quarter) * DVec3::NEG_Y;
        assert!((turned - DVec3::X).length() < 1.0e-15, "{turned}");
        // About the axis to the right (ours x), up goes to the user.
        let pitch = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let turned = orientation(&pitch) * DVec3::Z;
        assert!((turned - DVec3::NEG_Y).length() < 1.0e-15, "{turned}");
    }
}
