//! Power of a designed study, by simulation: how often each effect of the analysis of variance is found at 5 %.

use super::effects::DesignEffects;
use super::measure::MeasureKind;
use super::record::DesignRecord;
use flotor_study_design::answer::Reply;
use flotor_study_design::course::{Course, Handle, ReplyError, Session, Step};
use flotor_study_design::design::Design;
use flotor_study_design::observer::{Population, SimulatedObserver};
use flotor_study_design::subject::SubjectNumber;
use serde::Serialize;

/// Level of the tests.
const LEVEL: f64 = 0.05;

/// Power for one effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectPower {
    /// Names of the factors, joined by colons.
    pub effect: String,
    /// Share of the studies with p below 5 %, without a correction of sphericity.
    pub share: f64,
    /// Standard error of the share.
    pub standard_error: f64,
    /// Number of studies in which the effect could be tested.
    pub studies: usize,
}

/// Runs one session of a simulated subject.
///
/// # Errors
/// Never in practice: the simulated observer gives valid answers.
fn session_of(
    design: &Design,
    population: &Population,
    session: Session,
) -> Result<DesignRecord, ReplyError> {
    let mut course = Course::new(design, session);
    let observer = SimulatedObserver::new(population, session);
    let mut steps: Vec<(Step, Reply)> = Vec::new();
    while let Some(step) = course.next() {
        let reply = observer.respond(design, &step);
        course.answer(&reply, Handle::InRange)?;
        steps.push((step, reply));
    }
    Ok(DesignRecord::of_session(steps.iter().map(|(step, reply)| (step, reply)), &course))
}

/// Simulates a study of `subjects` people; returns effect and p-value of each effect that could be tested.
#[must_use]
pub fn study_of(design: &Design, population: &Population, subjects: u16, seed: u64) -> Vec<(String, f64)> {
    let measure = MeasureKind::of(design);
    let mut rows: Vec<(DesignRecord, Vec<f64>)> = Vec::new();
    for subject in (1..=subjects).filter_map(SubjectNumber::new) {
        let sessions = (1..=design.blocks().sessions)
            .filter_map(|session| session_of(design, population, Session { seed, subject, session }).ok());
        let Some(record) = sessions.reduce(|mut record, session| {
            record.add(session);
            record
        }) else {
            continue;
        };
        let conditions = record.conditions(design);
        let row: Result<Vec<f64>, _> =
            conditions.iter().map(|condition| measure.value(&record, condition)).collect();
        if let Ok(row) = row {
            rows.push((record, row));
        }
    }
    let rows: Vec<(&DesignRecord, Vec<f64>)> =
        rows.iter().map(|(record, row)| (record, row.clone())).collect();
    let effects = DesignEffects::of(design, &rows);
    let tested = effects.anova.tested().into_iter().flatten();
    tested.filter(|effect| effect.p.is_finite()).map(|effect| (effect.effect.clone(), effect.p)).collect()
}

/// Summarises simulated studies: how often each effect was found.
#[must_use]
pub fn power_of(studies: &[Vec<(String, f64)>]) -> Vec<EffectPower> {
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in studies.iter().flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let of = |name: &String| {
        let tested: Vec<f64> =
            studies.iter().flatten().filter(|(own, _)| own == name).map(|(_, p)| *p).collect();
        let n = tested.len() as f64;
        let share = tested.iter().filter(|p| **p < LEVEL).count() as f64 / n;
        EffectPower {
            effect: name.clone(),
            share,
            standard_error: (share * (1.0 - share) / n).sqrt(),
            studies: tested.len(),
        }
    };
    names.into_iter().map(of).collect()
}
