//! What the device can be told.

use crate::boundary::{Walls, thesis_nm_per_rad};
use crate::facts;
use crate::transport::Kind;
use flotor_hal::{Choices, Parameter, Settings, choices};
use std::time::Duration;

const TRANSPORTS: Choices = choices!["tcp", "serial", "usb", "hid"];
const PACES: Choices = choices!["real", "lockstep"];
const GRAVITY: Choices = choices!["off", "defy"];
const WALLS: Choices = choices!["off", "maker", "thesis"];

/// Where an emulator listens unless told otherwise.
const DEFAULT_ADDRESS: &str = "127.0.0.1:5678";

/// The schema.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice("transport", TRANSPORTS, 0, "How the controller is reached"),
    Parameter::text(
        "address",
        "Where: host:port (default 127.0.0.1:5678), a serial port's path, or vendor:product in hex (usb, hid)",
    ),
    Parameter::choice(
        "pace",
        PACES,
        0,
        "real: answers are taken as they come; lockstep: each tick waits for its answer (virtual clock, emulator)",
    ),
    Parameter::real(
        "watchdog_ms",
        "ms",
        1.0,
        1000.0,
        8.0,
        "Watchdog of the controller: time without a command after which it ends the session and holds",
    ),
    Parameter::real("timeout_ms", "ms", 2.0, 10_000.0, 15.0, "Silence of the controller that is a fault"),
    Parameter::real(
        "feedforward_n",
        "N",
        -50.0,
        50.0,
        0.0,
        "Vertical force the controller adds by itself; a calibration corrects the sum",
    ),
    Parameter::real(
        "takeoff_ms",
        "ms",
        0.0,
        10_000.0,
        0.0,
        "Time to bring the handle home before the scene becomes active; 0: the scene is active at once",
    ),
    Parameter::choice(
        "gravity",
        GRAVITY,
        0,
        "Gravity compensation: off (the controller or the scene does it), defy (measured at take-off, then applied)",
    ),
    Parameter::real("landing_ms", "ms", 0.0, 10_000.0, 0.0, "Time in which the handle is let down at the end"),
    Parameter::choice(
        "walls",
        WALLS,
        0,
        "Walls of the device, inside those of the scene: off, the maker's, or those of the thesis",
    ),
    Parameter::real("wall_radius_mm", "mm", 1.0, 12.0, 11.0, "Where the spherical wall begins").live(),
    Parameter::real("wall_x_mm", "mm", 0.5, 12.0, 12.0, "Where the walls on x begin").live(),
    Parameter::real("wall_y_mm", "mm", 0.5, 12.0, 12.0, "Where the walls on y begin").live(),
    Parameter::real("wall_z_mm", "mm", 0.5, 12.0, 12.0, "Where the walls on z begin").live(),
    Parameter::real(
        "wall_stiffness_n_per_m",
        "N/m",
        0.0,
        facts::MAX_STIFFNESS_N_PER_M,
        15_000.0,
        "Stiffness of the walls (proportional gain); scaled down to what is stable",
    )
    .live(),
    Parameter::real("wall_damping_ns_per_m", "N s/m", 0.0, 40.0, 15.0, "Damping of the walls").live(),
    Parameter::real(
        "angle_limit_deg",
        "°",
        0.1,
        7.0,
        2.864_788_975_654_116,
        "Where tilt and yaw are limited",
    )
    .live(),
    Parameter::real(
        "angle_stiffness_nm_per_rad",
        "N m/rad",
        0.0,
        facts::MAX_STIFFNESS_NM_PER_RAD,
        50.0,
        "Stiffness beyond it, with the maker's walls; scaled down to what is stable",
    )
    .live(),
    Parameter::real(
        "gamma_n",
        "N",
        0.0,
        100.0,
        17.0,
        "Gamma of the spring, with the thesis's walls: the stiffness beyond the angle limit is 2.5 gamma, at least 30",
    )
    .live(),
    Parameter::real(
        "angle_damping_nms_per_rad",
        "N m s/rad",
        0.0,
        1.0,
        0.15,
        "Damping beyond it; thesis: everywhere",
    )
    .live(),
    Parameter::real(
        "yaw_stiffness_nm_per_rad",
        "N m/rad",
        0.0,
        50.0,
        0.0,
        "Spring of yaw about home; scaled down to what is stable",
    )
    .live(),
];

