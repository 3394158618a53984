//! State machine of the controller: modes, session, watchdog, limits.

use super::limits::{LimitConfig, Load};
use flotor_hal::{DVec3, Pose, Twist, Wrench};
use flotor_maglev::protocol::{
    Answer, AnswerFrame, Condition, Description, Intake, Mode, Rejection, Request, RequestFrame, Status,
};

/// Configuration of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerConfig {
    /// Description sent to hosts.
    pub description: Description,
    /// Limits of the wrench.
    pub limits: LimitConfig,
    /// Time in the mode Holding before landing, µs.
    pub hold_us: u64,
    /// Duration of a landing, µs.
    pub landing_us: u64,
    /// Damping of translation, N·s/m, and rotation, N·m·s/rad, while holding and landing.
    pub hold_damping: [f64; 2],
    /// Speed of the handle above which the controller faults, m/s.
    pub max_speed_m_per_s: f64,
}

/// One sample of the sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Pose of the handle, device frame.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s.
    pub twist: Twist,
    /// False once the flotor is out of range or a sensor failed.
    pub in_range: bool,
    /// True if a coil is too hot.
    pub too_hot: bool,
    /// State of the buttons, one bit each.
    pub buttons: u32,
}

impl Default for Sample {
    fn default() -> Self {
        Self::HOME
    }
}

impl Sample {
    /// Sample at home and at rest.
    pub const HOME: Self =
        Self { pose: Pose::HOME, twist: Twist::ZERO, in_range: true, too_hot: false, buttons: 0 };
}

/// Reply to a received request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// The status, acknowledging this sequence number.
    Status(u32),
    /// The status after an accepted command, acknowledging this sequence number.
    Commanded(u32),
    /// A page of the description, encoded.
    Page(AnswerFrame),
}

/// The newest command with its time of arrival.
#[derive(Clone, Copy, Debug)]
struct Command {
    wrench: Wrench,
    valid_us: u64,
    since_us: u64,
}

/// Controller of the device as a state machine. Times are µs of the controller's monotonic clock.
#[derive(Clone, Debug)]
pub struct Controller {
    config: ControllerConfig,
    mode: Mode,
    /// Start of the current mode.
    mode_since_us: u64,
    condition: Condition,
    /// Current session; 0: none.
    session: u32,
    /// Previous session: an old frame must not restart that session.
    last_session: u32,
    watchdog_us: u64,
    period_us: u32,
    /// Time of the last accepted request of this session.
    heard_us: u64,
    intake: Intake,
    command: Option<Command>,
    driven: Wrench,
    load: Load,
    answers: u32,
    sample: Sample,
    sampled_us: u64,
}

impl Controller {
    /// Creates a controller with its coils off.
    #[must_use]
    pub fn new(config: ControllerConfig) -> Self {
        Self {
            config,
            mode: Mode::Disarmed,
            mode_since_us: 0,
            condition: Condition::NONE,
            session: 0,
            last_session: 0,
            watchdog_us: 0,
            period_us: 0,
            heard_us: 0,
            intake: Intake::default(),
            command: None,
            driven: Wrench::ZERO,
            load: Load::default(),
            answers: 0,
            sample: Sample::HOME,
            sampled_us: 0,
        }
    }

    /// Returns the current mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Returns the faults and active limits.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Returns the replay protection, with the counts of rejected requests.
    #[must_use]
    pub fn intake(&self) -> &Intake {
        &self.intake
    }

    /// Returns the command period announced on arming, µs; 0 before.
    #[must_use]
    pub fn period_us(&self) -> u32 {
        self.period_us
    }

    /// Returns the time since the last accepted request, µs; before the first, the time since the start of the clock.
    #[must_use]
    pub fn silence_us(&self, now_us: u64) -> u64 {
        now_us.saturating_sub(self.heard_us)
    }

    /// Executes a received request and returns the reply; `None` for a rejected request.
    pub fn receive(&mut self, packet: &[u8], now_us: u64) -> Option<Reply> {
        match RequestFrame::decode(packet) {
            Ok(frame) => self.execute(&frame, now_us),
            Err(rejection) => {
                self.intake.reject(rejection);
                None
            }
        }
    }

    /// Rejects and counts received data that is not a packet.
    pub fn receive_malformed(&mut self) {
        self.intake.reject(Rejection::Length);
    }

