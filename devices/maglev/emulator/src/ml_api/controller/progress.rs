//! Procedures that take seconds: take-off, landing and the search for gravity, one at a time; a new procedure replaces the
//! previous procedure. A reset of gains runs in parallel and neither ends nor delays a landing.

use super::machine::{Command, Controller, Flight, KEPT, narrow, vector};
use super::procedure::{GainReset, Procedure, ProcedureId, Search};
use flotor_hal::DVec3;
use flotor_maglev::ml_api::{Axis, GainSet, Pid, Reply, Results, Status};

/// Speed of the moving target, m/s and rad/s.
const GLIDE_M_PER_S: f64 = 15.0e-3;
const GLIDE_RAD_PER_S: f64 = 0.2;
/// Home is reached within this distance, m and rad ...
const HOME_M: f64 = 1.0e-3;
const HOME_RAD: f64 = 0.02;
/// ... or after this time with the target at home, s: a hand may hold the flotor elsewhere.
const HOME_PATIENCE_S: f64 = 2.0;
/// Fade time of the gains at the end of a landing, s.
const FADE_S: f64 = 0.4;
/// Duration of a reset of gains to their defaults, s.
const RESET_S: f64 = 2.0;
/// Search for gravity: time to settle, s, samples to average, and limit of rounds.
const SETTLE_S: f64 = 0.25;
const SAMPLES: u32 = 50;
const ROUNDS: u32 = 30;
/// Residual at which the search ends, N and N·m.
const FOUND_N: f64 = 2.0e-3;
const FOUND_NM: f64 = 1.0e-4;

impl Controller {
    /// Returns the reply of a finished procedure; `None` while in progress, and after 64 later replies.
    #[must_use]
    pub fn reply(&self, procedure_id: ProcedureId) -> Option<Reply> {
        self.finished.iter().find(|(of, _)| *of == procedure_id).map(|(_, reply)| *reply)
    }

    /// Begins a landing if the flotor takes off or levitates; no call waits for the landing.
    pub fn land(&mut self) {
        if matches!(self.flight, Flight::TakingOff | Flight::Flying) {
            self.begin_landing();
        }
    }

    pub(super) fn begin_take_off(&mut self) -> ProcedureId {
        self.end_resets(Status::OK, |set| set == GainSet::Normal);
        self.gains.glide(GainSet::Normal, &[Pid::ZERO; 6], 1.0);
        (self.desired, self.command) = (self.at, Command::Position);
        self.integral_n = [0.0; 6];
        self.flight = Flight::TakingOff;
        self.begin(Procedure::TakeOff { at_home_s: 0.0 })
    }

    pub(super) fn begin_landing(&mut self) -> ProcedureId {
        (self.desired, self.command) = (self.at, Command::Position);
        self.integral_n = [0.0; 6];
        self.landing = (self.gains.landing(), 1.0);
        self.flight = Flight::Landing;
        self.begin(Procedure::Land { faded_s: 0.0 })
    }

    pub(super) fn begin_search(&mut self) -> ProcedureId {
        // The actual position, unless the gains hold a target already.
        (self.desired, self.command) = (self.at_target(), Command::Position);
        self.desired_told = narrow(vector(&self.desired, 0), vector(&self.desired, 3));
        self.begin(Procedure::FindGravity(Search::default()))
    }

    pub(super) fn begin_reset(&mut self, set: GainSet) -> ProcedureId {
        self.end_resets(Status::REPLACED, |other| other == set);
        let (procedure_id, from) = (self.next_procedure_id(), *self.gains.set(set));
        self.resets.push(GainReset { procedure_id, set, from, elapsed_s: 0.0 });
        procedure_id
    }

    /// Ends the resets of the selected sets at their present gains.
    pub(super) fn end_resets(&mut self, status: Status, is_meant: impl Fn(GainSet) -> bool) {
        while let Some(place) = self.resets.iter().position(|reset| is_meant(reset.set)) {
            let procedure_id = self.resets.swap_remove(place).procedure_id;
            self.finish(procedure_id, Reply::status(status));
        }
    }

    fn begin(&mut self, procedure: Procedure) -> ProcedureId {
        self.end_procedure(Status::REPLACED);
        let procedure_id = self.next_procedure_id();
        self.procedure = Some((procedure_id, procedure));
        procedure_id
    }

    fn next_procedure_id(&mut self) -> ProcedureId {
        self.last_procedure_id.0 += 1;
        self.last_procedure_id
    }

    /// Ends the procedure in progress with a status.
    pub(super) fn end_procedure(&mut self, status: Status) {
        self.trim = [0.0; 6];
        if let Some((procedure_id, procedure)) = self.procedure.take() {
            let results = match procedure {
                Procedure::FindGravity(_) => Results::AxisValues([0.0; 6]),
                _ => Results::None,
            };
            self.finish(procedure_id, Reply { status, results });
        }
    }

    fn finish(&mut self, procedure_id: ProcedureId, reply: Reply) {
        // Several calls may wait, and their clients may be disconnected: only the newest replies are stored.
        if self.finished.len() >= KEPT {
            let _ = self.finished.remove(0);
        }
        self.finished.push((procedure_id, reply));
    }

