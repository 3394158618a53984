//! `flotor study check`: what a study file does, without a person.

mod report;
mod rows;
mod tally;

use super::design_file::DesignFile;
use super::plan::file_and_text;
use clap::Args;
use flotor_analysis::designed::{EffectPower, power_of, study_of};
use flotor_command::options::{JsonOption, count, duration_s};
use flotor_command::{CommandError, print_result, progress_bar, write_text};
use flotor_study::protocol::SubjectNumber;
use flotor_study_design::course::{Course, Handle, Phase, Session, Step, Trial};
use flotor_study_design::design::Design;
use flotor_study_design::observer::SimulatedObserver;
use flotor_study_design::value::Setting;
use rayon::prelude::*;
use report::{Check, picture, to_text};
use rows::{BlockRow, SessionRow};
use std::path::PathBuf;
use tally::Tally;

#[derive(Args)]
#[command(
    after_help = "Every subject of the file is simulated with the table [simulated]: the schedule is that of a person, the number of \
    trials of an adaptive method that of these observers. The power is the share of simulated studies in which the analysis of \
    variance finds an effect at 5 %.\n\n\
    Examples:\n  \
    flotor study check delay.study.toml\n  \
    flotor study check delay.study.toml --plot schedule.svg --runs 1000\n  \
    flotor study check jnd"
)]
pub(super) struct CheckArguments {
    /// Study file with a design (default: the only NAME.study.toml in this folder)
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// Number of simulated studies for the power analysis; 0: no power analysis
    #[arg(long, default_value_t = 200, value_parser = count(0..=100_000_u32), value_name = "N")]
    runs: u32,
    /// Number of subjects (default: that of the file, or 16)
    #[arg(long, value_parser = count(1..=SubjectNumber::MOST), value_name = "N")]
    subjects: Option<u16>,
    /// Time for each interval of a trial, its answer included
    #[arg(long, default_value = "8s", value_parser = duration_s, value_name = "TIME")]
    interval_time: f64,
    /// Time for each item of a questionnaire
    #[arg(long, default_value = "10s", value_parser = duration_s, value_name = "TIME")]
    item_time: f64,
    /// Time for each rest
    #[arg(long, default_value = "60s", value_parser = duration_s, value_name = "TIME")]
    rest_time: f64,
    /// Write a picture of the schedule
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

pub(super) fn run(arguments: &CheckArguments) -> Result<(), CommandError> {
    let (file, text) = file_and_text(arguments.file.clone())?;
    if !DesignFile::is_in(&text) {
        return Err(CommandError::Usage(format!(
            "{}: the file names a protocol, not a design; `flotor study power` and `flotor study run {0}` are for protocols",
            file.display()
        )));
    }
    let study = DesignFile::read(&file, &text)?;
    let option = |name: &str| study.option(name).and_then(|value| u64::try_from(value).ok());
    let subjects = arguments.subjects.or(option("subjects").and_then(|count| u16::try_from(count).ok()));
    let (subjects, seed) = (subjects.unwrap_or(16), option("seed").unwrap_or(1));
    let mut tally = Tally::default();
    let mut sessions = Vec::new();
    let mut sees = Vec::new();
    for subject in (1..=subjects).filter_map(SubjectNumber::new) {
        for session in 1..=study.design.blocks().sessions {
            let session = Session { seed, subject, session };
            sessions.push(walk(arguments, &study, session, &mut tally, &mut sees));
        }
    }
    let check = Check {
        study: study.design.study().to_owned(),
        title: study.title.clone(),
        subjects,
        sessions,
        balance: tally.balance(&study.design),
        sees,
        power: power(arguments, &study, subjects, seed),
    };
    write_text(arguments.plot.as_deref(), || picture(&check, &study.design).to_svg())?;
    print_result(arguments.json.file(), &check, || to_text(&check))
}

/// Number of steps of the first subject that are shown.
const SHOWN: usize = 12;

/// Walks through a session of a simulated subject.
fn walk(
    arguments: &CheckArguments,
    study: &DesignFile,
    session: Session,
    tally: &mut Tally,
    sees: &mut Vec<String>,
) -> SessionRow {
    let design = &study.design;
    let mut course = Course::new(design, session);
    let observer = SimulatedObserver::new(&study.population, session);
    let mut row = SessionRow {
        subject: session.subject.to_string(),
        session: session.session,
        blocks: Vec::new(),
        practice: 0,
        trials: 0,
        rests: 0,
        questionnaires: 0,
        minutes: 0.0,
    };
    let mut block = 0;
    let is_first = session.subject.get() == 1 && session.session == 1;
    while let Some(step) = course.next() {
        if is_first && sees.len() < SHOWN {
            sees.push(step_text(design, &course, &step));
        }
        let before = row.minutes;
        match &step {
            Step::Trial(trial) => {
                row.minutes += arguments.interval_time * design.task().intervals() as f64 / 60.0;
                match trial.phase {
                    Phase::Practice => row.practice += 1,
                    Phase::Main => {
                        row.trials += 1;
                        tally.pair(trial.comparison_at);
                        if trial.block != block {
                            block = trial.block;
                            let condition = block_text(design, trial);
                            row.blocks.push(BlockRow { condition, from_minute: before, to_minute: before });
                        }
                    }
                }
            }
            Step::Form { questionnaire, .. } => {
                let items = design.questionnaires().get(*questionnaire).map_or(0, |form| form.items.len());
                row.minutes += arguments.item_time * items as f64 / 60.0;
                row.questionnaires += 1;
            }
            Step::Rest { .. } => {
                row.minutes += arguments.rest_time / 60.0;
                row.rests += 1;
            }
        }
        if let (Some(last), Step::Trial(_) | Step::Rest { .. }) = (row.blocks.last_mut(), &step) {
            last.to_minute = row.minutes;
        }
        // The observer gives valid answers: an error would be one of the program, and ends the walk.
        if course.answer(&observer.respond(design, &step), Handle::InRange).is_err() {
            break;
        }
        if let Step::Trial(trial) = &step {
            tally.group(session, design, &trial.condition);
        }
    }
    tally.blocks(&row.blocks);
    row
}

fn power(arguments: &CheckArguments, study: &DesignFile, subjects: u16, seed: u64) -> Vec<EffectPower> {
    if arguments.runs == 0 {
        return Vec::new();
    }
    let progress = progress_bar(u64::from(arguments.runs), "{percent:>3} %  {elapsed}");
    let one = |run: u32| {
        let seed = seed.wrapping_mul(1_000_003).wrapping_add(u64::from(run) + 1);
        progress.inc(1);
        study_of(&study.design, &study.population, subjects, seed)
    };
    let studies: Vec<_> = (0..arguments.runs).into_par_iter().map(one).collect();
    progress.finish_and_clear();
    power_of(&studies)
}

/// Describes a step as the person sees it.
fn step_text(design: &Design, course: &Course, step: &Step) -> String {
    match step {
        Step::Rest { .. } => "rest".to_owned(),
        Step::Form { questionnaire, .. } => {
            let form = design.questionnaires().get(*questionnaire);
            form.map_or(String::new(), |form| {
                format!("questionnaire {} ({} items)", form.title, form.items.len())
            })
        }
        Step::Trial(trial) => {
            let phase = if trial.phase == Phase::Practice { "practice  " } else { "" };
            let intervals: Vec<String> = course
                .settings(trial)
                .iter()
                .map(|settings| {
                    let shown = settings.iter().filter(|(setting, _)| *setting != Setting::Picture);
                    shown.map(|(setting, value)| format!("{setting} {value}")).collect::<Vec<_>>().join(", ")
                })
                .collect();
            let question = &design.task().question;
            let question = if question.is_empty() { design.task().word() } else { question };
            format!("{phase}{}  -> {question}", intervals.join("  |  "))
        }
    }
}

/// Names the condition of a block: levels of the factors that are constant in it.
fn block_text(design: &Design, trial: &Trial) -> String {
    let by = &design.blocks().by;
    let levels = trial.condition.iter().filter(|(name, _)| by.contains(name));
    let text: Vec<String> = levels.map(|(name, value)| format!("{name} {value}")).collect();
    if text.is_empty() { "all".to_owned() } else { text.join(", ") }
}
