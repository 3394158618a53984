//! Parameters of the device.

use crate::boundary::{Walls, thesis_nm_per_rad};
use crate::facts;
use crate::ml_api;
use crate::transport::{Kind, tcp};
use flotor_hal::{Choices, Parameter, Refusal, Settings, choices, read_text};
use std::path::Path;
use std::time::Duration;

const PROTOCOLS: Choices = choices!["flotor", "ml-api"];
const TRANSPORTS: Choices = choices!["tcp", "serial", "usb", "hid"];
const PACES: Choices = choices!["real", "lockstep"];
const GRAVITY: Choices = choices!["auto", "off", "defy"];
const WALLS: Choices = choices!["off", "maker", "thesis"];

/// Schema of the parameters, in the order of their indices.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice(
        "protocol",
        PROTOCOLS,
        0,
        "Protocol of the controller: flotor (on every transport), or the ML API 1.5b of the Maglev 200 (tcp)",
    ),
    Parameter::choice("transport", TRANSPORTS, 0, "Transport (usb and hid: if built with these features)"),
    Parameter::text(
        "address",
        "Address: host:port (tcp; default 127.0.0.1:5679, with ml-api 127.0.0.1:5678), a port such as /dev/ttyACM0 or COM3 \
         (serial), or vendor:product or vendor:product:serial, ids in hex (usb, hid)",
    ),
    Parameter::choice(
        "pace",
        PACES,
        0,
        "real: each tick uses the newest reply; lockstep: each tick waits for its reply (virtual clock, emulator)",
    ),
    Parameter::real(
        "watchdog_ms",
        "ms",
        1.0,
        1000.0,
        8.0,
        "Timeout of the controller's watchdog: without a command for this time the controller ends the \
         session, holds the handle and lands it; no effect with ml-api",
    ),
    Parameter::real("timeout_ms", "ms", 2.0, 10_000.0, 15.0, "Timeout for replies of the controller"),
    Parameter::real(
        "feedforward_n",
        "N",
        -50.0,
        50.0,
        0.0,
        "Vertical force that the controller adds by itself; a calibration corrects the sum; no effect without a calibration",
    ),
    Parameter::real(
        "takeoff_ms",
        "ms",
        0.0,
        10_000.0,
        0.0,
        "Time to bring the handle home before the scene becomes active; 0: the scene is active at once; no effect with ml-api, whose controller takes off by itself",
    ),
    Parameter::choice(
        "gravity",
        GRAVITY,
        0,
        "Gravity compensation: off (the controller or the scene compensates), defy (measured at take-off, then applied; needs \
         `takeoff_ms` except with ml-api); auto: off, with ml-api defy",
    ),
    Parameter::real(
        "fade_ms",
        "ms",
        0.0,
        10_000.0,
        1000.0,
        "With ml-api: time in which the controller's gains fade out before forces are commanded",
    ),
    Parameter::real(
        "boundary_mm",
        "mm",
        1.0,
        12.5,
        12.0,
        "With ml-api: radius of the controller's own boundary sphere",
    ),
    Parameter::real(
        "velocity_cutoff_hz",
        "Hz",
        1.0,
        5000.0,
        200.0,
        "With ml-api: cutoff frequency of the low-pass filter of the velocity, which is estimated by finite \
         differences of the pose",
    ),
    Parameter::file(
        "first_contact",
        choices![],
        "Report of tests/hardware/first_contact.py, for ml-api; its parameters replace the defaults (default: no report)",
    ),
    Parameter::real(
        "landing_ms",
        "ms",
        0.0,
        10_000.0,
        0.0,
        "Time in which the handle is lowered at the end; 0: the handle is not lowered; no effect with ml-api, whose controller lands by itself",
    ),
    Parameter::choice(
        "walls",
        WALLS,
        0,
        "Additional walls, inside the walls of the scene: off (the parameters of walls, angles and yaw have no effect), maker (the maker's boundary mode), or thesis (as maker, but with a stiffness from `gamma_n` beyond the angle limit, and damping of rotation at every angle)",
    ),
    Parameter::real("wall_radius_mm", "mm", 1.0, 12.0, 11.0, "Radius of the spherical wall about home")
        .live(),
    plane(
        "wall_x_mm",
        "Distance from home to each of the two walls perpendicular to x; no effect beyond `wall_radius_mm`",
    ),
    plane(
        "wall_y_mm",
        "Distance from home to each of the two walls perpendicular to y; no effect beyond `wall_radius_mm`",
    ),
    plane(
        "wall_z_mm",
        "Distance from home to each of the two walls perpendicular to z; no effect beyond `wall_radius_mm`",
    ),
    Parameter::real(
        "wall_stiffness_n_per_m",
        "N/m",
        0.0,
        facts::MAX_STIFFNESS_N_PER_M,
        15_000.0,
        "Stiffness of the walls (proportional gain); reduced to the stability limit",
    )
    .live(),
    Parameter::real("wall_damping_ns_per_m", "N s/m", 0.0, 40.0, 15.0, "Damping of the walls").live(),
    Parameter::real("angle_limit_deg", "°", 0.1, 7.0, 2.864_788_975_654_116, "Limit of tilt and yaw").live(),
    Parameter::real(
        "angle_stiffness_nm_per_rad",
        "N m/rad",
        0.0,
        facts::MAX_STIFFNESS_NM_PER_RAD,
        50.0,
        "Stiffness beyond the angle limit, with the maker's walls; reduced to the stability limit",
    )
    .live(),
    Parameter::real(
        "gamma_n",
        "N",
        0.0,
        100.0,
        17.0,
        "With the walls of the thesis: gamma of the spring; the stiffness beyond the angle limit is 2.5 \
         gamma in N m/rad, at least 30",
    )
    .live(),
    Parameter::real(
        "angle_damping_nms_per_rad",
        "N m s/rad",
        0.0,
        1.0,
        0.15,
        "Damping beyond the angle limit; with the walls of the thesis, or a yaw spring, at every angle",
    )
    .live(),
    Parameter::real(
        "yaw_stiffness_nm_per_rad",
        "N m/rad",
        0.0,
        50.0,
        0.0,
        "Stiffness of the yaw spring about home; 0: no spring; reduced to the stability limit",
    )
    .live(),
];

