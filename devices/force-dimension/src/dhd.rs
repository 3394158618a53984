//! A device of the SDK in the axes of the contract, and its errors with what to do.

use crate::ffi::Functions;
use flotor_hal::{DMat3, DQuat, DVec3, Fault, Pose, Refusal, Twist, Wrench};
use flotor_vendor_sdk::{Library, LibraryProblem, Sdk, StandIn, without_signals};
use std::ffi::c_int;

/// The SDK, as far as its library has to be found. `libdrd` has the functions of both; `libdhd` cannot initialise.
const SDK: Sdk = Sdk {
    name: "the Force Dimension SDK",
    files: &["libdrd.so.3", "libdrd.so", "libdhd.so.3", "libdhd.so"],
    files_on_windows: &["drdms64.dll", "drd64.dll", "dhdms64.dll", "dhd64.dll"],
    variables: &["FDSDK", "FORCEDIM_SDK", "FD_SDK_DIR", "ForceDimensionSDK_DIR"],
};
/// Oldest version of the SDK.
const OLDEST: [c_int; 2] = [3, 14];
/// Places of a status: connected, calibrated, error, why force is off.
const CALIBRATED: usize = 3;
const ERROR: usize = 9;
const FORCE_OFF_CAUSE: usize = 14;
/// Errors of the SDK: the link is lost, no driver, no device, a thing that this device has not, an answer that is late, a call
/// that does nothing, a device of another program.
const COM: c_int = 2;
const NO_DRIVER: c_int = 4;
const NO_DEVICE: c_int = 5;
const NOT_AVAILABLE: c_int = 6;
const TIMEOUT: c_int = 7;
const NOT_IMPLEMENTED: c_int = 10;
const IN_USE: c_int = 20;

/// A call that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Failed {
    code: c_int,
    words: String,
    what: &'static str,
}

impl Failed {
    /// What it means while the loop runs.
    pub(crate) fn fault(&self) -> Fault {
        match self.code {
            COM | NO_DRIVER | NO_DEVICE => Fault::Disconnected,
            TIMEOUT => Fault::Timeout,
            _ => Fault::Protocol,
        }
    }

    /// For people, before it runs.
    pub(crate) fn refusal(&self) -> Refusal {
        let remedy = match self.code {
            NO_DRIVER => {
                "this user may not open the USB device: `flotor doctor --device force-dimension` has the line for udev"
            }
            NO_DEVICE => "connect it and switch it on; `lsusb -d 1451:` lists what the system sees",
            IN_USE => "end the other program that uses it",
            COM | TIMEOUT => "check cable, hub and power, switch it off and on",
            _ => "try it with the maker's own programs first",
        };
        Refusal::resource(format!(
            "{} failed (error {} of the SDK: {}); {remedy}",
            self.what, self.code, self.words
        ))
    }
}

/// A device that is open.
pub(crate) struct Dhd {
    functions: Box<Functions>,
    id: i8,
    wrist: Wrist,
}

/// What there is beside the translations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wrist {
    None,
    Sensed,
    Driven,
}