    /// Advances the procedure, the gain resets and the target of a velocity command by a cycle of `dt_s`.
    pub(super) fn advance(&mut self, dt_s: f64) {
        if let (Command::Velocity(speeds), Flight::Flying) = (self.command, self.flight) {
            for (desired, speed) in self.desired.iter_mut().zip(speeds) {
                *desired += f64::from(speed) * dt_s;
            }
            self.desired_told = narrow(vector(&self.desired, 0), vector(&self.desired, 3));
        }
        self.glide_gains(dt_s);
        let Some((procedure_id, mut procedure)) = self.procedure.take() else { return };
        let reply = match &mut procedure {
            Procedure::TakeOff { at_home_s } => self.take_off(at_home_s, dt_s),
            Procedure::Land { faded_s } => self.let_down(faded_s, dt_s),
            Procedure::FindGravity(search) => self.search(search, dt_s),
        };
        match reply {
            Some(reply) => self.finish(procedure_id, reply),
            None => self.procedure = Some((procedure_id, procedure)),
        }
    }

    fn glide_gains(&mut self, dt_s: f64) {
        let Self { resets, gains, .. } = self;
        let mut finished = None;
        for reset in resets {
            reset.elapsed_s += dt_s;
            #[allow(clippy::cast_possible_truncation)] // a fraction
            gains.glide(reset.set, &reset.from, (reset.elapsed_s / RESET_S).min(1.0) as f32);
            if reset.elapsed_s >= RESET_S {
                finished = Some(reset.set);
            }
        }
        // One per cycle: a second finished reset has reached its defaults already.
        if let Some(set) = finished {
            self.end_resets(Status::OK, |other| other == set);
        }
    }

    fn take_off(&mut self, at_home_s: &mut f64, dt_s: f64) -> Option<Reply> {
        if !self.glide(&[0.0; 6], dt_s) {
            return None;
        }
        *at_home_s += dt_s;
        let is_home = vector(&self.at, 0).length() < HOME_M && vector(&self.at, 3).length() < HOME_RAD;
        (is_home || *at_home_s > HOME_PATIENCE_S).then(|| {
            self.flight = Flight::Flying;
            self.desired_told = [0.0; 6];
            Reply::status(Status::OK)
        })
    }

    fn let_down(&mut self, faded_s: &mut f64, dt_s: f64) -> Option<Reply> {
        let floor = [0.0, 0.0, self.config.floor_m, 0.0, 0.0, 0.0];
        if !self.glide(&floor, dt_s) {
            return None;
        }
        *faded_s += dt_s;
        self.landing.1 = (1.0 - *faded_s / FADE_S).max(0.0);
        (*faded_s >= FADE_S).then(|| {
            self.flight = Flight::Landed;
            (self.desired, self.desired_told) = ([0.0; 6], [0.0; 6]);
            Reply::status(Status::OK)
        })
    }

    /// Moves the target by a step; returns true at the end.
    fn glide(&mut self, to: &[f64; 6], dt_s: f64) -> bool {
        let step = |from: DVec3, to: DVec3, most: f64| {
            let way = to - from;
            if way.length() <= most { (to, true) } else { (from + way.normalize() * most, false) }
        };
        let (position, there) = step(vector(&self.desired, 0), vector(to, 0), GLIDE_M_PER_S * dt_s);
        let (turn, turned) = step(vector(&self.desired, 3), vector(to, 3), GLIDE_RAD_PER_S * dt_s);
        self.desired = [position.x, position.y, position.z, turn.x, turn.y, turn.z];
        there && turned
    }

    /// Averages the error and adds its proportional force to the trim, until the addition is small.
    fn search(&mut self, search: &mut Search, dt_s: f64) -> Option<Reply> {
        search.settled_s += dt_s;
        if search.settled_s < SETTLE_S {
            return None;
        }
        for (axis, sum) in Axis::ALL.into_iter().zip(&mut search.sums) {
            let [(_, error), _] = self.laws(axis);
            *sum += error.off;
        }
        search.samples += 1;
        if search.samples < SAMPLES {
            return None;
        }
        let acting = Axis::ALL.map(|axis| self.laws(axis)[0].0);
        let mut is_found = true;
        for (index, pid) in acting.iter().enumerate() {
            let missing = f64::from(pid.p) * search.sums[index] / f64::from(SAMPLES);
            self.trim[index] += missing;
            is_found &= missing.abs() < if index < 3 { FOUND_N } else { FOUND_NM };
        }
        *search = Search { rounds: search.rounds + 1, ..Search::default() };
        if !is_found && search.rounds < ROUNDS {
            return None;
        }
        let found = std::array::from_fn(|index| {
            f64::from(acting[index].ff) + self.trim[index] + self.integral_n[index]
        });
        self.trim = [0.0; 6];
        let status = if is_found { Status::OK } else { Status::TIMER };
        Some(Reply { status, results: Results::AxisValues(narrow(vector(&found, 0), vector(&found, 3))) })
    }
}