    fn execute(&mut self, frame: &RequestFrame, now_us: u64) -> Option<Reply> {
        // A description request is open to every host and changes nothing.
        if let Request::Describe { page } = frame.request {
            let page = self.config.description.page(page).map_err(|rejection| self.intake.reject(rejection));
            return page.ok().map(|page| Reply::Page(self.answer(Answer::Description(page), frame.sequence)));
        }
        match frame.request {
            // Without a session there is nothing to protect, and disarming is idempotent.
            Request::Disarm if self.session == 0 => {
                self.disarm(now_us);
                return Some(Reply::Status(frame.sequence));
            }
            Request::Arm { .. }
                if self.mode == Mode::Disarmed && ![0, self.last_session].contains(&frame.session) =>
            {
                self.intake.restart();
            }
            // Rejects hosts that were replaced or never armed.
            _ if frame.session != self.session || self.session == 0 => {
                self.intake.reject(Rejection::Session);
                return None;
            }
            _ => {}
        }
        if !self.intake.accept(frame.sequence) {
            return None;
        }
        self.heard_us = now_us;
        match (frame.request, self.mode) {
            (Request::Arm { period_us, watchdog_us }, Mode::Disarmed) => {
                let longest_us = self.config.description.limits.longest_watchdog_us;
                self.watchdog_us = u64::from(watchdog_us.min(longest_us).max(1));
                self.period_us = period_us;
                (self.session, self.last_session) = (frame.session, frame.session);
                self.condition = Condition::NONE;
                self.enter(Mode::Armed, now_us);
            }
            (Request::TakeOff, Mode::Armed) => self.enter(Mode::Levitating, now_us),
            (Request::Command { wrench, valid_us }, Mode::Levitating) => {
                let [fx, fy, fz, tx, ty, tz] = wrench.map(f64::from);
                let wrench = Wrench::new(DVec3::new(fx, fy, fz), DVec3::new(tx, ty, tz));
                self.command = Some(Command { wrench, valid_us: u64::from(valid_us), since_us: now_us });
                return Some(Reply::Commanded(frame.sequence));
            }
            (Request::Land, Mode::Levitating | Mode::Holding) => self.enter(Mode::Landing, now_us),
            (Request::Disarm, _) => self.disarm(now_us),
            // Other requests do not fit the mode; the reply contains the mode.
            _ => {}
        }
        Some(Reply::Status(frame.sequence))
    }

    /// Switches the coils off at once after the loss of the link, ends the session, and sets the condition `LINK_LOST`; no effect
    /// while the controller is disarmed.
    pub fn link_lost(&mut self, now_us: u64) {
        if self.mode != Mode::Disarmed {
            self.disarm(now_us);
            self.condition = self.condition.with(Condition::LINK_LOST);
        }
    }

    /// Stores a sample of the sensors, taken at `now_us`.
    pub fn observe(&mut self, now_us: u64, sample: &Sample) {
        self.sample = *sample;
        self.sampled_us = now_us;
    }

    /// Checks timeouts and faults and returns the wrench for the coils over the next `dt_us`, within all limits; zero in
    /// the modes Disarmed, Armed and Fault. Call once per cycle, after [`Self::observe`].
    pub fn drive(&mut self, now_us: u64, dt_us: u64) -> Wrench {
        self.watch(now_us);
        let sample = self.sample;
        let dt_s = dt_us as f64 * 1.0e-6;
        let mut reports = self.condition.faults();
        let wanted = match self.mode {
            Mode::Disarmed | Mode::Armed | Mode::Fault => {
                self.condition = reports;
                self.driven = Wrench::ZERO;
                return Wrench::ZERO;
            }
            Mode::Levitating => match self.command {
                Some(command) if now_us < command.since_us + command.valid_us => command.wrench,
                Some(_) => {
                    reports = reports.with(Condition::EXPIRED);
                    self.damping()
                }
                None => Wrench::ZERO,
            },
            Mode::Holding | Mode::Landing => self.damping(),
        };
        let wall = self.config.limits.wall(sample.pose.position(), sample.twist.linear());
        if wall.is_some() {
            reports = reports.with(Condition::BOUNDARY);
        }
        let wanted = wanted + Wrench::from_force(wall.unwrap_or(DVec3::ZERO));
        let limited = self.config.limits.clamped(&wanted);
        let driven = self.config.limits.slewed(&self.driven, &limited, dt_s);
        if driven != wanted {
            reports = reports.with(Condition::LIMITED);
        }
        self.condition = reports;
        self.driven = driven;
        if self.load.update(&driven, dt_s, &self.config.limits) {
            return self.fault(Condition::OVERLOAD, now_us);
        }
        driven
    }

