//! Answers of a subject of a designed study, over all sessions.

use flotor_study::designed::DesignedLog;
use flotor_study_design::answer::Reply;
use flotor_study_design::course::{Course, Phase, Step, TrackResult, Trial};
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::factor::Vary;
use flotor_study_design::subject::SubjectNumber;

/// Counted trial with its answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Answered {
    /// Trial.
    pub trial: Trial,
    /// Answer.
    pub reply: Reply,
}

/// Answers of a subject.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignRecord {
    /// Number of the subject.
    pub subject: SubjectNumber,
    /// Counted trials, in order: no practice, and no trial that was presented again.
    pub trials: Vec<Answered>,
    /// Results of the completed tracks.
    pub tracks: Vec<TrackResult>,
}

impl DesignRecord {
    /// Returns the record of a session of a subject: its steps with their answers, and its course after them.
    pub fn of_session<'s>(steps: impl IntoIterator<Item = (&'s Step, &'s Reply)>, course: &Course) -> Self {
        let mut trials: Vec<Answered> = Vec::new();
        for (step, reply) in steps {
            let Step::Trial(trial) = step else { continue };
            // A repeat replaces the presentation before it.
            if trial.repeat > 0 {
                trials.pop_if(|last| last.trial.number + 1 == trial.number);
            }
            trials.push(Answered { trial: trial.clone(), reply: reply.clone() });
        }
        trials.retain(|answered| answered.trial.phase == Phase::Main);
        Self { subject: course.session().subject, trials, tracks: course.results().to_vec() }
    }

    /// Returns the records of all subjects from their logs: the sessions of a subject together.
    #[must_use]
    pub fn of_logs(logs: &[DesignedLog]) -> Vec<Self> {
        let mut records: Vec<Self> = Vec::new();
        for log in logs {
            let steps = log.steps.iter().map(|event| (&event.step, &event.reply));
            let session = Self::of_session(steps, log.course());
            match records.iter_mut().find(|record| record.subject == session.subject) {
                Some(record) => record.add(session),
                None => records.push(session),
            }
        }
        records
    }

    /// Adds another session of the same subject.
    pub fn add(&mut self, session: Self) {
        self.trials.extend(session.trials);
        self.tracks.extend(session.tracks);
    }

    /// Returns the conditions of this subject: all combinations of the factors within subjects, the last one varying fastest, with the
    /// subject's levels of the others. Empty without any answer.
    #[must_use]
    pub fn conditions(&self, design: &Design) -> Vec<Condition> {
        let Some(own) = self.trials.first().map(|answered| &answered.trial.condition) else {
            return Vec::new();
        };
        let is_within = |name: &String| {
            design.factors().iter().any(|factor| factor.name == *name && factor.vary == Vary::Within)
        };
        let fixed: Condition = own
            .iter()
            .filter(|(name, _)| !is_within(name))
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        let within = design.within_conditions();
        within.into_iter().map(|condition| condition.into_iter().chain(fixed.clone()).collect()).collect()
    }

    /// Returns the counted trials in a condition.
    pub fn in_condition<'a>(&'a self, condition: &'a Condition) -> impl Iterator<Item = &'a Answered> {
        self.trials.iter().filter(move |answered| answered.trial.condition == *condition)
    }
}
