//! Reader of a log: verifies the hash chain, the syntax and the order of the events, and, by a replay of the experiment, the trials
//! and verdicts.

use super::error::{LogError, LogProblem};
use super::lines::{LogEnd, read_lines};
use super::{Begin, Event, FORMAT, Incident, LogWriter, TrialEvent};
use crate::sitting::{Sitting, TrackResult};
use crate::time_of_day::TimeOfDay;
use crate::trial::{Response, Trial};
use std::path::{Path, PathBuf};

/// Logged trial.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRecord {
    /// Trial, answer, verdict and exploration.
    pub event: TrialEvent,
    /// Result of the track that this trial completed; `None` if the trial completed no track.
    pub track: Option<TrackResult>,
}

/// Verified log.
pub struct SittingLog {
    /// First line of the log.
    pub begin: Begin,
    /// Trials in order of presentation.
    pub trials: Vec<TrialRecord>,
    /// Trials whose answers were withdrawn; not among [`Self::trials`].
    pub withdrawn: Vec<TrialEvent>,
    /// Notes of experimenter and program, each with the number of trials before it.
    pub notes: Vec<(u32, String)>,
    /// Interruptions and disturbances, each with the number of trials before it and the time of day (`None` for simulated
    /// observers).
    pub incidents: Vec<(u32, Option<TimeOfDay>, Incident)>,
    /// Start of the sitting; `None` for simulated observers.
    pub began: Option<TimeOfDay>,
    /// True if the sitting is complete.
    pub complete: bool,
    /// Number of times the sitting was resumed.
    pub resumed: u32,
    /// True if the last event, notes aside, explains the end or interruption of the sitting.
    has_reason_to_end: bool,
    sitting: Sitting,
    path: PathBuf,
    end: LogEnd,
}

