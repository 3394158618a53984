//! The device with Flotor's own protocol: activation arms the controller and lifts the flotor, on any transport.

use crate::flight::Holder;
use crate::host_link::{AcknowledgedStatus, HostLink, Unanswered};
use crate::parameters::Options;
use crate::protocol::{Condition, Description, Mode, Rejections, Request, Status};
use crate::shaping::Shaping;
use crate::transport::{self, Kind, LinkLost};
use flotor_hal::{
    Axes, Capabilities, Conditions, Cycle, DQuat, DVec3, DeviceState, Fault, IndependentStop, LoopConfig,
    Pose, Refusal, SafeStop, StopFlag, StoppedState, Tick, Twist, VerticalCalibration, Wrench,
};
use std::time::Duration;

/// Timeout of the description, of arming, of take-off and of switching off.
const PATIENCE: Duration = Duration::from_secs(2);
/// Timeout of a lockstep tick: a delayed emulator is not a fault.
const LOCKSTEP_PATIENCE: Duration = Duration::from_secs(10);
/// Validity of a command in periods: one more than its replacement takes. After two missed deadlines the force of the host
/// ends, long before the watchdog ends the session.
const VALID_PERIODS: u64 = 3;
/// Rounding tolerance of the squared length of a quaternion's vector part in `f32`.
const LENGTH_TOLERANCE: f64 = 1.0e-5;

/// The opened device: the controller has described itself; no session has begun.
pub(crate) struct OwnDevice {
    options: Options,
    link: HostLink,
    description: Description,
    pub(crate) calibration: VerticalCalibration,
    /// Requests that the device switch off at its next tick; without a next tick the controller's watchdog switches it off.
    stop: StopFlag,
}

/// The device, levitating.
pub(crate) struct OwnActive {
    opened: Box<OwnDevice>,
    pub(crate) shaping: Shaping,
    period_us: u64,
    /// Sequence number of the command awaited by a lockstep tick.
    awaited: Option<u32>,
    /// The status of take-off, until a newer one arrives.
    first: Option<Status>,
    /// The newest status: the start of a landing.
    newest: Status,
    state: DeviceState,
    heard_ns: u64,
}

impl OwnDevice {
    pub(crate) fn open(options: &Options) -> Result<Self, Refusal> {
        let (link, description) = connect(options)?;
        Ok(Self {
            options: options.clone(),
            link,
            description,
            calibration: VerticalCalibration::NONE,
            stop: StopFlag::default(),
        })
    }

    pub(crate) fn capabilities(&self) -> Capabilities {
        let Description { axes: sensing, ranges, limits } = self.description;
        Capabilities {
            sensed: axes(sensing.sensed),
            actuated: axes(sensing.actuated),
            range_m: ranges.range_m.map(f64::from),
            range_rad: ranges.range_rad.map(f64::from),
            resolution_m: f64::from(sensing.resolution_m),
            max_force_n: limits.max_force_n.map(f64::from),
            max_torque_nm: limits.max_torque_nm.map(f64::from),
            max_force_slew_n_per_s: f64::from(ranges.force_slew_n_per_s),
            max_torque_slew_nm_per_s: f64::from(ranges.torque_slew_nm_per_s),
            max_stiffness_n_per_m: f64::from(ranges.max_stiffness_n_per_m),
            rate_hz: sensing.rate_hz.map(f64::from),
            latency_s: self.latency_s(),
        }
    }

    pub(crate) fn latency_s(&self) -> f64 {
        f64::from(self.description.axes.latency_us) * 1.0e-6
    }

    pub(crate) fn stopper(&self) -> StopFlag {
        self.stop.clone()
    }

    pub(crate) fn serial(&self) -> String {
        self.description.serial_text()
    }

    /// Describes the controller's own stop: three periods after a command the controller only damps, and after the watchdog
    /// timeout it lands. A stop message from another process would be rejected for its session and sequence number.
    pub(crate) fn independent_stop(&self) -> IndependentStop {
        let watchdog_us = self.options.watchdog_us.min(self.description.limits.longest_watchdog_us);
        IndependentStop::by_itself(StoppedState::Landed, u64::from(watchdog_us) * 1000)
    }

    pub(crate) fn activate(
        mut self: Box<Self>,
        config: &LoopConfig,
    ) -> Result<Box<OwnActive>, (Box<Self>, Refusal)> {
        match self.take_off(config) {
            Ok((first, weight_n)) => Ok(Box::new(OwnActive {
                newest: first,
                shaping: Shaping::new(
                    self.calibration,
                    Wrench::from_force(DVec3::Z * weight_n),
                    self.options.feedforward_n,
                ),
                period_us: config.period_ns / 1000,
                awaited: None,
                first: Some(first),
                state: DeviceState::HOME,
                heard_ns: 0,
                opened: self,
            })),
            Err(refusal) => Err((self, refusal)),
        }
    }