/// Returns the parameter of the distance from home to two opposite walls.
const fn plane(id: &'static str, doc: &'static str) -> Parameter {
    Parameter::real(id, "mm", 0.5, 12.0, 12.0, doc).live()
}

/// Protocol of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Protocol {
    Flotor,
    MlApi,
}

/// Gravity compensation by the plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gravity {
    /// [`Off`](Self::Off) for Flotor's protocol, [`Defy`](Self::Defy) for the ML API.
    Auto,
    Off,
    Defy,
}

/// Options fixed while the loop runs, parsed from the parameters of connection, timing, feed-forward, take-off and landing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Options {
    pub(crate) protocol: Protocol,
    pub(crate) kind: Kind,
    pub(crate) address: String,
    pub(crate) lockstep: bool,
    pub(crate) watchdog_us: u32,
    pub(crate) timeout: Duration,
    pub(crate) feedforward_n: f64,
    /// Homing time; zero: no homing.
    pub(crate) take_off: Duration,
    pub(crate) landing: Duration,
    pub(crate) gravity: Gravity,
    /// Time in which the gains fade.
    pub(crate) fade: Duration,
}

impl Options {
    pub(crate) fn new(settings: &Settings<'_>, values: &Values) -> Result<Self, Refusal> {
        let milliseconds = |id| Duration::from_secs_f64(values.value(id) * 1.0e-3);
        let protocol = settings.one_of("protocol", [Protocol::Flotor, Protocol::MlApi]);
        let kind = settings.one_of("transport", [Kind::Tcp, Kind::Serial, Kind::Usb, Kind::Hid]);
        let port = match (protocol, kind) {
            (Protocol::Flotor, _) => tcp::PORT,
            (Protocol::MlApi, Kind::Tcp) => ml_api::PORT,
            (Protocol::MlApi, _) => {
                let reason =
                    "the ML API works over TCP only; remove `transport`, or set `protocol = \"flotor\"`";
                return Err(Refusal::parameter(reason));
            }
        };
        Ok(Self {
            protocol,
            kind,
            address: settings.text("address").map_or_else(|| format!("127.0.0.1:{port}"), str::to_owned),
            lockstep: settings.choice_or_default("pace") == 1,
            watchdog_us: u32::try_from(milliseconds("watchdog_ms").as_micros()).unwrap_or(u32::MAX),
            timeout: milliseconds("timeout_ms"),
            feedforward_n: values.value("feedforward_n"),
            take_off: milliseconds("takeoff_ms"),
            landing: milliseconds("landing_ms"),
            gravity: settings.one_of("gravity", [Gravity::Auto, Gravity::Off, Gravity::Defy]),
            fade: milliseconds("fade_ms"),
        })
    }

