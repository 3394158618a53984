//! The device with the ML API: opened over TCP, lifted by its own controller, driven by force commands.

use crate::facts;
use crate::ml_api::{Event, FaultBits, Status, WirePose, angles};
use crate::ml_client::connection::NoResults;
use crate::ml_client::session::{Facts, Failed, Plan, Session, TakenOff};
use crate::ml_client::stop::Stop;
use crate::parameters::{Options, Values};
use crate::shaping::Shaping;
use flotor_hal::{
    Axes, Capabilities, Conditions, Cycle, DVec3, DeviceState, Fault, LoopConfig, Pose, Refusal, SampleWait,
    Tick, Twist, VerticalCalibration, Wrench, math, rotation_vector,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Latency from a tick to the resulting force, beyond one period, s: a round trip on a dedicated network.
const LATENCY_S: f64 = 1.0e-3;
/// Divisor of the period that gives the timeout for the confirmation of a command.
const CONFIRMATION_SHARE: u32 = 2;
/// Timeout of a lockstep tick: a delayed emulator is not a fault.
const LOCKSTEP_PATIENCE: Duration = Duration::from_secs(10);
/// Reads within which an event may explain a rejected command: the event is sent after the tick is acknowledged.
const EXPLAINED_WITHIN: u32 = 2;
/// Limit of events read per tick: a controller that does not wait for acknowledgements has a backlog after a stop.
const EVENTS_PER_LOOK: usize = 32;
/// Slew rate of force and torque, N/s and N·m/s: full scale in a millisecond.
const SLEW: [f64; 2] = [55.0e3, 6.3e3];

/// The opened device: the controller has identified itself and is not commanded yet.
pub(crate) struct MlDevice {
    session: Session,
    facts: Facts,
    pub(crate) stop: Arc<Stop>,
    pub(crate) calibration: VerticalCalibration,
}

/// The device, levitating under force commands.
pub(crate) struct MlActive {
    opened: Box<MlDevice>,
    pub(crate) shaping: Shaping,
    lockstep: bool,
    timeout: Duration,
    budget: Duration,
    smoothing_s: f64,
    /// Pose of the newest tick not yet returned by [`read`](Self::read).
    pending: Option<WirePose>,
    newest: WirePose,
    state: DeviceState,
    /// Loop time of the last used tick, ns; `received_at`: arrival of the newest tick on the machine's clock.
    sampled_ns: Option<u64>,
    received_at: Instant,
    at_boundary: bool,
    fault: Option<Fault>,
    /// Reads since an unexplained rejection of a command; `None` without one.
    refused: Option<u32>,
}

fn refused(address: &str, failed: Failed) -> Refusal {
    let hint = match failed {
        Failed::At(_, NoResults::Lost | NoResults::Silent) => {
            "; check its power and the network; without hardware start the emulator with `flotor emulate maglev --protocol ml-api` (on Linux)"
        }
        Failed::At(_, NoResults::Refused(Status::RECEIVE_ONLY)) => "; end the other program first",
        Failed::At(_, NoResults::Refused(Status::REPLACED)) => {
            "; end other programs that use the controller, and start again"
        }
        Failed::At(_, NoResults::Malformed) => "; use a controller with the ML API 1.5b, and check `address`",
        Failed::At(_, NoResults::Refused(_)) => {
            "; remove this cause, correct the parameters of the device that this request transfers, or restart the controller"
        }
        Failed::Faulted(_) | Failed::NoTick => "",
    };
    Refusal::resource(format!("the controller at {address}: {failed}{hint}"))
}

impl MlDevice {
    pub(crate) fn open(options: &Options) -> Result<Self, Refusal> {
        let address = &*options.address;
        let mut session = Session::open(address).map_err(Refusal::resource)?;
        let facts = session.facts().map_err(|failed| refused(address, failed))?;
        let stop = Arc::new(Stop::open(address).map_err(Refusal::resource)?);
        Ok(Self { session, facts, stop, calibration: VerticalCalibration::NONE })
    }

    /// Returns the version of the controller in place of a serial number, which the protocol does not have.
    pub(crate) fn serial(&self) -> String {
        format!("ml-api {}", self.facts.version.text())
    }

    /// Returns the published capabilities, with force and torque scaled down in proportion to the controller's smallest current
    /// limit.
    pub(crate) fn capabilities(&self, lockstep: bool) -> Capabilities {
        let share = self.facts.current_limits_a.iter().fold(1.0_f64, |share, limit| {
            let limit = f64::from(*limit) / facts::MAX_COIL_CURRENT_A;
            if limit.is_finite() { share.min(limit.max(0.0)) } else { share }
        });
        let [side_n, up_n] = facts::MAX_FORCE_N;
        let [tilt_nm, yaw_nm] = facts::MAX_TORQUE_NM;
        Capabilities {
            resolution_m: facts::RESOLUTION_M[0],
            max_force_n: [side_n, side_n, up_n].map(|limit| limit * share),
            max_torque_nm: [tilt_nm, tilt_nm, yaw_nm].map(|limit| limit * share),
            rate_hz: facts::SERVO_RATE_HZ,
            ..Capabilities::driving(Axes::ALL)
                .with_range(facts::RANGE_M, facts::RANGE_RAD)
                .with_slew(SLEW[0], SLEW[1])
                .with_stiffness(facts::MAX_STIFFNESS_N_PER_M)
                .with_latency(Self::latency_s(lockstep))
        }
    }

    /// Returns the latency from a tick to the resulting force, beyond one period, s.
    pub(crate) fn latency_s(lockstep: bool) -> f64 {
        if lockstep { 0.0 } else { LATENCY_S }
    }

    pub(crate) fn activate(
        mut self: Box<Self>,
        options: &Options,
        values: &Values,
        config: &LoopConfig,
    ) -> Result<Box<MlActive>, (Box<Self>, Refusal)> {
        #[allow(clippy::cast_possible_truncation)] // the wire format is f32
        let plan = Plan {
            rate_hz: (1.0e9 / config.period_ns as f64) as f32,
            boundary_m: values.value("boundary_mm") as f32 * 1.0e-3,
            finds_gravity: options.finds_gravity(),
            fade: options.fade,
        };
        let taken_off = self.take_off(options, &plan);
        let TakenOff { pose, gravity } = match taken_off {
            Ok(taken_off) => taken_off,
            Err(refusal) => {
                if !self.session.is_lost() {
                    self.session.land(None);
                }
                return Err((self, refusal));
            }
        };
        let period = Duration::from_nanos(config.period_ns);
        let [fx, fy, fz, tx, ty, tz] = gravity.map(f64::from);
        let weight = Wrench::new(DVec3::new(fx, fy, fz), DVec3::new(tx, ty, tz));
        // First-order filter: a cut-off of f has the time constant 1 / (2 pi f).
        let smoothing_s = 1.0 / (std::f64::consts::TAU * values.value("velocity_cutoff_hz"));
        Ok(Box::new(MlActive {
            shaping: Shaping::new(self.calibration, weight, options.feedforward_n),
            lockstep: options.lockstep,
            timeout: options.timeout,
            budget: if options.lockstep { LOCKSTEP_PATIENCE } else { period / CONFIRMATION_SHARE },
            smoothing_s,
            pending: Some(pose),
            newest: pose,
            state: DeviceState::HOME,
            sampled_ns: None,
            received_at: Instant::now(),
            at_boundary: false,
            fault: None,
            refused: None,
            opened: self,
        }))
    }

    /// Takes off; first reopens a lost session (cable unplugged and plugged in again).
    fn take_off(&mut self, options: &Options, plan: &Plan) -> Result<TakenOff, Refusal> {
        let address = &*options.address;
        self.stop.rearm();
        if self.session.is_lost() {
            self.session = Session::open(address).map_err(Refusal::resource)?;
            self.stop.reopen(address).map_err(Refusal::resource)?;
        }
        let taken_off = match self.session.take_off(plan) {
            Err(Failed::At(_, NoResults::Lost)) => {
                self.session = Session::open(address).map_err(Refusal::resource)?;
                self.stop.reopen(address).map_err(Refusal::resource)?;
                self.session.take_off(plan)
            }
            other => other,
        };
        taken_off.map_err(|failed| refused(address, failed))
    }
}

impl MlActive {
    /// Returns the number of ticks superseded by a newer tick before use.
    pub(crate) fn dropped_ticks(&self) -> u64 {
        self.opened.session.dropped_ticks()
    }

    /// Reads the pending events and waits for a tick until the timeout; returns the number of ticks read.
    fn poll(&mut self, patience: Duration) -> Result<u64, NoResults> {
        let until = Instant::now() + patience;
        let mut ticks = 0;
        for _ in 0..EVENTS_PER_LOOK {
            let rest = match self.pending {
                Some(_) => Duration::ZERO,
                None => until.saturating_duration_since(Instant::now()),
            };
            match self.opened.session.next_event(rest)? {
                None => break,
                Some(Event::Tick(pose)) => {
                    self.pending = Some(pose);
                    self.received_at = Instant::now();
                    ticks += 1;
                }
                // The first fault is the cause; later ones, such as a fall, may result from it.
                Some(Event::Fault(bits)) => self.fault = self.fault.or(fault(bits)),
                Some(Event::Overtemp(_)) => self.fault = self.fault.or(Some(Fault::OverTemperature)),
                Some(Event::Boundary(sides)) => self.at_boundary = sides.iter().any(|side| *side != 0),
                Some(Event::Button(buttons)) => {
                    self.state.buttons = u32::from(buttons.left) | u32::from(buttons.right) << 1;
                }
                Some(Event::End) => return Err(NoResults::Lost),
            }
        }
        Ok(ticks)
    }

    pub(crate) fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        let dropped = self.dropped_ticks();
        if self.pending.is_some() {
            return SampleWait::Arrived { samples: 1 };
        }
        match self.poll(Duration::from_nanos(timeout_ns)) {
            Ok(_) if self.pending.is_some() => {
                SampleWait::Arrived { samples: 1 + self.dropped_ticks() - dropped }
            }
            // The next read reports the fault.
            Err(_) => SampleWait::Arrived { samples: 1 },
            Ok(_) => SampleWait::TimedOut,
        }
    }

    pub(crate) fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let waits = self.lockstep && self.pending.is_none();
        let polled = self.poll(if waits { LOCKSTEP_PATIENCE } else { Duration::ZERO });
        let verdict = match (polled, self.pending.take()) {
            (Err(why), _) => Cycle::Fault(why.fault()),
            (Ok(_), Some(pose)) => self.sample(&pose, tick),
            (Ok(_), None) if self.received_at.elapsed() > self.timeout && !self.lockstep => {
                Cycle::Fault(Fault::Timeout)
            }
            (Ok(_), None) => Cycle::Stale,
        };
        *state = self.state;
        if self.fault.is_none() && self.refused.is_some_and(|reads| reads >= EXPLAINED_WITHIN) {
            self.fault = Some(Fault::Protocol);
        }
        self.refused = self.refused.map(|reads| reads + 1);
        match self.fault {
            // Stopped on request: the flotor is landing, and the pose is still valid.
            _ if self.opened.stop.is_stopped() => verdict,
            Some(fault) => Cycle::Fault(fault),
            None => verdict,
        }
    }

    /// Updates pose and velocity from a tick.
    fn sample(&mut self, pose: &WirePose, tick: &Tick) -> Cycle {
        if !pose.at.iter().all(|value| value.is_finite()) {
            return Cycle::Fault(Fault::Protocol);
        }
        if pose.out_of_range {
            return Cycle::Fault(Fault::SensorOutOfRange);
        }
        self.newest = *pose;
        let [x, y, z, rx, ry, rz] = pose.at.map(f64::from);
        let pose = Pose::new(DVec3::new(x, y, z), angles::orientation(DVec3::new(rx, ry, rz)));
        let elapsed_ns = self.sampled_ns.map_or(0, |then| tick.time_ns.saturating_sub(then));
        let when = |is: bool| if is { Conditions::EXCESS_FORCE } else { Conditions::NONE };
        self.state = DeviceState {
            pose,
            twist: self.twist(&pose, elapsed_ns as f64 * 1.0e-9),
            delivered: self.shaping.commanded,
            sampled_ns: tick.time_ns,
            conditions: when(self.shaping.warning.is_active() || self.at_boundary),
            ..self.state
        };
        self.sampled_ns = Some(tick.time_ns);
        Cycle::Fresh
    }

    /// Estimates the velocity as the smoothed difference of two poses.
    fn twist(&self, pose: &Pose, elapsed_s: f64) -> Twist {
        if elapsed_s <= 0.0 {
            return self.state.twist;
        }
        let before = &self.state.pose;
        let linear = (pose.position() - before.position()) / elapsed_s;
        let turned = pose.orientation() * before.orientation().conjugate();
        let angular = rotation_vector(turned) / elapsed_s;
        let new = 1.0 - math::exp(-elapsed_s / self.smoothing_s);
        let (slow, spin) = (self.state.twist.linear(), self.state.twist.angular());
        Twist::new(slow + (linear - slow) * new, spin + (angular - spin) * new)
    }

    pub(crate) fn write(&mut self, wrench: &Wrench) -> Cycle {
        let commanded = if self.opened.stop.is_stopped() {
            // Landing: a force command would interrupt it.
            self.shaping.commanded = Wrench::ZERO;
            self.state.delivered = Wrench::ZERO;
            Ok(true)
        } else {
            let command = self.shaping.command(wrench, &self.state);
            self.opened.session.command(command, self.budget)
        };
        let overdue = self.opened.session.unconfirmed_since().map(|since| since.elapsed());
        let acknowledged = self.opened.session.acknowledge_ticks();
        match (commanded, acknowledged) {
            // A rejection while landing belongs to an earlier command.
            (Err(NoResults::Refused(_)), _) if self.opened.stop.is_stopped() => Cycle::Fresh,
            // The event with the cause follows the acknowledgement of the tick.
            (Err(NoResults::Refused(_)), Ok(())) => {
                self.refused.get_or_insert(0);
                Cycle::Stale
            }
            (Err(why), _) | (_, Err(why)) => Cycle::Fault(self.fault.unwrap_or(why.fault())),
            (Ok(true), Ok(())) => Cycle::Fresh,
            (Ok(false), Ok(())) if overdue.is_some_and(|overdue| overdue > self.timeout) => {
                Cycle::Fault(Fault::Timeout)
            }
            (Ok(false), Ok(())) => Cycle::Stale,
        }
    }

    pub(crate) fn deactivate(mut self) -> Box<MlDevice> {
        let holds = self.fault.is_none() && !self.opened.stop.is_stopped();
        if !self.opened.session.is_lost() {
            self.opened.session.land(holds.then_some(self.newest));
        }
        self.opened
    }
}

impl NoResults {
    /// Returns the fault that the device reports.
    fn fault(self) -> Fault {
        match self {
            Self::Lost => Fault::Disconnected,
            Self::Silent => Fault::Timeout,
            // A rejected force: another client commands, or the flotor has landed.
            Self::Malformed | Self::Refused(_) => Fault::Protocol,
        }
    }
}

fn fault(bits: FaultBits) -> Option<Fault> {
    const FAULTS: [(FaultBits, Fault); 4] = [
        (FaultBits::SENSOR_RANGE, Fault::SensorOutOfRange),
        (FaultBits::OVER_TEMPERATURE, Fault::OverTemperature),
        (FaultBits::OVER_CURRENT, Fault::OverCurrent),
        (FaultBits::OVER_SPEED, Fault::OverSpeed),
    ];
    let known = FAULTS.iter().find(|(bit, _)| bits.contains(*bit)).map(|(_, fault)| *fault);
    known.or((!bits.is_empty()).then_some(Fault::Protocol))
}
