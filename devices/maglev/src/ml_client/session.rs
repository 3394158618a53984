//! Session with a controller: take-off, commands and landing. Not real-time, except for the calls of a tick.

use super::connection::{Control, Events, Line, NoResults};
use crate::ml_api::{
    Acknowledgement, AxisValues, Event, EventKind, FaultBits, Function, GainSet, Pid, Request, Results,
    Status, WirePose,
};
use crate::transport::OpenError;
use std::time::{Duration, Instant};

/// Timeout of a call, and of a call that moves the flotor.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);
const PROCEDURE_PATIENCE: Duration = Duration::from_secs(30);
/// Limit of attempts to reset the faults, and the pause between two attempts.
const RESETS: u32 = 10;
const RESET_PAUSE: Duration = Duration::from_millis(500);
/// Number of steps of the fading gains.
const FADE_STEPS: u32 = 20;
/// Process id in registrations; the controller only compares it.
const PROCESS: i32 = 1;
/// Events of a session; ticks last, because they begin at once.
const KINDS: [EventKind; 5] =
    [EventKind::Fault, EventKind::Overtemp, EventKind::Boundary, EventKind::Button, EventKind::Tick];
/// Gain sets that must not act beside a force command. The boundary's gains stay: they are the controller's own wall.
const FORCED: [GainSet; 3] = [GainSet::Normal, GainSet::Locked, GainSet::Constrained];

/// Identity and limits of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Facts {
    pub(crate) version: crate::ml_api::Version,
    pub(crate) current_limits_a: AxisValues,
    pub(crate) speed_limits: AxisValues,
}

/// Settings of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    pub(crate) rate_hz: f32,
    pub(crate) boundary_m: f32,
    pub(crate) finds_gravity: bool,
    pub(crate) fade: Duration,
}

/// Result of a take-off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TakenOff {
    /// Pose of the first tick.
    pub(crate) pose: WirePose,
    /// Wrench that balances the weight of the flotor, N and N·m; zero if not measured.
    pub(crate) gravity: AxisValues,
}

/// Error of a session: failed call with its function, persistent faults, or missing ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Failed {
    #[error("{}: {}", .0.name(), .1)]
    At(Function, NoResults),
    #[error(
        "the controller stays faulted ({0}); hold the handle still within the range of the sensors, and let hot coils cool"
    )]
    Faulted(FaultBits),
    #[error(
        "the controller sends no ticks; end other programs that use the controller, and restart the controller"
    )]
    NoTick,
}

/// Session with a controller: control connection, callback connection for events, and count of unacknowledged ticks.
pub(crate) struct Session {
    control: Control,
    events: Option<Events>,
    address: String,
    /// Gains of the sets in [`FORCED`] before the fade, restored for the landing.
    kept: [[Pid; 6]; 3],
    /// Ticks received and not yet acknowledged.
    owed: u32,
    dropped: u64,
}

impl Session {
    /// Opens the control connection.
    pub(crate) fn open(address: &str) -> Result<Self, OpenError> {
        Ok(Self {
            control: Control::new(Line::open(address)?),
            events: None,
            address: address.to_owned(),
            kept: [[Pid::ZERO; 6]; 3],
            owed: 0,
            dropped: 0,
        })
    }

    pub(crate) fn is_lost(&self) -> bool {
        self.control.is_lost
    }

    /// Returns the number of ticks superseded by a newer tick before use.
    pub(crate) fn dropped_ticks(&self) -> u64 {
        self.dropped
    }

    fn call(&mut self, request: &Request) -> Result<Results, Failed> {
        self.call_within(request, PATIENCE)
    }

    fn call_within(&mut self, request: &Request, patience: Duration) -> Result<Results, Failed> {
        self.control.call(request, patience).map_err(|why| Failed::At(request.function(), why))
    }

    /// Calls a function for its results.
    fn get<T: TryFrom<Results>>(&mut self, request: &Request) -> Result<T, Failed> {
        self.get_within(request, PATIENCE)
    }

    fn get_within<T: TryFrom<Results>>(
        &mut self,
        request: &Request,
        patience: Duration,
    ) -> Result<T, Failed> {
        let results = self.call_within(request, patience)?;
        results.try_into().map_err(|_| Failed::At(request.function(), NoResults::Malformed))
    }

