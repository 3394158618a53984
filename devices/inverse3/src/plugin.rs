//! Implementation of the device contract for the Inverse3: positions, orientation and buttons from the service, forces to the service.

use crate::exchange::Exchange;
use crate::message::Sample;
use crate::session::{GripRequest, Request, Session};
use flotor_force_switch::ForceSwitch;
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Conditions, ConnectionDevice, Cycle, DVec3, Device, DeviceInfo,
    DeviceState, IndependentStop, IndependentStopDevice, LoopConfig, Parameter, Pose, Refusal, Settings,
    StoppedState, Tick, Twist, UsbAccess, UsbKind, VelocityFilter, Wrench, export_device, rotation_vector,
};
use std::f64::consts::PI;
use std::time::{Duration, Instant};

/// Default address of the service.
const ADDRESS: &str = "127.0.0.1:10001";
/// Value of `grip` for no grip.
const NO_GRIP: &str = "none";
/// Resolution of the cursor, m: the maker's figure.
const RESOLUTION_M: f64 = 1.0e-5;
/// Maximum slew rate of the force, N/s: from zero to the default limit in a millisecond.
const SLEW_N_PER_S: f64 = 5000.0;
/// Latency from a tick to its force, in addition to one period, s: to the service and to the device.
const LATENCY_S: f64 = 1.0e-3;
/// Timeout for commands of earlier sessions to expire: several times their validity.
const COMMANDS_FADE: Duration = Duration::from_millis(500);
const LOOK: Duration = Duration::from_millis(5);
/// Time after which a service removes the force of a silent session, ns: documented as a return to idle, without a number;
/// Flotor's own service takes 0.1 s. If the host's process ends, the connection ends at once.
const STOP_NS: u64 = 100_000_000;

const SCHEMA: &[Parameter] = &[
    Parameter::text("address", "Address of the Inverse Service (default: 127.0.0.1:10001)"),
    Parameter::text("device", "Id of the Inverse3, from its label (default: the only one)"),
    Parameter::text("grip", "Id of the VerseGrip; `none`: no grip (default: the only one, if there is one)"),
    Parameter::real("max_force_n", "N", 0.0, 20.0, 5.0, "Largest force on the hand"),
    Parameter::real(
        "range_mm",
        "mm",
        1.0,
        200.0,
        60.0,
        "Half-extent of the workspace along each axis, about the centre of the arm's range",
    ),
    Parameter::real(
        "force_gate",
        "1",
        0.0,
        1.0,
        0.0,
        "Gain of the service's force gate, whose effect on the force the maker does not document",
    ),
    Parameter::real(
        "foreign_force_n",
        "N",
        0.0,
        100.0,
        0.5,
        "Largest deviation of a component of the reported force from the range of recent commands; a larger \
         deviation is a fault: another program commands the device",
    ),
    Parameter::real(
        "spin_cutoff_hz",
        "Hz",
        1.0,
        500.0,
        30.0,
        "Cutoff frequency of the low-pass filter of the angular velocity, which is estimated by finite \
         differences of the orientation; no effect without a grip",
    ),
    Parameter::real("timeout_ms", "ms", 5.0, 10_000.0, 100.0, "Timeout for messages of the service"),
];

/// Parsed parameters.
#[derive(Clone, Debug)]
struct Options {
    request: Request,
    max_force_n: f64,
    range_m: f64,
    spin_cutoff_hz: f64,
    values: Vec<f64>,
}

impl Options {
    fn new(settings: &Settings<'_>) -> Self {
        let grip = match settings.text("grip") {
            None => GripRequest::OnlyOne,
            Some(NO_GRIP) => GripRequest::None,
            Some(id) => GripRequest::Named(id.to_owned()),
        };
        let request = Request {
            address: settings.text("address").unwrap_or(ADDRESS).to_owned(),
            arm: settings.text("device").map(str::to_owned),
            grip,
            force_gate: settings.number_or_default("force_gate"),
            timeout: Duration::from_secs_f64(settings.number_or_default("timeout_ms") * 1.0e-3),
            foreign_force_n: settings.number_or_default("foreign_force_n"),
        };
        Self {
            request,
            max_force_n: settings.number_or_default("max_force_n"),
            range_m: settings.number_or_default("range_mm") * 1.0e-3,
            spin_cutoff_hz: settings.number_or_default("spin_cutoff_hz"),
            values: settings.values(),
        }
    }

    /// Opens a session on a device that no program commands.
    fn open(&self) -> Result<Session, Refusal> {
        let mut session = Session::open(&self.request).map_err(Refusal::resource)?;
        self.idle(&mut session)?;
        Ok(session)
    }