/// Everything but the walls, which change while the loop runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Options {
    pub(crate) kind: Kind,
    pub(crate) address: String,
    pub(crate) lockstep: bool,
    pub(crate) watchdog_us: u32,
    pub(crate) timeout: Duration,
    pub(crate) feedforward_n: f64,
    /// Time for coming home; none: at once.
    pub(crate) take_off: Duration,
    pub(crate) landing: Duration,
    pub(crate) defy_gravity: bool,
}

impl Options {
    pub(crate) fn new(settings: &Settings<'_>) -> Self {
        let milliseconds = |id| Duration::from_secs_f64(settings.number_or_default(id) * 1.0e-3);
        Self {
            kind: match settings.choice_or_default("transport") {
                1 => Kind::Serial,
                2 => Kind::Usb,
                3 => Kind::Hid,
                _ => Kind::Tcp,
            },
            address: settings.text("address").unwrap_or(DEFAULT_ADDRESS).to_owned(),
            lockstep: settings.choice_or_default("pace") == 1,
            watchdog_us: u32::try_from(milliseconds("watchdog_ms").as_micros()).unwrap_or(u32::MAX),
            timeout: milliseconds("timeout_ms"),
            feedforward_n: settings.number_or_default("feedforward_n"),
            take_off: milliseconds("takeoff_ms"),
            landing: milliseconds("landing_ms"),
            defy_gravity: settings.choice_or_default("gravity") == 1,
        }
    }
}

/// Every number of the schema, in its order, and what walls they make.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Values {
    values: Vec<f64>,
}

impl Values {
    pub(crate) fn new(settings: &Settings<'_>) -> Self {
        Self { values: SCHEMA.iter().map(|parameter| settings.number_or_default(parameter.id())).collect() }
    }

    pub(crate) fn get(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }

    pub(crate) fn set(&mut self, index: usize, value: f64) {
        if let Some(slot) = self.values.get_mut(index) {
            *slot = value;
        }
    }

    fn value(&self, id: &str) -> f64 {
        SCHEMA.iter().position(|parameter| parameter.id() == id).map_or(f64::NAN, |index| self.get(index))
    }

    /// The walls as asked for; nothing if they are off. Real-time: bounded, no allocation.
    pub(crate) fn walls(&self) -> Option<Walls> {
        const MM: f64 = 1.0e-3;
        /// Places in the list of choices.
        const OFF: f64 = 0.0;
        const THESIS: f64 = 2.0;
        let choice = self.value("walls");
        if choice == OFF {
            return None;
        }
        let mut walls = Walls::maker(self.value("wall_radius_mm") * MM);
        let (stiffness, damping) =
            (self.value("wall_stiffness_n_per_m"), self.value("wall_damping_ns_per_m"));
        (walls.sphere.stiffness, walls.sphere.damping) = (stiffness, damping);
        for (plane, id) in walls.planes.iter_mut().zip(["wall_x_mm", "wall_y_mm", "wall_z_mm"]) {
            *plane = crate::boundary::Wall { limit: self.value(id) * MM, stiffness, damping };
        }
        for turn in [&mut walls.tilt, &mut walls.yaw] {
            turn.limit = self.value("angle_limit_deg").to_radians();
            turn.stiffness = match choice {
                THESIS => thesis_nm_per_rad(self.value("gamma_n")),
                _ => self.value("angle_stiffness_nm_per_rad"),
            };
            turn.damping = self.value("angle_damping_nms_per_rad");
        }
        walls.yaw_spring_nm_per_rad = self.value("yaw_stiffness_nm_per_rad");
        if choice == THESIS || walls.yaw_spring_nm_per_rad > 0.0 {
            walls.rotation_damping_nms_per_rad = walls.tilt.damping;
        }
        Some(walls)
    }
}