    /// Begins a session, homes and weighs the handle if configured; first reopens a lost link (cable unplugged and
    /// plugged in again). Returns the last status and the weight, N.
    fn take_off(&mut self, config: &LoopConfig) -> Result<(Status, f64), Refusal> {
        let period_us = u32::try_from(config.period_ns / 1000).unwrap_or(u32::MAX);
        let watchdog_us = self.options.watchdog_us;
        let taken_off = match self.link.take_off(period_us, watchdog_us, PATIENCE) {
            Err(Unanswered::Lost) => {
                let (link, description) = connect(&self.options)?;
                if description != self.description {
                    let reason = "another controller than the opened controller replies; start again";
                    return Err(Refusal::resource(reason));
                }
                self.link = link;
                self.link.take_off(period_us, watchdog_us, PATIENCE)
            }
            other => other,
        };
        let status = taken_off.map_err(|unanswered| refused(&self.options, unanswered))?;
        self.stop.arm();
        if self.options.take_off.is_zero() {
            return Ok((status, 0.0));
        }
        let holder = self.holder(period_us);
        let (status, found_n) =
            holder.take_off(&mut self.link, status, self.options.take_off).map_err(|why| {
                let _ = self.link.disarm(PATIENCE);
                Refusal::resource(format!("homing failed: {why}"))
            })?;
        Ok((status, if self.options.finds_gravity() { found_n } else { 0.0 }))
    }

    fn holder(&self, period_us: u32) -> Holder {
        Holder { period_us, delay_s: self.latency_s(), lockstep: self.options.lockstep }
    }
}

/// Opens the link and requests the controller's description.
fn connect(options: &Options) -> Result<(HostLink, Description), Refusal> {
    let transport = transport::open(options.kind, &options.address).map_err(Refusal::resource)?;
    let mut link = HostLink::new(transport);
    let description = link.describe(PATIENCE).map_err(|unanswered| refused(options, unanswered))?;
    Ok((link, description))
}

fn refused(options: &Options, unanswered: Unanswered) -> Refusal {
    let Options { kind, address, .. } = options;
    let hint = match kind {
        Kind::Tcp => "; without hardware start the emulator with `flotor emulate maglev` (on Linux)",
        Kind::Serial | Kind::Usb | Kind::Hid => "",
    };
    Refusal::resource(match unanswered {
        Unanswered::Lost => format!(
            "the connection to the controller at {address} was lost; check cable and power, and end other programs that use the controller"
        ),
        Unanswered::Silent => format!(
            "no controller of this device replies at {address}; check its power, `address` and `protocol`, and end other programs that use the controller{hint}"
        ),
    })
}

fn axes(bits: u8) -> Axes {
    let all = |mask| bits & mask == mask;
    match (all(0b00_0111), all(0b11_1000)) {
        (true, true) => Axes::ALL,
        (true, false) => Axes::TRANSLATION,
        (false, true) => Axes::ROTATION,
        (false, false) => Axes::NONE,
    }
}