impl Dhd {
    /// Opens the library, and the device of this serial number, or of this place in the list. Moves nothing. Not real-time.
    pub(crate) fn open(path: Option<&str>, stand_in: StandIn, which: Which) -> Result<Self, Refusal> {
        let library = Library::open(&SDK, path, stand_in).map_err(Refusal::resource)?;
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
            // Those in use are not opened a second time.
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
                    "no free device has the serial number {wanted}; found: {}",
                    if found.is_empty() { "none".to_owned() } else { found.join(", ") }
                )))
            }
        }
    }

    fn opened(functions: Functions, index: i8) -> Result<Self, Refusal> {
        let id = without_signals(|| functions.open(index));
        let id = checked(&functions, id, "opening the device").map_err(|failed| failed.refusal())?;
        let id =
            i8::try_from(id).map_err(|_| Refusal::broken(format!("the SDK opened the device as {id}")))?;
        let wrist = match (functions.has_wrist(id), functions.has_active_wrist(id)) {
            (_, true) => Wrist::Driven,
            (true, false) => Wrist::Sensed,
            (false, false) => Wrist::None,
        };
        Ok(Self { functions: Box::new(functions), id, wrist })
    }

    fn check(&self, code: c_int, what: &'static str) -> Result<c_int, Failed> {
        checked(&self.functions, code, what)
    }

    /// What the maker calls it.
    pub(crate) fn name(&self) -> String {
        self.functions.system_name(self.id)
    }

    /// Number of its type.
    pub(crate) fn kind(&self) -> i32 {
        self.functions.system_type(self.id)
    }

    /// Its serial number; 0 if it says none.
    pub(crate) fn serial(&self) -> u16 {
        match self.functions.serial_number(self.id) {
            (0, serial) => serial,
            _ => 0,
        }
    }

    pub(crate) fn wrist(&self) -> Wrist {
        self.wrist
    }

    /// Whether it knows where it is.
    pub(crate) fn is_initialized(&self) -> bool {
        let (code, status) = self.functions.status(self.id);
        let is_calibrated = code >= 0 && status.get(CALIBRATED) == Some(&1);
        self.functions.is_initialized(self.id).unwrap_or(is_calibrated)
    }

    /// Moves the arm to find out where it is, and lets it go. Not real-time: seconds.
    pub(crate) fn initialize(&self) -> Result<(), Refusal> {
        let Some(code) = without_signals(|| self.functions.auto_init(self.id)) else {
            return Err(Refusal::resource(
                "this library cannot initialise a device: name `libdrd.so.3` of the same SDK with `library`",
            ));
        };
        let done = self.check(code, "the automatic initialisation").map_err(|failed| failed.refusal());
        let stopped = self.check(self.functions.stop_regulation(self.id), "the end of the regulation");
        done?;
        stopped.map(drop).map_err(|failed| failed.refusal())
    }

    /// Limits, velocity, watchdog, then force on, at zero.
    pub(crate) fn energize(&self, setup: &Setup) -> Result<(), Failed> {
        let Self { functions, id, wrist } = self;
        let [most_n, most_nm] = setup.most;
        match self.check(functions.set_gravity_compensation(true, *id), "gravity compensation") {
            // Not every device has it.
            Err(failed) if [NOT_AVAILABLE, NOT_IMPLEMENTED].contains(&failed.code) => {}
            done => drop(done?),
        }
        self.check(functions.set_most_force(most_n, *id), "the limit of force")?;
        self.check(functions.config_velocity(setup.window_ms, *id), "the velocity's window")?;
        if *wrist != Wrist::None {
            self.check(functions.config_angular_velocity(setup.window_ms, *id), "the velocity's window")?;
        }
        if *wrist == Wrist::Driven {
            self.check(functions.set_most_torque(most_nm, *id), "the limit of torque")?;
        }
        self.check(functions.set_watchdog(setup.watchdog_units, *id), "the watchdog of the device")?;
        self.check(functions.set_brakes(false, *id), "the brakes")?;
        self.check(functions.enable_force(true, *id), "enabling force")?;
        self.send(&Wrench::ZERO).map(drop)
    }

    /// Force off, brakes on. Whatever fails, the rest is done.
    pub(crate) fn relax(&self) {
        let Self { functions, id, .. } = self;
        let _ = functions.set_wrench([0.0; 3], [0.0; 3], *id);
        let _ = functions.stop(*id);
        let _ = functions.set_brakes(true, *id);
    }

    /// Pose, m and unit quaternion.
    pub(crate) fn pose(&self) -> Result<Pose, Failed> {
        let (code, position, rows) = self.functions.pose(self.id);
        self.check(code, "reading the pose")?;
        Ok(Pose::new(from_dhd(position), orientation(&rows)))
    }

    /// Velocity, m/s and rad/s; zero until its window is filled.
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

    /// What it says it gives, N and N·m.
    pub(crate) fn wrench(&self) -> Result<Wrench, Failed> {
        let (code, force, torque) = self.functions.wrench(self.id);
        self.check(code, "reading the force")?;
        Ok(Wrench::new(from_dhd(force), from_dhd(torque)))
    }

    pub(crate) fn buttons(&self) -> u32 {
        self.functions.buttons(self.id)
    }

    /// Sends a wrench and waits for the exchange; whether the motors cannot give all of it.
    pub(crate) fn send(&self, wrench: &Wrench) -> Result<Given, Failed> {
        const SATURATED: c_int = 2;
        let code = self.functions.set_wrench(to_dhd(wrench.force()), to_dhd(wrench.torque()), self.id);
        let code = self.check(code, "sending the force")?;
        Ok(if code == SATURATED { Given::Saturated } else { Given::All })
    }

    /// Why the device has switched its force off, if it has.
    pub(crate) fn force_off(&self) -> Result<Option<Fault>, Failed> {
        let (code, status) = self.functions.status(self.id);
        self.check(code, "reading the status")?;
        if status[ERROR] == 1 {
            return Ok(Some(Fault::Protocol));
        }
        Ok(match status[FORCE_OFF_CAUSE] {
            // A button at the device, or a handle that nobody holds.
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

/// Which device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Which {
    /// The first.
    First,
    /// That of a serial number.
    Serial(u16),
}

/// Whether the motors give what is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    All,
    Saturated,
}

/// How a device is to be energised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    /// Largest force, N, and torque, N·m.
    pub(crate) most: [f64; 2],
    /// Window of the velocity, ms.
    pub(crate) window_ms: c_int,
    /// Watchdog, in units of 125 µs.
    pub(crate) watchdog_units: u8,
}

fn checked(functions: &Functions, code: c_int, what: &'static str) -> Result<c_int, Failed> {
    if code >= 0 {
        return Ok(code);
    }
    let (code, words) = functions.last_error();
    Err(Failed { code, words, what })
}

/// Theirs: x towards the user, y right, z up. Ours: x right, y away, z up.
fn from_dhd([x, y, z]: [f64; 3]) -> DVec3 {
    DVec3::new(y, -x, z)
}

fn to_dhd(vector: DVec3) -> [f64; 3] {
    [-vector.y, vector.x, vector.z]
}

/// The orientation of a matrix of theirs, by its rows.
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