    /// Waits until no earlier session commands the device, and returns a sample.
    fn idle(&self, session: &mut Session) -> Result<Sample, Refusal> {
        let started = Instant::now();
        loop {
            let sample = session.poll().map_err(|error| {
                Refusal::resource(format!("the Inverse Service at {}: {error}", self.request.address))
            })?;
            if !sample.is_commanded {
                return Ok(sample);
            }
            if started.elapsed() >= COMMANDS_FADE {
                return Err(Refusal::resource(
                    "another program commands this Inverse3, and the forces of both would add up; end that program first",
                ));
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// Opened Inverse3: a session of the service without commands.
pub struct Inverse3Device {
    options: Options,
    /// `None` after a fault: the next activation opens another session.
    session: Option<Session>,
    has_grip: bool,
    switch: ForceSwitch,
}

/// Active Inverse3: exerts the commanded force.
pub struct DrivenDevice {
    opened: Inverse3Device,
    exchange: Exchange,
    /// Sample of the activation, until it is read.
    first: Option<Sample>,
    state: DeviceState,
    spin: VelocityFilter,
}

impl Device for Inverse3Device {
    const INFO: DeviceInfo = DeviceInfo::new(
        "inverse3",
        "Haply Inverse3",
        "A desktop arm with three driven axes and a grip that turns freely, through Haply's Inverse Service",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = DrivenDevice;
    type Stop = ForceSwitch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let options = Options::new(settings);
        let session = options.open()?;
        let has_grip = session.chosen().grip.is_some();
        Ok(Self { options, session: Some(session), has_grip, switch: ForceSwitch::default() })
    }

    fn capabilities(&self) -> Capabilities {
        let Options { max_force_n, range_m, .. } = self.options;
        Capabilities {
            resolution_m: RESOLUTION_M,
            rate_hz: [100.0, 4000.0],
            ..Capabilities::driving(Axes::TRANSLATION)
                .sensing(if self.has_grip { Axes::ALL } else { Axes::TRANSLATION })
                .with_range(range_m, PI)
                .with_limits(max_force_n, 0.0)
                .with_slew(SLEW_N_PER_S, f64::INFINITY) // no torque to limit
                .with_latency(LATENCY_S)
        }
    }

    fn stopper(&self) -> ForceSwitch {
        self.switch.clone()
    }

    fn activate(mut self, _config: &LoopConfig) -> Result<DrivenDevice, (Self, Refusal)> {
        match self.start() {
            Ok((exchange, sample)) => Ok(DrivenDevice {
                spin: VelocityFilter::new(self.options.spin_cutoff_hz),
                opened: self,
                exchange,
                first: Some(sample),
                state: DeviceState::HOME,
            }),
            Err(refusal) => Err((self, refusal)),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.options.values.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl Inverse3Device {
    fn start(&mut self) -> Result<(Exchange, Sample), Refusal> {
        let mut session = match self.session.take() {
            Some(session) => session,
            None => self.options.open()?,
        };
        let sample = self.options.idle(&mut session)?;
        self.switch.rearm();
        let exchange = Exchange::start(session, &self.switch).map_err(Refusal::resource)?;
        Ok((exchange, sample))
    }
}

impl ActiveDevice for DrivenDevice {
    type Opened = Inverse3Device;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let newest = match self.exchange.take() {
            Ok(newest) => newest.or(self.first),
            Err(error) => return Cycle::Fault(error.fault()),
        };
        self.first = None;
        let cycle = match newest {
            Some(sample) => {
                self.sample(&sample, tick.time_ns);
                Cycle::Fresh
            }
            // The thread reports a service that is silent for too long.
            None => Cycle::Stale,
        };
        *state = self.state;
        cycle
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let asked_n = wrench.force();
        let force_n = match asked_n.is_finite() && !self.opened.switch.is_stopped() {
            true => asked_n.clamp_length_max(self.opened.options.max_force_n),
            false => DVec3::ZERO,
        };
        if self.exchange.post(force_n) { Cycle::Fresh } else { Cycle::Stale }
    }

    fn deactivate(mut self) -> Inverse3Device {
        self.opened.session = self.exchange.end();
        self.opened
    }
}

impl DrivenDevice {
    /// Updates the sample from a state of the service.
    fn sample(&mut self, sample: &Sample, time_ns: u64) {
        let pose = Pose::new(sample.position_m, sample.orientation);
        let turned_rad = rotation_vector(sample.orientation * self.state.pose.orientation().conjugate());
        let angular = self.spin.update(turned_rad, time_ns);
        self.state = DeviceState {
            pose,
            twist: Twist::new(sample.velocity_m_per_s, angular),
            delivered: Wrench::from_force(sample.force_n),
            sampled_ns: time_ns,
            buttons: sample.buttons,
            conditions: Conditions::NONE,
        };
    }
}

impl IndependentStopDevice for Inverse3Device {
    /// Declares a stop by the service: the connection ends with the host's process, and with the connection the service
    /// removes the force.
    fn independent_stop(&self) -> IndependentStop {
        IndependentStop::by_itself(StoppedState::Zero, STOP_NS)
    }
}

impl ConnectionDevice for Inverse3Device {
    /// Serial ports that the service uses: arm, and receiver of a grip.
    const USB: &'static [UsbKind] =
        &[UsbKind::new(0x16c0, 0x0483, UsbAccess::Serial), UsbKind::new(0x2fe3, 0x0100, UsbAccess::Serial)];
}

export_device!(Inverse3Device, connection, independent_stop);
