//! Event log of one session of a designed study.

use crate::log::lines::{LogEnd, read_lines};
use crate::log::{
    Incident, InputFile, LogError, LogProblem, LogWriter, LoggedEvent, ObserverKind, Person, Plan, another,
};
use crate::time_of_day::TimeOfDay;
use crate::trial::Exploration;
use flotor_study_design::answer::Reply;
use flotor_study_design::course::{Course, Handle, Session, Step};
use flotor_study_design::design::Design;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Revision of the format.
pub const FORMAT: u32 = 1;

/// Event of a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// First line: all inputs needed to repeat the session.
    Begin(Box<Begin>),
    /// A step was presented and answered.
    Step(Box<StepEvent>),
    /// The session was resumed after an interruption.
    Resume {
        /// Number of repeated steps.
        steps: u32,
        /// Version of the program.
        version: String,
    },
    /// Note of the experimenter or the program.
    Note {
        /// Text of the note.
        text: String,
    },
    /// Interruption or disturbance.
    Incident(Incident),
    /// The session is complete.
    End {
        /// Number of steps.
        steps: u32,
    },
}

impl LoggedEvent for Event {
    fn is_begin(&self) -> bool {
        matches!(self, Self::Begin(_))
    }
}

/// First line of a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Begin {
    /// Revision of the format.
    pub designed: u32,
    /// Version of the program.
    pub version: String,
    /// Subject, session and seed.
    pub session: Session,
    /// Study file in use.
    pub plan: Plan,
    /// Design of the study.
    pub design: Design,
    /// Optional data on the person.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub person: Option<Person>,
    /// Observer with all parameters that affect the answers, as JSON; `"human"` for a person.
    pub observer: serde_json::Value,
    /// Apparatus with all settings that affect the stimuli, as JSON.
    pub apparatus: serde_json::Value,
    /// Files that determine the stimuli, with their hashes.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub inputs: Vec<InputFile>,
}

impl Begin {
    /// Describes the first difference from an earlier session's configuration; `None` if they are equal. Subject, person, session,
    /// version and input files may differ.
    #[must_use]
    pub fn differs(&self, earlier: &Self) -> Option<String> {
        let seeds = (self.session.seed, earlier.session.seed);
        let what = Plan::differs(Some(&self.plan), Some(&earlier.plan))
            .or_else(|| another("design", &earlier.design, &self.design))
            .or_else(|| (seeds.0 != seeds.1).then(|| format!("--seed {}, not {}", seeds.1, seeds.0)))
            .or_else(|| another("observer", &earlier.observer, &self.observer))
            .or_else(|| another("apparatus", &earlier.apparatus, &self.apparatus));
        what.map(|what| format!("begun with {what}"))
    }

    /// Returns the origin of the answers.
    #[must_use]
    pub fn observer_kind(&self) -> ObserverKind {
        if self.is_of_a_person() { ObserverKind::Human } else { ObserverKind::Simulated }
    }

    /// Returns true for the session of a person; its events have times of day.
    #[must_use]
    pub fn is_of_a_person(&self) -> bool {
        self.observer == serde_json::json!("human")
    }
}

/// Step with its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepEvent {
    /// Presented step.
    pub step: Step,
    /// Answer of the subject.
    pub reply: Reply,
    /// Measurements during the presentation; `None` for a step without stimuli.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub exploration: Option<Exploration>,
}

impl StepEvent {
    /// Returns the state of the handle during the step.
    #[must_use]
    pub fn handle(&self) -> Handle {
        match &self.exploration {
            Some(exploration) if exploration.boundary_hit => Handle::LeftRange,
            _ => Handle::InRange,
        }
    }
}

/// Verified log.
pub struct DesignedLog {
    /// First line of the log.
    pub begin: Begin,
    /// Steps in order of presentation.
    pub steps: Vec<StepEvent>,
    /// Notes, each with the number of steps before it.
    pub notes: Vec<(u32, String)>,
    /// Interruptions and disturbances, each with the number of steps before it.
    pub incidents: Vec<(u32, Incident)>,
    /// Start of the session; `None` for simulated observers.
    pub began: Option<TimeOfDay>,
    /// True if the session is complete.
    pub complete: bool,
    /// Number of times the session was resumed.
    pub resumed: u32,
    /// True if the last event, notes aside, explains the end or interruption of the session.
    has_reason_to_end: bool,
    course: Course,
    path: PathBuf,
    end: LogEnd,
}