    /// Changes the mode on timeouts, sensor faults and the edge of the range, independently of requests.
    fn watch(&mut self, now_us: u64) {
        if matches!(self.mode, Mode::Disarmed | Mode::Fault) {
            return;
        }
        if matches!(self.mode, Mode::Levitating | Mode::Holding | Mode::Landing) {
            let Sample { twist, in_range, too_hot, .. } = self.sample;
            let too_fast = twist.linear().length() > self.config.max_speed_m_per_s;
            let wrong = [
                (!in_range || !self.sample.pose.is_finite(), Condition::SENSOR_RANGE),
                (too_hot, Condition::OVER_TEMPERATURE),
                (too_fast || !twist.is_finite(), Condition::OVER_SPEED),
            ];
            if let Some((_, condition)) = wrong.into_iter().find(|(wrong, _)| *wrong) {
                self.fault(condition, now_us);
                return;
            }
        }
        let in_mode_us = now_us.saturating_sub(self.mode_since_us);
        let Sample { pose, twist, .. } = self.sample;
        match self.mode {
            Mode::Levitating | Mode::Holding
                if self.config.limits.is_leaving(pose.position(), twist.linear()) =>
            {
                self.condition = self.condition.with(Condition::EDGE);
                self.end_session(Mode::Landing, now_us);
            }
            Mode::Armed | Mode::Levitating if now_us.saturating_sub(self.heard_us) >= self.watchdog_us => {
                let flying = self.mode == Mode::Levitating;
                self.condition = self.condition.with(Condition::WATCHDOG);
                self.end_session(if flying { Mode::Holding } else { Mode::Fault }, now_us);
            }
            Mode::Holding if in_mode_us >= self.config.hold_us => self.enter(Mode::Landing, now_us),
            Mode::Landing if in_mode_us >= self.config.landing_us => {
                if self.condition.faults().is_empty() {
                    self.disarm(now_us);
                } else {
                    self.enter(Mode::Fault, now_us);
                }
            }
            _ => {}
        }
    }

    /// Returns a wrench of pure damping.
    fn damping(&self) -> Wrench {
        let [linear, angular] = self.config.hold_damping;
        Wrench::new(self.sample.twist.linear() * -linear, self.sample.twist.angular() * -angular)
    }

    fn fault(&mut self, condition: Condition, now_us: u64) -> Wrench {
        self.condition = self.condition.with(condition);
        self.driven = Wrench::ZERO;
        self.end_session(Mode::Fault, now_us);
        Wrench::ZERO
    }

    fn disarm(&mut self, now_us: u64) {
        self.driven = Wrench::ZERO;
        self.condition = Condition::NONE;
        self.end_session(Mode::Disarmed, now_us);
    }

    /// Enters a mode without a session: requests of a host that resumes are rejected.
    fn end_session(&mut self, mode: Mode, now_us: u64) {
        self.session = 0;
        self.command = None;
        self.enter(mode, now_us);
    }

    fn enter(&mut self, mode: Mode, now_us: u64) {
        self.mode = mode;
        self.mode_since_us = now_us;
    }

    /// Creates the next status frame, with mode, condition and the newest sample; `acknowledged` is the sequence number of the
    /// answered request.
    pub fn status(&mut self, acknowledged: u32) -> AnswerFrame {
        let Sample { pose, twist, .. } = self.sample;
        let orientation = pose.orientation();
        // q and -q are one rotation: send the one with a non-negative scalar part.
        let vector = if orientation.w < 0.0 { -orientation.xyz() } else { orientation.xyz() };
        let status = Status {
            mode: self.mode,
            condition: self.condition,
            position_m: narrow(pose.position()),
            rotation_xyz: narrow(vector),
            velocity_steps: steps(twist.linear(), Status::VELOCITY_STEP_M_PER_S),
            spin_steps: steps(twist.angular(), Status::SPIN_STEP_RAD_PER_S),
        };
        self.answer(Answer::Status(status), acknowledged)
    }

    fn answer(&mut self, answer: Answer, acknowledged: u32) -> AnswerFrame {
        self.answers = self.answers.wrapping_add(1);
        #[allow(clippy::cast_possible_truncation)] // the clock on the wire wraps
        let time_us = self.sampled_us as u32;
        AnswerFrame { sequence: self.answers, acknowledged, time_us, session: self.session, answer }
    }
}

/// Converts to the wire format; non-finite values become 0, and the mode reports the failure of the sensors.
#[allow(clippy::cast_possible_truncation)] // f32 exceeds the sensors' resolution
fn narrow(vector: DVec3) -> [f32; 3] {
    vector.to_array().map(|value| if value.is_finite() { value as f32 } else { 0.0 })
}

#[allow(clippy::cast_possible_truncation)] // `as` saturates
fn steps(vector: DVec3, step: f64) -> [i16; 3] {
    vector.to_array().map(|value| (value / step).round() as i16)
}