impl SittingLog {
    /// Reads a log, checks its chain, and replays the experiment: every trial and verdict must equal the result of the state
    /// machine.
    ///
    /// # Errors
    /// [`LogError`] with line and reason.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let at = |line: usize, problem: LogProblem| LogError { path: path.into(), line, problem };
        let mut log: Option<Self> = None;
        let end = read_lines(path, |event: Event, time| match (&mut log, event) {
            (None, Event::Begin(begin)) => {
                if !(1..=FORMAT).contains(&begin.format) {
                    return Err(LogProblem::Format { found: begin.format });
                }
                log = Some(Self { began: time, ..Self::new(*begin, path) });
                Ok(())
            }
            (None, _) => Err(LogProblem::Order("the log does not start with `begin`")),
            (Some(log), event) => log.take_in(event, time),
        })?;
        let mut log = log.ok_or_else(|| at(0, LogProblem::Empty))?;
        log.end = end;
        Ok(log)
    }

    fn new(begin: Begin, path: &Path) -> Self {
        let sitting = Sitting::new(&begin.protocol, begin.seed, begin.subject);
        Self {
            begin,
            trials: Vec::new(),
            withdrawn: Vec::new(),
            notes: Vec::new(),
            incidents: Vec::new(),
            began: None,
            complete: false,
            resumed: 0,
            has_reason_to_end: false,
            sitting,
            path: path.into(),
            end: LogEnd::default(),
        }
    }

    fn take_in(&mut self, event: Event, time: Option<TimeOfDay>) -> Result<(), LogProblem> {
        if self.complete && !matches!(event, Event::Note { .. }) {
            return Err(LogProblem::Order("an event other than a note follows `end`"));
        }
        if !matches!(event, Event::Note { .. }) {
            self.has_reason_to_end =
                matches!(&event, Event::Incident(incident) if incident.ends_the_sitting());
        }
        let presented = self.sitting.presented();
        match event {
            Event::Begin(_) => return Err(LogProblem::Order("a second `begin` is in the log")),
            Event::Trial(event) => self.replay(*event)?,
            Event::Withdrawn { trial } => self.withdraw(trial)?,
            Event::Resume { trials, .. } if trials != presented => {
                return Err(LogProblem::Order("`resume` has another number of trials than the log"));
            }
            Event::Resume { .. } => self.resumed += 1,
            Event::Note { text } => self.notes.push((presented, text)),
            Event::Incident(incident) => self.incidents.push((presented, time, incident)),
            Event::End { trials } if !self.sitting.is_over() || trials != presented => {
                return Err(LogProblem::Order("`end` does not follow the last trial"));
            }
            Event::End { .. } => self.complete = true,
        }
        Ok(())
    }

    fn replay(&mut self, event: TrialEvent) -> Result<(), LogProblem> {
        let number = event.trial.number;
        // The comparison is bit-exact, because a number in JSON keeps all digits.
        if self.sitting.next() != Some(event.trial) {
            return Err(LogProblem::Diverges { number });
        }
        let before = self.sitting.results().len();
        let verdict = self.sitting.answer(event.response, &event.exploration);
        let verdict = verdict.map_err(|cause| LogProblem::Answer { number, cause })?;
        if verdict != event.verdict {
            return Err(LogProblem::Diverges { number });
        }
        let track = self.sitting.results().get(before).copied();
        self.trials.push(TrialRecord { event, track });
        Ok(())
    }

    /// Restores the state before the last trial by a replay of all earlier answers.
    fn withdraw(&mut self, number: u32) -> Result<(), LogProblem> {
        const LAST: &str = "`withdrawn` names another trial than the last";
        let is_last = |last: &TrialRecord| last.event.trial.number == number;
        let last = self.trials.pop_if(|last| is_last(last)).ok_or(LogProblem::Order(LAST))?;
        self.withdrawn.push(last.event);
        self.sitting = Sitting::new(&self.begin.protocol, self.begin.seed, self.begin.subject);
        for TrialRecord { event, .. } in &self.trials {
            let answered = self.sitting.answer(event.response, &event.exploration);
            answered.map_err(|cause| LogProblem::Answer { number: event.trial.number, cause })?;
        }
        Ok(())
    }

    /// Returns true if the next trial was already answered and the answer withdrawn.
    #[must_use]
    pub fn is_answered_anew(&self) -> bool {
        let open = self.sitting.presented() + 1;
        self.withdrawn.last().is_some_and(|last| last.trial.number == open)
    }

    /// Returns the path of the log.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the results of the completed tracks.
    #[must_use]
    pub fn tracks(&self) -> &[TrackResult] {
        self.sitting.results()
    }

    /// Returns all trials with their answers, in order, for a replay.
    pub fn answers(&self) -> impl Iterator<Item = (Trial, Response)> {
        self.trials.iter().map(|record| (record.event.trial, record.event.response))
    }

    /// Adds a note of the experimenter, also to a complete sitting.
    ///
    /// # Errors
    /// If the log is in use or cannot be written.
    pub fn annotate(self, text: &str) -> Result<(), LogError> {
        self.writer()?.write(&Event::Note { text: text.to_owned() })
    }

    /// Opens the log for writing, with times of day for a person.
    fn writer(&self) -> Result<LogWriter, LogError> {
        let writer = LogWriter::append(&self.path, &self.end)?;
        Ok(if self.begin.is_of_a_person() { writer.stamped() } else { writer })
    }

    /// Returns the sitting at its next trial, and the log open for writing. Truncates an incomplete last line and logs the
    /// resumption. If a person's sitting was interrupted without a logged reason, logs [`Incident::Killed`].
    ///
    /// # Errors
    /// If the log is in use or cannot be written.
    pub fn resume(self, version: &str) -> Result<(Sitting, LogWriter), LogError> {
        let mut writer = self.writer()?;
        let trials = self.sitting.presented();
        if self.begin.is_of_a_person() && !self.has_reason_to_end {
            writer.write(&Event::Incident(Incident::Killed))?;
        }
        writer.write(&Event::Resume { trials, version: version.to_owned() })?;
        Ok((self.sitting, writer))
    }
}