    /// Returns true if the plugin measures gravity at take-off and compensates it. Under force commands the controller of
    /// the ML API compensates nothing by itself.
    pub(crate) fn finds_gravity(&self) -> bool {
        match self.gravity {
            Gravity::Auto => self.protocol == Protocol::MlApi,
            Gravity::Off => false,
            Gravity::Defy => true,
        }
    }
}

/// Values of all numeric parameters, in the order of the schema.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Values {
    values: Vec<f64>,
}

impl Values {
    /// Collects the values: from the scene, else from a first-contact report, else the defaults.
    pub(crate) fn new(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let mut values = Self { values: SCHEMA.iter().map(Parameter::default).collect() };
        if let Some(report) = settings.text("first_contact") {
            values.learn(Path::new(report))?;
        }
        for (index, parameter) in SCHEMA.iter().enumerate() {
            if let Some(value) = settings.number(parameter.id()) {
                values.set(index, value);
            }
        }
        Ok(values)
    }

    /// Reads the table `device.parameters` from a first-contact report.
    fn learn(&mut self, report: &Path) -> Result<(), Refusal> {
        let wrong = |why: &dyn std::fmt::Display| {
            Refusal::parameter(format!("first_contact = \"{}\": {why}", report.display()))
        };
        let text = read_text(report, "the file").map_err(|problem| wrong(&problem.problem))?;
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            wrong(&format_args!(
                "line {line}: {}; run tests/hardware/first_contact.py again",
                error.message()
            ))
        })?;
        let parameters = table.get("device").and_then(|device| device.get("parameters"));
        let Some(parameters) = parameters.and_then(toml::Value::as_table) else {
            return Err(wrong(
                &"the table [device.parameters] is missing; name a report that \
                     tests/hardware/first_contact.py has written",
            ));
        };
        for (id, value) in parameters {
            let Some(index) = SCHEMA.iter().position(|parameter| parameter.id() == id) else {
                return Err(wrong(&format_args!(
                    "the device has no parameter `{id}`; remove the line, or run \
                     tests/hardware/first_contact.py of this version again"
                )));
            };
            #[allow(clippy::cast_precision_loss)] // numbers written by people
            let number = value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
            let checked = number.ok_or("must be a number".to_owned()).and_then(|number| {
                SCHEMA[index].check(number).map_err(|error| error.to_string()).map(|_| number)
            });
            self.set(index, checked.map_err(|why| wrong(&format_args!("{id} = {value}: {why}")))?);
        }
        Ok(())
    }

    pub(crate) fn get(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }

    pub(crate) fn set(&mut self, index: usize, value: f64) {
        if let Some(slot) = self.values.get_mut(index) {
            *slot = value;
        }
    }

    pub(crate) fn value(&self, id: &str) -> f64 {
        SCHEMA.iter().position(|parameter| parameter.id() == id).map_or(f64::NAN, |index| self.get(index))
    }

    /// Returns the configured walls; `None` if they are off. Real-time: bounded, no allocation.
    pub(crate) fn walls(&self) -> Option<Walls> {
        const MM: f64 = 1.0e-3;
        /// Indices in the list of choices.
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
