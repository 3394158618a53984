//! State of the controller and its servo cycle.

use super::coils::CoilSet;
use super::gains::Gains;
use super::procedure::{GainReset, Procedure, ProcedureId};
use crate::controller::Sample;
use clap::ValueEnum;
use flotor_hal::{DVec3, Wrench};
use flotor_maglev::ml_api::{
    Axis, AxisMode, AxisValues, Buttons, CellOffset, Event, FaultBits, GainSet, Pid, Reply, Status, angles,
};

/// Effect of a force command on the gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ForceCommand {
    /// Replacement: the commanded force replaces the force of the gains.
    #[value(name = "replace")]
    Replaces,
    /// Addition: the commanded force is added to the force of the gains.
    #[value(name = "add")]
    Adds,
}

/// Reaction to the loss of a client while levitating.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Silence {
    /// The flotor lands.
    #[value(name = "land", help = "Land the flotor")]
    Lands,
    /// The flotor continues to levitate.
    #[value(name = "ignore", help = "Continue without a reaction")]
    Ignored,
}

/// Clients that may command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Commanders {
    /// The first commanding client, until disconnected; others get [`Status::RECEIVE_ONLY`].
    #[value(help = None::<&str>)]
    One,
    /// All clients.
    #[value(help = None::<&str>)]
    All,
}

/// Configuration of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerConfig {
    /// Effect of a force command on the gains.
    pub force_command: ForceCommand,
    /// Reaction to the loss of a client while levitating.
    pub silence: Silence,
    /// Clients that may command.
    pub commanders: Commanders,
    /// Timeout of a force command without an acknowledged tick, while its client is registered for ticks, s.
    pub watchdog_s: f64,
    /// Height of a flotor on its stator, m: the end of a landing.
    pub floor_m: f64,
}

impl Default for ControllerConfig {
    fn default() -> Self {
        Self {
            force_command: ForceCommand::Replaces,
            silence: Silence::Lands,
            commanders: Commanders::One,
            watchdog_s: 0.5,
            floor_m: -9.5e-3,
        }
    }
}

/// State of the flotor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flight {
    /// On the stator, without force.
    #[default]
    Landed,
    /// Rising to home.
    TakingOff,
    /// Levitating.
    Flying,
    /// Descending to the stator.
    Landing,
}

/// Last command: position, velocity, force and current exclude one another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Command {
    #[default]
    Position,
    Velocity(AxisValues),
    Forces(AxisValues),
    Currents(AxisValues),
}

/// Hysteresis of a boundary, m or rad: the resolution of the sensors.
const INSIDE_M: f64 = 2.0e-6;

/// Capacity for replies and events that are not yet read.
pub(super) const KEPT: usize = 64;

/// Crossed boundaries: -1, 0, 1 for each constrained axis, then 1 outside the sphere.
type Sides = [i32; 7];

/// Emulated controller of a Maglev 200.
#[derive(Clone, Debug, Default)]
pub struct Controller {
    pub(in crate::ml_api) config: ControllerConfig,
    pub(super) gains: Gains,
    pub(super) coils: CoilSet,
    pub(in crate::ml_api) flight: Flight,
    pub(super) procedure: Option<(ProcedureId, Procedure)>,
    /// Gains on the way to their defaults, at most one entry per set.
    pub(super) resets: Vec<GainReset>,
    pub(super) finished: Vec<(ProcedureId, Reply)>,
    pub(super) last_procedure_id: ProcedureId,
    pub(super) command: Command,
    pub(super) modes: [AxisMode; 6],
    pub(super) locked_at: [f64; 6],
    pub(super) ranges: [[f32; 2]; 6],
    pub(super) desired: [f64; 6],
    pub(super) desired_told: AxisValues,
    /// Integral terms of the control law by axis, N and N·m.
    pub(super) integral_n: [f64; 6],
    /// Offset added by the search for gravity, N and N·m.
    pub(super) trim: [f64; 6],
    /// Gains for the landing, and the fraction not yet faded.
    pub(super) landing: ([Pid; 6], f64),
    /// Fault bits; a fault stays set until a client resets the faults after the end of its cause, or restarts the
    /// controller.
    pub(in crate::ml_api) faults: FaultBits,
    /// Fault bits injected for a test.
    pub(super) injected: FaultBits,
    pub(super) sample: Sample,
    /// Position, m, and angles, rad, in the default frame.
    pub(super) at: [f64; 6],
    pub(super) speed: [f64; 6],
    pub(super) frame: AxisValues,
    pub(super) gravity: AxisValues,
    pub(super) boundary_radius_m: f32,
    pub(super) speed_limits: AxisValues,
    pub(super) servo_hz: f32,
    pub(super) cell_offsets: [CellOffset; 3],
    pub(super) grasp: Grasp,
    pub(super) aux_v: f32,
    sides: Sides,
    buttons: Buttons,
    was_too_hot: bool,
    pub(super) events: Vec<Event>,
}