impl DesignedLog {
    /// Reads a log, checks its chain, and repeats the course: every step must follow.
    ///
    /// # Errors
    /// [`LogError`] with line and reason.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let mut log: Option<Self> = None;
        let end = read_lines(path, |event: Event, time| match (&mut log, event) {
            (None, Event::Begin(begin)) => {
                if begin.designed != FORMAT {
                    return Err(LogProblem::Format { found: begin.designed });
                }
                log = Some(Self::new(*begin, time, path));
                Ok(())
            }
            (None, _) => Err(LogProblem::Order("the log does not start with `begin`")),
            (Some(log), event) => log.take_in(event),
        })?;
        let empty = || LogError { path: path.into(), line: 0, problem: LogProblem::Empty };
        let mut log = log.ok_or_else(empty)?;
        log.end = end;
        Ok(log)
    }

    fn new(begin: Begin, began: Option<TimeOfDay>, path: &Path) -> Self {
        let course = Course::new(&begin.design, begin.session);
        Self {
            begin,
            steps: Vec::new(),
            notes: Vec::new(),
            incidents: Vec::new(),
            began,
            complete: false,
            resumed: 0,
            has_reason_to_end: false,
            course,
            path: path.into(),
            end: LogEnd::default(),
        }
    }

    fn take_in(&mut self, event: Event) -> Result<(), LogProblem> {
        if self.complete && !matches!(event, Event::Note { .. }) {
            return Err(LogProblem::Order("an event other than a note follows `end`"));
        }
        if !matches!(event, Event::Note { .. }) {
            self.has_reason_to_end =
                matches!(&event, Event::Incident(incident) if incident.ends_the_sitting());
        }
        let before = self.count();
        match event {
            Event::Begin(_) => return Err(LogProblem::Order("a second `begin` is in the log")),
            Event::Step(event) => self.repeat(*event)?,
            Event::Resume { steps, .. } if steps != before => {
                return Err(LogProblem::Order("`resume` has another number of steps than the log"));
            }
            Event::Resume { .. } => self.resumed += 1,
            Event::Note { text } => self.notes.push((before, text)),
            Event::Incident(incident) => self.incidents.push((before, incident)),
            Event::End { steps } if !self.course.is_over() || steps != before => {
                return Err(LogProblem::Order("`end` does not follow the last step"));
            }
            Event::End { .. } => self.complete = true,
        }
        Ok(())
    }

    fn repeat(&mut self, event: StepEvent) -> Result<(), LogProblem> {
        let number = self.count() + 1;
        // The comparison is bit-exact, because a number in JSON keeps all digits.
        let follows = self.course.next().as_ref() == Some(&event.step)
            && self.course.answer(&event.reply, event.handle()).is_ok();
        if !follows {
            return Err(LogProblem::OtherStep { number });
        }
        self.steps.push(event);
        Ok(())
    }

    fn count(&self) -> u32 {
        u32::try_from(self.steps.len()).unwrap_or(u32::MAX)
    }

    /// Returns the path of the log.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the course at its next step.
    #[must_use]
    pub fn course(&self) -> &Course {
        &self.course
    }

    /// Adds a note of the experimenter, also to a complete session.
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

    /// Returns the course at its next step, and the log open for writing. Truncates an incomplete last line and logs the
    /// resumption. If a person's session was interrupted without a logged reason, logs [`Incident::Killed`].
    ///
    /// # Errors
    /// If the log is in use or cannot be written.
    pub fn resume(self, version: &str) -> Result<(Course, LogWriter), LogError> {
        let mut writer = self.writer()?;
        if self.begin.is_of_a_person() && !self.has_reason_to_end {
            writer.write(&Event::Incident(Incident::Killed))?;
        }
        writer.write(&Event::Resume { steps: self.count(), version: version.to_owned() })?;
        Ok((self.course, writer))
    }
}