impl OwnActive {
    pub(crate) fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let newest = match self.poll() {
            Ok(newest) => newest,
            Err(LinkLost) => return Cycle::Fault(Fault::Disconnected),
        };
        let status = newest.map(|newest| newest.status).or_else(|| self.first.take());
        let Some(status) = status else {
            #[allow(clippy::cast_possible_truncation)] // ten seconds at most
            let timeout_ns = self.opened.options.timeout.as_nanos() as u64;
            let silence_ns = tick.time_ns.saturating_sub(self.heard_ns);
            *state = self.state;
            return if silence_ns > timeout_ns { Cycle::Fault(Fault::Timeout) } else { Cycle::Stale };
        };
        self.heard_ns = tick.time_ns;
        self.newest = status;
        let Some(sample) = sample(&status) else { return Cycle::Fault(Fault::Protocol) };
        let when = |is: bool, condition| if is { condition } else { Conditions::NONE };
        let saturated = when(status.condition.contains(Condition::LIMITED), Conditions::SATURATED);
        let excess = when(self.shaping.warning.is_active(), Conditions::EXCESS_FORCE);
        let is_levitating = status.mode == Mode::Levitating;
        self.state = DeviceState {
            conditions: saturated.with(excess),
            delivered: if is_levitating { self.shaping.commanded } else { Wrench::ZERO },
            sampled_ns: tick.time_ns,
            ..sample
        };
        *state = self.state;
        match fault(&status) {
            // Switched off on request: the pose is still valid.
            _ if self.opened.stop.is_set() => Cycle::Fresh,
            Some(fault) => Cycle::Fault(fault),
            None => Cycle::Fresh,
        }
    }

    pub(crate) fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle {
        let request = if self.opened.stop.is_set() {
            // Stopped: no force from now on, whatever the next status contains.
            self.shaping.commanded = Wrench::ZERO;
            self.state.delivered = Wrench::ZERO;
            Request::Disarm
        } else {
            let valid_us = u16::try_from(VALID_PERIODS * self.period_us).unwrap_or(u16::MAX);
            Request::Command { wrench: self.shaping.command(wrench, &self.state), valid_us }
        };
        #[allow(clippy::cast_possible_truncation)] // the clock on the wire wraps
        match self.opened.link.send(request, (tick.time_ns / 1000) as u32) {
            Ok(()) => {
                self.awaited = Some(self.opened.link.sequence);
                Cycle::Fresh
            }
            Err(LinkLost) => Cycle::Fault(Fault::Disconnected),
        }
    }

    pub(crate) fn deactivate(mut self) -> Box<OwnDevice> {
        if !self.opened.options.landing.is_zero()
            && !self.opened.stop.is_set()
            && fault(&self.newest).is_none()
        {
            let holder = self.opened.holder(u32::try_from(self.period_us).unwrap_or(u32::MAX));
            let (landing, weight_n) = (self.opened.options.landing, self.shaping.weight.force().z);
            // On any error: the device is switched off next.
            let _ = holder.land(&mut self.opened.link, self.newest, landing, weight_n);
        }
        // If the controller is gone or silent, its own watchdog switches it off.
        let _ = self.opened.link.disarm(PATIENCE);
        self.opened
    }

    /// Returns the numbers of rejected replies of the controller, by reason.
    pub(crate) fn rejections(&self) -> &Rejections {
        self.opened.link.rejections()
    }

    pub(crate) fn latency_s(&self) -> f64 {
        self.opened.latency_s()
    }

    /// Reads the newest status, if any; in lockstep, waits for the status that answers the last command.
    fn poll(&mut self) -> Result<Option<AcknowledgedStatus>, LinkLost> {
        let awaited = self.awaited.take().filter(|_| self.opened.options.lockstep);
        match awaited {
            Some(awaited) => self.opened.link.wait_for(awaited, LOCKSTEP_PATIENCE),
            None => self.opened.link.take(),
        }
    }
}

/// Converts a status to pose and velocity; `None` if its rotation is not part of a unit quaternion.
fn sample(status: &Status) -> Option<DeviceState> {
    let vector = DVec3::from_array(status.rotation_xyz.map(f64::from));
    let rest = 1.0 - vector.length_squared();
    if rest < -LENGTH_TOLERANCE {
        return None;
    }
    let orientation = DQuat::from_xyzw(vector.x, vector.y, vector.z, rest.max(0.0).sqrt()).normalize();
    let scaled = |steps: [i16; 3], step: f64| DVec3::from_array(steps.map(f64::from)) * step;
    Some(DeviceState {
        pose: Pose::new(DVec3::from_array(status.position_m.map(f64::from)), orientation),
        twist: Twist::new(
            scaled(status.velocity_steps, Status::VELOCITY_STEP_M_PER_S),
            scaled(status.spin_steps, Status::SPIN_STEP_RAD_PER_S),
        ),
        ..DeviceState::HOME
    })
}

/// Returns the fault of a status; `None` in the mode [`Mode::Levitating`].
fn fault(status: &Status) -> Option<Fault> {
    if status.mode == Mode::Levitating {
        return None;
    }
    const FAULTS: [(Condition, Fault); 7] = [
        (Condition::SENSOR_RANGE, Fault::SensorOutOfRange),
        (Condition::EDGE, Fault::SensorOutOfRange),
        (Condition::OVERLOAD, Fault::OverCurrent),
        (Condition::OVER_TEMPERATURE, Fault::OverTemperature),
        (Condition::OVER_SPEED, Fault::OverSpeed),
        (Condition::WATCHDOG, Fault::Timeout),
        (Condition::LINK_LOST, Fault::Disconnected),
    ];
    let found = FAULTS.iter().find(|(condition, _)| status.condition.contains(*condition));
    // Disarmed by another host, without a fault.
    Some(found.map_or(Fault::Protocol, |(_, fault)| *fault))
}