/// Stored settings for grasping; the emulated device has no gripper.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grasp {
    pub(super) gains: Pid,
    pub(super) current_a: f32,
    pub(super) limit_a: f32,
}

impl Controller {
    /// Creates a controller with the flotor on the stator.
    #[must_use]
    pub fn new(config: ControllerConfig) -> Self {
        Self {
            config,
            resets: Vec::with_capacity(GainSet::ALL.len()),
            finished: Vec::with_capacity(KEPT),
            boundary_radius_m: 0.012,
            speed_limits: [2.0, 2.0, 2.0, 20.0, 20.0, 20.0],
            servo_hz: 1000.0,
            events: Vec::with_capacity(KEPT),
            ..Self::default()
        }
    }

    /// Returns the servo rate, Hz.
    #[must_use]
    pub fn servo_hz(&self) -> f64 {
        f64::from(self.servo_hz)
    }

    /// Returns true while a procedure or a gain reset is in progress.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.procedure.is_some() || !self.resets.is_empty()
    }

    /// Returns true while a client's force or current command levitates the flotor.
    #[must_use]
    pub fn is_driven_by_forces(&self) -> bool {
        self.flight == Flight::Flying && matches!(self.command, Command::Forces(_) | Command::Currents(_))
    }

    /// Returns the current of the grasp that the clients command, A: within the limit that they have set, and none unless the
    /// flotor levitates.
    #[must_use]
    pub fn grasp_a(&self) -> f64 {
        let Grasp { current_a, limit_a, .. } = self.grasp;
        let most_a = if limit_a > 0.0 { limit_a } else { f32::MAX };
        if self.flight == Flight::Flying { f64::from(current_a.clamp(-most_a, most_a)) } else { 0.0 }
    }

    /// Sets the injected faults, until the next call.
    pub fn inject(&mut self, injected: FaultBits) {
        self.injected = injected;
    }

    /// Removes and returns the events since the last call.
    pub fn take_events(&mut self) -> impl Iterator<Item = Event> + '_ {
        self.events.drain(..)
    }

    /// Returns the pose of the flotor in the frame set by clients.
    #[must_use]
    pub fn pose(&self) -> flotor_maglev::ml_api::WirePose {
        let out_of_range = !self.is_in_range();
        let user = angles::orientation(three(&self.frame, 3));
        let position = user * vector(&self.at, 0) - three(&self.frame, 0);
        let turn = angles::angles(user * angles::orientation(vector(&self.at, 3)));
        flotor_maglev::ml_api::WirePose { out_of_range, at: narrow(position, turn) }
    }

    /// Returns the velocity of the flotor in the frame set by clients.
    pub(super) fn velocity(&self) -> AxisValues {
        let user = angles::orientation(three(&self.frame, 3));
        narrow(user * vector(&self.speed, 0), user * vector(&self.speed, 3))
    }

    /// Begins a servo interval of `dt_s`: stores its first sample, checks for faults, queues events and advances procedures.
    pub fn sense(&mut self, sample: &Sample, dt_s: f64) {
        self.observe(sample);
        self.watch();
        self.advance(dt_s);
    }

    /// Returns the wrench over a servo interval of `dt_s`, for the newest command within the limits of the coils; heats
    /// the coils and advances the integral terms.
    pub fn drive(&mut self, dt_s: f64) -> Wrench {
        let wanted = self.wanted();
        self.integrate(dt_s);
        let (currents_a, driven) = self.coils.driven(&wanted);
        self.coils.carry(&currents_a, dt_s);
        driven
    }

    /// Stores a sample without any reaction, before the first interval.
    pub fn observe(&mut self, sample: &Sample) {
        if sample.in_range && sample.pose.is_finite() && sample.twist.is_finite() {
            let (position, turn) = (sample.pose.position(), angles::angles(sample.pose.orientation()));
            let (linear, angular) = (sample.twist.linear(), sample.twist.angular());
            self.at = [position.x, position.y, position.z, turn.x, turn.y, turn.z];
            self.speed = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
        }
        self.sample = *sample;
    }

    fn is_in_range(&self) -> bool {
        self.sample.in_range
            && self.sample.pose.is_finite()
            && !self.injected.contains(FaultBits::SENSOR_RANGE)
    }

    /// Returns the faults with a present cause.
    pub(super) fn causes(&self) -> FaultBits {
        let too_fast = self.speed.iter().zip(&self.speed_limits).any(|(speed, limit)| {
            // A limit set to zero by a client faults at the first bit of noise, as requested.
            speed.abs() > f64::from(*limit)
        });
        let when = |is: bool, fault| if is { fault } else { FaultBits::NONE };
        self.injected
            .with(when(!self.is_in_range(), FaultBits::SENSOR_RANGE))
            .with(when(self.is_too_hot(), FaultBits::OVER_TEMPERATURE))
            .with(when(self.coils.is_overloaded(), FaultBits::OVER_CURRENT))
            .with(when(too_fast, FaultBits::OVER_SPEED))
    }

    fn is_too_hot(&self) -> bool {
        self.coils.is_too_hot() || self.sample.too_hot || self.injected.contains(FaultBits::OVER_TEMPERATURE)
    }

    /// Checks for faults, and queues events for changes.
    fn watch(&mut self) {
        let found = self.faults.with(self.causes());
        if found != self.faults {
            self.set_faults(found);
            self.drop_flotor();
        }
        let hot = self.is_too_hot();
        if hot && !self.was_too_hot {
            self.events.push(Event::Overtemp(self.temperatures_c()));
        }
        self.was_too_hot = hot;
        let sides = self.sides_now();
        if sides != self.sides {
            self.sides = sides;
            self.events.push(Event::Boundary(sides));
        }
        let buttons = self.buttons();
        if buttons != self.buttons {
            self.buttons = buttons;
            self.events.push(Event::Button(buttons));
        }
    }

    pub(super) fn set_faults(&mut self, faults: FaultBits) {
        self.faults = faults;
        self.events.push(Event::Fault(faults));
    }

    /// Switches the coils off after a fault.
    fn drop_flotor(&mut self) {
        self.end_procedure(self.cause_status());
        self.flight = Flight::Landed;
        self.command = Command::Position;
        self.integral_n = [0.0; 6];
        self.trim = [0.0; 6];
    }

    /// Returns the status for a rejection because of a fault.
    pub(super) fn cause_status(&self) -> Status {
        let causes = [
            (FaultBits::OVER_TEMPERATURE, Status::OVERHEATED),
            (FaultBits::OVER_CURRENT, Status::CURRENT),
            (FaultBits::SENSOR_RANGE, Status::POSITION),
            (FaultBits::OVER_SPEED, Status::SPEED),
        ];
        let found = causes.iter().find(|(fault, _)| self.faults.contains(*fault));
        found.map_or(Status::OFF_LINE, |(_, status)| *status)
    }

    /// Returns the temperatures of the coils, °C; 260 °C for the first coil if the over-temperature is injected or reported by the
    /// plant alone.
    pub(super) fn temperatures_c(&self) -> AxisValues {
        let mut all = self.coils.temperatures_c();
        if self.is_too_hot() && !self.coils.is_too_hot() {
            all[0] = 260.0;
        }
        all
    }

    pub(super) fn buttons(&self) -> Buttons {
        Buttons { left: self.sample.buttons & 1 != 0, right: self.sample.buttons & 2 != 0 }
    }

    /// Returns the crossed boundaries, with hysteresis: a flotor that rests at its boundary crosses it once.
    fn sides_now(&self) -> Sides {
        let mut sides = [0; 7];
        for axis in Axis::ALL {
            let (side, told) = (i32::from(self.side(axis)), self.sides[axis as usize]);
            let is_constrained = self.modes[axis as usize] == AxisMode::Constrained;
            let stays = told != 0 && is_constrained && {
                let [least, most] = self.ranges[axis as usize].map(f64::from);
                let depth =
                    if told > 0 { self.at[axis as usize] - most } else { least - self.at[axis as usize] };
                depth > -INSIDE_M
            };
            sides[axis as usize] = if side == 0 && stays { told } else { side };
        }
        let depth = vector(&self.at, 0).length() - f64::from(self.boundary_radius_m);
        sides[6] = i32::from(depth > if self.sides[6] == 0 { 0.0 } else { -INSIDE_M });
        sides
    }
}

/// Returns three of six numbers.
pub(super) fn vector(six: &[f64; 6], first: usize) -> DVec3 {
    let at = |index: usize| six.get(index).copied().unwrap_or(0.0);
    DVec3::new(at(first), at(first + 1), at(first + 2))
}

fn three(six: &AxisValues, first: usize) -> DVec3 {
    vector(&six.map(f64::from), first)
}

pub(super) fn wrench(six: &[f64; 6]) -> Wrench {
    Wrench::new(vector(six, 0), vector(six, 3))
}

/// Converts to the wire format.
#[allow(clippy::cast_possible_truncation)]
pub(super) fn narrow(linear: DVec3, angular: DVec3) -> AxisValues {
    [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z].map(|value| value as f32)
}