    /// Requests identity and limits of the controller.
    pub(crate) fn facts(&mut self) -> Result<Facts, Failed> {
        Ok(Facts {
            version: self.get(&Request::Plain(Function::GetVersion))?,
            current_limits_a: self.get(&Request::Plain(Function::GetCurrentLimits))?,
            speed_limits: self.get(&Request::Plain(Function::GetSpeedLimits))?,
        })
    }

    /// Clears faults, lifts and weighs the flotor, fades the gains to a force command, registers for events, and waits for the
    /// first tick.
    pub(crate) fn take_off(&mut self, plan: &Plan) -> Result<TakenOff, Failed> {
        self.clear_faults()?;
        self.call(&Request::Number(Function::SetServoFrequency, plan.rate_hz))?;
        match self.call_within(&Request::Plain(Function::Takeoff), PROCEDURE_PATIENCE) {
            Ok(_) => {}
            Err(Failed::At(_, NoResults::Refused(Status::TAKEN_OFF))) => self.take_over()?,
            Err(failed) => return Err(failed),
        }
        let gravity = self.carry(plan)?;
        self.call(&Request::Number(Function::SetBoundaryRadius, plan.boundary_m))?;
        for kind in KINDS {
            if kind == EventKind::Tick {
                self.fade_to_forces(plan.fade, gravity)?;
            }
            self.register(kind)?;
        }
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            if let Some(Event::Tick(pose)) = self.next_event(PATIENCE).map_err(|_| Failed::NoTick)? {
                return Ok(TakenOff { pose, gravity });
            }
        }
        Err(Failed::NoTick)
    }

    /// Takes over a flotor that another client left levitating, perhaps with a force in place of gains: restores the
    /// default gains, which rise slowly, then sets the actual pose as the target.
    fn take_over(&mut self) -> Result<(), Failed> {
        let reset = Request::OfSet(Function::ResetGainVecAxes, GainSet::Normal);
        self.call_within(&reset, PROCEDURE_PATIENCE)?;
        let pose = self.get(&Request::Plain(Function::GetActualPosition))?;
        self.call(&Request::Pose(Function::SetDesiredPosition, pose)).map(|_| ())
    }

    fn clear_faults(&mut self) -> Result<(), Failed> {
        let mut left = FaultBits::NONE;
        for attempt in 0..RESETS {
            if attempt > 0 {
                std::thread::sleep(RESET_PAUSE);
            }
            // A rejection is ignored: the remaining fault bits explain more.
            match self.call(&Request::Plain(Function::ResetFault)) {
                Ok(_) => {}
                Err(refused @ Failed::At(_, NoResults::Refused(Status::RECEIVE_ONLY))) => {
                    return Err(refused);
                }
                Err(Failed::At(_, NoResults::Refused(_))) => {}
                Err(failed) => return Err(failed),
            }
            left = self.get(&Request::Plain(Function::GetFault))?;
            if left.is_empty() {
                return Ok(());
            }
        }
        Err(Failed::Faulted(left))
    }

    /// Measures the weight of the flotor, and compensates it by the controller until force commands replace the gains.
    fn carry(&mut self, plan: &Plan) -> Result<AxisValues, Failed> {
        if !plan.finds_gravity {
            return Ok([0.0; 6]);
        }
        let gravity = self.get_within(&Request::Plain(Function::FindGravity), PROCEDURE_PATIENCE)?;
        self.call(&Request::AxisValues(Function::SetGravity, gravity))?;
        self.call(&Request::Plain(Function::DefyGravity))?;
        Ok(gravity)
    }

    fn register(&mut self, kind: EventKind) -> Result<(), Failed> {
        if self.events.is_none() {
            let (events, token) = Events::open(&self.address, PATIENCE)
                .map_err(|why| Failed::At(Function::RequestToken, why))?;
            self.call(&Request::MapToken(token))?;
            self.events = Some(events);
        }
        self.call(&Request::register(kind, PROCESS)).map(|_| ())
    }

    /// Fades the gains down to the feed-forward of the weight and replaces them by a force command. All three sets end at
    /// zero: the force is then the same whether a command replaces the gains or adds to them.
    fn fade_to_forces(&mut self, fade: Duration, gravity: AxisValues) -> Result<(), Failed> {
        for (place, set) in FORCED.into_iter().enumerate() {
            self.kept[place] = self.get(&Request::OfSet(Function::GetGainVecAxes, set))?;
        }
        let [normal, ..] = self.kept;
        if !fade.is_zero() {
            for step in 1..=FADE_STEPS {
                #[allow(clippy::cast_precision_loss)] // a few steps
                let left = 1.0 - step as f32 / FADE_STEPS as f32;
                let faded =
                    normal.map(|pid| Pid { p: pid.p * left, i: pid.i * left, d: pid.d * left, ..pid });
                self.call(&Request::SetGainVecAxes(GainSet::Normal, faded))?;
                std::thread::sleep(fade / FADE_STEPS);
            }
        }
        self.call(&Request::AxisValues(Function::SetForces, gravity))?;
        for set in FORCED {
            self.call(&Request::SetGainVecAxes(set, [Pid::ZERO; 6]))?;
        }
        Ok(())
    }

    /// Unregisters from events, restores the gains to hold the pose `at` (`None`: leaves the gains unchanged), and lands. Continues
    /// after an error.
    pub(crate) fn land(&mut self, at: Option<WirePose>) {
        for kind in KINDS.into_iter().rev() {
            let (_, unregister) = kind.functions();
            let _ = self.call(&Request::Register(unregister, PROCESS));
        }
        if let Some(pose) = at {
            for (place, set) in FORCED.into_iter().enumerate() {
                let _ = self.call(&Request::SetGainVecAxes(set, self.kept[place]));
            }
            let _ = self.call(&Request::Pose(Function::SetDesiredPosition, pose));
        }
        let _ = self.call_within(&Request::Plain(Function::Land), PROCEDURE_PATIENCE);
        // Discard ticks that are still in transit.
        while let Ok(Some(_)) = self.next_event(Duration::ZERO) {}
        let _ = self.acknowledge_ticks();
    }

    // ------------------------------------------------------------ in a tick

    /// Reads the next event; acknowledges all but ticks. Real-time: bounded, no allocation.
    pub(crate) fn next_event(&mut self, budget: Duration) -> Result<Option<Event>, NoResults> {
        let Some(events) = &mut self.events else { return Err(NoResults::Lost) };
        let event = match events.next(budget) {
            Ok(event) => event,
            Err(why) => {
                self.events = None;
                return Err(why);
            }
        };
        match event {
            Some(Event::Tick(_)) => {
                self.dropped += u64::from(self.owed > 0);
                self.owed += 1;
            }
            Some(_) => events.acknowledge(Acknowledgement(0))?,
            None => {}
        }
        Ok(event)
    }

    /// Acknowledges the received ticks, so that the controller continues. Real-time: bounded, no allocation.
    pub(crate) fn acknowledge_ticks(&mut self) -> Result<(), NoResults> {
        let Some(events) = &mut self.events else { return Err(NoResults::Lost) };
        while self.owed > 0 {
            events.acknowledge(Acknowledgement(0))?;
            self.owed -= 1;
        }
        Ok(())
    }

    /// Commands a wrench; returns true if the controller confirms within the budget. Waits for the confirmation of an earlier
    /// command first, and drops the new command if the earlier confirmation is missing. Real-time: bounded, no allocation.
    pub(crate) fn command(&mut self, wrench: AxisValues, budget: Duration) -> Result<bool, NoResults> {
        if self.control.outstanding_since().is_some() && !self.is_confirmed(budget)? {
            return Ok(false);
        }
        self.control.begin(&Request::AxisValues(Function::SetForces, wrench))?;
        self.is_confirmed(budget)
    }

    /// Returns the start of the unconfirmed command, if any.
    pub(crate) fn unconfirmed_since(&self) -> Option<Instant> {
        self.control.outstanding_since()
    }

    fn is_confirmed(&mut self, budget: Duration) -> Result<bool, NoResults> {
        match self.control.finish(budget)? {
            None => Ok(false),
            Some(reply) if reply.status.is_ok() => Ok(true),
            Some(reply) => Err(NoResults::Refused(reply.status)),
        }
    }
}

impl Drop for Session {
    /// Ends the session in the two steps of the protocol; a lost connection is reset.
    fn drop(&mut self) {
        if self.control.is_lost {
            return;
        }
        if self.events.is_some() {
            if self.call(&Request::Plain(Function::StopCallbacks)).is_err() {
                return;
            }
            let until = Instant::now() + PATIENCE;
            while Instant::now() < until {
                match self.next_event(PATIENCE) {
                    Ok(Some(Event::End)) | Err(_) => break,
                    Ok(_) => drop(self.acknowledge_ticks()),
                }
            }
        }
        let _ = self.call(&Request::Plain(Function::Disconnect));
    }
}
